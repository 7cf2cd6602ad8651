"""What the coarse pass of light field probes saves, and what their glossy rays cost."""

from __future__ import annotations

import time

import numpy as np
import pytest

from gibench.generators.rooms import sample_room
from gibench.generators.scene_files import write_room
from gibench.rendering.backend import select_variant
from gibench.rendering.scene import load_scene

pytestmark = pytest.mark.performance

RAYS = 200_000
REPEATS = 5


def test_marching_with_against_without_the_coarse_pass(tmp_path):
    select_variant("auto")
    import drjit as dr
    import mitsuba as mi

    from gibench.baselines.light_field_probes.marching import LightField
    from gibench.baselines.probes.baking import ProbeSettings
    from gibench.baselines.probes.maps import load_probes
    from tests.baselines.meshes import directions
    from tests.baselines.probes.test_mappings import vectors
    from tests.baselines.sites import site

    write_room(sample_room(0, 0, kind="living"), tmp_path, max_depth=9, resolution=(64, 48), spp=1)
    scene = load_scene(tmp_path / "scene.xml")
    settings = ProbeSettings(32, 368, 368, 1, mapping="octahedral")
    probes = load_probes(site(scene, tmp_path), settings, ("distance", "normal"))
    field = LightField(probes)

    # From points that the probes see, as a method's rays begin on surfaces.
    rng = np.random.default_rng(0)
    probe = mi.UInt32(rng.integers(0, probes.count, RAYS).astype(np.uint32))
    towards = vectors(directions(RAYS, 1))
    first = scene.mi_scene.ray_intersect(mi.Ray3f(mi.Point3f(probes.position(probe)), towards))
    leaving = vectors(directions(RAYS, 2))
    leaving = dr.mulsign(leaving, dr.dot(leaving, first.n) * dr.dot(-first.n, towards))
    point = mi.Point3f(first.p)
    dr.eval(point, leaving)

    seconds, texels = {}, {}
    for _ in range(REPEATS + 1):  # the first compiles
        for coarse in (False, True):
            dr.sync_thread()
            start = time.perf_counter()
            found = field.trace(point, leaving, mi.Float(1), mi.Bool(True), mi.Bool(coarse))
            dr.eval(found)
            dr.sync_thread()
            seconds.setdefault(coarse, []).append(time.perf_counter() - start)
            texels[coarse] = np.array(found[3]).mean()
    fine, quick = (np.median(seconds[coarse][1:]) for coarse in (False, True))
    print(
        f"\n{probes.count} probes of 368²: a ray looks at {texels[True]:.0f} texels with the coarse pass, "
        f"{texels[False]:.0f} without; {fine / quick:.1f} times as fast ({RAYS / quick / 1e6:.2f} M rays/s)"
    )
    assert texels[True] < texels[False]
