#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures rt_vulkan on this machine's device: gpu.py [--quick]

1. The unlit bunny and whole scenes, compared with a bare trace of the same primary rays.
2. On a GPU: the dissertation's scenes, by path.
3. A long run with scene changes: memory, file descriptors, validation messages.

On a CPU, whole scenes are traced by `plain` only, the plugin's choice there, as each path takes long to compile.
Drivers' compiled shaders are cached in build/gpu."""
import json
import os
import pathlib
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1] / "tables"), str(HERE.parents[1]), str(HERE.parents[2] / "tools")]
from replays import BUILD, ROOT  # noqa: E402
from scene_views import VIEWS  # noqa: E402
from tables import TABLES, face_count_note, scene_file  # noqa: E402

OUT = ROOT / "build/gpu"
PROGRAM = BUILD / "bin/rt-vulkan-bench"
ENVIRONMENT = os.environ | {"XDG_CACHE_HOME": str(OUT)}
QUICK = "--quick" in sys.argv


def traced(scene, size, rounds, paths, view=None):
    """Returns each path's measurements, and the log; `view`: the eye and its target."""
    command = [PROGRAM, "trace", scene, *size, rounds, paths, *(view[0] + view[1] if view else ())]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False, env=ENVIRONMENT)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr}")
    return [json.loads(line) for line in done.stdout.splitlines()], done.stderr


def note(scene, log):
    return "   a stand-in for the scan" if "stand-in" in log else face_count_note(scene, log)


def compare_with_bare(is_gpu):
    """The unlit bunny mainly measures visibility; the other scenes are for orientation."""
    size, rounds, paths = ((800, 600), 101, "all") if is_gpu else ((400, 300), 31, "auto")
    rounds = 3 if QUICK else rounds
    print(f"time per image of rt_vulkan and of a bare trace of its primary rays, {size[0]}x{size[1]}, 1 sample, medians of "
          f"{rounds} alternating rounds\n"
          f"  {'':10} {'path':9} {'image, ms':>9} {'bare, ms':>9} {'relative speed':>14}")
    missed = []
    for name in ("bunny", "demo", "optix-cs", "optix-gl"):
        rows, log = traced(*(("bunny", size, rounds, "all") if name == "bunny" else
                              (scene_file(name), size, rounds, paths, VIEWS[name][0])))
        for row in rows:
            speed = 100 * row["bare_ms"] / row["frame_ms"]
            print(f"  {name:10} {row['path']:9} {row['frame_ms']:9.2f} {row['bare_ms']:9.2f} {speed:12.1f} %"
                  f"{note(name, log) if name != 'bunny' else ''}", flush=True)
            if name == "bunny" and row["drawn"] != row["hit"]:
                missed.append(f"{row['path']}: the bare trace hits {row['hit']} pixels, but {row['drawn']} are drawn")
    return missed


def dissertation():
    """Frames per second of its scenes, and the shares of GPU time and read-back."""
    for width, height in ((800, 600), (1280, 720)):
        for title, scenes in TABLES.items():
            print(f"{title}: {width}x{height}, frames per second (the dissertation's at 800x600 on a GTX 1060, at most 60)\n"
                  f"  {'scene':6} {'diss.':>8}  {'path':9} {'rt_vulkan':>10} {'on the GPU':>11} {'read back':>10}")
            for name, (scene, view, _, alone) in scenes.items():
                rows, log = traced(scene_file(scene), (width, height), 5 if QUICK else 101, "all", VIEWS[scene][view])
                for row in rows:
                    print(f"  {name:6} {alone:8.2f}  {row['path']:9} {1000 / row['frame_ms']:10.2f} "
                          f"{100 * row['gpu_share']:9.1f} % {100 * row['read_back_share']:8.1f} %"
                          f"{note(scene, log)}", flush=True)


def main():
    OUT.mkdir(parents=True, exist_ok=True)
    probe, _ = traced("bunny", (16, 16), 1, "auto")
    is_gpu = probe[0]["is_gpu"]
    print(f"gpu: {probe[0]['device']}")
    missed = compare_with_bare(is_gpu)
    if is_gpu:
        dissertation()
    else:
        print("the dissertation's scenes are skipped: there is no GPU among the Vulkan devices, and a CPU's frame rates and "
              "shares say nothing about a GPU's.")
    # Speed does not matter here: let lavapipe compile quickly.
    images, every = (400, 20) if QUICK else (10_000, 100)
    run = [PROGRAM, "run", str(images), str(every), *(scene_file(name) for name in ("demo", "optix-cs", "moving"))]
    sys.stdout.flush()
    done = subprocess.run(run, check=False, env=ENVIRONMENT | {"GALLIVM_PERF": "nopt", "LP_NATIVE_VECTOR_WIDTH": "128"})
    if done.returncode:
        missed.append("the long run")
    if missed:
        raise SystemExit("missed: " + "; ".join(missed))


main()
