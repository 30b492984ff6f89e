# SPDX-License-Identifier: Apache-2.0
"""Mitsuba 3 with Open Image Denoise for tools/bench equal-quality: peer_mitsuba.py WIDTH HEIGHT THREADS (peer.py)."""
import importlib.metadata
import os
import sys

import drjit as dr
import mitsuba as mi
import numpy as np
import pyoidn

from peer import serve
from scene import LOOK_AT, SCENE, eye, fov_y_degrees

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "light"))
import reference  # noqa: E402

width, height, threads = map(int, sys.argv[1:])
dr.set_thread_count(threads)
T = mi.ScalarTransform4f


def shape(thing):
    if "sphere" in thing:
        return reference.shape(thing, SCENE["materials"], "")
    if "plane" in thing:
        made = {"type": "rectangle", "to_world": T().scale(thing["plane"]["size"] / 2)}
    else:
        made = {"type": "cube", "to_world": T().translate(thing["cuboid"]["centre"]) @ T().scale(
            [each / 2 for each in thing["cuboid"]["size"]])}
        for step in thing["transform"]:
            move = T().translate(step["translate"]) if "translate" in step else \
                T().rotate(step["rotate"]["axis"], step["rotate"]["degrees"])
            made["to_world"] = move @ made["to_world"]
    return made | {"bsdf": reference.bsdf(SCENE["materials"][thing["material"]], "")}


def load(degrees):
    made = {"type": "scene", "sky": {"type": "constant", "radiance": reference.rgb(SCENE["background"])}, "sensor": {
        "type": "perspective", "fov": fov_y_degrees(width, height), "fov_axis": "y", "near_clip": 1, "far_clip": 100_000,
        "to_world": T().look_at(origin=eye(degrees), target=LOOK_AT, up=[0, 0, 1]), "sampler": {"type": "multijitter"},
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb",
                 "component_format": "float32"}}}
    for i, thing in enumerate(SCENE["objects"]):
        made[f"object-{i}"] = shape(thing)
    for i, lamp in enumerate(SCENE["lights"]):
        made[f"lamp-{i}"] = reference.emitter(lamp) | {
            "to_world": reference.plane_transform(lamp["position"], lamp["size"], lamp["direction"], up=(0, 0, 1))}
    return mi.load_dict(made)


# arhost's depth counts bounces, Mitsuba's counts rays.
integrator = mi.load_dict({"type": "aov", "aovs": "albedo:albedo,normal:sh_normal", "path": {
    "type": "path", "max_depth": SCENE["max_depth"] + 1}})
device = pyoidn.Device()
device.set_int("numThreads", threads)
device.commit()
layers = {name: np.zeros((height, width, 3), np.float32) for name in ("color", "albedo", "normal", "output")}


def denoiser(quality):
    made = pyoidn.Filter(device)
    for name, layer in layers.items():
        made.set_image(name, layer, pyoidn.OIDN_FORMAT_FLOAT3)
    made.set_bool("hdr", True)
    made.set_bool("cleanAux", quality == pyoidn.OIDN_QUALITY_HIGH)  # of the converged picture
    made.set_quality(quality)
    made.commit()
    return made


denoisers = {"fast": denoiser(pyoidn.OIDN_QUALITY_FAST), "high": denoiser(pyoidn.OIDN_QUALITY_HIGH)}
scenes, frames = {}, {}


def render(degrees, samples, seed, quality):
    if degrees not in scenes:
        scenes[degrees] = load(degrees)
    once = min(samples, 64)
    if once not in frames:
        # Records the kernel once; otherwise Python traces it again each frame.
        frames[once] = dr.freeze(lambda scene, number: mi.render(scene, integrator=integrator, spp=once, seed=number))
    # A literal seed would be compiled into the kernel.
    rendered = np.mean([np.array(frames[once](scenes[degrees], dr.opaque(mi.UInt32, 1000 * seed + i)))
                        for i in range(samples // once)], 0)
    for i, name in enumerate(("color", "albedo", "normal")):
        layers[name][:] = rendered[..., 3 * i:3 * i + 3]
    denoisers[quality].execute()


serve(f"Mitsuba {mi.__version__}, Dr.Jit {dr.__version__}, LLVM {'.'.join(map(str, dr.detail.llvm_version()))}, "
      f"pyoidn {importlib.metadata.version('pyoidn')}", render, lambda: layers["output"])
