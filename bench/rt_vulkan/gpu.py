#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures rt_vulkan on this machine's device: gpu.py [--quick] [--minutes=8]

1. The unlit bunny and whole scenes, compared with a bare trace of the same primary rays.
2. On a GPU: the dissertation's scenes.
3. A long run with scene changes: memory, file descriptors, validation messages.

1 and 2 begin with the path `pipeline`, which GPUs without ray queries have, too. After --minutes, what runs is stopped,
and what is left is not started. On a CPU, whole scenes are traced by `plain` only, the plugin's choice there, as each
path takes long to compile. Drivers' compiled shaders are cached in build/gpu."""
import json
import os
import pathlib
import subprocess
import sys
import time

HERE = pathlib.Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1] / "tables"), str(HERE.parents[1]), str(HERE.parents[2] / "tools")]
from replays import BUILD, ROOT  # noqa: E402
from scene_views import VIEWS  # noqa: E402
from tables import TABLES, face_count_note, scene_file  # noqa: E402

OUT = ROOT / "build/gpu"
PROGRAM = BUILD / "bin/rt-vulkan-bench"
ENVIRONMENT = os.environ | {"XDG_CACHE_HOME": str(OUT)}
QUICK = "--quick" in sys.argv
MINUTES = next((float(word.partition("=")[2]) for word in sys.argv if word.startswith("--minutes=")), 8)
DEADLINE = time.monotonic() + 60 * MINUTES


def run(*command, **options):
    """Raises subprocess.TimeoutExpired at the deadline."""
    return subprocess.run(list(map(str, command)), text=True, check=False, timeout=DEADLINE - time.monotonic(), **options)


def traced(scene, size, rounds, path, view=None):
    """Returns the measurements with this path, and the log; `view`: the eye and its target."""
    command = [PROGRAM, "trace", scene, *size, rounds, path, *(view[0] + view[1] if view else ())]
    done = run(*command, capture_output=True, env=ENVIRONMENT)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return json.loads(done.stdout), done.stderr


def note(scene, log):
    return "   a stand-in for the scan" if "stand-in" in log else face_count_note(scene, log)


def compare_with_bare(path, is_gpu):
    """The unlit bunny mainly measures visibility; the other scenes are for orientation. Returns what is wrong."""
    size, rounds = ((800, 600), 101) if is_gpu else ((400, 300), 31)
    rounds = 3 if QUICK else rounds
    print(f"time per image and of a bare trace of its primary rays, {size[0]}x{size[1]}, 1 sample, medians of {rounds} "
          f"alternating rounds\n  {'':10} {'path':9} {'image, ms':>9} {'bare, ms':>9} {'relative speed':>14}")
    wrong = []
    for name in ("bunny", "demo", "optix-cs", "optix-gl") if is_gpu or path == "plain" else ("bunny",):
        row, log = traced("bunny", size, rounds, path) if name == "bunny" else \
            traced(scene_file(name), size, rounds, path, VIEWS[name][0])
        print(f"  {name:10} {path:9} {row['frame_ms']:9.2f} {row['bare_ms']:9.2f} "
              f"{100 * row['bare_ms'] / row['frame_ms']:12.1f} %{note(name, log) if name != 'bunny' else ''}", flush=True)
        if name == "bunny" and row["drawn"] != row["hit"]:
            wrong.append(f"{path}: the bare trace hits {row['hit']} pixels, but {row['drawn']} are drawn")
    return wrong


def dissertation(path):
    """Frames per second of its scenes, and the shares of GPU time and read-back."""
    for width, height in ((800, 600), (1280, 720)):
        for title, scenes in TABLES.items():
            print(f"{title}: {width}x{height}, frames per second (the dissertation's at 800x600 on a GTX 1060, at most 60)\n"
                  f"  {'scene':6} {'diss.':>8}  {'path':9} {'rt_vulkan':>10} {'on the GPU':>11} {'read back':>10}")
            for name, (scene, view, _, alone) in scenes.items():
                row, log = traced(scene_file(scene), (width, height), 5 if QUICK else 101, path, VIEWS[scene][view])
                print(f"  {name:6} {alone:8.2f}  {path:9} {1000 / row['frame_ms']:10.2f} "
                      f"{100 * row['gpu_share']:9.1f} % {100 * row['read_back_share']:8.1f} %{note(scene, log)}", flush=True)
    return []


def long_run():
    images, every = (400, 20) if QUICK else (10_000, 100)
    # Speed does not matter here: let lavapipe compile quickly.
    done = run(PROGRAM, "run", images, every, *map(scene_file, ("demo", "optix-cs", "moving")),
               env=ENVIRONMENT | {"GALLIVM_PERF": "nopt", "LP_NATIVE_VECTOR_WIDTH": "128"})
    return ["the long run"] if done.returncode else []


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    probe, _ = traced("bunny", (16, 16), 1, "auto")
    is_gpu = probe["is_gpu"]
    paths = sorted(probe["paths"])  # "pipeline" is the first
    print(f"gpu: {probe['device']}, paths: {', '.join(paths)}")
    if not is_gpu:
        print("the dissertation's scenes are skipped: there is no GPU among the Vulkan devices, and a CPU's frame rates and "
              "shares say nothing about a GPU's.")
    parts = [(f"{path} compared with a bare trace", lambda path=path: compare_with_bare(path, is_gpu)) for path in paths]
    parts += [(f"{path}, the dissertation's scenes", lambda path=path: dissertation(path)) for path in paths if is_gpu]
    parts += [("long run", long_run)]
    missed, left_out = [], []
    for name, part in parts:
        begin = time.monotonic()
        if begin >= DEADLINE:
            left_out.append(name)
            continue
        print(f"\n{name}:", flush=True)
        try:
            missed += part()
        except subprocess.TimeoutExpired:
            left_out.append(f"the rest of: {name}")
        print(f"  {time.monotonic() - begin:.0f} s", flush=True)
    if left_out:
        print(f"\nleft out after {MINUTES:g} minutes: {'; '.join(left_out)}")
    if missed:
        raise SystemExit("missed: " + "; ".join(missed))


main()
