"""A rig lights a scene as if it had been loaded with that light, and compiles nothing to do so."""

from __future__ import annotations

import gc
from contextlib import contextmanager
from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.camera import PinholeCamera
from gibench.rendering.latlong import for_envmap
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import AreaLight, EnvironmentMap, Lighting, LightingError
from gibench.rendering.panoramas import Panorama
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering.scenes import CAMERA, MATERIALS, area, box, rectangle, rgb
from tests.rendering.test_lighting import panorama
from tests.rendering.test_portals import CAMERA as INSIDE
from tests.rendering.test_portals import OPENINGS_OF_ROOM, room

LIGHTS = (
    AreaLight((0.2, -0.1, 1.7), (0.3, 0.2, -2.0), 0.4, 0.3, (8, 7, 6)),
    AreaLight((-0.7, -0.6, 0.5), (1.0, 0.4, 0.1), 0.2, 0.5, (5, 9, 9)),
    AreaLight((0.0, 0.0, 1.2), (0, 0, 1), 0.8, 0.6, (2, 2, 3)),
)
SIZE = (256, 128)
AREA = tuple(Lighting(light) for light in LIGHTS)
SKIES = tuple(Lighting(environment=EnvironmentMap(panorama(seed, SIZE), 0.4 + seed)) for seed in range(3))


def loaded_with(lighting: Lighting, scene: dict) -> dict:
    """The description of a scene with this light and no other."""
    import mitsuba as mi

    dark = {name: dict(part) if isinstance(part, dict) else part for name, part in scene.items()}
    for name, part in scene.items():
        if isinstance(part, dict):
            dark[name].pop("emitter", None)
            if part.get("type") in ("envmap", "constant", "point"):
                del dark[name]
    if lighting.area is not None:
        dark["light"] = {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f(lighting.area.to_world),
            "bsdf": {"type": "diffuse", "reflectance": 0.0},
            "emitter": area(*lighting.area.radiance),
        }
    elif lighting.environment is not None:
        turn = mi.ScalarTransform4f().rotate([0, 0, 1], np.degrees(lighting.environment.rotation))
        dark["sky"] = {
            "type": "envmap",
            "bitmap": mi.Bitmap(for_envmap(lighting.environment.panorama.pixels)),
            "to_world": turn @ mi.ScalarTransform4f().rotate([1, 0, 0], 90),
        }
    return dark


def image(scene, seed=0, camera=CAMERA, spp=256, side=24, **options):
    return render_frame(scene, camera, resolution=(side, side), spp=spp, seed=seed, **options).arrays


def assert_same(one, other):
    """Two images of independent samples: each pixel, and far sharper the mean of the frame."""
    spread = np.sqrt(one["color_se"] ** 2 + other["color_se"] ** 2)
    difference = one["color"] - other["color"]
    assert np.mean(np.abs(difference) > 5 * np.maximum(spread, 1e-6)) < 2e-3
    for part in ("emission", "color"):
        whole = (one[part] - other[part]).mean() / (np.sqrt((spread**2).sum()) / spread.size)
        assert abs(whole) < 4, part


@contextmanager
def kernels_compiled():
    """Appends how many kernels were compiled inside."""
    import drjit as dr

    history, found = dr.flag(dr.JitFlag.KernelHistory), []
    dr.set_flag(dr.JitFlag.KernelHistory, True)
    dr.kernel_history_clear()
    try:
        yield found
        dr.sync_thread()
        kernels = [k for k in dr.kernel_history() if k["type"] == dr.KernelType.JIT]
        found.append(sum(not k["cache_hit"] for k in kernels))
    finally:
        dr.set_flag(dr.JitFlag.KernelHistory, history)


@pytest.mark.parametrize("lighting", [*AREA, SKIES[0]], ids=lambda value: value.kind)
def test_the_image_is_that_of_a_scene_loaded_with_the_light(lighting):
    rig = LightRig(load_dict(box("coat")))
    rig.set(AREA[1])
    rig.set(lighting)
    assert_same(image(rig.scene), image(load_dict(loaded_with(lighting, box("coat"))), seed=1))


def test_the_scenes_own_light_is_given_back():
    import mitsuba as mi

    own = box("coat")
    own["bulb"] = {"type": "point", "position": [0.5, 0, 1.5], "intensity": rgb(0.3)}
    own["screen"] = rectangle(
        [-0.9, 0, 1.2],
        [1, 0, 0],
        (0.2, 0.2),
        bsdf=MATERIALS["diffuse"],  # without one, Mitsuba makes what shines black and all else grey
        emitter={
            "type": "area",
            "radiance": {
                "type": "bitmap",
                "bitmap": mi.Bitmap(np.full((2, 2, 3), 3.0, np.float32)),
                "raw": True,
            },
        },
    )
    own["sky"] = {"type": "constant", "radiance": rgb(0.4, 0.5, 0.6)}
    plain = load_dict(own)
    rig = LightRig(load_dict(own))
    before = image(rig.scene, spp=1024)
    assert_same(before, image(plain, seed=1, spp=1024))
    for other in (AREA[0], SKIES[0]):
        rig.set(other)
        loaded = load_dict(loaded_with(other, own))
        assert_same(image(rig.scene, spp=1024), image(loaded, seed=1, spp=1024))
    rig.set(Lighting())
    for name, value in image(rig.scene, spp=1024).items():
        np.testing.assert_array_equal(value, before[name], err_msg=name)


@pytest.mark.parametrize("sky", [False, True], ids=["lamps", "lamps and sky"])
def test_after_every_change_of_kind_frames_are_those_of_a_new_recording(sky):
    # Nothing is loaded in between: that would have everything recorded anew.
    own = {**box("coat"), "bulb": {"type": "point", "position": [0.5, 0, 1.5], "intensity": rgb(0.3)}}
    if sky:
        own["sky"] = {"type": "constant", "radiance": rgb(0.4, 0.5, 0.6)}
    rig = LightRig(load_dict(own))
    order = [{"own": Lighting(), "area": AREA[0], "sky": SKIES[0]}[kind] for kind in _EVERY_CHANGE]

    def frame(scene):
        return image(scene, side=16, spp=16)

    replayed = []
    for lighting in order:
        rig.set(lighting)
        replayed.append(frame(rig.scene))
    for lighting, seen in zip(order, replayed, strict=True):
        rig.set(lighting)
        for name, value in frame(replace(rig.scene)).items():
            np.testing.assert_array_equal(seen[name], value, err_msg=name)


_EVERY_CHANGE = ("own", "area", "sky", "own", "sky", "area", "own")


def test_moves_and_swaps_compile_no_kernel_and_record_each_kind_once():
    gc.collect()  # scenes of other tests that die in between change what kernels call
    rig = LightRig(load_dict(box("metal")))

    def frame():
        return image(rig.scene, side=16, spp=16, channels=("color", "light_direction"))["color"].mean()

    rng = np.random.default_rng(0)

    def moved(number):
        if number % 3 == 2:
            return Lighting(environment=EnvironmentMap(panorama(number, SIZE), rng.uniform(0, 6)))
        centre, radiance = rng.uniform((-0.8, -0.8, 0.2), (0.8, 0.8, 1.8)), rng.uniform(1, 9, 3)
        return Lighting(AreaLight(centre, rng.normal(size=3), *rng.uniform(0.1, 0.4, 2), radiance))

    with kernels_compiled():  # recordings are told apart by such settings too
        for number in (1, 2):
            rig.set(moved(number))
            frame()
    with kernels_compiled() as compiled:
        seen = []
        for number in range(51):
            rig.set(moved(number))
            seen.append(frame())
        assert [kernel.recordings for kernel in rig.scene.replays.values()] == [2, 2]
        rig.set(Lighting())
        frame()
    assert compiled == [0]
    assert [kernel.recordings for kernel in rig.scene.replays.values()] == [3, 3]
    assert len(set(seen)) == 51


def test_light_samples_follow_the_light():
    import drjit as dr
    import mitsuba as mi

    rig = LightRig(load_dict({**box("coat"), "sky": {"type": "constant"}}))
    at = dr.zeros(mi.Interaction3f, 1 << 12)
    at.p = mi.Point3f(0.1, -0.2, 0.9)
    u = mi.Point2f(np.random.default_rng(0).random((2, 1 << 12), dtype=np.float32))

    def sampled():
        sample, _ = rig.scene.mi_scene.sample_emitter_direction(at, u, False)
        return np.array(sample.p).T, np.array(sample.pdf)

    for lighting in AREA[:2]:
        rig.set(lighting)
        points, densities = sampled()
        light = lighting.area
        local = (points - light.centre) @ light.axes.T
        assert (np.abs(local) <= [light.width / 2 + 1e-5, light.height / 2 + 1e-5, 1e-5]).all()
        to = points - [0.1, -0.2, 0.9]
        cosine = np.abs(to @ np.array(light.direction)) / np.linalg.norm(to, axis=1)
        np.testing.assert_allclose(densities, (to**2).sum(1) / cosine / light.area, rtol=1e-4)
    rig.set(SKIES[0])
    points, _ = sampled()
    assert (np.linalg.norm(points, axis=1) > 2).all()


def test_portals_are_used_where_the_sky_is_bright_and_only_there():
    scene = replace(load_dict(room()), openings=OPENINGS_OF_ROOM)
    rig = LightRig(scene)
    shares = []
    for lighting in (Lighting(), AREA[0], SKIES[0], AREA[1]):
        rig.set(lighting)
        shares.append(float(np.array(rig.scene.portals.fraction)[0]))
    assert shares == [0.5, 0, 0.5, 0]
    rig.set(SKIES[1])
    with_portals = image(rig.scene, camera=INSIDE, spp=1024)
    assert_same(
        with_portals, image(load_dict(loaded_with(SKIES[1], room())), camera=INSIDE, spp=1024, seed=1)
    )
    without = LightRig(
        replace(load_dict(room(environment=False)), openings=OPENINGS_OF_ROOM), panoramas=False
    )
    without.set(AREA[0])
    assert float(np.array(without.scene.portals.fraction)[0]) == 0


def test_the_ids_of_all_else_stay_and_the_light_has_the_last():
    scene = load_dict(box("coat"))
    shapes, materials, seen = (
        scene.shapes,
        scene.materials,
        image(scene, channels=("shape_id", "material_id"), spp=None),
    )
    rig = LightRig(scene)
    assert rig.scene.shapes == (*shapes, "area_light")
    assert rig.scene.materials == (*materials, "area_light_material")
    for name, ids in image(rig.scene, channels=("shape_id", "material_id"), spp=None).items():
        np.testing.assert_array_equal(ids, seen[name])
    rig.set(Lighting(replace(LIGHTS[0], centre=(0, -0.5, 1.0), direction=(0, -1, 0))))
    assert (image(rig.scene, channels=("shape_id",), spp=None)["shape_id"] == len(shapes) + 1).any()


def test_a_name_that_is_taken_is_not_taken_twice():
    scene = load_dict({**box("coat"), "area_light": rectangle([0, 0, 0.5], [0, 0, 1], (0.1, 0.1))})
    rig = LightRig(scene)
    assert rig.scene.shapes[-1] == "area_light."
    assert sorted(rig.scene.shapes)[:2] == ["area_light", "area_light."]


def test_the_light_is_black_from_behind_and_hides_what_is_behind_it():
    rig = LightRig(load_dict(box("diffuse")), panoramas=False)
    rig.set(Lighting(AreaLight((0, -0.5, 1.0), (0, 1, 0), 0.6, 0.6, (5, 5, 5))))
    middle = image(rig.scene, spp=16)["color"][11:13, 11:13]
    assert not middle.any()
    rig.set(Lighting(AreaLight((0, -0.5, 1.0), (0, -1, 0), 0.6, 0.6, (5, 5, 5))))
    np.testing.assert_allclose(image(rig.scene, spp=16)["emission"][11:13, 11:13], 5)


def test_a_dark_scene_is_black_and_may_be_lit():
    dark = {name: part for name, part in box("diffuse").items() if name != "lamp"}
    rig = LightRig(load_dict(dark))
    assert not image(rig.scene, spp=16)["color"].any()
    rig.set(AREA[0])
    assert image(rig.scene, spp=16)["color"].any()
    rig.set(Lighting())
    assert not image(rig.scene, spp=16)["color"].any()


@pytest.mark.parametrize("before", [None, SKIES[0], AREA[0]], ids=lambda value: value and value.kind)
def test_a_black_environment_is_black_and_leaves_others_as_they_were(before):
    gc.collect()
    rig = LightRig(load_dict(box("coat")))
    black = Lighting(environment=EnvironmentMap(Panorama.of("night", np.zeros((SIZE[1], SIZE[0], 3)))))
    if before is not None:
        rig.set(before)
    with kernels_compiled():  # recordings are told apart by such settings too
        rig.set(black)
        found = image(rig.scene, spp=16)
    assert not any(found[name].any() for name in ("color", "emission", "color_se"))
    with kernels_compiled() as compiled:
        rig.set(SKIES[1])
        after = image(rig.scene, spp=16)
    assert compiled == [0]
    assert {kernel.recordings for kernel in rig.scene.replays.values()} == {1}
    fresh = LightRig(load_dict(box("coat")))
    fresh.set(SKIES[1])
    np.testing.assert_array_equal(after["color"], image(fresh.scene, spp=16)["color"])


def test_what_a_rig_cannot_do_is_said_in_one_line():
    plain = LightRig(load_dict(box("coat")), panoramas=False)
    with pytest.raises(LightingError, match="made without panoramas"):
        plain.set(SKIES[0])
    assert plain.lighting == Lighting()
    sunny = {**box("coat"), "sky": {"type": "sunsky", "sun_direction": [0, -1, 1], "turbidity": 3.0}}
    with pytest.raises(LightingError, match=r"(?i)sunsky.*does not give back"):
        LightRig(load_dict(sunny))
    rig = LightRig(load_dict(sunny), panoramas=False)
    rig.set(AREA[0])
    assert_same(image(rig.scene), image(load_dict(loaded_with(AREA[0], box("coat"))), seed=1))


@pytest.mark.parametrize("camera", [PinholeCamera((0, -3, 30), (0, 0, 0), 0.2)])
def test_the_hidden_light_is_not_seen(camera):
    rig = LightRig(load_dict(box("diffuse")))
    rig.set(AREA[0])
    rig.set(SKIES[0])
    ids = image(rig.scene, camera=camera, side=256, channels=("shape_id",), spp=None)["shape_id"]
    assert (ids != len(rig.scene.shapes)).all()
