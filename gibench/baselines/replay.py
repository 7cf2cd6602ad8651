"""Kernels that methods replay: `gibench.rendering.replay` under the name that methods know it by."""

from gibench.rendering.replay import Replay, arrays_of, camera_arrays, ray_generator

__all__ = ["Replay", "arrays_of", "camera_arrays", "ray_generator"]
