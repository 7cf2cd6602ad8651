"""What a scene file from anywhere may not do, and what includes and defaults mean."""

from __future__ import annotations

import os
import time

import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import read_tree
from gibench.generators.imported.scene import import_scene

from .files import SQUARE, image, upgraded, written

BOMB = """<?xml version="1.0"?>
<!DOCTYPE scene [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">
<!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;"><!ENTITY d "&c;&c;&c;&c;&c;&c;&c;&c;&c;&c;">
<!ENTITY e "&d;&d;&d;&d;&d;&d;&d;&d;&d;&d;"><!ENTITY f "&e;&e;&e;&e;&e;&e;&e;&e;&e;&e;">]>
<scene version="3.0.0"><string name="x" value="&f;"/></scene>
"""
OUTWARD = """<!DOCTYPE scene [<!ENTITY secret SYSTEM "file:///etc/passwd">]>
<scene version="3.0.0"><string name="x" value="&secret;"/></scene>
"""


def refused(file, says: str, **options) -> None:
    with pytest.raises(SceneFileError, match=says) as problem:
        read_tree(file, **options)
    assert "\n" not in str(problem.value)


def test_what_is_no_xml_is_named_with_its_line(tmp_path):
    (tmp_path / "scene.xml").write_text("<scene>\n<shape\n")
    refused(tmp_path / "scene.xml", r"scene\.xml: it is no XML: unclosed token in line 2")
    (tmp_path / "picture.xml").write_bytes(b"\x89PNG\r\n\x1a\n\0\0\0")
    refused(tmp_path / "picture.xml", r"it is no XML")
    (tmp_path / "empty.xml").write_text("")
    refused(tmp_path / "empty.xml", r"it is no XML: no element found")


def test_xml_that_is_no_scene(tmp_path):
    (tmp_path / "page.xml").write_text("<html><body/></html>")
    refused(tmp_path / "page.xml", r"no Mitsuba scene: its first element is <html>")


def test_a_file_that_is_not_there(tmp_path):
    refused(tmp_path / "none.xml", r"none\.xml cannot be read: No such file")
    refused(tmp_path, r"cannot be read: Is a directory")


@pytest.mark.parametrize("text", [BOMB, OUTWARD], ids=["bomb", "external"])
def test_entities_are_refused_before_they_expand(tmp_path, text):
    (tmp_path / "scene.xml").write_text(text)
    began = time.perf_counter()
    refused(tmp_path / "scene.xml", r"scene\.xml:\d+: it has a document type declaration")
    assert time.perf_counter() - began < 5  # expanded, it would not end


def test_depth_is_bounded(tmp_path):
    nested = "<bsdf type='twosided'>" * 3000 + "</bsdf>" * 3000
    refused(written(tmp_path, nested), r"more than 100 elements in one another")


def test_includes_are_put_in_their_place(tmp_path):
    written(
        tmp_path, '<bsdf type="diffuse" id="m"/><bsdf type="diffuse" id="n"/>', name="parts/materials.xml"
    )
    (tmp_path / "one.xml").write_text('<bsdf type="diffuse" id="o"/>')
    file = written(
        tmp_path, f'<include filename="parts/materials.xml"/>{SQUARE}<include filename="one.xml"/>'
    )
    root = read_tree(file).root
    assert [node.get("id") or node.type for node in root.nodes()] == ["m", "n", "rectangle", "o"]
    assert root.nodes()[0].where == "materials.xml:2"


def test_a_cyclic_include_ends(tmp_path):
    written(tmp_path, '<include filename="b.xml"/>', name="a.xml")
    written(tmp_path, '<include filename="scene.xml"/>', name="b.xml")
    file = written(tmp_path, '<include filename="a.xml"/>')
    refused(file, r"b\.xml:2: 'scene\.xml' includes itself")


def test_defaults_fill_in_parameters_the_longest_name_first(tmp_path):
    body = '<default name="n" value="3"/><default name="name" value="7"/>'
    file = written(tmp_path, body + '<shape type="sphere"><float name="radius" value="$name.$n"/></shape>')
    root = read_tree(file).root
    assert root.nodes("shape")[0].value("radius") == "7.3"
    assert not root.nodes("default")
    refused(written(tmp_path, '<float name="x" value="$nothing"/>'), r"scene\.xml:2: \$nothing has no value")


@pytest.mark.parametrize(
    "body",
    [
        '<shape type="ply"><string name="filename" value="../secret.ply"/></shape>',
        '<shape type="ply"><string name="filename" value="/etc/passwd"/></shape>',
        '<shape type="ply"><string name="filename" value="models/../../secret.ply"/></shape>',
        '<shape type="ply"><string name="filename" value="link.ply"/></shape>',
    ],
)
def test_files_outside_the_folder_are_refused_unless_allowed(tmp_path, body):
    (tmp_path / "secret.ply").write_text("ply")
    folder = tmp_path / "scene"
    file = written(folder, body)
    (folder / "models").mkdir()
    os.symlink(tmp_path / "secret.ply", folder / "link.ply")
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: .* lies outside the folder of the scene"):
        import_scene(file)
    tree = read_tree(file, allow_outside=True)
    name = tree.root.nodes("shape")[0].property("filename")
    assert tree.located(name.get("value"), name.where).is_file()


def test_includes_and_search_paths_do_not_lead_outside(tmp_path):
    written(tmp_path, "", name="other.xml")
    refused(written(tmp_path / "scene", '<include filename="../other.xml"/>'), r"lies outside the folder")
    refused(written(tmp_path / "scene", '<path value=".."/>'), r"<path> leads outside the folder")


def test_a_search_path_inside_is_searched(tmp_path):
    image(tmp_path / "pictures" / "a.png")
    tree = read_tree(written(tmp_path, '<path value="pictures"/>' + SQUARE))
    assert tree.located("a.png", "here") == tmp_path / "pictures" / "a.png"
    assert tree.located("pictures\\a.png", "here") == tmp_path / "pictures" / "a.png"


def test_an_unknown_plugin_is_named_with_its_place_and_the_nearest(tmp_path):
    with pytest.raises(
        SceneFileError, match=r"scene\.xml:3: there is no bsdf 'diffus': did you mean diffuse"
    ):
        upgraded(tmp_path, '\n<bsdf type="diffus"/>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: there is no shape 'deformable'"):
        upgraded(tmp_path, '<shape type="deformable"/>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: <bsdf> has no type"):
        upgraded(tmp_path, "<bsdf/>")


def test_a_scene_without_a_version_is_refused(tmp_path):
    (tmp_path / "scene.xml").write_text("<scene>\n</scene>")
    with pytest.raises(SceneFileError, match=r"scene\.xml:1: <scene> has no version"):
        import_scene(tmp_path / "scene.xml")


def test_a_reference_to_nothing(tmp_path):
    file = written(tmp_path, '<shape type="rectangle"><ref id="gone"/></shape>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: nothing has the id 'gone'"):
        import_scene(file)


def test_all_missing_files_are_listed_at_once(tmp_path):
    body = "".join(
        f'<shape type="ply"><string name="filename" value="models/{i}.ply"/></shape>' for i in range(3)
    )
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="gone.png"/></texture>'
    square = f'<shape type="rectangle" id="s"><bsdf type="diffuse">{texture}</bsdf></shape>'
    file = written(tmp_path, body + square)
    with pytest.raises(
        SceneFileError, match=r"4 files are missing: models/0\.ply, models/1\.ply, models/2\.ply, gone"
    ):
        import_scene(file)
    from gibench.generators.imported.scene import ImportSettings

    scene = import_scene(file, ImportSettings(allow_missing=True))
    assert scene.missing == ("models/0.ply", "models/1.ply", "models/2.ply", "gone.png")
    assert [shape.get("id") for shape in scene.tree.root.nodes("shape")] == ["s"]
    assert any("4 files are missing" in warning for warning in scene.warnings)


def test_a_texture_that_is_no_image(tmp_path):
    (tmp_path / "a.png").write_text("<html>404</html>")
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/></texture>'
    file = written(tmp_path, f'<shape type="rectangle"><bsdf type="diffuse">{texture}</bsdf></shape>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: a\.png is no image that Mitsuba reads"):
        import_scene(file)


def test_a_texture_that_ends_early(tmp_path):
    path = image(tmp_path / "a.png", size=(64, 64))
    path.write_bytes(path.read_bytes()[:40])
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="a.png"/></texture>'
    file = written(tmp_path, f'<shape type="rectangle"><bsdf type="diffuse">{texture}</bsdf></shape>')
    with pytest.raises(
        SceneFileError, match=r"scene\.xml:2: Mitsuba refuses it: .* a\.png: |scene\.xml:2: .*\"a\.png\""
    ):
        _ = import_scene(file).loaded


def test_a_mesh_that_is_none(tmp_path):
    (tmp_path / "a.ply").write_text("no mesh")
    file = written(tmp_path, '<shape type="ply"><string name="filename" value="a.ply"/></shape>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: a\.ply is no PLY file"):
        _ = import_scene(file).loaded


def test_a_scene_without_light_or_shape(tmp_path):
    scene = import_scene(written(tmp_path, SQUARE))
    assert scene.warnings == ("the scene has no light: everything in it is black",)
    with pytest.raises(SceneFileError, match=r"the scene has no shape"):
        import_scene(written(tmp_path, ""))
