"""Temporal difference: does the prediction change as the reference does."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.registry import register
from gibench.metrics.sequence import TemporalError, temporal_error


@register(
    name="temporal_difference",
    direction="lower",
    range=(0.0, 2.0),
    identity=0.0,
    units="1",
    values="display",
    inputs="sequence",
    reference="Chaitanya et al. 2017, ACM TOG 36(4)",
)
def temporal_difference(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    motion: ArrayLike | None = None,
    visible: ArrayLike | None = None,
) -> TemporalError:
    """Temporal difference, mean |ΔI_pred − ΔI_ref|, ΔI being a frame less the one before it.

    Unlike `warping_error` it is 0 for a perfect prediction whatever the light does, and a prediction that is
    wrong but steady costs nothing.

    Args:
        pred: display values in [0, 1], (T, H, W, 3), T ≥ 2, all under one exposure (`tone_map`).
        ref: the reference, of the same shape.
        motion: (T, H, W, 2), exact motion in pixels to the frame before, along which that frame is brought to
            this one: column, then row; frame 0 is ignored. None compares pixels at the same place.
        visible: booleans (T, H, W), True where the point was seen in the frame before too; see
            `gibench.metrics.visibility`. None lets every pixel count.

    Returns:
        A `TemporalError` whose value lies in [0, 2], with mean |ΔI| of either sequence beside it.
        A frame without a visible pixel gives NaN with an `EmptyMaskWarning`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are no such sequences.

    References:
        Chaitanya et al. 2017, Interactive reconstruction of Monte Carlo image sequences using a recurrent
        denoising autoencoder, ACM Transactions on Graphics 36(4) (the temporal loss, there without motion).
    """
    return temporal_error(
        pred,
        ref,
        motion=motion,
        visible=visible,
        quantity=lambda change: float(np.mean(np.abs(change))),
        value=lambda p, r: float(np.mean(np.abs(p - r))),
    )
