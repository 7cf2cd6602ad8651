"""Geometry-Aware Feature Aggregation (Gai, Wang & Li): indirect light of rooms never seen, in screen space."""

from gibench.baselines.image_to_image import CHANNELS, KNOBS
from gibench.baselines.method import Knob, Method, Variant

OWN_KNOBS = (
    Knob("mini", False, (False, True), "the paper's network of 8.76 M parameters", trains=True),
    Knob("monochromatic", True, (False, True), "whether each colour goes through by itself", trains=True),
    Knob("heads", 8, (1, 4, 8), "of the attention", trains=True),
)

METHOD = Method(
    id="gfa",
    title="Geometry-aware feature aggregation",
    family="image to image",
    tracks=("unseen-rooms",),
    paper="Gai et al., Geometry-Aware Global Feature Aggregation for Real-Time Indirect Illumination",
    implementation="gibench.baselines.geometry_aware_feature_aggregation.implementation:GeometryAwareAggregation",
    channels=CHANNELS,
    knobs=(*OWN_KNOBS, *KNOBS),
    budget="spp",
    trained=True,
    trains=True,
    variants=(
        Variant("mini", {"mini": True}),
        Variant("normal", {"monochromatic": False}),
        Variant("one-head", {"heads": 1}),
        Variant("no-perceptual", {"perceptual": False}),
        Variant("no-adversarial", {"adversarial": False}),
    ),
)
