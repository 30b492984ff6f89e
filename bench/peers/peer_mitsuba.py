# SPDX-License-Identifier: Apache-2.0
"""Mitsuba 3 for tools/bench peers: peer_mitsuba.py FOLDER THREADS (served.py)."""
import sys

import drjit as dr
import mitsuba as mi
import numpy as np

from served import Scene, serve

mi.set_variant("llvm_ad_rgb")
dr.set_thread_count(int(sys.argv[2]))


class DirectDiffuse(mi.BSDF):
    """Lambert without indirect light: rt_embree has no diffuse interreflection."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        self.value = properties["value"] / np.pi
        self.m_components = [mi.BSDFFlags.DiffuseReflection | mi.BSDFFlags.FrontSide]
        self.m_flags = self.m_components[0]

    def sample(self, context, si, sample1, sample2, active):
        return dr.zeros(mi.BSDFSample3f), mi.Color3f(0)

    def eval(self, context, si, wo, active):
        lit = active & (mi.Frame3f.cos_theta(si.wi) > 0) & (mi.Frame3f.cos_theta(wo) > 0)
        return dr.select(lit, mi.Color3f(self.value * mi.Frame3f.cos_theta(wo)), 0)

    def pdf(self, context, si, wo, active):
        return mi.Float(0)

    def eval_pdf(self, context, si, wo, active):
        return self.eval(context, si, wo, active), mi.Float(0)


mi.register_bsdf("directdiffuse", DirectDiffuse)
spec = Scene(sys.argv[1])


def grey(value):
    return {"type": "rgb", "value": value}


def mesh(name, positions, normals, indices, bsdf):
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(bsdf)
    made = mi.Mesh(name, len(positions), len(indices), has_vertex_normals=normals is not None, props=properties)
    values = mi.traverse(made)
    values["vertex_positions"] = positions.ravel()
    if normals is not None:
        values["vertex_normals"] = normals.ravel()
    values["faces"] = indices.ravel()
    values.update()
    return made


def scene_of(case):
    surface = {
        "diffuse": {"type": "diffuse", "reflectance": grey(spec.bunny_grey)},
        "mirror": {"type": "conductor", "material": "none", "specular_reflectance": grey(spec.mirror_grey)},
        "glass-path": {"type": "dielectric", "int_ior": spec.glass_index, "ext_ior": 1.0,
                       "specular_reflectance": grey(spec.glass_grey),
                       "specular_transmittance": grey(spec.glass_grey)},
    }[case]
    parts = {
        "type": "scene",
        "sensor": {
            "type": "perspective", "fov": spec.fov_y_degrees, "fov_axis": "y", "near_clip": 1, "far_clip": 10000,
            "to_world": mi.ScalarTransform4f().look_at(origin=spec.eye, target=spec.look_at, up=[0, 1, 0]),
            "sampler": {"type": "independent", "sample_count": 1},
            "film": {"type": "hdrfilm", "width": spec.width, "height": spec.height, "rfilter": {"type": "box"},
                     "pixel_format": "rgb", "component_format": "float32"},
        },
        "bunny": mesh("bunny", spec.positions, spec.normals, spec.indices, surface),
    }
    if case != "glass-path":
        a = spec.ground_half_side
        corners = np.array([[-a, 0, -a], [-a, 0, a], [a, 0, a], [a, 0, -a]], np.float32)
        matt = {"type": "diffuse", "reflectance": grey(spec.ground_grey)} if case == "diffuse" else \
            {"type": "directdiffuse", "value": spec.ground_grey}
        parts["ground"] = mesh("ground", corners, None, np.array([[0, 1, 2], [0, 2, 3]], np.uint32), matt)
        # arhost's intensity includes Lambert's 1/π.
        parts["lamp"] = {"type": "point", "position": spec.lamp_position,
                         "intensity": grey(spec.lamp_intensity * np.pi)}
    if case != "diffuse":
        # The environment is visible only in mirrors and glass; the ground is lit by the lamp.
        parts["white"] = {"type": "constant", "radiance": grey(1), "sampling_weight": 0 if "lamp" in parts else 1}
    return mi.load_dict(parts)


# arhost's depth counts bounces, Mitsuba's counts rays; no Russian roulette.
def path(rays):
    return {"type": "path", "max_depth": rays, "rr_depth": 10_000}


integrators = {
    # A primary and a shadow ray, as in rt_embree.
    "diffuse": {"type": "direct", "emitter_samples": 1, "bsdf_samples": 0},
    "mirror": path(spec.mirror_depth + 1),
    "glass-path": path(spec.glass_depth + 1),
}
scenes, frames = {}, {}


def cached_scene(case):
    if case not in scenes:
        scenes[case] = scene_of(case)
    return scenes[case]


def render(case, seed):
    if case not in frames:
        integrator = mi.load_dict(integrators[case])
        # Record the kernel once; otherwise Python traces it again each frame.
        frames[case] = dr.freeze(lambda scene, number: mi.render(scene, integrator=integrator, spp=1, seed=number))
    np.array(frames[case](cached_scene(case), mi.UInt32(seed)))


def image(case, samples):
    scene = cached_scene(case)
    light = np.array(mi.render(scene, integrator=mi.load_dict(integrators[case]), spp=samples, seed=0))
    # Primary hits at pixel centres, as in rt_embree.
    sensor = scene.sensors()[0]
    number = np.arange(spec.width * spec.height)
    centres = mi.Point2f((number % spec.width + 0.5) / spec.width, (number // spec.width + 0.5) / spec.height)
    rays, _ = sensor.sample_ray(0, 0.5, centres, mi.Point2f(0.5))
    alpha = np.array(scene.ray_test(rays)).reshape(spec.height, spec.width, 1)
    return np.concatenate([light, alpha], 2)


def rays(case):
    """With lossless glass in white surroundings, a path limited to k rays is black unless it has left the glass, so the
    fraction of black pixels is the fraction of paths that trace ray k + 1."""
    scene = cached_scene(case)
    values = mi.traverse(scene)
    keys = [key for key in values.keys() if "specular_" in key and key.endswith("value")]

    def colour(value):
        for key in keys:
            values[key] = mi.Color3f(value)
        values.update()

    colour(1)
    count = 1.0
    for k in range(1, spec.glass_depth + 1):
        picture = np.array(mi.render(scene, integrator=mi.load_dict(path(k)), spp=1, seed=k))
        count += (picture[..., 0] == 0).mean()
    colour(spec.glass_grey)
    return float(count * spec.width * spec.height)


serve(sys.argv[1],
      {"name": "Mitsuba 3 (llvm)", "short": "mitsuba",
       "version": f"{mi.__version__}, Dr.Jit {dr.__version__}, LLVM {'.'.join(map(str, dr.detail.llvm_version()))}"},
      render, image, rays)
