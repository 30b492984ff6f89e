# SPDX-License-Identifier: Apache-2.0
"""Writes the rooms of tools/bench truth as scenes of arhost."""
import math

import numpy as np

import rooms


def numbers(values):
    return "[" + ", ".join(f"{value:.7g}" for value in values) + "]"


def material(spec):
    colour = numbers(spec["colour"])
    if spec["kind"] == "glass":
        absorption = f", attenuation: {{colour: {colour}, distance_mm: {spec['distance']}}}" if spec["distance"] else ""
        return f"{{model: glass, index: 1.5{absorption}}}"
    if spec["kind"] == "emissive":
        return f"{{model: metallic-roughness, colour: 0, metallic: 0, emission: {numbers([each * spec['radiance'] for each in spec['colour']])}}}"
    if spec["kind"] == "metal" and spec["roughness"] == 0:
        return f"{{model: mirror, reflectivity: {colour}}}"
    if spec["kind"] == "dielectric" and not spec["specular"]:
        return f"{{model: diffuse, diffuse: {colour}}}"
    return f"{{model: metallic-roughness, colour: {colour}, metallic: {int(spec['kind'] == 'metal')}, roughness: {spec['roughness']}}}"


def lamp(lamp):
    """The intensity of arhost includes Lambert's 1/π, and its unit of length is mm."""
    share = 1 / math.pi if lamp.kind == "rectangle" else 1 / (4 * math.pi)
    intensity = numbers([1e6 * lamp.power * share / math.pi * each for each in lamp.colour])
    text = f"type: {lamp.kind}, position: {numbers(lamp.position)}, intensity: {intensity}, falloff: inverse-square"
    if lamp.kind != "rectangle":
        text += f", radius: {lamp.radius}"
    if lamp.kind == "sphere":
        return f"{{{text}}}"
    aim = np.array(lamp.target, float) - lamp.position
    text += f", direction: {numbers(aim / np.linalg.norm(aim))}"
    if lamp.kind == "rectangle":
        return f"{{{text}, size: {numbers(lamp.size)}}}"
    outer = math.cos(math.radians(lamp.outer_degrees))
    inner = math.degrees(math.acos(outer + (1 - outer) * lamp.blend))  # as Cycles blends
    return f"{{{text}, outer_degrees: {lamp.outer_degrees}, inner_degrees: {inner:.6g}}}"


def objects(bunny):
    lines = []
    for thing in rooms.THINGS:
        text = f"name: {thing.name}, material: {thing.material}"
        if thing.shape == "sphere":
            lines.append(f"{{{text}, sphere: {{radius: {thing.size}, centre: {numbers(thing.centre)}}}}}")
        elif thing.shape == "cuboid":
            lines.append(f"{{{text}, cuboid: {{size: {thing.size}}}, transform: [{{rotate: {{axis: [0, 0, 1], degrees: "
                         f"{thing.turn_degrees}}}}}, {{translate: {numbers(thing.centre)}}}]}}")
        elif bunny:
            lines.append(f"{{{text}, mesh: {bunny}, smooth: true}}")
    return lines


def scene(light, bunny, table_roughness=0):
    """The virtual objects on a table, in `light`: lines of YAML."""
    size, centre = rooms.TABLE_SIZE, rooms.TABLE_CENTRE
    table = f"{{name: table, plane: {{size: {numbers(size)}, centre: {numbers((*centre, 0))}}}, material: table, role: catcher}}"
    surface = (f"{{model: metallic-roughness, colour: 0.33, metallic: 0, roughness: {table_roughness}}}" if table_roughness
               else "{model: diffuse, diffuse: 0.33}")
    return "\n".join(["axes: z-up", "max_depth: 16", *light, "materials:", f"  table: {surface}",
                      *(f"  {name}: {material(spec)}" for name, spec in rooms.MATERIALS.items()), "objects:",
                      *("  - " + each for each in [table, *objects(bunny)])]) + "\n"


def demo_light():
    """A lamp by guess, with the integrator `whitted`."""
    return ["version: 1", "ambient: 0.28", "background: '#c9d6e4'", "lights:",
            "  - {type: rectangle, position: [-640, 702, 710], direction: [0.674, -0.739, 0], size: [800, 940], "
            "intensity: [1.25, 1.3, 1.38]}"]


def default_light():
    """That of scenes that describe none."""
    return ["version: 2"]


def known_light(room, integrator):
    lights = ["lights:", *("  - " + lamp(each) for each in room.lamps)] if room.lamps else []
    shadows = ["shadow_alpha: {opaque: 1, translucent: 0.5}", "coloured_shadows: true"] if integrator == "whitted" else []
    return ["version: 2", f"integrator: {integrator}", "environment: {image: environment.hdr}", *shadows, *lights]


def write_hdr(pixels, file):
    """Writes linear light as Radiance RGBE, without compression."""
    peak = pixels[..., :3].max(-1)
    exponent = np.where(peak > 1e-32, np.floor(np.log2(np.maximum(peak, 1e-32))) + 1, -128)
    mantissa = np.clip(pixels[..., :3] / np.exp2(exponent)[..., None] * 256, 0, 255)
    rgbe = np.dstack([mantissa, np.where(peak > 1e-32, exponent + 128, 0)]).astype(np.uint8)
    with open(file, "wb") as out:
        out.write(f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {pixels.shape[0]} +X {pixels.shape[1]}\n".encode())
        out.write(rgbe.tobytes())
