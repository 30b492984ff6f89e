# SPDX-License-Identifier: Apache-2.0
"""Blender Cycles with Open Image Denoise for tools/bench equal-quality: peer_cycles.py WIDTH HEIGHT THREADS
(peer.py)."""
import math
import os
import sys
import tempfile

from peer import serve  # first, because Blender prints

import bpy
import numpy as np
from mathutils import Matrix, Vector

from scene import LOOK_AT, SCENE, eye, fov_y_degrees, triple

width, height, threads = map(int, sys.argv[1:])
# 1 unit is 1 mm: light does not depend on the unit.


def material(description):
    made = bpy.data.materials.new("")
    made.use_nodes = True
    nodes = made.node_tree.nodes
    model = description["model"]
    kind, inputs = {
        "diffuse": ("ShaderNodeBsdfDiffuse", {"Color": "diffuse"}),
        "metallic-roughness": ("ShaderNodeBsdfPrincipled", {"Base Color": "colour", "Metallic": "metallic",
                                                            "Roughness": "roughness"}),
        "mirror": ("ShaderNodeBsdfAnisotropic", {"Color": "reflectivity"}),
        "glass": ("ShaderNodeBsdfGlass", {"IOR": "index"})}[model]
    node = nodes.new(kind)
    for socket, key in inputs.items():
        is_colour = node.inputs[socket].type == "RGBA"
        node.inputs[socket].default_value = (*triple(description[key]), 1) if is_colour else description[key]
    if model in ("mirror", "glass"):
        node.inputs["Roughness"].default_value = 0
    if model == "glass":
        node.inputs["Color"].default_value = (1, 1, 1, 1)
    made.node_tree.links.new(node.outputs[0], nodes["Material Output"].inputs["Surface"])
    return made


def facing(position, direction):
    """A transform that turns −z to `direction` and keeps x horizontal."""
    return Matrix.Translation(position) @ Vector(direction).to_track_quat("-Z", "Y").to_matrix().to_4x4()


bpy.ops.wm.read_factory_settings(use_empty=True)
scene = bpy.context.scene
materials = {name: material(each) for name, each in SCENE["materials"].items()}
for thing in SCENE["objects"]:
    if "sphere" in thing:
        bpy.ops.mesh.primitive_uv_sphere_add(segments=192, ring_count=96, radius=thing["sphere"]["radius"],
                                             location=thing["sphere"]["centre"])
        bpy.ops.object.shade_smooth()
    elif "plane" in thing:
        bpy.ops.mesh.primitive_plane_add(size=thing["plane"]["size"])
    else:
        bpy.ops.mesh.primitive_cube_add(size=1)
        matrix = Matrix.Translation(thing["cuboid"]["centre"]) @ Matrix.Diagonal((*thing["cuboid"]["size"], 1))
        for step in thing["transform"]:
            move = Matrix.Translation(step["translate"]) if "translate" in step else \
                Matrix.Rotation(math.radians(step["rotate"]["degrees"]), 4, step["rotate"]["axis"])
            matrix = move @ matrix
        bpy.context.object.matrix_world = matrix
    bpy.context.object.data.materials.append(materials[thing["material"]])
for lamp in SCENE["lights"]:
    data = bpy.data.lights.new("lamp", "AREA")
    data.shape, data.size, data.size_y = "RECTANGLE", *lamp["size"]
    # The radiance is π · intensity / area in arhost and energy / (π · area) in Blender.
    data.energy = lamp["intensity"] * math.pi ** 2
    made = bpy.data.objects.new("lamp", data)
    made.matrix_world = facing(lamp["position"], lamp["direction"])
    scene.collection.objects.link(made)
scene.world = bpy.data.worlds.new("world")
scene.world.use_nodes = True
scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (*SCENE["background"], 1)
camera = bpy.data.cameras.new("camera")
camera.sensor_fit, camera.angle_y = "VERTICAL", math.radians(fov_y_degrees(width, height))
camera.clip_start, camera.clip_end = 1, 100_000
scene.camera = bpy.data.objects.new("camera", camera)
scene.collection.objects.link(scene.camera)

settings, cycles = scene.render, scene.cycles
settings.engine = "CYCLES"
settings.resolution_x, settings.resolution_y, settings.resolution_percentage = width, height, 100
settings.threads_mode, settings.threads = "FIXED", threads
settings.use_persistent_data = True  # keep mesh and BVH between frames
settings.use_compositing = settings.use_sequencer = False
settings.image_settings.file_format, settings.image_settings.color_depth = "OPEN_EXR", "32"
cycles.device = "CPU"
cycles.use_adaptive_sampling = cycles.use_auto_tile = cycles.use_light_tree = False
cycles.use_denoising, cycles.denoiser, cycles.denoising_input_passes = True, "OPENIMAGEDENOISE", "RGB_ALBEDO_NORMAL"
cycles.pixel_filter_type = "BOX"
depth = SCENE["max_depth"]
cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = depth
cycles.sample_clamp_indirect = cycles.blur_glossy = 0


def render(degrees, samples, seed, quality):
    position = Vector(eye(degrees))
    scene.camera.matrix_world = facing(position, Vector(LOOK_AT) - position)
    cycles.samples, cycles.seed = samples, seed
    cycles.denoising_quality, cycles.denoising_prefilter = {"fast": ("FAST", "FAST"), "high": ("HIGH", "ACCURATE")}[quality]
    scene.update_tag()  # otherwise a new seed is ignored
    bpy.ops.render.render()


def picture():
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "cycles.exr")
        bpy.data.images["Render Result"].save_render(file)
        image = bpy.data.images.load(file)
        image.colorspace_settings.name = "Non-Color"
        pixels = np.empty(width * height * image.channels, np.float32)
        image.pixels.foreach_get(pixels)
        bpy.data.images.remove(image)
    return pixels.reshape(height, width, -1)[::-1, :, :3]


serve(f"Blender {bpy.app.version_string}", render, picture)
