"""Small methods that do what real ones do, and what they should not: crash, hang, return nonsense."""

from __future__ import annotations

import ctypes
import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from gibench.baselines.method import Knob, Method, Prediction
from gibench.benchmarks.registry import Found


def card(name: str, **changes) -> Method:
    """A card for the class `name` of this module."""
    values = {
        "id": name.lower(),
        "title": f"A toy that is called {name}",
        "family": "toys",
        "tracks": ("walkthrough",),
        "paper": "none",
        "implementation": f"tests.benchmarks.toys:{name}",
    }
    return Method(**values | changes)


def found(name: str, **changes) -> Found:
    return Found(card(name, **changes), "toys", "1.0")


SHADE = Knob("shade", 1.0, (0.25, 0.5, 1.0, 2.0), "radiance of the image")
STYLE = Knob("style", "plain", ("plain", "fancy"), "decides what is baked", bakes=True)
PAUSE = Knob("pause", 0.0, (0.0, 0.01, 0.03, 0.1), "seconds a frame takes")


def image(view, value: float) -> np.ndarray:
    width, height = view.resolution
    return np.full((height, width, 3), value, np.float32)


class Constant:
    """One colour. Bakes a file, reads its training views where it may, and keeps count of what it prepared."""

    def __init__(self, settings):
        self.settings = dict(settings)

    def prepare(self, site):
        def make(folder):
            time.sleep(0.05)
            (folder / "colour.txt").write_bytes(b"x" * 1000)

        site.bakes.get("lightmap", {"style": self.settings.get("style")}, make)
        with site.stages.stage("training"):
            time.sleep(0.02)
        for frame in site.training[:1]:
            assert frame["color"].shape == (*site.resolution[::-1], 3)
        print("prepared", os.getpid(), file=sys.stderr)

    def adjust(self, settings):
        self.settings = dict(settings)

    def render(self, view, stages):
        assert (view.previous is None) == (view.index == 0)
        with stages.stage("gather"):
            time.sleep(self.settings.get("pause", 0.0))
        shade = self.settings.get("shade", 1.0)
        return Prediction(image(view, shade), image(view, shade / 2), {"process": os.getpid()})


class Plain:
    """Has no specular part, no stages and no `adjust`."""

    def __init__(self, settings):
        self.shade = settings.get("shade", 1.0)

    def prepare(self, site):
        pass

    def render(self, view, stages):
        return Prediction(image(view, self.shade), None, {"process": os.getpid(), "odds": float("nan")})


class Wrong:
    """Does what its knob says, in frame 1 or in the preparation."""

    def __init__(self, settings):
        self.how = settings["how"]

    def prepare(self, site):
        print("getting ready", flush=True)
        if self.how == "unprepared":
            raise ValueError("no bricks")

    def adjust(self, settings):
        self.how = settings["how"]

    def render(self, view, stages):
        colour = image(view, 1.0)
        if view.index == 1:
            if self.how == "crash":
                raise RuntimeError("the roof\nfell in\udc80")
            if self.how == "segfault":
                ctypes.string_at(0)
            if self.how == "exit":
                os._exit(3)
            if self.how == "hang":
                time.sleep(600)
            if self.how == "disk":
                raise OSError(28, "No space left on device", "/nowhere")
            colour[2, 3] = {"nan": np.nan, "negative": -1.0, "infinite": np.inf}.get(self.how, 1.0)
            if self.how == "shape":
                colour = colour[:, :-1]
            if self.how == "integers":
                colour = colour.astype(np.uint8)
            if self.how == "none":
                return None
        return Prediction(colour)


def strike(mark: Path, number: int, *, again: bool) -> None:
    """Send a signal to the process that watches this one and wait for the end; again: not the first time alone."""
    if again or not mark.exists():
        mark.parent.mkdir(parents=True, exist_ok=True)
        with mark.open("a") as tries:
            tries.write("x")
        os.kill(os.getppid(), number)
        time.sleep(600)


class Deadly:
    """Kills the process that watches it, the first time or every time."""

    def __init__(self, settings):
        self.how = settings["how"]

    def prepare(self, site):
        strike(site.bakes.root.parent / "killed", signal.SIGKILL, again=self.how == "always")

    def render(self, view, stages):
        return Prediction(image(view, 0.5))


HOWS = ("crash", "segfault", "exit", "nan", "negative", "infinite", "shape", "integers", "none")
WRONG = found(
    "Wrong", knobs=(Knob("how", "well", ("well", *HOWS, "hang", "disk", "unprepared"), "what goes wrong"),)
)
DEADLY = found("Deadly", knobs=(Knob("how", "once", ("once", "always"), "when", bakes=True),))
CONSTANT = found("Constant", knobs=(SHADE, STYLE, PAUSE), channels=("color",), budget="shade")
PLAIN = found("Plain", knobs=(SHADE,))


class Learner:
    """Trains: keeps the mean of what it is given, or fails, or stops or kills the process that watches it."""

    def __init__(self, settings):
        self.settings = dict(settings)

    def train(self, training):
        if self.settings["how"] == "failing":
            raise ValueError("nothing to learn")
        if self.settings["how"] == "deadly":
            strike(training.folder.parents[1] / "killed", signal.SIGKILL, again=True)
        if self.settings["how"] == "stopping":
            strike(training.folder.parents[1] / "stopped", signal.SIGSTOP, again=False)
        mean = np.mean([frame["color"].mean() for frame in training.views])
        (training.folder / "mean.txt").write_text(f"{mean} {training.views.rooms} {training.seconds}")

    def prepare(self, site):
        self.mean = float((site.weights / "mean.txt").read_text().split()[0])
        assert not list(site.folder.rglob("*.exr"))

    def render(self, view, stages):
        return Prediction(image(view, self.mean))


LEARNER = found(
    "Learner",
    knobs=(Knob("how", "well", ("well", "failing", "deadly", "stopping"), "what goes wrong", trains=True),),
    channels=("color",),
    trains=True,
)
