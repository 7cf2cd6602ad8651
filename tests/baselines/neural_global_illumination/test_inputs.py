"""Channels of a frame as the network has them, in closed form."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.moving_light.measure import CODE, Measure, per_flux, unit_of
from gibench.baselines.neural_global_illumination.inputs import LIGHTING, assembled
from gibench.baselines.neural_global_illumination.network import INPUTS
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CHANNELS, CUES
from gibench.rendering.lighting import AreaLight

CAMERA = PinholeCamera((0.0, -3.0, 1.0), (0.0, 0.0, 1.0), np.radians(60.0))
AREA = AreaLight((0.0, 0.0, 2.0), (0, 0, -1), 0.5, 0.5, (4.0, 2.0, 0.0))
MEASURE = Measure((0.0, 0.0, 1.0), (2.0, 2.0, 1.0), 0.1, 0.05)
NAMES = (
    *("position", "normal", "albedo", "specular_albedo", "roughness"),
    *("reflected_position", "reflected_normal", "reflected_albedo"),
    *("direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular", *CUES),
)


def frame(height=4, width=5, seed=0):
    generator = torch.Generator().manual_seed(seed)
    images = {n: torch.rand(CHANNELS[n].components, height, width, generator=generator) for n in NAMES}
    for name in ("normal", "reflected_normal"):
        images[name] = images[name] / images[name].norm(dim=0)
    return images


def parts(inputs):
    return dict(zip(INPUTS, inputs[:34].split(list(INPUTS.values())), strict=True))


def test_all_channels_are_where_the_network_has_them():
    images = frame()
    found = parts(assembled(images, CAMERA, AREA, MEASURE, "all"))
    assert torch.equal(found["normal"], images["normal"])
    assert torch.equal(found["diffuse"], images["albedo"])
    assert torch.equal(found["specular"], images["specular_albedo"])
    assert torch.equal(found["roughness"], images["roughness"])
    expected = images["position"] / torch.tensor([2.0, 2.0, 1.0])[:, None, None]
    expected[2] -= 1
    torch.testing.assert_close(found["position"], expected)
    for name, there in (("view", CAMERA.position), ("light_direction", AREA.centre)):
        towards = torch.tensor(there)[:, None, None] - images["position"]
        torch.testing.assert_close(found[name], towards / towards.norm(dim=0))
    direct = images["direct_diffuse"] + images["direct_specular"]
    decoded = CODE.decode(found["direct"]) * MEASURE.direct * unit_of(AREA)
    torch.testing.assert_close(decoded[:2], direct[:2], rtol=1e-4, atol=1e-5)
    assert not decoded[2].any()  # a light without blue


def test_a_brighter_light_is_the_same_light():
    images = frame()
    first = assembled(images, CAMERA, AREA, MEASURE, "all")
    for scale in (1e-4, 1e5):
        brighter = dataclasses.replace(AREA, radiance=tuple(scale * c for c in AREA.radiance))
        lit = {
            n: scale * image if n.startswith(("direct", "radiance")) else image for n, image in images.items()
        }
        torch.testing.assert_close(
            assembled(lit, CAMERA, brighter, MEASURE, "all"), first, rtol=1e-4, atol=1e-5
        )
        indirect = images["indirect_diffuse"]
        torch.testing.assert_close(per_flux(scale * indirect, brighter), per_flux(indirect, AREA))


def test_where_the_light_faces_comes_after_all_else():
    images = frame()
    found = assembled(images, CAMERA, AREA, MEASURE, "facing")
    assert torch.equal(found[:34], assembled(images, CAMERA, AREA, MEASURE, "all"))
    assert found[34:, 2, 3].tolist() == list(AREA.direction)


@pytest.mark.parametrize("lighting", LIGHTING)
def test_what_a_variant_is_not_told(lighting):
    images = frame()
    found, whole = (parts(assembled(images, CAMERA, AREA, MEASURE, told)) for told in (lighting, "all"))
    assert found["cues"].any() == (lighting in ("all", "facing"))
    assert found["direct"].any() == (lighting != "position")
    constant = bool((found["light_direction"] == found["light_direction"][:, :1, :1]).all())
    assert constant == (lighting == "position")
    for name in ("position", "normal", "diffuse", "specular", "roughness", "view"):
        assert torch.equal(found[name], whole[name])


def test_a_perfect_mirror_is_what_it_shows():
    images = frame()
    images["roughness"][:, 0] = 0  # the first row: mirrors, but the second of them is coated paint
    images["albedo"][:, 0] = 0
    images["albedo"][:, 0, 1] = 0.5
    images["reflected_normal"][:, 0, 2] = 0  # shows the sky
    found = parts(assembled(images, CAMERA, AREA, MEASURE, "all"))
    mirror = torch.zeros(4, 5, dtype=torch.bool)
    mirror[0, [0, 3, 4]] = True
    assert torch.equal(found["normal"][:, mirror], images["reflected_normal"][:, mirror])
    assert torch.equal(found["diffuse"][:, mirror], images["reflected_albedo"][:, mirror])
    assert torch.equal(found["normal"][:, ~mirror], images["normal"][:, ~mirror])
    for name, there in (
        ("view", images["position"]),
        ("light_direction", torch.tensor(AREA.centre)[:, None, None]),
    ):
        towards = there - images["reflected_position"]
        expected = towards / towards.norm(dim=0)
        torch.testing.assert_close(found[name][:, mirror], expected[:, mirror])
    assert torch.equal(found["specular"], images["specular_albedo"])  # the mirror's own


def test_a_frame_of_sky_and_one_at_the_light_are_finite():
    images = {name: torch.zeros_like(image) for name, image in frame().items()}
    assert not assembled(images, CAMERA, AREA, MEASURE, "all").any()
    images = frame()
    images["position"][:] = torch.tensor(AREA.centre)[:, None, None]
    images["direct_specular"][:] = 1e30
    found = assembled(images, CAMERA, AREA, MEASURE, "all")
    assert found.isfinite().all()
    assert found.abs().max() <= 2
