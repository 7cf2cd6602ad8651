"""A run made up of real arrays: small painted rooms, methods that blur or add noise, metrics truly computed."""

from __future__ import annotations

import hashlib
import json
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.ndimage import gaussian_filter

from gibench.metrics import evaluate, reference_exposure

PREPARED = {"lightmap": (40, 0, 0, 0), "probes": (40, 300, 0, 0), "network": (40, 60, 90, 400)}
STAGES = {
    "path-traced": ("g-buffer", "ray casting", "denoising"),
    "lightmap": ("g-buffer", "gather"),
    "probes": ("g-buffer", "search", "gather", "filtering"),
    "network": ("g-buffer", "search", "inference"),
}


@dataclass(frozen=True)
class Setting:
    """One made-up setting: its noise and blur decide the images, its milliseconds the times."""

    method: str
    knobs: dict = field(default_factory=dict)
    shown: str = ""
    kind: str = "probes"
    noise: float = 0.0
    blur: float = 1.0
    ms: float = 20.0
    specular: bool = True

    @property
    def label(self):
        return f"{self.method} {self.shown}".strip()


def settings():
    """Methods like those of the walkthrough track."""
    found = [
        Setting("lightmap", kind="lightmap", blur=6, ms=5, specular=False),
        Setting("nearest-probe", kind="probes", blur=5, ms=11),
        Setting("ulr", kind="probes", blur=3.4, ms=24),
        Setting("isg", kind="lightmap", blur=2.8, ms=30),
        Setting("rtrt", {"rays": 4}, kind="lightmap", blur=1.3, ms=130),
    ]
    for spp in (1, 4, 16):
        for oidn in (False, True):
            words = " ".join(filter(None, ["" if spp == 4 else f"spp={spp}", "oidn" if oidn else ""]))
            found.append(
                Setting(
                    "path-traced",
                    {"spp": spp, "oidn": oidn},
                    words,
                    "path-traced",
                    noise=(0.25 if oidn else 1.2) / spp**0.5,
                    blur=0.6 if oidn else 0,
                    ms=40 * spp + (60 if oidn else 0),
                )
            )
    return found


class SyntheticRun:
    """What `write_report` takes, made up.

    failed: labels whose result of the last scene failed. machines: each has its own results of every setting.
    looks: at the held-out error of a training; networks train, for each room and seed. seeds: of every setting.
    stills: how many frames, from the first on, are in no sequence.
    """

    def __init__(
        self,
        root,
        *,
        chosen=None,
        scenes=3,
        frames=4,
        size=(48, 32),
        metrics=("rmse", "flip", "psnr"),
        failed=(),
        machines=("cpu-a",),
        measured=True,
        parts=("full", "specular"),
        looks=12,
        seeds=(1,),
        stills=0,
    ):
        self.root = Path(root)
        self.settings = settings() if chosen is None else chosen
        self.scenes = [f"room-{number:06d}" for number in range(scenes)]
        self.indices = list(range(frames))
        self.width, self.height = size
        self.metrics, self.failed, self.machines = metrics, failed, machines
        self.measured, self.parts = measured, parts
        self.looks, self.seeds, self.stills = looks, seeds, stills
        self.read = []
        self.run = {
            "track": "walkthrough",
            "preset": "smoke",
            "seed": 1,
            "machine": {
                "cpu": "Imaginary(R) Processor 8481C CPU @ 2.70GHz",
                "gpu": None,
                "threads": 2,
                "cores": 2,
                "mitsuba": "3.9.1",
            },
            "created": "2025-01-01T00:00:00Z",
        }

    def who(self):
        for machine in self.machines:
            for setting in self.settings:
                for scene in self.scenes:
                    for seed in self.seeds:
                        key = f"{machine}/{setting.label}/{scene}" + (f"/{seed}" if seed != 1 else "")
                        yield hashlib.sha256(key.encode()).hexdigest()[:16], machine, setting, scene, seed

    @cached_property
    def of(self):
        return {result: (setting, scene) for result, _, setting, scene, _ in self.who()}

    @cached_property
    def results(self):
        rows = []
        for result, machine, setting, scene, seed in self.who():
            broken = setting.label in self.failed and scene == self.scenes[-1]
            wobble = 1 + 0.1 * self.scenes.index(scene)
            parts = dict(
                zip(
                    ("lightmap", "probes", "references", "training"),
                    PREPARED.get(setting.kind, (0, 0, 0, 0)),
                    strict=True,
                )
            )
            number = np.nan if broken else 1.0
            rows.append(
                {
                    "result": result,
                    "track": "walkthrough",
                    "scene": scene,
                    "method": setting.method,
                    "title": setting.method.replace("-", " ").title(),
                    "family": setting.kind,
                    "label": setting.label,
                    "knobs": json.dumps(setting.knobs),
                    "seed": seed,
                    "status": "failed" if broken else "ok",
                    "reason": "Traceback (most recent call last):\n  File\nMemoryError: <b>no</b> room"
                    if broken
                    else "",
                    "frames": 0 if broken else len(self.indices),
                    "ms_median": setting.ms * wobble * number,
                    "ms_p95": setting.ms * wobble * 1.3 * number,
                    "prepare_s": sum(parts.values()) * wobble * number,
                    **{f"prepare_{name}_s": s * wobble * number for name, s in parts.items()},
                    "bytes": (sum(parts.values()) * 3e5) * number,
                    "peak_mb": (400 + setting.ms) * number,
                    "machine": machine,
                }
            )
        return pd.DataFrame(rows)

    @cached_property
    def done(self):
        return [row for row in self.results.itertuples() if row.status == "ok"]

    @cached_property
    def stages(self):
        rows = []
        for row in self.done:
            names = STAGES[self.of[row.result][0].kind]
            for position, name in enumerate(names):
                share = (position + 1) / sum(range(1, len(names) + 1))
                rows.append((row.result, name, row.ms_median * share, row.ms_p95 * share))
        return pd.DataFrame(rows, columns=["result", "stage", "ms_median", "ms_p95"])

    @cached_property
    def frames(self):
        rows = []
        rng = np.random.default_rng(5)
        for row in self.done:
            setting, scene = self.of[row.result]
            for frame in self.indices:
                ms = row.ms_median * rng.uniform(0.9, 1.2)
                for part in self.parts:
                    if part == "specular" and not setting.specular:
                        continue
                    for metric, value in self.scores(setting, scene, frame, part, rng).items():
                        rows.append((row.result, frame, ms, metric, part, value))
        return pd.DataFrame(rows, columns=["result", "frame", "ms", "metric", "part", "value"])

    def scores(self, setting, scene, frame, part, rng):
        if not self.measured:
            level = (0.01 + 0.02 * setting.blur + 0.1 * setting.noise) * rng.uniform(0.8, 1.25)
            return {name: 20 - 10 * np.log10(level) if name == "psnr" else level for name in self.metrics}
        found = evaluate(
            self.paint(setting, scene, frame, part),
            self.reference(scene, frame, part),
            metrics=self.metrics,
            exposure=self.exposure(scene, frame),
        )
        return {name: found[name] for name in self.metrics}

    @cached_property
    def sequences(self):
        rows = [
            (row.result, "walk", "warping_error", part, 0.01 + 0.05 * self.of[row.result][0].noise)
            for row in self.done
            for part in self.parts
            if part == "full" or self.of[row.result][0].specular
        ]
        return pd.DataFrame(rows, columns=["result", "sequence", "metric", "part", "value"])

    @cached_property
    def extras(self):
        rows = [(row.result, frame, "lit", 0.25) for row in self.done for frame in self.indices]
        return pd.DataFrame(rows, columns=["result", "frame", "name", "value"])

    @cached_property
    def curves(self):
        rows = []
        for number, row in enumerate(self.done):
            setting, scene = self.of[row.result]
            if setting.kind != "network":
                continue
            rng = np.random.default_rng([number, self.looks])
            level, seconds = setting.blur * (1 + 0.3 * self.scenes.index(scene)), 0.05
            for look in range(self.looks):
                error = (
                    level * (0.1 + 0.9 * np.exp(-5 * look / max(1, self.looks - 1))) * rng.uniform(0.95, 1.05)
                )
                rows.append((row.result, 0, 100 * look, seconds, error, False))
                seconds += row.prepare_training_s / self.looks * rng.uniform(0.9, 1.1)
        return pd.DataFrame(rows, columns=["result", "training", "step", "seconds", "error", "kept"])

    @cached_property
    def paths(self):
        rows = [
            (scene, frame, "" if frame < self.stills else "walk")
            for scene in self.scenes
            for frame in self.indices
        ]
        return pd.DataFrame(rows, columns=["scene", "frame", "sequence"])

    @cached_property
    def floor(self):
        rows = [
            (scene, frame, metric, part, 45.0 if metric == "psnr" else 0.004)
            for scene in self.scenes
            for frame in self.indices
            for metric in self.metrics
            for part in self.parts
        ]
        return pd.DataFrame(rows, columns=["scene", "frame", "metric", "part", "value"])

    def exposure(self, scene, frame):
        return float(reference_exposure(self.reference(scene, self.indices[0], "full")))

    def reference(self, scene, frame, part):
        return paint_room(self.scenes.index(scene), frame, part, self.width, self.height)

    def paint(self, setting, scene, frame, part):
        image = gaussian_filter(self.reference(scene, frame, part), (setting.blur, setting.blur, 0))
        if setting.noise:
            seed = [frame, int(setting.noise * 1000), self.scenes.index(scene)]
            speckle = np.random.default_rng(seed).exponential(1, image.shape) - 1
            image = image * np.maximum(0, 1 + setting.noise * speckle)
        return np.ascontiguousarray(image, np.float32)

    def prediction(self, result, frame, part):
        self.read.append((result, frame, part))
        return self.paint(*self.of[result], frame, part)


@lru_cache(maxsize=512)
def paint_room(number, frame, part, width, height):
    """A tiled floor, a wall, a lamp far above 1 and a glossy highlight that moves with the camera."""
    y, x = np.mgrid[0:height, 0:width].astype(np.float32)
    u, v = (x + 0.5) / width, (y + 0.5) / height
    shift = 0.01 * frame
    floor = np.where((np.floor((u + shift) * 10) + np.floor(v * 8)) % 2 > 0, 0.7, 0.25)
    wall = 0.5 + 0.3 * np.sin((u + shift) * 7 + number)
    tint = np.array([1.0, 0.85 - 0.05 * number, 0.6 + 0.1 * number], np.float32)
    base = np.where(v > 0.55, floor, wall)[..., None] * tint * (0.3 + 0.7 * v[..., None])
    glow = 6 * np.exp(-(((u - 0.5 + shift) / 0.08) ** 2) - ((v - 0.75) / 0.05) ** 2)[..., None]
    glow = glow * np.ones(3, np.float32)
    lamp = np.where((u - 0.3) ** 2 + (v - 0.12) ** 2 < 0.004, 60.0, 0.0)[..., None] * tint
    image = glow if part == "specular" else base + glow + lamp
    return np.ascontiguousarray(image, np.float32)
