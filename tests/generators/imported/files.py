"""Scene files for tests, written in a few words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from PIL import Image

from gibench.generators.imported.reading import read_tree
from gibench.generators.imported.upgrading import upgrade

SQUARE = '<shape type="rectangle"/>'


def written(folder: Path, body: str, *, version: str = "0.5.0", name: str = "scene.xml") -> Path:
    """A scene file whose body begins in its second line."""
    file = folder / name
    file.parent.mkdir(parents=True, exist_ok=True)
    file.write_text(f'<scene version="{version}">\n{body}\n</scene>\n', encoding="utf-8")
    return file


def upgraded(folder: Path, body: str, *, version: str = "0.5.0"):
    """The `<scene>` after its upgrade, and the changes."""
    tree = read_tree(written(folder, body, version=version))
    changes = upgrade(tree)
    return tree.root, changes


def image(path: Path, *, mode: str = "RGB", color: tuple[int, ...] = (128, 64, 32), size=(4, 4)) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new(mode, size, color).save(path)
    return path


def one(root, tag: str, type: str | None = None):
    """The only element of a kind."""
    found = [n for n in root.everything() if n.tag == tag and type in (None, n.type)]
    assert len(found) == 1, [(n.tag, n.type) for n in root.everything()]
    return found[0]


def numbers(text: str) -> np.ndarray:
    return np.array([float(word) for word in text.replace(",", " ").split()])


ROOM = """
<sensor type="perspective">
  <float name="fov" value="70"/>
  <transform name="to_world"><lookat origin="0.6, -2.2, 1.6" target="0, 0.5, 1.1" up="0, 0, 1"/></transform>
</sensor>
<bsdf type="twosided" id="wall"><bsdf type="diffuse"><rgb name="reflectance" value="0.7 0.65 0.6"/></bsdf></bsdf>
<shape type="cube" id="shell">
  <boolean name="flip_normals" value="{flip}"/>
  <transform name="to_world"><scale x="2.5" y="3" z="1.35"/><translate z="1.35"/></transform>
  <ref id="wall"/>
</shape>
<shape type="rectangle" id="lamp">
  <transform name="to_world"><scale value="0.4"/><rotate x="1" angle="180"/><translate z="2.69"/></transform>
  <emitter type="area"><rgb name="radiance" value="12 11 10"/></emitter>
</shape>
{things}
"""
"""A closed room of 5 × 6 × 2.7 m, its floor at 0, in the syntax of Mitsuba 3 and Z up."""


def room_file(folder: Path, *, flip: str = "true", extra: str = "") -> Path:
    """A room with a dozen boxes in it: enough for views to have something to show."""
    boxes = [
        (x, y, s)
        for x, y, s in [
            (-2.0, -2.4, 0.4),
            (-2.0, 0.0, 0.45),
            (-2.1, 2.3, 0.35),
            (2.0, -2.3, 0.4),
            (2.0, 0.2, 0.35),
            (1.9, 2.4, 0.45),
            (0.0, 2.4, 0.5),
            (-0.9, 2.5, 0.3),
            (1.0, 2.5, 0.3),
            (0.0, -0.2, 0.3),
        ]
    ]
    things = "\n".join(
        f'<shape type="cube" id="box{i}"><transform name="to_world"><scale value="{s}"/>'
        f'<translate x="{x}" y="{y}" z="{s}"/></transform><ref id="wall"/></shape>'
        for i, (x, y, s) in enumerate(boxes)
    )
    return written(folder, ROOM.format(flip=flip, things=things + extra), version="3.0.0")
