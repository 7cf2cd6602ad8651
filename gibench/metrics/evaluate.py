"""Several metrics on linear images at once, as one tidy row."""

from __future__ import annotations

from collections.abc import Iterable
from functools import cached_property
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from gibench.metrics.errors import ShapeError, UnknownMetricError
from gibench.metrics.inputs import FloatArray, MetricValue, linear_pair
from gibench.metrics.registry import Descriptor, metric
from gibench.metrics.tone_map import reference_exposure, tone_map

Row = dict[str, MetricValue]


def evaluate(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    metrics: Iterable[str],
    mask: ArrayLike | None = None,
    exposure: ArrayLike | None = None,
) -> Row:
    """Compute image metrics of linear radiance; display metrics see it through `tone_map`.

    Args:
        pred: linear radiance, (H, W, 3) or (N, H, W, 3), W·m⁻²·sr⁻¹ in Rec. 709 RGB.
        ref: the reference, of the same shape.
        metrics: names of image metrics in the registry.
        mask: booleans (H, W) or (N, H, W), True where a pixel counts.
        exposure: None takes `reference_exposure` of each frame; a number or (N,) overrides it, for instance
            to look at a layer of an image under the exposure of the whole.

    Returns:
        "exposure" and each metric's name with its value: floats for one image, arrays (N,) for a batch.
        Either makes a table at once: `pandas.DataFrame([row])` or `pandas.DataFrame(row)`.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are not such images.
        UnknownMetricError: for a name that is not in the registry, a metric of sequences, or one that takes
            no mask where there is one.

    Examples:
        >>> import numpy as np
        >>> ref = np.full((16, 16, 3), 2.0)
        >>> {name: round(value, 3) for name, value in evaluate(ref, ref, metrics=["relmse", "ssim"]).items()}
        {'exposure': 0.09, 'relmse': 0.0, 'ssim': 1.0}
    """
    chosen = _choose(metrics, "image")
    if mask is not None:
        for descriptor in chosen:
            if not descriptor.accepts("mask"):
                raise UnknownMetricError(f"{descriptor.name} takes no mask: evaluate it apart, without one")
    prediction, reference, batched = linear_pair(pred, ref)
    if not batched:
        prediction, reference = prediction[0], reference[0]
    factor = np.asarray(reference_exposure(reference) if exposure is None else exposure, dtype=np.float64)
    if factor.shape not in ((), reference.shape[:-3]):
        raise ShapeError(f"exposure has shape {factor.shape} for an image of shape {reference.shape}")
    pair = _Displayed(prediction, reference, factor)
    row: Row = {"exposure": np.broadcast_to(factor, len(reference)).copy() if batched else float(factor)}
    keywords = {} if mask is None else {"mask": mask}
    values: dict[str, MetricValue] = {}

    def value(descriptor: Descriptor) -> MetricValue:
        if descriptor.name not in values:
            if descriptor.derived is None:
                values[descriptor.name] = descriptor(*pair.pair_for(descriptor), **keywords)
            else:
                base, derive = descriptor.derived
                values[descriptor.name] = derive(value(metric(base)))
        return values[descriptor.name]

    return row | {descriptor.name: value(descriptor) for descriptor in chosen}


def evaluate_sequence(
    pred: ArrayLike,
    ref: ArrayLike,
    *,
    metrics: Iterable[str],
    motion: ArrayLike,
    visible: ArrayLike,
    exposure: float | None = None,
) -> Row:
    """Compute temporal metrics of a sequence of linear radiance under one exposure.

    Args:
        pred: linear radiance, (T, H, W, 3), T ≥ 2.
        ref: the reference, of the same shape.
        metrics: names of sequence metrics in the registry.
        motion: (T, H, W, 2), pixels to the frame before; `mabd` is taken along it as well.
        visible: booleans (T, H, W), see `gibench.metrics.visibility`.
        exposure: None takes the `reference_exposure` that all frames share.

    Returns:
        "exposure", and for each metric its value under its name, and what was measured in the prediction and
        in the reference under that name with "_prediction" and "_reference"; all floats.

    Raises:
        DtypeError, ShapeError, NonFiniteError, RangeError: for inputs that are no such sequences.
        UnknownMetricError: for a name that is not in the registry, or a metric of single images.
    """
    chosen = _choose(metrics, "sequence")
    prediction, reference, _ = linear_pair(pred, ref)
    factor = float(reference_exposure(reference, shared=True)) if exposure is None else exposure
    pair = _Displayed(prediction, reference, factor)
    row: Row = {"exposure": factor}
    for descriptor in chosen:
        error = descriptor(*pair.pair_for(descriptor), motion=motion, visible=visible)
        row[descriptor.name] = error.value
        row[f"{descriptor.name}_prediction"] = error.prediction
        row[f"{descriptor.name}_reference"] = error.reference
    return row


class _Displayed:
    """A pair of linear images and, once a metric asks, the same pair on the display."""

    def __init__(self, pred: FloatArray, ref: FloatArray, exposure: ArrayLike) -> None:
        self.linear = pred, ref
        self.exposure = exposure

    @cached_property
    def display(self) -> tuple[FloatArray, FloatArray]:
        pred, ref = self.linear
        return tone_map(pred, self.exposure), tone_map(ref, self.exposure)

    def pair_for(self, descriptor: Descriptor) -> tuple[FloatArray, FloatArray]:
        """Give the values that a metric takes."""
        return self.display if descriptor.values == "display" else self.linear


def _choose(names: Iterable[str], inputs: Literal["image", "sequence"]) -> list[Descriptor]:
    chosen = [metric(name) for name in names]
    for descriptor in chosen:
        if descriptor.inputs != inputs:
            place = "evaluate" if descriptor.inputs == "image" else "evaluate_sequence"
            raise UnknownMetricError(f"{descriptor.name} is a metric of {descriptor.inputs}s: use {place}")
    return chosen
