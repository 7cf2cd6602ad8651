"""Orders of a command: a track, a size of it, methods with their settings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from gibench.benchmarks.errors import TrackError
from gibench.benchmarks.registry import Found
from gibench.benchmarks.settings import Choice, choices
from gibench.benchmarks.track import Preset, Track
from gibench.datasets.making import default_threads
from gibench.rendering.channels import resolve


@dataclass(frozen=True)
class Order:
    """Order of a command.

    methods: with their settings, in the order in which they run. rooms, seeds: None takes the preset's. scenes: keys
    of a recipe that put scene files in the place of rooms. cluster: where all is done, as `cluster.run_tasks` takes it;
    None is here. command: how to do the same again, for the record and for
    messages.
    """

    track: Track
    preset: str
    methods: tuple[tuple[Found, tuple[Choice, ...]], ...]
    rooms: int | None = None
    scenes: Mapping[str, Any] = field(default_factory=dict)
    seeds: tuple[int, ...] | None = None
    variant: str = "auto"
    threads: int = field(default_factory=lambda: default_threads(1))
    retry_failed: bool = False
    cluster: str | None = None
    command: str = ""

    @property
    def size(self) -> Preset:
        """The preset itself."""
        return self.track.preset(self.preset)

    @property
    def room_count(self) -> int:
        """Number of rooms or scenes."""
        return len(self.scenes.get("scenes", ())) or self.rooms or self.size.rooms


def ordered_methods(
    track: Track, preset: str, methods: Sequence[Found], overrides: Mapping[str, Mapping[str, Any]]
) -> tuple[tuple[Found, tuple[Choice, ...]], ...]:
    """Methods with the settings that a preset and the user ask for.

    Raises TrackError for a method that does not run on the track, lacks a channel of the training views, or trains
    where there is nothing to train on; MethodError for settings that do not exist.
    """
    size = track.preset(preset)
    stored = () if size.training is None else size.recipe("training").channels
    result = []
    for found in methods:
        method = found.method
        if track.id not in method.tracks:
            raise TrackError(
                f"method '{method.id}' does not run on track {track.id}, but on {', '.join(method.tracks)}"
            )
        if size.training is None and (method.trains or method.channels):
            raise TrackError(
                f"method '{method.id}' trains, but {track.id}, preset {preset}, has no views to train on: add "
                f"[presets.{preset}.training] to a copy of the track, and run with --track COPY.toml"
            )
        if missing := [channel for channel in resolve(method.channels) if channel not in stored]:
            raise TrackError(
                f"method '{method.id}' needs channel {', '.join(missing)} of the training views, which {track.id}, "
                f"preset {preset}, does not store: copy the track (`gibench bench list --track {track.id} --show`), "
                f"add it to channels under [presets.{preset}.training], and run with --track COPY.toml"
            )
        result.append((found, tuple(choices(method, size.plan(method), overrides.get(method.id, {})))))
    return tuple(result)
