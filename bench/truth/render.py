# SPDX-License-Identifier: Apache-2.0
"""Renders the rooms of tools/bench truth with Blender Cycles: render.py FOLDER SAMPLES JOB…

A job is ROOM/PICTURE/VIEW: PICTURE is plate (the real room), truth (with the virtual objects), again (the same with
another seed), catcher (Blender's shadow catcher with the room's environment; RGBA, premultiplied) or probe (the
environment, equirectangular, seen from the marker, without lamps; VIEW is then 0). Writes FOLDER/ROOM/PICTURE-VIEW.npy:
linear light, float32, top row first. `m` before VIEW: a frame of the moving camera. Also writes labels-VIEW.npz: what
each pixel's centre ray hits, and where; and FOLDER/bunny.obj, in world coordinates."""
import math
import os
import sys

import bpy
import numpy as np
from mathutils import Matrix, Vector

import rooms

SCALE = 1e-3  # m per mm: Blender's lamps are defined in metres


def metres(point):
    return Vector(point) * SCALE


# ---- materials ----

class Nodes:
    """The node tree of a new material with a Principled BSDF."""

    def __init__(self, name):
        self.material = bpy.data.materials.new(name)
        self.material.use_nodes = True
        self.tree = self.material.node_tree
        self.surface = self.tree.nodes["Principled BSDF"]
        self.output = self.tree.nodes["Material Output"]

    def node(self, kind, **inputs):
        made = self.tree.nodes.new(kind)
        for key, value in inputs.items():
            if key in made.inputs:
                made.inputs[key].default_value = value
            else:
                setattr(made, key, value)
        return made

    def link(self, source, target):
        self.tree.links.new(source, target)

    def set(self, **inputs):
        for key, value in inputs.items():
            self.surface.inputs[key.replace("_", " ")].default_value = value
        return self


def rgba(colour):
    return (*colour, 1)


def plain(name, colour, roughness=0.6, gloss=0.3):
    return Nodes(name).set(Base_Color=rgba(colour), Roughness=roughness, Specular_IOR_Level=gloss).material


def ramp(nodes, value, colours):
    made = nodes.node("ShaderNodeValToRGB")
    stops = made.color_ramp.elements
    while len(stops) < len(colours):
        stops.new(0)
    for i, colour in enumerate(colours):
        stops[i].position, stops[i].color = i / (len(colours) - 1), rgba(colour)
    nodes.link(value, made.inputs["Fac"])
    return made.outputs["Color"]


def position(nodes, scale):
    mapping = nodes.node("ShaderNodeMapping", Scale=scale)
    nodes.link(nodes.node("ShaderNodeTexCoord").outputs["Object"], mapping.inputs["Vector"])
    return mapping.outputs["Vector"]


def textured(name, texture, scale, colours, roughness, gloss, **inputs):
    nodes = Nodes(name).set(Roughness=roughness, Specular_IOR_Level=gloss)
    made = nodes.node(texture, **inputs)
    nodes.link(position(nodes, scale), made.inputs["Vector"])
    value = made.outputs["Fac" if "Fac" in made.outputs else 0]
    nodes.link(ramp(nodes, value, colours), nodes.surface.inputs["Base Color"])
    return nodes.material


def table_material(kind):
    if kind == "wood":
        return textured(kind, "ShaderNodeTexNoise", (3, 45, 3), [(0.17, 0.085, 0.04), (0.36, 0.20, 0.10), (0.50, 0.31, 0.17)],
                        0.5, 0.35, Scale=3.0, Detail=8.0, Distortion=0.6)
    if kind == "cloth":
        return textured(kind, "ShaderNodeTexChecker", (40, 40, 40), [(0.42, 0.38, 0.36), (0.30, 0.24, 0.26)], 0.95, 0.0, Scale=1.0)
    if kind == "brick":
        nodes = Nodes(kind).set(Roughness=0.9, Specular_IOR_Level=0.1)
        brick = nodes.node("ShaderNodeTexBrick", Color1=rgba((0.42, 0.13, 0.07)), Color2=rgba((0.14, 0.05, 0.04)),
                           Mortar=rgba((0.55, 0.52, 0.46)), Scale=1.0)
        for key, value in (("Mortar Size", 0.005), ("Mortar Smooth", 0.1), ("Brick Width", 0.11), ("Row Height", 0.045)):
            brick.inputs[key].default_value = value
        nodes.link(position(nodes, (1.4, 0.9, 0.03)), brick.inputs["Vector"])
        nodes.link(brick.outputs["Color"], nodes.surface.inputs["Base Color"])
        return nodes.material
    if kind == "granite":
        return textured(kind, "ShaderNodeTexNoise", (1.4, 0.9, 0.03),
                        [(0.01,) * 3, (0.02, 0.02, 0.022), (0.04, 0.04, 0.045), (0.25, 0.24, 0.22)], 0.12, 0.5, Scale=130.0,
                        Detail=4.0, Roughness=0.7)
    if kind == "plaster":
        return textured(kind, "ShaderNodeTexNoise", (1, 1, 1), [(0.68, 0.68, 0.67), (0.76, 0.76, 0.75)], 0.5, 0.2, Scale=6.0,
                        Detail=4.0)
    if kind == "stone":
        return textured(kind, "ShaderNodeTexNoise", (1, 1, 1), [(0.20, 0.20, 0.19), (0.34, 0.33, 0.31), (0.44, 0.43, 0.40)],
                        0.8, 0.15, Scale=60.0, Detail=10.0, Roughness=0.7)
    return textured(kind, "ShaderNodeTexNoise", (2, 2, 2), [(0.30, 0.30, 0.28), (0.38, 0.37, 0.34)], 0.3, 0.5, Scale=4.0, Detail=4.0)


def marker_material(picture):
    nodes = Nodes("marker").set(Roughness=0.9, Specular_IOR_Level=0.0)
    image = nodes.node("ShaderNodeTexImage", interpolation="Closest", extension="CLIP")
    image.image = bpy.data.images.load(picture)
    tint = nodes.node("ShaderNodeMix", data_type="RGBA")
    tint.inputs["A"].default_value, tint.inputs["B"].default_value = rgba((0.03,) * 3), rgba((0.78,) * 3)
    nodes.link(image.outputs["Color"], tint.inputs["Factor"])
    nodes.link(tint.outputs["Result"], nodes.surface.inputs["Base Color"])
    return nodes.material


def virtual_material(name):
    spec = rooms.MATERIALS[name]
    nodes, kind = Nodes(name), spec["kind"]
    if kind == "dielectric":
        nodes.set(Base_Color=rgba(spec["colour"]), Roughness=spec["roughness"], IOR=1.5,
                  Specular_IOR_Level=0.5 * spec["specular"])
    elif kind == "metal":
        nodes.set(Base_Color=rgba(spec["colour"]), Roughness=spec["roughness"], Metallic=1.0)
    elif kind == "emissive":
        nodes.set(Base_Color=rgba((0, 0, 0)), Specular_IOR_Level=0.0, Emission_Color=rgba(spec["colour"]),
                  Emission_Strength=spec["radiance"])
    else:
        glass = nodes.node("ShaderNodeBsdfGlass", Roughness=0.0, IOR=1.5)
        nodes.link(glass.outputs[0], nodes.output.inputs["Surface"])
        if spec["distance"]:
            # Blender's absorption is density · (1 − colour) per metre.
            extinction = [-math.log(each) / (spec["distance"] * SCALE) for each in spec["colour"]]
            density = max(extinction) * 1.0001
            volume = nodes.node("ShaderNodeVolumeAbsorption", Density=density,
                                Color=rgba([1 - each / density for each in extinction]))
            nodes.link(volume.outputs[0], nodes.output.inputs["Volume"])
    return nodes.material


# ---- shapes ----

def placed(thing, material, smooth=False):
    if material is not None:
        thing.data.materials.clear()
        thing.data.materials.append(material)
    if smooth:
        thing.data.polygons.foreach_set("use_smooth", np.ones(len(thing.data.polygons), bool))
    return thing


def cuboid(size, centre, material, turn_degrees=0):
    bpy.ops.mesh.primitive_cube_add(size=1, location=metres(centre), rotation=(0, 0, math.radians(turn_degrees)))
    thing = bpy.context.object
    thing.scale = metres(size)
    return placed(thing, material)


def sphere(radius, centre, material):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=192, ring_count=96, radius=radius * SCALE, location=metres(centre))
    return placed(bpy.context.object, material, smooth=True)


def cylinder(radius, length, centre, material, rotation=(0, 0, 0)):
    bpy.ops.mesh.primitive_cylinder_add(vertices=96, radius=radius * SCALE, depth=length * SCALE, location=metres(centre),
                                        rotation=[math.radians(each) for each in rotation])
    thing = placed(bpy.context.object, material)
    bpy.ops.object.shade_auto_smooth(angle=math.radians(40))
    return thing


def plane(size, centre, material, rotation=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=1, location=metres(centre), rotation=[math.radians(each) for each in rotation])
    thing = bpy.context.object
    thing.scale = (size[0] * SCALE, size[1] * SCALE, 1)
    return placed(thing, material)


def mug(centre, material):
    cylinder(38, 90, (centre[0], centre[1], 45), material)
    inside = cylinder(34, 80, (centre[0], centre[1], 51), material)
    inside.hide_render = inside.hide_viewport = True
    outside = [each for each in bpy.context.scene.objects if each.type == "MESH"][-2]
    cut = outside.modifiers.new("hollow", "BOOLEAN")
    cut.object, cut.operation = inside, "DIFFERENCE"
    bpy.ops.mesh.primitive_torus_add(location=metres((centre[0] - 40, centre[1], 46)), rotation=(math.pi / 2, 0, 0),
                                     major_radius=24 * SCALE, minor_radius=6 * SCALE)
    placed(bpy.context.object, material, smooth=True)


def tall_objects():
    """A bottle, boxes and rods beside the virtual objects."""
    cylinder(24, 190, (-140, 92, 95), plain("bottle", (0.06, 0.22, 0.45), 0.3, 0.5))
    cylinder(10, 30, (-140, 92, 205), plain("cap", (0.8, 0.8, 0.8), 0.4, 0.4))
    cuboid((60, 60, 170), (138, 96, 85), plain("box", (0.75, 0.32, 0.05), 0.6, 0.2), 24)
    cuboid((120, 20, 130), (-10, 165, 65), plain("board", (0.05, 0.28, 0.12), 0.5, 0.3), -8)
    for x in (-150, -130, -110):
        cylinder(4, 150, (x, -75, 75), plain("rod", (0.6, 0.6, 0.62), 0.3, 0.5))
    cylinder(16, 120, (140, -60, 60), Nodes("can").set(Base_Color=rgba((0.85, 0.85, 0.86)), Roughness=0.2, Metallic=1.0).material)
    sphere(26, (205, 20, 26), plain("ball", (0.60, 0.05, 0.08), 0.3, 0.5))


def real_objects():
    mug((-185, 160), plain("mug", (0.10, 0.25, 0.52), 0.25, 0.5))
    for size, z, colour, turn in (((150, 105, 26), 13, (0.45, 0.06, 0.06), 14), ((140, 100, 20), 36, (0.07, 0.30, 0.20), 9),
                                  ((130, 92, 18), 55, (0.70, 0.58, 0.14), 20)):
        cuboid(size, (190, 190, z), plain(f"book {z}", colour, 0.6, 0.3), turn)
    cylinder(4, 170, (-180, -40, 4), plain("pencil", (0.75, 0.50, 0.06), 0.4, 0.5), (90, 0, 22))
    cylinder(4, 160, (-160, -55, 12), plain("pen", (0.05, 0.10, 0.45), 0.3, 0.5), (87, 0, -18))
    sphere(24, (-60, 215, 24), plain("ball", (0.60, 0.25, 0.08), 0.5, 0.4))
    bpy.ops.mesh.primitive_monkey_add(size=62 * SCALE, location=metres((70, 230, 30)), rotation=(-0.55, 0, -0.3))
    placed(bpy.context.object, plain("figure", (0.52, 0.47, 0.40), 0.7, 0.3), smooth=True)
    for x, y in ((170, -85), (196, -70), (182, -102)):
        cylinder(12, 2.2, (x, y, 1.1), Nodes("coin").set(Base_Color=rgba((0.80, 0.60, 0.30)), Roughness=0.3, Metallic=1.0).material)


def load_bunny(folder):
    """Reads FOLDER/bunny.ply, and writes bunny.obj: in world coordinates, with the normals that Cycles shades with.
    Returns points in m and faces, or nothing if there is no such file."""
    file = os.path.join(folder, "bunny.ply")
    if not os.path.exists(file):
        return None
    thing = next(each for each in rooms.THINGS if each.shape == "bunny")
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.wm.ply_import(filepath=file)
    data = bpy.context.object.data
    data.transform(Matrix.Rotation(math.pi / 2, 4, "X"))
    points = np.array([vertex.co for vertex in data.vertices])
    low, high = points.min(0), points.max(0)
    centre = (low + high) / 2
    data.transform(Matrix.Translation(thing.centre) @ Matrix.Rotation(math.radians(thing.turn_degrees), 4, "Z") @
                   Matrix.Scale(thing.size / (high[2] - low[2]), 4) @ Matrix.Translation((-centre[0], -centre[1], -low[2])))
    with open(os.path.join(folder, "bunny.obj"), "w", encoding="utf-8") as out:
        out.writelines("v %.6g %.6g %.6g\n" % tuple(vertex.co) for vertex in data.vertices)
        out.writelines("vn %.6g %.6g %.6g\n" % tuple(vertex.normal) for vertex in data.vertices)
        out.writelines("f " + " ".join(f"{i + 1}//{i + 1}" for i in face.vertices) + "\n" for face in data.polygons)
    return [tuple(vertex.co * SCALE) for vertex in data.vertices], [tuple(face.vertices) for face in data.polygons]


def virtual_objects(bunny):
    for thing in rooms.THINGS:
        material = virtual_material(thing.material)
        if thing.shape == "sphere":
            made = sphere(thing.size, thing.centre, material)
        elif thing.shape == "cuboid":
            made = cuboid((thing.size,) * 3, thing.centre, material, thing.turn_degrees)
        else:
            if bunny is None:
                continue
            data = bpy.data.meshes.new(thing.name)
            data.from_pydata(bunny[0], [], bunny[1])
            made = bpy.data.objects.new(thing.name, data)
            bpy.context.scene.collection.objects.link(made)
            placed(made, material, smooth=True)
        made.name = "virtual " + thing.name


# ---- rooms ----

def add_lamp(lamp):
    data = bpy.data.lights.new("lamp", {"rectangle": "AREA", "sphere": "POINT", "spot": "SPOT"}[lamp.kind])
    data.energy, data.color = lamp.power, lamp.colour
    if lamp.kind == "rectangle":
        data.shape, data.size, data.size_y = "RECTANGLE", lamp.size[0] * SCALE, lamp.size[1] * SCALE
    else:
        data.shadow_soft_size = lamp.radius * SCALE
    if lamp.kind == "spot":
        data.spot_size, data.spot_blend = 2 * math.radians(lamp.outer_degrees), lamp.blend
    thing = bpy.data.objects.new("lamp", data)
    thing.location = metres(lamp.position)
    if lamp.kind != "sphere":
        thing.rotation_euler = (metres(lamp.target) - metres(lamp.position)).to_track_quat("-Z", "Y").to_euler()
    thing.visible_camera = False  # as in the probe: arhost gets lamps and environment apart
    bpy.context.scene.collection.objects.link(thing)


def overcast_sky(zenith):
    """CIE overcast sky: L(θ) = zenith · (1 + 2 sin θ) / 3 above the horizon."""
    tree = bpy.context.scene.world.node_tree

    def math_node(operation, *values):
        made = tree.nodes.new("ShaderNodeMath")
        made.operation = operation
        for socket, value in zip(made.inputs, values):
            if isinstance(value, (int, float)):
                socket.default_value = value
            else:
                tree.links.new(value, socket)
        return made.outputs[0]

    split = tree.nodes.new("ShaderNodeSeparateXYZ")
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], split.inputs[0])
    sine = math_node("MAXIMUM", split.outputs["Z"], 0.0)
    strength = math_node("MULTIPLY", math_node("ADD", math_node("MULTIPLY", sine, 2.0), 1.0), zenith / 3)
    background = tree.nodes["Background"]
    background.inputs["Color"].default_value = (0.93, 0.97, 1.0, 1)
    tree.links.new(strength, background.inputs["Strength"])


def build(room, picture, folder, bunny):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.world = bpy.data.worlds.new("world")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Strength"].default_value = 0
    for lamp in room.lamps:
        add_lamp(lamp)
    centre, size = rooms.TABLE_CENTRE, rooms.TABLE_SIZE
    if picture == "catcher":
        environment(np.load(os.path.join(folder, room.name, "probe-0.npy")), folder)
        table = plane(size, (*centre, 0), plain("table", (0.35, 0.33, 0.31), 1.0, 0.0))
        table.is_shadow_catcher = True
        virtual_objects(bunny)
        scene.render.film_transparent = True
        return
    table = cuboid((*size, 30), (*centre, -15), table_material(room.table))
    table.name = "table"
    plane((rooms.PAPER_MM,) * 2, (0, 0, 0.15), plain("paper", (0.78,) * 3, 0.9, 0.0)).name = "table paper"
    plane((rooms.MARKER_SIDE_MM,) * 2, (0, 0, 0.25), marker_material(os.path.join(folder, "marker.png"))).name = "table marker"
    if room.tall_objects:
        tall_objects()
    else:
        real_objects()
    if room.near_walls:
        behind, beside = (plain("near wall", colour, 0.7, 0.1) for colour in room.near_walls)
        plane((1400, 700), (0, 275, 350), behind, (90, 0, 0))
        plane((900, 700), (-285, 0, 350), beside, (90, 0, 90))
    if room.walls:
        wall = plain("wall", room.walls, 0.9, 0.0)
        for size, at, rotation in (((4000, 2600), (-2000, 500, 560), (90, 0, 90)), ((4000, 2600), (2000, 500, 560), (90, 0, 90)),
                                   ((4000, 2600), (0, 2500, 560), (90, 0, 0)), ((4000, 2600), (0, -1500, 560), (90, 0, 0)),
                                   ((4000, 4000), (0, 500, 1860), (0, 0, 0))):
            plane(size, at, wall, rotation)
        plane((4000, 4000), (0, 500, -740), plain("floor", (0.28, 0.20, 0.14), 0.5, 0.3))
        cuboid((900, 300, 1700), (1100, 2300, 110), plain("shelf", (0.35, 0.16, 0.09), 0.5, 0.3))
        cuboid((700, 20, 500), (-500, 2480, 700), plain("picture", (0.12, 0.30, 0.36), 0.4, 0.4))
    if room.sky:
        overcast_sky(room.sky)
        plane((60000, 60000), (0, 0, -740), plain("ground", (0.22, 0.24, 0.16), 1.0, 0.0))
        cuboid((9000, 400, 5000), (-1500, 5200, 1760), plain("house", (0.42, 0.20, 0.14), 0.9, 0.0))
        sphere(1500, (4200, 2500, 1600), plain("tree", (0.06, 0.14, 0.04), 1.0, 0.0))
    if picture in ("truth", "again"):
        virtual_objects(bunny)


def environment(pixels, folder):
    """Lights the scene with an equirectangular picture, whose centre is at +y."""
    tree = bpy.context.scene.world.node_tree
    file = os.path.join(folder, "environment.exr")
    image = bpy.data.images.new("environment", pixels.shape[1], pixels.shape[0], float_buffer=True)
    image.colorspace_settings.name = "Non-Color"
    image.pixels.foreach_set(np.ascontiguousarray(np.dstack([pixels[..., :3], np.ones(pixels.shape[:2])])[::-1], np.float32).ravel())
    image.filepath_raw, image.file_format = file, "OPEN_EXR"
    image.save()
    node = tree.nodes.new("ShaderNodeTexEnvironment")
    node.image = bpy.data.images.load(file)
    node.image.colorspace_settings.name = "Non-Color"
    # Blender's centre is at +x, and arhost's at +y.
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value = (0, 0, math.radians(-90))
    tree.links.new(tree.nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    tree.links.new(node.outputs["Color"], tree.nodes["Background"].inputs["Color"])
    tree.nodes["Background"].inputs["Strength"].default_value = 1


# ---- pictures ----

def set_camera(camera, is_probe):
    data = bpy.data.cameras.new("camera")
    thing = bpy.data.objects.new("camera", data)
    scene = bpy.context.scene
    scene.collection.objects.link(thing)
    scene.camera = thing
    data.clip_start, data.clip_end = 0.01, 200
    render = scene.render
    render.resolution_percentage = 100
    if is_probe:
        render.resolution_x, render.resolution_y = 512, 256
        data.type, data.panorama_type = "PANO", "EQUIRECTANGULAR"
        thing.location = metres((0, 0, 60))
        thing.rotation_euler = (math.pi / 2, 0, 0)  # looks at +y
        return
    render.resolution_x, render.resolution_y = rooms.WIDTH, rooms.HEIGHT
    data.sensor_fit, data.sensor_width, data.lens = "HORIZONTAL", rooms.WIDTH, rooms.FOCAL_PX
    thing.location = metres(camera.eye)
    thing.rotation_euler = (metres(camera.look_at) - metres(camera.eye)).to_track_quat("-Z", "Y").to_euler()


def set_quality(samples, seed):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.render.threads_mode, scene.render.threads = "FIXED", len(os.sched_getaffinity(0))
    image = scene.render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    scene.render.use_compositing = scene.render.use_sequencer = False
    cycles = scene.cycles
    cycles.device, cycles.samples, cycles.seed = "CPU", samples, seed
    cycles.use_adaptive_sampling = False
    cycles.use_denoising, cycles.denoiser = True, "OPENIMAGEDENOISE"
    cycles.denoising_input_passes, cycles.denoising_prefilter = "RGB_ALBEDO_NORMAL", "ACCURATE"
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces, cycles.diffuse_bounces, cycles.glossy_bounces, cycles.transmission_bounces = 16, 8, 8, 16
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True


def render(file):
    scene = bpy.context.scene
    scene.render.filepath = file + ".exr"
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(file + ".exr")
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(image.size[1], image.size[0], 4)[::-1]
    os.remove(file + ".exr")
    with open(file + ".part", "wb") as out:
        np.save(out, pixels)
    os.rename(file + ".part", file + ".npy")


def write_labels(file):
    """Which object the ray through each pixel's centre hits: an index into THINGS, or −1; and where, in mm."""
    scene = bpy.context.scene
    graph = bpy.context.evaluated_depsgraph_get()
    origin, axes = scene.camera.matrix_world.translation, scene.camera.matrix_world.to_3x3()
    names = ["virtual " + thing.name for thing in rooms.THINGS]
    labels = np.full((rooms.HEIGHT, rooms.WIDTH), -1, np.int8)
    points = np.full((rooms.HEIGHT, rooms.WIDTH, 3), np.nan, np.float32)
    for row in range(rooms.HEIGHT):
        for column in range(rooms.WIDTH):
            direction = axes @ Vector(((column - rooms.WIDTH / 2 + 0.5) / rooms.FOCAL_PX,
                                       (rooms.HEIGHT / 2 - 0.5 - row) / rooms.FOCAL_PX, -1)).normalized()
            found, location, _, _, thing, _ = scene.ray_cast(graph, origin, direction)
            if found:
                points[row, column] = location / SCALE
                if thing.name in names:
                    labels[row, column] = names.index(thing.name)
    np.savez_compressed(file, labels=labels, points=points)


def main():
    folder, samples, jobs = sys.argv[1], int(sys.argv[2]), sys.argv[3:]
    bunny = load_bunny(folder)
    for number, job in enumerate(jobs):
        name, picture, view = job.split("/")
        os.makedirs(os.path.join(folder, name), exist_ok=True)
        build(next(each for each in rooms.ROOMS + rooms.OTHER_ROOMS if each.name == name), picture, folder, bunny)
        set_camera(rooms.camera_of(view), picture == "probe")
        set_quality(samples, 1 if picture == "again" else 0)
        if picture == "truth": # before the picture, which tells that the job is done
            write_labels(os.path.join(folder, name, f"labels-{view}.npz"))
        render(os.path.join(folder, name, f"{picture}-{view}"))
        print(f"{number + 1} of {len(jobs)}: {job}", flush=True)


main()
