"""Height fields, hair and textured roughness of Mitsuba 0.x, and merged shapes of Mitsuba 3."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.old_shapes import height_mesh
from gibench.generators.imported.scene import ImportSettings, import_scene

from .files import SQUARE, image, one, written


def test_a_height_field_is_the_surface_of_its_function():
    y, x = np.meshgrid(np.linspace(-1, 1, 65), np.linspace(-1, 1, 33), indexing="ij")
    mesh = height_mesh(0.3 * x - 0.2 * y, smooth=True)
    assert len(mesh.faces) == 2 * 64 * 32
    np.testing.assert_allclose(
        mesh.vertices[:, 2], 0.3 * mesh.vertices[:, 0] - 0.2 * mesh.vertices[:, 1], atol=1e-12
    )
    normal = np.array([-0.3, 0.2, 1]) / np.sqrt(1.13)
    np.testing.assert_allclose(mesh.normals, np.broadcast_to(normal, mesh.normals.shape), atol=1e-12)
    a, b, c = (mesh.vertices[mesh.faces[:, k]] for k in range(3))
    area = 0.5 * np.cross(b - a, c - a)
    np.testing.assert_allclose(area.sum(axis=0), 4 * np.sqrt(1.13) * normal, atol=1e-9)  # faces +z
    np.testing.assert_allclose(mesh.uvs, 0.5 * (mesh.vertices[:, :2] + 1), atol=1e-12)


@pytest.mark.parametrize(
    ("inside", "height"),
    [
        ('<string name="filename" value="h.png"/><float name="scale" value="2"/>', 2 * 0.2158605),
        ('<texture type="bitmap"><string name="filename" value="h.png"/></texture>', 0.2158605),
        (
            '<texture type="bitmap"><string name="filename" value="h.png"/><float name="gamma" value="1"/></texture>',
            128 / 255,
        ),
        (
            '<texture type="scale"><float name="scale" value="3"/><texture type="bitmap">'
            '<string name="filename" value="h.png"/></texture></texture>',
            3 * 0.2158605,
        ),
    ],
)
def test_height_fields_of_images(tmp_path, inside, height):
    image(tmp_path / "h.png", mode="L", color=128, size=(8, 5))
    body = f'<bsdf type="plastic" id="b"/><shape type="heightfield">{inside}<ref id="b"/></shape>'
    scene = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    assert any(change.rule == "height_fields" and change.loss for change in scene.changes)
    assert one(scene.tree.root, "shape").type == "ply"
    box = scene.loaded.mi_scene.bbox()
    np.testing.assert_allclose(box.min, (-1, -1, height), atol=1e-5)
    np.testing.assert_allclose(box.max, (1, 1, height), atol=1e-5)


@pytest.mark.parametrize(
    ("inside", "says"),
    [
        (
            '<texture type="checkerboard"/>',
            "the heights of a heightfield come from a texture of the type checkerboard",
        ),
        ("", "the heights of a heightfield come from nothing"),
        ('<string name="filename" value="line.png"/>', "1 × 9 heights; allowed are 2 × 2 to"),
        ('<string name="filename" value="text.png"/>', "cannot be read as an image"),
        ('<string name="filename" value="bomb.png"/>', "pixels"),
        ('<string name="filename" value="gone.png"/>', "missing: gone.png"),
    ],
)
def test_height_fields_that_are_none(tmp_path, inside, says):
    image(tmp_path / "line.png", mode="L", color=9, size=(1, 9))
    (tmp_path / "text.png").write_text("heights")
    header = struct.pack(">II5B", 1 << 15, 1 << 15, 8, 0, 0, 0, 0)
    chunks = [(b"IHDR", header), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")]
    (tmp_path / "bomb.png").write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + b"".join(
            struct.pack(">I", len(c)) + t + c + struct.pack(">I", zlib.crc32(t + c)) for t, c in chunks
        )
    )
    file = written(tmp_path, f'<shape type="heightfield">{inside}</shape>{SQUARE}')
    with pytest.raises(SceneFileError, match=says):
        import_scene(file)


@pytest.mark.parametrize(
    "inside",
    [
        '<string name="filename" value="gone.png"/>',
        '<texture type="bitmap"><string name="filename" value="gone.png"/></texture>',
    ],
)
def test_a_height_field_without_its_image_is_left_out(tmp_path, inside):
    file = written(tmp_path, f'<shape type="heightfield">{inside}</shape>{SQUARE}')
    scene = import_scene(file, ImportSettings(allow_missing=True))
    assert one(scene.tree.root, "shape").type == "rectangle"
    assert scene.missing == ("gone.png",)


STRANDS = [[(0, 0, 0), (0, 0, 1), (0, 0.1, 2)], [(1, 0, 0), (1, 0, 1.5)]]


def hair(kind: str) -> bytes:
    if kind == "text":
        text = "\n\n".join("\n".join(" ".join(map(str, point)) for point in strand) for strand in STRANDS)
        return f"# two hairs\n{text}\n\n7 7 7\n".encode()  # and a point that is none
    numbers = [v for strand in STRANDS for v in (np.inf, *np.ravel(strand))]
    count = sum(map(len, STRANDS))
    return b"BINARY_HAIR" + struct.pack("<I", count) + np.array(numbers, "<f4").tobytes()


@pytest.mark.parametrize("kind", ["text", "binary"])
def test_hair_is_curves(tmp_path, kind):
    (tmp_path / "a.hair").write_bytes(hair(kind))
    body = (
        '<shape type="hair"><string name="filename" value="a.hair"/><float name="radius" value="0.1"/>'
        '<transform name="toWorld"><translate x="5"/></transform><bsdf type="diffuse"/></shape>'
    )
    scene = import_scene(written(tmp_path, body), ImportSettings(up="z"))
    assert one(scene.tree.root, "shape").type == "linearcurve"
    assert [c.loss for c in scene.changes if c.rule == "hair"] == [False]
    (text,) = (content.decode() for content in scene.tree.made.values())
    curves = [
        [list(map(float, line.split())) for line in part.split("\n") if line] for part in text.split("\n\n")
    ]
    assert [len(curve) for curve in curves] == [3, 2]
    points = [(*point, 0.1) for strand in STRANDS for point in strand]
    np.testing.assert_allclose([point for curve in curves for point in curve], points, atol=1e-6)
    box = scene.loaded.mi_scene.bbox()
    assert box.min[0] <= 5 <= box.max[0]
    assert box.max[2] >= 2


@pytest.mark.parametrize(
    "content",
    [b"", b"no hair at all", b"1 2 3\n", b"BINARY_HAIR", b"BINARY_HAIR\xff\xff\xff\xff", b"0 0 nan\n0 0 1\n"],
)
def test_hair_that_is_none(tmp_path, content):
    (tmp_path / "a.hair").write_bytes(content)
    file = written(tmp_path, '<shape type="hair"><string name="filename" value="a.hair"/></shape>')
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: a\.hair is no file of hair"):
        import_scene(file)


def test_the_roughness_of_plastic_is_one_number(tmp_path):
    Image.fromarray(np.array([[0, 255], [255, 0]], np.uint8)).save(tmp_path / "a.png")
    texture = '<texture type="bitmap" name="alpha"><string name="filename" value="a.png"/></texture>'
    scene = import_scene(
        written(tmp_path, f'<shape type="sphere"><bsdf type="roughplastic">{texture}</bsdf></shape>')
    )
    assert one(scene.tree.root, "float").get("value") == "0.5"
    assert scene.loaded is not None
    colors = '<float name="color0" value="0.2"/><float name="color1" value="0.4"/>'
    checks = f'<texture type="checkerboard" name="alpha">{colors}</texture>'
    scene = import_scene(
        written(tmp_path, f'<shape type="sphere"><bsdf type="roughplastic">{checks}</bsdf></shape>')
    )
    assert float(one(scene.tree.root, "float").get("value")) == pytest.approx(0.3)


def test_merged_shapes_stand_beside_the_others(tmp_path):
    body = f'<shape type="merge">{SQUARE}{SQUARE}</shape><shape type="cube"/>'
    scene = import_scene(written(tmp_path, body, version="3.0.0"))
    assert [node.type for node in scene.tree.root.nodes("shape")] == ["rectangle", "rectangle", "cube"]
    assert len(scene.loaded.mi_scene.shapes()) == 3
