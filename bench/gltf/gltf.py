#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""glTF models in rt_embree compared with Blender Cycles: tools/bench gltf [--quick], or
bench/gltf/gltf.py [--quick] [MODEL…]. Method: bench/gltf/README.md. Exits with 1 if a target is missed."""
import glob
import hashlib
import json
import os
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
sys.path.insert(0, os.path.join(root, "bench", "peers"))
import peers  # noqa: E402

peers.enter({"bpy": "5.0.1", "pillow": "13.0.0", "flip-evaluator": "1.7"})

import flip_evaluator  # noqa: E402
import numpy as np  # noqa: E402
from PIL import Image, ImageDraw, ImageFont  # noqa: E402

QUICK = "--quick" in sys.argv
NAMES = [word for word in sys.argv[1:] if not word.startswith("--")]
FOLDER = os.path.join(root, "build", "gltf" + "-quick" * QUICK)
DATA = os.path.join(root, "..", "shared", "data")
MODELS = os.path.join(DATA, "gltf")
QUICK_MODELS = ("BoxTextured", "Duck", "MetalRoughSpheresNoTextures")
SETTINGS = {"width": 512, "height": 384, "focal_px": 1024, "bounces": 12, "samples": 16 if QUICK else 256,
            "environment": os.path.abspath(os.path.join(DATA, "env", "lebombo_1k.hdr")), "intensity": 0.6}
BACKGROUND = 0.5  # sRGB
LARGEST_SILHOUETTE, LARGEST_FLIP = 0.05, 0.05  # % of the pixels; mean of the models
# From the model to the camera, with +y up and the front at +z.
THREE_QUARTER, FRONT = (0.6, 0.45, 1), (0, 0, 1)
DIRECTIONS = {name: FRONT for name in (
    "AlphaBlendModeTest", "AttenuationTest", "ClearCoatTest", "EmissiveStrengthTest", "InterpolationTest",
    "MeshPrimitiveModes", "MetalRoughSpheresNoTextures", "MultiUVTest", "NormalTangentTest", "TextureTransformTest",
    "TransmissionTest")}
# Behind their blended surfaces, arhost shows the video or the environment, and Cycles nothing: their silhouettes differ.
SEEN_THROUGH = {"ClearCoatTest"}
# Cycles does not show these as glTF defines them.
NOT_CARRIED = {"TransmissionTest": "thin walls, which Blender refracts as solid glass"}
CELL, LABEL, LARGEST_SHEET = (192, 144), 14, 400_000  # px, px, bytes


def model_file(name):
    files = glob.glob(os.path.join(MODELS, name, "glTF-Binary", "*.glb")) or glob.glob(os.path.join(MODELS, name, "glTF", "*.gltf"))
    return os.path.abspath(files[0]) if files else None


def key_of(name):
    """Changes if the model or the settings change."""
    sums = hashlib.sha256(json.dumps([SETTINGS, DIRECTIONS.get(name, THREE_QUARTER)]).encode())
    for path in [os.path.join(here, "render.py"), *sorted(glob.glob(os.path.join(os.path.dirname(model_file(name)), "*")))]:
        with open(path, "rb") as file:
            sums.update(file.read())
    return sums.hexdigest()


def path_of(name, ending):
    return os.path.join(FOLDER, name + ending)


def cached(name):
    try:
        return str(np.load(path_of(name, "-cycles.npz"))["key"]) == key_of(name)
    except OSError:
        return False


def render_cycles(names):
    """Renders what has changed. Models of NOT_CARRIED as well: their cameras come from Blender."""
    jobs = [{"file": model_file(name), "out": path_of(name, "-cycles.npz"), "key": key_of(name),
             "direction": DIRECTIONS.get(name, THREE_QUARTER)} for name in names if not cached(name)]
    if not jobs:
        return
    print(f"Cycles renders {len(jobs)} models with {SETTINGS['samples']} samples", flush=True)
    with open(path_of("jobs", ".json"), "w", encoding="utf-8") as file:
        json.dump({**SETTINGS, "models": jobs}, file)
    with open(path_of("cycles", ".log"), "w", encoding="utf-8") as log:
        process = subprocess.Popen([sys.executable, os.path.join(here, "render.py"), path_of("jobs", ".json")],
                                   stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        for line in process.stdout:
            log.write(line)
            if line.startswith("rendered: "):
                print("  " + line, end="", flush=True)
    if process.wait() != 0:
        raise SystemExit(f"gltf: Blender failed: see {path_of('cycles', '.log')}")


def render_arhost(name, eye, at):
    """(light, coverage), and what rt_embree rejects instead"""
    out = path_of(name, ".f32")
    scene = {"version": 2, "axes": "y-up", "max_depth": SETTINGS["bounces"],
             "environment": {"image": SETTINGS["environment"], "intensity": SETTINGS["intensity"]}, "materials": {},
             "objects": [{"gltf": model_file(name), "transform": [{"scale": 1000}]}]}
    with open(path_of(name, ".yaml"), "w", encoding="utf-8") as file:
        json.dump(scene, file)  # YAML contains JSON
    width, height, frames = SETTINGS["width"], SETTINGS["height"], max(1, SETTINGS["samples"] // 64)
    words = [path_of(name, ".yaml"), out, width, height, SETTINGS["focal_px"], *(f"{1000 * each:.9g}" for each in (*eye, *at)),
             0, 1, 0, SETTINGS["samples"] // frames, frames, "max_radiance=0"]
    ran = subprocess.run([os.path.join(peers.binaries, "render-light"), *map(str, words)], stdout=subprocess.PIPE,
                         stderr=subprocess.PIPE, text=True, check=False)
    if ran.returncode != 0:
        return None, ran.stderr.strip()
    values = np.fromfile(out, np.float32).reshape(height, width, 6)
    os.remove(out)
    return (values[..., :3], 1 - values[..., 3:].mean(-1)), ""


def encoded(light, coverage):
    """Codes over the background, not rounded."""
    light = np.clip(light + (1 - coverage[..., None]) * ((BACKGROUND + 0.055) / 1.055) ** 2.4, 0, 1)
    return 255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055)


class Comparison:
    """A model's pictures, and their differences."""

    def __init__(self, name):
        self.name, self.reason = name, NOT_CARRIED.get(name, "")
        truth = np.load(path_of(name, "-cycles.npz"))
        self.cycles = encoded(truth["pixels"][..., :3], truth["pixels"][..., 3])
        rendered, self.rejected = render_arhost(name, truth["eye"], truth["at"])
        if self.rejected:
            return
        self.arhost = encoded(*rendered)
        coverage = truth["pixels"][..., 3]
        self.silhouette = 100 * float(np.abs(rendered[1] - coverage).mean())
        covered = np.maximum(rendered[1], coverage) > 0
        self.codes = float(np.abs(self.arhost - self.cycles)[covered].mean())
        flip = flip_evaluator.evaluate(np.float32(self.cycles / 255), np.float32(self.arhost / 255), "LDR", applyMagma=False)[0]
        self.flip = float(flip[covered].mean())
        for renderer, picture in (("cycles", self.cycles), ("arhost", self.arhost)):
            Image.fromarray(np.uint8(np.round(picture))).save(path_of(name, f"-{renderer}.png"))

    def row(self):
        if self.rejected:
            return f"{self.name:28} rejected: {self.rejected}"
        return f"{self.name:28} {self.silhouette:13.3f} {self.flip:8.3f} {self.codes:8.2f}   {self.reason}"

    def strip(self):
        """Its row of the sheet: the viewer's screenshot, Cycles, arhost, difference."""
        shown = [None, None if self.reason else self.cycles, None if self.rejected else self.arhost, None]
        if shown[1] is not None and shown[2] is not None:
            shown[3] = 127.5 + 2 * (self.arhost - self.cycles)
        cells = [Image.fromarray(np.uint8(np.clip(np.round(each), 0, 255))) if each is not None else None for each in shown]
        screenshot = glob.glob(os.path.join(MODELS, self.name, "screenshot", "screenshot.*"))
        cells[0] = Image.open(screenshot[0]).convert("RGB") if screenshot else None
        strip = Image.new("RGB", (4 * (CELL[0] + 2), CELL[1] + LABEL + 2), "white")
        for i, cell in enumerate(cells):
            if cell:
                cell.thumbnail(CELL, Image.Resampling.LANCZOS)
                strip.paste(cell, (i * (CELL[0] + 2) + (CELL[0] - cell.width) // 2, LABEL + (CELL[1] - cell.height) // 2))
        label = self.name + (": rejected" if self.rejected else f": {self.reason}" if self.reason else
                             f": silhouette {self.silhouette:.3f} %, FLIP {self.flip:.3f}, {self.codes:.1f} codes")
        ImageDraw.Draw(strip).text((3, 0), label, fill="black", font=ImageFont.load_default(11))
        return strip


def write_sheet(strips):
    width, height = strips[0].size
    rows = -(-len(strips) // 2)
    sheet = Image.new("RGB", (2 * width + 10, rows * height), "white")
    for i, strip in enumerate(strips):
        sheet.paste(strip, (i // rows * (width + 10), i % rows * height))
    for quality in range(90, 30, -5):
        sheet.save(path_of("sheet", ".jpg"), quality=quality)
        if os.path.getsize(path_of("sheet", ".jpg")) < LARGEST_SHEET:
            break


def main():
    if not os.path.isdir(MODELS):
        print("gltf is skipped, because ../shared/data is missing")
        return 0
    names = NAMES or (QUICK_MODELS if QUICK else sorted(name for name in os.listdir(MODELS) if model_file(name)))
    if unknown := [name for name in names if not model_file(name)]:
        raise SystemExit(f"gltf: ../shared/data/gltf has no model {', '.join(unknown)}")
    os.makedirs(FOLDER, exist_ok=True)
    render_cycles(names)
    print(f"{'model':28} {'silhouette, %':>13} {'FLIP':>8} {'codes':>8}   not comparable", flush=True)
    compared = []
    for name in names:
        compared.append(Comparison(name))
        print(compared[-1].row(), flush=True)
    write_sheet([each.strip() for each in compared])
    if QUICK:
        return 0
    missed = [f"{each.name} is rejected" for each in compared if each.rejected]
    carried = [each for each in compared if not each.rejected and not each.reason]
    missed += [f"{each.name}: silhouette {each.silhouette:.3f} %, target {LARGEST_SILHOUETTE}" for each in carried
               if each.silhouette > LARGEST_SILHOUETTE and each.name not in SEEN_THROUGH]
    mean = sum(each.flip for each in carried) / max(1, len(carried))
    print(f"mean FLIP of {len(carried)} models: {mean:.3f}")
    if mean > LARGEST_FLIP:
        missed.append(f"mean FLIP {mean:.3f}, target {LARGEST_FLIP}")
    print("\n".join("missed: " + each for each in missed) or "all targets met")
    return 1 if missed else 0


sys.exit(main())
