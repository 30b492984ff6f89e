#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""How far a picture with virtual objects is from the truth: tools/bench truth [--quick] [--moving] [--other]. Method:
bench/truth/README.md.

Renders rooms with Blender Cycles, without virtual objects (plate) and with them (truth), lets arhost add the objects to
the plate, and prints the differences. --quick: one view, 32 samples. --other: other rooms. --moving: a moving camera in
all rooms, with `quality: realtime`; --moving --quick: two frames of one room, 4 samples. Pictures are kept in build/truth,
truth-quick, truth-moving or truth-moving-quick; what exists is not rendered again. The first run takes hours on two cores,
or less than one with --moving."""
import gzip
import json
import os
import shutil
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
sys.path.insert(0, os.path.join(root, "bench", "peers"))
import peers  # noqa: E402

PACKAGES = {"bpy": "5.0.1", "pillow": "13.0.0", "flip-evaluator": "1.7", "scikit-image": "0.26.0"}
QUICK = "--quick" in sys.argv
MOVING = "--moving" in sys.argv
SAMPLES = (4 if QUICK else 16) if MOVING else 32 if QUICK else 256
if MOVING and "--other" in sys.argv:
    raise SystemExit("truth: --moving measures all rooms; omit --other")
FOLDER = os.path.join(root, "build", "truth" + "-moving" * MOVING + "-quick" * QUICK)
BIN = os.path.join(root, "build", "release", "bin")
peers.enter(PACKAGES)

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

import measure  # noqa: E402
import rooms  # noqa: E402
import scenes  # noqa: E402

ROOMS = rooms.OTHER_ROOMS if "--other" in sys.argv else rooms.ROOMS
VIEWS = [str(view) for view in range(1 if QUICK else len(rooms.VIEWS))]
if MOVING:
    ROOMS = rooms.ROOMS[:1] if QUICK else rooms.ROOMS + rooms.OTHER_ROOMS
    VIEWS = [f"m{frame}" for frame in range(2 if QUICK else rooms.MOVING_FRAMES)]
# Frames of a moving camera that are compared with the truth. The targets are for the last ones, when the denoiser has
# a history.
FIRST_VIEWS, LAST_VIEWS = VIEWS[:4], VIEWS[-8:]
LARGEST_CODES, LARGEST_MEAN_CODES, LARGEST_MEAN_FLIP = 8, 6, 0.15


def render(jobs):
    wanted = []
    for job in jobs:
        name, picture, view = job.split("/")
        if not os.path.exists(os.path.join(FOLDER, name, f"{picture}-{view}.npy")):
            wanted.append(job)
    if wanted:
        print(f"Cycles renders {len(wanted)} pictures with {SAMPLES} samples", flush=True)
        process = subprocess.Popen([sys.executable, os.path.join(here, "render.py"), FOLDER, str(SAMPLES), *wanted],
                                   stdout=subprocess.PIPE, text=True)
        for line in process.stdout:
            if " of " in line and "/" in line and line[0].isdigit():
                print("  " + line, end="", flush=True)
        if process.wait() != 0:
            raise SystemExit("truth: Blender failed")


def prepare():
    """Writes the marker's picture and the bunny."""
    os.makedirs(FOLDER, exist_ok=True)
    marker = os.path.join(FOLDER, "marker.png")
    if not os.path.exists(marker):
        sheet, side = os.path.join(FOLDER, "sheet.png"), rooms.MARKER_SIDE_MM
        subprocess.run([os.path.join(BIN, "arhost"), "marker", "tag36h11:0", "--side", str(side), "--paper", "130x150",
                        "--margin", "4", "--dpi", "254", "-o", sheet], check=True, stdout=subprocess.DEVNULL)
        page = np.asarray(Image.open(sheet).convert("L"))
        top = int((page < 128).any(1).argmax())  # 10 px per mm; the marker's upper edge
        left = int((page[top] < 128).argmax())
        Image.fromarray(page[top:top + 10 * side, left:left + 10 * side]).save(marker)
    bunny = os.path.join(root, "..", "shared", "data", "meshes", "bunny_69451.ply.gz")
    mesh = os.path.join(FOLDER, "bunny.ply")
    if not os.path.exists(bunny):
        print("skipped: the bunny, because ../shared/data is missing")
    elif not os.path.exists(mesh):
        with gzip.open(bunny) as packed, open(mesh, "wb") as out:
            shutil.copyfileobj(packed, out)


def load(room, picture, view):
    return np.load(os.path.join(FOLDER, room.name, f"{picture}-{view}.npy"))


def photo(room, picture, view):
    return measure.photo(load(room, picture, view), room.name, view)


def areas_of(room, view):
    hits = np.load(os.path.join(FOLDER, room.name, f"labels-{view}.npz"))
    return measure.areas(load(room, "plate", view), load(room, "truth", view), hits)


def write_trajectory(file, views):
    header = {"format": "arhost-trajectory", "version": 1, "unit": "mm", "clock": "media", "fps": 25,
              "camera": {"width": rooms.WIDTH, "height": rooms.HEIGHT, "fx": rooms.FOCAL_PX, "fy": rooms.FOCAL_PX,
                         "cx": (rooms.WIDTH - 1) / 2, "cy": (rooms.HEIGHT - 1) / 2}}
    with open(file, "w", encoding="utf-8") as out:
        out.write(json.dumps(header) + "\n")
        for frame, view in enumerate(views):
            camera = rooms.camera_of(view)
            out.write(json.dumps({"frame": frame, "capture_ns": frame * 40_000_000, "eye": camera.eye, "look_at": camera.look_at,
                                  "up": camera.up}) + "\n")


def augmented(room, rig, light, table_roughness=0, views=tuple(VIEWS), options="quality: reference, samples: 256"):
    """arhost's pictures, as codes, by view."""
    folder = os.path.join(FOLDER, room.name, rig)
    shutil.rmtree(folder, ignore_errors=True)
    os.makedirs(folder)
    scenes.write_hdr(load(room, "probe", 0), os.path.join(folder, "environment.hdr"))
    bunny = os.path.join(FOLDER, "bunny.obj")
    with open(os.path.join(folder, "scene.yaml"), "w", encoding="utf-8") as out:
        out.write(scenes.scene(light, bunny if os.path.exists(bunny) else None, table_roughness))
    write_trajectory(os.path.join(folder, "cameras.jsonl"), views)
    for frame, view in enumerate(views):
        Image.fromarray(photo(room, "plate", view)).save(os.path.join(folder, f"plate-{frame}.png"))
    with open(os.path.join(folder, "run.yaml"), "w", encoding="utf-8") as out:
        out.write("version: 1\nsource: {plugin: source_file, path: plate-%d.png, fps: 25}\ntrajectory: cameras.jsonl\n"
                  "raytracer: {plugin: rt_embree, scene: scene.yaml, deadline_ms: 100000, "
                  f"options: {{{options}}}}}\n"
                  "outputs: [{plugin: sink_images, path: out-%d.png}]\n")
    ran = subprocess.run([os.path.join(BIN, "arhost"), "run.yaml"], cwd=folder, stderr=subprocess.PIPE, text=True, check=False)
    if ran.returncode != 0:
        raise SystemExit(ran.stderr)
    return [np.asarray(Image.open(os.path.join(folder, f"out-{frame}.png")).convert("RGB")) for frame in range(len(views))]


def rows_of(room):
    """The pictures of each row of the table, as codes, by view."""
    plates = [load(room, "plate", view) for view in VIEWS]
    photos = [photo(room, "plate", view) for view in VIEWS]
    catchers = []
    for view, plate in zip(VIEWS, plates):
        catcher = load(room, "catcher", view)
        catchers.append(measure.photo(catcher[..., :3] + (1 - catcher[..., 3:]) * plate[..., :3], room.name, view))
    return {"nothing": photos, "demo lamp": augmented(room, "demo", scenes.demo_light()),
            "default light": augmented(room, "default", scenes.default_light()),
            "whitted": augmented(room, "whitted", scenes.known_light(room, "whitted")),
            "known light": augmented(room, "known", scenes.known_light(room, "path"), room.table_roughness),
            "Blender's catcher": catchers,
            "floor": [photo(room, "again", view) for view in VIEWS]}


def write_film(file, pictures):
    """At a fifth of the camera's speed."""
    if not shutil.which("ffmpeg"):
        print("skipped: the film, because ffmpeg is not installed")
        return
    height, width = pictures[0].shape[:2]
    subprocess.run(["ffmpeg", "-v", "error", "-y", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", f"{width}x{height}", "-r", "5",
                    "-i", "-", "-pix_fmt", "yuv420p", "-crf", "16", file], input=b"".join(map(bytes, pictures)), check=True)


def measure_moving(room):
    """The differences with a moving camera, by row of the table. Writes a film, and a sheet of the last frame."""
    light, last = scenes.known_light(room, "path"), VIEWS[-1]
    plates = {view: photo(room, "plate", view) for view in VIEWS}
    realtime = dict(zip(VIEWS, augmented(room, "realtime", light, room.table_roughness, options="quality: realtime")))
    reference = augmented(room, "reference", light, room.table_roughness, views=[last])
    write_film(os.path.join(FOLDER, room.name + ".mp4"),
               [np.concatenate([plates[view], realtime[view]], 1) for view in VIEWS])
    sheet = [plates[last], photo(room, "truth", last), realtime[last], reference[0]]
    Image.fromarray(np.concatenate(sheet, 1)).save(os.path.join(FOLDER, room.name + ".png"))

    def differences(pictures, views):
        return measure.compare(pictures, [photo(room, "truth", view) for view in views],
                               [areas_of(room, view) for view in views])

    def of(pictures, views):
        return differences([pictures[view] for view in views], views)

    return {"nothing, last 8": of(plates, LAST_VIEWS), "realtime, first 4": of(realtime, FIRST_VIEWS),
            "realtime, last 8": of(realtime, LAST_VIEWS), "realtime, last 1": of(realtime, [last]),
            "reference, last 1": differences(reference, [last]),
            "floor, last 1": differences([photo(room, "again", last)], [last])}


def moving():
    results = {}
    for room in ROOMS:
        render([f"{room.name}/{picture}" for picture in (
            "probe/0", *(f"plate/{view}" for view in VIEWS),
            *(f"truth/{view}" for view in dict.fromkeys(FIRST_VIEWS + LAST_VIEWS)), f"again/{VIEWS[-1]}")])
        results[room.name] = measure_moving(room)
        print(f"{room.name}: " + ", ".join(f"{name}: {row['all']['codes']:.2f}" for name, row in results[room.name].items())
              + " codes", flush=True)
    write_results(results)
    if QUICK:
        return 0
    rows = {name: result["realtime, last 8"]["all"] for name, result in results.items()}
    checks = [(f"{name}: codes", row["codes"], LARGEST_CODES) for name, row in rows.items()]
    checks += [("mean codes", np.mean([row["codes"] for row in rows.values()]), LARGEST_MEAN_CODES),
               ("mean FLIP", np.mean([row["FLIP"] for row in rows.values()]), LARGEST_MEAN_FLIP)]
    missed = [f"missed: {what}: {value:.3g}, target {target}" for what, value, target in checks if value > target]
    print("\n".join(["", *(missed or ["all targets met"])]))
    if not os.path.exists(os.path.join(FOLDER, "bunny.obj")):
        print("not measured: the bunny")
    return 1 if missed else 0


def write_results(results):
    with open(os.path.join(FOLDER, "truth.json"), "w", encoding="utf-8") as out:
        json.dump(results, out, indent=1)
    measure.print_tables(results)


def main():
    prepare()
    if MOVING:
        return moving()
    jobs = [f"{room.name}/probe/0" for room in ROOMS]
    for view in VIEWS:
        jobs += [f"{room.name}/{picture}/{view}" for room in ROOMS for picture in ("plate", "truth", "catcher", "again")]
    render(jobs)
    results = {}
    for room in ROOMS:
        rows = rows_of(room)
        truths = [photo(room, "truth", view) for view in VIEWS]
        areas = [areas_of(room, view) for view in VIEWS]
        results[room.name] = {name: measure.compare(pictures, truths, areas) for name, pictures in rows.items()}
        sheet = [pictures[0] for name, pictures in rows.items() if name != "floor"] + [truths[0]]
        Image.fromarray(np.concatenate(sheet, 1)).save(os.path.join(FOLDER, f"{room.name}.png"))
    write_results(results)
    return 0


sys.exit(main())
