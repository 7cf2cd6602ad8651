"""The method `ambient`: direct light plus a constant times albedo, the constant fitted on the training frames."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from gibench.baselines.direct_light.tracer import DirectLight
from gibench.baselines.environments import mean_radiance
from gibench.baselines.method import MethodError, Prediction, Site, Training, View, on_host, reading
from gibench.baselines.stages import Stages
from gibench.rendering.lighting import Lighting

CONSTANT = "ambient.json"


def fitted(frames: Iterable[tuple[NDArray[Any], NDArray[Any], float]]) -> NDArray[np.float64]:
    """The constant c (3,), W·m⁻²·sr⁻¹, that makes c · albedo most like indirect light, in the sense of least squares.

    frames: indirect radiance (H, W, 3), albedo (H, W, 3) times what the light gives off, and exposure of each.
    Differences are of exposed radiance, so that a frame that is lit a hundred times brighter does not decide alone. 0
    where nothing has albedo.
    """
    products, squares = np.zeros(3), np.zeros(3)
    for indirect, albedo, exposure in frames:
        weight = exposure**2
        products += weight * np.sum(indirect * albedo, axis=(0, 1), dtype=np.float64)
        squares += weight * np.sum(np.square(albedo), axis=(0, 1), dtype=np.float64)
    return np.divide(products, squares, out=np.zeros(3), where=squares > 0)


class AmbientLight(DirectLight):
    """See `gibench.baselines.ambient_light.METHOD`."""

    @staticmethod
    def parts_of(site: Site) -> list[str]:
        """Direct light as it is shown, and by lobes where they are scored: indirect light is not traced."""
        lobes = {"diffuse": "direct_diffuse", "specular": "specular"}
        return ["full", *(traced for part, traced in lobes.items() if part in site.parts)]

    def train(self, training: Training) -> None:
        """Fit the constant."""
        if not len(training.views):
            raise MethodError("ambient fits its constant on training frames, but there are none")

        def parts() -> Iterable[tuple[NDArray[Any], NDArray[Any], float]]:
            for frame in training.views:
                read = frame.read("indirect_diffuse", "indirect_specular", "albedo")
                indirect = read["indirect_diffuse"] + read["indirect_specular"]
                exposure = float(frame.row["exposure"])
                lit = read["albedo"] * light_of(frame.lighting)
                yield indirect, lit, exposure if np.isfinite(exposure) else 1.0

        constant = fitted(parts())
        (training.folder / CONSTANT).write_text(json.dumps(constant.tolist()), encoding="utf-8")

    def prepare(self, site: Site) -> None:
        """Read the constant."""
        super().prepare(site)
        if site.weights is None:
            raise MethodError("ambient has not been trained: it needs the folder that `train` filled")
        self._constant = _read(site.weights)

    def render(self, view: View, stages: Stages) -> Prediction:
        """Direct light, and the constant times albedo."""
        parts = self.images(view, stages, ("full",))
        albedo = parts["albedo"]
        constant = self._constant * light_of(view.shot.lighting)
        ambient = albedo * type(albedo)(constant.astype(np.float32))

        def diffuse() -> NDArray[Any]:
            return np.asarray(on_host(parts["direct_diffuse"]) + on_host(ambient))

        return Prediction(
            parts["full"] + ambient,
            parts.get("specular"),
            diffuse=diffuse if "direct_diffuse" in parts else None,
            indirect=ambient,
        )


def light_of(lighting: Lighting) -> NDArray[np.float64]:
    """(3,), what the constant is multiplied by, for a brighter light makes a brighter room.

    Intensity of an area light, W·sr⁻¹; mean radiance of an environment, W·m⁻²·sr⁻¹; 1 for the scene's own.
    """
    if lighting.area is not None:
        return lighting.area.intensity
    if lighting.environment is not None:
        return mean_radiance(lighting.environment.panorama)
    return np.ones(3)


def _read(folder: Path) -> NDArray[np.float64]:
    with reading("the constant", folder):
        constant = np.array(json.loads((folder / CONSTANT).read_text(encoding="utf-8")), dtype=np.float64)
    if constant.shape != (3,) or not np.isfinite(constant).all():
        raise MethodError(f"the constant in {folder} is not three numbers: remove that folder")
    return constant
