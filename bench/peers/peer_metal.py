# SPDX-License-Identifier: Apache-2.0
"""Mitsuba 3 for metal.py; prints JSON.

peer_metal.py intensity IMAGE: the factor that scales the image's mean radiance to 0.25.
peer_metal.py compare IMAGE INTENSITY ROUGHNESSES PICTURE…: for each picture, the light of each sphere relative to
Mitsuba's. Both are limited to white. Writes the pictures and Mitsuba's, one below the other, beside the first one."""
import json
import os
import sys

import mitsuba as mi
import numpy as np
from PIL import Image

mi.set_variant("scalar_rgb")  # needs no LLVM
what, image, *rest = sys.argv[1:]

if what == "intensity":
    light = np.array(mi.Bitmap(image).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    rows = np.sin(np.pi * (np.arange(light.shape[0]) + 0.5) / light.shape[0])
    print(0.25 / float((light.mean((1, 2)) * rows).sum() / rows.sum()))
    sys.exit()

intensity, roughnesses, pictures = float(rest[0]), json.loads(rest[1]), rest[2:]
T = mi.ScalarTransform4f
parts = {
    "type": "scene", "integrator": {"type": "path", "max_depth": 9, "rr_depth": 10_000},
    # In arhost, the image's centre is in front of a y-up scene; in Mitsuba, its edge is.
    "sky": {"type": "envmap", "filename": image, "scale": intensity, "to_world": T().rotate([0, 1, 0], 180)},
    "sensor": {"type": "perspective", "fov": 30, "fov_axis": "y", "near_clip": 1, "far_clip": 10_000,
               "to_world": T().look_at(origin=[0, 0, 300], target=[0, 0, 0], up=[0, 1, 0]),
               "sampler": {"type": "independent"},
               "film": {"type": "hdrfilm", "width": 640, "height": 160, "rfilter": {"type": "box"},
                        "pixel_format": "rgb", "component_format": "float32"}},
}
for i, roughness in enumerate(roughnesses):
    parts[f"sphere{i}"] = {
        "type": "sphere", "center": [60 * i - 120, 0, 0], "radius": 25,
        # White metal: Schlick's and Fresnel's reflectance are then both 1.
        "bsdf": {"type": "roughconductor", "material": "none", "distribution": "ggx",
                 "alpha": max(roughness ** 2, 0.001)}}
light = np.clip(np.array(mi.render(mi.load_dict(parts), spp=128, seed=0)), 0, 1)

f = 160 / 2 / np.tan(np.radians(15))
y, x = np.mgrid[0:160, 0:640]
masks = [np.hypot(x - 319.5 - f * (60 * i - 120) / 300, y - 79.5) < 0.94 * f * 25 / 300 for i in range(len(roughnesses))]
# At an edge of the view, a sphere looks elongated: its inside still covers this disc.
ratios, rows = [], []
for picture in pictures:
    codes = np.asarray(Image.open(picture).convert("RGBA"), np.float64) / 255
    ours = np.where(codes <= 0.04045, codes / 12.92, ((codes + 0.055) / 1.055) ** 2.4)[..., :3]
    assert all((codes[mask, 3] == 1).all() for mask in masks), "the spheres are not where they should be"
    ratios.append([float(ours[mask].mean() / light[mask].mean()) for mask in masks])
    rows.append(codes[..., :3] * codes[..., 3:])
rows.append(np.where(light <= 0.0031308, 12.92 * light, 1.055 * light ** (1 / 2.4) - 0.055))
name = os.path.splitext(os.path.basename(image))[0]
if pictures:
    Image.fromarray((255 * np.concatenate(rows, 0) + 0.5).astype(np.uint8)).save(
        os.path.join(os.path.dirname(pictures[0]), f"metal-{name}.png"))
print(json.dumps(ratios))
