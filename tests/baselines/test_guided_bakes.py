"""Lightmap texels and probe texels have the same means under a guide as without, over 64 independent repeats.

Of 256 paths each: with 16 most repeats miss what is rare and bright, more of them without a guide, and scores of single
texels lean to one side.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from gibench.rendering.scene import GUIDED, load_dict
from tests.baselines.meshes import room, slab
from tests.rendering import scenes

LEARNING = "gibench.rendering.guiding.learning"

REPEATS = 64

MAX_DEPTH = 5


@pytest.fixture(scope="module")
def pair():
    """A room of coated walls whose lamp hangs over a baffle, plain and guided by few paths."""
    description = {
        "type": "scene",
        **room(scenes.MATERIALS["coat"]),
        "baffle": slab([-0.3, -0.3, 0.4], [0.3, 0.3, 0.45], scenes.MATERIALS["metal"]),
        "lamp": {
            "type": "sphere",
            "center": [0.0, 0.0, 0.6],
            "radius": 0.14,
            "bsdf": {"type": "diffuse"},
            "emitter": scenes.area(8, 7, 6),
        },
    }
    plain = load_dict(description)
    guided = replace(plain, sampling=GUIDED)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LEARNING + ".LANES", 1 << 14)
        patch.setattr(LEARNING + ".LOOKS", 1 << 16)
        patch.setattr(LEARNING + ".DIRECTIONS_PAY", -1.0)
        assert guided.guide is not None
    return plain, guided


def assert_alike(one, other):
    """Two sets of REPEATS values, (REPEATS, N): differences of their means are as large as their spread says."""
    error = np.sqrt((one.var(axis=0, ddof=1) + other.var(axis=0, ddof=1)) / REPEATS)
    difference = one.mean(axis=0) - other.mean(axis=0)
    assert (difference[error == 0] == 0).all()
    assert (error > 0).sum() >= 64  # texels outside of the room are black
    z = difference[error > 0] / error[error > 0]
    assert abs(z.mean()) < 4 / np.sqrt(len(z))
    assert abs(z.std() - 1) < 0.05 + 4 / np.sqrt(2 * len(z))
    assert np.abs(z).max() < 6
    # Whole maps are the sharper test.
    whole, against = one.mean(axis=1), other.mean(axis=1)
    spread = np.sqrt((whole.var(ddof=1) + against.var(ddof=1)) / REPEATS)
    assert abs(whole.mean() - against.mean()) < 4 * spread


def test_lightmap_texels(pair):
    from gibench.baselines.lightmap.coverage import cover
    from gibench.baselines.lightmap.texel_paths import TexelPoints, trace_texels
    from gibench.baselines.lightmap.unwrapping import unwrap

    def repeats(scene, seed):
        unwrapping = unwrap(scene, 4.0)
        coverage = cover(unwrapping, 2)
        # Every texel REPEATS times: each has paths of its own.
        points = len(coverage.faces)
        first = np.concatenate(
            [coverage.first[:-1] + k * points for k in range(REPEATS)] + [[REPEATS * points]]
        )
        tiled = replace(
            coverage,
            faces=np.tile(coverage.faces, REPEATS),
            barycentrics=np.tile(coverage.barycentrics, (REPEATS, 1)),
        )
        texels = TexelPoints(scene, unwrapping, tiled)
        values, known = trace_texels(texels, first, spp=256, max_depth=MAX_DEPTH, seed=seed)
        assert known.any()
        return values.astype(float).mean(axis=1).reshape(REPEATS, -1)

    assert_alike(repeats(pair[0], 1), repeats(pair[1], 2))


@pytest.mark.parametrize("what", ["light", "radiance"])
def test_probe_texels(pair, what):
    from gibench.baselines.probes.baking import ProbeSettings, _Baker

    settings = ProbeSettings(count=2, width=8, height=4, spp=256)
    positions = np.tile(np.array([[0.5, -0.4, 0.0], [-0.3, 0.6, 0.7]], dtype=np.float32), (REPEATS, 1))

    def repeats(scene):
        baker = _Baker(scene, positions, settings, max_depth=MAX_DEPTH)
        maps = {what: np.zeros((len(positions), settings.height, settings.width, 3), dtype=np.float32)}
        baker.run(getattr(baker, what), settings.spp, maps)
        return maps[what].astype(float).mean(axis=-1).reshape(REPEATS, -1)

    # The guide draws more random numbers a vertex, so that the same seed gives other paths.
    assert_alike(repeats(pair[0]), repeats(pair[1]))
