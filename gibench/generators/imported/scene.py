"""A scene file imported: read, upgraded, placed, its files found."""

from __future__ import annotations

import hashlib
import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import tostring

import numpy as np

from gibench.generators.imported.analytic import mesh_shapes
from gibench.generators.imported.changes import Change
from gibench.generators.imported.distance_grids import mesh_grids
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import destinations, named_files, settle_missing
from gibench.generators.imported.films import DEFAULT_SIZE, film_of, whole_number
from gibench.generators.imported.finite import check_numbers
from gibench.generators.imported.images import check_images, made_images, plain_roughness
from gibench.generators.imported.mesh_files import check_meshes
from gibench.generators.imported.obj_files import split_objs
from gibench.generators.imported.old_shapes import curve_hair, mesh_height_fields
from gibench.generators.imported.own_cameras import GivenCamera, cameras_of, read_camera_file
from gibench.generators.imported.placing import place, placed_matrix, up_axis
from gibench.generators.imported.reading import SceneTree, read_tree
from gibench.generators.imported.refusals import refusal, with_lines
from gibench.generators.imported.shapes import (
    check_references,
    expand_instances,
    name_everything,
    resolve_aliases,
    share_emitters,
)
from gibench.generators.imported.tree import Node, copied
from gibench.generators.imported.upgrading import upgrade

if TYPE_CHECKING:
    from gibench.rendering.scene import Scene


DEFAULT_DEPTH = -1
"""Mitsuba's, of a path tracer: no limit."""


@dataclass(frozen=True)
class ImportSettings:
    """Options for reading scene files.

    up: axis of the file that is up: "x", "y", "z" or "auto" (`placing.up_axis`). scale: metres of its unit.
    allow_missing: leave out what needs a missing file. allow_outside: read files outside the scene's folder. cameras:
    a camera file (`own_cameras.read_camera_file`). parameters: "name=value", which count before any `<default>`.
    """

    up: str = "auto"
    scale: float = 1.0
    allow_missing: bool = False
    allow_outside: bool = False
    cameras: Path | None = None
    parameters: tuple[str, ...] = ()

    @property
    def values(self) -> dict[str, str]:
        """The parameters by name. Raises SceneFileError for one that is no name=value."""
        pairs = [text.partition("=") for text in self.parameters]
        for (name, equals, _), text in zip(pairs, self.parameters, strict=True):
            if not equals or not re.fullmatch(r"\w+", name):
                raise SceneFileError(f"-D: '{text[:60]}' is no name=value, such as -D samples=64")
        return {name: value for name, _, value in pairs}


@dataclass(frozen=True, eq=False)
class ImportedScene:
    """A scene in Z-up metres that Mitsuba 3 reads.

    name: that of its folder, or of its file where that says more. tree: the scene, its file names as in the source. up,
    scale: what was done to it. cameras: its own, then those of the camera file. resolution: (width, height) of its
    first image; max_depth: of its integrator, as Mitsuba counts. changes: what was rewritten, missing: files that were
    left out, as the scene names them. files: file → name in a room's folder.
    """

    name: str
    tree: SceneTree
    up: str
    scale: float
    cameras: tuple[GivenCamera, ...]
    resolution: tuple[int, int]
    max_depth: int
    changes: tuple[Change, ...]
    missing: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    files: Mapping[Path | str, str] = field(default_factory=dict)

    @cached_property
    def loaded(self) -> Scene:
        """The scene under Mitsuba's current variant. Raises SceneFileError with Mitsuba's reason."""
        from gibench.rendering.backend import select_variant, threads_to_load

        select_variant()
        import mitsuba as mi

        from gibench.rendering.scene import SceneError, wrap

        # Mitsuba reads files alone, and only while it loads.
        with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
            for name, content in self.tree.made.items():
                (Path(scratch) / name).write_bytes(content)

            def absolute(source: Path | str) -> str:
                return f"{scratch}/{source}" if isinstance(source, str) else str(source.resolve())

            text, places = with_lines(self._with_files(absolute))
            try:
                with threads_to_load():
                    loaded = mi.load_string(text, optimize=False)
                self._check_corners(loaded)
                return wrap(loaded)
            except SceneError as problem:
                raise SceneFileError(f"{self.tree.file}: {problem}") from None
            except (RuntimeError, UnicodeDecodeError) as problem:
                raise SceneFileError(refusal(problem, places, self.tree.file, scratch)) from None

    def _check_corners(self, loaded: Any) -> None:
        """Check of shapes that `mesh_files` does not cover, before a ray meets them."""
        for shape in loaded.shapes():
            if not shape.is_mesh() or shape.face_count() == 0:
                continue
            if int(np.array(shape.faces_buffer()).max()) >= shape.vertex_count():
                raise SceneFileError(
                    f"{self.tree.file}: faces of the mesh '{shape.id()}' name vertices that it has not: export it again"
                )

    def with_files(self) -> Node:
        """A copy of the scene whose file names are those of a room's folder."""
        return self._with_files(lambda source: self.files[source])

    def _with_files(self, named: Callable[[Path | str], str]) -> Node:
        copy = replace(self.tree, root=copied(self.tree.root))
        for file in named_files(copy):
            file.element.set(file.attribute, named(file.source))
        return copy.root


def import_scene(file: Path, settings: ImportSettings | None = None) -> ImportedScene:
    """Import a Mitsuba scene file of any version from 0.5 on.

    Raises SceneFileError for whatever is wrong with it, its files or the settings.
    """
    settings = settings or ImportSettings()
    tree = read_tree(file, allow_outside=settings.allow_outside, parameters=settings.values)
    changes = upgrade(tree)

    def note(rule: str) -> Any:
        def take(node: Node, what: str, loss: bool = False) -> None:
            changes.append(Change(rule, what, node.where, loss))

        return take

    check_numbers(tree.root)
    resolve_aliases(tree.root, note("aliases"))
    check_references(tree.root)
    share_emitters(tree.root, note("shared_lights"))
    split_objs(tree, note("obj_files"))
    missing = settle_missing(tree, note("files"), allow_missing=settings.allow_missing)
    check_images(tree)
    check_meshes(tree)
    mesh_height_fields(tree, note("height_fields"))
    curve_hair(tree, note("hair"))
    plain_roughness(tree, note("roughness"))
    made_images(tree, note("images"))
    expand_instances(tree.root, note("instances"))
    name_everything(tree.root)
    mesh_grids(tree, note("distance_grids"))
    mesh_shapes(tree, note("analytic"))
    if not tree.root.nodes("shape"):
        raise SceneFileError(f"{file}: the scene has no shape, so there is nothing to see")
    up = up_axis(tree.root, settings.up)
    place(tree.root, up, settings.scale)
    cameras = cameras_of(tree.root, note("cameras"))
    if settings.cameras is not None:
        cameras += read_camera_file(settings.cameras, placed_matrix(up, settings.scale), changes)
    resolution, max_depth = _settled_settings(tree.root)
    warnings = [f"-D {name}: nothing in the scene asks for ${name}" for name in sorted(tree.unused)]
    if not any(node.tag == "emitter" for node in tree.root.everything()):
        warnings.append("the scene has no light: everything in it is black")
    if missing:
        warnings.append(
            f"{len(missing)} files are missing, what needs them is left out: {', '.join(missing)}"
        )
    return ImportedScene(
        name=scene_title(file),
        tree=tree,
        up=up,
        scale=settings.scale,
        cameras=tuple(cameras),
        resolution=resolution,
        max_depth=max_depth,
        changes=tuple(changes),
        missing=tuple(missing),
        warnings=tuple(warnings),
        files=destinations(tree),
    )


def _settled_settings(root: Node) -> tuple[tuple[int, int], int]:
    """Size of the first image and depth of the integrator; sensors and integrators go, as whoever renders has them."""
    size, depth = None, DEFAULT_DEPTH
    for node in root.nodes("sensor", "integrator"):
        root.remove(node)
        if size is None and node.nodes("film"):
            size = film_of(node).window
        if node.tag == "integrator":
            depth = max(-1, whole_number(node, "max_depth", DEFAULT_DEPTH))
    return size or DEFAULT_SIZE, depth


def scene_title(file: Path) -> str:
    """Name of a scene: its folder where the file is called scene.xml, else by the file."""
    return file.resolve().parent.name if file.stem == "scene" else file.stem


def fingerprint(file: Path, settings: ImportSettings) -> str:
    """SHA-256 of a scene file and all the files that it names, hexadecimal: what it looks like depends on them alone.

    Raises SceneFileError.
    """
    tree = read_tree(file, allow_outside=settings.allow_outside, parameters=settings.values)
    digest = hashlib.sha256(tostring(tree.root))
    paths: list[Path] = []
    for named in named_files(tree):
        digest.update(named.name.encode() + b"\0")
        if isinstance(named.source, Path) and named.source.is_file():
            paths.append(named.source)
            # The materials of an OBJ file lie beside it.
            paths += sorted(named.source.parent.glob("*.mtl")) if named.owner.type == "obj" else []
    for path in paths:
        with path.open("rb") as content:
            digest.update(hashlib.file_digest(content, "sha256").digest())
    return digest.hexdigest()
