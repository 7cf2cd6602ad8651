"""Area lights in free space: measured with an independent distance to every triangle of the room."""

import itertools

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

from gibench.generators.area_lights import (
    LUMENS,
    SIDES,
    NoPlaceForLight,
    area_light,
    sample_area_light,
    sample_area_light_path,
)
from gibench.generators.layouts.placement import RejectedRoom
from gibench.generators.light_shapes import light_mesh
from gibench.generators.light_space import (
    CLEARANCE,
    FINE,
    LARGEST_IN_VIEW,
    LightSpace,
    empty,
    room_light_space,
    share_of_view,
)
from gibench.rendering.backend import select_variant
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.free_space import NoFreeSpace
from gibench.rendering.scene import load_dict
from tests.generators import rooms_at_hand

UPRIGHT = Rotation.from_matrix(np.column_stack([[1, 0, 0], [0, 0, 1], [0, -1, 0]]))


@pytest.fixture(scope="module")
def room():
    return rooms_at_hand.room(2)


@pytest.fixture(scope="module")
def space(room):
    return room_light_space(room)


@pytest.fixture(scope="module")
def triangles(room):
    """(N, 3, 3) corners of everything in the room."""
    meshes = [m for thing in room.objects for m, _ in thing.shapes] + [light_mesh(li) for li in room.lights]
    return np.concatenate([m.vertices[m.faces] for m in meshes])


def distance(triangles, light):
    """Least distance of a grid of points on a light to triangles, if it is below a metre."""
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 5), np.linspace(-0.5, 0.5, 5))
    local = np.stack([u * light.width, v * light.height, 0 * u], axis=-1).reshape(-1, 3)
    least = 1.0
    for point in local @ light.axes + np.array(light.centre):
        outside = np.maximum(triangles.min(axis=1) - point, point - triangles.max(axis=1)).max(axis=1)
        near = triangles[outside < least]
        closest = trimesh.triangles.closest_point(near, np.tile(point, (len(near), 1)))
        least = np.linalg.norm(np.reshape(closest, (-1, 3)) - point, axis=1).min(initial=least)
    return least


def test_lights_keep_away_from_everything(space, triangles):
    rng = np.random.default_rng(1)
    for light in [sample_area_light(rng, space) for _ in range(8)]:
        assert distance(triangles, light) >= CLEARANCE - 1e-4


def test_size_flux_and_colour_lie_in_their_ranges(space):
    rng = np.random.default_rng(2)
    lights = [sample_area_light(rng, space) for _ in range(24)]
    sides = np.array([(light.width, light.height) for light in lights])
    assert ((sides >= SIDES[0]) & (sides <= SIDES[1])).all()
    flux = np.array([light.luminous_flux for light in lights])
    assert ((flux >= LUMENS[0] * 0.999) & (flux <= LUMENS[1] * 1.001)).all()
    assert len({light.centre for light in lights}) == len(lights)
    # Any direction: they point into all eight octants before long.
    assert len({tuple(np.sign(light.direction)) for light in lights}) >= 6


def test_the_same_seed_gives_the_same_lights(space, room):
    def drawn():
        return sample_area_light(np.random.default_rng(5), room_light_space(room))

    assert drawn() == drawn() == sample_area_light(np.random.default_rng(5), space)


def test_no_light_stands_before_the_lens(space, room):
    rng = np.random.default_rng(3)
    camera = room.cameras[0]
    lights = [sample_area_light(rng, space, cameras=[camera], aspect=4 / 3) for _ in range(12)]
    assert max(share_of_view(light, camera, 4 / 3) for light in lights) <= LARGEST_IN_VIEW


def test_how_much_of_a_view_a_light_covers():
    camera = PinholeCamera((0, 0, 0), (0, 1, 0), np.pi / 2)  # sees 2 m × 1 m at 1 m
    wall = area_light((0, 1, 0), UPRIGHT, 1.0, 0.5, 1000.0, 3000.0)
    assert share_of_view(wall, camera, 2.0) == pytest.approx(0.25)
    assert share_of_view(area_light((0, -1, 0), UPRIGHT, 1.0, 1.0, 1000.0, 3000.0), camera, 2.0) == 0
    half = area_light((1, 1, 0), UPRIGHT, 1.0, 0.5, 1000.0, 3000.0)
    assert share_of_view(half, camera, 2.0) == pytest.approx(0.125)
    # A floor that the camera stands on reaches from under it to the horizon: the part behind the lens is cut off.
    floor = area_light((0, 0, -0.5), Rotation.identity(), 100.0, 100.0, 1000.0, 3000.0)
    assert share_of_view(floor, camera, 2.0) == pytest.approx(
        0.5 - 0.01
    )  # up to 50 m, a hundredth below the horizon


def test_a_light_on_its_way_keeps_away_from_everything_and_moves_smoothly(space, triangles, room):
    lights = sample_area_light_path(np.random.default_rng(4), space, 24, cameras=room.cameras[:1])
    assert len(lights) == 24
    centres = np.array([light.centre for light in lights])
    steps = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    np.testing.assert_allclose(steps, steps.mean(), rtol=0.05)
    assert steps.sum() >= 0.7
    # No corner in the way, and no jump in the direction.
    towards = np.diff(centres, axis=0) / steps[:, None]
    assert np.degrees(np.arccos((towards[1:] * towards[:-1]).sum(axis=1).clip(-1, 1))).max() < 25
    turn = [Rotation.from_matrix(light.axes.T) for light in lights]
    turned = [np.degrees((a.inv() * b).magnitude()) for a, b in itertools.pairwise(turn)]
    assert max(turned) < 25
    assert len({(light.width, light.height, light.radiance) for light in lights}) == 1
    for light in lights[::6]:
        assert distance(triangles, light) >= CLEARANCE - 1e-4
        assert share_of_view(light, room.cameras[0], 1.0) <= LARGEST_IN_VIEW


@pytest.fixture(scope="module")
def mi():
    select_variant()
    import mitsuba

    return mitsuba


def box_space(mi, size, *extra):
    """The space in a closed box of `size`³ m, with other shapes in it."""
    to_world = mi.ScalarTransform4f().scale(size / 2)
    walls = {"type": "cube", "to_world": to_world, "flip_normals": True}
    scene = load_dict({"type": "scene", "walls": walls, **{f"thing{k}": e for k, e in enumerate(extra)}})
    return LightSpace(scene, np.random.default_rng(0).uniform(-size / 2, size / 2, (500, 3)))


def test_a_cord_of_five_millimetres_is_found(mi):
    light = area_light((0, 0, 0), Rotation.identity(), 0.5, 0.5, 1000.0, 3000.0)
    cord = {"type": "cylinder", "p0": [0.013, 0.1501, -1], "p1": [0.013, 0.1501, 1], "radius": 0.0026}
    assert empty(box_space(mi, 4.0).scene, [light], FINE)[0]
    assert not empty(box_space(mi, 4.0, cord).scene, [light], FINE)[0]


def test_a_room_with_no_space_says_so(mi):
    with pytest.raises(NoPlaceForLight, match="256 places for an area light were tried") as caught:
        sample_area_light(np.random.default_rng(0), box_space(mi, 0.5))
    assert isinstance(caught.value, RejectedRoom)
    assert "\n" not in str(caught.value)
    with pytest.raises(NoPlaceForLight, match="ways of an area light were tried"):
        sample_area_light_path(np.random.default_rng(0), box_space(mi, 0.5), 8)
    with pytest.raises(NoFreeSpace, match="no free space"):
        LightSpace(box_space(mi, 1.0).scene, np.zeros((0, 3)))


def test_fixed_parameters_are_kept(mi):
    space = box_space(mi, 3.0)
    light = sample_area_light(np.random.default_rng(0), space, width=0.4, height=0.3, lumens=2000.0)
    assert (light.width, light.height) == (0.4, 0.3)
    assert light.luminous_flux == pytest.approx(2000.0, rel=1e-6)
    assert sample_area_light_path(np.random.default_rng(0), space, 1)[0].width > 0


def test_a_light_that_shines_out_of_the_scene_lights_nothing(mi):
    """Only a floor is there: every light that is kept shines down on it."""
    floor = {"type": "rectangle", "to_world": mi.ScalarTransform4f().scale(50)}
    points = np.random.default_rng(0).uniform((-1, -1, 0.5), (1, 1, 2), (300, 3))
    space = LightSpace(load_dict({"type": "scene", "floor": floor}), points)
    rng = np.random.default_rng(1)
    assert all(sample_area_light(rng, space).direction[2] < 0.1 for _ in range(12))
