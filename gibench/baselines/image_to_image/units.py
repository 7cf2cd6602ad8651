"""Units of the light of frames, in which a network is given it and says what it makes of it."""

from __future__ import annotations

from dataclasses import dataclass

from torch import Tensor

from gibench.baselines.image_to_image.frames import Frames, spaced
from gibench.baselines.image_to_image.shading import brightness, in_units
from gibench.rendering.lighting import AreaLight

MEASURED = 64
"""Training frames that are looked at."""


@dataclass(frozen=True)
class Units:
    """Of a room that an area light lights: what that gives off in each colour, times a constant of the room. Of others:
    the brightness of a frame's own direct light, all colours together.

    The mean direct light in view says little where the light moves: in a living room whose indirect light varies by a
    factor of 7, light and light in view are apart by 10⁷, and one frame of fifteen sees no direct light at all.

    in_view: brightness of direct light over radiance times area (W·sr⁻¹), a mean; None without area lights.
    """

    in_view: float | None = None

    @staticmethod
    def of_frames(frames: Frames) -> Units:
        """From training frames with direct light and albedo."""
        numbers = spaced(range(len(frames)), MEASURED)
        areas = [frames.area_light(number) for number in numbers]
        shares: list[float] = []
        for number, area in zip(numbers, areas, strict=True):
            if area is None:
                return Units()
            images = frames[number]
            light = brightness(images["direct_diffuse"], images["albedo"], of_each_colour=True)
            given = light.new_tensor(area.intensity)[:, None, None]
            if (given > 0).any():
                shares.append(float(in_units(light, given)[given > 0].mean()))
        mean = sum(shares) / max(len(shares), 1)
        return Units(mean) if mean > 0 else Units()

    def of(self, direct: Tensor, albedo: Tensor, area: AreaLight | None) -> Tensor:
        """Of a frame's direct light and albedo (3, H, W): (3, 1, 1), or (1, 1, 1), the brightness of what is in view.

        area: the light of the frame.
        """
        if self.in_view is None or area is None:
            return brightness(direct, albedo)
        return direct.new_tensor(self.in_view * area.intensity)[:, None, None]

    @property
    def own(self) -> bool:
        """Whether they are a frame's own, so that nobody knows how bright a room is."""
        return self.in_view is None
