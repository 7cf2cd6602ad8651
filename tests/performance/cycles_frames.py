"""Frames of a matt room by Blender Cycles: run by a Python that has `bpy`, with the room's .npz and words of OPTIONS.

Each line of its input is a JSON object of seed, resolution, samples, max_depth (scattering events) and file; each line
that it answers, when that frame lies in the file, of OpenEXR, is the CPU seconds of its process so far.
"""

from __future__ import annotations

import json
import os
import sys
import time

import bpy
import numpy as np
from mathutils import Matrix

OPTIONS = ("lamps", "portals", "guiding")
"""Area lights in place of disks and rectangles that glow; portals in the openings; path guiding by OpenPGL."""

IN_FRONT = 5e-4
"""Metres from the mesh of a lamp, which it does not hide, to its area light."""


def nodes_of(owner):
    """Its node tree, empty."""
    owner.use_nodes = True
    owner.node_tree.nodes.clear()
    return owner.node_tree


def color(values):
    return (*(float(v) for v in values), 1.0)


def glowing(tree, radiance, kind):
    """An emission or background node of this radiance."""
    node = tree.nodes.new(kind)
    node.inputs["Color"].default_value = color(radiance / radiance.max())
    node.inputs["Strength"].default_value = float(radiance.max())
    return node


def material(name, reflectance, radiance):
    """Matt on both sides; what glows does so in front."""
    made = bpy.data.materials.new(name)
    tree = nodes_of(made)
    end = tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"]
    matt = tree.nodes.new("ShaderNodeBsdfDiffuse")
    matt.inputs["Color"].default_value = color(reflectance)
    matt.inputs["Roughness"].default_value = 0.0
    if not radiance.any():
        made.cycles.emission_sampling = "NONE"
        tree.links.new(matt.outputs[0], end)
        return made
    made.cycles.emission_sampling = "FRONT"
    both, side = tree.nodes.new("ShaderNodeAddShader"), tree.nodes.new("ShaderNodeMixShader")
    back = tree.nodes.new("ShaderNodeNewGeometry").outputs["Backfacing"]
    tree.links.new(back, side.inputs[0])
    tree.links.new(glowing(tree, radiance, "ShaderNodeEmission").outputs[0], side.inputs[1])
    tree.links.new(matt.outputs[0], both.inputs[0])
    tree.links.new(side.outputs[0], both.inputs[1])
    tree.links.new(both.outputs[0], end)
    return made


def area_light(scene, shape, across, along, normal, centre):
    """Of full edges `across` and `along`, which shines along `normal`; it has no power yet."""
    lamp = bpy.data.lights.new("light", "AREA")
    lamp.shape = shape
    lamp.size, lamp.size_y = float(np.linalg.norm(across)), float(np.linalg.norm(along))
    # Blender's shine along -Z.
    x, z = across / np.linalg.norm(across), -normal / np.linalg.norm(normal)
    place = np.eye(4)
    place[:3] = np.column_stack([x, np.cross(z, x), z, centre])
    held = bpy.data.objects.new("light", lamp)
    held.matrix_world = Matrix(place.tolist())
    held.visible_camera = True  # which lights are not by themselves
    scene.collection.objects.link(held)
    return lamp


def lamp(scene, shape, matrix, vertices, faces, radiance):
    """An area light of the power of a flat mesh that glows."""
    across, along, normal, centre = matrix[:3].T
    normal = normal / np.linalg.norm(normal)
    made = area_light(scene, shape, 2 * across, 2 * along, normal, centre + IN_FRONT * normal)
    a, b, c = (vertices[faces[:, corner]] for corner in range(3))
    area = 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum()
    made.color = (radiance / radiance.max()).tolist()
    made.energy = float(np.pi * area * radiance.max())


def build(room, options):
    """The scene of a room as `matt_rooms.save` wrote it."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    for number, (reflectance, radiance) in enumerate(
        zip(room["reflectances"], room["radiances"], strict=True)
    ):
        name = f"shape_{number}"
        kind = str(room["flat_lights"][number])
        if kind and "lamps" in options:
            vertices, faces = room[f"vertices_{number}"], room[f"faces_{number}"]
            lamp(scene, kind.upper(), room["matrices"][number], vertices, faces, radiance)
            radiance = np.zeros(3)
        mesh = bpy.data.meshes.new(name)
        mesh.from_pydata(room[f"vertices_{number}"].tolist(), [], room[f"faces_{number}"].tolist())
        mesh.materials.append(material(name, reflectance, radiance))
        scene.collection.objects.link(bpy.data.objects.new(name, mesh))
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.angle = "HORIZONTAL", float(room["fov"])
    lens.clip_start, lens.clip_end = 1e-4, 1e5
    camera = bpy.data.objects.new("camera", lens)
    right, down, forward = room["frame"]
    place = np.eye(4)
    place[:3] = np.column_stack([right, -down, -forward, room["position"]])
    camera.matrix_world = Matrix(place.tolist())
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.world = bpy.data.worlds.new("world")
    tree = nodes_of(scene.world)
    background = tree.nodes.new("ShaderNodeBackground")
    background.inputs["Color"].default_value = (0, 0, 0, 1)
    tree.links.new(background.outputs[0], tree.nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
    if "panorama" in room:
        pixels = room["panorama"]
        height, width = pixels.shape[:2]
        image = bpy.data.images.new("panorama", width, height, alpha=False, float_buffer=True)
        rows = np.concatenate([pixels, np.ones((height, width, 1))], axis=2)[::-1]
        image.pixels.foreach_set(rows.astype(np.float32).ravel())
        image.update()
        node = tree.nodes.new("ShaderNodeTexEnvironment")
        node.image, node.projection, node.interpolation = image, "EQUIRECTANGULAR", "Linear"
        tree.links.new(node.outputs["Color"], background.inputs["Color"])
        if "portals" in options:
            for corner, u, v in room["openings"]:
                centre = corner + 0.5 * (u + v)
                area_light(scene, "RECTANGLE", u, v, np.cross(u, v), centre).cycles.is_portal = True


def settle(options):
    """Cycles as it samples by itself, without what is biased."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.use_adaptive_sampling = cycles.use_denoising = cycles.use_fast_gi = False
    cycles.use_animated_seed = False
    cycles.sample_clamp_direct = cycles.sample_clamp_indirect = cycles.blur_glossy = 0.0
    cycles.light_sampling_threshold = 0.0
    cycles.use_light_tree = True
    cycles.caustics_reflective = cycles.caustics_refractive = True
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.use_guiding = "guiding" in options
    render = scene.render
    render.threads_mode, render.threads = "FIXED", len(os.sched_getaffinity(0))
    render.resolution_percentage = 100
    render.use_compositing = render.use_sequencer = False
    render.use_persistent_data = True
    render.image_settings.file_format = "OPEN_EXR"
    render.image_settings.color_mode, render.image_settings.color_depth = "RGB", "32"


def frame(*, seed, resolution, samples, max_depth, file):
    scene = bpy.context.scene
    # Cycles counts from what is lit directly.
    scene.cycles.max_bounces = scene.cycles.diffuse_bounces = max_depth - 1
    scene.cycles.seed, scene.cycles.samples = seed, samples
    scene.render.resolution_x, scene.render.resolution_y = resolution
    scene.render.filepath = file
    bpy.ops.render.render(write_still=True)


def main():
    # Blender prints as it likes.
    answers = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    options = sys.argv[2:]
    assert set(options) <= set(OPTIONS), options
    with np.load(sys.argv[1]) as room:
        build(dict(room), options)
    settle(options)
    print(f"{time.process_time()}", file=answers, flush=True)
    for line in sys.stdin:
        frame(**json.loads(line))
        print(f"{time.process_time()}", file=answers, flush=True)


if __name__ == "__main__":
    main()
