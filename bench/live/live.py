#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Long live runs: live.py [window] [soak] [swaps] [faults] [--quick] [--minutes=10]

window 10 minutes each of the scenes demo (with `live.target_fps`) and optix-cs at 30 frames per second, 640x480, with a
       window (on Xvfb), on two cores. The video is a film, as a camera takes no CPU time to draw its picture. Targets: no
       frame lost, p99 of the latency at most two frame times, 12 ms with optix-cs. --minutes: this run only, but longer
       or shorter.
soak   30 minutes at 30 frames per second, 640x480, scene optix-cs, a window (on Xvfb) and a web page with two viewers.
       Targets: no frame lost, p99 of the latency at most two frame times, and no process that grows: the growth of its
       resident memory over the last 20 minutes, from a linear fit, is below the fit's uncertainty or 64 KiB.
swaps  tracker and ray tracer are replaced every second for 10 minutes at 30 frames per second; first by arhost's plugins,
       then by plugins whose overlays contain the number of their frame. Targets: no frame lost, no frame without overlay,
       no overlay of another frame, no growth of the host.
faults 30 minutes at 30 frames per second, 640x480: every 30 seconds, a worker that is chosen at random is killed or
       stopped. Two viewers, a recording, a session and the poses. Targets: all poses as in an undisturbed run (to 1e-6 mm:
       after a lost frame, the tracker starts from an older pose), every output readable, no file or process left, and
       no time without composited frames longer than the deadline of a hang and 2.5 s: a source that starts again decodes
       up to ten seconds of its film.

--quick: a minute, as a smoke test. Writes build/live/."""
import contextlib
import json
import os
import pathlib
import random
import shutil
import signal
import socket
import statistics
import subprocess
import sys
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench"))
from processes import children, name_of  # noqa: E402

BUILD = ROOT / "build/release"
OUT = ROOT / "build/live"
QUICK = "--quick" in sys.argv
MINUTES = next((float(word.partition("=")[2]) for word in sys.argv if word.startswith("--minutes=")), None)
FPS = 30
FILM_FRAMES = 10 * FPS  # one round of the camera path of source_synthetic
missed = []


def check(what, value, target):
    print(f"  {what}: {value:.4g} (target {target:.4g})")
    if value > target:
        missed.append(what)


def resident_kib(pid):
    for line in pathlib.Path(f"/proc/{pid}/status").read_text(encoding="utf-8").splitlines():
        if line.startswith("VmRSS:"):
            return int(line.split()[1])
    return 0


class Run:
    """A running arhost in its own folder, with the output sink_control."""

    def __init__(self, name, configuration, environment=None):
        self.folder = OUT / name
        shutil.rmtree(self.folder, ignore_errors=True)
        self.folder.mkdir(parents=True)
        (self.folder / "run.yaml").write_text(configuration, encoding="utf-8")
        runtime = self.folder / "runtime"
        runtime.mkdir()
        self.log = open(self.folder / "log.txt", "w", encoding="utf-8")
        self.process = subprocess.Popen(
            [BUILD / "bin/arhost", "run.yaml"], cwd=self.folder, stderr=self.log,
            env=os.environ | {"XDG_RUNTIME_DIR": str(runtime), "ARHOST_PLUGIN_PATH": str(BUILD / "tests/plugins")} | (environment or {}))
        path = str(runtime / "arhost/arhost.sock")
        while True:
            self.expect_running()
            self.socket = socket.socket(socket.AF_UNIX)
            try:
                # The path may be longer than an address can be.
                with contextlib.chdir(runtime):
                    self.socket.connect(os.path.relpath(path, runtime))
                break
            except OSError:
                self.socket.close()
                time.sleep(0.05)
        self.answers = self.socket.makefile(encoding="utf-8")

    def expect_running(self):
        if self.process.poll() is not None:
            raise SystemExit(f"arhost has ended: {(self.folder / 'log.txt').read_text(encoding='utf-8')}")

    def command(self, **command):
        self.socket.sendall(json.dumps(command).encode() + b"\n")
        answer = json.loads(self.answers.readline())
        if not answer["ok"]:
            raise SystemExit(f"{command}: {answer['error']}")
        return answer

    def processes(self):
        """The pids of host, launcher and workers, by name."""
        found = {"arhost": self.process.pid}
        for launcher in children(self.process.pid):
            found["launcher"] = launcher
            for worker in children(launcher):
                name = name_of(worker)
                if name == "arhost-init":  # the first process of a worker's PID namespace
                    continue
                found[name] = worker
        return found

    def end(self):
        self.process.send_signal(signal.SIGINT)
        self.process.wait(timeout=60)
        self.log.close()
        return json.loads((self.folder / "stats.json").read_text(encoding="utf-8"))


class Viewer(threading.Thread):
    """Reads the web page's stream as a browser does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.frames = 0
        self.socket = socket.create_connection(("127.0.0.1", port))
        self.socket.sendall(f"GET /stream.mjpg HTTP/1.1\r\nHost: 127.0.0.1:{port}\r\n\r\n".encode())
        self.start()

    def run(self):
        tail = b""
        while data := self.socket.recv(1 << 20):
            self.frames += (tail + data).count(b"\xff\xd8\xff")  # the first bytes of a JPEG file
            tail = data[-2:]


def free_port():
    with socket.create_server(("127.0.0.1", 0)) as free:
        return free.getsockname()[1]


def growth_kib(samples, seconds):
    """Growth over the last `seconds`, from a linear fit, and the fit's uncertainty (two standard errors), in KiB."""
    last = [(at, kib) for at, kib in samples if at >= samples[-1][0] - seconds]
    slope, begin = statistics.linear_regression(*zip(*last))
    mean = statistics.fmean(at for at, _ in last)
    residuals = sum((kib - begin - slope * at) ** 2 for at, kib in last)
    error = (residuals / (len(last) - 2) / sum((at - mean) ** 2 for at, _ in last)) ** 0.5
    return slope * seconds, 2 * error * seconds


def lost(stats, *outputs):
    """The number of frames that were dropped before compositing, and by these outputs."""
    return sum(count for what, count in stats["frames"]["dropped"].items()
               if what in ("source", "tracker", "raytracer", "late", "output", *outputs))


@contextlib.contextmanager
def x_server():
    read, write = os.pipe()
    server = subprocess.Popen(["Xvfb", "-displayfd", str(write), "-screen", "0", "800x600x24", "-nolisten", "tcp"],
                              pass_fds=[write], stderr=subprocess.DEVNULL)
    os.close(write)
    try:
        yield ":" + os.read(read, 16).decode().strip()
    finally:
        server.kill()
        server.wait()


def film(folder):
    """Writes film.mkv, which shows the marker 0 of tag36h11, and can be repeated without a jump."""
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "film.yaml").write_text(f"""version: 1
source: {{plugin: source_synthetic, fps: {FPS}, options: {{frames: {FILM_FRAMES}, width: 640, height: 480}}}}
outputs: [{{plugin: sink_video, path: film.mkv}}]
""", encoding="utf-8")
    subprocess.run([BUILD / "bin/arhost", "film.yaml"], cwd=folder, check=True, stderr=subprocess.DEVNULL)


def check_frames(stats, *outputs):
    """Checks that all frames have an overlay and are not late."""
    frames = stats["frames"]
    check("frames lost", lost(stats, *outputs), 0)
    check("frames without overlay", frames["composited"] - frames["augmented"], 0)
    check("p99 of the latency until composited, ms", stats["stages"]["latency"]["p99_ms"], 2000 / FPS)
    for output in outputs:
        check(f"p99 of the latency until {output} has the frame, ms", stats["latency"]["outputs"][output]["p99_ms"], 2000 / FPS)


def window():
    minutes = MINUTES or (1 if QUICK else 10)
    os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:2])
    film(OUT / "film")
    for scene in "demo", "optix-cs":
        with x_server() as display:
            run = Run(f"window-{scene}", f"""version: 1
mode: live
source: {{plugin: source_file, path: ../film/film.mkv, options: {{loop: true}}}}
camera: {{width: 640, height: 480, fx: 600}}
tracker: {{plugin: tracker_aruco, targets: [{{marker: 0, family: tag36h11, side_mm: 80}}]}}
raytracer: {{plugin: rt_embree, scene: {scene}}}
live: {{target_fps: {FPS}}}
outputs:
  - {{plugin: sink_window, allow: [display]}}
  - {{plugin: sink_control, allow: [listen], control: [status]}}
stats: stats.json
""", {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"})
            end = time.monotonic() + 60 * minutes
            while (left := end - time.monotonic()) > 0:
                run.expect_running()
                time.sleep(min(1, left))
            stats = run.end()
        frames = stats["frames"]
        medians = ", ".join(f"{name} {stage['p50_ms']:.1f}" for name, stage in stats["stages"].items())
        print(f"window: {minutes:g} minutes, 640x480 at {FPS} fps, {scene}, load average {os.getloadavg()[0]:.1f}\n"
              f"  {frames['in']} frames in, {frames['composited']} composited, dropped {frames['dropped']}, quality at the "
              f"end {stats['quality']}\n  p50 in ms: {medians}")
        check_frames(stats, "sink_window")
        if scene == "optix-cs":
            check("p99 of the latency until composited with optix-cs, ms", stats["stages"]["latency"]["p99_ms"], 12)
        print(flush=True)


def soak():
    seconds, settled = (60, 40) if QUICK else (1800, 1200)
    port = free_port()
    configuration = f"""version: 1
mode: live
source: {{plugin: source_synthetic, fps: {FPS}, options: {{frames: 0, id: 0, side_mm: 80, width: 640, height: 480}}}}
tracker: {{plugin: tracker_aruco, targets: [{{marker: 0, family: tag36h11, side_mm: 80}}]}}
raytracer: {{plugin: rt_embree, scene: optix-cs}}
outputs:
  - {{plugin: sink_window, allow: [display], control: [status]}}
  - {{plugin: sink_web, allow: [listen], options: {{listen: "127.0.0.1:{port}"}}, control: [status]}}
  - {{plugin: sink_control, allow: [listen], control: [status]}}
stats: stats.json
"""
    with x_server() as display:
        run = Run("soak", configuration, {"DISPLAY": display, "LIBGL_ALWAYS_SOFTWARE": "1"})
        while run.command(command="status")["status"]["frames"]["composited"] == 0:
            time.sleep(0.1)
        viewers = [Viewer(port), Viewer(port)]
        processes = run.processes()
        memory = {name: [] for name in processes}
        begin = time.monotonic()
        while (now := time.monotonic() - begin) < seconds:
            run.expect_running()
            for name, pid in processes.items():
                memory[name].append((now, resident_kib(pid)))
            if sys.stderr.isatty():
                print(f"\r{now / 60:.1f} of {seconds / 60:.0f} min", end="", file=sys.stderr, flush=True)
            time.sleep(2 if QUICK else 10)
        stats = run.end()
    print(f"\nsoak: {seconds / 60:.0f} minutes, 640x480 at {FPS} fps, optix-cs, window and web page with two viewers")
    frames = stats["frames"]
    print(f"  {frames['in']} frames in, {frames['composited']} composited, {frames['augmented']} with overlay; "
          f"the viewers got {[viewer.frames for viewer in viewers]}; restarts {stats['restarts']}")
    check_frames(stats, "sink_window", "sink_web")
    for name, samples in memory.items():
        growth, uncertainty = growth_kib(samples, settled)
        check(f"growth of {name} ({samples[-1][1] / 1024:.1f} MiB), KiB", growth, max(uncertainty, 64))
    (OUT / "soak/memory.json").write_text(json.dumps(memory), encoding="utf-8")


def swap_run(name, configuration, choices, seconds):
    """Replaces tracker and ray tracer every second. Returns the statistics."""
    run = Run(name, configuration)
    while run.command(command="status")["status"]["frames"]["composited"] < FPS:
        time.sleep(0.1)
    samples, descriptors = [], []
    begin = time.monotonic()
    for second in range(seconds):
        for component in ("tracker", "raytracer"):
            run.command(command="swap", component=component, plugin=choices[component][second % 2])
        samples.append((time.monotonic() - begin, resident_kib(run.process.pid)))
        descriptors.append(len(os.listdir(f"/proc/{run.process.pid}/fd")))
        time.sleep(max(0, begin + second + 1 - time.monotonic()))
    time.sleep(2)  # until the replaced workers have ended
    processes = len(run.processes())
    stats = run.end()
    print(f"  {name}: {2 * seconds} swaps in {seconds} s, {stats['frames']['in']} frames")
    check("frames lost", lost(stats), 0)
    check("frames without overlay", stats["frames"]["composited"] - stats["frames"]["augmented"], 0)
    growth, uncertainty = growth_kib(samples, seconds * 2 / 3)
    check("growth of the host, KiB", growth, max(uncertainty, 64))
    half = len(descriptors) // 2
    check("additional descriptors of the host in the second half", max(descriptors[half:]) - max(descriptors[:half]), 0)
    check("processes at the end", processes, 7)
    return run


def swaps():
    seconds = 30 if QUICK else 600
    print(f"swaps: tracker and ray tracer every second, {FPS} fps")
    swap_run("own plugins", f"""version: 1
mode: live
source: {{plugin: source_synthetic, fps: {FPS}, options: {{frames: 0, id: 0, side_mm: 80, width: 640, height: 480}}}}
tracker: {{plugin: tracker_aruco, targets: [{{marker: 0, family: tag36h11, side_mm: 80}}]}}
raytracer: {{plugin: rt_embree, scene: optix-cs}}
alternatives:
  tracker: [{{plugin: tracker_apriltag}}]
  raytracer: [{{name: bright, plugin: rt_embree}}]
outputs:
  - {{plugin: sink_null}}
  - {{plugin: sink_control, allow: [listen], control: [status, swap]}}
stats: stats.json
""", {"tracker": ("tracker_apriltag", "tracker_aruco"), "raytracer": ("bright", "rt_embree")}, seconds)
    run = swap_run("counting plugins", f"""version: 1
mode: live
source: {{plugin: source_counter, fps: {FPS}, options: {{frames: 1000000}}}}
tracker: {{plugin: tracker_counter, targets: [{{marker: 3, family: tag36h11, side_mm: 80}}]}}
raytracer: {{plugin: rt_counter, scene: optix-cs}}
alternatives:
  tracker: [{{name: second, plugin: tracker_counter}}]
  raytracer: [{{name: second, plugin: rt_counter}}]
outputs:
  - {{plugin: sink_counter, path: counted.txt}}
  - {{plugin: sink_control, allow: [listen], control: [status, swap]}}
stats: stats.json
""", {"tracker": ("second", "tracker_counter"), "raytracer": ("second", "rt_counter")}, seconds)
    lines = [line.split() for line in (run.folder / "counted.txt").read_text(encoding="utf-8").splitlines()]
    check("overlays of another frame", sum(not frame == video == overlay for frame, video, overlay, _ in lines), 0)


def longest_pause(run, seconds):
    """The longest time without a further composited frame during the next `seconds`, or until one has come since."""
    begin = last = time.monotonic()
    frames, longest = -1, 0
    while (now := time.monotonic()) < begin + seconds or last < begin + seconds and now < begin + 60:
        composited = run.command(command="status")["status"]["frames"]["composited"]
        if composited != frames:
            frames, longest, last = composited, max(longest, now - last), now
        time.sleep(0.01)
    return longest if last >= begin + seconds else now - last


def pose_by_capture(path):
    """The poses of the world in a file of sink_poses, by capture time."""
    poses = {}
    with open(path, encoding="utf-8") as file:
        for line in file:
            record = json.loads(line)
            found = [target["mt"] for target in record["targets"] if target["state"] == "detected"]
            if found:
                poses.setdefault(record["capture_ns"], []).append(found[0])
    return poses


def faults():
    """Kills and stops of workers during a live run."""
    seconds, interval, deadline_s = (60, 6, 2) if QUICK else (1800, 30, 2)
    reference = OUT / "reference"
    film(reference)
    tracker = "tracker: {plugin: tracker_apriltag, targets: [{marker: 0, family: tag36h11, side_mm: 80}]}"
    (reference / "poses.yaml").write_text(f"""version: 1
source: {{plugin: source_file, path: film.mkv}}
camera: {{width: 640, height: 480, fx: 600}}
{tracker}
outputs: [{{plugin: sink_poses, path: poses.jsonl}}]
""", encoding="utf-8")
    subprocess.run([BUILD / "bin/arhost", "poses.yaml"], cwd=reference, check=True, stderr=subprocess.DEVNULL)
    expected = {at: poses[0] for at, poses in pose_by_capture(reference / "poses.jsonl").items()}

    port = free_port()
    limits = f"deadline_ms: {1000 * deadline_s}"
    run = Run("faults", f"""version: 1
mode: live
source: {{plugin: source_file, path: ../reference/film.mkv, {limits}, options: {{loop: true}}}}
camera: {{width: 640, height: 480, fx: 600}}
{tracker[:-1]}, {limits}}}
raytracer: {{plugin: rt_embree, scene: demo, {limits}}}
live: {{target_fps: {FPS}}}
outputs:
  - {{plugin: sink_web, allow: [listen], {limits}, options: {{listen: "127.0.0.1:{port}"}}, control: [status]}}
  - {{plugin: sink_control, allow: [listen], control: [status]}}
  - {{plugin: sink_video, path: film/recording.mkv, {limits}}}
  - {{plugin: sink_session, path: session, {limits}}}
  - {{plugin: sink_poses, path: poses/poses.jsonl, {limits}}}
stats: stats.json
""")
    rng = random.Random(1)
    victims = [name[:15] for name in ("source_file", "tracker_apriltag", "rt_embree", "sink_web", "sink_video",
                                      "sink_session", "sink_poses")]
    while run.command(command="status")["status"]["frames"]["composited"] < FPS:
        time.sleep(0.1)
    viewers = [Viewer(port), Viewer(port)]
    done, begin = [], time.monotonic()
    for number in range(seconds // interval):
        time.sleep(max(0, begin + (number + rng.uniform(0.2, 0.6)) * interval - time.monotonic()))
        run.expect_running()
        victim, kind = rng.choice(victims), rng.choice([signal.SIGKILL, signal.SIGSTOP])
        worker = run.processes().get(victim)
        if worker:
            os.kill(worker, kind)
            done.append((victim, kind.name, longest_pause(run, 2 * deadline_s)))
        viewers = [viewer if viewer.is_alive() else Viewer(port) for viewer in viewers]
        if sys.stderr.isatty():
            print(f"\r{number + 1} of {seconds // interval} faults", end="", file=sys.stderr, flush=True)
    time.sleep(interval / 2)
    load = os.getloadavg()
    stats = run.end()

    frames = stats["frames"]
    print(f"\nfaults: {len(done)} in {seconds / 60:.0f} minutes, 640x480 at {FPS} fps, load average {load[0]:.1f}: "
          f"{frames['in']} frames in, {frames['composited']} composited, {frames['augmented']} with overlay; restarts {stats['restarts']}")
    seen = pose_by_capture(run.folder / "poses/poses.jsonl")
    length_ns = max(expected) + 1e9 / FPS  # of the film, whose time stamps are rounded to ms
    by_frame = {round(at * FPS / 1e9): pose for at, pose in expected.items()}
    differences = [max(abs(a - b) for a, b in zip(by_frame[round(at % length_ns * FPS / 1e9) % FILM_FRAMES], pose))
                   for at, poses in seen.items() for pose in poses]
    print(f"  {len(differences)} poses, of which {sum(value == 0 for value in differences)} are identical to those of an undisturbed run")
    check("largest difference of an element of a pose (mm)", max(differences), 1e-6)
    print("  the longest time without frames, s, after each fault:")
    for victim in victims:
        for kind in ("SIGKILL", "SIGSTOP"):
            pauses = sorted(pause for name, signal_name, pause in done if (name, signal_name) == (victim, kind))
            if pauses:
                print(f"    {kind} of {victim}: {', '.join(f'{pause:.2f}' for pause in pauses)}")
    check("longest time without frames, s", max(pause for _, _, pause in done), deadline_s + 2.5)
    # The frames that may come while sink_video is stopped and starts again.
    allowed = FPS * sum((deadline_s if kind == "SIGSTOP" else 0) + 1 for name, kind, _ in done if name == "sink_video")
    recorded = int(subprocess.run(
        ["ffprobe", "-v", "error", "-select_streams", "v", "-count_packets", "-show_entries", "stream=nb_read_packets",
         "-of", "csv=p=0", run.folder / "film/recording.mkv"], check=True, capture_output=True, text=True).stdout)
    dropped = frames["composited"] - recorded
    print(f"  the recording has {recorded} frames; {dropped} were lost in the restarts of sink_video")
    check("frames that the recording lacks", dropped, allowed)
    check("frames that were recorded twice", -dropped, 0)
    replay = subprocess.run([BUILD / "bin/arhost", "replay", "session", "--frames", "300", "--output", "none"],
                            cwd=run.folder, capture_output=True, text=True)
    check("exit status of the session's replay", replay.returncode, 0)
    left = [str(path.relative_to(run.folder)) for path in run.folder.rglob(".*")]
    check("hidden files left", len(left), 0)
    check("processes left", sum(name_of(pid).startswith("arhost") for pid in children(os.getpid())), 0)


def main():
    names = [word for word in sys.argv[1:] if not word.startswith("--")]
    runs = {"window": window, "soak": soak, "swaps": swaps, "faults": faults}
    if any(name not in runs for name in names):
        raise SystemExit(__doc__)
    for name in names or (["window"] if MINUTES else runs):
        runs[name]()
    if missed:
        raise SystemExit("missed: " + "; ".join(missed))


main()
