# SPDX-License-Identifier: Apache-2.0
"""Blender Cycles for tools/bench peers: peer_cycles.py FOLDER THREADS (served.py)."""
import math
import os
import sys
import time

import bpy
import numpy as np
from mathutils import Matrix

from served import Scene, serve

spec = Scene(sys.argv[1])
threads = int(sys.argv[2])
# Axes are kept (Blender's "up" is irrelevant to Cycles); 1 unit is 1 mm.


def material(name, kind, **inputs):
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    nodes = made.node_tree.nodes
    nodes.clear()
    node, output = nodes.new(kind), nodes.new("ShaderNodeOutputMaterial")
    for key, value in inputs.items():
        node.inputs[key].default_value = value
    if hasattr(node, "distribution"):
        node.distribution = "GGX"
    made.node_tree.links.new(node.outputs[0], output.inputs["Surface"])
    return made


def grey(value):
    return (value, value, value, 1)


def mesh(scene, name, positions, normals, indices, surface):
    data = bpy.data.meshes.new(name)
    data.from_pydata(positions.tolist(), [], indices.tolist())
    if normals is not None:
        data.polygons.foreach_set("use_smooth", np.ones(len(indices), bool))
        data.normals_split_custom_set_from_vertices(normals.tolist())
    data.materials.append(surface)
    scene.collection.objects.link(bpy.data.objects.new(name, data))


def limit(scene, bounces):
    """Cycles traces one more bounce, to lamps and environment only."""
    scene.cycles.max_bounces = scene.cycles.glossy_bounces = scene.cycles.transmission_bounces = bounces


def scene_of(case):
    scene = bpy.data.scenes.new(case)
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = spec.width, spec.height, 100
    render.threads_mode, render.threads = "FIXED", threads
    render.use_persistent_data = True  # keep mesh and BVH between frames
    render.use_compositing = render.use_sequencer = False
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode = "RGBA"
    render.image_settings.color_depth = "32"
    render.use_stamp_render_time = True
    cycles.device = "CPU"
    cycles.samples = 1
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.use_auto_tile = cycles.use_light_tree = False
    cycles.pixel_filter_type = "BOX"
    cycles.min_light_bounces = 1024  # no Russian roulette
    cycles.light_sampling_threshold = 0
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True
    limit(scene, {"diffuse": 0, "mirror": spec.mirror_depth - 1, "glass-path": spec.glass_depth - 1}[case])
    # rt_embree has no diffuse interreflection.
    cycles.diffuse_bounces = 0

    surface = {
        "diffuse": lambda: material("bunny", "ShaderNodeBsdfDiffuse", Color=grey(spec.bunny_grey)),
        "mirror": lambda: material("mirror", "ShaderNodeBsdfAnisotropic", Color=grey(spec.mirror_grey), Roughness=0),
        "glass-path": lambda: material("glass", "ShaderNodeBsdfGlass", Color=grey(spec.glass_grey), Roughness=0,
                                       IOR=spec.glass_index),
    }[case]()
    mesh(scene, "bunny", spec.positions, spec.normals, spec.indices, surface)
    world = bpy.data.worlds.new(case)
    world.use_nodes = True
    white = 0 if case == "diffuse" else 1
    world.node_tree.nodes["Background"].inputs["Color"].default_value = grey(white)
    world.cycles.sampling_method = "NONE"
    # The environment is visible only in mirrors and glass; the ground is lit by the lamp.
    world.cycles_visibility.diffuse = False
    scene.world = world
    if case != "glass-path":
        a = spec.ground_half_side
        corners = np.array([[-a, 0, -a], [-a, 0, a], [a, 0, a], [a, 0, -a]])
        mesh(scene, "ground", corners, None, np.array([[0, 1, 2], [0, 2, 3]]),
             material("ground", "ShaderNodeBsdfDiffuse", Color=grey(spec.ground_grey)))
        lamp = bpy.data.lights.new("lamp", "POINT")
        lamp.shadow_soft_size = 0
        # Blender's radiant intensity is W / 4π², including π; arhost's intensity includes Lambert's 1/π.
        lamp.energy = spec.lamp_intensity * 4 * math.pi ** 2
        lamp.cycles.use_multiple_importance_sampling = False
        lamp = bpy.data.objects.new("lamp", lamp)
        lamp.location = spec.lamp_position
        scene.collection.objects.link(lamp)

    camera = bpy.data.cameras.new("camera")
    camera.sensor_fit = "VERTICAL"
    camera.angle_y = math.radians(spec.fov_y_degrees)
    camera.clip_start, camera.clip_end = 1, 10000
    camera = bpy.data.objects.new("camera", camera)
    # A Blender camera looks along its −z axis, and so does the scene's.
    assert spec.eye[0] == spec.look_at[0] and spec.eye[1] == spec.look_at[1] and spec.eye[2] > spec.look_at[2]
    camera.matrix_world = Matrix.Translation(spec.eye)
    scene.collection.objects.link(camera)
    scene.camera = camera
    return scene


scenes = {}


def cached_scene(case):
    if case not in scenes:
        scenes[case] = scene_of(case)
    return scenes[case]


def render(case, seed):
    scene = cached_scene(case)
    scene.cycles.seed = seed
    scene.update_tag()  # otherwise the new seed is ignored
    bpy.ops.render.render(scene=case)


def rendered(case, samples):
    scene = cached_scene(case)
    scene.cycles.samples = samples
    file = os.path.join(sys.argv[1], "cycles.exr")
    scene.render.filepath = file
    scene.update_tag()
    bpy.ops.render.render(scene=case, write_still=True)
    image = bpy.data.images.load(file)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(spec.width * spec.height * 4, np.float32)
    image.pixels.foreach_get(pixels)
    bpy.data.images.remove(image)
    os.remove(file)
    scene.cycles.samples = 1
    return pixels.reshape(spec.height, spec.width, 4)[::-1]


def image(case, samples):
    scene = cached_scene(case)
    light = rendered(case, samples)
    scene.render.film_transparent = True
    alpha = rendered(case, samples)
    scene.render.film_transparent = False
    return np.concatenate([light[..., :3], alpha[..., 3:]], 2)


def own_ms(case, seed):
    """Time per sample without the per-frame overhead of synchronisation, start and end of a render."""
    scene = cached_scene(case)
    scene.cycles.seed = seed
    wall = []
    for samples in (1, 9):
        scene.cycles.samples = samples
        scene.update_tag()
        begin = time.perf_counter()
        bpy.ops.render.render(scene=case)
        wall.append(time.perf_counter() - begin)
    scene.cycles.samples = 1
    return 1e3 * (wall[1] - wall[0]) / 8


def rays(case):
    """Counted as in peer_mitsuba.py."""
    scene = cached_scene(case)
    bunny = scene.collection.objects[0]
    socket = bunny.active_material.node_tree.nodes["Glass BSDF"].inputs["Color"]
    socket.default_value = grey(1)
    # Counts primary rays plus one ray per hit; the depth limit does not affect these.
    scene.render.film_transparent = True
    count = 1 + float((rendered(case, 1)[..., 3] > 0).mean())
    scene.render.film_transparent = False
    for bounces in range(spec.glass_depth - 1):
        limit(scene, bounces)
        count += float((rendered(case, 1)[..., 0] == 0).mean())
    socket.default_value = grey(spec.glass_grey)
    return count * spec.width * spec.height


serve(sys.argv[1], {"name": "Blender Cycles", "short": "cycles", "version": bpy.app.version_string}, render, image, rays,
      own_ms)
