"""How much of the light of environments few wavelets hold: rendered panoramas beside real maps."""

import numpy as np
import pytest

from gibench.baselines.wavelets.haar import haar
from gibench.baselines.wavelets.selection import POWERS, energy_kept, largest
from gibench.datasets.environment_panoramas import make_environments
from gibench.generators.environments.files import environment_files, read_environment
from gibench.rendering.cubemap import to_cubemap

pytestmark = pytest.mark.performance

COUNTS = (64, 245)
"""Wavelets of a frame, and 1 % of all 24,576."""


def kept(files):
    """(counts, maps, weightings) share of the energy that the largest coefficients hold."""
    shares = []
    for entry in files:
        coefficients = haar(to_cubemap(read_environment(entry.path), 64).astype(np.float64))
        shares.append(
            [[energy_kept(coefficients, largest(coefficients, count, w)) for w in POWERS] for count in COUNTS]
        )
    return np.array(shares).swapaxes(0, 1)


def test_energy_in_few_wavelets(tmp_path):
    make_environments(tmp_path / "maps", count=8, seed=7, spp=64)
    sets = {
        "indoor": environment_files("indoor"),
        "outdoor": environment_files("outdoor"),
        "rendered": environment_files(str(tmp_path / "maps")),
    }
    shares = {name: kept(files) for name, files in sets.items()}
    for name, by_count in shares.items():
        for count, values in zip(COUNTS, by_count, strict=True):
            told = ", ".join(
                f"{weighting} {100 * mean:.0f} %"
                for weighting, mean in zip(POWERS, values.mean(axis=0), strict=True)
            )
            least, most = values[:, 0].min(), values[:, 0].max()
            print(f"{name} ({len(values)}), {count} wavelets: {told}; from {least:.2f} to {most:.2f}")
    # Rendered rooms spread as the real ones do: none of them is emptier of wavelets than all real maps.
    real = np.concatenate([shares["indoor"][0], shares["outdoor"][0]])
    assert real[:, 0].min() - 0.15 < shares["rendered"][0][:, 0].mean() < real[:, 0].max()
