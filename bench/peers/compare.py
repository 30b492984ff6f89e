# SPDX-License-Identifier: Apache-2.0
"""compare.py FOLDER PEER CASE…: prints differences between a peer's pictures and rt_embree's as JSON.
compare.py FOLDER picture CASE… PEER…: writes all pictures side by side to peers.png."""
import json
import os
import sys

import numpy as np
from PIL import Image

folder, what, *names = sys.argv[1:]
with open(os.path.join(folder, "scene.json"), encoding="utf-8") as file:
    scene = json.load(file)
shape = (scene["height"], scene["width"], 4)


def ours(case):
    """Linear, composited over the background that peers render."""
    rgba = np.fromfile(os.path.join(folder, f"ours-{case}.rgba"), np.uint8).reshape(shape) / 255
    light = np.where(rgba <= 0.04045, rgba / 12.92, ((rgba + 0.055) / 1.055) ** 2.4)[..., :3]
    alpha = rgba[..., 3:]
    return np.concatenate([light * alpha + (1 - alpha) * (case != "diffuse"), alpha], 2)


def peers(name, case):
    return np.fromfile(os.path.join(folder, f"{name}-{case}.f32"), np.float32).reshape(shape)


if what == "picture":
    cases = [name for name in names if name not in ("mitsuba", "cycles")]
    rows = []
    for case in cases:
        row = [ours(case)] + [peers(name, case) for name in names if name not in cases]
        linear = np.clip(np.concatenate([picture[..., :3] for picture in row], 1), 0, 1)
        rows.append(np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055))
    Image.fromarray((255 * np.concatenate(rows, 0) + 0.5).astype(np.uint8)).save(os.path.join(folder, "peers.png"))
else:
    found = {}
    for case in names:
        a, b = ours(case), peers(what, case)
        both_hit = (a[..., 3] > 0.5) & (b[..., 3] > 0.5)
        found[case] = {"mask": float(np.abs(a[..., 3] - b[..., 3]).mean()),
                       "our_light": float(a[both_hit, :3].mean()), "light": float(np.clip(b[both_hit, :3], 0, 1).mean()),
                       "difference": float(np.abs(a[both_hit, :3] - np.clip(b[both_hit, :3], 0, 1)).mean())}
    print(json.dumps(found))
