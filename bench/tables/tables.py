#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""The dissertation's tables 3 and 4 and figures 23 and 26 with arhost's results next to the author's, and arhost's CPU
overhead over its plugins: tables.py [--quick] [overhead] [tables] [figures]

Each scene is traced twice with the same cameras: by the ray tracer alone (arhost replay, the dissertation's "pure" mode)
and in the whole pipeline (--with-pipeline: one preloaded image repeatedly, tracker_aruco, sink_null).
Writes build/tables/tables.json, figure-23.svg and figure-26.svg."""
import json
import math
import os
import pathlib
import re
import statistics
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve()
sys.path[:0] = [str(HERE.parents[1]), str(HERE.parents[2] / "tools")]
import replays  # noqa: E402
from replays import BUILD, HEIGHT, ROOT, WIDTH, frames_per_second, write_trajectory  # noqa: E402
from scene_views import VIEWS  # noqa: E402

OUT = ROOT / "build/tables"
FRAME = OUT / "frame.png"

# Dissertation's name → scene, view, frames per second with the middleware and of the ray tracer alone (GTX 1060 and a
# camera of 30 frames per second).
FAR, CLOSE = 0, 1
TABLES = {
    "Table 3 (OptiX)": {
        "CS": ("optix-cs", FAR, 29.99, 60.0), "B": ("optix-b", FAR, 30.0, 59.99), "HB": ("optix-hb", FAR, 29.99, 59.97),
        "GL": ("optix-gl", FAR, 29.99, 51.21), "CGL": ("optix-gl", CLOSE, 14.20, 14.43),
        "GD": ("optix-gd", FAR, 29.99, 37.81), "CGD": ("optix-gd", CLOSE, 10.16, 10.13)},
    "Table 4 (VKRay)": {
        "CS": ("vkray-cs", FAR, 30.19, 59.79), "B": ("vkray-b", FAR, 30.15, 59.75),
        "HB": ("vkray-hb", FAR, 30.07, 29.99), "HBF": ("vkray-hbf", FAR, 30.32, 59.51),
        "MD": ("vkray-md", FAR, 15.16, 15.01), "CMD": ("vkray-md", CLOSE, 5.73, 5.98)}}
# File → title, table, scenes that the camera approaches (far view, and close view if the table has one). The circles in
# the figures are the author's frame rates of the ray tracer alone.
FIGURES = {
    "figure-23.svg": ("Figure 23: the camera approaches, OptiX scenes", "Table 3 (OptiX)", [("GL", "CGL"), ("GD", "CGD")]),
    "figure-26.svg": ("Figure 26: the camera approaches, VKRay scenes", "Table 4 (VKRay)", [("CS", None), ("MD", "CMD")])}


def scene_file(scene):
    return ROOT / f"config/scenes/{scene}.yaml"


def replay(scene, trajectory, frames, with_pipeline):
    """Returns a run's statistics, timeline and stderr."""
    pipeline = ["--with-pipeline", "--set",
                f"source={{plugin: source_file, path: \"{FRAME}\", options: {{frames: {frames}}}}}"]
    return replays.replay(scene_file(scene), trajectory, frames, *(pipeline if with_pipeline else []))


def make_frame():
    (OUT / "frame.yaml").write_text(f"""version: 1
source: {{plugin: source_synthetic, options: {{frames: 1, width: {WIDTH}, height: {HEIGHT}}}}}
outputs: [{{plugin: sink_images, path: "{FRAME}"}}]
""")
    subprocess.run([BUILD / "bin/arhost", "--config", OUT / "frame.yaml"], check=True, stderr=subprocess.DEVNULL)


def face_count_note(scene, log):
    """A note if the mesh has fewer faces than the dissertation's, as counted by the loader."""
    wanted = re.search(r"stand_in: \{faces: (\d+)", scene_file(scene).read_text())
    found = [int(count) for count in re.findall(r"models/\S+: (\d+) triangles", log)]
    if wanted and found and found[0] < 0.99 * int(wanted[1]):
        return f"   {found[0]:,} faces, the dissertation's has {int(wanted[1]):,}"
    return ""


def print_tables(seconds):
    results = {}
    for title, scenes in TABLES.items():
        print(f"{title}: {WIDTH}x{HEIGHT}, frames per second\n"
              f"  {'scene':6} {'dissertation':^24}   {'arhost with rt_embree, ' + str(os.cpu_count()) + ' cores':^34}\n"
              f"  {'':6} {'whole':>7} {'alone':>7} {'ratio':>7}   {'whole':>8} {'alone':>8} {'ratio':>7}  ray tracer, ms")
        for name, (scene, view, whole, alone) in scenes.items():
            trajectory = OUT / "still.jsonl"
            write_trajectory(trajectory, [VIEWS[scene][view]] * 2000, scene.startswith("vkray"))
            probe = frames_per_second(replay(scene, trajectory, 12, False)[1])
            frames = max(24, min(2000, int(seconds * probe)))
            _, rows_alone, log = replay(scene, trajectory, frames, False)
            _, rows_whole, _ = replay(scene, trajectory, frames, True)
            ours_alone, ours_whole = frames_per_second(rows_alone), frames_per_second(rows_whole)
            tracer = [statistics.median(row["raytracer_ms"] for row in rows) for rows in (rows_whole, rows_alone)]
            stand_in = "   a stand-in for the scan" if "stand-in" in log else ""
            note = stand_in or face_count_note(scene, log)
            print(f"  {name:6} {whole:7.2f} {alone:7.2f} {whole / alone:7.3f}   {ours_whole:8.2f} {ours_alone:8.2f} "
                  f"{ours_whole / ours_alone:7.3f}  {tracer[0]:.2f} / {tracer[1]:.2f}{note}", flush=True)
            results[f"{title}, {name}"] = {
                "dissertation": {"whole": whole, "alone": alone}, "frames": frames,
                "arhost": {"whole": ours_whole, "alone": ours_alone, "raytracer_ms_whole": tracer[0],
                           "raytracer_ms_alone": tracer[1]}, "stand_in": bool(stand_in), "note": note.strip()}
        print()
    return results


def approach(scene, frames):
    """From far to close at constant speed."""
    (eye, at), (near_eye, near_at) = VIEWS[scene] if scene != "vkray-cs" else (VIEWS[scene][0], ((0, 75, 130), (0, 40, 0)))
    for i in range(frames):
        fraction = i / (frames - 1)
        yield tuple(tuple(a + fraction * (b - a) for a, b in zip(p, q)) for p, q in ((eye, near_eye), (at, near_at)))


def smoothed(rows):
    """(Position along the trajectory 0 to 1, frames per second over the surrounding nine frames.)"""
    points = []
    for i in range(4, len(rows) - 4):
        points.append((i / (len(rows) - 1), 8 / (rows[i + 4]["shown_s"] - rows[i - 4]["shown_s"])))
    return points


def draw(file, title, curves, marks):
    """curves: (label, colour, dashed, points); marks: (label, colour, x, frames per second). The frame rate axis is
    logarithmic."""
    left, top, width, height = 60, 50, 620, 330
    values = [y for _, _, _, points in curves for _, y in points] + [y for _, _, _, y in marks]
    low, high = math.floor(math.log2(min(values))), math.ceil(math.log2(max(values)))

    def place(x, y):
        return left + x * width, top + height * (1 - (math.log2(y) - low) / (high - low))

    svg = [f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 980 440" font-family="sans-serif" font-size="13">',
           '<rect width="980" height="440" fill="white"/>', f'<text x="{left}" y="28" font-size="16">{title}</text>',
           f'<text x="{left + width / 2}" y="425" text-anchor="middle">along the trajectory: from far to close</text>',
           f'<text transform="translate(18 {top + height / 2}) rotate(-90)" text-anchor="middle">frames per second</text>']
    for power in range(low, high + 1):
        _, y = place(0, 2.0 ** power)
        svg.append(f'<path d="M{left} {y:.1f}h{width}" stroke="#ddd"/>'
                   f'<text x="{left - 8}" y="{y + 4:.1f}" text-anchor="end">{2.0 ** power:g}</text>')
    legend = []
    for label, colour, dashed, points in curves:
        path = "M" + "L".join("{:.1f} {:.1f}".format(*place(*point)) for point in points)
        dash = ' stroke-dasharray="6 4"' if dashed else ""
        svg.append(f'<path d="{path}" fill="none" stroke="{colour}" stroke-width="2"{dash}/>')
        legend.append((f'<path d="M{left + width + 16} {{y}}h26" stroke="{colour}" stroke-width="2"{dash}/>', label))
    for label, colour, x, value in marks:
        px, py = place(x, value)
        svg.append(f'<circle cx="{px:.1f}" cy="{py:.1f}" r="5" fill="none" stroke="{colour}" stroke-width="2"/>')
    for label, colour in dict.fromkeys((label, colour) for label, colour, _, _ in marks):
        legend.append((f'<circle cx="{left + width + 29}" cy="{{y}}" r="5" fill="none" stroke="{colour}" '
                       f'stroke-width="2"/>', label))
    for number, (sign, label) in enumerate(legend):
        y = top + 14 + 24 * number
        svg.append(sign.format(y=y) + f'<text x="{left + width + 50}" y="{y + 4}">{label}</text>')
    file.write_text("\n".join(svg) + "\n</svg>\n")


def draw_figures(frames):
    results = {}
    for file, (title, table, scenes) in FIGURES.items():
        curves, marks = [], []
        for (far, close), (strong, pale) in zip(scenes, (("#c0392b", "#e6a79f"), ("#1f6fb2", "#9cc3e2"))):
            scene = TABLES[table][far][0]
            trajectory = OUT / "approach.jsonl"
            write_trajectory(trajectory, list(approach(scene, frames)), scene.startswith("vkray"))
            whole, alone = (replay(scene, trajectory, frames, with_pipeline)[1] for with_pipeline in (True, False))
            curves += [(f"{far}, whole pipeline", strong, False, smoothed(whole)),
                       (f"{far}, ray tracer alone", strong, True, smoothed(alone))]
            for name, x in ((far, 0), (close, 1)):
                if name:
                    marks += [(f"{far}, dissertation (GTX 1060)", pale, x, TABLES[table][name][3])]
            ratio = frames_per_second(whole) / frames_per_second(alone)
            results[f"{title}: {far}"] = {"whole_to_alone": ratio, "whole": smoothed(whole), "alone": smoothed(alone)}
            print(f"  {title.split(':')[0]}, {far}: {smoothed(alone)[0][1]:.1f} to {smoothed(alone)[-1][1]:.1f} frames per second "
                  f"alone, whole to alone {ratio:.3f}", flush=True)
        draw(OUT / file, title, curves, marks)
        print(f"  {(OUT / file).relative_to(ROOT)}", flush=True)
    print()
    return results


def cpu_ms_per_frame(scene, trajectory, frames, with_pipeline):
    """By component: the difference between a long and a short run, which excludes start-up and scene loading. Both cover
    whole periods of the trajectory."""
    short = 10
    a, b = (replay(scene, trajectory, count, with_pipeline)[0]["cpu_seconds"] for count in (short, short + frames))
    return {name: 1e3 * (b[name] - a[name]) / frames for name in b}


def print_overhead(frames, rounds):
    """The middleware's overhead in CPU time, which is less sensitive to other load than wall time."""
    results, missed = {}, []
    print(f"arhost's overhead: CPU time per frame, {WIDTH}x{HEIGHT}, medians of {rounds} alternating rounds (target 1.03):\n"
          f"  {'scene':8} {'ray tracer: whole, alone, ratio':^32}   {'all: whole, sum of parts, ratio':^34}")
    for scene in ("optix-cs", "optix-b", "vkray-b"):
        trajectory = OUT / "approach.jsonl"
        write_trajectory(trajectory, list(approach(scene, 10)) * 100, scene.startswith("vkray"))
        rows = []
        for _ in range(rounds):
            parts = json.loads(subprocess.run(
                [BUILD / "bin/plugins-alone", scene_file(scene), trajectory, FRAME, str(frames)],
                capture_output=True, text=True, check=True).stdout)
            alone = cpu_ms_per_frame(scene, trajectory, frames, False)
            whole = cpu_ms_per_frame(scene, trajectory, frames, True)
            rows.append((whole["raytracer"], alone["raytracer"], whole["total"], sum(parts.values())))
        tracer_whole, tracer_alone, total, parts = (statistics.median(column) for column in zip(*rows))
        tracer_ratio = statistics.median(row[0] / row[1] for row in rows)
        total_ratio = statistics.median(row[2] / row[3] for row in rows)
        print(f"  {scene:8} {tracer_whole:9.2f} {tracer_alone:9.2f} {tracer_ratio:9.3f}       {total:9.2f} {parts:9.2f} {total_ratio:9.3f}",
              flush=True)
        results[scene] = {"tracer": tracer_ratio, "total": total_ratio}
        missed += [f"{scene}: {what} {ratio:.3f}" for what, ratio in (("tracer", tracer_ratio), ("whole", total_ratio)) if ratio > 1.03]
    print()
    return results, missed


def main():
    quick = "--quick" in sys.argv[1:]
    parts = [word for word in sys.argv[1:] if word != "--quick"] or ["overhead", "tables", "figures"]
    if unknown := set(parts) - {"overhead", "tables", "figures"}:
        raise SystemExit(f"unknown part: {', '.join(sorted(unknown))}; use overhead, tables or figures")
    OUT.mkdir(parents=True, exist_ok=True)
    make_frame()
    file = OUT / ("quick.json" if quick else "tables.json")  # keep the results of parts not measured now
    results, missed = json.loads(file.read_text()) if file.exists() else {}, []
    if "overhead" in parts:
        results["overhead"], missed = print_overhead(30 if quick else 100, 1 if quick else 15)
    if "tables" in parts:
        results["tables"] = print_tables(0.5 if quick else 8)
    if "figures" in parts:
        results["figures"] = draw_figures(20 if quick else 120)
    file.write_text(json.dumps(results, indent=1) + "\n")
    if missed and not quick:
        raise SystemExit("missed: " + "; ".join(missed))


if __name__ == "__main__":
    main()
