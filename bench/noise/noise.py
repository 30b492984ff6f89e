#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Noise and time of rt_embree's path integrator, denoised and not: tools/bench noise [--quick]. Method:
bench/noise/README.md."""
import gzip
import os
import re
import shutil
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
FOLDER = os.path.join(root, "build", "noise")
PROGRAM = os.path.join(root, "build", "release", "bin", "render-noise")
BUNNY = os.path.join(root, "..", "shared", "data", "meshes", "bunny_69451.ply.gz")
QUICK = "--quick" in sys.argv
# RMS difference from the converged picture, in codes: after 16 frames of a camera at rest, and while it moves.
TARGETS = {"still": {"catcher": 2, "diffuse": 2.5, "glossy": 2.5, "mirror, glass": 4},
           "moving": {"catcher": 4, "diffuse": 5, "glossy": 5, "mirror, glass": 6}}
LARGEST_WALL_MS = 33  # of a frame with the bunny alone
LARGEST_FLICKER = 1  # standard deviation over frames of a camera at rest, in codes
# Frames after a change of the light, after which nothing is left of the light before; largest ratio of the RMS
# difference to that of a run without the light before.
FRAMES_TO_FORGET = 5
LARGEST_RATIO = 1.1
BALL = "  - {name: gold, sphere: {centre: [55, -25, 18], radius: 18}, material: gold}\n"


def scene():
    """The scene file; with the bunny in place of the red ball, if there is one."""
    os.makedirs(FOLDER, exist_ok=True)
    with open(os.path.join(here, "scene.yaml"), encoding="utf-8") as file:
        text = file.read()
    if not os.path.exists(BUNNY):
        print("skipped: the bunny, because ../shared/data is missing")
    else:
        with gzip.open(BUNNY) as packed, open(os.path.join(FOLDER, "bunny.ply"), "wb") as mesh:
            shutil.copyfileobj(packed, mesh)
        ball = "  - {name: red, sphere: {centre: [-70, 10, 28], radius: 28}, material: red}\n"
        assert ball in text
        # The scan is in metres, with y up.
        text = text.replace(ball, "  - name: bunny\n    mesh: bunny.ply\n    smooth: true\n    material: red\n    transform:\n"
                            "      - scale: 450\n      - rotate: {axis: [1, 0, 0], degrees: 90}\n"
                            "      - translate: [-62, 10, -15]\n")
    path = os.path.join(FOLDER, "scene.yaml")
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def variant(path, name, *replacements):
    """A variant of the scene file."""
    with open(path, encoding="utf-8") as file:
        text = file.read()
    for old, new in replacements:
        assert old in text
        text = text.replace(old, new)
    path = os.path.join(FOLDER, name)
    with open(path, "w", encoding="utf-8") as file:
        file.write(text)
    return path


def first_object_alone(path):
    """The bunny on the table, without the other objects."""
    with open(path, encoding="utf-8") as file:
        others = file.read().partition("  - name: box\n")
    return variant(path, "alone.yaml", ("".join(others[1:]), ""))


def with_motion(path):
    """The gold ball moves by 85 mm/s."""
    return variant(path, "motion.yaml", (BALL, """  - name: gold
    sphere: {centre: [55, -25, 18], radius: 18}
    material: gold
    motion: {keys: [{at_s: 0}, {at_s: 1, translate: [-60, -60, 0]}, {at_s: 2}]}
"""))


def with_lamp(path):
    """A glowing ball, which can be switched on and off."""
    return variant(path, "lamp.yaml", ("materials:\n", """materials:
  bulb: {model: metallic-roughness, colour: 0, metallic: 0, roughness: 1, emission: 12}
"""), ("objects:\n", """objects:
  - name: bulb
    sphere: {centre: [20, 10, 45], radius: 8}
    material: bulb
    motion: {keys: [{at_s: 0}, {at_s: 1, translate: [0, 0, 0.001]}]}
"""))


def measure(path, title, **keys):
    """{surface: (RMS, flicker)}; ["wall, ms"]: of a frame"""
    folder = os.path.join(FOLDER, title)
    os.makedirs(folder, exist_ok=True)
    ran = subprocess.run([PROGRAM, path, f"out={folder}", *(f"{key}={value}" for key, value in keys.items())],
                         stdout=subprocess.PIPE, text=True, check=True)
    print(f"{title}\n{ran.stdout}", flush=True)
    rows = {}
    for line in ran.stdout.splitlines()[1:-1]:
        words = line.rsplit(maxsplit=3)
        rows[words[0]] = (float(words[2]), float(words[3]))
    rows["wall, ms"] = float(re.search(r"wall time ([0-9.]+) ms", ran.stdout)[1])
    return rows


def main():
    path = scene()
    frames = 4 if QUICK else 16
    reference = 1 if QUICK else 16
    measure(path, "noisy", denoise=0, frames=frames, reference=1)
    still = measure(path, "still", frames=frames, reference=reference)
    alone = measure(first_object_alone(path), "first object alone", frames=frames, reference=reference)
    moving = measure(path, "moving", frames=24 if not QUICK else frames, orbit=0.5, reference=reference)
    moving_ball = measure(with_motion(path), "moving ball", frames=frames, reference=reference)
    events = {}
    for title, key in (("lamp on", "show"), ("lamp off", "hide")):
        events[title] = [measure(with_lamp(path), name, frames=first + 1 + FRAMES_TO_FORGET, stop=0,
                                 reference=reference, **{key: first})
                         for name, first in ((title, frames), (title + ", without the light before", 0))]
    if QUICK:
        return 0
    missed = [f"{name} {title}: RMS {rows[name][0]}, target {target}"
              for title, rows in (("still", still), ("moving", moving), ("moving ball", moving_ball))
              for name, target in TARGETS[title.split()[0]].items() if rows[name][0] > target]
    missed += [f"{name}: flicker {still[name][1]}, target {LARGEST_FLICKER}" for name in TARGETS["still"]
               if still[name][1] > LARGEST_FLICKER]
    if alone["wall, ms"] > LARGEST_WALL_MS:
        missed.append(f"first object alone: wall time {alone['wall, ms']} ms, target {LARGEST_WALL_MS} ms")
    missed += [f"{name} after {title}: RMS {after[name][0]}, without the light before {fresh[name][0]}"
               for title, (after, fresh) in events.items() for name in TARGETS["still"]
               if after[name][0] > LARGEST_RATIO * fresh[name][0]]
    print("\n".join("missed: " + each for each in missed) or "all targets met")
    return 1 if missed else 0


sys.exit(main())
