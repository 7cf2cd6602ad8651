"""Scoring: metrics of predictions that lie on disk, computed once each, so that a new metric needs no rerun.

All frames of a sequence are seen under one exposure, that of its references, and a still under its own; their parts
too. Where references keep their samples beside what is denoised, quadratic metrics are against the truth and not
against the reference (`gibench.metrics.unbiased`).

What a reference is wrong by is scored beside, as its floor: of quadratic metrics its true error, where there are
samples. For the others it is the mean of two renderings a and b of the same variance, so that its own error has at
least the variance of (a − b)/2 = a − reference: metric(a, reference) is what a perfect method would get if denoising
had no bias. One frame has too few pixels to say how far a good reference is from the truth, so that floor is of all
frames of a scene together, and the same for each.
"""

from __future__ import annotations

import importlib.util
import os
import warnings
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from functools import cache, partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

import gibench
from gibench import metrics
from gibench.baselines.sources import digest, module_of
from gibench.benchmarks import predictions
from gibench.benchmarks.errors import ResultsError, RunError
from gibench.benchmarks.records import Scores
from gibench.benchmarks.references import read_reference, reference_parts
from gibench.benchmarks.result_files import FORMAT, RunFolder
from gibench.benchmarks.scenes import SceneFiles, scenes_in
from gibench.benchmarks.track import CHANNELS_OF
from gibench.datasets.errors import MakingError
from gibench.datasets.files import as_json, write_whole
from gibench.datasets.making import default_threads
from gibench.datasets.pool import Listener, Report, Work, run_rooms
from gibench.errors import GibenchError

Image = NDArray[np.float32]
Frames = Callable[[int], dict[str, Image]]  # frame → part → image

#: Modules that decide a score beside that of the metric.
SHARED = ("gibench.metrics.evaluate", "gibench.metrics.unbiased", "gibench.metrics.reprojection")


@dataclass(frozen=True)
class Scored:
    """Result of scoring. done: score files that were written or completed. skipped: metric → why, each with how
    many results it concerns. problems: results that cannot be read, one line each. clipped: metric → how many values
    stand as 0 for an estimate below it."""

    done: int
    skipped: dict[str, tuple[str, int]]
    problems: tuple[str, ...]
    clipped: dict[str, int]


def score(
    folder: RunFolder,
    *,
    more: Sequence[str] = (),
    on_progress: Callable[[int, int], None] = lambda done, of: None,
    told: Callable[[str], None] = lambda remark: None,
) -> Scored:
    """Compute what is missing of the metrics of all results of a run.

    more: metrics beside those of the track. on_progress: called with (done, of). told: of a process that hangs, whose
    result is scored again in a new one. Raises ResultsError, UnknownMetricError, RunError where a result takes two
    processes with it.
    """
    run = folder.read_run()
    names = tuple(dict.fromkeys([*run["metrics"], *run["sequence_metrics"], *more]))
    for name in names:
        metrics.metric(name)  # an unknown one is named here, before any work
    unusable = _unusable(names)
    scenes = {scene.name: scene for scene in scenes_in(*folder.references)}
    owners: list[tuple[str, SceneFiles]] = []
    problems: list[str] = []
    for id in folder.ids():
        try:
            record = folder.read_result(id)
        except ResultsError as damage:
            problems.append(str(damage))
            continue
        if record["status"] == "ok":
            scene = scenes.get(record["config"]["scene"])
            if scene is None or scene.sha256 != record["config"]["scene_sha256"]:
                problems.append(
                    f"{folder.result_file(id)} is of a scene that is not here any more: its dataset was made anew"
                )
                continue
            if changed := folder.changed_frame(record):
                problems.append(
                    f"{folder.result_file(id)}: {changed}: remove it and run the same command again"
                )
                continue
            owners.append((id, scene))
    used = sorted({scene.name for _, scene in owners})
    exposures = {name: exposures_of(folder, scenes[name], anew=True) for name in used}
    units = [
        _Unit(folder, id, scene, names, tuple(run["parts"]), unusable, exposures[scene.name])
        for id, scene in [*owners, *((None, scenes[name]) for name in used)]
    ]
    wanting = [unit for unit in units if unit.missing()]
    on_progress(0, len(wanting))
    skipped: Counter[tuple[str, str]] = Counter()
    clipped: Counter[str] = Counter()
    finished = 0

    def heard(unit: int, outcome: _Outcome) -> None:
        nonlocal finished
        skipped.update(outcome.skipped.items())
        clipped.update(outcome.clipped)
        if outcome.problem:
            problems.append(outcome.problem)
        finished += 1
        on_progress(finished, len(wanting))

    _score_all(wanting, heard, told)
    return Scored(
        len(wanting),
        {name: (why, count) for (name, why), count in skipped.items()},
        tuple(problems),
        dict(clipped),
    )


@cache
def code_of(name: str) -> str:
    """Digest of the sources that decide a metric's values: where it changes, they are computed anew."""
    return digest(module_of(metrics.metric(name).function), *SHARED)


def _unusable(names: Iterable[str]) -> dict[str, str]:
    """Metrics that cannot be computed here, and why: nothing is fetched behind the user's back."""
    wanted = [name for name in names if name.startswith("lpips")]
    if not wanted:
        return {}
    for package in ("torch", "lpips"):
        if importlib.util.find_spec(package) is None:
            return dict.fromkeys(wanted, f"{package} is not installed: pip install 'gibench[bench]'")
    state = metrics.weights_state()
    if state.state != "cached":
        return dict.fromkeys(wanted, f"its weights are {state.state}: {state.command}")
    return {}


@dataclass(frozen=True)
class _Outcome:
    """What came of a unit. skipped: metric → why. problem: what is wrong with the result, if anything. clipped: metric
    → how many values."""

    skipped: dict[str, str]
    problem: str
    clipped: dict[str, int]


def _score_all(
    units: Sequence[_Unit],
    heard: Callable[[int, _Outcome], None],
    told: Callable[[str], None],
) -> None:
    """Score units, in as many processes as there are cores. heard: of each that is done. Raises RunError."""
    workers = min(default_threads(1), len(units))
    if workers <= 1:
        for number, unit in enumerate(units):
            heard(number, _scored(unit))
        return
    listener = Listener(
        ready=lambda facts: None,
        message=lambda unit, kind, content: None,
        done=heard,
        died=lambda unit: None,
        told=lambda remark: told(f"{remark}; once more in a new one"),
    )
    try:
        run_rooms(_work(units), range(len(units)), listener, workers=workers)
    except MakingError as problem:
        raise RunError(str(problem)) from None


def _work(units: Sequence[_Unit]) -> Work:
    return Work(
        setup=_one_thread,
        job=partial(_scored_one, units),
        place=tuple(unit.place for unit in units).__getitem__,
        again="out of memory? `gibench bench score` continues",
        rooms_per_worker=float("inf"),  # no renderer, which would grow
    )


def _one_thread() -> None:
    # One process a core: torch with all cores in each of them would be slower.
    os.environ["OMP_NUM_THREADS"] = "1"


def _scored_one(units: Sequence[_Unit], unit: int, report: Report) -> _Outcome:
    return _scored(units[unit])


@dataclass(frozen=True)
class _Unit:
    """One score file: of a result, or with id None of the reference's own noise."""

    folder: RunFolder
    id: str | None
    scene: SceneFiles
    names: tuple[str, ...]
    parts: tuple[str, ...]
    unusable: dict[str, str]
    exposures: tuple[float, ...]

    @property
    def place(self) -> str:
        """What is scored, for messages."""
        return f"{self.scene.name}: reference" if self.id is None else f"result {self.id}"

    def read(self) -> dict[str, Any]:
        """The file so far; an empty one where it is against other references."""
        scores = read_scores(self.folder, self.id or self.scene.name)
        if scores is None or scores.get("references") != self.scene.references_sha256:
            return {"format": FORMAT, "frames": {}, "sequences": {}, "skipped": {}}
        return scores

    def missing(self) -> list[str]:
        """Metrics that the file lacks, or has from other code: neither values nor why there are none."""
        scores = self.read()
        known = {metric for part in scores["frames"].values() for metric in part}
        known |= {
            metric for part in scores["sequences"].values() for named in part.values() for metric in named
        }
        codes, skipped = scores.get("codes", {}), scores["skipped"]

        def is_done(name: str) -> bool:
            if name in skipped and name in self.unusable:
                return True
            return (name in known or name in skipped) and codes.get(name) == code_of(name)

        return [name for name in self.names if not is_done(name)]


def read_scores(folder: RunFolder, name: str) -> dict[str, Any] | None:
    """A score file, None where there is none. name: id of a result, or a scene's. Raises ResultsError."""
    path = folder.score_file(name)
    if not path.exists():
        return None
    remedy = f"remove it and run `gibench bench score {folder.root}`"
    return folder.read_checked(path, Scores, remedy, _by_sequence)


def _by_sequence(scores: dict[str, Any]) -> dict[str, Any]:
    """Scores of before a scene had several sequences: the values of its one path stood without a name."""
    sequences = scores.get("sequences")
    if not isinstance(sequences, dict):
        return scores
    named = {
        part: {"path": values}
        if isinstance(values, dict) and not any(isinstance(value, dict) for value in values.values())
        else values
        for part, values in sequences.items()
    }
    return {**scores, "sequences": named}


def _scored(unit: _Unit) -> _Outcome:
    """Complete a score file."""
    scores, missing = unit.read(), unit.missing()
    skipped = {name: unit.unusable[name] for name in missing if name in unit.unusable}
    frames = None
    if unit.id is not None:
        predicted = _predicted(unit.folder, unit.id)

        def frames(frame: int) -> dict[str, Image]:
            return {part: image for part, image in predicted(frame).items() if part in unit.parts}

    chosen = [metrics.metric(name) for name in missing if name not in skipped]
    try:
        new = compute(
            frames,
            unit.scene,
            [d.name for d in chosen if d.inputs == "image"],
            [d.name for d in chosen if d.inputs == "sequence"],
            unit.exposures,
            unit.parts,
        )
    except GibenchError as problem:
        return _Outcome({}, str(problem), {})
    for part, values in new["frames"].items():
        scores["frames"].setdefault(part, {}).update(values)
    for part, sequences in new["sequences"].items():
        for name, values in sequences.items():
            scores["sequences"].setdefault(part, {}).setdefault(name, {}).update(values)
    skipped |= new["skipped"]
    scores["skipped"] = {
        name: why for name, why in {**scores["skipped"], **skipped}.items() if name not in new["done"]
    }
    done = set(new["done"])
    of_before = {name: count for name, count in scores.get("clipped", {}).items() if name not in done}
    scores |= {
        "gibench": gibench.__version__,
        "references": unit.scene.references_sha256,
        "exposures": list(unit.exposures),
        "codes": {
            **scores.get("codes", {}),
            EXPOSURES: _exposure_code(),
            **{name: code_of(name) for name in (*new["done"], *new["lasting"])},
        },
        "unbiased": sorted({*scores.get("unbiased", ())} - done | {*new["unbiased"]}),
        "clipped": of_before | new["clipped"],
    }
    unit.folder.scores.mkdir(exist_ok=True)
    write_whole(unit.folder.score_file(unit.id or unit.scene.name), as_json(_finite(scores)))
    return _Outcome(skipped, "", new["clipped"])


def _finite(value: Any) -> Any:
    """Numbers that JSON lacks as None: a frame of which nothing was visible before, equal images in decibels."""
    if isinstance(value, dict):
        return {key: _finite(inner) for key, inner in value.items()}
    if isinstance(value, list):
        return [_finite(inner) for inner in value]
    return None if isinstance(value, float) and not np.isfinite(value) else value


EXPOSURES = "exposures"
"""What the code of exposures is known by among those of metrics."""


def _exposure_code() -> str:
    return digest("gibench.metrics.tone_map")


def exposures_of(folder: RunFolder, scene: SceneFiles, *, anew: bool = False) -> tuple[float, ...]:
    """The exposure that each frame is seen under: `reference_exposure`, shared by the frames of a sequence.

    That of the scores of these references where there are some. anew: only if the same code found them.
    """
    known = read_scores(folder, scene.name) or {}
    current = known.get("references") == scene.references_sha256 or (not anew and "references" not in known)
    if anew:
        current = current and known.get("codes", {}).get(EXPOSURES) == _exposure_code()
    if current and len(known.get("exposures", ())) == len(scene):  # older scores have one, or none
        return tuple(float(exposure) for exposure in known["exposures"])
    exposures = [0.0] * len(scene)
    stills = [range(frame, frame + 1) for frame in range(len(scene)) if scene.stretch(frame) is None]
    for frames in (*stills, *(range(s.first, s.first + s.count) for s in scene.sequences)):
        references = np.stack([reference_parts(scene, frame)["full"] for frame in frames])
        shared = float(metrics.reference_exposure(references, shared=True))
        exposures[frames.start : frames.stop] = [shared] * len(frames)
    return tuple(exposures)


def _predicted(folder: RunFolder, id: str) -> Frames:
    files = folder.read_result(id)["files"]
    return lambda frame: predictions.read(folder.root, id, frame, files[f"{frame:04d}.exr"])


def compute(
    frames: Frames | None,
    scene: SceneFiles,
    image: Sequence[str],
    sequence: Sequence[str],
    exposures: Sequence[float],
    parts: Sequence[str] = tuple(CHANNELS_OF),
) -> dict[str, Any]:
    """Compute metrics of all frames of a scene, two frames in memory at a time.

    frames: predictions; None for what the references themselves are wrong by. parts: that are scored.

    Returns "frames": part → metric → a value a frame; "sequences": part → name of the sequence → metric → the mean over
    its steps, with "_prediction" and "_reference" beside (see `evaluate_sequence`); "skipped": metric → why; "lasting":
    metrics that these frames can never have; "done";
    "unbiased": metrics that are against the truth in all parts; "clipped": of these, metric → how many values stand as
    0 for an estimate below it.
    """
    quadratic = [name for name in image if metrics.is_quadratic(name)]
    biased: set[str] = set()
    clipped: Counter[str] = Counter()
    squares: dict[tuple[str, str], list[metrics.Unbiased]] = {}
    values: dict[str, dict[str, list[float]]] = {}
    steps: dict[str, dict[str, dict[str, list[float]]]] = {}
    skipped: dict[str, str] = {}
    lasting: set[str] = set()
    before: _Step | None = None
    for number in range(len(scene)):
        stretch = scene.stretch(number) if sequence else None
        reference, exposure = read_reference(scene, number), exposures[number]
        predicted = reference.halves[0] if frames is None else frames(number)
        now = _Step(predicted, reference.parts, scene, None if stretch is None else number)
        known = reference.truths(exposure) if quadratic else {}
        for part, pred in now.predicted.items():
            if part not in now.references or part not in parts:
                continue
            if number == 0 and not values:
                impossible, small = _impossible(pred, image)
                skipped, lasting = skipped | impossible, lasting | small
            possible = [name for name in image if name not in skipped]
            truly = [
                name for name in quadratic if name in possible and part in known and known[part].knows(name)
            ]
            biased |= {name for name in image if name not in truly}
            against = [name for name in possible if name not in truly]
            row = metrics.evaluate(pred, now.references[part], metrics=against, exposure=exposure)
            for name in truly:
                if frames is None:
                    squares.setdefault((part, name), []).append(known[part].error_of_reference(name))
                    row[name] = float("nan")
                else:
                    found = known[part].error(name, pred)
                    row[name], clipped[name] = found.value, clipped[name] + found.clipped
            for name in possible:
                values.setdefault(part, {}).setdefault(name, []).append(float(np.float64(row[name])))
            if stretch is not None and scene.before(number) is not None and before is not None:
                for name, value in _step(before, now, part, sequence, exposure).items():
                    named = steps.setdefault(part, {}).setdefault(stretch.name, {})
                    named.setdefault(name, []).append(value)
        before = now
    for (part, name), of_frames in squares.items():
        together = metrics.mean_of(name, of_frames)
        values[part][name] = [together.value] * len(of_frames)
        clipped[name] += together.clipped
    if not any(stretch.count > 1 for stretch in scene.sequences):
        skipped |= dict.fromkeys(sequence, "there is no sequence of two frames or more")
        lasting |= set(sequence)
    return {
        "frames": values,
        "sequences": {
            part: {
                stretch: {name: _mean(row) for name, row in rows.items()} for stretch, rows in named.items()
            }
            for part, named in steps.items()
        },
        "skipped": skipped,
        "lasting": sorted(lasting),
        "done": [name for name in [*image, *sequence] if name not in skipped],
        "unbiased": [name for name in image if name not in biased],
        "clipped": {name: count for name, count in clipped.items() if count},
    }


def _impossible(image: Image, names: Sequence[str]) -> tuple[dict[str, str], set[str]]:
    """Metrics that images of this size have no value of here, and why; and which of them have none anywhere."""
    reasons, small = {}, set()
    for name in names:
        try:
            metrics.evaluate(image, image, metrics=[name], exposure=1.0)
        except metrics.ImageTooSmallError as why:
            reasons[name] = str(why)
            small.add(name)
        except (metrics.WeightsError, metrics.MissingDependencyError) as why:
            reasons[name] = str(why)
    return reasons, small


class _Step:
    """A frame with what the temporal metrics need of it."""

    def __init__(
        self, predicted: dict[str, Image], references: dict[str, Image], scene: SceneFiles, frame: int | None
    ) -> None:
        self.predicted, self.references = predicted, references
        if frame is not None:
            read = scene.half(0, frame, "position", "shape_id", "motion", "motion_valid")
            self.position, self.ids = read["position"], read["shape_id"][..., 0]
            self.motion, self.valid = read["motion"], read["motion_valid"][..., 0] > 0


def _step(before: _Step, now: _Step, part: str, names: Sequence[str], exposure: float) -> dict[str, float]:
    motion = np.stack([before.motion, now.motion])
    visible = metrics.visibility(
        motion, np.stack([before.ids, now.ids]), np.stack([before.position, now.position])
    )
    with warnings.catch_warnings():
        warnings.simplefilter(
            "ignore", metrics.EmptyMaskWarning
        )  # NaN says the same, and is left out of the mean
        row = metrics.evaluate_sequence(
            np.stack([before.predicted[part], now.predicted[part]]),
            np.stack([before.references[part], now.references[part]]),
            metrics=names,
            motion=motion,
            visible=visible & np.stack([before.valid, now.valid]),
            exposure=exposure,
        )
    return {name: float(value) for name, value in row.items() if name != "exposure"}


def _mean(values: Sequence[float]) -> float:
    known = [value for value in values if not np.isnan(value)]
    return float(np.mean(known)) if known else float("nan")
