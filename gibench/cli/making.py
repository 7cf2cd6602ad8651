"""Output of `make-dataset` and `gibench dataset info`."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from gibench import gate
from gibench.cli.output import one_line, say
from gibench.cli.progress import amount, counting, duration, making
from gibench.datasets.checked import parsed
from gibench.datasets.estimating import estimate
from gibench.datasets.folder import room_folder, whole_rooms
from gibench.datasets.making import make
from gibench.datasets.manifest import processors_told
from gibench.datasets.recipes import Recipe
from gibench.datasets.records import Described, Polished

#: What moves in a sequence, in words.
MOVING = {"camera": "the camera moves", "light": "the light moves", "both": "camera and light move"}

#: Rewrites of scene files that change names alone; they are counted.
QUIET_RULES = ("property_names", "transform_tags")


def make_and_print(
    root: Path, recipe: Recipe, variant: str, workers: int, command: str, cluster: str | None = None
) -> None:
    """Make a dataset with a progress bar, then say what there is."""
    with making() as on_progress:
        summary = make(
            root,
            recipe,
            variant=variant,
            workers=workers,
            cluster=cluster,
            command=command,
            on_progress=on_progress,
        )
    if summary.made == 0:
        say(f"{root} is already complete")
    describe(root, summary.manifest)
    if summary.made:
        seconds = summary.seconds / max(summary.frames, 1)
        say(_row("this run", f"{duration(summary.seconds)}, {seconds:.2f} s a frame"))
        say(_row("look at it", f"{root / 'preview.png'}"))


def describe(root: Path, manifest: dict[str, Any]) -> None:
    """Say what a dataset holds, from its manifest."""
    recipe, totals = manifest["recipe"], manifest.get("totals")
    width, height = recipe["resolution"]
    samples = f"{recipe['spp']} spp" if recipe["error"] is None else f"until error {recipe['error']:g}"
    done = "" if manifest["complete"] else f" of {recipe['rooms']}, not complete"
    say(_row("dataset", str(root)))
    if totals is not None:
        splits = ", ".join(f"{name} {count}" for name, count in totals["splits"].items())
        say(_row("rooms", f"{totals['rooms']}{done}"))
        say(_row("frames", f"{totals['frames']} ({splits}), {width}x{height}, {samples}"))
    if manifest["identity"].get("sampling") == "guided":
        say(_row("paths", "guided: lights and directions are chosen by what is learned of a room"))
    if recipe.get("lighting", "own") != "own":
        maps = f" ({', '.join(map(str, recipe['environments']))})" if recipe["environments"] else ""
        say(_row("lighting", f"{recipe['lighting']}{maps}, one of its own a frame"))
    if recipe.get("opened", "none") != "none":
        say(_row("opened", "no ceiling" + (" and one wall less" if recipe["opened"] == "stage" else "")))
    if recipe.get("gloss", "any") != "any":
        say(_row("gloss", _gloss(root)))
    for name, sequence in recipe.get("sequences", {}).items():
        moving = MOVING[sequence["moves"]]
        say(_row("sequence", f"{name}: {sequence['views']} frames, {moving}"))
    denoised = "denoised" if recipe["denoise"] else "not denoised"
    say(_row("channels", f"{len(recipe['channels'])}, {denoised}"))
    if totals is not None:
        if totals["median_error"] is not None:
            say(_row("median error", f"{two_digits(100 * totals['median_error'])} % (of the samples)"))
        say(_row("size", f"{amount(totals['bytes'], 'B')} ({amount(totals['frame_bytes'], 'B')} in frames)"))
        if totals["kernel_seconds"] > 0:
            speed = amount(totals["paths"] / totals["kernel_seconds"], "paths/s")
            say(_row("rendering", f"{duration(totals['kernel_seconds'])} in kernels, {speed}"))
        if changes := totals.get("denoise_changes"):
            worst = changes[0]
            say(
                _row(
                    "denoising",
                    f"warning: changed the mean of a part by more than 3 % in {len(changes)} frames; most in room "
                    f"{worst['room']}, view {worst['view']}: {100 * worst['change']:+.0f} %. More samples help",
                )
            )
        if processors := processors_told(manifest):
            say(_row("processors", processors))
        if totals["invalid_paths"]:
            say(_row("invalid paths", f"{totals['invalid_paths']}, counted as 0"))
    _print_rejections(manifest.get("rejections", {}), manifest["rejected_rooms"])
    if recipe.get("scenes"):
        _print_scenes(root)
    versions = manifest["versions"]
    say(
        _row(
            "made with",
            f"gibench {versions['gibench']}, Mitsuba {versions['mitsuba']}, {manifest['variant']}",
        )
    )
    say(_row("licence", manifest["licence"]))
    say(_row("command", manifest["command"]))


def dry_run(recipe: Recipe, variant: str, workers: int) -> None:
    """Build and check every room, then say what the dataset would take."""
    with counting("rooms built and checked") as on_room:
        result = estimate(recipe, variant=variant, workers=workers, on_room=on_room)
    most = "at most " if recipe.spp is None else "about "
    built = f"{1000 * result.build_seconds:.0f} ms each"
    if result.checked < recipe.rooms:
        say(_row("rooms", f"about {result.rooms}, of which {result.checked} were built and checked, {built}"))
    else:
        say(_row("rooms", f"{result.rooms} built and checked, {built}"))
    _print_rejections(result.rejections, result.rejected_rooms)
    say(_row("frames", f"{result.frames}, about {two_digits(result.seconds_per_frame)} s each"))
    speed = amount(result.paths_per_second, "paths/s")
    say(_row("time", f"{most}{duration(result.seconds)} ({result.variant}, {speed})"))
    say(_row("disk", f"about {amount(result.bytes, 'B')}"))
    say("Time and disk are scaled from one small frame of a first room; nothing was kept.")


def two_digits(value: float) -> str:
    """A number of two significant digits without an exponent: 0.012, 1.2, 120."""
    return f"{float(f'{value:.2g}'):g}"


def _gloss(root: Path) -> str:
    """Its fraction of the views of the rooms."""
    seen = []
    for room in whole_rooms(root):
        path = room_folder(root, room) / "room.json"
        try:
            described = parsed(gate.read_inside(root, path.relative_to(root)), Polished)
        except (gate.GateError, ValueError) as problem:
            return f"much; {path} is damaged: {problem}"
        seen.append(described["parameters"].get("gloss", 0.0))
    return f"much, {100 * sum(seen) / len(seen):.0f} % of what cameras see" if seen else "much"


def _print_scenes(root: Path) -> None:
    for room in whole_rooms(root):
        path = room_folder(root, room) / "room.json"
        try:
            print_scene(parsed(gate.read_inside(root, path.relative_to(root)), Described))
        except (gate.GateError, ValueError) as problem:
            say(_row("scene", f"{path} is damaged: {problem}"))


def print_scene(described: dict[str, Any]) -> None:
    """Say what was done to an imported scene, from its room.json, which holds all of it."""
    source = described["source"]
    changes = sum(change["count"] for change in source["changes"])
    placed = f"{source['up']} up" + ("" if source["scale"] == 1 else f", scale {source['scale']:g}")
    say(_row("scene", f"{described['kind']}: {placed}, {changes} changes"))
    for warning in source["warnings"]:
        say(_row("", f"warning: {warning}"))
    for change in source["changes"]:
        if change["loss"] or change["rule"] not in QUIET_RULES:
            times = "" if change["count"] == 1 else f" ({change['count']} times)"
            mark = "warning: " if change["loss"] else ""
            say(_row("", f"{mark}{change['what']}{times}"))


def _print_rejections(rejections: dict[str, int], rooms: dict[Any, str]) -> None:
    if rejections:
        listed = ", ".join(
            f"{reason} {count}" for reason, count in sorted(rejections.items(), key=lambda r: -r[1])
        )
        say(_row("rejected", f"{sum(rejections.values())} tries: {listed}"))
    for room, reason in rooms.items():
        say(_row("left out", f"room {room}: {reason}"))


def _row(name: str, value: str) -> str:
    return f"{name:<14}{one_line(value)}"
