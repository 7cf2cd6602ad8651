"""Radiance cues are direct light on the materials that stand in, and directions lead to the light."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_erosion

from gibench.rendering.estimate import EstimateError
from gibench.rendering.light_rig import LightRig
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering.scenes import CAMERA, MATERIALS, box, rgb, two_sided
from tests.rendering.test_light_rig import AREA, SKIES, image
from tests.rendering.test_portals import CAMERA as INSIDE
from tests.rendering.test_portals import OPENINGS_OF_ROOM, room

BASES = (
    two_sided(type="diffuse", reflectance=rgb(1.0)),
    *(
        two_sided(type="roughconductor", material="none", alpha=alpha, distribution="ggx")
        for alpha in (0.05, 0.13, 0.34)
    ),
)


def replaced(scene: dict, basis: dict) -> dict:
    """The scene with every material that is not diffuse replaced."""
    glossy = ("coat", "textured_coat", "metal", "mirror")

    def of(part):
        if not isinstance(part, dict):
            return part
        if any(part.get("inside") == MATERIALS[name]["inside"] for name in glossy):
            return {**basis, **({"id": part["id"]} if "id" in part else {})}
        return {key: of(value) for key, value in part.items()}

    return {name: of(part) for name, part in scene.items()}


@pytest.mark.parametrize("lighting", [AREA[0], AREA[1], SKIES[0]], ids=["above", "low", "sky"])
def test_cues_are_direct_light_on_the_materials_that_stand_in(lighting):
    rig = LightRig(load_dict(box("coat")))
    rig.set(lighting)
    halves = [image(rig.scene, channels=("lighting",), spp=1024, seed=seed) for seed in (1, 2)]
    for number, basis in enumerate(BASES):
        other = LightRig(load_dict(replaced(box("coat"), basis)))
        other.set(lighting)
        known = image(other.scene, spp=1024, max_depth=1, channels=("radiance",))
        direct = known["direct_diffuse"] + known["direct_specular"]
        cue = np.mean([half[f"radiance_cue_{number}"] for half in halves], axis=0)
        noise = halves[0][f"radiance_cue_{number}"] - halves[1][f"radiance_cue_{number}"]
        spread = np.sqrt(known["color_se"] ** 2 + (noise / 2) ** 2)
        whole = (cue - direct).mean() / (np.sqrt((spread**2).sum()) / spread.size)
        assert abs(whole) < 4, number
        glossy = image(rig.scene, channels=("roughness",), spp=None)["roughness"][..., 0] < 1
        whole = (cue - direct)[glossy].mean() / (np.sqrt((spread[glossy] ** 2).sum()) / spread[glossy].size)
        assert abs(whole) < 4, number


def test_what_is_diffuse_keeps_its_own_material():
    rig = LightRig(load_dict(box("textured")), panoramas=False)
    rig.set(AREA[0])
    found = image(rig.scene, channels=("lighting", "roughness"), spp=64, side=48)
    rough = found["roughness"][..., 0]
    diffuse, glossy = (
        binary_erosion(where, np.ones((3, 3))) for where in (rough == 1, (rough > 0) & (rough < 1))
    )
    assert diffuse.any()
    assert glossy.any()
    for number in (1, 2, 3):
        np.testing.assert_allclose(
            found[f"radiance_cue_{number}"][diffuse], found["radiance_cue_0"][diffuse], rtol=1e-4, atol=1e-6
        )
    assert not np.allclose(found["radiance_cue_1"][glossy], found["radiance_cue_3"][glossy], rtol=0.1)


def test_cues_through_portals_are_the_same_with_less_noise():
    glossy = {**room(), "floor": {**room()["floor"], "bsdf": MATERIALS["metal"]}}
    images = [
        [image(scene, camera=INSIDE, channels=("lighting",), spp=256, seed=seed) for seed in (0, 1)]
        for scene in (load_dict(glossy), replace(load_dict(glossy), openings=OPENINGS_OF_ROOM))
    ]
    for number in range(4):
        name = f"radiance_cue_{number}"
        (a, b), (c, d) = ([frame[name] for frame in pair] for pair in images)
        spread = np.sqrt((((a - b) ** 2 + (c - d) ** 2) / 4).sum()) / a.size
        assert abs((a + b - c - d).mean() / 2) < 4 * spread


def test_directions_lead_to_the_centre_of_the_light_and_follow_it():
    rig = LightRig(load_dict(box("diffuse")))
    for lighting in AREA[:2]:
        rig.set(lighting)
        found = image(rig.scene, channels=("position", "light_direction", "shape_id"), spp=None)
        hit = found["shape_id"][..., 0] > 0
        towards = lighting.area.centre - found["position"].astype(np.float64)
        towards /= np.linalg.norm(towards, axis=-1, keepdims=True)
        np.testing.assert_allclose(found["light_direction"][hit], towards[hit], atol=1e-5)
        assert not found["light_direction"][~hit].any()
    rig.set(SKIES[0])
    assert not image(rig.scene, channels=("light_direction",), spp=None)["light_direction"].any()
    plain = load_dict(box("diffuse"))
    assert not image(plain, channels=("light_direction",), spp=None)["light_direction"].any()


def test_cues_are_denoised_like_radiance_and_nothing_is_left_of_a_miss():
    rig = LightRig(load_dict(box("coat")), panoramas=False)
    rig.set(AREA[0])
    truth = image(rig.scene, channels=("lighting",), spp=1024, side=48)
    noisy, clean = (
        image(rig.scene, channels=("lighting",), spp=4, side=48, denoise=denoise, seed=3)
        for denoise in (False, True)
    )
    errors = [np.mean((found["radiance_cue_0"] - truth["radiance_cue_0"]) ** 2) for found in (noisy, clean)]
    assert errors[1] < 0.7 * errors[0]
    wide = image(
        rig.scene,
        channels=("lighting", "shape_id"),
        spp=4,
        side=48,
        camera=replace(CAMERA, fov=1.6),
        denoise=True,
    )
    missed = binary_erosion(wide["shape_id"][..., 0] == 0, np.ones((9, 9)))
    assert missed.any()
    for number in range(4):
        values = wide[f"radiance_cue_{number}"]
        assert np.isfinite(values).all()
        assert (values >= 0).all()
        assert values[missed].max() < 1e-3 * values.max()


def test_cues_need_samples():
    scene = load_dict(box("coat"))
    with pytest.raises(EstimateError, match="cues need spp"):
        render_frame(scene, CAMERA, resolution=(8, 8), channels=("lighting",), error=0.1)
    with_radiance = render_frame(
        scene, CAMERA, resolution=(8, 8), channels=("radiance_cue_0", "color"), error=0.9, spp_cap=64
    )
    assert with_radiance.arrays["radiance_cue_0"].any()


def test_surfaces_and_cues_stay_on_the_device_inside_a_replay():
    import drjit as dr
    import mitsuba as mi

    from gibench.rendering.gbuffer import surface_arrays
    from gibench.rendering.light_cues import cue_images
    from gibench.rendering.replay import Replay, camera_arrays

    rig = LightRig(load_dict(box("coat")), panoramas=False)
    scene, names = rig.scene, ("position", "albedo", "roughness", "light_direction")

    def inputs(camera, seed, width):
        surfaces = surface_arrays(scene, names, camera, width, 24 * 24)
        cues = cue_images(scene, camera, seed, mi.UInt32(0), width, 24 * 24, 4)
        return surfaces, cues

    replay = Replay(scene, inputs)
    seen = []
    for number, lighting in enumerate((*AREA, AREA[0])):
        rig.set(lighting)
        varying = [dr.opaque(mi.UInt32, n) for n in (7, 24)]
        surfaces, cues = replay(camera_arrays(CAMERA, (24, 24)), *varying)
        known = image(scene, channels=names, spp=None)
        for name in names:
            values = np.array(surfaces[name]).reshape(-1, 24 * 24).T.reshape(known[name].shape)
            np.testing.assert_array_equal(values, known[name], err_msg=f"{name} {number}")
        seen.append(np.array(cues["radiance_cue_1"]))
    assert replay.recordings == 1
    np.testing.assert_array_equal(seen[0], seen[3])
    assert not np.array_equal(seen[0], seen[1])
