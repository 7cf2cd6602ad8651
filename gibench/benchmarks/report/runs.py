"""One report of several runs, which may be of several tracks, and boards of groups of frames beside those of all.

A scene of another track is another scene, so its name gains that of the track. Where frames of a track are of several
groups (stills, sequences by name, indoor and outdoor light), the values of each group stand once more as a part of its
own: "full:stills".
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from gibench.benchmarks.report.source import PARTS, ReportError
from gibench.benchmarks.results import WHOLE_PATH, Results
from gibench.benchmarks.scenes import STILLS

if TYPE_CHECKING:
    import pandas as pd

APART = ":"
"""Between the name of a part and that of a group of frames."""


def image_part(part: str) -> str:
    """The part of the image that a part of a board is of."""
    return part.partition(APART)[0]


def part_title(part: str) -> str:
    """Name of a scored part for readers."""
    of, _, group = part.partition(APART)
    return PARTS.get(of, of) + (f", {group}" if group else "")


class Runs:
    """A `ReportSource` of one run or more."""

    def __init__(self, runs: Sequence[Results]) -> None:
        """Raises ReportError for none, and for two runs of one track that have scenes of one name but another content,
        or one setting of a method with other results.
        """
        if not runs:
            raise ReportError("name the folder of a run, or several")
        self._runs = list(runs)
        self.root: Path = runs[0].root
        self._place: dict[str, tuple[Results, str]] = {}
        self._names: dict[tuple[int, str], str] = {}
        content: dict[str, str] = {}
        settings: dict[tuple[Any, ...], tuple[str, Results]] = {}
        for number, run in enumerate(self._runs):
            for record in run.records():
                own, config = str(record["config"]["scene"]), record["config"]
                name = own if self._alone else f"{config['track']}-{own}"
                if content.setdefault(name, config["scene_sha256"]) != config["scene_sha256"]:
                    raise ReportError(
                        f"{run.root} and {self._place[name][0].root} are both of {config['track']}, but their {own} "
                        "is not the same scene: report them apart"
                    )
                what = (name, record["label"], config["seed"], config["machine"])
                id, other = settings.setdefault(what, (record["id"], run))
                if id != record["id"]:
                    raise ReportError(
                        f"{other.root} and {run.root} both have '{record['label']}' in {own}, of other code, knobs or "
                        "training: report them apart, or compare them with `gibench bench compare`"
                    )
                self._place.setdefault(name, (run, own))
                self._names[number, own] = name

    @property
    def _alone(self) -> bool:
        return len(self._runs) == 1

    @cached_property
    def run(self) -> Mapping[str, Any]:
        """Facts common to the runs, and those that differ, side by side; "unbiased": see `Results.unbiased`."""
        facts = [run.run for run in self._runs]

        def both(key: str) -> str:
            return ", ".join(dict.fromkeys(str(one.get(key, "")) for one in facts))

        lists = {
            key: list(dict.fromkeys(name for one in facts for name in one[key]))
            for key in ("metrics", "sequence_metrics", "parts")
        }
        scored = {name for run in self._runs for name in run.frames["metric"].unique()}
        unbiased = [
            name
            for name in scored
            if all(name in run.unbiased for run in self._runs if name in set(run.frames["metric"]))
        ]
        machines = {id: machine for one in facts for id, machine in one.get("machines", {}).items()}
        created = max(str(one.get("created", "")) for one in facts)
        return {
            **facts[0],
            **lists,
            "preset": both("preset"),
            "seed": both("seed"),
            "created": created,
            "machines": machines,
            "unbiased": sorted(unbiased),
        }

    @cached_property
    def results(self) -> pd.DataFrame:
        """As `Results.results`; a result that several runs have stands once."""
        return self._joined("results", self._with_names).drop_duplicates("result", ignore_index=True)

    @cached_property
    def stages(self) -> pd.DataFrame:
        """As `Results.stages`."""
        return self._joined("stages").drop_duplicates(["result", "stage"], ignore_index=True)

    @cached_property
    def extras(self) -> pd.DataFrame:
        """As `Results.extras`."""
        return self._joined("extras").drop_duplicates(["result", "frame", "name"], ignore_index=True)

    @cached_property
    def curves(self) -> pd.DataFrame:
        """As `Results.curves`."""
        return self._joined("curves").drop_duplicates(ignore_index=True)

    @cached_property
    def paths(self) -> pd.DataFrame:
        """Scene, frame, and the sequence that the frame lies in: "" for a still."""
        import pandas as pd

        found: dict[tuple[str, int], str] = {}
        for number, run in enumerate(self._runs):
            for record in run.records():
                scene = self._names[number, str(record["config"]["scene"])]
                # Before frames had tags, a scene had one path and nothing else.
                tags = record.get("tags") or [["path"]] * len(record.get("frames", []))
                for frame, own in enumerate(tags):
                    found[scene, frame] = "" if own[0] == STILLS else str(own[0])
        rows = [(*where, sequence) for where, sequence in sorted(found.items())]
        columns = {"scene": "str", "frame": "int64", "sequence": "str"}
        return pd.DataFrame(rows, columns=list(columns)).astype(columns)

    @cached_property
    def frames(self) -> pd.DataFrame:
        """As `Results.frames`, with the groups of frames as parts."""
        frames = self._joined("frames").drop_duplicates(["result", "frame", "metric", "part"])
        return _grouped(frames, self._tags(), ["result", "frame"])

    @cached_property
    def sequences(self) -> pd.DataFrame:
        """As `Results.sequences`, with each sequence as a part where there are several, and their mean as the part."""
        import pandas as pd

        table = self._joined("sequences").drop_duplicates(["result", "sequence", "metric", "part"])
        whole = table.groupby(["result", "metric", "part"], as_index=False, sort=False)["value"].mean()
        several = table[table.groupby(["result", "metric", "part"])["sequence"].transform("nunique") > 1]
        apart = several.assign(part=several["part"] + APART + several["sequence"])
        return pd.concat([whole, apart[whole.columns]], ignore_index=True)

    @cached_property
    def floor(self) -> pd.DataFrame:
        """As `Results.floor`, with the groups of frames as parts."""
        import pandas as pd

        floor = self._joined("floor", self._with_names)
        floor = floor.drop_duplicates(["scene", "frame", "metric", "part"])
        in_time = floor["frame"] <= WHOLE_PATH
        tags = self._tags().merge(self.results[["result", "scene"]], on="result")
        tags = tags.drop(columns="result").drop_duplicates()
        frames = _grouped(floor[~in_time], tags, ["scene", "frame"])
        return pd.concat([frames, floor[in_time].assign(frame=WHOLE_PATH)], ignore_index=True)

    def prediction(self, result: str, frame: int, part: str) -> NDArray[np.float32]:
        """See `Results.prediction`."""
        return self._of_result[result].prediction(result, frame, image_part(part))

    def reference(self, scene: str, frame: int, part: str) -> NDArray[np.float32]:
        """See `Results.reference`."""
        run, own = self._place[scene]
        return run.reference(own, frame, image_part(part))

    def exposure(self, scene: str, frame: int) -> float:
        """See `Results.exposure`."""
        run, own = self._place[scene]
        return run.exposure(own, frame)

    @cached_property
    def _of_result(self) -> dict[str, Results]:
        return {record["id"]: run for run in reversed(self._runs) for record in run.records()}

    def _joined(
        self, name: str, change: Callable[[int, pd.DataFrame], pd.DataFrame] | None = None
    ) -> pd.DataFrame:
        import pandas as pd

        tables = [getattr(run, name) for run in self._runs]
        if change is not None:
            tables = [change(number, table) for number, table in enumerate(tables)]
        return pd.concat([table for table in tables if len(table)] or tables[:1], ignore_index=True)

    def _with_names(self, number: int, table: pd.DataFrame) -> pd.DataFrame:
        return table.assign(
            scene=[self._names.get((number, str(scene)), str(scene)) for scene in table["scene"]]
        )

    def _tags(self) -> pd.DataFrame:
        """Result, frame and group, for tracks whose frames are not all of the same groups."""
        import pandas as pd

        of: dict[str, list[dict[str, Any]]] = {}
        for run in self._runs:
            for record in run.records():
                of.setdefault(record["config"]["track"], []).append(record)
        rows = []
        for records in of.values():
            # Of the whole track: a room may have stills alone beside rooms with paths.
            if len({tuple(one) for record in records for one in record.get("tags", [])}) > 1:
                rows += [
                    (record["id"], frame, tag)
                    for record in records
                    for frame, own in enumerate(record.get("tags", []))
                    for tag in own
                ]
        return pd.DataFrame(rows, columns=["result", "frame", "tag"]).drop_duplicates()


def _grouped(table: pd.DataFrame, tags: pd.DataFrame, on: list[str]) -> pd.DataFrame:
    """The rows, and once more those of each group, under a part that names it."""
    import pandas as pd

    if tags.empty:
        return table
    apart = table.merge(tags, on=on)
    apart = apart.assign(part=apart["part"] + APART + apart["tag"]).drop(columns="tag")
    return pd.concat([table, apart], ignore_index=True)
