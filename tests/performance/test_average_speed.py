"""Handing a frame over: the mean over the rays of a pixel on the device, against copying and averaging them."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.backend import select_variant
from tests.performance.turns import seconds

select_variant("auto")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from gibench.baselines.first_hits import averaged  # noqa: E402

pytestmark = pytest.mark.performance


def copied(values, resolution: tuple[int, int], grid: int) -> np.ndarray:
    width, height = resolution
    image = np.array(mi.Color3f(values), dtype=np.float32).T.reshape(height, width, 3)
    return image.reshape(height // grid, grid, width // grid, grid, 3).mean(axis=(1, 3))


@pytest.mark.parametrize("resolution", [(320, 180), (1920, 1080)])
def test_average(resolution):
    grid = 2
    fine = (resolution[0] * grid, resolution[1] * grid)
    lanes = dr.arange(mi.Float, fine[0] * fine[1])
    values = mi.Color3f(lanes * 1.0, lanes * 2.0, lanes * 3.0)
    dr.eval(values)

    def on_device() -> None:
        averaged(values, fine, grid)
        dr.sync_thread()

    device, host = seconds(on_device, lambda: copied(values, fine, grid))
    print(
        f"\n{resolution[0]} × {resolution[1]}, {grid**2} rays a pixel: {1000 * device:.1f} ms on the device, "
        f"{1000 * host:.1f} ms copied and averaged by NumPy, ratio {host / device:.0f}"
    )
