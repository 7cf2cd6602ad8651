"""Results as tables, from which the board, the plots and the comparisons are made."""

from __future__ import annotations

import json
from collections.abc import Mapping
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.benchmarks import machine as machines
from gibench.benchmarks import predictions
from gibench.benchmarks.costs import BOOKED
from gibench.benchmarks.errors import ResultsError
from gibench.benchmarks.references import reference_parts
from gibench.benchmarks.result_files import RunFolder
from gibench.benchmarks.scenes import SceneFiles, scenes_in
from gibench.benchmarks.scoring import exposures_of, read_scores
from gibench.datasets.errors import nearest

if TYPE_CHECKING:
    import pandas as pd

Image = NDArray[np.float32]

COLUMNS = {
    "result": "str",
    "track": "str",
    "scene": "str",
    "method": "str",
    "title": "str",
    "family": "str",
    "label": "str",
    "knobs": "str",
    "seed": "int64",
    "status": "str",
    "reason": "str",
    "frames": "int64",
    "ms_median": "float64",
    "ms_p95": "float64",
    "prepare_s": "float64",
    **{f"prepare_{name}_s": "float64" for name in BOOKED},
    "bytes": "float64",
    "peak_mb": "float64",
    "gpu_mb": "float64",
    "machine": "str",
}

#: The stage of a frame's time that no stage of the method names.
OTHER = "other"

#: Number of the frame in `Results.floor` where a metric is of a whole sequence: the first of a scene.
WHOLE_PATH = -1


class Results:
    """The results of a run.

    root: their folder. run: what `run.json` says: track, preset, seed, machine (cpu, gpu, threads, cores, platform,
    versions …), machines (by id), created, equal_time, asked, runs. Where the same label, scene, seed and machine has
    several results, of versions of the code, of training times or of what the label leaves out, the one stands that was
    made or asked for last; `superseded` counts the others.

    results: a row a result. Columns: result (id), track, scene, method, title, family, label (method and what sets it
    apart), knobs (JSON), seed, status ("ok" or "failed"), reason, frames, ms_median and ms_p95 (of a frame over the
    path, ms), prepare_s (all of the preparation, whoever paid first, s), of which prepare_lightmap_s,
    prepare_probes_s, prepare_references_s, prepare_training_s, bytes (of what was baked, on disk), peak_mb (resident
    memory while rendering), gpu_mb (NaN without one), machine (id). Numbers of failed results are NaN.
    """

    def __init__(self, folder: RunFolder, run: dict[str, Any], records: list[dict[str, Any]]) -> None:
        """See `load`."""
        self.folder, self.root, self.run = folder, folder.root, run
        asked = run.get("asked", {})
        newest: dict[tuple[Any, ...], dict[str, Any]] = {}
        for record in sorted(records, key=lambda r: max(str(r["created"]), asked.get(r["id"], ""))):
            config = record["config"]
            newest[config["scene"], record["label"], config["seed"], config["machine"]] = record
        self.superseded = len(records) - len(newest)
        self._records = {
            record["id"]: record
            for record in sorted(
                newest.values(), key=lambda r: (r["room"], r["config"]["method"], r["label"])
            )
        }

    def among(self, *, room: str | None = None, group: str | None = None) -> Results:
        """The same with the frames of one room alone, of one group of frames, or of both.

        room: name of a scene. group: one that frames are of, such as "stills", "near", "indoor", or the name of a
        sequence. A sequence is among a group if its frames are. Raises ResultsError for what is not there.
        """
        records = list(self._records.values())
        if room is not None:
            rooms = sorted({str(record["config"]["scene"]) for record in records})
            if room not in rooms:
                raise ResultsError(f"{self.root} has no room '{room}'; {nearest(room, rooms)}")
            records = [record for record in records if record["config"]["scene"] == room]
        some = Results(self.folder, self.run, records)
        if group is None:
            return some
        tags = {str(record["config"]["scene"]): record.get("tags", []) for record in records}
        groups = sorted({tag for own in tags.values() for one in own for tag in one})
        if group not in groups:
            known = nearest(group, groups) if groups else "its frames are all of one"
            raise ResultsError(f"{self.root} has no group of frames '{group}'; {known}")
        # With their scene: frames, numbered as in `floor`, and sequences.
        numbers: set[tuple[str, int]] = set()
        names: set[tuple[str, str]] = set()
        for scene, own in tags.items():
            numbers |= {(scene, number) for number, one in enumerate(own) if group in one}
            names |= {(scene, one[0]) for one in own if group in one}
            sequences = (read_scores(self.folder, scene) or {}).get("sequences", {}).values()
            scored = dict.fromkeys(name for by_sequence in sequences for name in by_sequence)
            numbers |= {
                (scene, WHOLE_PATH - order) for order, name in enumerate(scored) if (scene, name) in names
            }
        scenes = some.results.set_index("result")["scene"]
        some.frames = _kept(some.frames, some.frames["result"].map(scenes), "frame", numbers)
        some.sequences = _kept(some.sequences, some.sequences["result"].map(scenes), "sequence", names)
        some.floor = _kept(some.floor, some.floor["scene"], "frame", numbers)
        return some

    @cached_property
    def mixed(self) -> list[str]:
        """Labels whose results are not all of one version of the code, training time and setting of the knobs."""
        found: dict[str, set[str]] = {}
        for record in self._records.values():
            config = record["config"]
            facts = [config.get(name) for name in ("code", "training_seconds", "knobs")]
            found.setdefault(record["label"], set()).add(json.dumps(facts, sort_keys=True))
        return [label for label, several in found.items() if len(several) > 1]

    @cached_property
    def results(self) -> pd.DataFrame:
        """A row a result."""
        import pandas as pd

        rows = [_row(record) for record in self._records.values()]
        return pd.DataFrame(rows, columns=list(COLUMNS)).astype(COLUMNS)

    @cached_property
    def times(self) -> pd.DataFrame:
        """A row a frame that was rendered: result, frame, ms."""
        import pandas as pd

        rows = [
            (id, number, frame["seconds"] * 1000)
            for id, record in self._good()
            for number, frame in enumerate(record["frames"])
        ]
        return pd.DataFrame(rows, columns=["result", "frame", "ms"])

    @cached_property
    def stages(self) -> pd.DataFrame:
        """A row a stage of a result: result, stage, ms_median, ms_p95 over the frames of the path.

        A frame without the stage counts as 0. "other" is what no stage of the method holds.
        """
        import pandas as pd

        rows = []
        for id, record in self._good():
            names = dict.fromkeys(name for frame in record["frames"] for name in frame["stages"])
            for name in names:
                ms = [frame["stages"].get(name, 0.0) * 1000 for frame in record["frames"]]
                rows.append((id, name, *_median_p95(ms)))
            rest = [1000 * (f["seconds"] - sum(f["stages"].values())) for f in record["frames"]]
            rows.append((id, OTHER, *_median_p95([max(0.0, ms) for ms in rest])))
        return pd.DataFrame(rows, columns=["result", "stage", "ms_median", "ms_p95"])

    @cached_property
    def extras(self) -> pd.DataFrame:
        """A row a number that a method says of a frame beside its image: result, frame, name, value.

        NaN where the method had no number.
        """
        import pandas as pd

        rows = [
            (id, number, name, float("nan") if value is None else value)
            for id, record in self._good()
            for number, frame in enumerate(record["frames"])
            for name, value in frame.get("extra", {}).items()
        ]
        columns = {"result": "str", "frame": "int64", "name": "str", "value": "float64"}
        return pd.DataFrame(rows, columns=list(columns)).astype(columns)

    @cached_property
    def curves(self) -> pd.DataFrame:
        """A row a look at the held-out error of a training: result, training, step, seconds, error, kept.

        training: numbers those of a result, from 0. kept: whether the weights are those of this look; False for all of
        a training that does not say. What is trained on rooms stands with every result that uses it.
        """
        import pandas as pd

        rows = [
            (id, number, look["step"], look["seconds"], look["error"], look.get("kept", False))
            for id, record in self._good()
            for number, curve in enumerate(record["prepare"].get("curves", []))
            for look in curve
        ]
        columns = {"result": "str", "training": "int64", "step": "int64", "seconds": "float64"}
        columns |= {"error": "float64", "kept": "bool"}
        return pd.DataFrame(rows, columns=list(columns)).astype(columns)

    @cached_property
    def frames(self) -> pd.DataFrame:
        """A row a frame, metric and part: result, frame, ms, metric, part ("full", "specular"), value.

        Empty before scoring. An undefined value, such as the PSNR of equal images, is NaN.
        """
        import pandas as pd

        rows = [
            (id, number, self._records[id]["frames"][number]["seconds"] * 1000, metric, part, value)
            for id, scores in self._scores.items()
            for part, by_metric in scores["frames"].items()
            for metric, values in by_metric.items()
            for number, value in enumerate(values)
        ]
        columns = {"result": "str", "frame": "int64", "ms": "float64", "metric": "str", "part": "str"}
        return pd.DataFrame(rows, columns=[*columns, "value"]).astype(columns | {"value": "float64"})

    @cached_property
    def sequences(self) -> pd.DataFrame:
        """A row a sequence, temporal metric and part: result, sequence, metric, part, value.

        Beside each metric stand what it measured in the prediction and in the reference, as `<metric>_prediction` and
        `<metric>_reference`.
        """
        import pandas as pd

        rows = [
            (id, sequence, metric, part, value)
            for id, scores in self._scores.items()
            for part, by_sequence in scores["sequences"].items()
            for sequence, by_metric in by_sequence.items()
            for metric, value in by_metric.items()
        ]
        columns = {"result": "str", "sequence": "str", "metric": "str", "part": "str"}
        return pd.DataFrame(rows, columns=[*columns, "value"]).astype(columns | {"value": "float64"})

    @cached_property
    def floor(self) -> pd.DataFrame:
        """Noise floors of the references: scene, frame, metric, part, value.

        Temporal metrics stand under frame −1 (`WHOLE_PATH`) for the first sequence of a scene, −2 for the second, and
        so on.
        """
        import pandas as pd

        rows: list[tuple[Any, ...]] = []
        for scene in sorted({str(record["config"]["scene"]) for record in self._records.values()}):
            scores = read_scores(self.folder, scene)
            for part, by_metric in (scores or {}).get("frames", {}).items():
                for metric, values in by_metric.items():
                    rows += [(scene, number, metric, part, value) for number, value in enumerate(values)]
            for part, by_sequence in (scores or {}).get("sequences", {}).items():
                for number, by_metric in enumerate(by_sequence.values()):
                    rows += [
                        (scene, WHOLE_PATH - number, metric, part, value)
                        for metric, value in by_metric.items()
                    ]
        columns = {"scene": "str", "frame": "int64", "metric": "str", "part": "str"}
        return pd.DataFrame(rows, columns=[*columns, "value"]).astype(columns | {"value": "float64"})

    @cached_property
    def unbiased(self) -> frozenset[str]:
        """Metrics that are against the truth in all results, by samples of the references that were not denoised."""
        found = [(set(scores.get("unbiased", ())), _metrics_in(scores)) for scores in self._scores.values()]
        there = {name for _, names in found for name in names}
        return frozenset(
            name for name in there if all(name in own or name not in names for own, names in found)
        )

    @property
    def skipped(self) -> dict[str, str]:
        """Metrics that could not be computed for some result, and why."""
        return {name: why for scores in self._scores.values() for name, why in scores["skipped"].items()}

    def prediction(self, result: str, frame: int, part: str = "full") -> Image:
        """Predicted image of a frame, (H, W, 3) linear. Raises ResultsError."""
        files = self._records[result]["files"]
        parts = predictions.read(self.root, result, frame, files[f"{frame:04d}.exr"])
        if part not in parts:
            raise ResultsError(f"result {result} has no part '{part}': its method does not tell it apart")
        return parts[part]

    def reference(self, scene: str, frame: int, part: str = "full") -> Image:
        """The reference of a frame of a scene's path, (H, W, 3) linear."""
        return reference_parts(self._scene(scene), frame)[part]

    def exposure(self, scene: str, frame: int) -> float:
        """The exposure that a frame of a scene is seen under: that of its sequence, or its own."""
        return self._exposures(scene)[frame]

    @cache  # noqa: B019 - as long as the results
    def _exposures(self, scene: str) -> tuple[float, ...]:
        return exposures_of(self.folder, self._scene(scene))

    def record(self, result: str) -> Mapping[str, Any]:
        """All that is known of a result, as its JSON file says it: traceback and log of a failed one too."""
        return self._records[result]

    def records(self) -> list[dict[str, Any]]:
        """All that is known of all results."""
        return list(self._records.values())

    def _scene(self, name: str) -> SceneFiles:
        if name not in self._scenes:
            raise ResultsError(f"{self.root} has no scene '{name}'; it has {', '.join(self._scenes)}")
        return self._scenes[name]

    @cached_property
    def _scenes(self) -> dict[str, SceneFiles]:
        return {scene.name: scene for scene in scenes_in(*self.folder.references)}

    @cached_property
    def _scores(self) -> dict[str, dict[str, Any]]:
        found = {}
        for id, record in self._good():
            scores = read_scores(self.folder, id)
            if scores is None:
                continue
            for by_metric in scores["frames"].values():
                for metric, values in by_metric.items():
                    if len(values) != len(record["frames"]):
                        raise ResultsError(
                            f"{self.folder.score_file(id)} is damaged ({len(values)} values of {metric} for "
                            f"{len(record['frames'])} frames): remove it and run `gibench bench score {self.root}`"
                        )
            found[id] = scores
        return found

    def _good(self) -> list[tuple[str, dict[str, Any]]]:
        return [(id, record) for id, record in self._records.items() if record["status"] == "ok"]


def load(root: str | Path) -> Results:
    """Read a folder of results; pixels are read when they are asked for.

    Raises ResultsError: no such folder, one of another version, or a damaged file, each with what to do.
    """
    folder = RunFolder(Path(root))
    run = folder.read_run()
    return Results(folder, run, [folder.read_result(id) for id in folder.ids()])


def _kept(table: pd.DataFrame, scenes: pd.Series, column: str, kept: set[tuple[str, Any]]) -> pd.DataFrame:
    """The rows whose scene and value of a column are among those that are kept."""
    return table[np.array([one in kept for one in zip(scenes, table[column], strict=True)], bool)]


def _metrics_in(scores: Mapping[str, Any]) -> set[str]:
    return {name for by_metric in scores["frames"].values() for name in by_metric}


def _median_p95(values: list[float]) -> tuple[float, float]:
    return float(np.median(values)), float(np.percentile(values, 95))


def _row(record: dict[str, Any]) -> dict[str, Any]:
    config, good = record["config"], record["status"] == "ok"
    prepare = record.get("prepare") or {}
    nan = float("nan")
    median, p95 = _median_p95([frame["seconds"] * 1000 for frame in record["frames"]]) if good else (nan, nan)
    gpu = record.get("gpu_mb")
    return {
        "result": record["id"],
        "track": config["track"],
        "scene": config["scene"],
        "method": config["method"],
        "title": record["title"],
        "family": record["family"],
        "label": record["label"],
        "knobs": json.dumps(config["knobs"]),
        "seed": config["seed"],
        "status": record["status"],
        "reason": record.get("reason", ""),
        "frames": len(record["frames"]) if good else 0,
        "ms_median": median,
        "ms_p95": p95,
        "prepare_s": prepare.get("seconds", nan),
        **{f"prepare_{name}_s": prepare.get(name, nan) for name in BOOKED},
        "bytes": prepare.get("bytes", nan),
        "peak_mb": record.get("peak_mb", nan),
        "gpu_mb": nan if gpu is None else gpu,
        "machine": machines.digest(record["machine"]),
    }
