"""Scenes of strangers that came out wrong without a word: each against stock Mitsuba, or the value it should have."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.room import import_room, write_imported_room
from gibench.generators.imported.scene import ImportSettings, import_scene

SIZE = (32, 24)

EXTERNAL = os.environ.get("GIBENCH_EXTERNAL")

pytestmark = pytest.mark.skipif(not EXTERNAL, reason="GIBENCH_EXTERNAL is unset")

CASES = Path(EXTERNAL or ".") / "cases"

LIKE_STOCK = [
    "alias",
    "default-in-default",
    "ids-non-ascii",
    "include-default-order",
    "include-old-version",
    "mirrored-sphere",
    "shapegroup-inline-bsdf",
    "spectrum-file",
    "vertex-colours-turned",
    "scenes/alias",
    "scenes/curve_turned",
    "scenes/root_area_light",
    "scenes/sdfgrid_instance",
    "scenes/spectrum_file",
    "scenes/turned_blend_ref",
    "scenes/turned_mesh_attribute",
    "scenes/turned_normalmap",
    "scenes/turned_twosided_pair",
]

MEANS = {
    "vertex-colours-turned/flip-flag.xml": ((0.084, 0.066, 0.053), {}),
    "projector-units/metres.xml": ((1.01, 0.885, 0.773), {}),
    "projector-units/centimetres.xml": ((1.01, 0.885, 0.773), {"scale": 0.01}),
    "opacity-grey-alpha/scene.xml": ((0.093, 0.12, 0.062), {}),
    "opacity-grey-alpha/same-as-rgba.xml": ((0.093, 0.12, 0.062), {}),
}

COMES_IN = [
    "scenes/blackbody",
    "scenes/diffuse_reflectance_name",
    "scenes/file_name_case",
    "scenes/hex_in_phong",
    "scenes/missing_measured",
    "scenes/missing_normalmap",
    "scenes/missing_shared_texture",
    "scenes/parameter_in_integrator",
    "scenes/spectrum_triple",
    "scenes/unknown_property",
    "scenes/zero_normals_obj",
    "scenes/zero_rotation_axis",
    "missing-texture-by-ref",
]

REFUSED = {
    "bad-up/scene.xml": r"scene\.xml:4: '0; 0; 1' is not 3",
    "envmap-nan/scene.xml": r"scene\.xml:7: 3 values of nan\.exr are negative or not finite",
    "spectrum-outside/scene.xml": r"scene\.xml:15: '/etc/hostname' lies outside",
    "mesh-messages/quads.xml": r"quads\.xml:15: a\.ply: face 0 has 4 corners, .*: triangulate",
    "mesh-messages/negative.xml": r"negative\.xml:15: negative\.obj:6: .* absolute indices",
    "mesh-messages/cmyk.xml": r"cmyk\.xml:15: cmyk\.jpg is a JPEG of CMYK colours",
    "mesh-messages/layer.xml": r"layer\.xml:7: layer\.exr has no channels .* 'sky'",
    "mesh-messages/dup-ids.xml": r"dup-ids\.xml:15: the id 'wall' is taken by dup-ids\.xml:6",
}

WARNED = {
    "hide-emitters": "hide_emitters is left out",
    "near-clip": "a near_clip of 2.5 m is left out",
}


def mean(path: Path, size: tuple[int, int] = SIZE) -> np.ndarray:
    """Of stock Mitsuba's image of the first camera."""
    import mitsuba as mi

    scene = mi.load_file(str(path), optimize=False)
    sensor = scene.sensors()[0]
    params = mi.traverse(sensor)
    params["film.size"] = params["film.crop_size"] = mi.ScalarVector2u(*size)
    params.update()
    integrator = mi.load_dict({"type": "path", "max_depth": 5})
    return np.array(mi.render(scene, sensor=sensor, integrator=integrator, spp=256, seed=3))[..., :3].mean(
        (0, 1)
    )


def written(case: Path, folder: Path, **settings) -> tuple[Path, list[str]]:
    scene = import_scene(case, ImportSettings(**settings))
    room = import_room(scene, resolution=SIZE, views=0)
    write_imported_room(room, folder, max_depth=5, resolution=SIZE, spp=4)
    return folder / "scene.xml", [change.what for change in room.scene.changes if change.loss]


@pytest.mark.parametrize("case", LIKE_STOCK)
def test_it_looks_as_in_stock_mitsuba(case, tmp_path, monkeypatch):
    monkeypatch.chdir(CASES / case)  # where Mitsuba looks for spectra
    found = mean(written(CASES / case / "scene.xml", tmp_path)[0])
    np.testing.assert_allclose(found, mean(CASES / case / "scene.xml"), rtol=0.03, atol=0.002)


@pytest.mark.parametrize("case", MEANS)
def test_it_has_the_colour_that_it_should(case, tmp_path):
    expected, settings = MEANS[case]
    np.testing.assert_allclose(mean(written(CASES / case, tmp_path, **settings)[0]), expected, rtol=0.06)


@pytest.mark.parametrize("case", COMES_IN)
def test_it_is_read_and_loads(case):
    settings = ImportSettings(allow_missing="missing" in case)
    assert len(import_scene(CASES / case / "scene.xml", settings).loaded.shapes) > 1


@pytest.mark.parametrize("case", REFUSED)
def test_it_is_refused_in_a_line(case):
    with pytest.raises(SceneFileError, match=REFUSED[case]) as refused:
        import_scene(CASES / case)
    assert "\n" not in str(refused.value)


@pytest.mark.parametrize("case", WARNED)
def test_what_is_left_out_is_said(case, tmp_path):
    assert any(loss.startswith(WARNED[case]) for loss in written(CASES / case / "scene.xml", tmp_path)[1])


def test_a_principal_point_of_0_is_none(tmp_path):
    assert written(CASES / "principal-point-zero/scene.xml", tmp_path)[1] == []


@pytest.mark.parametrize("file", ["roll.json", "mirror.json"])
def test_a_matrix_that_rolls_or_mirrors_is_said(file):
    scene = import_scene(
        CASES / "camera-file-roll/scene.xml", ImportSettings(cameras=CASES / "camera-file-roll" / file)
    )
    said = [change for change in scene.changes if change.rule == "cameras"]
    assert any("roll of" in change.what or "mirrored" in change.what for change in said)
    assert all(change.loss and f"{file}, camera 0" in change.where for change in said)


def test_a_crop_window_is_the_image(tmp_path):
    """The README's means of the 16x16 crop that the film asks for."""
    scene = import_scene(CASES / "film-crop/scene.xml")
    assert scene.resolution == (16, 16)
    write_imported_room(
        import_room(scene, resolution=(16, 16), views=0), tmp_path, max_depth=5, resolution=(16, 16), spp=4
    )
    np.testing.assert_allclose(mean(tmp_path / "scene.xml", (16, 16)), (0.086, 0.067, 0.052), rtol=0.03)


def test_a_byte_order_mark_is_skipped():
    settings = ImportSettings(cameras=CASES / "bom/bom.json")
    assert len(import_scene(CASES / "bom/scene.xml", settings).cameras) == 2


@pytest.mark.parametrize("case", ["jfif", "icc", "stripped", "a"])
def test_a_glb_file_holds_every_image(case, tmp_path):
    import trimesh

    written(CASES / "glb-jpeg-headers" / f"{case}.xml", tmp_path)
    meshes = trimesh.load(tmp_path / "room.glb").geometry.values()
    images = [getattr(mesh.visual.material, "baseColorTexture", None) for mesh in meshes]
    assert [image.size for image in images if image is not None] == [(32, 32)]


def test_principled_is_metallic_roughness(tmp_path):
    import trimesh

    written(CASES / "glb-principled/scene.xml", tmp_path)
    meshes = trimesh.load(tmp_path / "room.glb").geometry.values()
    found = {
        (round(m.visual.material.metallicFactor, 3), round(m.visual.material.roughnessFactor, 3))
        for m in meshes
    }
    assert (1.0, 0.2) in found


@pytest.mark.parametrize("case", ["obj_mtl", "obj_named_materials"])
def test_groups_of_an_obj_file_have_materials_of_their_own(case, tmp_path):
    import mitsuba as mi

    path, _ = written(CASES / "scenes" / case / "scene.xml", tmp_path)
    image = np.array(mi.render(mi.load_file(str(path)), spp=64))[..., :3]
    left, right = image[:, : SIZE[0] // 2].mean((0, 1)), image[:, SIZE[0] // 2 :].mean((0, 1))
    assert left[0] > 1.3 * left[2]
    assert right[2] > 1.3 * right[0]
