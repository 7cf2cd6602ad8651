"""MABD: mean absolute brightness differences, of the prediction against the reference."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.pixelwise import Float64
from gibench.metrics.registry import register
from gibench.metrics.sequence import TemporalError, temporal_error
from gibench.metrics.tone_map import LUMINANCE


@register(
    name="mabd",
    direction="lower",
    range=(0.0, 1.0),
    identity=0.0,
    units="1",
    values="display",
    inputs="sequence",
    reference="Jiang & Zheng 2019, ICCV",
)
def mabd(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    motion: ArrayLike | None = None,
    visible: ArrayLike | None = None,
) -> TemporalError:
    """Squared difference of the mean absolute brightness differences (MABD) of prediction and reference.

    The MABD of a step is mean |b_t − b_{t−1}|, b being the luma of the display values; the value is the mean
    over the steps of (MABD_pred − MABD_ref)². In the published form, without motion, pixels at the same place
    are compared. Gao et al. 2022 use the name for `warping_error`.

    Args:
        pred: display values in [0, 1], (T, H, W, 3), T ≥ 2, all under one exposure (`tone_map`).
        ref: the reference, of the same shape.
        motion: None as published, or (T, H, W, 2), exact motion in pixels to the frame before: column, then
            row; frame 0 is ignored.
        visible: booleans (T, H, W), True where the point was seen in the frame before too; see
            `gibench.metrics.visibility`. None lets every pixel count.

    Returns:
        A `TemporalError` whose value lies in [0, 1], with both MABDs beside it.
        A frame without a visible pixel gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are no such sequences.

    References:
        Jiang & Zheng 2019, Learning to see moving objects in the dark, ICCV, section 5.
    """

    def quantity(change: Float64) -> float:
        return float(np.mean(np.abs(change @ LUMINANCE)))

    return temporal_error(
        pred,
        ref,
        motion=motion,
        visible=visible,
        quantity=quantity,
        value=lambda p, r: (quantity(p) - quantity(r)) ** 2,
    )
