"""How sure a mean over frames is, when the frames come from rooms.

Frames of one room resemble each other, so that a hundred frames of three rooms say little more than three
numbers. The bootstrap here draws rooms first and then frames inside each room (Davison & Hinkley 1997,
Bootstrap methods and their application, section 3.8). Every room weighs the same, however many frames it has.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from gibench.metrics.errors import MetricInputError, NonFiniteError, ShapeError

RESAMPLES = 4000
"""Enough that the ends of a 95 % interval move by a few percent of its width from seed to seed."""


@dataclass(frozen=True)
class Interval:
    """A mean with its confidence interval.

    Attributes:
        mean: the mean over rooms of each room's mean.
        low, high: the ends of the percentile interval.
        level: the confidence that it is meant to have.
        rooms, frames: how many there were. With fewer than about ten rooms such an interval is too narrow.
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


def mean_interval(
    values: ArrayLike, rooms: ArrayLike, *, level: float = 0.95, resamples: int = RESAMPLES, seed: int = 0
) -> Interval:
    """Bootstrap the mean of a metric over rooms and frames.

    Args:
        values: (F,), the metric of each frame, in any unit.
        rooms: (F,), the room of each frame: integers or strings.
        level: the confidence level, in (0, 1).
        resamples: how many times rooms and frames are drawn.
        seed: of the draws; the same seed gives the same interval.

    Returns:
        The mean and its percentile interval.

    Raises:
        ShapeError: when values and rooms are not two lists of one length, or are empty.
        NonFiniteError: for NaN (an empty mask) and infinity (the PSNR of equal images): leave such frames out
            knowingly, of both methods where two are compared.
        MetricInputError: for a level outside (0, 1) or no resamples.
    """
    samples = np.asarray(values, dtype=np.float64)
    groups = np.asarray(rooms)
    if samples.ndim != 1 or samples.shape != groups.shape or not samples.size:
        raise ShapeError(
            f"values {samples.shape} and rooms {groups.shape} must be two lists of one length ≥ 1"
        )
    if not np.isfinite(samples).all():
        wrong = np.flatnonzero(~np.isfinite(samples))
        raise NonFiniteError(f"values has {len(wrong)} non-finite values, the first at frame {wrong[0]}")
    if not 0 < level < 1 or resamples < 1:
        raise MetricInputError(
            f"level must lie in (0, 1) and resamples be positive, not {level} and {resamples}"
        )

    names, index = np.unique(groups, return_inverse=True)
    members = [samples[index == room] for room in range(len(names))]
    means = _resampled_means(members, resamples, np.random.default_rng(seed))
    low, high = np.quantile(means, [(1 - level) / 2, (1 + level) / 2])
    mean = float(np.mean([room.mean() for room in members]))
    return Interval(mean, float(low), float(high), level, len(names), samples.size)


def paired_difference(
    first: ArrayLike,
    second: ArrayLike,
    rooms: ArrayLike,
    *,
    level: float = 0.95,
    resamples: int = RESAMPLES,
    seed: int = 0,
) -> Interval:
    """Bootstrap the mean difference of two methods on the same frames, first less second.

    Both methods meet the same easy and hard frames, so the difference is far surer than the two means are.

    Args:
        first: (F,), the metric of each frame for one method.
        second: (F,), the same for the other, frame by frame.
        rooms: (F,), the room of each frame.
        level, resamples, seed: see `mean_interval`.

    Returns:
        The mean difference and its interval.

    Raises:
        ShapeError, NonFiniteError, MetricInputError: see `mean_interval`.
    """
    a, b = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    if a.shape != b.shape:
        raise ShapeError(f"first has shape {a.shape} and second {b.shape}: a pair needs the same frames")
    with np.errstate(invalid="ignore"):  # ∞ − ∞ becomes NaN, which is refused below
        return mean_interval(a - b, rooms, level=level, resamples=resamples, seed=seed)


def _resampled_means(
    members: list[NDArray[np.float64]], resamples: int, rng: np.random.Generator
) -> NDArray[np.float64]:
    # Room by room: how often each resample drew the room, and the mean of the frames drawn each time.
    counts = rng.multinomial(len(members), np.full(len(members), 1 / len(members)), size=resamples)
    totals = np.zeros(resamples)
    for room, times in zip(members, counts.T, strict=True):
        draws = room[rng.integers(len(room), size=(int(times.sum()), len(room)))].mean(axis=1)
        np.add.at(totals, np.repeat(np.arange(resamples), times), draws)
    return totals / len(members)
