#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Measures the cost of motion and deformation: moving.py [--quick]

Traces config/scenes/moving.yaml and a copy of it without motion with the ray tracer alone (arhost replay), from a static
camera, with one sample per pixel and one shadow ray to the lamp. CPU time is that of the ray tracer's process, including
the evaluation of the motion; other programs affect it less than wall time. Writes build/moving/moving.json."""
import json
import os
import pathlib
import re
import shutil
import statistics
import struct
import sys

HERE = pathlib.Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parents[2] / "tools")]
from replays import HEIGHT, ROOT, WIDTH, frames_per_second, replay, write_trajectory  # noqa: E402
from scene_views import MOVING_VIEW  # noqa: E402

OUT = ROOT / "build/moving"
SCENES = ROOT / "config/scenes"
SHORT = 10  # frames of the run that measures the startup cost


def without_motion(scene):
    """The scene's text with everything static at its initial position."""
    def placed(motion):
        start = re.search(r"at_s: 0, translate: (\[[^]]*\])", motion.group())
        return f"    transform: [{{translate: {start.group(1)}}}]\n" if start else ""

    return re.sub(r"(?m)^    motion:\n(?:      .*\n)+", placed, re.sub(r"(?m)^    animation: .*\n", "", scene))


def triangles(glb):
    length, = struct.unpack_from("<I", glb, 12)
    model = json.loads(glb[20:20 + length])
    return sum(model["accessors"][part["indices"]]["count"] // 3 for mesh in model["meshes"] for part in mesh["primitives"])


def write_scenes():
    """Writes the scene and its copy without motion to OUT."""
    for folder in ("textures", "meshes"):
        (OUT / folder).symlink_to(SCENES / folder)
    scene = (SCENES / "moving.yaml").read_text()
    (OUT / "moving.yaml").write_text(scene)
    (OUT / "still.yaml").write_text(without_motion(scene))


def measure(scene, trajectory, frames):
    """Frames per second, and CPU time per frame in ms without startup."""
    short, (stats, timeline, _) = (replay(scene, trajectory, count, "--set", "raytracer.options.light_samples=1") for count in (SHORT, SHORT + frames))
    cpu_s = stats["cpu_seconds"]["raytracer"] - short[0]["cpu_seconds"]["raytracer"]
    return frames_per_second(timeline), 1e3 * cpu_s / frames


def main():
    frames, rounds = (20, 1) if "--quick" in sys.argv[1:] else (60, 5)
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    trajectory = OUT / "still.jsonl"
    write_trajectory(trajectory, [MOVING_VIEW] * (SHORT + frames), False)
    write_scenes()
    deforming = triangles((OUT / "meshes/tentacles.glb").read_bytes())
    rows = []
    for _ in range(rounds):
        still, moving = (measure(OUT / f"{scene}.yaml", trajectory, frames) for scene in ("still", "moving"))
        rows.append((still[0], moving[0], still[1], moving[1], moving[1] / still[1]))
    columns = [statistics.median(column) for column in zip(*rows)]
    print(f"moving: {WIDTH}x{HEIGHT}, {os.cpu_count()} cores, medians of {rounds} rounds, {deforming:,} triangles that deform\n"
          f"  {'frames per second':^24}   {'CPU time per frame, ms':^24}\n"
          f"  {'still':>8} {'moving':>8}           {'still':>8} {'moving':>8} {'ratio':>7}")
    print("  {:8.1f} {:8.1f}           {:8.1f} {:8.1f} {:7.2f}".format(*columns))
    results = {"triangles": deforming, **dict(zip(("fps_still", "fps_moving", "cpu_ms_still", "cpu_ms_moving", "cpu_ratio"), columns))}
    (OUT / "moving.json").write_text(json.dumps([results], indent=1) + "\n")


main()
