"""Quadratic errors against the truth, of which there are two independent estimates from samples.

A reference that was denoised is nearer to the truth than its samples, but biased, and an error against it counts what
the denoiser left out as if the method had it wrong. The samples are not biased: with estimates t₁ and t₂ of the truth T
whose errors are independent of each other and of a prediction m,

    E[(m − t₁)(m − t₂)] = (m − T)²

whatever their noise is. The same is true after weights that depend on neither, and of display values to first order:
their curve is replaced by its tangent at the reference, so that noise stays linear, and what is left is of the second
order in the reference's own error. Fireflies therefore cost precision, but no bias. The mean over an image may come out
below 0 for a prediction as good as the truth; values are then 0, and who asks is told.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from gibench.metrics.errors import ShapeError, UnknownMetricError
from gibench.metrics.inputs import FloatArray, check_radiance, float_array
from gibench.metrics.registry import Descriptor, metric
from gibench.metrics.tone_map import display_slope, tone_map

Float64 = NDArray[np.float64]

BLOCK_ROWS = 32
"""Rows worked on at a time, so that float64 and its temporaries stay small."""


@dataclass(frozen=True)
class Unbiased:
    """A value of a metric. mean_square: what it is of, which has no bias and may be below 0; the value then is of 0."""

    value: float
    mean_square: float

    @property
    def clipped(self) -> bool:
        """Whether the estimate was below 0, which no error is."""
        return self.mean_square < 0


@dataclass(frozen=True, eq=False)
class Truth:
    """What is known of the true image, all (H, W, 3) linear radiance in Rec. 709 RGB.

    samples: two estimates without bias and with independent errors. halves: the same two denoised, each from its own
    samples alone; of references that are not denoised the samples themselves, which leaves fewer metrics that it
    `knows`. exposure: for display values.

    Raises DtypeError, ShapeError, NonFiniteError, RangeError for inputs that are not such images.
    """

    samples: tuple[FloatArray, FloatArray]
    halves: tuple[FloatArray, FloatArray]
    exposure: float

    def __post_init__(self) -> None:
        """Check the images."""
        named = {"samples": self.samples, "halves": self.halves}
        for name, images in named.items():
            for image in images:
                check_radiance(name, float_array(name, image))
                self._like(name, image)

    def _like(self, name: str, image: FloatArray) -> None:
        if image.shape != self.halves[0].shape or image.ndim != 3 or image.shape[-1] != 3:
            raise ShapeError(f"{name} has shape {image.shape} beside {self.halves[0].shape}")

    @cached_property
    def reference(self) -> FloatArray:
        """The mean of the halves."""
        return 0.5 * (self.halves[0] + self.halves[1])

    @cached_property
    def _is_smooth(self) -> bool:
        """Whether the reference has less noise than the samples: it was denoised, or there is none in black."""
        same = all(np.array_equal(half, own) for half, own in zip(self.halves, self.samples, strict=True))
        return not same or not self.reference.any()

    def knows(self, name: str) -> bool:
        """Whether a metric has no bias here: a mean of squares whose weights and tangents, which are taken at the
        reference, do not follow the noise of the samples.
        """
        if not is_quadratic(name):
            return False
        descriptor = metric(name)
        return self._is_smooth or (descriptor.values != "display" and descriptor.weight is None)

    def error(self, name: str, pred: FloatArray) -> Unbiased:
        """A quadratic metric of a prediction (H, W, 3), whose errors are independent of those of the samples.

        Raises UnknownMetricError for a metric that is not quadratic, and as for the images of the truth.
        """
        descriptor = _quadratic(name)
        check_radiance("pred", float_array("pred", pred))
        self._like("pred", pred)

        def products(rows: slice) -> Float64:
            image = self._seen(descriptor, pred, rows)
            return np.multiply(*(image - self._sampled(descriptor, sample, rows) for sample in self.samples))

        return self._value(descriptor, products)

    def error_of_reference(self, name: str) -> Unbiased:
        """What the reference itself would get, though its errors are not independent of the samples'.

        Those of a half are independent of the samples of the other. With halves a, b and samples s, t of the same
        renderings, all squares of noise cancel in ½((a − t)² + (b − s)² − (s − t)²), whose mean is that of the squared
        errors of a and b; and of the squared error of their mean it is that less ¼(a − b)².
        """
        descriptor = _quadratic(name)

        def products(rows: slice) -> Float64:
            a, b = (self._seen(descriptor, half, rows) for half in self.halves)
            s, t = (self._sampled(descriptor, sample, rows) for sample in self.samples)
            # (a − t)² + (b − s)² − (s − t)² without the difference of large squares.
            crossed = 0.5 * ((a - s) * (a + s - 2 * t) + (b - t) * (b + t - 2 * s) + np.square(s - t))
            return np.asarray(crossed - 0.25 * np.square(a - b))

        return self._value(descriptor, products)

    def _value(self, descriptor: Descriptor, products: Callable[[slice], Float64]) -> Unbiased:
        mean = math.fsum(float(products(rows).sum()) for rows in self._rows()) / self.halves[0].size
        return _value_of(descriptor, mean)

    def _rows(self) -> Iterator[slice]:
        for first in range(0, len(self.halves[0]), BLOCK_ROWS):
            yield slice(first, first + BLOCK_ROWS)

    def _seen(self, descriptor: Descriptor, image: FloatArray, rows: slice) -> Float64:
        """Rows of an image as the metric takes differences of them."""
        values = image[rows].astype(np.float64)
        if descriptor.values == "display":
            return np.asarray(tone_map(values, self.exposure))
        return self._weighted(descriptor, values, rows)

    def _sampled(self, descriptor: Descriptor, sample: FloatArray, rows: slice) -> Float64:
        """The same of samples: a linear function of them."""
        values = sample[rows].astype(np.float64)
        if descriptor.values == "display":
            at = self.reference[rows].astype(np.float64)
            return np.asarray(tone_map(at, self.exposure) + display_slope(at, self.exposure) * (values - at))
        return self._weighted(descriptor, values, rows)

    def _weighted(self, descriptor: Descriptor, values: Float64, rows: slice) -> Float64:
        if descriptor.weight is None:
            return values
        return np.asarray(values * descriptor.weight(self.reference[rows].astype(np.float64)))


def mean_of(name: str, found: Sequence[Unbiased]) -> Unbiased:
    """The value of a metric of several images of one size together. Raises UnknownMetricError."""
    return _value_of(_quadratic(name), math.fsum(one.mean_square for one in found) / len(found))


def is_quadratic(name: str) -> bool:
    """Whether a metric is decided by a mean of squares, so that samples of the truth give it without bias."""
    return metric(name).of_mean_square is not None


def _value_of(descriptor: Descriptor, mean_square: float) -> Unbiased:
    assert descriptor.of_mean_square is not None
    return Unbiased(float(descriptor.of_mean_square(max(mean_square, 0.0))), mean_square)


def _quadratic(name: str) -> Descriptor:
    if not is_quadratic(name):
        raise UnknownMetricError(f"{name} is no mean of squares: it is only known against the reference")
    return metric(name)
