"""Rooms with much gloss: measured by what their cameras see, and otherwise the rooms that they would be."""

import numpy as np
import pytest

from gibench.generators.gloss import MUCH, visible_gloss
from gibench.generators.parts import Camera, Material, Mesh, RoomObject
from gibench.generators.rooms import UnknownKind, sample_room


def square(name, material, x, half=1.0):
    """A thing that stands across the y axis at y = 1, x to the right."""
    corners = np.array([[x - half, 1, -half], [x + half, 1, -half], [x + half, 1, half], [x - half, 1, half]])
    mesh = Mesh(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32), np.zeros((0, 3)), np.zeros((0, 2)))
    return RoomObject(name, name, {}, (0.0, 0.0, 0.0), 0.0, ((mesh, material),))


def test_half_of_the_view():
    materials = {
        "shiny": Material("shiny", "paint", "roughplastic", (0.5, 0.5, 0.5), alpha=0.05),
        "rough": Material("rough", "paint", "roughplastic", (0.5, 0.5, 0.5), alpha=0.3),
    }
    camera = Camera((0.0, 0.0, 0.0), (0.0, 1.0, 0.0), np.pi / 2)
    both = [square("left", "shiny", -1.0), square("right", "rough", 1.0)]
    assert visible_gloss(both, materials, [camera]) == pytest.approx(0.5)
    assert visible_gloss(both[:1], materials, [camera]) == pytest.approx(0.5)
    assert visible_gloss(both[1:], materials, [camera]) == 0
    assert visible_gloss(both, materials, []) == 0


def test_rooms_with_much_gloss_have_it():
    glossy = [sample_room(3, index, kind="dining-kitchen", views=3, gloss="much") for index in range(2)]
    for room in glossy:
        assert room.parameters["gloss"] >= MUCH
        assert visible_gloss(room.objects, room.materials, room.cameras) == pytest.approx(
            room.parameters["gloss"], abs=1e-4
        )
    plain = [sample_room(3, index, kind="dining-kitchen", views=3) for index in range(2)]
    shares = [visible_gloss(room.objects, room.materials, room.cameras) for room in plain]
    assert np.mean(shares) < np.mean([room.parameters["gloss"] for room in glossy])
    assert all("gloss" not in room.parameters for room in plain)


def test_only_the_materials_change():
    """A try that passes has the things and cameras of the same try without the polish."""
    for index in range(8):
        room = sample_room(3, index, kind="bathroom", views=1, gloss="much")
        plain = sample_room(3, index, kind="bathroom", views=1)
        if room.parameters["attempt"] == plain.parameters["attempt"]:
            assert [t.name for t in room.objects] == [t.name for t in plain.objects]
            assert room.cameras == plain.cameras
            return
    pytest.fail("no room passed in the same try")


def test_unknown_gloss():
    with pytest.raises(UnknownKind, match="there is no gloss 'some'; choose from any, much"):
        sample_room(0, 0, gloss="some")
