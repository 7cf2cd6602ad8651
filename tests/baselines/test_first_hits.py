"""Averages over the rays of a pixel, on the device."""

from __future__ import annotations

import numpy as np
import pytest

from gibench.rendering.backend import select_variant

select_variant("auto")

import drjit as dr  # noqa: E402
import mitsuba as mi  # noqa: E402

from gibench.baselines.first_hits import averaged  # noqa: E402


@pytest.mark.parametrize("grid", [1, 2, 4])
def test_a_pixel_is_the_mean_of_its_rays(grid):
    width, height = 5, 3
    lanes = np.random.default_rng(1).random((3, height * grid * width * grid), dtype=np.float32)
    lanes[1] = 0.25
    values = mi.Color3f(mi.Float(lanes[0]), mi.Float(0.25), mi.Float(lanes[2]))  # a constant has one lane
    image = averaged(values, (width * grid, height * grid), grid)
    assert isinstance(image, mi.TensorXf)
    wanted = lanes.reshape(3, height, grid, width, grid).mean(axis=(2, 4), dtype=np.float64)
    np.testing.assert_allclose(np.asarray(image), np.moveaxis(wanted, 0, -1), rtol=1e-6)


def test_one_kernel_serves_all_sizes():
    def launched(size: int) -> list[str]:
        values = dr.arange(mi.Float, 3 * size * size)
        dr.eval(values)
        with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
            dr.kernel_history_clear()
            averaged(mi.Color3f(values), (3 * size, size), 2)
            return [kernel["hash"] for kernel in dr.kernel_history() if kernel["type"] == dr.KernelType.JIT]

    assert launched(4) == launched(6) != []
