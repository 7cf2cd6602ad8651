"""Images of lights in flat mirrors: which there are, that they change no mean, and that they take noise away."""

from __future__ import annotations

from dataclasses import replace

import mitsuba as mi
import numpy as np
import pytest

from gibench.rendering.guiding.mirrors import MOST_IMAGES, MOST_MIRRORS, SMALLEST, flat_mirrors, images_of
from gibench.rendering.light_numbers import lights_of
from gibench.rendering.scene import GUIDED, load_dict
from tests.rendering import scenes
from tests.rendering.guiding.test_guide import LEARNING, frame, z_score_of_means, z_scores

MIRROR = scenes.two_sided(type="conductor", material="none", specular_reflectance=scenes.rgb(0.85))

ONE_SIDED = {"type": "conductor", "material": "Al"}

MIDDLE = np.array([[0.0, 0.0, 1.0]])


@pytest.fixture(autouse=True)
def quick(monkeypatch):
    """A guide from few paths, of the lights alone."""
    monkeypatch.setattr(LEARNING + ".LANES", 1 << 14)
    monkeypatch.setattr(LEARNING + ".LOOKS", 1 << 16)
    monkeypatch.setattr(LEARNING + ".DIRECTIONS_PAY", 1.0)


def room(*, lamp=0.15, albedo=0.6, **mirrors):
    """A matt room that two round lamps of a radius light, with mirrors on its walls."""
    wall = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(albedo))
    found = {
        "type": "scene",
        "floor": scenes.rectangle([0, 0, 0], [0, 0, 1], (1, 1), bsdf=wall),
        "ceiling": scenes.rectangle([0, 0, 2], [0, 0, -1], (1, 1), bsdf=wall),
        "back": scenes.rectangle([0, 1, 1], [0, -1, 0], (1, 1), bsdf=wall),
        "left": scenes.rectangle([-1, 0, 1], [1, 0, 0], (1, 1), bsdf=wall),
        "right": scenes.rectangle([1, 0, 1], [-1, 0, 0], (1, 1), bsdf=wall),
    }
    for number, x in enumerate((-0.5, 0.4)):
        to_world = mi.ScalarTransform4f().look_at([x, 0.3, 1.9], [x, 0, 0], [1, 0, 0])
        to_world = to_world @ mi.ScalarTransform4f().scale([lamp, lamp, 1])
        emitter = scenes.area((0.2 + 0.1 * number) / lamp**2, 0.2 / lamp**2, 0.1 / lamp**2)
        found[f"lamp_{number}"] = {"type": "disk", "to_world": to_world, "emitter": emitter}
    return found | mirrors


def glass(origin, normal, size=(0.5, 0.5), bsdf=MIRROR):
    return scenes.rectangle(origin, normal, size, bsdf=bsdf)


def slab(bsdf=MIRROR):
    """A mirror with a thickness: a mesh with six sides, at the left wall."""
    to_world = mi.ScalarTransform4f().translate([-0.97, 0.2, 1.0]).scale([0.01, 0.4, 0.5])
    return {"type": "cube", "to_world": to_world, "bsdf": bsdf}


def tilted():
    return glass([0.3, 0.75, 0.7], [-0.2, -1, 0.3], (0.4, 0.3))


def at_left(**options):
    return glass([-0.99, 0, 1], [1, 0, 0], **options)


def screened():
    grey = scenes.two_sided(type="diffuse", reflectance=scenes.rgb(0.3))
    return {
        "glass": at_left(),
        "screen": scenes.rectangle([-0.6, 0.2, 0.8], [1, 0, 0], (0.3, 0.3), bsdf=grey),
    }


PATTERN = {"type": "conductor", "specular_reflectance": scenes.checker()}

ROOMS = {
    "rectangle": lambda: {"glass": at_left()},
    "seen from its back": lambda: {"glass": glass([-0.99, 0, 1], [-1, 0, 0])},
    "one side": lambda: {"glass": at_left(bsdf=ONE_SIDED)},
    "the wrong side": lambda: {"glass": glass([-0.99, 0, 1], [-1, 0, 0], bsdf=ONE_SIDED)},
    "slab": lambda: {"glass": slab()},
    "facing": lambda: {"glass": at_left(), "other": glass([0.99, 0, 1], [-1, 0, 0])},
    "tilted": lambda: {"glass": tilted()},
    "pattern": lambda: {"glass": at_left(bsdf=PATTERN)},
    "screen before it": screened,
}


@pytest.mark.parametrize("max_depth", [6, 2])
@pytest.mark.parametrize("name", ROOMS)
def test_same_mean(name, max_depth):
    plain = load_dict(room(**ROOMS[name]()))
    guided = replace(plain, sampling=GUIDED)
    assert (guided.guide.images is not None) == (name != "the wrong side")
    one, other = (
        frame(scene, seed=seed, spp=4080, max_depth=max_depth) for scene, seed in ((guided, 1), (plain, 2))
    )
    assert abs(z_score_of_means(one, other)) < 4
    z = z_scores(one, other)
    assert abs(np.median(z)) < 0.5


@pytest.mark.parametrize("part", ["direct_diffuse", "indirect_diffuse"])
def test_light_by_a_mirror_is_indirect(part):
    plain = load_dict(room(**ROOMS["rectangle"]()))
    means = {}
    for scene, seed in ((replace(plain, sampling=GUIDED), 1), (plain, 2)):
        found = frame(scene, seed=seed, spp=4080, max_depth=2)
        means[scene.sampling] = found[part].astype(float).mean()
    assert means[GUIDED] == pytest.approx(means["plain"], rel=0.05)
    assert means[GUIDED] > 0


def test_one_event_shows_no_image():
    plain = load_dict(room(**ROOMS["rectangle"]()))
    found = frame(replace(plain, sampling=GUIDED), max_depth=1)
    assert not found["indirect_diffuse"].any()


def test_less_noise():
    """Of what nearly black walls get by a mirror from lamps of 6 cm."""
    plain = load_dict(room(lamp=0.03, albedo=0.05, glass=at_left(size=(0.8, 0.8))))
    with_images = replace(plain, sampling=GUIDED)
    without = replace(plain, sampling=GUIDED)
    assert with_images.guide.images is not None
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(LEARNING + ".images_of", lambda *_: None)
        assert without.guide.images is None
    variance = []
    for scene in (with_images, without):
        found = frame(scene, seed=1, spp=16380, max_depth=2)
        straight = found["emission"].any(axis=-1)  # an edge of a lamp is noisy, too
        variance.append(np.square(found["color_se"].astype(float))[~straight].mean())
    assert variance[0] < 0.01 * variance[1]


def planes(description):
    return flat_mirrors(load_dict(description).mi_scene, MIDDLE)


def test_flat_parts():
    found = planes(room(glass=slab(), other=tilted()))
    assert [round(p.area, 3) for p in found] == [0.8, 0.48]
    np.testing.assert_allclose(found[0].normal, [1, 0, 0], atol=1e-6)
    assert found[0].offset == pytest.approx(-0.96, abs=1e-6)
    np.testing.assert_allclose(found[1].normal, np.array([-0.2, -1, 0.3]) / np.sqrt(1.13), atol=1e-6)
    # Its edges are smaller than a mirror that has images, and its back sees nothing.
    assert all(p.area > SMALLEST for p in found)


@pytest.mark.parametrize(
    "bsdf",
    [
        scenes.two_sided(type="roughconductor", alpha=1e-3),
        scenes.two_sided(type="diffuse"),
        {"type": "bumpmap", "texture": scenes.checker(), "of": {"type": "conductor"}},
        {"type": "mask", "opacity": 0.5, "of": MIRROR},
        {"type": "dielectric"},
    ],
    ids=["rough", "matt", "bumped", "holes", "glass"],
)
def test_other_materials_have_no_images(bsdf):
    assert planes(room(glass=at_left(bsdf=bsdf))) == []


@pytest.mark.parametrize(
    "shape",
    [{"type": "sphere", "radius": 0.4}, {"type": "cylinder", "radius": 0.4}],
    ids=["sphere", "cylinder"],
)
def test_curved_mirrors_have_no_images(shape):
    assert planes(room(ball={**shape, "bsdf": MIRROR})) == []


def test_curved_mesh_has_no_images():
    """A tube whose normals are smooth, of strips that are each large enough."""
    turn = np.linspace(0, 2 * np.pi, 13)[:-1]
    ring = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    mesh = mi.Mesh("tube", 24, 24, has_vertex_normals=True)
    values = mi.traverse(mesh)
    values["vertex_positions"] = np.concatenate([np.c_[ring, np.full(12, z)] for z in (0, 2)]).ravel()
    values["vertex_normals"] = -np.concatenate([np.c_[ring, np.zeros(12)]] * 2).ravel()
    k = np.arange(12)
    after = (k + 1) % 12
    values["faces"] = np.concatenate([np.c_[k, after, k + 12], np.c_[after, after + 12, k + 12]]).ravel()
    values.update()
    mesh.set_bsdf(mi.load_dict(MIRROR))
    scene = load_dict({"type": "scene", "tube": mesh})
    assert scene.mi_scene.shapes()[0].surface_area()[0] > 10
    assert flat_mirrors(scene.mi_scene, MIDDLE) == []


def images(description):
    scene = load_dict(description).mi_scene
    return images_of(scene, lights_of(scene), MIDDLE)


def test_images_are_bounded():
    """Forty lamps and ten mirrors: the largest mirrors, and the lamps that are closest to them."""
    many = room(
        **{f"glass_{k}": glass([-0.99 + 0.01 * k, 0, 1], [1, 0, 0], (0.3 + 0.01 * k, 0.3)) for k in range(10)}
    )
    for k in range(40):
        many[f"bulb_{k}"] = {
            "type": "sphere",
            "center": [0.9 - 0.01 * k, 0.5, 1.5],
            "radius": 0.01,
            "emitter": scenes.area(1, 1, 1),
        }
    found = images(many)
    assert len(found.lights) == MOST_IMAGES
    assert found.mirrors.min() == 1
    assert found.mirrors.max() <= MOST_MIRRORS


def test_lamps_behind_a_mirror_have_no_image():
    assert images(room(glass=glass([0, 0.1, 1], [0, -1, 0], (1, 1), bsdf=ONE_SIDED))) is None


def test_no_mirror_no_images():
    assert images(room()) is None
