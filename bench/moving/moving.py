#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Cost of moving and deforming objects: moving.py [--quick]

Traces config/scenes/moving.yaml with the ray tracer alone (arhost replay) from a static camera, and a copy of it without
motion; both also with a mesh of about 100,000 triangles. One sample per pixel, one shadow ray to the lamp. CPU time is
that of the ray tracer's process, which includes evaluating the motion; it is less sensitive to other load than wall time.
Writes build/moving/moving.json."""
import json
import os
import pathlib
import re
import shutil
import statistics
import struct
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parents[2] / "tools")]
from replays import HEIGHT, ROOT, WIDTH, frames_per_second, replay, write_trajectory  # noqa: E402
from scene_views import MOVING_VIEW  # noqa: E402

OUT = ROOT / "build/moving"
SCENES = ROOT / "config/scenes"
SHORT = 10  # frames of the run that measures the start-up time


def without_motion(scene):
    """The scene's text with all objects fixed at their initial positions."""
    def placed(motion):
        initial = re.search(r"at_s: 0, translate: (\[[^]]*\])", motion.group())
        return f"    transform: [{{translate: {initial.group(1)}}}]\n" if initial else ""

    return re.sub(r"(?m)^    motion:\n(?:      .*\n)+", placed, re.sub(r"(?m)^    animation: .*\n", "", scene))


def triangles(glb):
    length, = struct.unpack_from("<I", glb, 12)
    model = json.loads(glb[20:20 + length])
    return sum(model["accessors"][part["indices"]]["count"] // 3 for mesh in model["meshes"] for part in mesh["primitives"])


def lay_out(folder, faces):
    """Writes the scene and its copy without motion, with a mesh of `faces` triangles or, if None, the shipped one. Returns
    the number of triangles."""
    folder.mkdir(parents=True)
    (folder / "textures").symlink_to(SCENES / "textures")
    mesh = folder / "meshes/tentacles.glb"
    if faces:
        subprocess.run([ROOT / "tools/make-tentacles", "--faces", str(faces), "--output", mesh], check=True, stdout=subprocess.DEVNULL)
    else:
        mesh.parent.symlink_to(SCENES / "meshes")
    scene = (SCENES / "moving.yaml").read_text()
    (folder / "moving.yaml").write_text(scene)
    (folder / "still.yaml").write_text(without_motion(scene))
    return triangles(mesh.read_bytes())


def measure(scene, trajectory, frames):
    """Frames per second, and CPU time per frame in ms without start-up."""
    short, (stats, timeline, _) = (replay(scene, trajectory, count, "--set", "raytracer.options.light_samples=1") for count in (SHORT, SHORT + frames))
    cpu_s = stats["cpu_seconds"]["raytracer"] - short[0]["cpu_seconds"]["raytracer"]
    return frames_per_second(timeline), 1e3 * cpu_s / frames


def main():
    frames, rounds = (20, 1) if "--quick" in sys.argv[1:] else (60, 5)
    shutil.rmtree(OUT, ignore_errors=True)
    OUT.mkdir(parents=True)
    trajectory = OUT / "still.jsonl"
    write_trajectory(trajectory, [MOVING_VIEW] * (SHORT + frames), False)
    print(f"moving: {WIDTH}x{HEIGHT}, {os.cpu_count()} cores, medians of {rounds} alternating rounds\n"
          f"  {'deforming':>12}   {'frames per second':^24}   {'CPU time per frame, ms':^24}\n"
          f"  {'triangles':>12}   {'static':>8} {'moving':>8}           {'static':>8} {'moving':>8} {'ratio':>7}")
    results = []
    for name, faces in (("shipped", None), ("100k", 100_000)):
        deforming = lay_out(OUT / name, faces)
        rows = []
        for _ in range(rounds):
            still, moving = (measure(OUT / name / f"{scene}.yaml", trajectory, frames) for scene in ("still", "moving"))
            rows.append((still[0], moving[0], still[1], moving[1], moving[1] / still[1]))
        columns = [statistics.median(column) for column in zip(*rows)]
        print("  {:12,}   {:8.1f} {:8.1f}           {:8.1f} {:8.1f} {:7.2f}".format(deforming, *columns), flush=True)
        results.append({"triangles": deforming, **dict(zip(("fps_still", "fps_moving", "cpu_ms_still", "cpu_ms_moving", "cpu_ratio"), columns))})
    (OUT / "moving.json").write_text(json.dumps(results, indent=1) + "\n")


main()
