"""How far references are from the truth, whether the floor says so, and what scoring against them did to methods.

Two renderings of many more samples stand for the truth and share nothing with the references: errors against it have no
bias (`gibench.metrics.unbiased`), whoever computes them. Rooms of the preset `cpu`, and scene files that are at hand.
The figures of docs/benchmark.md are with GIBENCH_TRUTH_ROOMS=0,1,2,3,4, GIBENCH_TRUTH_RESOLUTION=128,72 and
GIBENCH_TRUTH_SPP=2048.
"""

from __future__ import annotations

import os
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from gibench import metrics
from gibench.rendering.backend import select_variant
from gibench.rendering.channels import PARTS
from gibench.rendering.denoise import balanced, denoise, denoise_part
from gibench.rendering.estimate import estimate_radiance, frame_of
from gibench.rendering.scene import PLAIN

pytestmark = pytest.mark.performance

ROOMS = tuple(map(int, os.environ.get("GIBENCH_TRUTH_ROOMS", "0,1,2,3").split(",")))
SCENES = Path(os.environ.get("GIBENCH_EXTERNAL", "../shared")) / "scenes"
RESOLUTION = tuple(map(int, os.environ.get("GIBENCH_TRUTH_RESOLUTION", "160,90").split(",")))
TRUTH_SPP = int(os.environ.get("GIBENCH_TRUTH_SPP", "4096"))
"""Of each of the two renderings of the truth."""

SPP = 256
METHODS = (8, 32)
"""Samples a pixel of path tracing that is denoised as a whole."""

STEP = 8
"""Of the path whose frame is rendered."""

NAMES = ("relmse", "rmse_display")

LEAST_ALBEDO = 0.02

BLEND = 0.05
"""Share of the samples in a reference that is blended with them."""


def frames():
    """Name, recipe, number of the room and of the view."""
    from gibench.benchmarks.track import load_track

    preset = load_track("walkthrough").preset("cpu")
    size = {"resolution": RESOLUTION}
    recipe = preset.recipe("reference", max(ROOMS) + 1).model_copy(update=size)
    for room in ROOMS:
        yield f"room {room}", recipe, room, recipe.views + STEP
    for file in sorted(SCENES.glob("*/scene.xml")):
        scene = preset.recipe("reference", 1, {"scenes": [str(file)], "allow_missing": True})
        yield file.parent.name, scene.model_copy(update=size), 0, 0


class Rendered:
    """Means over the samples of a pixel: parts and guides, (H, W, 3)."""

    def __init__(self, loaded, camera, spp, seed, *, sampling=None):
        """sampling: that of the recipe where it is None."""
        depth = loaded.recipe.max_depth
        scene = loaded.scene if sampling is None else replace(loaded.scene, sampling=sampling)
        found = estimate_radiance(scene, camera, RESOLUTION, spp=spp, seed=seed, max_depth=depth, guides=True)
        self.parts = {name: frame_of(found.part(name), RESOLUTION) for name in PARTS}
        self.guides = {name: frame_of(found.part(name), RESOLUTION) for name in ("albedo", "normal")}

    @property
    def color(self):
        return sum(self.parts.values())

    def mixed(self, other):
        """The mean of two renderings of as many samples."""
        both = object.__new__(Rendered)
        both.parts = {name: 0.5 * (image + other.parts[name]) for name, image in self.parts.items()}
        both.guides = {name: 0.5 * (image + other.guides[name]) for name, image in self.guides.items()}
        return both

    @property
    def demodulated(self):
        """As `denoised`, but diffuse parts are divided by the albedo for it, where that is not next to black."""
        albedo = np.where(self.guides["albedo"] > LEAST_ALBEDO, self.guides["albedo"], 1).astype(np.float32)
        total = self.parts["emission"].copy()
        for name, image in self.parts.items():
            if name.endswith("diffuse"):
                total += balanced(denoise(image / albedo, **self.guides) * albedo, image)
            elif name != "emission":
                total += denoise_part(image, **self.guides)
        return total

    @property
    def denoised(self):
        clean = [
            denoise_part(image, **self.guides) for name, image in self.parts.items() if name != "emission"
        ]
        return self.parts["emission"] + sum(clean)


def measured(loaded, camera):
    """Mean squares of one frame, by metric and what they are of."""
    halves = [Rendered(loaded, camera, SPP, 1000 + which) for which in (0, 1)]
    clean = tuple(half.denoised for half in halves)
    reference = 0.5 * (clean[0] + clean[1])
    exposure = float(metrics.reference_exposure(reference))
    board = metrics.Truth(tuple(half.color for half in halves), clean, exposure)
    samples = tuple(Rendered(loaded, camera, TRUTH_SPP, 5000 + which).color for which in (0, 1))
    truth = metrics.Truth(samples, clean, exposure)
    rows = {}
    for name in NAMES:
        rows[name, "reference"] = truth.error(name, reference).mean_square
        rows[name, "floor"] = board.error_of_reference(name).mean_square
        half = metrics.evaluate(clean[0], reference, metrics=[name], exposure=exposure)[name]
        rows[name, "halves"] = half**2 if name == "rmse_display" else half
    whole = halves[0].mixed(halves[1])
    others = {
        "denoised together": whole.denoised,
        "demodulated together": whole.demodulated,
        "blended": (1 - BLEND) * reference + np.float32(BLEND) * whole.color,
    }
    for name in NAMES:
        rows |= {(name, of): truth.error(name, image).mean_square for of, image in others.items()}
    for spp in METHODS:
        # As methods trace: what a room has shown is prepared by no method.
        traced = Rendered(loaded, camera, spp, 77 + spp, sampling=PLAIN)
        image = denoise(traced.color, **traced.guides)
        for name in NAMES:
            rows[name, spp, "true"] = truth.error(name, image).mean_square
            rows[name, spp, "board"] = board.error(name, image).mean_square
            against = metrics.evaluate(image, reference, metrics=[name], exposure=exposure)[name]
            rows[name, spp, "reference"] = against**2 if name == "rmse_display" else against
    return rows


def test_references_against_the_truth(tmp_path):
    from gibench.datasets.room_making import LoadedRoom, sampled_room, written_room
    from gibench.generators.shots import shot_of

    select_variant("auto")
    found = {}
    for name, recipe, room, view in frames():
        built = sampled_room(recipe, room)
        folder = tmp_path / name.replace(" ", "-")
        written_room(built, folder, recipe)
        found[name] = measured(LoadedRoom.of(recipe, built, folder), shot_of(built, view).camera)
        told(name, found[name])
    mean = {key: float(np.mean([rows[key] for rows in found.values()])) for key in next(iter(found.values()))}
    told(f"mean of {len(found)} frames", mean)
    for name in NAMES:
        # The bounds of a board, which has some ninety frames of six times as many pixels, with the noise of these few.
        assert 0.5 < mean[name, "floor"] / mean[name, "reference"] < 2
        for spp in METHODS:
            assert abs(mean[name, spp, "board"] / mean[name, spp, "true"] - 1) < 0.15


def told(name, rows):
    print(f"\n{name}:")
    for metric in NAMES:
        true = rows[metric, "reference"]
        print(
            f"  {metric}: reference {true:.3g}, floor {rows[metric, 'floor'] / true:.2f} of it, difference of halves "
            f"{rows[metric, 'halves'] / true:.2f}"
        )
        of_it = (
            f"{of} {rows[metric, of] / true:.2f}"
            for of in ("denoised together", "demodulated together", "blended")
        )
        print(f"    made in other ways, of the reference's: {', '.join(of_it)}")
        for spp in METHODS:
            error = rows[metric, spp, "true"]
            board, against = (rows[metric, spp, of] / error - 1 for of in ("board", "reference"))
            print(
                f"    denoised path tracing, {spp} samples: {error:.3g}; the board says {board:+.1%}, the reference "
                f"{against:+.1%}; the reference's own error is {true / error:.2f} of it"
            )
