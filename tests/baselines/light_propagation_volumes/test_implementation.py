"""Frames of `lpv`: what a closed box reflects, black light, hard lights, and one kernel for all frames."""

from __future__ import annotations

import dataclasses

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines.light_propagation_volumes import METHOD
from gibench.baselines.light_propagation_volumes.emission import lattice, lit_volume
from gibench.baselines.light_propagation_volumes.geometry import passing, room_grid, surfaces, walls
from gibench.baselines.light_propagation_volumes.implementation import PropagatedLight, spread
from gibench.baselines.light_propagation_volumes.volume import Grid
from gibench.baselines.linearly_transformed_cosines.rectangle import light_arrays
from gibench.baselines.method import MethodError, View
from gibench.baselines.stages import Stages
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import AreaLight, Lighting, Shot
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.area_lights import HARD_LIGHTS, LIGHT, lit_frame
from tests.baselines.material_strips import CAMERA, strips_rig
from tests.baselines.sites import site
from tests.rendering import scenes
from tests.rendering.test_kernels import kernels_of

RESOLUTION = (24, 20)
SETTINGS = {"cells": 8, "steps": 32, "virtual_lights": 16384, "rays": 1}


def prepared(rig, folder, **settings):
    running = PropagatedLight(METHOD.settings({**SETTINGS, **settings}))
    running.prepare(dataclasses.replace(site(rig.scene, folder), rig=rig))
    return running


@pytest.fixture(scope="module")
def rig():
    return strips_rig()


@pytest.fixture(scope="module")
def method(rig, tmp_path_factory):
    return prepared(rig, tmp_path_factory.mktemp("lpv"))


def frame(rig, method, light, resolution=RESOLUTION, camera=CAMERA):
    return lit_frame(rig, method, light, resolution, ("virtual lights", "propagation", "gather"), camera)


WHITE = 0.6


def closed_room(middle=(0.0, 0.0, 0.0), half=(1.0, 1.0, 1.0), **more):
    """Two metres wide, around the origin, where not said otherwise."""
    wall = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(WHITE))
    for axis in range(3):
        for side in (-1, 1):
            towards = side * np.eye(3)[axis]
            # Whichever of its sides lies along which axis, it reaches behind the walls beside it.
            size = max(h for a, h in enumerate(half) if a != axis)
            more[f"wall{axis}{side > 0}"] = scenes.rectangle(
                (np.array(middle) + half * towards).tolist(), (-towards).tolist(), (size, size), bsdf=wall
            )
    return load_dict({"type": "scene", **more})


@pytest.fixture(scope="module")
def white_room():
    return LightRig(closed_room(), panoramas=False)


@pytest.fixture(scope="module")
def white_folder(tmp_path_factory):
    """Where its bakes are."""
    return tmp_path_factory.mktemp("white")


INSIDE = PinholeCamera((0.0, -0.9, 0.0), (0.0, 1.0, -0.2), np.radians(80.0))


@pytest.mark.parametrize(("bounces", "depth"), [(1, 2), (4, 5)])
def test_indirect_light_of_a_closed_white_room_is_that_of_paths(white_room, white_folder, bounces, depth):
    """Once reflected light, and most of all of it, where nothing but walls is: they need not block light."""
    light = AreaLight((0.0, 0.0, 0.9), (0, 0, -1), 0.5, 0.5, (5, 4, 3))
    white_room.set(Lighting(area=light))
    truth = render_frame(
        white_room.scene,
        INSIDE,
        resolution=RESOLUTION,
        channels=("indirect_diffuse",),
        spp=64,
        max_depth=depth,
    ).arrays["indirect_diffuse"]
    method = prepared(white_room, white_folder, bounces=bounces, geometry=False)
    found = frame(white_room, method, light, camera=INSIDE).indirect
    np.testing.assert_allclose(found.mean(axis=(0, 1)), truth.mean(axis=(0, 1)), rtol=0.15)
    method.adjust(METHOD.settings({**SETTINGS, "bounces": bounces}))
    blocked = frame(white_room, method, light, camera=INSIDE).indirect
    assert 0.9 * found.mean() < blocked.mean() < 1.01 * found.mean()


@pytest.mark.parametrize("cells", [16, 32])
def test_faces_of_cells_lie_on_the_walls_of_a_room(cells):
    """Whatever its proportions, and behind a cupboard that covers a third of a wall."""
    middle, half = np.array((0.13, -0.27, 1.4)), np.array((2.75, 3.1, 1.4))
    cupboard = {
        "type": "cube",
        "to_world": mi.ScalarTransform4f().translate([2.7, -0.27, 1.0]).scale([0.3, 1, 1]),
    }
    grid = room_grid(closed_room(middle, half, cupboard=cupboard), cells)
    assert cells - cells // 8 <= max(grid.counts) <= cells
    low, high = (np.abs((middle + side * half - grid.low) / grid.side) for side in (-1, 1))
    np.testing.assert_allclose(low, 0, atol=0.15)
    np.testing.assert_allclose(high, grid.counts, atol=0.15)


def test_light_of_a_room_with_odd_proportions_is_that_of_paths(tmp_path):
    """With surfaces that block light: those of the walls are in nobody's way."""
    middle, shift = np.array((0.13, -0.27, 1.4)), np.array((0.3, 0.2, 0.7))
    rig = LightRig(closed_room(middle, (2.75, 3.1, 1.4)), panoramas=False)
    light = AreaLight(tuple((middle + shift).tolist()), (0.2, 0.1, -1), 0.5, 0.5, (5, 4, 3))
    rig.set(Lighting(area=light))
    camera = PinholeCamera(tuple((middle - (2.2, 2.5, 0)).tolist()), tuple(middle.tolist()), np.radians(80.0))
    truth = render_frame(
        rig.scene, camera, resolution=RESOLUTION, channels=("indirect_diffuse",), spp=64, max_depth=5
    ).arrays["indirect_diffuse"]
    found = [
        frame(rig, prepared(rig, tmp_path, **options), light, camera=camera).indirect.mean(axis=(0, 1))
        for options in (
            {"geometry": geometry, "cells": 16, "bounces": 4, "steps": 64} for geometry in (True, False)
        )
    ]
    np.testing.assert_allclose(found[0], truth.mean(axis=(0, 1)), rtol=0.12)
    np.testing.assert_allclose(found[0], found[1], rtol=0.02)


def test_walls_are_where_most_surface_faces_the_room():
    """A niche behind one, a board before it, and a side that is open, as towards a garden."""
    low, high = np.array((0.0, 0.0, 0.0)), np.array((4.0, 3.0, 2.5))
    pieces = [
        (4.1, (-1, 0, 0), 7.0),  # the wall, a little behind what free space has reached
        (4.3, (-1, 0, 0), 1.0),  # the back of the niche
        (3.9, (-1, 0, 0), 2.0),  # the board
        (0.1, (-1, 0, 0), 9.0),  # the back of a screen
    ]
    points, normals, areas = zip(*(((x, 1.5, 1.0), normal, area) for x, normal, area in pieces), strict=True)
    found = walls(low, high, *(np.array(part, dtype=float) for part in (points, normals, areas)))
    np.testing.assert_allclose(found[0], low)
    np.testing.assert_allclose(found[1], (4.1, 3.0, 2.5))
    nothing = np.zeros((0, 3))
    np.testing.assert_allclose(walls(low, high, nothing, nothing, np.zeros(0)), (low, high))


def test_virtual_lights_hold_the_light_that_the_room_reflects(white_room):
    """In a closed room every path hits a wall: it reflects its albedo, and what comes after that its square."""
    grid = Grid((-1.05, -1.05, -1.05), 2.1 / 8, (8, 8, 8))
    # So small that hardly a path meets the lamp itself, which is black.
    area = AreaLight((0.1, 0.2, 0.3), (0.3, 0.5, -1), 0.01, 0.01, (5, 4, 3))
    white_room.set(Lighting(area=area))
    for bounces, expected in ((1, WHITE), (3, WHITE + WHITE**2 + WHITE**3)):
        state = lit_volume(white_room.scene, grid.arrays, light_arrays(area), 4096, bounces, grid.size)
        assert 4 * np.pi * np.array(state[0]).sum() == pytest.approx(expected, rel=1e-3)


def test_the_lattice_is_even():
    u = np.array([np.array(part) for part in lattice(4096)])
    assert u.min() >= 0
    assert u.max() < 1
    assert u.mean(axis=1) == pytest.approx(0.5, abs=1e-3)
    assert (u[:, None] * u[None]).mean(axis=2)[~np.eye(4, dtype=bool)] == pytest.approx(0.25, abs=2e-3)


def test_surfaces_of_a_room_are_as_large_as_they_are():
    """And the faces of cells behind them are covered: a grid that is a cell larger on every side."""
    grid = Grid((-1.5, -1.5, -1.5), 0.5, (6, 6, 6))
    points, normals, areas = surfaces(closed_room(), grid, 1 << 17)
    assert np.abs(points).max() == pytest.approx(1, abs=1e-5)
    by_side = [areas[normals[:, axis] * side > 0.5].sum() for axis in range(3) for side in (-1, 1)]
    assert by_side == pytest.approx([4.0] * 6, rel=0.03)
    shares = passing(grid, points, normals, areas).reshape(6, 6, 6, 6)
    assert shares[0, 1:5, 1:5, 0].mean() < 0.05  # travelling along −x, into the cells behind the wall
    assert (shares[:, 1:5, 1:5, 1:5] == 1).all()


@pytest.mark.parametrize(("cells", "most"), [(8, 0.015), (9, 0.03)])
def test_rooms_beside_each_other_hardly_light_each_other(cells, most):
    """A wall of 4 mm parts them, on faces of cells or in the middle of cells, whose light is that of both rooms."""
    wall = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(WHITE))
    sheets = {f"sheet{side > 0}": [0.002 * side, 0, 0] for side in (-1, 1)}
    scene = closed_room(
        **{name: scenes.rectangle(at, [at[0] * 500, 0, 0], (1, 1), bsdf=wall) for name, at in sheets.items()}
    )
    grid = Grid((-1.0, -1.0, -1.0), 2 / cells, (cells, cells, cells))
    area = AreaLight((-0.9, 0.0, 0.0), (1, 0, 0), 0.5, 0.5, (5, 4, 3))
    state = lit_volume(scene, grid.arrays, light_arrays(area), 4096, 4, grid.size)
    shares = [mi.Float(share) for share in passing(grid, *surfaces(scene, grid, 1 << 18))]
    shape, half = (cells, cells, cells), cells // 2
    lit, free = (
        np.array(spread(grid.arrays, state, let_through, 64, grid.size)[0]).reshape(shape).sum(axis=(0, 1))
        for let_through in (shares, None)
    )
    assert free[-half:].sum() > 0.2 * free[:half].sum()
    assert lit[-half:].sum() < most * lit[:half].sum()


def test_frames_compile_no_kernel_again(rig, method):
    """Other lights and other cameras: the kernels of the first frame, recorded once."""

    def once(number):
        light = dataclasses.replace(LIGHT, centre=(0.1 * number, 0.0, 1.7), radiance=(1.0, 2.0, 1.0 + number))
        camera = dataclasses.replace(CAMERA, position=(0.05 * number, -2.4, 1.2))
        rig.set(Lighting(area=light))
        view = View(Shot(camera, Lighting(area=light)), None, RESOLUTION, number, number)
        return kernels_of(lambda: dr.eval(method.render(view, Stages())._images["color"]))

    once(0)
    launched = [once(number) for number in range(1, 5)]
    assert launched[0]
    assert all(kernels == launched[0] for kernels in launched)
    assert {name: kernel.recordings for name, kernel in method.kernels.items()} == dict.fromkeys(
        method.kernels, 1
    )


def test_black_light_is_black(rig, method):
    black = dataclasses.replace(LIGHT, radiance=(0, 0, 0))
    found = frame(rig, method, black)
    assert not found.color.any()
    red = frame(rig, method, dataclasses.replace(LIGHT, radiance=(1, 0, 0)))
    assert red.indirect[..., 0].any()
    assert not red.color[..., 1:].any()


@pytest.mark.parametrize("light", HARD_LIGHTS)
def test_hard_lights_give_finite_light(rig, method, light):
    frame(rig, method, light)


def test_light_is_linear_and_frames_repeat(rig, method):
    one = frame(rig, method, LIGHT).indirect
    np.testing.assert_array_equal(frame(rig, method, LIGHT).indirect, one)
    for scale in (2e-5, 2e4):
        scaled = dataclasses.replace(LIGHT, radiance=tuple(scale * c for c in LIGHT.radiance))
        np.testing.assert_allclose(frame(rig, method, scaled).indirect, scale * one, rtol=1e-5)


def test_a_frame_of_sky_alone_and_a_larger_one(rig, method):
    up = PinholeCamera((0.0, 0.0, 3.0), (0.0, 0.1, 9.0), 1.0)
    assert not frame(rig, method, LIGHT, camera=up).color.any()
    frame(rig, method, LIGHT, resolution=(240, 200))


def test_a_room_without_diffuse_surfaces_has_no_virtual_lights(tmp_path):
    mirror = scenes.MATERIALS["mirror"]
    parts = {
        "floor": scenes.rectangle([0, 0, 0], [0, 0, 1], (1.5, 1.5), bsdf=mirror),
        "wall": scenes.rectangle([0, 1.5, 1], [0, -1, 0], (1.5, 1), bsdf=scenes.MATERIALS["metal"]),
    }
    rig = LightRig(load_dict({"type": "scene", **parts}), panoramas=False)
    assert not frame(rig, prepared(rig, tmp_path, bounces=4), LIGHT).indirect.any()


def test_more_steps_without_another_preparation(rig, method):
    before = frame(rig, method, LIGHT).indirect.mean()
    method.adjust(METHOD.settings({**SETTINGS, "steps": 2}))
    assert 0 < frame(rig, method, LIGHT).indirect.mean() < before
    method.adjust(METHOD.settings(SETTINGS))


def test_a_frame_without_an_area_light_is_refused(rig, method):
    rig.set(Lighting())
    with pytest.raises(MethodError, match="lpv is for frames under an area light"):
        method.render(View(Shot(CAMERA), None, RESOLUTION, 0, 0), Stages())


@pytest.mark.parametrize("name", ["grid.json", "passing.npy"])
def test_damaged_bakes_are_named(rig, tmp_path, name):
    prepared(rig, tmp_path)
    path = next((tmp_path / "bakes").glob(f"geometry-*/{name}"))
    path.write_bytes(b"x" * path.stat().st_size)
    with pytest.raises(MethodError, match=r"cannot be read .* remove that folder"):
        prepared(rig, tmp_path)
