"""Deep Shading (Nalbach et al. 2017): screen-space effects by a small U-shaped network."""

from gibench.baselines.image_to_image import CHANNELS, KNOBS
from gibench.baselines.method import Method

METHOD = Method(
    id="deep-shading",
    title="Deep shading",
    family="image to image",
    tracks=("unseen-rooms",),
    paper="Nalbach et al. 2017, Deep Shading: Convolutional Neural Networks for Screen Space Shading",
    implementation="gibench.baselines.deep_shading.implementation:DeepShadingOfColours",
    channels=CHANNELS,
    knobs=KNOBS,
    budget="spp",
    trained=True,
    trains=True,
)
