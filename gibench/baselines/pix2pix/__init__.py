"""pix2pix (Isola et al. 2017): images to images by a U-Net, with a discriminator."""

from gibench.baselines.image_to_image import CHANNELS, KNOBS
from gibench.baselines.method import Method

METHOD = Method(
    id="pix2pix",
    title="pix2pix",
    family="image to image",
    tracks=("unseen-rooms",),
    paper="Isola et al. 2017, Image-to-Image Translation with Conditional Adversarial Networks",
    implementation="gibench.baselines.pix2pix.implementation:Pix2Pix",
    channels=CHANNELS,
    knobs=KNOBS,
    budget="spp",
    trained=True,
    trains=True,
)
