"""Replayed kernels give what a fresh one would: for other cameras, beside other scenes, with what they hold."""

from __future__ import annotations

import gc
import weakref
from dataclasses import replace
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera, RayGenerator
from gibench.rendering.light_rig import LightRig
from gibench.rendering.replay import Replay, ReplayError, arrays_of, camera_arrays, ray_generator
from gibench.rendering.scene import load_dict
from tests.rendering import scenes

SIZE = (8, 6)
CAMERAS = [
    PinholeCamera((0.2 * k, -3.0, 1.0), (0.1 * k, 0.0, 0.5 + 0.1 * k), 0.6 + 0.1 * k) for k in range(4)
]


def seen(scene, generator):
    lane = dr.arange(mi.UInt32, SIZE[0] * SIZE[1])
    row = lane // SIZE[0]
    ray = generator.rays(mi.Point2f(mi.Float(lane - row * SIZE[0]) + 0.5, mi.Float(row) + 0.5))
    si = scene.mi_scene.ray_intersect(ray)
    color = si.bsdf(ray).eval_diffuse_reflectance(si)
    dr.eval(si.t, color, scene.material_ids(si.bsdf(ray), si.is_valid()))
    return si.t, color, scene.material_ids(si.bsdf(ray), si.is_valid())


def test_every_camera_sees_what_it_would_without_replay():
    # One after another while the others stay alive: calls of a material reach those of all scenes.
    for description in (
        scenes.box("textured"),
        scenes.box("coat"),
        scenes.furnace(scenes.MATERIALS["metal"]),
    ):
        scene = load_dict(description)
        replay = Replay(scene, lambda camera, scene=scene: seen(scene, ray_generator(camera)))
        for camera in CAMERAS:
            found = replay(camera_arrays(camera, SIZE))
            for one, other in zip(found, seen(scene, RayGenerator(camera, SIZE)), strict=True):
                np.testing.assert_array_equal(np.array(one), np.array(other))
        assert replay.recordings == 1


def test_python_numbers_are_part_of_the_recording():
    replay = Replay(load_dict(scenes.box("coat")), lambda values, factor: values * factor)
    values = mi.Float([1, 2, 3])
    for factor in (2, 5, 2):
        np.testing.assert_array_equal(np.array(replay(values, factor)), np.array([1, 2, 3]) * factor)


def test_what_is_held_may_be_read():
    class Thing:
        def __init__(self):
            self.table = mi.Float([10, 20, 30])
            self.name = "not an array"
            self.arrays = {"table": self.table}
            dr.make_opaque(self.table)

    thing = Thing()
    replay = Replay(
        load_dict(scenes.box("coat")),
        lambda index: dr.gather(mi.Float, thing.table, index),
        arrays_of(thing),
    )
    for index in ([0, 2], [1, 1], [2, 0]):
        np.testing.assert_array_equal(np.array(replay(mi.UInt32(index))), np.array([10, 20, 30])[index])


def test_a_scene_dies_with_what_holds_it():
    """At once, by counting references: where Python looks for cycles instead, kernels may be being traced."""
    gc.disable()
    try:
        scene = load_dict(scenes.box("coat"))
        watched = weakref.ref(scene)
        replay = Replay(scene, partial(lambda scene, camera: seen(scene, ray_generator(camera)), scene))
        replay(camera_arrays(CAMERAS[0], SIZE))
        del scene
        assert watched() is not None
        del replay
        assert watched() is None
    finally:
        gc.enable()


def test_garbage_is_collected_again_after_a_call():
    replay = Replay(load_dict(scenes.box("coat")), lambda values: values + 1)
    assert gc.isenabled()
    replay(mi.Float([1, 2]))
    assert gc.isenabled()
    with pytest.raises(RuntimeError, match="record"):
        Replay(load_dict(scenes.box("coat")), lambda values: 1 / 0)(mi.Float([1, 2]))
    assert gc.isenabled()


def test_after_a_failure_others_work():
    scene = load_dict(scenes.box("coat"))
    with pytest.raises(RuntimeError, match="record"):
        Replay(scene, lambda camera: seen(scene, ray_generator(camera)) / 0)(camera_arrays(CAMERAS[0], SIZE))
    found = Replay(scene, lambda camera: seen(scene, ray_generator(camera)))(camera_arrays(CAMERAS[1], SIZE))
    np.testing.assert_array_equal(
        np.array(found[0]), np.array(seen(scene, RayGenerator(CAMERAS[1], SIZE))[0])
    )


class Declaring:
    """A table in rows, which a look at the attributes alone would miss."""

    def __init__(self, declare=True):
        self.rows = [{"values": mi.Float([10, 20, 30])}]
        self.declare = declare
        dr.make_opaque(self.rows)

    @property
    def arrays(self):
        return self.rows if self.declare else []


def test_nested_arrays_that_change_are_no_part_of_the_recording():
    thing, scene = Declaring(), load_dict(scenes.box("coat"))
    replay = Replay(scene, lambda index: dr.gather(mi.Float, thing.rows[0]["values"], index))
    replay._changing.append(thing)
    for factor in (1, 2, 3):
        # From a list, not an array of NumPy, whose memory Dr.Jit reads in place: recordings are told apart by whether
        # it begins at a multiple of 64 bytes, which is luck.
        thing.rows = [{"values": mi.Float([10 * factor, 20 * factor, 30 * factor])}]
        dr.make_opaque(thing.rows)
        np.testing.assert_array_equal(np.array(replay(mi.UInt32([2, 0]))), np.multiply([30, 10], factor))
    assert replay.recordings == 1


def test_an_array_that_is_left_out_is_an_error_with_its_place():
    with pytest.raises(ReplayError, match=r"Declaring\.rows\[0\]\['values'\].*keep the value"):
        arrays_of(Declaring(declare=False))


def test_what_a_scene_shows_is_complete():
    openings = np.array([[[0.0, 0, 2], [1, 0, 0], [0, 1, 0]]])
    description = scenes.box("coat") | {"sky": {"type": "constant"}}
    scene = replace(load_dict(description), openings=openings)
    rig = LightRig(scene)
    for thing in (rig.scene.portals, rig.scene.lights, RayGenerator(CAMERAS[0], SIZE)):
        assert arrays_of(thing)
