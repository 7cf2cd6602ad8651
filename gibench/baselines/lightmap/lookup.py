"""Reading a lightmap on the device: diffuse radiance at any hit of any ray."""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np
import OpenEXR
from numpy.typing import NDArray

from gibench.baselines.lightmap.unwrapping import NONE, LightmapError
from gibench.datasets.exr import DARK, fits_half
from gibench.rendering.lobes import diffuse_lobe
from gibench.rendering.scene import Scene

ATLAS, CORNERS, OFFSETS = "atlas.exr", "corners.npy", "offsets.npy"


class Lightmap:
    """The diffuse light of a scene.

    What is stored is the outgoing diffuse radiance over the value of the diffuse lobe, both seen along the normal.
    The diffuse lobes of Lambert and of a rough plastic are products of a function of the view and one of the incident
    direction, so the lobe's value at another view, at the very point that is seen, gives the radiance there: texture
    and view dependence come back exactly.
    """

    def __init__(
        self,
        scene: Scene,
        atlas: NDArray[np.float32],
        corners: NDArray[np.float32],
        offsets: NDArray[np.uint32],
    ) -> None:
        """atlas: (H, W, 3) float32. corners: (F, 3, 2) float32, in texels. offsets: (shape ids,) uint32."""
        self._scene = scene
        height, width = atlas.shape[:2]
        padded = np.zeros((height, width, 4), dtype=np.float32)
        padded[..., :3] = atlas
        self._texels = mi.Float(padded.ravel())
        # Never empty, even where nothing is diffuse.
        self._corners = mi.Float(np.append(corners.astype(np.float32).ravel(), np.zeros(6, np.float32)))
        self._offsets = mi.UInt32(offsets)
        self._last = mi.Point2i(width - 1, height - 1)
        self._width = mi.UInt32(width)
        self.arrays = {
            "texels": self._texels,
            "corners": self._corners,
            "offsets": self._offsets,
            "last": self._last,
            "width": self._width,
        }
        dr.make_opaque(self.arrays)

    def diffuse(self, si: Any, preliminary: Any, active: Any = True) -> Any:
        """Diffuse radiance that leaves hits towards si.wi, mi.Color3f in W·m⁻²·sr⁻¹; 0 where there is none.

        si: mi.SurfaceInteraction3f; preliminary: the mi.PreliminaryIntersection3f it was computed from. What a hit
        emits is not in it. Shapes without triangles give 0.
        """
        active = active & si.is_valid()
        irradiance = self.irradiance(si, preliminary, active)
        towards = mi.Vector3f(0, 0, dr.copysign(mi.Float(1), si.wi.z))
        lobe = diffuse_lobe(self._scene.layers, si.bsdf(), si, towards, active)
        return dr.select(active, irradiance * lobe, 0)

    def irradiance(self, si: Any, preliminary: Any, active: Any = True) -> Any:
        """Stored values, bilinearly interpolated: W·m⁻², the irradiance where the material is Lambert's."""
        offset = dr.gather(mi.UInt32, self._offsets, self._scene.shape_ids(si.shape, active), active)
        active = active & (offset != NONE)
        row = 3 * (offset + preliminary.prim_index)
        uv = preliminary.prim_uv
        a, b, c = (dr.gather(mi.Point2f, self._corners, row + k, active) for k in range(3))
        at = a + (b - a) * uv.x + (c - a) * uv.y - 0.5
        low = dr.floor(at)
        share = at - low
        low = mi.Point2i(low)
        x0, x1 = (dr.clip(low.x + k, 0, self._last.x) for k in (0, 1))
        y0, y1 = (dr.clip(low.y + k, 0, self._last.y) for k in (0, 1))
        upper = dr.lerp(self._texel(x0, y0, active), self._texel(x1, y0, active), share.x)
        lower = dr.lerp(self._texel(x0, y1, active), self._texel(x1, y1, active), share.x)
        return dr.lerp(upper, lower, share.y)

    def _texel(self, x, y, active):
        value = dr.gather(mi.Vector4f, self._texels, mi.UInt32(y) * self._width + mi.UInt32(x), active)
        return mi.Color3f(value.x, value.y, value.z)


def write_lightmap(
    folder: Path, atlas: NDArray[np.float32], corners: NDArray[np.float32], offsets: NDArray[np.uint32]
) -> None:
    """Files that `read_lightmap` reads; the atlas as half floats where they can hold it, else in single precision."""
    lit = atlas[atlas > 0]
    half = fits_half(atlas, dark=DARK * float(np.median(lit))) if lit.size else True
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    pixels = np.ascontiguousarray(atlas, dtype=np.float16 if half else np.float32)
    content = io.BytesIO()  # OpenEXR says of a full disk only that something failed
    OpenEXR.File(header, {"RGB": pixels}).write(content)
    (folder / ATLAS).write_bytes(content.getvalue())
    np.save(folder / CORNERS, corners)
    np.save(folder / OFFSETS, offsets)


def read_lightmap(folder: Path, scene: Scene) -> Lightmap:
    """The lightmap of a scene. Raises LightmapError where its files are missing, damaged, or another scene's."""
    try:
        atlas = OpenEXR.File(str(folder / ATLAS)).channels()["RGB"].pixels
        corners, offsets = np.load(folder / CORNERS), np.load(folder / OFFSETS)
    except (OSError, EOFError, ValueError, RuntimeError, KeyError) as problem:
        raise LightmapError(
            f"the lightmap in {folder} cannot be read ({problem}): remove that folder"
        ) from problem
    if len(offsets) != len(scene.shapes) + 1:
        raise LightmapError(f"the lightmap in {folder} is another scene's: remove that folder")
    return Lightmap(scene, atlas.astype(np.float32), corners, offsets)
