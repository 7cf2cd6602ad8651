"""Output of the commands of `gibench bench`, in 80 columns."""

from __future__ import annotations

import textwrap
import time
from importlib import resources
from pathlib import Path
from typing import Any

from gibench.benchmarks import statistics
from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.registry import installed
from gibench.benchmarks.results import Results, load
from gibench.benchmarks.running import Report, State
from gibench.benchmarks.scoring import Scored
from gibench.benchmarks.track import Preset, load_track, track_names
from gibench.cli.output import cut, one_line, say
from gibench.cli.progress import QUIET_SECONDS, duration
from gibench.errors import GibenchError

#: Columns of a label; longer ones are cut.
LABEL = 26


class RunPrinter:
    """Says what a run does, a line a result."""

    def __init__(self) -> None:
        """Nothing was said yet."""
        self._said = time.monotonic()

    def show(self, state: State) -> None:
        """Say what is new."""
        record = state.record
        if state.remark:
            self._line(state.remark)
        elif record is not None:
            place = f"[{state.done:>{len(str(state.of))}}/{state.of}] {record['config']['scene']}"
            self._line(f"{place} {cut(record['label'], 32):<32} {_outcome(record)}")
        elif (training := state.training) is not None:
            took = f"{duration(training['training'])}, with its views {duration(training['seconds'])}"
            self._line(f"trained on rooms: {training['method']} (seed {training['seed']}) {took}")
        elif state.panoramas is not None and time.monotonic() - self._said >= QUIET_SECONDS:
            self._line("panoramas of rooms: {}/{}".format(*state.panoramas))
        elif state.scenes is not None and time.monotonic() - self._said >= QUIET_SECONDS:
            scenes = state.scenes
            self._line(
                f"scenes: rooms {scenes.rooms_done}/{scenes.rooms} frames {scenes.frames_done}/{scenes.frames}"
            )

    def _line(self, text: str) -> None:
        self._said = time.monotonic()
        say(text, err=True)


def _outcome(record: dict[str, Any]) -> str:
    if record["status"] != "ok":
        return f"failed {record['reason']}"
    seconds = sorted(frame["seconds"] for frame in record["frames"])
    return f"{1000 * seconds[len(seconds) // 2]:8.1f} ms"


def print_run(root: Path, report: Report) -> None:
    """Say what a run came to, and what its time went to."""
    seconds = report.seconds
    _row("results", f"{root} ({len(report.ids)}, of which {report.made} new, {len(report.failed)} failed)")
    spent = {"scenes": "scenes", "prepare": "preparing", "render": "rendering", "score": "scoring"}
    parts = ", ".join(f"{word} {duration(seconds[name])}" for name, word in spent.items())
    text = f"{duration(seconds['total'])}: {parts}"
    if report.workers:
        text += f"; preparing and rendering summed over {report.workers} workers"
    _rows("time", text)
    if report.workers:
        return
    share = 100 * seconds["harness"] / max(seconds["total"], 1e-9)
    _row("harness", f"{duration(seconds['harness'])}, {share:.1f} % of the run")


def remark(text: str) -> None:
    """Print a remark beside what shows progress."""
    say(text, err=True)


def print_scored(scored: Scored) -> None:
    """Say which metrics could not be computed, and why."""
    alike: dict[tuple[str, int], list[str]] = {}
    for name, reason in scored.skipped.items():
        alike.setdefault(reason, []).append(name)
    for (why, count), names in alike.items():
        _rows("left out", f"{', '.join(names)} of {count} results: {why}")
    if scored.clipped:
        counts = ", ".join(f"{name} ({count})" for name, count in scored.clipped.items())
        _rows("noise", f"estimates below 0, as those of good images may be, stand as no error: {counts}")
    for problem in scored.problems:
        say(problem, err=True)


def print_equal_time(root: Path, milliseconds: float) -> None:
    """Say which settings meet a time per frame."""
    run = load(root).run
    for entry in run["equal_time"]:
        if entry["ms"] == milliseconds and entry["machine"] == run["machine"]["id"]:
            tried = ", ".join(
                f"{value} {ms:.1f} ms" if ms is not None else f"{value} failed"
                for value, ms in entry["tried"].items()
            )
            met = entry["label"] or f"{entry['method']}: no setting meets it"
            _rows(f"≤ {milliseconds:g} ms", f"{met} (measured {tried.strip()})")


def print_results(root: Path) -> None:
    """List the results of a run, failed ones with their reasons."""
    results = load(root)
    table = results.results
    for row in table.to_dict("records"):
        outcome = f"{row['ms_median']:8.1f} ms" if row["status"] == "ok" else f"failed {row['reason']}"
        say(f"{row['scene']} {cut(row['label'], LABEL):<{LABEL}} {outcome}")
    failed = int((table["status"] != "ok").sum())
    say(f"{len(table)} results, {failed} failed; tracebacks stand in {results.folder.results}")
    if results.superseded:
        say(
            f"{results.superseded} more are left out: of other code, knobs or training time, asked for before."
        )


def print_track(name: str) -> None:
    """Print the file of a track that ships with gibench."""
    load_track(name)
    say((resources.files("gibench.benchmarks") / "tracks" / f"{name}.toml").read_text("utf-8"), nl=False)


def print_tracks(only: str | None) -> None:
    """List tracks and their presets."""
    for name in track_names() if only is None else (only,):
        track = load_track(name)
        say(f"track {track.id}: {track.question}")
        for preset_name, preset in track.presets.items():
            say(f"  {preset_name:<8} {_size(preset)}")


def _size(preset: Preset) -> str:
    reference = preset.recipe("reference")
    width, height = reference.resolution
    held_out = [len(reference.rendered_views(room=room)) for room in range(preset.rooms)]
    most = f"{held_out[0]} frames" if min(held_out) == held_out[0] else f"up to {held_out[0]} frames"
    rooms = "1 room" if preset.rooms == 1 else f"{preset.rooms} rooms"
    text = f"{rooms}, {most} of {width}x{height}"
    if preset.training is None:
        return f"{text}, nothing to train on"
    training = preset.recipe("training")
    views = len(training.rendered_views())
    if preset.training_rooms is not None:
        return f"{text}, {preset.training_rooms} rooms × {views} training views"
    return f"{text}, up to {views} training views"


def print_methods(track: str | None) -> None:
    """List methods and their knobs; what is broken on stderr."""
    registry = installed()
    for id, claims in sorted(registry.methods.items()):
        for found in claims:
            method = found.method
            if track is not None and load_track(track).id not in method.tracks:
                continue
            say(f"method {id}: {method.title} ({method.family}; {found.package} {found.version})")
            plain = registry.methods.get(id.partition(":")[0], ()) if ":" in id else ()
            same = {knob for one in plain for knob in one.method.knobs}  # a variant's list is what it changes
            for knob in (knob for knob in method.knobs if knob not in same):
                values = " ".join(f"[{v}]" if v == knob.default else str(v) for v in knob.values)
                say(f"  {knob.name:<16} {values}")
        if len(claims) > 1:
            packages = " and ".join(sorted(claim.package for claim in claims))
            say(f"error: method '{id}' is claimed by {packages}", err=True)
    for broken in registry.broken:
        say(f"error: {broken}", err=True)


def print_methods_compared(results: Results, first: str, second: str, where: str = "") -> None:
    """Print the paired comparison of two methods of a run, a row a metric and part: the track's, then others scored.

    where: which of the frames these are, "" for all.
    """
    one, other = _one_label(results, first), _one_label(results, second)
    _row("first", one)
    _row("second", other)
    if where:
        _row("frames of", where)
    _times(results, one, results, other)
    _head("metric")
    names = dict.fromkeys(
        [*results.run["metrics"], *results.run["sequence_metrics"], *results.frames["metric"]]
    )
    for part in results.run["parts"]:
        for name in names:
            _compared(f"{name} {part}", results, one, results, other, name, part)


def print_runs_compared(first: Results, second: Results, name: str, part: str, where: str = "") -> None:
    """Print the paired comparison of what two runs have in common, a row a label. where: as above."""
    both = [label for label in dict.fromkeys(first.results["label"]) if label in set(second.results["label"])]
    if not both:
        raise GibenchError(f"{first.root} and {second.root} have no method and setting in common")
    _row("first", str(first.root))
    _row("second", str(second.root))
    _row("compared by", f"{name} of the {part} image, first less second")
    if where:
        _row("frames of", where)
    _head("method")
    for label in both:
        _compared(label, first, label, second, label, name, part)
    for label in both:
        _times(first, label, second, label)


def _one_label(results: Results, name: str) -> str:
    labels = statistics.labels_of(results, name)
    if len(labels) > 1:
        raise GibenchError(
            f"'{name}' has several settings in {results.root}: name one of {', '.join(labels)}"
        )
    return labels[0]


def _head(what: str) -> None:
    say(f"{what:<{LABEL}} {'difference':>10} {'95 % interval':>19}  verdict of the first")


def _compared(text: str, first: Results, one: str, second: Results, other: str, name: str, part: str) -> None:
    try:
        difference = statistics.difference((first, one), (second, other), name, part)
    except ResultsError as problem:  # one has failed, or has no such part
        say(f"{cut(text, LABEL):<{LABEL}} {cut(f'not compared: {problem}', 79 - LABEL)}")
        return
    interval = difference.interval
    say(
        f"{cut(text, LABEL):<{LABEL}} {interval.mean:+10.2g} {interval.low:+9.2g} {interval.high:+9.2g}  "
        f"{difference.verdict}"
    )


def _times(first: Results, one: str, second: Results, other: str) -> None:
    """Compare times where both were measured on the same machine, and say so where they were not."""
    tables = [
        results.results[(results.results["label"] == label) & (results.results["status"] == "ok")]
        for results, label in ((first, one), (second, other))
    ]
    shared = sorted(set(tables[0]["machine"]) & set(tables[1]["machine"]))
    name = one if one == other else "times"
    if not shared:
        say(f"{cut(name, LABEL):<{LABEL}} times not compared: they are of different machines")
    for machine in shared:
        ms = [table[table["machine"] == machine]["ms_median"].mean() for table in tables]
        prepare = [table[table["machine"] == machine]["prepare_s"].mean() for table in tables]
        say(
            f"{cut(name, LABEL):<{LABEL}} {ms[0]:.1f} and {ms[1]:.1f} ms, prepared in "
            f"{duration(prepare[0])} and {duration(prepare[1])}"
        )


def _row(name: str, value: str) -> None:
    say(f"{name:<14}{one_line(value)}")


def _rows(name: str, text: str) -> None:
    """A row that goes on in the next lines where it is longer than 80 columns."""
    for number, line in enumerate(textwrap.wrap(text, 80 - 14)):
        _row(name if number == 0 else "", line)
