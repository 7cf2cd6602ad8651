"""Materials made of others: two-sided, masked, blended, bumped. Their leaves say what a surface is made of.

Mitsuba's attributes (`BSDF.eval_attribute`) reach through a material that is the same on both sides, and through no
other. Here the tree below every material is looked at once, and lanes walk down it together.
"""

# mypy: disable-error-code="no-untyped-def, misc"
from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from gibench.rendering import flags
from gibench.rendering.backend import is_scalar, registry_key
from gibench.rendering.children import children_of

LEAF, SIDES, NESTED, MASK, BLEND = range(5)

PRINCIPLED = ("Principled", "PrincipledThin")
"""Classes of materials that evaluate all of their lobes whichever they are asked for."""

INSEPARABLE = (*PRINCIPLED, "PolarizedPlastic")
"""Classes of materials whose lobes cannot be sampled alone. `pplastic` can be asked for one, and says its density as if
the other were there too: that of its diffuse lobe integrates to .29."""

PLAIN_ETA = ("SmoothPlastic", "SmoothDielectric")
"""Classes of materials whose index of refraction is a plain number, for which Mitsuba 3.9's attribute says 0."""


@dataclass
class Leaf:
    """A leaf and its share of the surface. bsdf: pointers; weight: mi.Float in [0, 1]."""

    bsdf: Any
    weight: Any


class Layers:
    """The trees below the materials of a scene.

    depth: of the deepest one; 0 where all are leaves. principled, inseparable, transmits: whether a leaf is of one of
    the classes PRINCIPLED or INSEPARABLE, or lets light through. masked: whether a material has holes.
    """

    def __init__(self, bsdfs: list[Any]) -> None:
        """bsdfs: those of the scene's shapes, under the current variant."""
        self.depth = 0
        self.principled = False
        self.inseparable = False
        self.transmits = False
        self.masked = False
        self._blends = False
        self._nodes: dict[int, tuple[int, Any, Any]] = {}
        self._etas: dict[int, float] = {}
        self._objects = bsdfs
        for bsdf in bsdfs:
            self.depth = max(self.depth, self._look(bsdf))
        self.arrays: list[Any] = []
        if is_scalar():
            return
        columns = np.zeros((3, max(self._nodes, default=0) + 1), dtype=np.uint32)
        for key, (kind, first, second) in self._nodes.items():
            columns[:, key] = kind, registry_key("BSDFPtr", first), registry_key("BSDFPtr", second)
        etas = np.zeros(max(self._etas, default=0) + 1, dtype=np.float32)
        etas[list(self._etas)] = list(self._etas.values())
        self.arrays = [*(mi.UInt32(column) for column in columns), mi.Float(etas)]
        dr.make_opaque(self.arrays)

    def _look(self, bsdf: Any) -> int:
        """Note the tree below a material; returns its depth."""
        children = [child for child in children_of(bsdf) if isinstance(child, mi.BSDF)]
        name = bsdf.class_name()
        if not children:
            self.principled |= name in PRINCIPLED
            self.inseparable |= name in INSEPARABLE
            self.transmits |= bool(int(bsdf.flags()) & flags.TRANSMITS)
            if name in PLAIN_ETA:
                self._etas[registry_key("BSDFPtr", bsdf)] = float(mi.traverse(bsdf)["eta"])
            return 0
        first, second = children[0], children[-1]
        depth = max(self._look(child) for child in (first, second))
        if name == "TwoSidedBRDF":
            if registry_key("BSDFPtr", first) != registry_key("BSDFPtr", second):
                kind = SIDES
            elif depth == 0:
                # Attributes reach through.
                if registry_key("BSDFPtr", first) in self._etas:
                    self._etas[registry_key("BSDFPtr", bsdf)] = self._etas[registry_key("BSDFPtr", first)]
                return 0
            else:
                kind = NESTED
        elif name == "MaskBSDF":
            kind = MASK
            self.masked = True
        elif name == "BlendBSDF":
            kind = BLEND
            self._blends = True
        else:
            kind = NESTED  # bump and normal maps
        self._nodes[registry_key("BSDFPtr", bsdf)] = (kind, first, second)
        return depth + 1

    def parts(self, bsdf: Any, si: Any, active: Any) -> tuple[list[Leaf], Any]:
        """The leaves of a material, and how much of the surface is not there (a mask's holes), mi.Float in [0, 1].

        bsdf: pointers (or in scalar mode an object). The shares of the leaves and the holes sum to 1.
        """
        if self.depth == 0:
            return [Leaf(bsdf, mi.Float(1))], mi.Float(0)
        if is_scalar():
            return self._scalar_parts(bsdf, si, active, 1.0)
        return self._walk(bsdf, si, active, mi.Float(1), self.depth)

    def eta(self, bsdf: Any, si: Any, active: Any) -> Any:
        """Relative index of refraction of leaves, mi.Float; 1 where they have none."""
        if is_scalar():
            known = active and bsdf.has_attribute("eta", True)
            return bsdf.eval_attribute_1("eta", si, True) if known else mi.Float(1)
        has = active & bsdf.has_attribute("eta", active)
        eta = dr.select(has, bsdf.eval_attribute_1("eta", si, has), 1)
        if not self._etas:
            return eta
        index = dr.reinterpret_array(mi.UInt32, bsdf)
        known = dr.gather(mi.Float, self.arrays[3], index, active & (index < dr.width(self.arrays[3])))
        return dr.select(known > 0, known, eta)

    def _walk(self, bsdf, si, active, weight, depth):
        if depth == 0:
            return [Leaf(bsdf, weight)], mi.Float(0)
        index = dr.reinterpret_array(mi.UInt32, bsdf)
        # Plugins of other scenes may have larger indices; none of them is met here.
        known = active & (index < dr.width(self.arrays[0]))
        kind, first, second = (dr.gather(mi.UInt32, column, index, known) for column in self.arrays[:3])
        inner = dr.select((kind == SIDES) & (si.wi.z < 0), second, first)
        inner = dr.select(kind == LEAF, index, inner)
        is_mask, is_blend = kind == MASK, kind == BLEND
        opacity = dr.clip(bsdf.eval_attribute_1("opacity", si, active & is_mask), 0, 1)
        hole = dr.select(is_mask, weight * (1 - opacity), 0)
        weight = dr.select(is_mask, weight * opacity, weight)
        share = mi.Float(0)
        if self._blends:
            share = dr.clip(bsdf.eval_attribute_1("weight", si, active & is_blend), 0, 1)
            share = dr.select(is_blend, share, 0)
        parts, holes = self._walk(
            dr.reinterpret_array(mi.BSDFPtr, inner), si, active, weight * (1 - share), depth - 1
        )
        holes += hole
        if self._blends:
            blended = active & is_blend
            other = dr.reinterpret_array(mi.BSDFPtr, dr.select(is_blend, second, 0))
            more, more_holes = self._walk(other, si, blended, weight * share, depth - 1)
            parts, holes = parts + more, holes + more_holes
        return parts, holes

    def _scalar_parts(self, bsdf, si, active, weight):
        if not active:
            return [Leaf(bsdf, weight)], 0.0
        kind, first, second = self._nodes.get(id(bsdf), (LEAF, bsdf, bsdf))
        if kind == LEAF:
            return [Leaf(bsdf, weight)], 0.0
        if kind == MASK:
            opacity = min(max(bsdf.eval_attribute_1("opacity", si, True), 0.0), 1.0)
            parts, holes = self._scalar_parts(first, si, active, weight * opacity)
            return parts, holes + weight * (1 - opacity)
        if kind == BLEND:
            share = min(max(bsdf.eval_attribute_1("weight", si, True), 0.0), 1.0)
            parts, holes = self._scalar_parts(first, si, active, weight * (1 - share))
            more, more_holes = self._scalar_parts(second, si, active, weight * share)
            return parts + more, holes + more_holes
        inner = second if kind == SIDES and si.wi.z < 0 else first
        return self._scalar_parts(inner, si, active, weight)
