"""What `sh-prt` costs: a bake against rendering every harmonic, a frame against path tracing."""

from __future__ import annotations

from functools import partial

import numpy as np
import pytest

from gibench.baselines.method import View
from gibench.baselines.path_traced import METHOD as PATH_TRACED
from gibench.baselines.precomputed_radiance_transfer import transfer
from gibench.baselines.precomputed_radiance_transfer.implementation import seen_box
from gibench.baselines.precomputed_radiance_transfer.vertices import sides_of
from gibench.baselines.stages import Stages
from gibench.baselines.vertex_features.remeshing import even_mesh, meshes_of
from gibench.rendering.backend import select_variant
from gibench.rendering.lighting import Shot
from gibench.rendering.panoramas import HEIGHT
from tests.baselines.precomputed_radiance_transfer.test_implementation import (
    CAMERA,
    corner,
    panorama,
    prepared,
)
from tests.performance.turns import seconds

pytestmark = pytest.mark.performance

SIGNED = 2 * 81
"""Environments that Sloan et al. render."""


@pytest.fixture(scope="module")
def where(tmp_path_factory):
    select_variant("auto")
    return corner(tmp_path_factory.mktemp("corner"))


def test_all_harmonics_at_once(where):
    method = prepared(where, paths=64)
    mesh = even_mesh(meshes_of(where.folder), seen_box(where, method._surfaces), 0.1)
    tracer = transfer._Tracer(where.scene, sides_of(mesh), 0.1, where.max_depth)
    some = np.arange(256)
    once, paths = seconds(
        partial(tracer.matrices, some, 1024, 8),
        partial(tracer._paths, some, 64, 1024, where.max_depth),
        repeats=3,
    )
    print(
        f"\n256 matrices of 81 × 81 from 1024 paths each: {1e3 * once:.0f} ms, {once / paths:.1f} times the paths; "
        f"paths for {SIGNED} environments would take {SIGNED * paths / once:.0f} times as long"
    )
    assert once < SIGNED * paths


def test_a_frame(where):
    method = prepared(where, paths=64, reflected=8, spp=16)
    paths = PATH_TRACED.load()(PATH_TRACED.settings({"spp": 2}))
    paths.prepare(where)
    lighting = panorama(np.random.default_rng(0).uniform(0, 1, (HEIGHT, 2 * HEIGHT, 3)))
    where.rig.set(lighting)
    view = View(Shot(CAMERA, lighting), None, (128, 128), 0, 0)

    def other_light():
        method.adjust(method.settings)  # forgets what arrives at the vertices
        method.render(view, Stages())

    first, again, traced = seconds(
        other_light,
        lambda: method.render(view, Stages()),
        lambda: paths.render(view, Stages()).finish(),
        repeats=5,
    )
    print(
        f"\n128 × 128: {1e3 * again:.0f} ms under light that stays, {1e3 * first:.0f} ms under another, "
        f"{again / traced:.1f} and {first / traced:.1f} times 2 paths a pixel"
    )
