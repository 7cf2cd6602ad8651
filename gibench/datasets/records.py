"""Schemas of the JSON files of a dataset, checked before anything is made of them; see `gibench.datasets.checked`."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field

from gibench.datasets.checked import Amount, Checked, Count, Fingerprint, Name, Sha256

Vector = Annotated[list[float], Field(min_length=3, max_length=3)]
Pair = Annotated[list[float], Field(min_length=2, max_length=2)]
RoomNumber = Annotated[str, Field(pattern=r"^[0-9]{1,9}$")]

#: Characters of the name of a processor, at most.
PROCESSOR = 100

#: A file of a room from its folder. Whether it leads out of there is the gate's to say.
FileName = Annotated[str, Field(min_length=1, max_length=1000)]


class Versions(Checked):
    """Packages that decide the pixels; all others are named beside."""

    gibench: str
    mitsuba: str


class DenoiseChange(Checked):
    """A frame of which denoising changed the mean of a part by a share."""

    room: Count
    view: Count
    change: float


class Totals(Checked):
    """Sums over all rooms that are whole."""

    rooms: Count
    frames: Count
    bytes: Count
    frame_bytes: Count
    paths: Count
    invalid_paths: Count
    kernel_seconds: Amount
    median_error: Amount | None
    splits: dict[Name, Count]
    denoise_changes: list[DenoiseChange] = Field(default_factory=list)
    processors: dict[str, Count] = Field(default_factory=dict)


class Manifest(Checked):
    """`dataset.json`. Its recipe has a model of its own."""

    format: int
    complete: bool
    recipe: dict[str, Any]
    identity: dict[str, Any]
    licence: str
    command: str
    variant: str
    versions: Versions
    runs: list[dict[str, Any]]
    rejected_rooms: dict[RoomNumber, str]
    rejections: dict[str, Count] = Field(default_factory=dict)
    totals: Totals | None = None
    records: Sha256 | None = None
    card: bool = False


class AreaLightRecord(Checked):
    """The light of a frame: a rectangle."""

    kind: Literal["area-light"]
    centre: Vector
    direction: Vector
    up: Vector
    width: Amount
    height: Amount
    radiance: Vector


class EnvironmentRecord(Checked):
    """The light of a frame: a panorama."""

    kind: Literal["environment"]
    environment: str
    sha256: Sha256
    rotation: float


class FrameRecord(Checked):
    """A frame of a room."""

    view: Count
    file: Annotated[str, Field(pattern=r"^frames/[0-9]{4,6}\.exr$")]
    sha256: Annotated[str, Field(pattern=r"^[0-9a-f]{64}$")]
    bytes: Count
    camera: Vector
    target: Vector
    fov: float
    up: Vector | None = None
    principal_point: Pair = Field(default_factory=lambda: [0.0, 0.0])
    mirrored: bool = False
    path: str
    step: Count
    exposure: float | None
    largest: float | None
    spp: Count
    paths: Count
    invalid_paths: Count
    median_error: float | None
    kernel_seconds: Amount
    denoise_seconds: Amount
    seconds: Amount
    processor: Annotated[str, Field(max_length=PROCESSOR)] = ""
    seed: Count
    lighting: Annotated[AreaLightRecord | EnvironmentRecord, Field(discriminator="kind")] | None = None


class Laps(Checked):
    """Seconds that making a room took."""

    build: Amount
    write: Amount
    load: Amount
    render: Amount


class RoomRecord(Checked):
    """`frames.json` of a room."""

    room: Count
    kind: str
    split: Name
    given_cameras: Annotated[int, Field(ge=0, le=10**6)] = 0
    materials: list[str]
    shapes: list[str]
    rejections: dict[str, Count]
    seconds: Laps
    frames: list[FrameRecord]
    files: dict[FileName, Fingerprint]


class Change(Checked):
    """Something that was done to an imported scene, as often as it was."""

    rule: str
    what: str
    loss: bool
    count: Count


class Source(Checked):
    """Origin of an imported scene."""

    up: str
    scale: float
    warnings: list[str]
    changes: list[Change]


class Described(Checked):
    """`room.json` of an imported scene, as far as `gibench dataset info` tells of it."""

    kind: str
    source: Source


class Shine(Checked):
    """Gloss of a generated room."""

    gloss: Annotated[float, Field(ge=0, le=1)] = 0.0


class Polished(Checked):
    """`room.json` of a generated room, as far as `gibench dataset info` tells of its gloss."""

    parameters: Shine


class Lamp(Checked):
    """A light of a room; those of scene files say neither flux nor temperature."""

    name: str = ""
    lumens: float | None = None
    kelvin: float | None = None


class Family(Checked):
    """A material of a room."""

    family: str


class Outside(Checked):
    """The environment outside the windows."""

    kind: str


class Contents(Checked):
    """`room.json` of any room, as far as the card of a dataset tells of it."""

    lights: list[Lamp] = Field(default_factory=list)
    materials: dict[str, Family] = Field(default_factory=dict)
    environment: Outside | None = None
