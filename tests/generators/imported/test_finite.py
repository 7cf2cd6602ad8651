"""Numbers that no image comes of are refused with their line; images by what their headers announce."""

from __future__ import annotations

import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.scene import import_scene

from .files import SQUARE, written


def lamp(light: str) -> str:
    return f'<shape type="rectangle"><emitter type="area">{light}</emitter></shape>'


def moved(step: str) -> str:
    return f'<shape type="cube"><transform name="toWorld">{step}</transform></shape>'


@pytest.mark.parametrize(
    ("body", "says"),
    [
        (lamp('<rgb name="radiance" value="1 nan 0"/>'), "'nan' is no finite number"),
        (lamp('<spectrum name="radiance" value="400:1, 500:inf"/>'), "'inf' is no finite number"),
        (lamp('<spectrum name="radiance" value="1e400"/>'), "'1e400' is no finite number"),
        (lamp('<rgb name="radiance" value="3, -1, 0"/>'), "a radiance of -1: light is not negative"),
        (moved('<matrix value="nan 0 0 0 0 1 0 0 0 0 1 0 0 0 0 1"/>'), "'nan' is no finite number"),
        (moved('<translate x="Infinity"/>'), "'Infinity' is no finite number"),
        (
            '<shape type="sphere"><bsdf type="roughplastic"><float name="alpha" value="nan"/></bsdf></shape>',
            "'nan' is no finite number",
        ),
    ],
)
@pytest.mark.parametrize("version", ["0.6.0", "3.0.0"])
def test_numbers_that_are_none(tmp_path, body, says, version):
    if version == "3.0.0":
        body = body.replace("toWorld", "to_world")
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: .*{says}"):
        import_scene(written(tmp_path, body, version=version))


def test_what_is_not_rendered_may_be_infinite(tmp_path):
    body = '<sensor type="perspective"><float name="far_clip" value="inf"/></sensor>'
    medium = '<medium type="homogeneous"><float name="scale" value="inf"/></medium>'
    assert import_scene(written(tmp_path, body + medium + SQUARE, version="3.0.0")).cameras


@pytest.mark.parametrize(
    ("name", "content", "says"),
    [
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 40000 +X 40000\n", "40000 × 40000 pixels"),
        ("a.hdr", b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n", "states no size"),
        ("a.pfm", b"PF\n99999 77777\n-1.0\n", "99999 × 77777 pixels"),
        ("a.pfm", b"PF\n-4 -4\n-1.0\n", "states no size"),
    ],
)
@pytest.mark.parametrize("where", ["texture", "envmap"])
def test_sizes_of_float_images_are_those_of_their_headers(tmp_path, name, content, says, where):
    (tmp_path / name).write_bytes(content)
    file = f'<string name="filename" value="{name}"/>'
    texture = f'<bsdf type="diffuse"><texture type="bitmap" name="reflectance">{file}</texture></bsdf>'
    body = {
        "texture": f'<shape type="cube">{texture}</shape>',
        "envmap": f'<emitter type="envmap">{file}</emitter>{SQUARE}',
    }[where]
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: {name}.*{says}"):
        import_scene(written(tmp_path, body, version="3.0.0"))
