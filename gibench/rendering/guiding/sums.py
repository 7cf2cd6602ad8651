"""Sums over samples, by place, and the distributions that follow from them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.rendering.guiding.directions import BIN_AREA, BINS
from gibench.rendering.guiding.grid import FACES
from gibench.rendering.guiding.guide import Distributions
from gibench.rendering.guiding.paths import NONE, Samples
from gibench.rendering.guiding.sights import Sights

FRACTIONS = (0.0, 0.2, 0.4, 0.6)
"""Of the directions at a diffuse surface that a guide may choose; the other ones bound what it can spoil. A place has
that which would have made the least noise of the samples of the last pass. With .8 as well nothing was gained."""

LEARNING_FRACTION = 0.4
"""That of the pass which judges them."""

SPREAD = 0.5
"""Of the guide's directions that follow the root of the second moment of what they bring, which has more regard for
what is bright and rare; the others follow the mean (Rath et al. 2020)."""

FLOOR = 0.1
"""Of the guide's directions that are spread evenly."""

LIGHT_FLOOR = 0.1
"""Of the light samples that are spread over the lights as they would be without a guide."""

DOUBT = 16
"""Looks from a place at which the guide chooses half of its share: few of them tell little of directions."""

PRIOR, PRIOR_OF_DIRECTIONS = 16, 1024
"""A place counts the mean of the 27 cells around it as this many samples of its own: for the lights, whose shadows have
edges, and for directions, of which there are 256."""

FEWEST = 8
"""Samples of the first pass that make a place known."""


class Sums:
    """Of all samples so far, by row; row 0 gathers what no place is known for."""

    def __init__(self, shape: tuple[int, ...], place: NDArray[np.uint32], lights: int) -> None:
        """shape: of the grid. place: of the samples of the first pass."""
        x, y, z = shape
        visits = np.bincount(place, minlength=(x * y * z + 1) * FACES)
        places = np.flatnonzero(visits >= FEWEST)
        self.rows = np.zeros(len(visits), dtype=np.uint32)
        self.rows[places] = np.arange(len(places)) + 1
        self._near = _neighbours(self.rows[:-FACES].reshape(z, y, x, FACES), places)
        count = len(places) + 1
        self.brought, self.squares = np.zeros((count, BINS)), np.zeros((count, BINS))
        self.looks = np.zeros(count)
        self.lit, self.asked = np.zeros((count, lights)), np.zeros((count, lights))
        self.sent, self.bounced, self.met = np.zeros(count), np.zeros(count), np.zeros(count)
        self.moments, self.judged = np.zeros((count, len(FRACTIONS))), np.zeros(count)

    def add(self, samples: Samples) -> None:
        """What paths tell of the lights, and of what a place sends."""
        row = self.rows[samples.place].astype(np.int64)
        self.sent += np.bincount(row, samples.sent, minlength=len(self.sent))
        self.bounced += np.bincount(row, samples.reflected, minlength=len(self.sent))
        self.met += np.bincount(row, minlength=len(self.met))
        item = row * self.lit.shape[1] + samples.light
        self.lit += np.bincount(item, np.square(samples.lit), minlength=self.lit.size).reshape(self.lit.shape)
        self.asked += np.bincount(item, minlength=self.lit.size).reshape(self.lit.shape)

    def radiance(self) -> NDArray[np.float64]:
        """(places,) that each place sends, in the mean over the directions that it is seen from."""
        return np.asarray(self._blended(self.sent[:, None], self.met[:, None], PRIOR)[self.rows, 0])

    def _reflected(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """(E,) radiance that rows send, and what of it bounces bring, over the largest; 0 in row 0."""
        both = np.stack([self.sent, self.bounced], axis=1)
        both = self._blended(both, self.met[:, None], PRIOR)
        both[0] = 0
        both /= max(both.max(), np.finfo(np.float64).tiny)
        return both[:, 0], both[:, 1]

    def see(self, sights: Sights) -> None:
        """What looks tell of where light comes from."""
        row = self.rows[sights.place].astype(np.int64)
        item = row * BINS + sights.direction
        for sums, values in (
            (self.brought, sights.brought),
            (self.squares, np.square(sights.brought) * sights.density),
        ):
            sums += np.bincount(item, values, minlength=sums.size).reshape(sums.shape)
        self.looks += np.bincount(row, minlength=len(self.looks))

    def add_moments(self, samples: Samples, guide: Distributions) -> None:
        """Second moments of bounces by each of FRACTIONS, from samples that `guide` has not been learned from.

        Each was drawn with a known density, so its moment is known for every other one (Veach 1997, section 2.5.2).
        """
        went = (samples.direction != NONE) & (samples.density > 0)
        row, drawn = self.rows[samples.place[went]].astype(np.int64), samples.density[went].astype(np.float64)
        guided, plain = guide.directions[row, samples.direction[went]] / BIN_AREA, samples.plain[went]
        moment = np.square(samples.reflected[went]) * drawn
        for k, fraction in enumerate(FRACTIONS):
            density = (1 - fraction) * plain + fraction * guided
            values = np.divide(moment, density, out=np.zeros_like(moment), where=density > 0)
            self.moments[:, k] += np.bincount(row, values, minlength=len(self.judged))
        self.judged += np.bincount(row, minlength=len(self.judged))

    def _blended(
        self, sums: NDArray[np.float64], count: NDArray[np.float64], prior: int
    ) -> NDArray[np.float64]:
        """Means of samples, drawn towards those of the places around."""
        around = self._near @ sums / np.maximum(self._near @ count, 1)
        return np.asarray((sums + prior * around) / (count + prior))

    def fractions(self) -> NDArray[np.float64]:
        """(E,) of FRACTIONS, once all samples are judged."""
        return np.asarray(FRACTIONS)[self._mean_moments().argmin(axis=1)]

    def _mean_moments(self) -> NDArray[np.float64]:
        return self._blended(self.moments, self.judged[:, None], PRIOR_OF_DIRECTIONS)

    def gain_of_directions(self) -> float:
        """Share of the second moment of bounces that directions of the guide take away, in the mean over judged ones.

        Place by place: a sum over all of them would be that of the few brightest samples.
        """
        moments = self._mean_moments()
        plain, best = moments[:, 0], moments.min(axis=1)
        left = np.divide(best, plain, out=np.ones_like(best), where=plain > 0)
        return float(1 - self.judged @ left / self.judged.sum()) if self.judged.any() else 0.0

    def learned(
        self, plain: NDArray[np.float64], fraction: NDArray[np.float64] | float = LEARNING_FRACTION
    ) -> Distributions:
        """plain: (L,) probabilities of the lights without a guide. fraction: of directions that the guide chooses."""
        even = np.full(BINS, 1 / BINS)
        count = self.looks[:, None]
        means, known = _distributions(self._blended(self.brought, count, PRIOR_OF_DIRECTIONS), even)
        squares = self._blended(self.squares, count, PRIOR_OF_DIRECTIONS)
        spreads, _ = _distributions(np.sqrt(squares), even)
        directions = (1 - SPREAD) * means + SPREAD * spreads
        # In proportion to the root of the second moment, the variance of a light's sample is least.
        lights, _ = _distributions(np.sqrt(self._blended(self.lit, self.asked, PRIOR)), plain)
        return Distributions(
            self.rows,
            (1 - LIGHT_FLOOR) * lights + LIGHT_FLOOR * plain,
            (1 - FLOOR) * directions + FLOOR * even,
            np.where(known, fraction * self.looks / (self.looks + DOUBT), 0.0),
            *self._reflected(),
        )


def _distributions(
    values: NDArray[np.float64], otherwise: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Rows divided by their sums, and which of them are known; another distribution where a row is not, as the first.

    values: (E, N), ≥ 0. otherwise: (N,). Divided by the largest first, since sums of huge values overflow.
    """
    scaled = values / np.maximum(values.max(axis=1, keepdims=True), np.finfo(np.float64).tiny)
    total = scaled.sum(axis=1, keepdims=True)
    known = np.asarray(total[:, 0] > 0)
    known[0] = False
    return np.where(known[:, None], scaled / np.where(total > 0, total, 1), otherwise), known


def _neighbours(rows: NDArray[np.uint32], places: NDArray[np.int64]) -> Any:
    """Sparse (E, E): 1 where two rows stand for the same face of cells that touch. rows: (z, y, x, FACES), of cells.

    places: of rows from 1 on; what lies outside comes last, and is a neighbour of itself alone.
    """
    from scipy.sparse import csr_array

    padded = np.pad(rows, ((1, 1), (1, 1), (1, 1), (0, 0)))
    cells = places[places < rows.size]
    at = np.stack(np.unravel_index(cells, rows.shape))
    outside = np.arange(len(cells), len(places)) + 1
    own, near = [outside], [outside]
    for step in np.ndindex(3, 3, 3):
        other = padded[at[0] + step[0], at[1] + step[1], at[2] + step[2], at[3]]
        own.append(np.arange(len(cells))[other > 0] + 1)
        near.append(other[other > 0])
    pairs = np.concatenate(own), np.concatenate(near).astype(np.int64)
    count = len(places) + 1
    return csr_array((np.ones(len(pairs[0])), pairs), shape=(count, count))
