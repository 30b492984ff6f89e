# SPDX-License-Identifier: Apache-2.0
"""Renders the scenes of cases.py with Mitsuba 3."""
import os
import time

import drjit as dr
import mitsuba as mi
import numpy as np

mi.set_variant("llvm_ad_rgb")
T = mi.ScalarTransform4f


class MetallicRoughness(mi.BSDF):
    """glTF 2.0, appendix B.3: the metallic-roughness material of arhost (core/shading/include/arhost/shading/leaf/bsdf.h)."""

    def __init__(self, properties):
        mi.BSDF.__init__(self, properties)
        colour, self.metallic = np.array(properties["colour"]), properties["metallic"]
        self.f0 = mi.Color3f((0.04 * (1 - self.metallic) + colour * self.metallic).tolist())
        self.diffuse = mi.Color3f((colour * (1 - self.metallic)).tolist())
        self.alpha = max(properties["roughness"] ** 2, 0.001)
        front = mi.BSDFFlags.FrontSide
        self.m_components = [mi.BSDFFlags.DiffuseReflection | front, mi.BSDFFlags.GlossyReflection | front]
        self.m_flags = self.m_components[0] | self.m_components[1]
        self.diffuse_chance = 0.0 if self.metallic == 1 else 0.5

    def facets(self):
        return mi.MicrofacetDistribution(mi.MicrofacetType.GGX, self.alpha, sample_visible=True)

    def sample(self, context, si, sample1, sample2, active):
        facet, _ = self.facets().sample(si.wi, sample2)
        is_diffuse = sample1 < self.diffuse_chance
        made = dr.zeros(mi.BSDFSample3f)
        made.wo = dr.select(is_diffuse, mi.warp.square_to_cosine_hemisphere(sample2), mi.reflect(si.wi, facet))
        value, made.pdf = self.eval_pdf(context, si, made.wo, active)
        made.eta = 1.0
        made.sampled_type = mi.UInt32(+mi.BSDFFlags.GlossyReflection)
        made.sampled_component = mi.UInt32(1)
        valid = active & (made.pdf > 0)
        return made, dr.select(valid, value / made.pdf, 0)

    def eval_pdf(self, context, si, wo, active):
        cos_eye, cos_light = mi.Frame3f.cos_theta(si.wi), mi.Frame3f.cos_theta(wo)
        valid = active & (cos_eye > 0) & (cos_light > 0)
        half = dr.normalize(si.wi + wo)
        grazing = dr.clip(1 - dr.dot(si.wi, half), 0, 1) ** 5
        fresnel = self.f0 * (1 - grazing) + grazing
        a2 = self.alpha ** 2
        density = a2 / (dr.pi * dr.square(dr.square(half.z) * (a2 - 1) + 1))

        def divisor(cosine):
            return cosine + dr.sqrt(a2 + (1 - a2) * cosine * cosine)

        lobe = density / (divisor(cos_eye) * divisor(cos_light)) * cos_light
        value = self.diffuse * (1 - fresnel) * (cos_light * dr.inv_pi) + fresnel * lobe
        pdf = self.diffuse_chance * cos_light * dr.inv_pi + (1 - self.diffuse_chance) * 0.5 * density / divisor(cos_eye)
        return dr.select(valid, value, 0), dr.select(valid, pdf, 0)

    def eval(self, context, si, wo, active):
        return self.eval_pdf(context, si, wo, active)[0]

    def pdf(self, context, si, wo, active):
        return self.eval_pdf(context, si, wo, active)[1]


mi.register_bsdf("metallic-roughness", MetallicRoughness)


def triple(value):
    return [float(value)] * 3 if np.isscalar(value) else [float(each) for each in value]


def rgb(value):
    return {"type": "rgb", "value": triple(value)}


def bsdf(material, folder):
    model = material["model"]
    if model == "diffuse":
        reflectance = rgb(material["diffuse"]) if "texture" not in material else \
            {"type": "bitmap", "filename": os.path.join(folder, material["texture"]["image"]), "raw": True, "wrap_mode": "clamp"}
        return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": reflectance}}
    if model == "mirror":
        return {"type": "twosided", "bsdf": {"type": "conductor", "material": "none",
                                             "specular_reflectance": rgb(material["reflectivity"])}}
    if model == "glass":
        indices = {"int_ior": material["index"], "ext_ior": 1.0}
        if "roughness" not in material:
            return {"type": "dielectric", **indices}
        return {"type": "roughdielectric", "distribution": "ggx", "alpha": material["roughness"] ** 2, **indices}
    return {"type": "metallic-roughness", "metallic": float(material["metallic"]), "roughness": float(material["roughness"]),
            "colour": mi.ScalarColor3f(triple(material["colour"]))}


def plane_transform(centre, size, normal, up=(0.0, 1, 0)):
    """Of the square from -1 to 1 that faces +z."""
    z = np.array(normal, float) / np.linalg.norm(normal)
    x = np.cross(up, z) if abs(z[1]) < 0.999 else np.array([1.0, 0, 0])
    x /= np.linalg.norm(x)
    y = np.cross(z, x)
    matrix = np.eye(4)
    matrix[:3, 0], matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = x * size[0] / 2, y * size[1] / 2, z, centre
    return T(matrix)


def shape(thing, materials, folder):
    material = materials[thing["material"]]
    if "sphere" in thing:
        made = {"type": "sphere", "center": thing["sphere"]["centre"], "radius": float(thing["sphere"]["radius"])}
    elif "plane" in thing:
        made = {"type": "rectangle", "to_world": plane_transform(**thing["plane"])}
    elif "cuboid" in thing:
        turn, move = thing["transform"]
        made = {"type": "cube", "to_world": T().translate(move["translate"]) @ T().rotate(
            turn["rotate"]["axis"], turn["rotate"]["degrees"]) @ T().scale([each / 2 for each in thing["cuboid"]["size"]])}
    else:
        made = {"type": "ply", "filename": os.path.join(folder, thing["mesh"]), "face_normals": not thing["smooth"]}
        for step in thing.get("transform", ()):
            if "scale" in step:
                made["to_world"] = T().scale(step["scale"]) @ made.get("to_world", T())
            else:
                made["to_world"] = T().translate(step["translate"]) @ made.get("to_world", T())
    made["bsdf"] = bsdf(material, folder)
    if "emission" in material:
        made["emitter"] = {"type": "area", "radiance": rgb(material["emission"])}
    return made


def emitter(lamp):
    """An intensity of arhost includes Lambert's 1/π. Lamps hide nothing: rays pass them."""
    intensity = np.pi * np.array(lamp["intensity"])
    kind, position, direction = lamp["type"], lamp.get("position"), lamp.get("direction")
    if kind == "point":
        return {"type": "point", "position": position, "intensity": rgb(intensity)}
    if kind == "directional":
        return {"type": "directional", "direction": direction, "irradiance": rgb(intensity)}
    if kind == "spot":
        aim = np.array(position) + direction
        up = [1, 0, 0] if abs(direction[0]) < 0.9 else [0, 1, 0]
        return {"type": "spot", "to_world": T().look_at(origin=position, target=aim.tolist(), up=up), "intensity": rgb(intensity),
                "cutoff_angle": lamp["outer_degrees"], "beam_width": lamp["outer_degrees"] - 0.001}
    if kind == "sphere":
        made = {"type": "sphere", "center": position, "radius": float(lamp["radius"])}
        area = np.pi * lamp["radius"] ** 2
    else:
        made = {"type": "rectangle", "to_world": plane_transform(position, lamp["size"], direction)}
        area = lamp["size"][0] * lamp["size"][1]
    return made | {"emitter": {"type": "area", "radiance": rgb(intensity / area)}, "bsdf": {"type": "null"}}


def environment_rows(file):
    """Mitsuba puts the first and the last row of an environment at the poles, arhost half a row before them. Rows
    between those of the picture make both interpolate the same light."""
    rows = np.array(mi.Bitmap(file).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32, False))
    made = np.empty((2 * len(rows) + 1, *rows.shape[1:]), np.float32)
    made[1::2] = rows
    made[2:-1:2] = (rows[:-1] + rows[1:]) / 2
    made[0], made[-1] = rows[0], rows[-1]
    return mi.Bitmap(made)


def mitsuba_scene(case, folder, width, height, with_virtual=True):
    scene = case.scene
    made = {"type": "scene", "sensor": {
        "type": "perspective", "fov": float(np.degrees(2 * np.arctan(height / 2 / case.focal))), "fov_axis": "y",
        "near_clip": 1, "far_clip": 100_000, "to_world": T().look_at(origin=case.eye, target=case.at, up=[0, 1, 0]),
        "sampler": {"type": "independent"},
        "film": {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "box"}, "pixel_format": "rgb",
                 "component_format": "float32"}}}
    for i, thing in enumerate(scene["objects"]):
        if with_virtual or thing.get("role") == "catcher":
            made[f"object-{i}"] = shape(thing, scene["materials"], folder)
    for i, lamp in enumerate(scene.get("lights", ())):
        made[f"lamp-{i}"] = emitter(lamp)
    if "environment" in scene:
        # In arhost, the image's centre is in front of a y-up scene; in Mitsuba, its edge is.
        made["sky"] = {"type": "envmap", "bitmap": environment_rows(os.path.join(folder, scene["environment"]["image"])),
                       "scale": scene["environment"].get("intensity", 1.0), "to_world": T().rotate([0, 1, 0], 180)}
    elif "background" in scene:
        made["sky"] = {"type": "constant", "radiance": rgb(scene["background"])}
    return mi.load_dict(made, optimize=False)


def regions(case, folder, width, height):
    """The object of each pixel, -1 at edges and elsewhere."""
    scene = mitsuba_scene(case, folder, width, height)
    y, x = np.mgrid[0:height, 0:width]
    numbers = []
    for dx, dy in ((0, 0), (-0.6, -0.6), (0.6, -0.6), (-0.6, 0.6), (0.6, 0.6)):
        at = mi.Point2f(((x + 0.5 + dx) / width).ravel(), ((y + 0.5 + dy) / height).ravel())
        rays, _ = scene.sensors()[0].sample_ray(0, 0.5, at, mi.Point2f(0.5))
        hit = scene.ray_intersect(rays).shape
        number = np.full(width * height, -1)
        for each in scene.shapes():
            if each.id().startswith("object-"):
                number[np.array(hit == mi.ShapePtr(each))] = int(each.id()[len("object-"):])
        numbers.append(number.reshape(height, width))
    same = np.all([number == numbers[0] for number in numbers], 0)
    return np.where(same, numbers[0], -1)


def path(case):
    """Lamps are not seen directly, but emissive objects are."""
    shines = any("emission" in each for each in case.scene["materials"].values())
    return {"type": "path", "max_depth": -1, "rr_depth": 5, "hide_emitters": not shines}


def render(scene, integrator, samples, seed):
    return np.array(mi.render(scene, integrator=mi.load_dict(integrator), spp=samples, seed=seed), np.float64)


def pictures(case, folder, width, height, batches=4):
    """Independent renders of the case, and the picture without the virtual objects (0 unless they have a background)."""
    scene = mitsuba_scene(case, folder, width, height)
    integrator = {"type": "ptracer", "max_depth": -1, "rr_depth": 20} if case.reference == "ptracer" else path(case)
    made = [render(scene, integrator, case.reference_samples // batches, seed) for seed in range(batches)]
    without = np.zeros_like(made[0])
    if case.reference == "difference":
        without = render(mitsuba_scene(case, folder, width, height, with_virtual=False), path(case), case.reference_samples, 100)
    return np.array(made), without


def timed(case, folder, width, height, samples, rounds):
    """Pictures and CPU seconds of renders with a compiled kernel."""
    scene = mitsuba_scene(case, folder, width, height)
    integrator = mi.load_dict(path(case))
    frame = dr.freeze(lambda scene, seed: mi.render(scene, integrator=integrator, spp=samples, seed=seed))
    made, seconds = [], []
    for seed in range(rounds + 3):
        begin = time.process_time()
        picture = np.array(frame(scene, mi.UInt32(seed)), np.float64)
        if seed >= 3:
            seconds.append(time.process_time() - begin)
            made.append(picture)
    return np.array(made), seconds
