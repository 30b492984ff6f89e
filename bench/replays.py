# SPDX-License-Identifier: Apache-2.0
"""Writes the benchmarks' trajectories and replays them (docs/trajectories.md)."""
import csv
import json
import pathlib
import subprocess

ROOT = pathlib.Path(__file__).resolve().parent.parent
BUILD = ROOT / "build/release"
if not (BUILD / "bin/arhost").exists():
    raise SystemExit(f"{BUILD}/bin/arhost is missing: build it with tools/test")
WIDTH, HEIGHT = 800, 600


def write_trajectory(file, eyes_and_targets, y_up):
    """`eyes_and_targets`: eye and look-at point in mm per frame; 30 frames per second, the dissertation's field of view of
    45 degrees."""
    focal = HEIGHT / 2 / 0.41421356237309503
    header = {"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": "media", "fps": 30,
              "camera": {"width": WIDTH, "height": HEIGHT, "fx": focal, "fy": focal, "cx": (WIDTH - 1) / 2,
                         "cy": (HEIGHT - 1) / 2}}
    lines = [header]
    for number, (eye, look_at) in enumerate(eyes_and_targets):
        lines.append({"frame": number, "capture_ns": number * 1_000_000_000 // 30, "eye": list(eye),
                      "look_at": list(look_at), "up": [0, 1, 0] if y_up else [0, 0, 1]})
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))


def replay(scene_file, trajectory, frames, *arguments):
    """Returns a run's statistics, timeline and stderr. Writes stats.json and timeline.csv next to the trajectory."""
    stats, timeline = trajectory.with_name("stats.json"), trajectory.with_name("timeline.csv")
    command = [BUILD / "bin/arhost", "replay", "--trajectory", trajectory, "--scene", scene_file,
               "--frames", str(frames), "--stats", stats, "--timeline", timeline,
               "--set", "raytracer.start_deadline_ms=120000", "--set", "raytracer.deadline_ms=60000", *arguments]
    done = subprocess.run(list(map(str, command)), capture_output=True, text=True, check=False)
    if done.returncode:
        raise SystemExit(f"{' '.join(map(str, command))}\n{done.stderr}")
    with open(timeline, encoding="utf-8") as file:
        rows = [{key: float(value) for key, value in row.items()} for row in csv.DictReader(file)]
    return json.loads(stats.read_text()), rows, done.stderr


def frames_per_second(rows):
    """Without the first fifth of a run, which has cold caches and an empty pipeline."""
    rows = rows[len(rows) // 5:]
    return (len(rows) - 1) / (rows[-1]["shown_s"] - rows[0]["shown_s"])
