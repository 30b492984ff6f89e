# SPDX-License-Identifier: Apache-2.0
"""The scenes of tools/bench light. A scene is the content of an arhost scene file (y-up), with a camera."""
import gzip
import math
import os
import shutil
import sys

import numpy as np

sys.path.append(os.path.join(os.path.dirname(os.path.abspath(__file__)), "..", "truth"))
from scenes import write_hdr  # noqa: E402

WIDTH, HEIGHT = 160, 120
WHITE, RED, GREEN = [0.73, 0.73, 0.73], [0.63, 0.06, 0.05], [0.14, 0.45, 0.09]


class Case:
    """`samples`: per pixel, of arhost and of the reference. `reference`: path, ptracer (light is traced from the lamps),
    difference (two renders, with and without the virtual objects), or a function that returns the picture.
    `regions`: names of the objects compared; None: all."""

    def __init__(self, name, scene, eye, at, focal, *, samples=512, reference_samples=512, reference="path", regions=None,
                 tolerance=0.02):
        self.name, self.scene, self.eye, self.at, self.focal = name, scene, eye, at, focal
        self.samples, self.reference_samples, self.reference = samples, reference_samples, reference
        self.regions, self.tolerance = regions, tolerance


def scene(objects, materials, lights=(), environment=None, background=None, depth=40):
    made = {"version": 2, "axes": "y-up", "max_depth": depth, "materials": materials, "objects": objects}
    if lights:
        made["lights"] = list(lights)
    if environment:
        made["environment"] = environment
    if background is not None or not (lights or environment):  # scenes without any get arhost's default light
        made["background"] = background or 0
    return made


def matt(colour):
    return {"model": "diffuse", "diffuse": colour}


def rough(colour, metallic, roughness, **more):
    return {"model": "metallic-roughness", "colour": colour, "metallic": metallic, "roughness": roughness, **more}


def emissive(radiance):
    return rough([0, 0, 0], 0, 1, emission=radiance)


def ball(name, centre, radius, material):
    return {"name": name, "sphere": {"centre": list(centre), "radius": radius}, "material": material}


def plane(name, centre, size, material, normal=(0, 1, 0), **more):
    return {"name": name, "plane": {"centre": list(centre), "size": list(size), "normal": list(normal)},
            "material": material, **more}


def cuboid(name, centre, size, material, degrees=0):
    return {"name": name, "cuboid": {"size": list(size)}, "material": material,
            "transform": [{"rotate": {"axis": [0, 1, 0], "degrees": degrees}}, {"translate": list(centre)}]}


def lamp(kind, intensity, **more):
    made = {"type": kind, "intensity": intensity if isinstance(intensity, list) else [intensity] * 3, **more}
    if kind != "directional":
        made["falloff"] = "inverse-square"
    return made


def cornell(name, lights=(), emitter=None, emitter_radiance=None, **more):
    """A room of 200 mm, open to the camera."""
    a = 100
    objects = [plane("floor", (0, -a, 0), (2 * a, 2 * a), "white"),
               plane("ceiling", (0, a, 0), (2 * a, 2 * a), "white", (0, -1, 0)),
               plane("back", (0, 0, -a), (2 * a, 2 * a), "white", (0, 0, 1)),
               plane("left", (-a, 0, 0), (2 * a, 2 * a), "red", (1, 0, 0)),
               plane("right", (a, 0, 0), (2 * a, 2 * a), "green", (-1, 0, 0)),
               cuboid("tall", (-35, -40, -30), (55, 120, 55), "white", 18),
               cuboid("short", (35, -70, 35), (55, 60, 55), "white", -18)]
    materials = {"white": matt(WHITE), "red": matt(RED), "green": matt(GREEN)}
    if emitter:
        objects.append(emitter)
        materials["light"] = emissive(emitter_radiance)
    return Case(name, scene(objects, materials, lights), (0, 0, 500), (0, 0, 0), 225, **more)


AREA_LAMP = lamp("rectangle", [9000, 8000, 6500], position=[0, 99, 0], direction=[0, -1, 0], size=[60, 60])


def furnaces(folder):
    """Light of radiance 1 from everywhere: what reflects all light is as bright as the surroundings. Rough surfaces of
    glTF lose some, so their reference is Mitsuba."""
    materials = {"matt": matt([1, 1, 1]), "mirror": {"model": "mirror", "reflectivity": 1},
                 "glass": {"model": "glass", "index": 1.5}}
    lossless = [ball(name, (60 * i - 90, 50, 0), 25, name) for i, name in enumerate(materials)]
    # Objects that light each other.
    lossless += [ball("left", (-60, -30, 0), 25, "matt"), ball("right", (-5, -30, 0), 25, "mirror"),
                 cuboid("slab", (0, -60, 0), (200, 10, 70), "matt"), ball("lens", (55, -30, 0), 25, "glass")]
    rough_ones, rough_materials = [], {}
    for i, (kind, roughness) in enumerate([("dielectric", 0.1), ("dielectric", 0.5), ("dielectric", 1), ("metal", 0.1),
                                           ("metal", 0.3), ("metal", 0.6), ("metal", 0.8), ("metal", 1)]):
        name = f"{kind} {roughness}"
        rough_materials[name] = rough([1, 1, 1], int(kind == "metal"), roughness)
        rough_ones.append(ball(name, (60 * (i % 4) - 90, 30 - 60 * (i // 4), 0), 25, name))
    write_hdr(np.ones((32, 64, 3)), os.path.join(folder, "white.hdr"))
    view = (0, 0, 900), (0, 0, 0), 520
    for name, light in (("background", {"background": 1}), ("environment", {"environment": {"image": "white.hdr"}})):
        yield Case(f"furnace, {name}", scene(lossless, materials, depth=100, **light), *view,
                   reference=lambda case: np.ones((HEIGHT, WIDTH, 3)), tolerance=0.01)
        yield Case(f"furnace, glTF, {name}", scene(rough_ones, rough_materials, depth=100, **light), *view, tolerance=0.01)


def spheres_in(name, image, intensity):
    objects, materials = [], {}
    for i, metallic in enumerate((0, 1)):
        for j, roughness in enumerate((0.1, 0.3, 0.6, 1)):
            key = f"{'metal' if metallic else 'dielectric'} {roughness}"
            materials[key] = rough([0.9, 0.5, 0.2], metallic, roughness)
            objects.append(ball(key, (60 * j - 90, 40 - 80 * i, 0), 18, key))
    return Case(f"glTF in {name}", scene(objects, materials, environment={"image": image, "intensity": intensity}), (0, 0, 900),
                (0, 0, 0), 560, samples=4096, reference_samples=8192)


def table_things():
    materials = {"table": matt([0.5, 0.45, 0.4]), "matt": matt([0.6, 0.3, 0.2]), "metal": rough([0.9, 0.7, 0.4], 1, 0.35),
                 "plastic": rough([0.1, 0.3, 0.6], 0, 0.4)}
    objects = [plane("table", (0, 0, 0), (400, 400), "table"), ball("matt", (-60, 30, 0), 30, "matt"),
               ball("metal", (0, 30, -20), 30, "metal"), ball("plastic", (60, 30, 10), 30, "plastic"),
               cuboid("box", (10, 15, 70), (50, 30, 30), "matt", 25)]
    return objects, materials


TABLE_VIEW = ((0, 220, 330), (0, 15, 0), 190)


def things(name, lights=(), depth=40, **more):
    objects, materials = table_things()
    light = {key: more.pop(key) for key in ("environment", "background") if key in more}
    return Case(name, scene(objects, materials, lights, depth=depth, **light), *TABLE_VIEW, **more)


def checkerboard(folder):
    from PIL import Image  # of peers-venv
    y, x = np.mgrid[0:576, 0:576] // 64  # nine by nine checks: the same after reflections
    Image.fromarray(np.where((x + y) % 2, 200, 40).astype(np.uint8)).save(os.path.join(folder, "checks.png"))
    return {"model": "diffuse", "texture": {"image": "checks.png", "encoding": "linear", "wrap": "clamp"}}


def glass_on_checks(name, folder, **light):
    objects = [plane("floor", (0, 0, 0), (360, 360), "checks"), ball("glass", (0, 45, 0), 45, "glass")]
    materials = {"checks": checkerboard(folder), "glass": {"model": "glass", "index": 1.5}}
    return Case(f"glass, {name}", scene(objects, materials, **light), (0, 160, 320), (0, 35, 0), 190, samples=2048,
                reference_samples=8192)


def frosted_on_checks(name, folder, lights=(), **light):
    objects = [plane("floor", (0, 0, 0), (360, 360), "checks"), ball("frosted ball", (-45, 40, 10), 40, "frosted 0.3"),
               cuboid("frosted pane", (60, 45, 0), (90, 80, 6), "frosted 0.5", 15)]
    materials = {"checks": checkerboard(folder)}
    materials |= {f"frosted {each}": {"model": "glass", "index": 1.5, "roughness": each} for each in (0.3, 0.5)}
    return Case(f"frosted glass, {name}", scene(objects, materials, lights, **light), (0, 160, 320), (0, 35, 0), 190,
                samples=2048, reference_samples=8192)


def many_lamps():
    random = np.random.default_rng(1)
    lights = []
    for _ in range(200):
        x, z = random.uniform(-180, 180, 2)
        power = random.uniform(0.2, 1) * 200
        lights.append(lamp("sphere", [float(power * each) for each in random.uniform(0.3, 1, 3)],
                           position=[float(x), float(random.uniform(90, 130)), float(z)], radius=1))
    return things("200 sphere lamps", lights, samples=1024, reference_samples=2048)


def ring(folder):
    """An open cylinder of facets, a mirror on both sides."""
    sides, radius, height = 96, 45, 18
    angles = 2 * math.pi * np.arange(sides) / sides
    low = np.stack([radius * np.cos(angles), 0 * angles + 0.01, radius * np.sin(angles)], 1)
    points = np.concatenate([low, low + [0, height, 0]])
    triangles = [t for i in range(sides) for j in [(i + 1) % sides] for t in ((i, j, i + sides), (j, j + sides, i + sides))]
    with open(os.path.join(folder, "ring.ply"), "w", encoding="ascii") as out:
        out.write(f"ply\nformat ascii 1.0\nelement vertex {len(points)}\nproperty float x\nproperty float y\nproperty float z\n"
                  f"element face {len(triangles)}\nproperty list uchar int vertex_indices\nend_header\n")
        out.writelines("{:.6f} {:.6f} {:.6f}\n".format(*p) for p in points)
        out.writelines("3 {} {} {}\n".format(*t) for t in triangles)
    return {"name": "ring", "mesh": "ring.ply", "smooth": False, "material": "mirror"}


def caustics(folder):
    materials = {"floor": matt([0.6, 0.6, 0.6]), "glass": {"model": "glass", "index": 1.5},
                 "mirror": {"model": "mirror", "reflectivity": 0.9}}
    floor = plane("floor", (0, 0, 0), (240, 240), "floor")
    light = [lamp("sphere", 30000, position=[-110, 170, 20], radius=4)]
    for name, thing in (("glass ball", ball("glass", (0, 40, 0), 40, "glass")), ("metal ring", ring(folder))):
        yield Case(f"caustic, {name}", scene([floor, thing], materials, light), (30, 260, 190), (10, 0, 0), 220,
                   reference="ptracer", reference_samples=2048, regions=["floor"], tolerance=0.05)


def catchers(hdr):
    table = plane("table", (0, 0, 0), (400, 400), "table", role="catcher")
    materials = {"table": matt([0.5, 0.45, 0.4]), "lacquer": rough([0.5, 0.45, 0.4], 0, 0.25), "matt": matt([0.6, 0.3, 0.2]),
                 "bright": matt([0.9, 0.75, 0.3]), "metal": rough([0.9, 0.7, 0.4], 1, 0.35), "light": emissive([3, 2, 1])}
    things_on_it = [ball("matt", (-60, 30, 0), 30, "matt"), ball("metal", (0, 30, -20), 30, "metal"),
                    cuboid("box", (10, 15, 70), (50, 30, 30), "matt", 25)]
    coloured = [lamp("sphere", [20000, 6000, 3000], position=[-160, 150, 60], radius=12),
                lamp("rectangle", [3000, 8000, 26000], position=[150, 200, 80], direction=[-0.6, -0.75, -0.28], size=[60, 60])]
    bright = [cuboid("board", (0, 40, -45), (160, 80, 6), "bright", 12), ball("bright", (50, 25, 20), 25, "bright")]
    shining = [ball("light", (-40, 35, 20), 15, "light"), cuboid("bar", (50, 20, -10), (20, 40, 80), "light", 20),
               ball("matt", (0, 20, 50), 20, "matt")]
    clear = [ball("glass", (-50, 30, 0), 30, "glass"), ball("mirror", (25, 25, -10), 25, "mirror"),
             cuboid("box", (30, 15, 60), (50, 30, 30), "matt", 25)]
    random = np.random.default_rng(2)
    many = [ball(f"ball {i}", (60 * (i % 6) - 150 + random.uniform(-15, 15), 8, 60 * (i // 6) - 150 + random.uniform(-15, 15)), 8,
                 "matt") for i in range(36)]
    materials |= {"glass": {"model": "glass", "index": 1.5}, "mirror": {"model": "mirror", "reflectivity": 0.9}}
    sun = [lamp("directional", [0.9, 0.8, 0.6], direction=[0.35, -0.75, -0.55])]
    for name, objects, lights, light in (
            ("coloured lamps", things_on_it, coloured, {}),
            ("bright matt object", bright, sun, {"background": [0.15, 0.2, 0.3]}),
            ("emissive objects", shining, [], {"background": 0.3}),
            ("environment", things_on_it, [], {"environment": hdr}),
            ("glass and mirror", clear, [], {"background": 0.5}),
            ("36 balls", many, coloured, {"background": 0.1}),
            ("lacquered", shining, sun, {})):  # the table mirrors neither sun nor surroundings, so it only gains light
        surface = "lacquer" if name == "lacquered" else "table"
        yield Case(f"catcher, {name}", scene([table | {"material": surface}, *objects], materials, lights, **light), *TABLE_VIEW,
                   reference="difference", samples=1024)


def bunny(name, shared, folder, hdr):
    """One case, or none if the scan is missing."""
    packed = os.path.join(shared, "meshes", "bunny_69451.ply.gz")
    if not os.path.exists(packed):
        print("  the bunny is skipped: its scan is missing (../shared/data/meshes)")
        return
    with gzip.open(packed) as scan, open(os.path.join(folder, "bunny.ply"), "wb") as out:
        shutil.copyfileobj(scan, out)
    objects = [plane("table", (0, 0, 0), (500, 500), "table"),
               {"name": "bunny", "mesh": "bunny.ply", "smooth": True, "material": "bunny",
                "transform": [{"scale": 1000}, {"translate": [17, -33, 0]}]}]
    materials = {"table": matt([0.5, 0.45, 0.4]), "bunny": matt([0.7, 0.6, 0.5])}
    yield Case(name, scene(objects, materials, environment=hdr), (0, 150, 330), (0, 65, 0), 220)


def spot_lamps():
    """The light of a smooth spot lamp on a matt plane, without and with a radius, from its definition in
    arhost/scene.h."""
    albedo = 0.5
    position, direction, outer, inner = np.array([40.0, 150, 30]), np.array([-0.3, -1, -0.2]), 30, 12
    direction /= np.linalg.norm(direction)

    def light_on(case, radius):
        eye, at = np.array(case.eye, float), np.array(case.at, float)
        ahead = (at - eye) / np.linalg.norm(at - eye)
        right = np.cross(ahead, [0, 1, 0])
        right /= np.linalg.norm(right)
        sub, discs = (3, 600) if radius else (8, 1)
        y, x = (np.mgrid[0:HEIGHT * sub, 0:WIDTH * sub] + 0.5) / sub
        way = ahead + ((x - WIDTH / 2) / case.focal)[..., None] * right \
            + ((y - HEIGHT / 2) / case.focal)[..., None] * np.cross(ahead, right)
        point = eye + way * (-eye[1] / way[..., 1])[..., None]
        total = np.zeros(x.shape)
        axis = (position - point) / np.linalg.norm(position - point, axis=-1, keepdims=True)
        u = np.cross(axis, [1, 0, 0])
        u /= np.linalg.norm(u, axis=-1, keepdims=True)
        v = np.cross(axis, u)
        for i in range(discs):
            r, turn = radius * math.sqrt((i + 0.5) / discs), i * math.pi * (3 - math.sqrt(5))
            to_light = position + r * (u * math.cos(turn) + v * math.sin(turn)) - point
            squared = (to_light ** 2).sum(-1)
            cosine = -(to_light @ direction) / np.sqrt(squared)
            c_outer, c_inner = math.cos(math.radians(outer)), math.cos(math.radians(inner))
            t = np.clip((cosine - c_outer) / (c_inner - c_outer), 0, 1)
            total += t * t * (3 - 2 * t) * to_light[..., 1] / squared ** 1.5 / discs
        light = albedo * 10000 * total.reshape(HEIGHT, sub, WIDTH, sub).mean((1, 3))
        return np.repeat(light[..., None], 3, 2)

    for radius in (0, 20):
        light = lamp("spot", 10000, position=position.tolist(), direction=direction.tolist(), outer_degrees=outer,
                     inner_degrees=inner, **({"radius": radius} if radius else {}))
        yield Case("spot lamp, smooth" + (f", radius {radius}" if radius else ""),
                   scene([plane("table", (0, 0, 0), (2000, 2000), "table")], {"table": matt([albedo] * 3)}, [light]),
                   *TABLE_VIEW, reference=lambda case, radius=radius: light_on(case, radius))


def all_cases(folder, environments):
    """`environments`: names and files of pictures, with the intensity of each."""
    yield cornell("Cornell, point lamp", [lamp("point", [9000, 8000, 6500], position=[0, 60, 10])])
    yield cornell("Cornell, area lamp", [AREA_LAMP])
    yield cornell("Cornell, sphere lamp", [lamp("sphere", [9000, 8000, 6500], position=[10, 50, 20], radius=8)])
    yield cornell("Cornell, emissive mesh", (), cuboid("lamp", (10, 50, 20), (60, 6, 20), "light", 30), [8, 7, 5])
    yield cornell("Cornell, emissive ball", (), ball("lamp", (10, 40, 20), 20, "light"), [8, 7, 5])
    yield from furnaces(folder)
    for name, image, intensity in environments:
        yield spheres_in(name, image, intensity)
    yield glass_on_checks("constant environment", folder, background=1)
    name, image, intensity = environments[0]
    hdr = {"image": image, "intensity": intensity}
    yield glass_on_checks(name, folder, environment=hdr)
    yield frosted_on_checks("constant environment", folder, background=1)
    yield frosted_on_checks("area lamp", folder, [lamp("rectangle", [20000, 18000, 15000], position=[-90, 200, 80],
                                                       direction=[0.4, -0.85, -0.35], size=[120, 120])])
    yield many_lamps()
    yield things("directional lamp", [lamp("directional", [1, 0.9, 0.7], direction=[0.4, -0.8, -0.4])])
    yield things("spot lamp, hard", [lamp("spot", 40000, position=[120, 200, 60], direction=[-0.5, -0.8, -0.25],
                                          outer_degrees=28)], samples=1024, reference_samples=2048)
    yield things("rectangle lamp", [lamp("rectangle", [20000, 16000, 12000], position=[-130, 150, 60],
                                         direction=[0.6, -0.75, -0.28], size=[80, 50])])
    yield from spot_lamps()
    yield from catchers(hdr)
    yield from caustics(folder)
