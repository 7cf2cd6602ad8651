"""What changes from frame to frame is no part of a kernel: compiling one takes longer than many frames do."""

import pytest

from gibench.rendering.backend import is_scalar
from gibench.rendering.camera import PinholeCamera
from gibench.rendering.channels import SETS
from gibench.rendering.render import render_frame
from gibench.rendering.scene import load_dict
from tests.rendering import scenes

FRAMES = 10


@pytest.fixture(scope="module")
def scene():
    if is_scalar():
        pytest.skip("nothing is compiled")
    return load_dict(scenes.closed_box(0.5, 1.0))


def camera(step: float) -> PinholeCamera:
    return PinholeCamera(
        (0.3 - 0.02 * step, 0.4, 0.5), (-0.2, 0.01 * step, -0.1 * step - 0.1), 1.0 + 0.01 * step
    )


def kernels_of(render) -> set[str]:
    """What a call launches, by the digest of its code."""
    import drjit as dr

    with dr.scoped_set_flag(dr.JitFlag.KernelHistory, True):
        dr.kernel_history_clear()
        render()
        return {kernel["hash"] for kernel in dr.kernel_history() if "operation_count" in kernel}


@pytest.mark.parametrize("name", SETS)
def test_ten_frames_share_the_kernels_of_the_first(scene, name):
    launched = [
        kernels_of(
            lambda step=step: render_frame(
                scene,
                camera(step),
                resolution=(16 + step, 12),
                channels=[name],
                spp=4,
                seed=step,
                previous_camera=camera(step - 1),
            )
        )
        for step in range(FRAMES)
    ]
    assert launched[0]
    assert all(kernels == launched[0] for kernels in launched[1:])


def test_the_first_frame_of_a_path_has_no_motion_to_compute(scene):
    options = {"resolution": (16, 12), "channels": ["motion"]}
    assert kernels_of(lambda: render_frame(scene, camera(0), **options)) == set()


def test_kernels_are_told_apart(scene):
    """The count is one that can fail: a number of Python's in a kernel makes another."""
    import drjit as dr
    import mitsuba as mi

    def compiled(number):
        return kernels_of(lambda: dr.eval(dr.arange(mi.Float, 8) * number))

    assert compiled(0.25) != compiled(0.75)
