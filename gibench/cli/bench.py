"""`gibench bench run | list | score | board | compare | report`."""

from __future__ import annotations

import math
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gibench.cli.dataset import AllowMissing, AllowOutside, Parameters, Scale, SceneFiles, UpAxis
from gibench.cli.output import say
from gibench.errors import GibenchError

if TYPE_CHECKING:
    from gibench.benchmarks.registry import Found
    from gibench.benchmarks.track import Preset

app = typer.Typer(
    help="Run, score and compare methods of real-time global illumination.", no_args_is_help=True
)

Folder = Annotated[Path, typer.Argument(metavar="RESULTS", help="The folder of a run.", show_default=False)]


@app.command("run")
def run_track(
    track: Annotated[str, typer.Option(help="A track, or a TOML file of your own.")] = "walkthrough",
    preset: Annotated[str, typer.Option(help="smoke, cpu, paper or another of the track.")] = "smoke",
    out: Annotated[Path | None, typer.Option(help="Where to.", show_default="results/TRACK-PRESET")] = None,
    methods: Annotated[
        str | None, typer.Option(help="Such as lightmap,path-traced.", show_default="all of the track")
    ] = None,
    rooms: Annotated[int | None, typer.Option(help="How many rooms.", show_default="the preset's")] = None,
    scene: SceneFiles = None,
    up: UpAxis = None,
    scale: Scale = None,
    allow_missing: AllowMissing = False,
    allow_outside: AllowOutside = False,
    define: Parameters = None,
    settings: Annotated[
        list[str] | None,
        typer.Option(
            "--set", help="METHOD.KNOB=VALUE or =VALUE,VALUE in place of the preset's; may be repeated."
        ),
    ] = None,
    equal_time: Annotated[
        float | None,
        typer.Option(
            help="Milliseconds a frame: find each method's dearest setting that meets it.", show_default=False
        ),
    ] = None,
    seeds: Annotated[
        str | None, typer.Option(help="Such as 0,1,2, for trained methods.", show_default="the preset's")
    ] = None,
    training_seconds: Annotated[
        float | None,
        typer.Option(help="Seconds after which a training ends.", show_default="the preset's"),
    ] = None,
    variant: Annotated[str, typer.Option(help="Mitsuba's, or auto: the fastest that works.")] = "auto",
    cluster: Annotated[
        str | None,
        typer.Option(help="Run on Dask: a scheduler's address or file, or local:N.", show_default=False),
    ] = None,
    retry_failed: Annotated[bool, typer.Option("--retry-failed", help="Try failed results again.")] = False,
    no_score: Annotated[
        bool, typer.Option("--no-score", help="Leave scoring to `gibench bench score`.")
    ] = False,
) -> None:
    """Bake, time and score methods on a track, or continue such a run."""
    from gibench.benchmarks.equal_time import search
    from gibench.benchmarks.errors import RunError, TrackError
    from gibench.benchmarks.orders import Order, ordered_methods
    from gibench.benchmarks.results import load
    from gibench.benchmarks.running import Run, run
    from gibench.benchmarks.scoring import Scored, score
    from gibench.benchmarks.settings import parse_overrides
    from gibench.benchmarks.track import load_track
    from gibench.cli import bench_printing as printing
    from gibench.cli.bench_board import print_board
    from gibench.cli.dataset import check_variant, scene_options, scene_words
    from gibench.cli.progress import counting

    chosen = load_track(track)
    chosen.preset(preset)
    check_variant(variant)
    for option, value in (
        ("--rooms", rooms),
        ("--equal-time", equal_time),
        ("--training-seconds", training_seconds),
    ):
        if value is not None and (not value > 0 or (value == math.inf and option == "--equal-time")):
            raise TrackError(f"{option}: {value:g} is not allowed; allowed is a number above 0")
    if training_seconds is not None:
        chosen = chosen.with_training_seconds(preset, training_seconds)
    if scene and rooms is not None:
        raise TrackError("--scene takes the place of rooms: leave out --rooms")
    scenes = {
        key: value
        for key, value in scene_options(scene, up, scale, allow_missing, allow_outside, define).items()
        if value is not None
    }
    chosen.preset(preset).recipe("reference", scenes=scenes)
    found = _methods(methods, chosen.id, chosen.preset(preset))
    overrides = parse_overrides(settings or (), {f.method.id: f.method for f in found})
    root = out or Path("results") / f"{chosen.id}-{preset}"
    given = {
        "--track": track,
        "--preset": preset,
        "--out": root,
        "--methods": methods,
        "--rooms": rooms,
        "--equal-time": equal_time,
        "--seeds": seeds,
        "--training-seconds": None if training_seconds is None else f"{training_seconds:g}",
        "--variant": None if variant == "auto" else variant,
        "--cluster": cluster,
    }
    words = [str(word) for option, value in given.items() if value is not None for word in (option, value)]
    words += scene_words(scene, up, scale, allow_missing, allow_outside, define)
    words += [word for text in settings or () for word in ("--set", text)]
    order = Order(
        track=chosen,
        preset=preset,
        methods=ordered_methods(chosen, preset, found, overrides),
        rooms=rooms,
        scenes=scenes,
        seeds=None if seeds is None else _seeds(seeds),
        variant=variant,
        retry_failed=retry_failed,
        cluster=cluster,
        command=shlex.join(["gibench", "bench", "run", *words]),
    )
    scored: list[Scored] = []

    def score_and_count(doing: Run) -> None:
        with counting("results scored") as on_progress:
            scored.append(score(doing.folder, on_progress=on_progress, told=printing.remark))

    report = run(
        root,
        order,
        work=None if equal_time is None else lambda doing: search(doing, equal_time),
        score=None if no_score else score_and_count,
        on_state=printing.RunPrinter().show,
    )
    printing.print_run(root, report)
    for done in scored:
        printing.print_scored(done)
    if equal_time is not None:
        printing.print_equal_time(root, equal_time)
    if not no_score:
        print_board(load(root))
    if report.failed:
        raise RunError(
            f"{len(report.failed)} results failed, `gibench bench list {root}` says why; --retry-failed tries again"
        )


@app.command("list")
def list_all(
    results: Annotated[
        Path | None,
        typer.Argument(metavar="[RESULTS]", help="A run, to list its results.", show_default=False),
    ] = None,
    track: Annotated[str | None, typer.Option(help="One track alone.", show_default=False)] = None,
    show: Annotated[bool, typer.Option("--show", help="Print the file of --track, to be copied.")] = False,
) -> None:
    """List tracks and methods with their knobs, or the results of a run and why some failed."""
    from gibench.benchmarks.errors import TrackError
    from gibench.cli import bench_printing as printing

    if results is not None:
        printing.print_results(results)
    elif show:
        if track is None:
            raise TrackError("--show needs --track, the name of a track")
        printing.print_track(track)
    else:
        printing.print_tracks(track)
        printing.print_methods(track)


@app.command("score")
def score_results(
    results: Folder,
    metrics: Annotated[
        str | None, typer.Option(help="More than the track's, such as ssim,psnr.", show_default=False)
    ] = None,
) -> None:
    """Compute what is missing of the metrics, from the predictions on disk."""
    from gibench.benchmarks.result_files import RunFolder
    from gibench.benchmarks.scoring import score
    from gibench.cli import bench_printing as printing
    from gibench.cli.dataset import names_in
    from gibench.cli.progress import counting

    folder = RunFolder(results)
    folder.read_run()
    more = () if metrics is None else names_in(metrics, "--metrics")
    with folder.claimed(), counting("results scored") as on_progress:
        scored = score(folder, more=more, on_progress=on_progress, told=printing.remark)
    say(f"{scored.done} files of scores written in {folder.scores}")
    printing.print_scored(scored)
    if scored.problems:
        raise GibenchError(f"{len(scored.problems)} results could not be scored")


OneRoom = Annotated[
    str | None,
    typer.Option(
        help="One room alone, such as room-000000; intervals are over its frames.", show_default=False
    ),
]
OneGroup = Annotated[
    str | None,
    typer.Option(help="One group of frames alone: stills, near, indoor, a sequence …", show_default=False),
]


@app.command("board")
def board(
    results: Folder,
    metrics: Annotated[
        str | None,
        typer.Option(
            help="Such as psnr,ssim; rows are sorted by the first.", show_default="the track's first"
        ),
    ] = None,
    parts: Annotated[str, typer.Option(help="Such as full,indirect.")] = "full",
    room: OneRoom = None,
    group: OneGroup = None,
    markdown: Annotated[bool, typer.Option("--markdown", help="A table to paste into a page.")] = False,
) -> None:
    """Print the leaderboard of a run, of all its frames or of some."""
    from gibench.benchmarks.results import load
    from gibench.cli.bench_board import print_board, print_columns
    from gibench.cli.dataset import names_in
    from gibench.metrics import metric

    run = load(results)
    names = run.run["metrics"][:1] if metrics is None else names_in(metrics, "--metrics")
    for name in names:
        metric(name)
    of = [_known_part(part, "--parts") for part in names_in(parts, "--parts")]
    some = run.among(room=room, group=group)
    if markdown or len(names) > 1 or len(of) > 1:
        print_columns(some, names, of, markdown=markdown)
    else:
        print_board(some, names[0], of[0])


@app.command("compare")
def compare(
    first: Annotated[str, typer.Argument(metavar="A", help="A folder, or with --in a method.")],
    second: Annotated[str, typer.Argument(metavar="B", help="What it is compared with.")],
    within: Annotated[
        Path | None, typer.Option("--in", help="Compare two methods of this run.", show_default=False)
    ] = None,
    metric: Annotated[str, typer.Option(help="Of two folders: the metric to compare by.")] = "rmse_display",
    part: Annotated[str, typer.Option(help="Of two folders: full, diffuse, specular or indirect.")] = "full",
    room: OneRoom = None,
    group: OneGroup = None,
) -> None:
    """Compare two runs, or two methods of one run, on the same frames."""
    from gibench.benchmarks.results import load
    from gibench.cli import bench_printing as printing
    from gibench.metrics import metric as descriptor

    where = ", ".join(name for name in (room, group) if name)
    if within is not None:
        printing.print_methods_compared(load(within).among(room=room, group=group), first, second, where)
        return
    descriptor(metric)
    _known_part(part, "--part")
    one, other = (load(folder).among(room=room, group=group) for folder in (first, second))
    printing.print_runs_compared(one, other, metric, part, where)


@app.command("report")
def report(
    results: Annotated[
        list[Path],
        typer.Argument(metavar="RESULTS...", help="Folders of runs, or a packed report.", show_default=False),
    ],
    out: Annotated[Path | None, typer.Option(help="Where to.", show_default=False)] = None,
    archive: Annotated[
        Path | None,
        typer.Option(help="Pack page, images, plots and tables into this ZIP file.", show_default=False),
    ] = None,
) -> None:
    """Write one page, CSV files, tables and plots of one run or more, or unpack those that were packed."""
    from gibench.cli.bench_reporting import write_and_print

    write_and_print(results, out, archive)


def _known_part(name: str, option: str) -> str:
    from gibench.benchmarks.errors import ResultsError
    from gibench.benchmarks.report.source import PARTS

    if name not in PARTS:
        raise ResultsError(f"{option}: '{name}' is not allowed; allowed are {', '.join(PARTS)}")
    return name


def _methods(names: str | None, track: str, preset: Preset) -> list[Found]:
    from gibench.benchmarks.errors import RegistryError, TrackError
    from gibench.benchmarks.registry import installed
    from gibench.cli.dataset import names_in
    from gibench.datasets.errors import nearest

    registry = installed()
    if names is not None:
        return [registry.get(name) for name in dict.fromkeys(names_in(names, "--methods"))]
    known = [*registry.methods, *(broken.name for broken in registry.broken)]
    for id in preset.methods:
        if id not in known:
            raise TrackError(
                f"track {track} has settings for method '{id}', which is not installed; {nearest(id, known)}"
            )
    for broken in registry.broken:
        say(f"left out: {broken}", err=True)
    found = registry.on_track(track)
    if not found:
        raise RegistryError(f"no installed method runs on track {track}: pip install gibench brings its own")
    return [one for one in found if preset.variants or ":" not in one.method.id]


def _seeds(text: str) -> tuple[int, ...]:
    from gibench.benchmarks.errors import TrackError

    try:
        seeds = tuple(dict.fromkeys(int(word) for word in text.split(",")))
    except ValueError:
        seeds = ()
    if not seeds or min(seeds) < 0:
        raise TrackError(
            f"--seeds: '{text}' is not allowed; allowed are integers from 0 with commas between them"
        )
    return seeds
