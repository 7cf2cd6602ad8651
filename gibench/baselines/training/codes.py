"""Codes of radiance: what networks take and predict in place of numbers that span nine powers of ten.

Each has `encode` and `decode`; `decode` takes any number that a network may say, and what it gives is finite, at most
`largest` in magnitude. A radiance above that is encoded as `largest`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Protocol

import torch
from torch import Tensor

from gibench.baselines.training.errors import TrainingError

LEAST_SLOPE = 0.02
"""Of `Exponential`, per unit of the exponent: exp itself has 1e-6 of slope where it is 1e-6."""

LARGEST = 1e5
"""Radiance that is still told from a larger one, unless it is given."""


class Code(Protocol):
    """A one-to-one map between radiance and numbers of order one."""

    @property
    def largest(self) -> float:
        """Bound of what `decode` gives."""

    def encode(self, radiance: Tensor) -> Tensor:
        """From radiance."""

    def decode(self, code: Tensor) -> Tensor:
        """To radiance, in single precision at least."""


@dataclass(frozen=True)
class LogCode:
    """Radiance in [0, largest] to [−1, 1]: log(x + 1/e), scaled so that 0 becomes −1 and the largest 1.

    Gao et al. 2020 (Deferred Neural Lighting) encode images like this, and the logarithm of Neural Global Illumination,
    equation 6, fits it with ε = 1/e. It is computed as log1p(e·x), which is the same and does not cancel near 0.
    In single precision a code is known to 6e-8, so radiance near 0 to 6e-8 · ln(1 + e · largest) / 2e.
    """

    largest: float = LARGEST

    def __post_init__(self) -> None:
        """Raises TrainingError for a range that is empty or has no end."""
        _check("largest", self.largest)

    @property
    def _span(self) -> float:
        return math.log1p(math.e * self.largest)

    def encode(self, radiance: Tensor) -> Tensor:
        """Negative radiance counts as 0."""
        return torch.log1p(math.e * radiance.clamp(0, self.largest)) * (2 / self._span) - 1

    def decode(self, code: Tensor) -> Tensor:
        """To [0, largest]."""
        share = (_at_least_single(code).clamp(-1, 1) + 1) * (self._span / 2)
        return (torch.expm1(share) / math.e).clamp(max=self.largest)


@dataclass(frozen=True)
class MuLaw:
    """Signed numbers by sign(x) · log(μ|x| + 1) / log(μ + 1), which leaves −1, 0 and 1 where they are.

    For wavelet coefficients and transport (the μ-law of telephony, ITU-T G.711). The offset is 1, for only then is the
    code continuous at 0.
    """

    mu: float = 10.0
    largest: float = LARGEST

    def __post_init__(self) -> None:
        """Raises TrainingError for a constant that is no positive number."""
        _check("mu", self.mu)
        _check("largest", self.largest)

    def encode(self, radiance: Tensor) -> Tensor:
        """Any sign."""
        size = radiance.abs().clamp(max=self.largest)
        return radiance.sign() * torch.log1p(self.mu * size) * (1 / math.log1p(self.mu))

    def decode(self, code: Tensor) -> Tensor:
        """To [−largest, largest]."""
        code = _at_least_single(code)
        highest = math.log1p(self.mu * self.largest)
        size = torch.expm1((code.abs() * math.log1p(self.mu)).clamp(max=highest)) / self.mu
        return code.sign() * size.clamp(max=self.largest)


@dataclass(frozen=True)
class Exponential:
    """Positive radiance as exp of what a network says (Gai et al., section 3.3): a factor of exposure is a shift.

    The exponent is held within [log smallest, log largest]; radiance below the smallest, 0 too, is encoded as that.
    """

    largest: float = LARGEST
    smallest: float = 1e-6

    def __post_init__(self) -> None:
        """Raises TrainingError for bounds that are no positive numbers, or the wrong way round."""
        _check("largest", self.largest)
        _check("smallest", self.smallest)
        if self.smallest >= self.largest:
            raise TrainingError(f"a code from {self.smallest} to {self.largest} holds nothing")

    def encode(self, radiance: Tensor) -> Tensor:
        """The logarithm."""
        return radiance.clamp(self.smallest, self.largest).log()

    def decode(self, code: Tensor) -> Tensor:
        """To [smallest, largest].

        Outside of the bounds gradients that lead back pass, as at the bound, and the slope is LEAST_SLOPE at least.
        Without either, a network that overshoots in its first steps has no gradient left and learns nothing again.
        """
        light: Tensor = _Bounded.apply(_at_least_single(code), self.smallest, self.largest)
        return light


class _Bounded(torch.autograd.Function):
    """exp within bounds; see `Exponential.decode`."""

    @staticmethod
    def forward(ctx: Any, code: Tensor, smallest: float, largest: float) -> Tensor:
        ctx.bounds = math.log(smallest), math.log(largest)
        light = code.clamp(*ctx.bounds).exp().clamp(smallest, largest)
        ctx.save_for_backward(code, light)
        return light

    @staticmethod
    def backward(ctx: Any, *gradients: Tensor) -> tuple[Tensor, None, None]:
        code, light = ctx.saved_tensors
        lowest, highest = ctx.bounds
        (gradient,) = gradients
        # Descending, a negative gradient makes more light.
        passes = ((code >= lowest) | (gradient < 0)) & ((code <= highest) | (gradient > 0))
        return gradient * light.clamp(min=LEAST_SLOPE) * passes, None, None


def _at_least_single(code: Tensor) -> Tensor:
    return code if code.dtype == torch.float64 else code.float()


def _check(name: str, value: float) -> None:
    if not (math.isfinite(value) and value > 0):
        raise TrainingError(f"a code's {name} must be a number above 0, not {value!r}")
