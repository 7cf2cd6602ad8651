"""A room of mirrors and metal alone, no diffuse surface: frames of all methods, and what networks learn there."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
import torch

from gibench.baselines.bilateral_network import METHOD as BILATERAL
from gibench.baselines.bilateral_network.implementation import BilateralConvolutions
from gibench.baselines.compositional_scene_representations import training as representing
from gibench.baselines.linearly_transformed_cosines import METHOD as DIRECT
from gibench.baselines.linearly_transformed_cosines.implementation import AnalyticLight
from gibench.baselines.method import View
from gibench.baselines.moving_light.measure import CODE, Measure, per_flux
from gibench.baselines.neural_global_illumination import SURFACE
from gibench.baselines.neural_global_illumination.inputs import assembled
from gibench.baselines.radiance_regression import training as regressing
from gibench.baselines.stages import Stages
from gibench.baselines.training.artifacts import RECORD, WEIGHTS
from gibench.baselines.training.budget import Budget
from gibench.baselines.training.files import write_tensors
from gibench.baselines.training.loop import train
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import CUES
from gibench.rendering.light_rig import LightRig
from gibench.rendering.lighting import AreaLight, Lighting, Shot
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.compositional_scene_representations import test_implementation as cnnr
from tests.baselines.light_propagation_volumes import test_implementation as lpv
from tests.baselines.neural_global_illumination import test_implementation as ngi
from tests.baselines.radiance_regression import test_implementation as rrf
from tests.baselines.sites import site
from tests.rendering import scenes

RESOLUTION = (24, 20)
CAMERA = PinholeCamera((-0.7, -0.8, 1.2), (0.3, 0.9, 0.4), np.radians(75.0))
LIGHT = AreaLight((0.0, 0.0, 1.8), (0, 0.1, -1), 0.4, 0.4, (5, 4, 3))


def metal(alpha):
    return scenes.two_sided(type="roughconductor", material="Al", alpha=alpha, distribution="ggx")


@pytest.fixture(scope="module")
def rig():
    """Mirrors to the left, to the right and above, metal of roughness 0.005 before and behind, of 1 below."""
    mirror = scenes.MATERIALS["mirror"]
    walls = {
        "floor": ([0, 0, 0], [0, 0, 1], metal(1.0)),
        "ceiling": ([0, 0, 2], [0, 0, -1], mirror),
        "left": ([-1, 0, 1], [1, 0, 0], mirror),
        "right": ([1, 0, 1], [-1, 0, 0], mirror),
        "front": ([0, -1, 1], [0, 1, 0], metal(0.005)),
        "back": ([0, 1, 1], [0, -1, 0], metal(0.005)),
    }
    parts = {name: scenes.rectangle(c, n, (1, 1), bsdf=bsdf) for name, (c, n, bsdf) in walls.items()}
    return LightRig(load_dict({"type": "scene", **parts}), panoramas=False)


def of_direct(rig, folder):
    running = AnalyticLight(DIRECT.settings({"rays": 1}))
    running.prepare(site(rig.scene, folder))
    return running


def of_bilateral(rig, folder):
    """`bcn` that has learned nothing."""
    settings = BILATERAL.settings({"width": 0.125, "spp": 4, "denoise": False})
    torch.manual_seed(0)
    network = BilateralConvolutions(settings).network()
    kept = {"weights": {"network": network.state_dict()}, "facts": {"in_view": 0.1}}
    write_tensors(folder / WEIGHTS, kept)
    (folder / RECORD).write_text("{}")
    running = BilateralConvolutions(settings)
    running.prepare(dataclasses.replace(site(rig.scene, folder), weights=folder, rig=rig))
    return running


MADE = {
    "ltc-direct": of_direct,
    "lpv": lpv.prepared,
    "ngi": lambda rig, folder: ngi.prepared(rig, ngi.untrained(folder), folder),
    "rrf": lambda rig, folder: rrf.prepared(rig, rrf.untrained(folder), folder),
    "cnnr": cnnr.untrained,
    "bcn": of_bilateral,
}


@pytest.mark.parametrize("name", MADE)
def test_frames_are_finite(rig, name, tmp_path):
    method = MADE[name](rig, tmp_path)
    for light in (LIGHT, dataclasses.replace(LIGHT, centre=(0.0, 0.95, 1.0), width=3.0, height=3.0)):
        rig.set(Lighting(area=light))
        found = method.render(View(Shot(CAMERA, Lighting(area=light)), None, RESOLUTION, 0, 0), Stages())
        for image in (found.color, found.indirect):
            assert np.isfinite(image).all()
            assert (image >= 0).all()
        assert found.color.any()
        # Without a diffuse surface there is no virtual light.
        assert found.indirect.any() == (name not in ("ltc-direct", "lpv"))


@pytest.fixture(scope="module")
def images(rig):
    """A training frame of the room, as tensors."""
    rig.set(Lighting(area=LIGHT))
    names = (
        *("direct_diffuse", "direct_specular", "indirect_diffuse", "indirect_specular", "distance"),
        *(*SURFACE, *CUES),
    )
    found = render_frame(rig.scene, CAMERA, resolution=RESOLUTION, channels=names, spp=16).arrays
    return {
        name: torch.from_numpy(np.ascontiguousarray(image)).movedim(-1, 0) for name, image in found.items()
    }


def test_inputs_and_truth_are_finite(images):
    assert not images["albedo"].any()
    indirect = images["indirect_diffuse"] + images["indirect_specular"]
    measure = Measure.of_frames([CAMERA.position, LIGHT.centre], [(images, LIGHT)])
    assert measure.indirect > 0
    assert CODE.encode(per_flux(indirect, LIGHT) / measure.indirect).isfinite().all()
    assert assembled(images, CAMERA, LIGHT, measure, "all").isfinite().all()
    assert representing.described(images, CAMERA, measure).isfinite().all()


def test_networks_of_parts_learn_there(images):
    measure = Measure.of_frames([CAMERA.position, LIGHT.centre], [(images, LIGHT)])
    place, rest = regressing.described(images, CAMERA, LIGHT, measure, True)
    indirect = images["indirect_diffuse"] + images["indirect_specular"]
    code = CODE.encode(per_flux(indirect, LIGHT) / measure.indirect)
    points = regressing.Points(*(part.flatten(1).T.contiguous() for part in (place, rest, code)))
    partition = regressing.room_of(points, 4)
    learner = regressing.Regressing(points, partition, [points], seed=0, seconds=1.0)
    trained = train(learner, learner.batches, Budget(steps=30, look_every=30), seed=0)
    assert trained.best.error < trained.curve[0].error
