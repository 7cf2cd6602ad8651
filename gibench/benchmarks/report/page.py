"""The page: one HTML file with its style, its program and its numbers, that opens from disk without a network."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from gibench.benchmarks.report.image_files import STEPS_PER_STOP, TOE
from gibench.benchmarks.report.runs import part_title
from gibench.benchmarks.report.source import ReportSource
from gibench.benchmarks.report.summary import Summary
from gibench.benchmarks.report.tables import stage_times
from gibench.benchmarks.report.trainings import TrainingCurve, trainings
from gibench.benchmarks.report.wording import against, metric_title
from gibench.datasets.files import write_whole
from gibench.metrics import METRICS

SCRIPTS = (
    "words.js",
    "image_codec.js",
    "leaderboard.js",
    "label_placement.js",
    "charts.js",
    "training.js",
    "viewer.js",
    "main.js",
)

DIGITS = 4
"""Significant digits of the numbers on the page; the CSV files have all that matter."""

MOST_LOOKS = 100
"""Looks of a training on the page; the plots and training.csv have all of them."""


def write_page(source: ReportSource, summary: Summary, out: Path) -> Path:
    """Write index.html into a folder that `write_images` has filled; give its path."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    assets = files("gibench.benchmarks.report") / "assets"
    environment = Environment(
        loader=PackageLoader("gibench.benchmarks.report", "assets"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    text = environment.get_template("page.html.j2").render(
        title=", ".join(summary.tracks),
        style=(assets / "page.css").read_text(encoding="utf-8"),
        scripts=[(assets / name).read_text(encoding="utf-8") for name in SCRIPTS],
        data=_inline(page_data(source, summary)),
        parts={part: part_title(part) for part in summary.parts},
        against=against(_metrics_of(source, summary), summary.unbiased),
    )
    path = out / "index.html"
    write_whole(path, text.encode())
    return path


def page_data(source: ReportSource, summary: Summary) -> dict[str, Any]:
    """Collect what the page shows, as plain values; `leaderboard.js` and its neighbours read it."""
    scenes = _scenes(source, summary)
    number_of = {scene["id"]: position for position, scene in enumerate(scenes)}
    machine = source.run.get("machine") or {}
    return {
        "run": {
            "preset": str(source.run.get("preset", "")),
            "seed": str(source.run.get("seed", "")),
            "created": str(source.run.get("created", "")),
            "machine": _described(machine),
        },
        "code": {"stepsPerStop": STEPS_PER_STOP, "toe": TOE},
        "magma": _magma(),
        "tracks": summary.tracks,
        "machines": summary.machines,
        "parts": summary.parts,
        "partTitles": {part: part_title(part) for part in summary.parts},
        "metrics": [
            {
                "name": name,
                "title": metric_title(name),
                "higher": METRICS[name].direction == "higher",
                "inTime": METRICS[name].inputs == "sequence",
            }
            for name in _metrics_of(source, summary)
        ],
        "stages": list(stage_times(source, summary).columns),
        "against": summary.against,
        "entries": _entries(source, summary),
        "scenes": scenes,
        "results": _results(source, summary, scenes, number_of),
        "trainings": [_training(curve) for curve in trainings(source, summary)],
    }


def _metrics_of(source: ReportSource, summary: Summary) -> list[str]:
    """As the track lists them: the board opens with its first."""
    scored = set(summary.scores["metric"])
    return [name for name in dict.fromkeys((*source.run.get("metrics", ()), *METRICS)) if name in scored]


def _training(curve: TrainingCurve) -> dict[str, Any]:
    # Of hundreds of looks so many that a line shows no gaps, and always the best and those at the ends.
    shown = set(np.linspace(0, len(curve.steps) - 1, min(MOST_LOOKS, len(curve.steps))).astype(int))
    best = curve.best
    looks = sorted(shown | ({best} if best is not None else set()))
    return {
        **{
            name: getattr(curve, name)
            for name in ("track", "machine", "family", "method", "name", "scenes", "seed")
        },
        "steps": [int(curve.steps[look]) for look in looks],
        "seconds": _numbers(curve.seconds[looks]),
        "errors": _numbers(curve.errors[looks]),
        "best": looks.index(best) if best is not None else None,
    }


def _entries(source: ReportSource, summary: Summary) -> list[dict[str, Any]]:
    stages = stage_times(source, summary)
    scores: dict[Any, dict[str, list[Any]]] = {}
    for row in summary.scores.to_dict("records"):
        # In the order that `leaderboard.js` takes apart.
        scores.setdefault(row["entry"], {})[f"{row['part']}/{row['metric']}"] = [
            *(_number(row[name]) for name in ("mean", "low", "high", "floor")),
            *(_number(row[name]) for name in ("difference", "difference_low", "difference_high")),
            row["verdict"] if isinstance(row["verdict"], str) else None,
            int(row["rooms"]),
            int(row["left_out"]),
        ]
    entries = []
    for entry, row in zip(summary.entries.index, summary.entries.to_dict("records"), strict=True):
        own = stages.loc[entry].dropna() if entry in stages.index else {}
        entries.append(
            {
                **{name: row[name] for name in ("track", "label", "method", "title", "family", "machine")},
                **{name: row[name] for name in ("curve", "step")},
                **{name: int(row[name]) for name in ("rooms", "failed_rooms", "seeds")},
                "costs": _costs(row),
                "stages": {str(name): _number(value) for name, value in own.items()},
                "scores": scores.get(entry, {}),
            }
        )
    return entries


def _costs(row: Any) -> dict[str, float | None]:
    return {
        "ms": _number(row["ms_median"]),
        "p95": _number(row["ms_p95"]),
        "prepare": _number(row["prepare_s"]),
        "bytes": _number(row["bytes"]),
        "peak": _number(row["peak_mb"]),
    }


def _scenes(source: ReportSource, summary: Summary) -> list[dict[str, Any]]:
    frames = source.frames[["result", "frame"]].drop_duplicates()
    paths = summary.paths
    sequences = dict(zip(zip(paths["scene"], paths["frame"], strict=True), paths["sequence"], strict=True))
    of = frames.merge(summary.results[["result", "scene", "track"]], on="result")
    floors = summary.floor.groupby(["scene", "part", "metric"])
    floor_of = {key: dict(zip(own["frame"], own["value"], strict=True)) for key, own in floors}
    scenes = []
    for (track, scene), own in of.groupby(["track", "scene"]):
        indices = sorted(int(frame) for frame in own["frame"].unique())
        part = source.frames["part"].iloc[0]
        height, width, _ = source.reference(str(scene), indices[0], part).shape
        scenes.append(
            {
                "id": str(scene),
                "track": str(track),
                "frames": indices,
                "sequences": [sequences.get((str(scene), frame), "") for frame in indices],
                "width": width,
                "height": height,
                "floor": {
                    f"{part}/{metric}": _numbers(values.get(frame, math.nan) for frame in indices)
                    for (where, part, metric), values in floor_of.items()
                    if where == scene and set(values) != {-1}
                },
            }
        )
    return scenes


def _results(
    source: ReportSource, summary: Summary, scenes: list[dict[str, Any]], number_of: dict[str, int]
) -> list[dict[str, Any]]:
    frames = source.frames
    series: dict[str, dict[str, list[float | None]]] = {}
    scene_of = dict(zip(summary.results["result"], summary.results["scene"], strict=True))
    for (result, part, metric), own in frames.groupby(["result", "part", "metric"]):
        if metric in METRICS and result in scene_of:
            values = dict(zip(own["frame"], own["value"], strict=True))
            indices = scenes[number_of[scene_of[result]]]["frames"]
            found = _numbers(values.get(frame, math.nan) for frame in indices)
            series.setdefault(str(result), {})[f"{part}/{metric}"] = found
    times = frames.drop_duplicates(["result", "frame"]).groupby("result")
    ms_of = {str(result): dict(zip(own["frame"], own["ms"], strict=True)) for result, own in times}
    in_time: dict[str, dict[str, float | None]] = {}
    for row in source.sequences.to_dict("records"):
        if row["metric"] in METRICS:
            in_time.setdefault(row["result"], {})[f"{row['part']}/{row['metric']}"] = _number(row["value"])
    results = []
    for row in summary.results.to_dict("records"):
        result, scene = str(row["result"]), str(row["scene"])
        known = scene in number_of
        indices = scenes[number_of[scene]]["frames"] if known else []
        results.append(
            {
                "id": result,
                "entry": int(row["entry"]),
                "scene": number_of[scene] if known else None,
                "room": scene,
                "seed": str(row["seed"]),
                "reason": None if row["status"] == "ok" else str(row["reason"] or "no reason was recorded"),
                "costs": _costs(row),
                "ms": _numbers(ms_of.get(result, {}).get(frame, math.nan) for frame in indices),
                "series": series.get(result, {}),
                "inTime": in_time.get(result, {}),
            }
        )
    return results


def _described(machine: Any) -> list[list[str]]:
    # Nested facts, such as versions, are told in one line.
    if not isinstance(machine, dict):
        return [["machine", str(machine)]]
    told = []
    for name, value in machine.items():
        if value in (None, "", {}):
            continue
        if isinstance(value, dict):
            value = ", ".join(f"{key} {version}" for key, version in value.items())
        told.append([str(name), str(value)])
    return told


def _magma() -> str:
    # The colour map of the FLIP papers (Andersson et al. 2020, section 5): 256 × RGB.
    from matplotlib import colormaps

    return base64.b64encode((colormaps["magma"](np.arange(256), bytes=True)[:, :3]).tobytes()).decode()


def _numbers(values: Iterable[Any]) -> list[float | None]:
    return [_number(value) for value in values]


def _number(value: Any) -> float | None:
    if value is None or not math.isfinite(value):
        return None
    rounded = float(f"{float(value):.{DIGITS}g}")
    return int(rounded) if rounded == int(rounded) else rounded


def _inline(data: dict[str, Any]) -> str:
    # Inside <script> only "<" can end the element or begin a comment (WHATWG HTML, 4.12.1.3).
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
