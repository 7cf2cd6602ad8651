"""Bilateral convolutions (Xin et al. 2021): indirect light by a small network whose kernels stop at edges."""

from gibench.baselines.image_to_image import CHANNELS, KNOBS
from gibench.baselines.method import Method

METHOD = Method(
    id="bcn",
    title="Bilateral convolutions",
    family="image to image",
    tracks=("moving-light", "unseen-rooms"),
    paper="Xin et al. 2021, Lightweight Bilateral Convolutional Neural Networks for Interactive Single-Bounce Diffuse "
    "Indirect Illumination",
    implementation="gibench.baselines.bilateral_network.implementation:BilateralConvolutions",
    channels=CHANNELS,
    knobs=KNOBS,
    budget="spp",
    trained=True,
    trains=True,
)
