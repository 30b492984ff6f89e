#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""cameras.py ARHOST BENCH-CAPTURE [--quick]: CPU time per frame of the worker with source_v4l2, compared with a bare capture
loop with the same copies. Captures from /dev/video0, which `tools/bench cameras` provides in a virtual machine. The worker's
time is the difference of two runs of different length, so that it excludes the start. Exits with 1 if a target is missed."""
import json
import os
import statistics
import subprocess
import sys
import tempfile

target = 1.1
arhost, bare_loop = sys.argv[1:3]
quick = "--quick" in sys.argv
width, height, fps = 640, 480, 25
short, frames, rounds = (15, 30, 1) if quick else (30, 300, 3)


def worker_cpu_ms(pixel_format, count, folder):
    with open(os.path.join(folder, "run.yaml"), "w", encoding="utf-8") as file:
        file.write(f"""version: 1
frames: {count}
source:
  plugin: source_v4l2
  allow: [video]
  fps: {fps}
  options: {{device: /dev/video0, width: {width}, height: {height}, format: {pixel_format}}}
outputs: [{{plugin: sink_null}}]
stats: stats.json
""")
    subprocess.run([arhost, "run.yaml"], cwd=folder, check=True, stderr=subprocess.DEVNULL)
    with open(os.path.join(folder, "stats.json"), encoding="utf-8") as file:
        return 1000 * json.load(file)["cpu_seconds"]["source"]


missed = False
print(f"cameras: CPU time per frame, {width}x{height}, {fps} fps, vivid, medians of {rounds}")
for pixel_format in ("grey", "yuyv"):
    workers, bare = [], []
    with tempfile.TemporaryDirectory() as folder:
        for _ in range(rounds):
            bare.append(float(subprocess.run(
                [bare_loop, "/dev/video0", pixel_format, str(width), str(height), str(fps), str(frames)],
                check=True, capture_output=True, text=True).stdout))
            workers.append((worker_cpu_ms(pixel_format, short + frames, folder) -
                            worker_cpu_ms(pixel_format, short, folder)) / frames)
    worker, loop = statistics.median(workers), statistics.median(bare)
    missed = missed or (worker / loop > target and not quick)
    print(f"  {pixel_format}: source_v4l2's worker {worker:.3f} ms, bare loop {loop:.3f} ms, ratio {worker / loop:.2f} "
          f"(target {target})")
sys.exit(missed)
