"""Common base of the metrics of sequences in time."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.errors import EmptyMaskWarning, ShapeError
from gibench.metrics.inputs import display_pair, frame_mask
from gibench.metrics.pixelwise import Float64
from gibench.metrics.reprojection import check_motion, reproject, sample


@dataclass(frozen=True)
class TemporalError:
    """A temporal metric, with the reference's own value beside the prediction's.

    Light that depends on the view changes along a surface even in a perfect sequence, so the reference's
    value is what a perfect prediction would have.

    Attributes:
        value_frames: (T − 1,), what the metric ranks by, from each frame's predecessor to it.
        prediction_frames: (T − 1,), the quantity measured in the prediction.
        reference_frames: (T − 1,), the same quantity measured in the reference.

    All three are NaN where no pixel is visible in both frames, and the means below are over the others.
    """

    value_frames: Float64
    prediction_frames: Float64
    reference_frames: Float64

    @property
    def value(self) -> float:
        """The value that the metric ranks by."""
        return _mean(self.value_frames)

    @property
    def prediction(self) -> float:
        """The quantity measured in the prediction."""
        return _mean(self.prediction_frames)

    @property
    def reference(self) -> float:
        """The quantity measured in the reference."""
        return _mean(self.reference_frames)


def temporal_error(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    motion: ArrayLike | None,
    visible: ArrayLike | None,
    quantity: Callable[[Float64], float],
    value: Callable[[Float64, Float64], float],
) -> TemporalError:
    """Measure how each frame differs from the one before it, brought along the motion.

    Args:
        pred: display values in [0, 1], (T, H, W, 3), T ≥ 2.
        ref: the reference, of the same shape.
        motion: (T, H, W, 2), see `reprojection`; None compares pixels that lie at the same place.
        visible: booleans (T, H, W), see `reprojection.visibility`; None lets every pixel count. Frame 0 of
            either is not looked at.
        quantity: what is measured in prediction and reference, from the differences (pixels, 3) of a step.
        value: what the metric ranks by, from both differences.

    Returns:
        All steps; NaN, with an `EmptyMaskWarning`, for those without a visible pixel.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: as their names say.
    """
    prediction, reference, batched = display_pair(pred, ref)
    if not batched or len(reference) < 2:
        raise ShapeError(f"a sequence must be (T, H, W, 3) with at least two frames, not {np.shape(ref)}")
    movement = None if motion is None else check_motion(motion)
    if movement is not None and movement.shape[:3] != reference.shape[:3]:
        raise ShapeError(f"motion has shape {movement.shape} beside frames of shape {reference.shape}")
    masks = frame_mask(visible, reference, batched)

    steps, hidden = [], []
    for frame in range(1, len(reference)):
        mask = np.ones(reference.shape[1:3], dtype=bool) if masks is None else masks[frame]
        if not mask.any():
            hidden.append(str(frame))
            steps.append((math.nan, math.nan, math.nan))
            continue
        taps = None if movement is None else reproject(movement[frame])
        changes = []
        for frames in (prediction, reference):
            before = frames[frame - 1] if taps is None else sample(frames[frame - 1], taps)
            changes.append(frames[frame][mask].astype(np.float64) - before[mask])
        steps.append((value(*changes), quantity(changes[0]), quantity(changes[1])))
    if hidden:
        warnings.warn(
            f"frame {', '.join(hidden)}: no pixel is visible in the frame before, so the value is NaN",
            EmptyMaskWarning,
            stacklevel=3,
        )
    return TemporalError(*np.array(steps, dtype=np.float64).T)


def _mean(values: Float64) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if known.size else math.nan
