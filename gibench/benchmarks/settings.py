"""Settings of a method that are run, and their labels on the board."""

from __future__ import annotations

import difflib
import itertools
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass

from gibench.baselines.method import Knob, Method, MethodError, Setting
from gibench.benchmarks.errors import TrackError
from gibench.benchmarks.track import MethodPlan

#: Values of knobs that say nothing without the knob's name.
AMBIGUOUS_VALUES = ("none", "off", "on", "auto")


@dataclass(frozen=True)
class Choice:
    """One setting of every knob of a method. label: what tables and plots call it."""

    knobs: tuple[tuple[str, Setting], ...]
    label: str

    @property
    def settings(self) -> dict[str, Setting]:
        """Knob → value."""
        return dict(self.knobs)


def choices(method: Method, plan: MethodPlan, overrides: Mapping[str, tuple[Setting, ...]]) -> list[Choice]:
    """The settings to run, in the order of the plan.

    overrides: values that win over the plan's. Raises MethodError for a knob or a value that does not exist.
    """
    vary = {**plan.vary, **overrides}
    base = base_settings(method, plan)
    combinations = [
        method.settings({**base, **dict(zip(vary, values, strict=True))})
        for values in itertools.product(*vary.values())
    ]
    return [Choice(tuple(settings.items()), label(method, settings, plan)) for settings in combinations]


def base_settings(method: Method, plan: MethodPlan) -> dict[str, Setting]:
    """Settings that labels leave out: the plan's base, with the first value of what it varies. Raises MethodError."""
    return method.settings({**plan.base, **{knob: values[0] for knob, values in plan.vary.items()}})


def label(method: Method, settings: Mapping[str, Setting], plan: MethodPlan) -> str:
    """Method and what sets it apart: numbers and names that the plan varies, and knobs that differ from its base."""
    words = [method.id]
    base = base_settings(method, plan)
    for knob in method.knobs:
        value = settings[knob.name]
        if value == base[knob.name] and (knob.name not in plan.vary or isinstance(value, bool)):
            continue
        if isinstance(value, bool):
            words.append(knob.name if value else f"no-{knob.name}")
        elif isinstance(value, str) and value not in AMBIGUOUS_VALUES:
            words.append(value)
        else:
            words.append(f"{knob.name}={value:g}" if isinstance(value, float) else f"{knob.name}={value}")
    return " ".join(words)


def parse_overrides(
    texts: Iterable[str], methods: Mapping[str, Method]
) -> dict[str, dict[str, tuple[Setting, ...]]]:
    """Read `method.knob=value` or `method.knob=value,value` as typed.

    methods: those that are run, by id. Raises TrackError for what is no such text or names no method, MethodError for
    an unknown knob or value.
    """
    overrides: dict[str, dict[str, tuple[Setting, ...]]] = {}
    for text in texts:
        name, equals, values = text.partition("=")
        id, dot, knob_name = name.rpartition(".")
        if not (equals and dot and id and knob_name and values):
            raise TrackError(
                f"--set: '{text}' is no setting; write METHOD.KNOB=VALUE, like path-traced.spp=4"
            )
        if id not in methods:
            near = difflib.get_close_matches(id, methods, n=3, cutoff=0.5) or sorted(methods)
            raise TrackError(f"--set: no method '{id}' is run; known are {', '.join(near)}")
        knobs = {knob.name: knob for knob in methods[id].knobs}
        if knob_name not in knobs:
            methods[id].settings({knob_name: values})  # says which there are
        chosen = tuple(_value(methods[id], knobs[knob_name], value.strip()) for value in values.split(","))
        overrides.setdefault(id, {})[knob_name] = chosen
    return overrides


def _value(method: Method, knob: Knob, text: str) -> Setting:
    number = None
    with suppress(ValueError):
        number = float(text)
    for value in knob.values:
        if text.lower() == str(value).lower():
            return value
        if number is not None and not isinstance(value, bool) and value == number:  # 1 for 1.0
            return value
    allowed = ", ".join(str(value) for value in knob.values)
    raise MethodError(f"{method.id}: {knob.name} = {text} is not allowed; allowed are {allowed}")
