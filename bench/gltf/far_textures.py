#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""A chessboard floor that reaches to the horizon under a moving camera: bench/gltf/far_textures.py. Compares frames of
few samples with frames of 256 samples. Method: bench/gltf/README.md."""
import json
import os
import subprocess
import sys

here = os.path.dirname(os.path.abspath(__file__))
root = os.path.dirname(os.path.dirname(here))
sys.path.insert(0, os.path.join(root, "bench", "peers"))
import peers  # noqa: E402

peers.enter({"pillow": "13.0.0"})

import numpy as np  # noqa: E402
from PIL import Image  # noqa: E402

FOLDER = os.path.join(root, "build", "far-textures")
WIDTH, HEIGHT, FOCAL_PX = 320, 240, 330
FRAMES, STEP_MM, REFERENCE_SAMPLES = 12, 1.7, 256
FAR_ROWS = 130  # above this row, a pixel covers more than a field of the board


def write_scenes():
    os.makedirs(FOLDER, exist_ok=True)
    field = np.add.outer(np.arange(256) // 16, np.arange(256) // 16) % 2
    Image.fromarray(np.uint8(field[..., None] * np.array([225, 215, 200]) + 20)).save(os.path.join(FOLDER, "board.png"))
    with open(os.path.join(FOLDER, "floor.obj"), "w", encoding="utf-8") as file:
        file.write("v -2000 0 0\nv 2000 0 0\nv 2000 6000 0\nv -2000 6000 0\nvt 0 0\nvt 40 0\nvt 40 60\nvt 0 60\n"
                   "f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n")
    board = {"model": "metallic-roughness", "colour": 0, "metallic": 0, "roughness": 1, "emission_texture": "board.png"}
    scene = {"version": 2, "axes": "z-up", "background": 0, "materials": {"board": board},
             "objects": [{"mesh": "floor.obj", "material": "board"}]}
    with open(os.path.join(FOLDER, "floor.yaml"), "w", encoding="utf-8") as file:
        json.dump(scene, file)  # YAML contains JSON


def codes_of(samples):
    """The pixels of all frames"""
    frames = []
    for number in range(FRAMES):
        x, out = STEP_MM * number, os.path.join(FOLDER, "frame.f32")
        words = [os.path.join(FOLDER, "floor.yaml"), out, WIDTH, HEIGHT, FOCAL_PX, x, -300, 250, x, 1500, 0,
                 0, 0, 1, samples, 1, "max_radiance=0"]
        subprocess.run([os.path.join(peers.binaries, "render-light"), *map(str, words)], check=True, stdout=subprocess.DEVNULL)
        light = np.clip(np.fromfile(out, np.float32).reshape(HEIGHT, WIDTH, 6)[..., :3], 0, 1)
        frames.append(255 * np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055))
    return np.array(frames)


write_scenes()
reference = codes_of(REFERENCE_SAMPLES)
floor = reference.min(axis=(0, 3)) > 0
floor[FAR_ROWS:] = False
print("samples  RMS, codes  flicker, codes")
for samples in (1, 4, 16):
    error = (codes_of(samples) - reference)[:, floor]
    print(f"{samples:7} {np.sqrt((error ** 2).mean()):11.1f} {np.sqrt(error.var(axis=0).mean()):15.1f}", flush=True)
