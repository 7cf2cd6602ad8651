"""Small files that stand for much: each is refused in a line, and soon."""

from __future__ import annotations

import struct
import zlib

import numpy as np
import pytest
from PIL import Image

from gibench.generators.imported import parsing
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.scene import ImportSettings, import_scene
from gibench.generators.imported.shapes import MOST_SHAPES
from tests.one_processor import needs_affinity, run_on_one_processor

from .files import SQUARE, written


def test_includes_that_multiply(tmp_path):
    for level in range(6):
        line = f'<include filename="i{level + 1}.xml"/>' * 10
        (tmp_path / f"i{level}.xml").write_text(f'<scene version="3.0.0">{line}</scene>')
    (tmp_path / "i6.xml").write_text(f'<scene version="3.0.0">{SQUARE}</scene>')
    with pytest.raises(SceneFileError, match=f"more than {parsing.MOST_INCLUDES} files are included"):
        import_scene(tmp_path / "i0.xml")


def test_elements_that_multiply(tmp_path, monkeypatch):
    monkeypatch.setattr(parsing, "MOST_ELEMENTS", 500)
    (tmp_path / "part.xml").write_text(f'<scene version="3.0.0">{SQUARE * 100}</scene>')
    with pytest.raises(SceneFileError, match="more than 500 elements, with what is included"):
        import_scene(written(tmp_path, '<include filename="part.xml"/>' * 9))


@pytest.mark.parametrize("nested", [False, True])
def test_parameters_that_multiply(tmp_path, nested):
    text = '<default name="a" value="' + "x" * 10**5 + '"/>'
    if nested:
        text += "".join(
            f'<default name="b{k}" value="{"$a" * 10 if k == 0 else f"$b{k - 1}" * 10}"/>' for k in range(9)
        )
    name = "$b8" if nested else "$a" * 10**4
    with pytest.raises(SceneFileError, match="parameters expand to more than"):
        import_scene(written(tmp_path, f'{text}<shape type="{name}"/>'))


def test_instances_that_multiply(tmp_path):
    group = '<shape type="shapegroup" id="g">' + SQUARE * 500 + "</shape>"
    body = group + '<shape type="instance"><ref id="g"/></shape>' * 500
    with pytest.raises(
        SceneFileError, match=f"500 instances the scene has 250501 shapes; more than {MOST_SHAPES}"
    ):
        import_scene(written(tmp_path, body))


def texture(name: str) -> str:
    return (
        f'<shape type="sphere"><bsdf type="diffuse"><texture type="bitmap" name="reflectance"><string name="filename" '
        f'value="{name}"/></texture></bsdf></shape>'
    )


def test_an_image_larger_than_memory(tmp_path):
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", 100_000, 100_000, 8, 2, 0, 0, 0)
    (tmp_path / "a.png").write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", b"") + chunk(b"IEND", b"")
    )
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: a\.png has "):
        import_scene(written(tmp_path, texture("a.png")))


def test_images_that_mitsuba_does_not_read(tmp_path):
    import OpenEXR

    Image.new("CMYK", (4, 4)).save(tmp_path / "a.jpg")
    with pytest.raises(
        SceneFileError, match=r"scene\.xml:2: a\.jpg is a JPEG of CMYK colours: save it as RGB"
    ):
        import_scene(written(tmp_path, texture("a.jpg")))
    pixels = np.zeros((4, 4, 3), dtype=np.float32)
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"sky": pixels}) as file:
        file.write(str(tmp_path / "a.exr"))
    with pytest.raises(
        SceneFileError, match=r"scene\.xml:2: a\.exr has no channels R, G and B, but .* 'sky'"
    ):
        import_scene(written(tmp_path, texture("a.exr")))


def ply(faces: bytes, *, vertices: int = 3, count: int = 1, kind: str = "binary_little_endian") -> bytes:
    header = (
        f"ply\nformat {kind} 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\nproperty float z\n"
        f"element face {count}\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return header.encode() + faces


CORNERS = struct.pack("<9f", 0, 0, 0, 1, 0, 0, 0, 1, 0)


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (ply(CORNERS + struct.pack("<B3i", 3, 0, 1, 3)), "face 0 names vertex 3, and the file has 3"),
        (ply(CORNERS + struct.pack("<B3i", 3, 0, -1, 2)), "face 0 names vertex -1"),
        (ply(CORNERS + struct.pack("<B3i", 3, 0, 1, 10**9)), "face 0 names vertex 1000000000"),
        (ply(CORNERS + struct.pack("<B4i", 4, 0, 1, 2, 0)), "face 0 has 4 corners, .* triangulate"),
        (ply(CORNERS, vertices=10**9), "ends before"),
        (ply(CORNERS + struct.pack("<B3i", 3, 0, 1, 2), count=10**9), "ends before"),
        (ply(CORNERS, vertices=-3), "count below 0"),
        (ply(b"0 0 0\n1 0 0\n0 1 0\n3 0 1 7\n", kind="ascii"), "face 0 names vertex 7"),
        (ply(b"0 0 0\n1 0 0\n0 1 0\n3 0 1 x\n", kind="ascii"), "no whole number"),
        (ply(b"0 0 0\n1 0 0\n", kind="ascii"), "ends before"),
        (b"ply\nformat binary_little_endian 1.0\nelement vertex many\nend_header\n", "element vertex many"),
        (b"no mesh", "no header"),
        (b"", "no header"),
    ],
)
def test_a_ply_file_whose_faces_or_counts_are_wrong(tmp_path, content, says):
    (tmp_path / "a.ply").write_bytes(content)
    scene = written(tmp_path, '<shape type="ply"><string name="filename" value="a.ply"/></shape>')
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: a\.ply.*{says}"):
        import_scene(scene)


@pytest.mark.parametrize(
    ("properties", "face", "says"),
    [
        (
            "property list uchar int vertex_indices\nproperty float quality\n",
            struct.pack("<B3if", 3, 0, 1, 8, 0.5),
            "vertex 8",
        ),
        (
            "property uchar flag\nproperty list uchar uint vertex_index\n",
            struct.pack("<BB3I", 1, 3, 0, 1, 4 * 10**9),
            "vertex 4000000000",
        ),
        (
            "property list uchar int vertex_indices\nproperty list uchar float texcoord\n",
            struct.pack("<B3iB2f", 3, 0, 1, 7, 2, 0, 0),
            "vertex 7",
        ),
        ("property list uchar int vertex_indices\n", struct.pack("<B", 250), "250 corners"),
    ],
)
def test_faces_with_more_than_corners(tmp_path, properties, face, says):
    header = (
        "ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float y\n"
        f"property float z\nelement face 1\n{properties}end_header\n"
    )
    (tmp_path / "a.ply").write_bytes(header.encode() + CORNERS + face)
    scene = written(tmp_path, '<shape type="ply"><string name="filename" value="a.ply"/></shape>')
    with pytest.raises(SceneFileError, match=says):
        import_scene(scene)


def serialized(corner: int, *, announced: int = 1) -> bytes:
    packed = struct.pack("<I", 0x1000) + b"name\0" + struct.pack("<QQ", 3, announced) + CORNERS
    packed += struct.pack("<3I", 0, 1, corner)
    start = struct.pack("<HH", 0x041C, 4) + zlib.compress(packed)
    return start + struct.pack("<Q", 0) + struct.pack("<I", 1)


@pytest.mark.parametrize(
    ("content", "index", "says"),
    [
        (serialized(9), 0, "names vertex 9"),
        (serialized(2, announced=2**40), 0, "announces"),
        (serialized(2, announced=3), 0, "ends before"),
        (serialized(2), 5, "has 1 meshes, and number 5"),
        (b"\x1c\x04", 0, "damaged"),
        (serialized(2)[:30], 0, "damaged"),
    ],
)
def test_a_serialized_mesh_that_is_wrong(tmp_path, content, index, says):
    (tmp_path / "a.serialized").write_bytes(content)
    body = (
        '<shape type="serialized"><string name="filename" value="a.serialized"/>'
        f'<integer name="shape_index" value="{index}"/></shape>'
    )
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: a\.serialized.*{says}"):
        import_scene(written(tmp_path, body))


def test_a_serialized_mesh_that_is_right(tmp_path):
    (tmp_path / "a.serialized").write_bytes(serialized(2))
    body = '<shape type="serialized"><string name="filename" value="a.serialized"/></shape>'
    assert (
        import_scene(written(tmp_path, body, version="3.0.0")).loaded.mi_scene.shapes()[0].face_count() == 1
    )


def test_an_environment_that_is_no_light(tmp_path):
    import OpenEXR

    pixels = np.ones((8, 16, 3), dtype=np.float32)
    pixels[0, 0] = np.nan
    pixels[1, 0, 0] = -1
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": pixels}) as file:
        file.write(str(tmp_path / "a.exr"))
    body = SQUARE + '<emitter type="envmap"><string name="filename" value="a.exr"/></emitter>'
    with pytest.raises(SceneFileError, match=r"scene\.xml:2: 4 values of a\.exr are negative or not finite"):
        import_scene(written(tmp_path, body, version="3.0.0"))


def test_what_a_parameter_is_given_counts_before_its_default(tmp_path):
    body = '<default name="r" value="1"/><shape type="sphere"><float name="radius" value="$r"/></shape>'
    scene = import_scene(written(tmp_path, body, version="3.0.0"), ImportSettings(parameters=("r=3", "s=4")))
    assert [w for w in scene.warnings if "-D" in w] == ["-D s: nothing in the scene asks for $s"]
    low, high = scene.loaded.mi_scene.bbox().min, scene.loaded.mi_scene.bbox().max
    np.testing.assert_allclose(np.array(high).ravel() - np.array(low).ravel(), 6, rtol=1e-3)
    with pytest.raises(SceneFileError, match="-D: 'r' is no name=value"):
        import_scene(written(tmp_path, body), ImportSettings(parameters=("r",)))


@needs_affinity
def test_an_environment_is_read_on_one_processor(tmp_path):
    """Mitsuba's reader of OpenEXR never returns where it may use one thread only."""
    import OpenEXR

    pixels = np.ones((32, 64, 3), dtype=np.float32)
    with OpenEXR.File({"compression": OpenEXR.ZIP_COMPRESSION}, {"RGB": pixels}) as file:
        file.write(str(tmp_path / "a.exr"))
    body = SQUARE + '<emitter type="envmap"><string name="filename" value="a.exr"/></emitter>'
    scene = written(tmp_path, body, version="3.0.0")
    run_on_one_processor(
        "from pathlib import Path\n"
        "from gibench.generators.imported.scene import import_scene\n"
        f"import_scene(Path({str(scene)!r}))"
    )
