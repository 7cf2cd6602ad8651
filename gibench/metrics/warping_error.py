"""Warping error: how much a sequence changes along its motion."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.pixelwise import Float64
from gibench.metrics.registry import register
from gibench.metrics.sequence import TemporalError, temporal_error


@register(
    name="warping_error",
    direction="lower",
    range=(0.0, 1.0),
    identity=None,
    units="1",
    values="display",
    inputs="sequence",
    reference="Lai et al. 2018, ECCV",
)
def warping_error(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    motion: ArrayLike,
    visible: ArrayLike | None = None,
) -> TemporalError:
    """Warping error, mean (V_t − Ŵ_{t−1})² over the pixels visible in both frames and their channels.

    Ŵ is the frame before, brought to this one along the motion. Lai et al. estimate the flow and warp the
    other way; here motion is exact. Gao et al. 2022 call it MABD and tabulate it in units of 10⁻⁴; `mabd`
    is another metric. The reference enters only with its own value, so that a blurred prediction can be better
    than the truth: read both values.

    Args:
        pred: display values in [0, 1], (T, H, W, 3), T ≥ 2, all under one exposure (`tone_map`).
        ref: the reference, of the same shape.
        motion: (T, H, W, 2), exact motion in pixels to the frame before: column, then row; frame 0 is
            ignored.
        visible: booleans (T, H, W), True where the point was seen in the frame before too; see
            `gibench.metrics.visibility`. None lets every pixel count.

    Returns:
        A `TemporalError` whose value is the prediction's warping error, in [0, 1], the reference's beside it.
        A frame without a visible pixel gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are no such sequences.

    References:
        Lai, Huang, Wang, Shechtman, Yumer & Yang 2018, Learning blind video temporal consistency, ECCV,
        equations 5 and 6.
    """

    def quantity(change: Float64) -> float:
        return float(np.mean(change * change))

    return temporal_error(
        pred, ref, motion=motion, visible=visible, quantity=quantity, value=lambda p, r: quantity(p)
    )
