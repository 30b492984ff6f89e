#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Time to the same FLIP error as Blender Cycles and Mitsuba 3, both with Open Image Denoise: tools/bench equal-quality
[--quick]. Method: bench/equal_quality/README.md. Exits with 1 if a target is missed."""
import math
import os
import re
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
sys.path.insert(0, os.path.join(root, "bench", "peers"))
import peers  # noqa: E402

PACKAGES = {"mitsuba": "3.9.1", "bpy": "5.0.1", "pyoidn": "2.5.1.0", "pyyaml": "6.0.3", "flip-evaluator": "1.7",
            "numpy": None, "pillow": None}
peers.enter(PACKAGES, needs_llvm=True)

import flip_evaluator  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

QUICK = "--quick" in sys.argv
FOLDER = os.path.join(root, "build", "equal_quality-quick" if QUICK else "equal_quality")
PROGRAM = os.path.join(peers.binaries, "render-noise")
WIDTH, HEIGHT = (160, 120) if QUICK else (640, 480)
THREADS = 2
NAMES = {"cycles": "Cycles + OIDN", "mitsuba": "Mitsuba + OIDN"}
TARGETS = {"cycles": 10, "mitsuba": 5}  # a peer's time divided by rt_embree's
# Mitsuba's sampler rounds 32 up to 35, and is slower with other numbers than powers of two.
SAMPLES = {"cycles": (1, 2, 4, 8, 16, 32, 64), "mitsuba": (1, 2, 4, 8, 16, 64)}
REFERENCE_SAMPLES = {"ours": 64 if QUICK else 1024, "cycles": 8 if QUICK else 256, "mitsuba": 8 if QUICK else 512}
SEEDS = 3
LARGEST_DIFFERENCE = 0.03  # of the mean light of converged pictures


def flip(truth, picture):
    return float(flip_evaluator.evaluate(truth / np.float32(255), picture / np.float32(255), "LDR")[1])


def encoded(light):
    light = np.clip(light, 0, 1)
    return np.round(255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)).astype(np.uint8)


def mean_light(codes):
    values = codes / 255
    return np.where(values <= 0.04045, values / 12.92, ((values + 0.055) / 1.055) ** 2.4).mean()


class Case:
    """A picture of rt_embree, whose error the peers must reach."""

    def __init__(self, name, picture, truth, has_target):
        self.name, self.picture, self.flip, self.has_target = name, picture, flip(truth, picture), has_target
        self.row = [name, f"{self.flip:.4f}"]


class View:
    """A camera, with rt_embree's time per frame. A column of the sheet has a renderer's pictures: with one sample, at
    equal error, converged."""

    def __init__(self, title, scene, frames, orbit_degrees):
        self.degrees = 25 + (frames - 1) * orbit_degrees  # as in bench/noise/render_noise.cpp
        out = os.path.join(FOLDER, title)
        os.makedirs(out, exist_ok=True)
        printed = subprocess.run(
            [PROGRAM, scene, f"out={out}", f"width={WIDTH}", f"height={HEIGHT}", f"threads={THREADS}", f"frames={frames}",
             f"orbit={orbit_degrees}", f"reference={REFERENCE_SAMPLES['ours'] // 64}"],
            stdout=subprocess.PIPE, text=True, check=True).stdout
        found = re.search(r"wall time ([\d.]+) ms, CPU time ([\d.]+) ms", printed)
        self.wall_ms, self.cpu_ms = map(float, found.groups())
        first, last, self.truth = (np.asarray(Image.open(os.path.join(out, name + ".ppm")))
                                   for name in ("frame-0", f"frame-{frames - 1}", "reference"))
        self.cases = [Case(f"{title}, frame {frames}", last, self.truth, True)]
        if not orbit_degrees:
            self.cases.insert(0, Case("first frame", first, self.truth, False))
        for case in self.cases:
            case.row.append(f"{self.wall_ms:.0f} ({self.cpu_ms:.0f})")
        self.columns = [[self.cases[0].picture, last, self.truth]]


def our_scene():
    """The scene file of bench/noise, with an ordinary desk, as Mitsuba has no catcher."""
    with open(os.path.join(root, "bench", "noise", "scene.yaml"), encoding="utf-8") as file:
        text = file.read()
    assert ", role: catcher" in text
    path = os.path.join(FOLDER, "scene.yaml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text.replace(", role: catcher", ""))
    return path


class Row:
    """A peer's mean error and time with a number of samples, and one of its pictures."""

    def __init__(self, samples, error, wall_ms, cpu_ms, picture):
        self.samples, self.flip, self.wall_ms, self.cpu_ms, self.picture = samples, error, wall_ms, cpu_ms, picture


def curve(renderer, name, degrees, wanted):
    """A peer's converged picture, and rows with more and more samples until FLIP is at most `wanted`."""
    file = os.path.join(FOLDER, f"{name}.npy")

    def render(samples, seed, quality):
        times = renderer.ask(f"{degrees} {samples} {seed} {quality} {file}")
        return encoded(np.load(file)), times

    truth, _ = render(REFERENCE_SAMPLES[name], SEEDS, "high")
    rows = []
    for samples in SAMPLES[name][:2 if QUICK else None]:
        pictures, times = zip(*(render(samples, seed, "fast") for seed in range(SEEDS)))
        wall, cpu = (np.mean([each[key] for each in times[1:]]) for key in ("wall_ms", "cpu_ms"))  # the first one compiles
        rows.append(Row(samples, np.mean([flip(truth, each) for each in pictures]), wall, cpu, pictures[0]))
        if rows[-1].flip <= wanted:
            break
    return truth, rows


class Needed:
    """The time that a peer needs for a FLIP error, interpolated between the logarithms of the rows."""

    def __init__(self, rows, error):
        self.sign = ">" if rows[-1].flip > error else ""
        flips, wall, cpu = zip(*sorted((math.log(row.flip), math.log(row.wall_ms), math.log(row.cpu_ms)) for row in rows))
        self.wall_ms, self.cpu_ms = (math.exp(np.interp(math.log(error), flips, each)) for each in (wall, cpu))


def table(head, rows):
    return "\n".join("| " + " | ".join(map(str, row)) + " |" for row in (head, ["---"] * len(head), *rows)) + "\n"


def compare(name, renderer, view, missed):
    """Adds a peer's times to the view's cases. Returns the rows of the table of errors."""
    truth, rows = curve(renderer, name, view.degrees, 0 if QUICK else min(case.flip for case in view.cases))
    view.columns.append([rows[0].picture, rows[-1].picture, truth])
    difference = mean_light(truth) / mean_light(view.truth) - 1
    print(f"  camera at {view.degrees:g}°: mean light {100 * difference:+.1f} % of rt_embree's", flush=True)
    if abs(difference) > LARGEST_DIFFERENCE:
        missed.append(f"{NAMES[name]}: the mean light differs by {100 * difference:.1f} %: the scenes are not the same")
    for case in view.cases:
        needed = Needed(rows, case.flip)
        wall, cpu = needed.wall_ms / view.wall_ms, needed.cpu_ms / view.cpu_ms
        case.row += [f"{needed.sign}{needed.wall_ms:.0f} ({needed.cpu_ms:.0f})", f"**{needed.sign}{wall:.1f}** ({cpu:.1f})"]
        if case.has_target and wall < TARGETS[name]:
            missed.append(f"{case.name}, {NAMES[name]}: {wall:.1f} times rt_embree's time, target {TARGETS[name]}")
    return [[NAMES[name], f"{view.degrees:g}°", row.samples, f"{row.flip:.4f}", f"{row.wall_ms:.0f}", f"{row.cpu_ms:.0f}"]
            for row in rows]


def main():
    os.makedirs(FOLDER, exist_ok=True)
    peers.folder = FOLDER  # for its logs
    available = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, available[:THREADS])  # inherited by the renderers
    print(f"{peers.cpu_model()}, {len(available)} processors, load {os.getloadavg()[0]:.1f}, {WIDTH}x{HEIGHT}, {THREADS} threads"
          + (" (smoke test, not a measurement)" if QUICK else ""), flush=True)
    scene = our_scene()
    views = [View("still", scene, 4 if QUICK else 16, 0), View("moving", scene, 4 if QUICK else 24, 0.5)]
    head, errors, missed = ["rt_embree", "FLIP", "time, ms (CPU)"], [], []
    for name, title in NAMES.items():
        try:
            renderer = peers.Renderer([peers.venv_python, os.path.join(here, f"peer_{name}.py"), str(WIDTH), str(HEIGHT),
                                       str(THREADS)], f"{name}.log")
        except RuntimeError as error:
            print(f"{title} is skipped: {error}")
            continue
        print(f"{title}: {renderer.about['version']}", flush=True)
        head += [f"{title}: time, ms (CPU)", f"÷ rt_embree's (CPU); target {TARGETS[name]}"]
        for view in views:
            errors += compare(name, renderer, view, missed)
        renderer.end()
    for view in views:
        Image.fromarray(np.concatenate([np.concatenate(column) for column in view.columns], 1)).save(
            os.path.join(FOLDER, f"camera-{view.degrees:g}.png"))
    text = table(head, [case.row for view in views for case in view.cases]) + "\n" + table(
        ["peer", "camera", "samples", "FLIP", "time, ms", "CPU time, ms"], errors)
    print("\n" + text)
    with open(os.path.join(FOLDER, "table.md"), "w", encoding="utf-8") as file:
        file.write(text)
    if QUICK:
        return 0
    print("\n".join("missed: " + each for each in missed) or "all targets met")
    return 1 if missed else 0


sys.exit(main())
