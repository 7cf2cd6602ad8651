"""What is seen through glass and holes, against closed forms and against the path tracer."""

import drjit as dr
import mitsuba as mi
import numpy as np
import pytest

from gibench.baselines import image_space_gathering, light_field_probes
from gibench.baselines.stages import Stages
from gibench.baselines.transmission import SURFACES, seen_through, transmits
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.baselines.glossy_rooms import LIGHTMAP
from tests.baselines.meshes import diffuse, room, slab
from tests.baselines.sites import RESOLUTION, lit_box, site, view
from tests.rendering import scenes

ETA = 1.5
REFLECTED = ((ETA - 1) / (ETA + 1)) ** 2
"""By a face of glass, seen along its normal."""

GLASS = {"type": "dielectric", "int_ior": ETA, "ext_ior": 1.0}
PANE = {"type": "thindielectric", "int_ior": ETA, "ext_ior": 1.0}
LAMP = 3.0


class Dark:
    """A lightmap of black surfaces."""

    def diffuse(self, si, preliminary, active):
        return mi.Color3f(0)


def behind(sheets, bsdf, between=None):
    """Of rays along x: what they see of a lamp behind `sheets` rectangles of a material, a metre apart."""
    parts = {
        f"sheet{number}": scenes.rectangle([number, 0, 0], [-1, 0, 0], (1, 1), bsdf=bsdf)
        for number in range(sheets)
    }
    if between is not None:
        parts["between"] = between
    lamp = scenes.rectangle([20, 0, 0], [-1, 0, 0], (1, 1), bsdf=diffuse(0), emitter=scenes.area(LAMP, 1, 0))
    scene = load_dict({"type": "scene", **parts, "lamp": lamp})
    assert transmits(scene.layers)
    ray = mi.Ray3f(mi.Point3f(-1, 0.1, 0.2) + dr.zeros(mi.Point3f, 16), mi.Vector3f(1, 0, 0))
    si = scene.mi_scene.ray_intersect(ray)
    light = seen_through(scene.mi_scene, scene.layers, Dark(), si, si.bsdf(), si.is_valid())
    return np.array(light)[:, 0]


@pytest.mark.parametrize("opacity", [0.0, 0.3, 1.0])
def test_holes_of_masks(opacity):
    mask = {"type": "mask", "opacity": opacity, "inside": diffuse(0.5)}
    for sheets in (1, 3):
        found = behind(sheets, mask)
        np.testing.assert_allclose(found, np.array([LAMP, 1, 0]) * (1 - opacity) ** sheets, rtol=1e-5)


def test_panes_and_blocks_of_glass():
    # A pane's two faces, and the light between them back and forth.
    through = 1 - 2 * REFLECTED / (1 + REFLECTED)
    np.testing.assert_allclose(behind(2, PANE)[0], LAMP * through**2, rtol=1e-4)
    # A way in and a way out; what η² does at the one it undoes at the other.
    np.testing.assert_allclose(
        behind(0, GLASS, slab([0, -1, -1], [0.5, 1, 1], GLASS))[0], LAMP * (1 - REFLECTED) ** 2, rtol=1e-4
    )


def test_rough_glass_is_drawn_sharp():
    rough = {"type": "roughdielectric", "alpha": 0.05, "int_ior": ETA, "ext_ior": 1.0}
    found = behind(0, rough, slab([0, -1, -1], [0.5, 1, 1], rough))[0]
    assert found == pytest.approx(LAMP * (1 - REFLECTED) ** 2, rel=0.02)


def test_blends_let_their_share_through():
    half = {"type": "blendbsdf", "weight": 0.25, "one": PANE, "other": diffuse(0.5)}
    through = 1 - 2 * REFLECTED / (1 + REFLECTED)
    assert behind(1, half)[0] == pytest.approx(0.75 * LAMP * through, rel=1e-4)


def test_rays_end_after_so_many_surfaces():
    hole = {"type": "mask", "opacity": 0.0, "inside": diffuse(0.5)}
    assert behind(SURFACES, hole)[0] == pytest.approx(LAMP)
    assert not behind(SURFACES + 1, hole).any()


def test_nothing_is_seen_through_what_is_solid():
    scene = load_dict({"type": "scene", **room(diffuse(0.5))})
    assert not transmits(scene.layers)


def with_window(window):
    """A room whose walls glow, each in its own colour: paths that go through glass to a small lamp are noise."""
    box = slab([-0.7, -0.7, -1], [-0.2, -0.2, -0.3], diffuse(0.2, 0.5, 0.7))
    parts = {**lit_box(diffuse(0.7, 0.6, 0.5)), "box": box}
    if window is not None:
        parts["window"] = scenes.rectangle([0.4, 0, 0], [1, 0, 0], (1, 1), bsdf=window)
    return load_dict(parts)


@pytest.mark.parametrize(
    ("method", "bound"), [(image_space_gathering.METHOD, 0.01), (light_field_probes.METHOD, 0.05)]
)
def test_a_room_behind_a_window(tmp_path, method, bound):
    """A window of glass, or one full of holes, right across a room: little more is wrong than without it.

    What the glass mirrors is asked of the probes, which know it less well.
    """
    camera = PinholeCamera((0.8, 0.0, 0.0), (-1.0, 0.0, -0.2), 1.0)
    error = {}
    holes = {"type": "mask", "opacity": 0.3, "inside": diffuse(0.2)}
    for name, window in (("none", None), ("pane", PANE), ("holes", holes)):
        scene = with_window(window)
        implementation = method.load()(method.settings(LIGHTMAP | {"rays": 4}))
        implementation.prepare(site(scene, tmp_path / name))
        found = np.asarray(implementation.render(view(camera), Stages()).color)
        truth = render_frame(scene, camera, resolution=RESOLUTION, spp=1024, channels=["color"])
        truth = truth.arrays["color"]
        error[name] = np.abs(found - truth).mean() / truth.mean()
        assert found.mean() == pytest.approx(truth.mean(), rel=0.02)
    assert max(error["pane"], error["holes"]) < error["none"] + bound
