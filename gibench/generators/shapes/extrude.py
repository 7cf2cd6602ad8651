"""Outlines given thickness: extruded polygons, and frames with mitred corners."""

from __future__ import annotations

import numpy as np
import shapely

from gibench.generators.parts import FloatArray, IntArray, Mesh
from gibench.generators.shapes.affine import Points
from gibench.generators.shapes.errors import ShapeError
from gibench.generators.shapes.skin import fillet

_CREASE = np.cos(np.radians(35))  # walls that meet at more than this angle have an edge


def rectangle(x0: float, x1: float, y0: float, y1: float) -> FloatArray:
    """(4, 2) corners of a rectangle, counter-clockwise."""
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def rounded_rectangle(
    x0: float, x1: float, y0: float, y1: float, radius: float, *, segments: int = 4
) -> FloatArray:
    """(4 · (segments + 1), 2) points of a rectangle with round corners (m), counter-clockwise."""
    return fillet(rectangle(x0, x1, y0, y1), radius, segments=segments, closed=True)


def _inset(ring: FloatArray, distance: float) -> FloatArray:
    """The ring (N, 2), counter-clockwise for an outline and clockwise for a hole, moved into the material."""
    edges = np.roll(ring, -1, 0) - ring
    outward = np.stack([edges[:, 1], -edges[:, 0]], 1) / np.linalg.norm(edges, axis=1, keepdims=True)
    before = np.roll(outward, 1, 0)
    return ring - distance * (outward + before) / (1 + np.sum(outward * before, 1, keepdims=True))


def _caps(rings: list[FloatArray]) -> IntArray:
    """Triangles (F, 3), counter-clockwise, over the points of an outline and its holes, one after the
    other."""
    outline = rings[0]
    edges = np.roll(outline, -1, 0) - outline
    following = np.roll(edges, -1, 0)
    if len(rings) == 1 and np.all(edges[:, 0] * following[:, 1] - edges[:, 1] * following[:, 0] > 0):
        fan = np.arange(1, len(outline) - 1)
        return np.stack([np.zeros_like(fan), fan, fan + 1], 1).astype(np.int32)
    polygon = shapely.Polygon(outline, rings[1:])
    pieces = shapely.get_parts(shapely.constrained_delaunay_triangles(polygon))
    corners = shapely.get_coordinates(pieces).reshape(-1, 4, 2)[:, :3]
    number = {(x, y): k for k, (x, y) in enumerate(np.concatenate(rings).tolist())}
    triangles = np.array([[number[x, y] for x, y in corner] for corner in corners.tolist()])
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    clockwise = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0] < 0
    triangles[clockwise] = triangles[clockwise, ::-1]
    return triangles.astype(np.int32)


def extrude(
    outline: Points,
    z0: float,
    z1: float,
    *,
    holes: tuple[Points, ...] = (),
    bevel: float = 0.002,
    grain: int = 0,
) -> Mesh:
    """An upright prism over a polygon, with bevelled rims.

    outline: (N, 2) m, a simple polygon; holes: further polygons inside it. bevel: of the upper and lower
    rim (m), at most a third of the height. grain: 0 or 1, the axis that u runs along on the caps; on the
    walls u runs around for both. Walls are smooth where they turn by less than 35°. Raises ShapeError if
    the polygon is not simple, or too narrow for the bevel.
    """
    if not (z1 > z0 and bevel > 0):
        raise ShapeError(f"extrude: height ({z1 - z0:g}) and bevel ({bevel:g}) must be positive")
    cut = min(bevel, (z1 - z0) / 3)
    polygon = shapely.Polygon(np.asarray(outline, float), [np.asarray(h, float) for h in holes])
    if not polygon.is_valid or polygon.area == 0:
        raise ShapeError("extrude: the outline must be a simple polygon around its holes")
    polygon = shapely.orient_polygons(polygon)
    rings = [np.array(r.coords)[:-1] for r in (polygon.exterior, *polygon.interiors)]
    inner = [_inset(r, cut) for r in rings]
    narrow = shapely.Polygon(inner[0], inner[1:])
    if not narrow.is_valid or narrow.area >= polygon.area:
        raise ShapeError(f"extrude: the outline is too narrow for the bevel of {cut:g} m; make it smaller")
    triangles = _caps(rings)
    flat = np.concatenate(inner)
    count = len(flat)
    along = np.eye(2)[:, [0, 1] if grain == 0 else [1, 0]] * ([1, 1] if grain == 0 else [1, -1])
    vertices = [np.column_stack([flat, np.full(count, z1)]), np.column_stack([flat, np.full(count, z0)])]
    normals = [np.tile([0.0, 0.0, 1.0], (count, 1)), np.tile([0.0, 0.0, -1.0], (count, 1))]
    uvs = [flat @ along, flat @ along * [1, -1]]
    faces: list[IntArray] = [triangles, triangles[:, ::-1] + count]
    start = 2 * count
    levels = np.array([z0, z0 + cut, z1 - cut, z1])[[0, 1, 1, 2, 2, 3]]
    slope = np.sqrt(2) * cut
    rise = z1 - z0 - 2 * cut
    across = np.array([-slope, 0, 0, rise, rise, rise + slope])
    for ring, narrowed in zip(rings, inner, strict=True):
        ahead = np.roll(np.arange(len(ring)), -1)
        edges = ring[ahead] - ring
        lengths = np.linalg.norm(edges, axis=1)
        outward = np.stack([edges[:, 1], -edges[:, 0]], 1) / lengths[:, None]
        before = np.roll(outward, 1, 0)
        joint = outward + before
        joint /= np.linalg.norm(joint, axis=1, keepdims=True)
        smooth = np.sum(outward * before, 1)[:, None] > _CREASE
        left, right = np.where(smooth, joint, outward), np.where(smooth, joint, before)[ahead]
        # Axes: edge, end of the edge, level (bevel, wall and bevel have two each), coordinate.
        wall = np.empty((len(ring), 2, 6, 3))
        wall[:, 0, 1:5, :2], wall[:, 1, 1:5, :2] = ring[:, None], ring[ahead][:, None]
        wall[:, 0, ::5, :2], wall[:, 1, ::5, :2] = narrowed[:, None], narrowed[ahead][:, None]
        wall[..., 2] = levels
        wall_normals = np.empty_like(wall)
        wall_normals[:, 0, :, :2], wall_normals[:, 1, :, :2] = left[:, None], right[:, None]
        wall_normals[..., 2] = [-1, -1, 0, 0, 1, 1]
        wall_normals[:, :, [0, 1, 4, 5]] /= np.sqrt(2)
        stops = np.concatenate([[0.0], np.cumsum(lengths)])
        wall_uvs = np.empty((len(ring), 2, 6, 2))
        # At the bevel u follows the shortened edge; the mitre keeps its ends on the bisectors.
        shift = np.sum((narrowed - ring) * edges, 1) / lengths
        shift_end = np.sum((narrowed - ring)[ahead] * edges, 1) / lengths
        wall_uvs[..., 0] = np.stack([stops[:-1], stops[1:]], 1)[..., None]
        wall_uvs[:, 0, ::5, 0] += shift[:, None]
        wall_uvs[:, 1, ::5, 0] += shift_end[:, None]
        wall_uvs[..., 1] = across
        index = np.arange(len(ring) * 12).reshape(len(ring), 2, 3, 2) + start
        a, b, c, d = index[:, 0, :, 0], index[:, 1, :, 0], index[:, 1, :, 1], index[:, 0, :, 1]
        vertices.append(wall.reshape(-1, 3))
        normals.append(wall_normals.reshape(-1, 3))
        uvs.append(wall_uvs.reshape(-1, 2))
        faces.append(np.stack([a, b, c, a, c, d], -1).reshape(-1, 3).astype(np.int32))
        start += index.size
    return Mesh(
        np.concatenate(vertices),
        np.concatenate(faces).astype(np.int32),
        np.concatenate(normals),
        np.concatenate(uvs),
    )


def frame(x0: float, x1: float, y0: float, y1: float, profile: Points) -> Mesh:
    """A rectangular frame with mitred corners in the x-y plane, as around a picture.

    profile: (P, 2) rows (inward distance from the outer rectangle, z) m, a closed loop. u runs along each
    side. Corners of the profile of more than 35° are edges. Raises ShapeError if the sides would meet.
    """
    profile = np.asarray(profile, float)
    if profile[:, 0].min() < -1e-9 or 2 * profile[:, 0].max() >= min(x1 - x0, y1 - y0):
        raise ShapeError("frame: the profile must lie between the rectangle and its middle; make it narrower")
    shoelace = np.sum(profile[:, 0] * np.roll(profile[:, 1], -1) - np.roll(profile[:, 0], -1) * profile[:, 1])
    if shoelace < 0:
        profile = profile[::-1]
    steps = np.roll(profile, -1, 0) - profile
    widths = np.linalg.norm(steps, axis=1)
    outward = np.stack([steps[:, 1], -steps[:, 0]], 1) / widths[:, None]
    before = np.roll(outward, 1, 0)
    joint = outward + before
    joint /= np.linalg.norm(joint, axis=1, keepdims=True)
    smooth = np.sum(outward * before, 1)[:, None] > _CREASE
    ahead = np.roll(np.arange(len(profile)), -1)
    ends = np.stack(
        [np.where(smooth, joint, outward), np.where(smooth, joint, before)[ahead]], 1
    )  # (P, 2, (inward, z))
    section = np.stack([profile, profile[ahead]], 1)
    stops = np.concatenate([[0.0], np.cumsum(widths)])
    girth = np.stack([stops[:-1], stops[1:]], 1)
    inward = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]])
    corners = rectangle(x0, x1, y0, y1)
    into = np.array([[0, 1], [-1, 0], [0, -1], [1, 0]])  # from side k (corner k to k + 1) towards the middle
    along = np.array([[1, 0], [0, 1], [-1, 0], [0, -1]])
    # Axes: side, profile edge, its end, corner of the side, coordinate.
    vertices = np.empty((4, len(profile), 2, 2, 3))
    normals = np.empty_like(vertices)
    uvs = np.empty((*vertices.shape[:-1], 2))
    for side in range(4):
        for end, corner in enumerate((side, (side + 1) % 4)):
            vertices[side, :, :, end, :2] = corners[corner] + section[..., :1] * inward[corner]
        vertices[side, ..., 2] = section[..., None, 1]
        normals[side, ..., :2] = ends[:, :, None, :1] * into[side]
        normals[side, ..., 2] = ends[:, :, None, 1]
        uvs[side, ..., 0] = vertices[side, ..., :2] @ along[side]
        uvs[side, ..., 1] = -girth[..., None]
    index = np.arange(vertices.size // 3).reshape(4, len(profile), 2, 2)
    a, b, c, d = index[:, :, 0, 0], index[:, :, 0, 1], index[:, :, 1, 1], index[:, :, 1, 0]
    faces = np.stack([a, d, c, a, c, b], -1).reshape(-1, 3)
    return Mesh(vertices.reshape(-1, 3), faces.astype(np.int32), normals.reshape(-1, 3), uvs.reshape(-1, 2))
