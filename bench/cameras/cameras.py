#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""cameras.py ARHOST PROGRAMS [--quick]: CPU time per frame of the workers with source_v4l2 and source_uvc, compared with bare
capture loops (in the folder PROGRAMS) with the same copies. Captures from the kernel's virtual camera at /dev/video0 and from
a USB camera in user space. `tools/bench cameras` provides both in a virtual machine whose clock counts instructions
(tools/vm/run-in-vm -i), so that the times are numbers of executed instructions, in user space and in the kernel. Exits with
1 if a target is missed."""
import os
import signal
import subprocess
import sys
import tempfile
import time

sys.path.insert(0, os.path.join(os.path.dirname(os.path.abspath(__file__)), ".."))
from processes import children, name_of  # noqa: E402

target = 1.1
arhost, programs = sys.argv[1:3]
quick = "--quick" in sys.argv
frames = 25 if quick else 200
usb_mode = 640, 480, 25  # width, height, fps
v4l2_modes = [(640, 480, 25), (1280, 720, 12.5)]  # the virtual camera has these rates


def program(name):
    return os.path.join(programs, name)


def cpu_ns(pid):
    total = 0
    for task in os.listdir(f"/proc/{pid}/task"):
        with open(f"/proc/{pid}/task/{task}/schedstat", encoding="ascii") as file:
            total += int(file.read().split()[0])
    return total


def worker_instructions(plugin, source, fps):
    """Instructions per frame of the source's worker during a run, in thousands."""
    with tempfile.TemporaryDirectory() as folder:
        with open(os.path.join(folder, "run.yaml"), "w", encoding="utf-8") as file:
            file.write(f"version: 1\nmode: live\nsource: {source}\noutputs: [{{plugin: sink_null}}]\n")
        with subprocess.Popen([arhost, "run.yaml"], cwd=folder, stderr=subprocess.PIPE, text=True) as host:
            for line in host.stderr:
                if line.startswith("info: source: "):  # the stream has started
                    break
            else:
                sys.exit(f"the run with {plugin} has ended")
            worker = next(pid for launcher in children(host.pid) for pid in children(launcher) if name_of(pid) == plugin)
            time.sleep(30 / fps)  # all slots have been written
            begin_ns = cpu_ns(worker)
            time.sleep(frames / fps)
            end_ns = cpu_ns(worker)
            host.send_signal(signal.SIGINT)
    return (end_ns - begin_ns) / frames / 1000


def is_met(plugin, permissions, options, case, bare_loop):
    pixel_format, width, height, fps = case
    bare = 1e3 * float(subprocess.run([*bare_loop, pixel_format, str(width), str(height), str(fps), str(frames)],
                                      check=True, capture_output=True, text=True).stdout)
    worker = worker_instructions(plugin, f"{{plugin: {plugin}, {permissions}, fps: {fps}, "
                                 f"options: {{{options}width: {width}, height: {height}, format: {pixel_format}}}}}", fps)
    print(f"  {plugin}, {pixel_format} {width}x{height}, {fps} fps: worker {worker:.1f}, bare loop {bare:.1f}, "
          f"difference {worker - bare:.1f}, ratio {worker / bare:.3f} (target {target})", flush=True)
    return worker / bare <= target or quick


print("cameras: thousands of instructions per frame", flush=True)
met = [is_met("source_v4l2", "allow: [video]", "device: /dev/video0, ", (pixel_format, *mode),
              [program("bench-capture"), "/dev/video0"]) for mode in v4l2_modes for pixel_format in ("grey", "yuyv")]
with subprocess.Popen([program("bench-usb-camera"), *map(str, usb_mode)], stdin=subprocess.PIPE) as camera:
    while not os.path.exists("/dev/bus/usb/001/002"):
        if camera.poll() is not None:
            sys.exit("there is no USB camera")
        time.sleep(0.1)
    met += [is_met("source_uvc", "usb: {vendor: 1d6b, product: 0104}", "", (pixel_format, *usb_mode),
                   [program("bench-usb-capture")])
            for pixel_format in ("yuyv", "nv12", "mjpeg")]
    camera.stdin.close()
sys.exit(not all(met))
