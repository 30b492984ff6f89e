# SPDX-License-Identifier: Apache-2.0
"""Renders glTF models with Blender Cycles for tools/bench gltf: render.py JOBS.json

JOBS has the keys width, height, samples, focal_px, environment, intensity, and models: a list of file, out, key and
direction (from the model to the camera, in the axes of glTF). Writes OUT.npz: `pixels` (linear light, premultiplied RGBA,
float32, top row first), `eye` and `at` (the camera that shows the whole model; in the axes of glTF, metres), and `key`."""
import json
import math
import os
import sys

import bpy
import numpy as np
from io_scene_gltf2.blender.imp.scene import BlenderScene
from mathutils import Matrix, Vector

MARGIN = 0.94  # the share of the picture's width or height that the model takes

# arhost shows the pose of the nodes; Blender would show the first frame of the first animation.
BlenderScene.create_animations = staticmethod(lambda gltf: None)


def z_up(vector):
    return Vector((vector[0], -vector[2], vector[1]))


def y_up(vectors):
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], -1)


def complete(material):
    """Adds what glTF defines and Blender's importer leaves to the user or to EEVEE."""
    nodes, links = material.node_tree.nodes, material.node_tree.links
    if material.name.startswith("DefaultMaterial"):  # plastic in Blender
        surface = nodes["Principled BSDF"]
        surface.inputs["Base Color"].default_value = (1, 1, 1, 1)
        surface.inputs["Metallic"].default_value = surface.inputs["Roughness"].default_value = 1
        material.use_backface_culling = True
    for node in nodes:
        if node.type == "BSDF_PRINCIPLED":
            node.distribution = "GGX"  # without light that microfacets scatter to each other
        if node.type == "VOLUME_ABSORPTION":
            # Blender's absorption per metre is density · (1 − colour), and glTF's −ln(colour) / distance.
            colour, density = node.inputs["Color"].default_value, node.inputs["Density"].default_value
            absorption = [-math.log(max(each, 1e-6)) * density for each in colour[:3]]
            node.inputs["Density"].default_value = most = max(*absorption, 1e-9)
            node.inputs["Color"].default_value = (*(1 - each / most for each in absorption), 1)
    if not material.use_backface_culling:
        return
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    surface = output.inputs["Surface"].links[0].from_socket
    camera_ray, geometry, both = (nodes.new("ShaderNode" + each) for each in ("LightPath", "NewGeometry", "Math"))
    clear, mix = nodes.new("ShaderNodeBsdfTransparent"), nodes.new("ShaderNodeMixShader")
    both.operation = "MULTIPLY"
    links.new(camera_ray.outputs["Is Camera Ray"], both.inputs[0])
    links.new(geometry.outputs["Backfacing"], both.inputs[1])
    links.new(both.outputs[0], mix.inputs[0])
    links.new(surface, mix.inputs[1])
    links.new(clear.outputs[0], mix.inputs[2])
    links.new(mix.outputs[0], output.inputs["Surface"])


def vertices():
    """Of all meshes with faces in the world, in the axes of glTF."""
    graph = bpy.context.evaluated_depsgraph_get()
    found = []
    for thing in bpy.context.scene.objects:
        if thing.type == "MESH" and thing.data.polygons:
            data = thing.evaluated_get(graph).data
            points = np.empty(3 * len(data.vertices), np.float32)
            data.vertices.foreach_get("co", points)
            world = np.array(thing.matrix_world)
            found.append(points.reshape(-1, 3) @ world[:3, :3].T + world[:3, 3])
    return y_up(np.concatenate(found))


def camera_for(points, direction, width, height, focal_px):
    """(eye, look-at) in the axes of glTF"""
    at = (points.min(0) + points.max(0)) / 2
    back = np.array(direction) / np.linalg.norm(direction)
    right = np.cross([0, 1, 0], back)
    right /= np.linalg.norm(right)
    up = np.cross(back, right)
    across, along = points - at, (points - at) @ back
    distance = max((np.abs(across @ axis) * focal_px / (MARGIN * size / 2) + along).max()
                   for axis, size in ((right, width), (up, height)))
    return at + distance * back, at


def environment(file, intensity):
    """Lights the scene with an equirectangular picture, whose centre is at +y."""
    world = bpy.context.scene.world = bpy.data.worlds.new("world")
    nodes, links = world.node_tree.nodes, world.node_tree.links
    node, mapping = nodes.new("ShaderNodeTexEnvironment"), nodes.new("ShaderNodeMapping")
    node.image = bpy.data.images.load(file)
    mapping.inputs["Rotation"].default_value = (0, 0, math.radians(-90))  # Blender's centre is at +x
    links.new(nodes.new("ShaderNodeTexCoord").outputs["Generated"], mapping.inputs["Vector"])
    links.new(mapping.outputs["Vector"], node.inputs["Vector"])
    links.new(node.outputs["Color"], nodes["Background"].inputs["Color"])
    nodes["Background"].inputs["Strength"].default_value = intensity


def set_camera(eye, at, jobs):
    data = bpy.data.cameras.new("camera")
    data.sensor_fit, data.sensor_width, data.lens = "HORIZONTAL", jobs["width"], jobs["focal_px"]
    distance = np.linalg.norm(eye - at)
    data.clip_start, data.clip_end = distance / 1000, distance * 1000
    camera = bpy.data.objects.new("camera", data)
    turn = (z_up(at) - z_up(eye)).to_track_quat("-Z", "Y").to_matrix().to_4x4()
    camera.matrix_world = Matrix.Translation(z_up(eye)) @ turn
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera


def set_quality(jobs):
    scene = bpy.context.scene
    render, cycles = scene.render, scene.cycles
    render.engine = "CYCLES"
    render.resolution_x, render.resolution_y, render.resolution_percentage = jobs["width"], jobs["height"], 100
    render.threads_mode, render.threads = "FIXED", len(os.sched_getaffinity(0))
    render.use_compositing = render.use_sequencer = False
    render.film_transparent = True
    image = render.image_settings
    image.file_format, image.color_mode, image.color_depth = "OPEN_EXR", "RGBA", "32"
    cycles.device, cycles.samples, cycles.seed = "CPU", jobs["samples"], 0
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.pixel_filter_type = "BOX"
    cycles.max_bounces = cycles.diffuse_bounces = cycles.glossy_bounces = cycles.transmission_bounces = jobs["bounces"]
    cycles.transparent_max_bounces = 64
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = 0
    cycles.blur_glossy = 0
    cycles.caustics_reflective = cycles.caustics_refractive = True


def render(out):
    file = out + ".exr"
    bpy.context.scene.render.filepath = file
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(file)
    image.colorspace_settings.name = "Non-Color"
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    os.remove(file)
    return pixels.reshape(image.size[1], image.size[0], 4)[::-1]


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        jobs = json.load(file)
    for job in jobs["models"]:
        bpy.ops.wm.read_factory_settings(use_empty=True)
        bpy.ops.import_scene.gltf(filepath=job["file"], disable_bone_shape=True)
        for thing in bpy.context.scene.objects:
            if thing.type == "MESH":
                slots = thing.data.materials
                if not slots:
                    slots.append(None)
                for i, material in enumerate(slots):
                    slots[i] = material or bpy.data.materials.new("DefaultMaterial")
        for material in bpy.data.materials:
            complete(material)
        environment(jobs["environment"], jobs["intensity"])
        eye, at = camera_for(vertices(), job["direction"], jobs["width"], jobs["height"], jobs["focal_px"])
        set_camera(eye, at, jobs)
        set_quality(jobs)
        np.savez_compressed(job["out"], pixels=render(job["out"]), eye=eye, at=at, key=job["key"])
        print("rendered:", os.path.basename(job["out"]), flush=True)


main()
