"""Kernels that methods replay: `gibench.rendering.replay` under the name that methods know it by."""

from gibench.rendering.replay import Replay, ReplayError, arrays_of, camera_arrays, ray_generator

__all__ = ["Replay", "ReplayError", "arrays_of", "camera_arrays", "ray_generator"]
