"""Still lifes: what is in them, that nothing floats or meets, that cameras see it, that the ring throws light."""

import math

import numpy as np
import pytest

from gibench.datasets.recipes import check_recipe
from gibench.generators.materials import is_glossy
from gibench.generators.rooms import ALL_KINDS, KINDS, sample_room
from gibench.generators.still_life.figures import ANIMALS
from gibench.generators.still_life.scene import COUNT
from gibench.generators.still_life.things import THINGS, ring, sample_thing
from gibench.rendering.camera import PinholeCamera
from tests.generators.rooms_at_hand import directed_edges_cancel

INDICES = range(8)


@pytest.fixture(scope="module")
def still_lifes():
    return [sample_room(3, index, kind="still-life", views=2) for index in INDICES]


def things(room):
    return [(thing, thing.shapes[0][0], room.materials[thing.shapes[0][1]]) for thing in room.objects[1:]]


def test_a_ring_and_three_to_eight_things_glossy_and_matt(still_lifes):
    for room in still_lifes:
        found = things(room)
        assert COUNT[0] <= len(found) <= COUNT[1]
        assert [thing.family for thing, _, _ in found].count("ring") == 1
        assert found[0][0].family == "ring"
        assert found[0][2].bsdf == "roughconductor"
        assert sum(is_glossy(material) for _, _, material in found) >= 2
        assert any(material.bsdf == "diffuse" for _, _, material in found)
        assert room.lights == ()
        assert room.environment.kind == "hdr"
    assert {room.parameters["support"] for room in still_lifes} == {"ground", "table"}
    counts = {len(things(room)) for room in still_lifes}
    assert len(counts) >= 4


def test_nothing_floats_or_meets(still_lifes):
    for room in still_lifes:
        assert max(mesh.vertices[:, 2].max() for mesh, _ in room.objects[0].shapes) == pytest.approx(0)
        outlines = []
        for _, mesh, _ in things(room):
            assert 0 < mesh.vertices[:, 2].min() < 1e-3
            outlines.append(mesh.vertices[:, :2])
            # All of it stands on the ground or the table.
            support = room.objects[0].shapes[0][0].vertices[:, :2]
            assert (mesh.vertices[:, :2] > support.min(axis=0)).all()
            assert (mesh.vertices[:, :2] < support.max(axis=0)).all()
        for k, one in enumerate(outlines):
            for other in outlines[k + 1 :]:
                assert np.linalg.norm(one[::7, None] - other[None, ::7], axis=-1).min() > 0.01


def test_every_camera_sees_the_things(still_lifes):
    for room in still_lifes:
        for camera in room.cameras:
            pinhole = PinholeCamera(camera.position, camera.target, camera.fov)
            middles = np.array(
                [(m.vertices.max(axis=0) + m.vertices.min(axis=0)) / 2 for _, m, _ in things(room)]
            )
            x, y, depth = pinhole.project(middles, (320, 240))
            assert (depth > 0.2).all()
            assert ((x > -20) & (x < 340) & (y > -20) & (y < 260)).all()
            assert camera.position[2] > 0.1
        one, other = (np.array(camera.position) for camera in room.cameras)
        assert np.linalg.norm(one - other) > 0.3


@pytest.mark.parametrize("path", ["walk", "orbit", "eight"])
def test_paths_are_smooth(path):
    room = sample_room(3, 0, kind="still-life", views=2, path=path, path_views=24)
    assert len(room.cameras) == 26
    walked = room.cameras[2:]
    assert [(camera.path, camera.step) for camera in walked] == [(path, k) for k in range(24)]
    places = np.array([camera.position for camera in walked])
    steps = np.linalg.norm(np.diff(places, axis=0), axis=1)
    assert 0.005 < steps.max() < 0.4
    assert np.linalg.norm(np.diff(places, 2, axis=0), axis=1).max() < 0.35 * steps.max()


def test_the_same_seed_gives_the_same_still_life_and_another_another():
    one, same, other = (sample_room(seed, 5, kind="still-life", views=1) for seed in (0, 0, 1))
    assert [t.name for t in one.objects] == [t.name for t in same.objects]
    for a, b in zip(one.objects, same.objects, strict=True):
        np.testing.assert_array_equal(a.shapes[0][0].vertices, b.shapes[0][0].vertices)
    assert one.cameras == same.cameras
    assert one.environment == same.environment
    assert one.cameras != other.cameras


def test_it_must_be_asked_for():
    assert "still-life" not in KINDS
    assert set(check_recipe({"kinds": ["all"]}).kinds) == set(KINDS)
    assert check_recipe({"kinds": ["still-life"]}).kinds == ("still-life",)
    assert check_recipe({"kinds": ["all", "still-life"]}).kinds == ALL_KINDS


@pytest.mark.parametrize("name", [*THINGS, "ring"])
def test_things_are_closed_stand_on_the_ground_and_have_a_size_for_the_hand(name):
    for seed in range(3):
        mesh = sample_thing(np.random.default_rng(seed), name)
        assert directed_edges_cancel(mesh)
        corners = mesh.vertices[mesh.faces]
        assert np.einsum("ij,ij->", corners[:, 0], np.cross(corners[:, 1], corners[:, 2])) > 0
        face = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        facing = np.einsum("ij,ij->i", mesh.normals[mesh.faces].mean(axis=1), face)
        assert (facing > 0)[np.linalg.norm(face, axis=1) > 1e-10].mean() > 0.999
        assert mesh.vertices[:, 2].min() == pytest.approx(0, abs=1e-9)
        assert 0.02 < np.ptp(mesh.vertices, axis=0).max() < 0.5


def test_animals_of_one_species_differ():
    for species in ANIMALS:
        one, other = (sample_thing(np.random.default_rng(seed), species) for seed in (0, 1))
        assert not math.isclose(np.ptp(one.vertices[:, 1]), np.ptp(other.vertices[:, 1]), rel_tol=1e-3)


def test_a_ring_throws_a_caustic():
    """The bright curve inside of a ring under a small lamp is there with the ring, and not without it.

    A ray that comes in level with the ground at radius 1 leaves the mirror towards the curve whose cusp lies half way
    between middle and rim (nephroid): the ground is brighter there than open ground is.
    """
    from gibench.rendering.backend import select_variant
    from gibench.rendering.render import render_frame
    from gibench.rendering.scene import load_dict

    select_variant()
    import mitsuba as mi

    from gibench.generators.light_space import _mitsuba_mesh

    at, scale = mi.ScalarTransform4f(), 0.1
    mirror = {"type": "twosided", "bsdf": {"type": "roughconductor", "material": "Ag", "alpha": 0.02}}
    band = _mitsuba_mesh("band", ring(radius=scale, height=0.05, thickness=0.006))
    props = mi.Properties()
    props["mesh_bsdf"] = mi.load_dict(mirror)
    lit = mi.Mesh("band", band.vertex_count(), band.face_count(), has_vertex_normals=False, props=props)
    parameters = mi.traverse(lit)
    for key in ("vertex_positions", "faces"):
        parameters[key] = mi.traverse(band)[key]
    parameters.update()
    lamp_at = at.look_at(origin=[0.9, 0, 0.5], target=[0, 0, 0], up=[0, 0, 1]).scale(0.03)
    base = {
        "type": "scene",
        "ground": {"type": "rectangle", "bsdf": {"type": "diffuse", "reflectance": 0.5}},
        "lamp": {
            "type": "rectangle",
            "to_world": lamp_at,
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": 100.0}},
        },
    }
    above = PinholeCamera((0, 0, 1.0), (0, 0, 0), 2 * math.atan(0.1))
    settings = {"resolution": (48, 48), "channels": ("color",), "spp": 256, "max_depth": 2}
    plain = render_frame(load_dict(base), above, **settings).arrays["color"].mean(axis=2)
    bright = render_frame(load_dict({**base, "band": lit}), above, **settings).arrays["color"].mean(axis=2)
    rows, columns = np.mgrid[0:48, 0:48]
    inside = np.hypot(rows - 23.5, columns - 23.5) < 0.85 * 24
    assert (bright[inside] > 1.3 * plain[inside]).sum() > 20
