import numpy as np
import pytest
import trimesh

from gibench.generators.glb import write_glb
from gibench.generators.light_shapes import light_mesh
from gibench.generators.parts import Texture
from gibench.generators.scene_files import write_room
from tests.generators.rooms_at_hand import joined, room


@pytest.fixture(scope="module")
def loaded(tmp_path_factory):
    path = tmp_path_factory.mktemp("room")
    write_room(room(2), path)
    return trimesh.load(path / "room.glb", force="scene", process=False)


def test_geometry_is_that_of_the_room_with_y_up(loaded):
    a_room = room(2)
    vertices = [joined(thing)[0] for thing in a_room.objects] + [
        light_mesh(x).vertices for x in a_room.lights
    ]
    everything = np.concatenate(vertices)
    low, high = everything.min(0), everything.max(0)
    # Y up: x stays, the old z is the new y, the old y points against the new z.
    expected = np.array([[low[0], low[2], -high[1]], [high[0], high[2], -low[1]]])
    np.testing.assert_allclose(loaded.bounds, expected, atol=1e-5)
    faces = sum(len(mesh.faces) for thing in a_room.objects for mesh, _ in thing.shapes)
    faces += sum(len(light_mesh(x).faces) for x in a_room.lights)
    assert sum(len(g.faces) for g in loaded.geometry.values()) == faces


def test_materials_are_those_of_the_room(loaded):
    a_room = room(2)
    names = {g.visual.material.name for g in loaded.geometry.values()}
    used = {material for thing in a_room.objects for _, material in thing.shapes}
    assert names == used | {light.name for light in a_room.lights}
    for geometry in loaded.geometry.values():
        surface = geometry.visual.material
        if surface.name not in a_room.materials:
            assert max(surface.emissiveFactor) == pytest.approx(1.0)
            continue
        material = a_room.materials[surface.name]
        if isinstance(material.reflectance, Texture):
            np.testing.assert_array_equal(
                np.asarray(surface.baseColorTexture)[..., :3], material.reflectance.pixels
            )
        if material.bsdf == "diffuse":
            assert surface.roughnessFactor == 1.0
        else:
            assert surface.roughnessFactor**2 == pytest.approx(material.alpha, abs=1e-6)
        assert surface.metallicFactor == float("conductor" in material.bsdf)


def test_textures_repeat_at_their_size(loaded):
    a_room = room(2)
    floor = next(o for o in a_room.objects if o.name == "floor")
    mesh, name = floor.shapes[0]
    reflectance = a_room.materials[name].reflectance
    size = reflectance.size if isinstance(reflectance, Texture) else (1.0, 1.0)
    geometry = next(g for k, g in loaded.geometry.items() if k == "floor")
    # trimesh counts v from the bottom of the image, glTF and the room from its top.
    uv = np.column_stack([geometry.visual.uv[:, 0], 1 - geometry.visual.uv[:, 1]])
    np.testing.assert_allclose(uv, mesh.uvs / size, rtol=1e-5, atol=1e-5)


def test_a_room_without_textures_has_no_images(tmp_path):
    a_room = room(2)
    plain = {n: m for n, m in a_room.materials.items() if not isinstance(m.reflectance, Texture)}
    things = tuple(t for t in a_room.objects if all(m in plain for _, m in t.shapes))
    from dataclasses import replace

    write_glb(replace(a_room, objects=things, materials=plain), tmp_path)
    scene = trimesh.load(tmp_path / "room.glb", force="scene")
    assert len(scene.geometry) > 0
