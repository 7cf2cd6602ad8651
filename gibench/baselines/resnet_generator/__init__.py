"""The generator of residual blocks that pix2pix is compared with (Johnson et al. 2016, Zhu et al. 2017)."""

from gibench.baselines.image_to_image import CHANNELS, KNOBS
from gibench.baselines.method import Method

METHOD = Method(
    id="resnet",
    title="Residual blocks",
    family="image to image",
    tracks=("unseen-rooms",),
    paper="Johnson et al. 2016, Perceptual Losses for Real-Time Style Transfer and Super-Resolution",
    implementation="gibench.baselines.resnet_generator.implementation:ResidualBlocks",
    channels=CHANNELS,
    knobs=KNOBS,
    budget="spp",
    trained=True,
    trains=True,
)
