"""Methods, found by the entry-point group `gibench.methods`; only their light cards are imported here."""

from __future__ import annotations

import difflib
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import cache
from importlib.metadata import EntryPoint, entry_points

from gibench.baselines.method import Method, MethodError
from gibench.benchmarks.errors import RegistryError

GROUP = "gibench.methods"


@dataclass(frozen=True)
class Found:
    """A method and where it comes from. package: name of the distribution, version: its."""

    method: Method
    package: str
    version: str


@dataclass(frozen=True)
class Broken:
    """An entry point that cannot be used, and why."""

    name: str
    package: str
    reason: str

    def __str__(self) -> str:
        """One line for the user."""
        return f"entry point '{self.name}' of package {self.package} cannot be used: {self.reason}"


@dataclass(frozen=True)
class Registry:
    """Methods of the installed packages.

    methods: id → every claim of that id, one where all is well. broken: entry points that could not be used; they
    keep nothing else from working.
    """

    methods: dict[str, tuple[Found, ...]]
    broken: tuple[Broken, ...]

    def get(self, id: str) -> Found:
        """The method of that id. Raises RegistryError: unknown (with the nearest), broken, or claimed twice."""
        claims = self.methods.get(id, ())
        if not claims:
            for broken in self.broken:
                if broken.name == id:
                    raise RegistryError(f"{broken}; mend or uninstall that package")
            near = difflib.get_close_matches(id, self.methods, n=3, cutoff=0.5)
            known = (
                "did you mean " + " or ".join(f"'{n}'" for n in near) + "?"
                if near
                else "known are " + (", ".join(sorted(self.methods)) or "none: is gibench installed?")
            )
            raise RegistryError(f"no method '{id}'; {known}")
        if len(claims) > 1:
            packages = " and ".join(sorted(f"{claim.package} {claim.version}" for claim in claims))
            raise RegistryError(
                f"method '{id}' is claimed by {packages}: uninstall one of them, or rename its method"
            )
        return claims[0]

    def on_track(self, track: str) -> list[Found]:
        """Methods that run on a track, by id. Raises RegistryError where two packages claim one of them."""
        return [
            self.get(id)
            for id, claims in sorted(self.methods.items())
            if any(track in claim.method.tracks for claim in claims)
        ]


def _load(point: EntryPoint) -> Found | Broken:
    package = point.dist.name if point.dist is not None else "of unknown name"
    version = point.dist.version if point.dist is not None else ""
    try:
        method = point.load()
    except Exception as problem:  # whatever a stranger's module raises must not break the listing
        reason = " ".join(str(problem).split())
        return Broken(point.name, package, f"{point.value} raises {type(problem).__name__}: {reason}")
    if not isinstance(method, Method):
        return Broken(point.name, package, f"{point.value} is no gibench.baselines.method.Method")
    try:
        method.with_variants()
    except MethodError as problem:
        return Broken(point.name, package, f"{point.value}: {problem}")
    return Found(method, package, version)


def registry_of(points: Iterable[EntryPoint]) -> Registry:
    """The registry of given entry points."""
    methods: dict[str, list[Found]] = {}
    broken = []
    for loaded in map(_load, sorted(points, key=lambda point: point.name)):
        if isinstance(loaded, Broken):
            broken.append(loaded)
        else:
            for method in loaded.method.with_variants():
                methods.setdefault(method.id, []).append(replace(loaded, method=method))
    return Registry({id: tuple(claims) for id, claims in methods.items()}, tuple(broken))


@cache
def installed() -> Registry:
    """The registry of what is installed, looked up once a process."""
    return registry_of(entry_points(group=GROUP))
