"""What networks share that make indirect light of a frame's direct light and its surfaces, an image of images.

`frames` reads what they learn from, `camera_space` is how a camera sees it, `device_frames` has the same of a frame
that is being rendered, on the device: channels have their names and units of the channel contract everywhere. `shading`
is what a network is given and how its answer becomes radiance, `examples` and `learner` are its training, and
`implementation` is a method but for its network.
"""

from gibench.baselines.direct_light import SAMPLING
from gibench.baselines.method import Knob

KNOBS = (
    Knob(
        "width",
        1.0,
        (0.125, 0.25, 0.5, 1.0),
        "share of the channels that the paper's network has",
        trains=True,
    ),
    Knob(
        "crop",
        128,
        (32, 48, 64, 96, 128, 192, 256, 512),
        "pixels along a side of what a step sees of a frame",
        trains=True,
    ),
    Knob(
        "images",
        1.0,
        (0.125, 0.25, 0.5, 1.0),
        "share of the training frames, by whole rooms where there are several",
        trains=True,
    ),
    Knob("batch", 1, (1, 2, 4, 8), "frames that a step sees", trains=True),
    Knob("perceptual", True, (False, True), "whether the perceptual loss is trained for", trains=True),
    Knob("adversarial", True, (False, True), "whether a discriminator learns along", trains=True),
    *SAMPLING,
)

CHANNELS = ("direct_diffuse", "indirect_diffuse", "albedo", "normal", "position", "depth")
"""Of the training frames."""


def channels_at(width: float, channels: tuple[int, ...]) -> tuple[int, ...]:
    """Channels of a network's levels at a share of its width: multiples of 8, which is a multiple of the heads."""
    return channels if width == 1 else tuple(max(8, 8 * round(width * count / 8)) for count in channels)
