"""Mesh files checked before Mitsuba opens them: what names vertices that are not there would end the process."""

from __future__ import annotations

import re
import struct
import zlib
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import named_files
from gibench.generators.imported.reading import SceneTree

MOST_BYTES = 1 << 31
"""Of one mesh, unpacked."""

PLY_TYPES = {
    **{"char": "i1", "uchar": "u1", "short": "i2", "ushort": "u2", "int": "i4", "uint": "u4"},
    **{"int8": "i1", "uint8": "u1", "int16": "i2", "uint16": "u2", "int32": "i4", "uint32": "u4"},
    **{"float": "f4", "float32": "f4", "double": "f8", "float64": "f8"},
}


def check_meshes(tree: SceneTree) -> None:
    """Raises SceneFileError, with the place in the scene and what to do, for a mesh file that cannot be read."""
    checks = {"ply": _check_ply, "obj": _check_obj, "serialized": _check_serialized}
    seen: set[tuple[Path, str]] = set()
    for file in named_files(tree):
        check = checks.get(file.owner.type)
        if check is None or not isinstance(file.source, Path):
            continue
        key = (file.source, file.owner.value("shape_index", "0") if file.owner.type == "serialized" else "")
        if key in seen:
            continue
        seen.add(key)
        where = f"{file.owner.where}: {file.source.name}"
        try:
            if file.source.stat().st_size > MOST_BYTES:
                raise SceneFileError(f"{where} has more than {MOST_BYTES >> 30} GB: make it smaller")
            check(where, file.source.read_bytes(), key[1])
        except OSError as problem:
            raise SceneFileError(f"{where} cannot be read: {problem.strerror}") from None


class _Element(NamedTuple):
    """properties: name, type of the count of a list or "", type of the values, in the order of the file."""

    name: str
    size: int
    properties: list[tuple[str, str, str]]

    @property
    def has_lists(self) -> bool:
        return any(count for _, count, _ in self.properties)


def _ply_header(where: str, content: bytes) -> tuple[str, list[_Element], int]:
    """Format, elements, and where the data begin."""
    end = re.search(rb"\nend_header[ \t]*\r?\n", content[: 1 << 16])
    if not content.startswith(b"ply") or end is None:
        raise SceneFileError(f"{where} is no PLY file: it has no header; export it again")
    kind, elements = "", []
    for line in content[: end.start()].decode("latin-1").splitlines()[1:]:
        words = line.split()
        try:
            if words[:1] == ["format"]:
                kind = words[1]
            elif words[:1] == ["element"]:
                elements.append(_Element(words[1], int(words[2]), []))
            elif words[:2] == ["property", "list"]:
                elements[-1].properties.append((words[4], PLY_TYPES[words[2]], PLY_TYPES[words[3]]))
            elif words[:1] == ["property"]:
                elements[-1].properties.append((words[2], "", PLY_TYPES[words[1]]))
        except (IndexError, KeyError, ValueError):
            raise SceneFileError(f"{where}: its header has the line '{line[:60]}', which is no PLY") from None
    if any(element.size < 0 for element in elements):
        raise SceneFileError(f"{where}: its header has a count below 0")
    return kind, elements, end.end()


def _check_ply(where: str, content: bytes, _index: str) -> None:
    kind, elements, at = _ply_header(where, content)
    vertices = next((element.size for element in elements if element.name == "vertex"), 0)
    order = {"binary_little_endian": "<", "binary_big_endian": ">"}.get(kind)
    short = SceneFileError(f"{where} ends before all that its header announces: get it again")
    if order is None:
        if kind == "ascii":
            _check_ascii_ply(where, content[at:], elements, vertices, short)
        return
    for element in elements:
        if element.name == "face":
            _check_binary_faces(where, content, at, element, vertices, order, short)
            return
        if element.has_lists:
            raise SceneFileError(
                f"{where} has lists before its faces, which is not read: export triangles alone"
            )
        at += element.size * sum(np.dtype(kind).itemsize for _, _, kind in element.properties)
        if at > len(content):
            raise short


def _check_binary_faces(
    where: str,
    content: bytes,
    at: int,
    element: _Element,
    vertices: int,
    order: str,
    short: SceneFileError,
) -> None:
    if element.size == 0:
        return
    # Faces have as many corners as the first, or none of them can be found; what has others is refused anyway.
    fields: list[Any] = []
    lists: list[tuple[str, int]] = []
    place = at
    for number, (name, count, kind) in enumerate(element.properties):
        if not count:
            fields.append((f"{name} {number}", order + kind))
            place += np.dtype(kind).itemsize
            continue
        head = np.dtype(order + count)
        if place + head.itemsize > len(content):
            raise short
        length = int(np.frombuffer(content, head, 1, place)[0])
        is_faces = name in ("vertex_index", "vertex_indices")
        if is_faces and length != 3:
            _check_corners(where, np.array([length]), np.zeros((0, 3)), vertices)
        if length < 0 or place + length > len(content):
            raise short
        fields += [(f"{number} count", head), (f"{number} values", order + kind, (length,))]
        lists.append(("corners" if is_faces else "", length))
        if is_faces:
            fields[-2:] = [("count", head), ("corners", order + kind, (3,))]
        else:
            lists[-1] = (f"{number} count", length)
        place += head.itemsize + length * np.dtype(kind).itemsize
    record = np.dtype(fields)
    if "corners" not in (record.names or ()):
        return
    room = max(len(content) - at, 0) // record.itemsize
    faces = np.frombuffer(content, record, min(element.size, room), at)
    for name, length in lists:
        if name != "corners" and (faces[name] != length).any():
            raise SceneFileError(f"{where} has faces with lists of other lengths: export triangles alone")
    _check_corners(where, faces["count"], faces["corners"], vertices)
    if room < element.size:
        raise short


def _check_ascii_ply(
    where: str, text: bytes, elements: list[_Element], vertices: int, short: SceneFileError
) -> None:
    lines = text.splitlines()
    at = 0
    for element in elements:
        if at + element.size > len(lines):
            raise short
        if element.name == "face":
            try:
                rows = [[int(word) for word in line.split()[:4]] for line in lines[at : at + element.size]]
            except ValueError:
                raise SceneFileError(
                    f"{where}: a corner of a face is no whole number: export it again"
                ) from None
            if any(len(row) < 1 or len(row) < min(row[0], 3) + 1 for row in rows):
                raise short
            counts = np.array([row[0] for row in rows], dtype=np.int64)
            if len(counts):
                bad = np.flatnonzero(counts != 3)
                whole = rows[: bad[0]] if len(bad) else rows
                corners = np.array([row[1:4] for row in whole], dtype=object).reshape(-1, 3)
                _check_corners(where, counts, corners, vertices)
        at += element.size


def _check_corners(where: str, counts: NDArray[Any], corners: NDArray[Any], vertices: int) -> None:
    other = np.flatnonzero(counts != 3)
    if len(other):
        raise SceneFileError(
            f"{where}: face {other[0]} has {int(counts[other[0]])} corners, and Mitsuba reads triangles "
            "alone: triangulate the mesh"
        )
    if corners.size and (corners.min() < 0 or corners.max() >= vertices):
        face = int(np.flatnonzero(((corners < 0) | (corners >= vertices)).any(axis=1))[0])
        worst = int(corners[face].max()) if corners[face].max() >= vertices else int(corners[face].min())
        raise SceneFileError(
            f"{where}: face {face} names vertex {worst}, and the file has {vertices}: it is damaged, export it again"
        )


def _check_obj(where: str, content: bytes, _index: str) -> None:
    relative = re.search(rb"^[ \t]*f[ \t][^\n]*?[ \t/](-\d+)", content, re.M)
    if relative is not None:
        line = content.count(b"\n", 0, relative.start(1)) + 1
        raise SceneFileError(
            f"{where}:{line}: a face names the vertex {relative[1].decode()}, counted from the end, which Mitsuba "
            "3 does not read: export it with absolute indices"
        )


def _check_serialized(where: str, content: bytes, index: str) -> None:
    damaged = SceneFileError(f"{where} is damaged or no mesh of Mitsuba: get it again")
    try:
        identifier, version = struct.unpack_from("<HH", content)
        (count,) = struct.unpack_from("<I", content, len(content) - 4)
        number = int(index)
    except (struct.error, ValueError):
        raise damaged from None
    width = 8 if version >= 4 else 4
    if identifier != 0x041C or version not in (3, 4):
        raise damaged
    if not 0 <= number < count:
        raise SceneFileError(f"{where} has {count} meshes, and number {number} is asked for (shape_index)")
    at = len(content) - 4 - width * (count - number)
    if at < 4:
        raise damaged
    (start,) = struct.unpack_from("<Q" if width == 8 else "<I", content, at)
    if start + 4 > at:
        raise damaged
    packed = zlib.decompressobj()
    try:
        head = packed.decompress(content[start + 4 :], 1 << 12)
        (flags,) = struct.unpack_from("<I", head)
        place = 4 if version == 3 else head.index(b"\0", 4) + 1
        vertices, triangles = struct.unpack_from("<QQ", head, place)
    except (zlib.error, struct.error, ValueError):
        raise damaged from None
    number_size = 8 if flags & 0x2000 else 4
    columns = 3 + 3 * bool(flags & 1) + 2 * bool(flags & 2) + 3 * bool(flags & 8)
    before = place + 16 + vertices * columns * number_size
    size = before + triangles * 12
    if size > MOST_BYTES or size > 1100 * len(content):
        raise SceneFileError(f"{where} announces {size} bytes: it is damaged, get it again")
    try:
        rest = packed.decompress(packed.unconsumed_tail, max(size - len(head), 1))
    except zlib.error:
        raise damaged from None
    data = head + rest
    if len(data) < size:
        raise SceneFileError(f"{where} ends before all that its header announces: get it again")
    corners = np.frombuffer(data, "<u4", triangles * 3, before).reshape(-1, 3)
    _check_corners(where, np.full(len(corners), 3), corners, vertices)
