#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Compares rt_embree with Mitsuba 3 (llvm) and Blender Cycles: `tools/bench peers [--quick]`. Method:
bench/peers/README.md.

Writes build/peers/peers.json (all numbers) and build/peers/peers.png (the pictures side by side). Exits with 1 if the
pictures show that the scenes differ; missed targets are only reported."""
import glob
import importlib.metadata
import json
import os
import platform
import re
import shutil
import statistics
import subprocess
import sys
import time

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
venv = os.path.join(root, "build", "peers-venv")
folder = os.path.join(root, "build", "peers")
binaries = os.path.join(root, "build", "release", "bin")
venv_python = os.path.join(venv, "bin", "python")

threads = 2
# For Python 3.11 (Debian 12); bpy determines the numpy version.
packages = {"mitsuba": "3.9.1", "bpy": "5.0.1", "pillow": "11.3.0"}
llvm_package, oldest_llvm = "libllvm19", 16  # LLVM 14 and 15 abort on Sapphire Rapids
cases = ["diffuse", "mirror", "glass-path"]
ours_alone = "glass-tree"
# Required speed relative to the peer.
targets = {"mitsuba": {"diffuse": 3, "mirror": 3, "glass-path": 2, "glass-tree": 2},
           "cycles": {"diffuse": 8, "mirror": 8, "glass-path": 4, "glass-tree": 2}}
largest_mask_difference = 0.005


def newest_llvm(libraries):
    """(major version, path) of the newest LLVM library; (0, None) if there is none."""
    newest = (0, None)
    for path in libraries:
        named = re.fullmatch(r"libLLVM(?:-(\d+)[\d.]*)?\.so(?:\.(\d+)[\d.]*)?", os.path.basename(path))
        in_folder = re.search(r"/llvm-(\d+)/", path)
        if named:
            major = named[1] or (in_folder and in_folder[1]) or named[2] or "0"
            newest = max(newest, (int(major), path), key=lambda each: each[0])
    return newest


def find_llvm():
    return newest_llvm(glob.glob("/usr/lib/*/libLLVM*.so*") + glob.glob("/usr/lib/llvm-*/lib/libLLVM*.so*"))


def install_llvm():
    """Installs LLVM if there is none that can compile Mitsuba's kernels."""
    if find_llvm()[0] < oldest_llvm:
        print(f"Installing for Mitsuba with apt-get: {llvm_package}", flush=True)
        as_root = [] if os.geteuid() == 0 else ["sudo"] if shutil.which("sudo") else None
        if as_root is None:
            print(f"Neither root nor sudo available to install {llvm_package}: Mitsuba may fail.")
        else:
            subprocess.run([*as_root, "apt-get", "update", "-q"], check=False)
            subprocess.run([*as_root, "env", "DEBIAN_FRONTEND=noninteractive", "apt-get", "install", "-q", "-y",
                            "--no-install-recommends", llvm_package], check=False)


def install(wanted):
    """Installs packages (name: version, or None for any version) into build/peers-venv."""
    if not os.path.exists(venv_python):
        suitable = [path for path in (sys.executable, "/usr/bin/python3", shutil.which("python3.11"))
                    if path and subprocess.run([path, "-c", "import sys, ensurepip; sys.exit(sys.version_info[:2] != (3, 11))"],
                                              stderr=subprocess.DEVNULL, check=False).returncode == 0]
        if not suitable:
            raise SystemExit("peers: Python 3.11 with venv is required (Debian 12: python3-venv)")
        subprocess.run([suitable[0], "-m", "venv", venv], check=True)
    for name, version in wanted.items():
        installed = subprocess.run([venv_python, "-c", f"import importlib.metadata as m; print(m.version('{name}'))"],
                               capture_output=True, text=True, check=False).stdout.strip()
        if installed == version or installed and version is None:
            continue
        package = f"{name}=={version}" if version else name
        print(f"Installing with pip into {os.path.relpath(venv, root)}: {package}", flush=True)
        if subprocess.run([venv_python, "-m", "pip", "install", "-q", "--disable-pip-version-check",
                           package], check=False).returncode:
            print(f"  pip failed: {name} is skipped.")


def enter(wanted, needs_llvm=False):
    """Installs packages and restarts the script in build/peers-venv, unless it runs there. `needs_llvm`: for Mitsuba."""
    if os.path.realpath(sys.prefix) == os.path.realpath(venv):
        return
    if needs_llvm:
        install_llvm()
    install(wanted)
    if needs_llvm:
        os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm()[1] or ""
    os.execv(venv_python, [venv_python, *sys.argv])


class Renderer:
    """A renderer process that answers request lines (served.py, rt_embree_peers.cpp). Its stderr goes to a log."""

    def __init__(self, command, log):
        with open(os.path.join(folder, log), "w", encoding="utf-8") as file:
            self.process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=file, text=True)
        self.log = log
        self.about = self.answer()

    def answer(self):
        line = self.process.stdout.readline()
        if not line:
            raise RuntimeError(f"{self.process.args[-3]} ended: see {os.path.join(folder, self.log)}")
        return json.loads(line)

    def ask(self, line):
        self.process.stdin.write(line + "\n")
        self.process.stdin.flush()
        return self.answer()

    def end(self):
        self.process.stdin.close()
        self.process.wait()


def cpu_model():
    with open("/proc/cpuinfo", encoding="utf-8") as file:
        return next((line.split(":")[1].strip() for line in file if line.startswith("model name")), platform.machine())


def measure(renderers, rounds, frames):
    """Times by renderer and case. Renderers take turns, so that other load affects all of them."""
    times = {name: {case: {"wall_ms": [], "cpu_ms": [], "own_ms": []} for case in cases} for name in renderers}
    times["ours"][ours_alone] = {"wall_ms": [], "cpu_ms": [], "own_ms": []}
    for _ in range(rounds):
        for case in [*cases, ours_alone]:
            for name, renderer in renderers.items():
                if case not in times[name]:
                    continue
                got = renderer.ask(f"{case} {frames}")
                for key, values in times[name][case].items():
                    values += got.get(key, [])
    return times


def main():
    quick = "--quick" in sys.argv[1:]
    if not os.path.exists(os.path.join(binaries, "rt-embree-peers")):
        raise SystemExit("peers: build/release/bin/rt-embree-peers is missing: run tools/bench peers")
    os.makedirs(folder, exist_ok=True)
    install_llvm()
    install(packages)
    if find_llvm()[1]:
        os.environ["DRJIT_LIBLLVM_PATH"] = find_llvm()[1]  # Dr.Jit's own search may find an older one

    available = sorted(os.sched_getaffinity(0))
    if len(available) > threads:
        os.sched_setaffinity(0, available[:threads])  # inherited by the renderers
    renderers = {"ours": Renderer([os.path.join(binaries, "rt-embree-peers"), folder, str(threads)], "ours.log")}
    counter = Renderer([os.path.join(binaries, "rt-embree-peers-rays"), folder, str(threads)], "rays.log")
    for name in ("mitsuba", "cycles"):
        try:
            renderers[name] = Renderer([venv_python, os.path.join(here, f"peer_{name}.py"), folder, str(threads)],
                                       f"{name}.log")
        except RuntimeError as error:
            print(f"{name} is skipped: {error}")
    with open(os.path.join(folder, "scene.json"), encoding="utf-8") as file:
        scene = json.load(file)

    rounds, frames = (1, 3) if quick else (4, 10)
    load_before = os.getloadavg()[0]
    times = measure(renderers, rounds, frames)
    load = max(load_before, os.getloadavg()[0])

    rays = {"ours": {case: counter.ask(f"{case} 1")["rays"] for case in [*cases, ours_alone]}}
    for name, renderer in renderers.items():
        if name != "ours":
            for case in cases:
                renderer.ask(f"image {case}")
            rays[name] = {"glass-path": renderer.ask("rays glass-path")["rays"]}
    for renderer in [*renderers.values(), counter]:
        renderer.end()

    differences = {}
    for name in renderers:
        if name != "ours":
            answer = subprocess.run([venv_python, os.path.join(here, "compare.py"), folder, name, *cases],
                                    stdout=subprocess.PIPE, text=True, check=True).stdout
            differences[name] = json.loads(answer)
    subprocess.run([venv_python, os.path.join(here, "compare.py"), folder, "picture", *cases,
                    *(name for name in renderers if name != "ours")], check=True)

    print(f"peers: {scene['mesh']} of {scene['triangles']} triangles, {scene['width']}x{scene['height']}, 1 sample, "
          f"{threads} threads, p50 of {rounds * frames} frames{' (smoke test, not a measurement)' if quick else ''}")
    print(f"  {cpu_model()}, {len(available)} processors, load {load:.1f}")
    for name, renderer in renderers.items():
        print(f"  {renderer.about['name']}: {renderer.about['version']}")
    medians = {name: {case: {key: statistics.median(values) for key, values in got.items() if values}
                     for case, got in by_case.items()} for name, by_case in times.items()}
    results = []
    print(f"  {'case':11} {'peer':8} {'peer ms':>8} {'ours ms':>8} {'ratio':>6} {'of CPU time':>11}   target")
    for name in renderers:
        if name == "ours":
            continue
        for case in cases:
            peer, ours = medians[name][case], medians["ours"][case]
            wall, cpu = peer["wall_ms"] / ours["wall_ms"], peer["cpu_ms"] / ours["cpu_ms"]
            own = peer["own_ms"] / ours["wall_ms"] if "own_ms" in peer else None
            target = targets[name][case]
            met = min(wall, cpu) >= target
            results.append({"case": case, "peer": name, "ratio_wall": wall, "ratio_cpu": cpu, "ratio_own": own,
                            "target": target, "met": met})
            print(f"  {case:11} {name:8} {peer['wall_ms']:8.1f} {ours['wall_ms']:8.1f} {wall:6.2f} {cpu:11.2f}   "
                  f"{target}: {'met' if met else 'MISSED'}"
                  + (f"   (without its synchronisation {peer['own_ms']:.1f} ms: {own:.2f})" if own else ""))
    print("  glass, million rays per second of CPU time (and of wall time)")
    rates = {}
    for name, case in [("ours", "glass-path"), ("ours", ours_alone), *((n, "glass-path") for n in rays if n != "ours")]:
        cpu, wall = (rays[name][case] / medians[name][case][key] / 1e3 for key in ("cpu_ms", "wall_ms"))
        rates[f"{name} {case}"] = {"rays": rays[name][case], "cpu": cpu, "wall": wall}
        print(f"    {name:8} {case:11} {rays[name][case]:10.0f} rays {cpu:7.2f} ({wall:.2f})")
    for name in rays:
        if name == "ours":
            continue
        ratio = {key: rates[f"ours {ours_alone}"][key] / rates[f"{name} glass-path"][key] for key in ("cpu", "wall")}
        met = min(ratio.values()) >= targets[name][ours_alone]
        results.append({"case": ours_alone, "peer": name, "ratio_wall": ratio["wall"], "ratio_cpu": ratio["cpu"],
                        "target": targets[name][ours_alone], "met": met})
        print(f"    ray tree relative to {name}: {ratio['wall']:.2f}, of CPU time {ratio['cpu']:.2f}   "
              f"{targets[name][ours_alone]}: {'met' if met else 'MISSED'}")
    same = True
    for name, by_case in differences.items():
        print(f"  {name}'s pictures: " + "; ".join(
            f"{case}: {100 * d['mask']:.2f} % of the mask differ, mean radiance {d['light']:.3f} (rt_embree: {d['our_light']:.3f})"
            for case, d in by_case.items()))
        same &= all(d["mask"] < largest_mask_difference for d in by_case.values())
    with open(os.path.join(folder, "peers.json"), "w", encoding="utf-8") as file:
        json.dump({"time": time.strftime("%Y-%m-%dT%H:%M:%SZ", time.gmtime()), "quick": quick, "cpu": cpu_model(),
                   "processors": len(available), "load": load, "threads": threads, "scene": scene,
                   "versions": {name: renderer.about for name, renderer in renderers.items()},
                   "median": medians, "times": times, "rays": rays, "rays_per_second": rates, "pictures": differences,
                   "results": results}, file, indent=1)
    print("  all numbers: build/peers/peers.json; pictures: build/peers/peers.png")
    if not same:
        raise SystemExit("peers: the masks differ by more than 0.5 %: the scenes are not the same")


if __name__ == "__main__":
    main()
