"""Confidence intervals of means over frames, when the frames come from rooms and the method from seeds.

Frames of one room resemble each other, so that a hundred frames of three rooms say little more than three numbers: a
room counts by the mean of its frames, and every room weighs the same. Seeds of a method that is trained are a factor
crossed with the rooms: a seed that trained badly is bad in all of them, however many there are.

Intervals are Student's, with the variances of rooms and seeds taken apart as in a two-way analysis of variance with
random effects (Searle, Casella & McCulloch 1992, Variance components, chapter 4) and the degrees of freedom of their
sum after Satterthwaite (1946, An approximate distribution of estimates of variance components, Biometrics Bulletin
2(6)). A bootstrap of three seeds knows a third too little of their variance, and nothing of how badly it knows it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import MetricInputError, NonFiniteError, ShapeError

DUST = 1e-12
"""Standard error, over the size of the values, below which it is what rounding leaves of none."""


@dataclass(frozen=True)
class Interval:
    """A mean with its confidence interval.

    Attributes:
        mean: the mean over rooms of each room's mean.
        low, high: the ends; infinite where a single value says nothing of how values differ.
        level: the confidence that it has.
        rooms, frames: how many there were. With one room it is of that room alone, from its frames.
    """

    mean: float
    low: float
    high: float
    level: float
    rooms: int
    frames: int

    @property
    def excludes_zero(self) -> bool:
        """Whether zero lies outside, so that a difference can be called one."""
        return self.low > 0 or self.high < 0


def mean_interval(values: ArrayLike, rooms: ArrayLike, *, level: float = 0.95) -> Interval:
    """The mean of a metric over rooms, and how sure it is.

    Args:
        values: (F,), the metric of each frame, in any unit; or (S, F), a row a seed of the same frames.
        rooms: (F,), the room of each frame: integers or strings.
        level: the confidence level, in (0, 1).

    Returns:
        The mean and its interval.

    Raises:
        ShapeError: when values and rooms do not fit, or are empty.
        NonFiniteError: for NaN (an empty mask) and infinity (the PSNR of equal images): leave such frames out
            knowingly, of both methods where two are compared.
        MetricInputError: for a level outside (0, 1).
    """
    table = _checked("values", values, rooms)
    return _interval(table.mean(axis=0), [table], rooms, level)


def paired_difference(
    first: ArrayLike, second: ArrayLike, rooms: ArrayLike, *, level: float = 0.95
) -> Interval:
    """The mean difference of two methods on the same frames, first less second, and how sure it is.

    Both methods meet the same easy and hard frames, so the difference is far surer than the two means are. Seeds are
    each method's own: seed 0 of one has nothing to do with seed 0 of the other.

    Args:
        first: (F,) or (S, F), the metric of each frame for one method, a row a seed.
        second: (F,) or (S', F), the same for the other, frame by frame.
        rooms: (F,), the room of each frame.
        level: see `mean_interval`.

    Returns:
        The mean difference and its interval.

    Raises:
        ShapeError, NonFiniteError, MetricInputError: see `mean_interval`.

    Examples:
        >>> kitchen, office = [0.30, 0.32], [0.10, 0.12]
        >>> worse = [value + shift for value, shift in zip(kitchen + office, [0.010, 0.010, 0.012, 0.012])]
        >>> interval = paired_difference(worse, kitchen + office, ["kitchen"] * 2 + ["office"] * 2)
        >>> round(interval.mean, 3), interval.rooms, interval.frames
        (0.011, 2, 4)
    """
    a, b = _checked("first", first, rooms), _checked("second", second, rooms)
    return _interval(a.mean(axis=0) - b.mean(axis=0), [a, b], rooms, level)


def _checked(name: str, values: ArrayLike, rooms: ArrayLike) -> NDArray[np.float64]:
    """Values as (S, F)."""
    samples, groups = np.asarray(values, dtype=np.float64), np.asarray(rooms)
    if samples.ndim not in (1, 2) or groups.shape != samples.shape[-1:] or not samples.size:
        raise ShapeError(
            f"{name} {samples.shape} and rooms {groups.shape} must be (F,) or (S, F), and (F,), with F ≥ 1"
        )
    if not np.isfinite(samples).all():
        wrong = np.argwhere(~np.isfinite(samples))
        raise NonFiniteError(f"{name} has {len(wrong)} non-finite values, the first at frame {wrong[0][-1]}")
    return np.atleast_2d(samples)


def _interval(
    effect: NDArray[np.float64], tables: list[NDArray[np.float64]], rooms: ArrayLike, level: float
) -> Interval:
    """effect: (F,), what the mean is of. tables: (S, F) each, whose seeds it was averaged over."""
    if not 0 < level < 1:
        raise MetricInputError(f"level must lie in (0, 1), not {level}")
    names, index = np.unique(np.asarray(rooms), return_inverse=True)
    alone = len(names) == 1
    # In one room its frames are what there is of a spread.
    units = effect if alone else _by_room(effect[None], index)[0]
    mean = float(units.mean())
    variance, uncertainty = 0.0, 0.0
    if len(units) > 1:
        variance = float(units.var(ddof=1)) / len(units)
        uncertainty = variance**2 / (len(units) - 1)
    for table in tables:
        more, how_unsure = _of_seeds(table if alone else _by_room(table, index))
        variance, uncertainty = variance + more, uncertainty + how_unsure
    if len(units) == 1:
        half = np.inf
    elif np.sqrt(variance) <= DUST * max(np.abs(table).max() for table in tables):
        half = 0.0
    else:
        from scipy.stats import t

        # A sum has at least the degrees of freedom of its poorest part; what is taken out of a part can feign fewer.
        freedom = max(1.0, variance**2 / uncertainty)
        half = float(t.ppf((1 + level) / 2, freedom) * np.sqrt(variance))
    return Interval(mean, mean - half, mean + half, level, len(names), effect.size)


def _by_room(table: NDArray[np.float64], index: NDArray[np.intp]) -> NDArray[np.float64]:
    """Means of (S, F) over the frames of each room: (S, R)."""
    counts = np.bincount(index)
    return np.stack([np.bincount(index, weights=row) / counts for row in table])


def _of_seeds(table: NDArray[np.float64]) -> tuple[float, float]:
    """Contribution of seeds to the variance of the mean of (S, R), and the sum of squares over degrees of freedom.

    What a seed and a room have together is in the spread of the rooms already, and is taken out.
    """
    seeds, rooms = table.shape
    if seeds == 1 or rooms == 1:
        return 0.0, 0.0
    by_seed = table.mean(axis=1)
    rest = table - table.mean(axis=0) - by_seed[:, None] + table.mean()
    together = float((rest**2).sum()) / ((seeds - 1) * (rooms - 1)) / (seeds * rooms)
    own = float(by_seed.var(ddof=1)) / seeds
    if own <= together:
        return 0.0, 0.0
    return own - together, own**2 / (seeds - 1) + together**2 / ((seeds - 1) * (rooms - 1))
