"""A scene file imported: read, upgraded, placed, its files found."""

from __future__ import annotations

import hashlib
import tempfile
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any
from xml.etree.ElementTree import tostring

from gibench.generators.imported.analytic import mesh_shapes
from gibench.generators.imported.channels import single_channels
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import destinations, named_files, settle_missing
from gibench.generators.imported.own_cameras import GivenCamera, cameras_of, read_camera_file
from gibench.generators.imported.placing import place, placed_matrix, up_axis
from gibench.generators.imported.reading import Node, SceneTree, read_tree
from gibench.generators.imported.shapes import check_references, expand_instances, name_everything
from gibench.generators.imported.upgrading import Change, is_legacy, upgrade

if TYPE_CHECKING:
    from gibench.rendering.scene import Scene


@dataclass(frozen=True)
class ImportSettings:
    """How scene files are read.

    up: axis of the file that is up: "x", "y", "z" or "auto" (`placing.up_axis`). scale: metres of its unit.
    allow_missing: leave out what needs a missing file. allow_outside: read files outside the scene's folder. cameras:
    a camera file (`own_cameras.read_camera_file`).
    """

    up: str = "auto"
    scale: float = 1.0
    allow_missing: bool = False
    allow_outside: bool = False
    cameras: Path | None = None


@dataclass(frozen=True, eq=False)
class ImportedScene:
    """A scene in Z-up metres that Mitsuba 3 reads.

    name: that of its folder, or of its file where that says more. tree: the scene, its file names as in the source. up,
    scale: what was done to it. cameras: its own, then those of the camera file. changes: what was rewritten, missing:
    files that were left out, as the scene names them.
    """

    name: str
    tree: SceneTree
    up: str
    scale: float
    cameras: tuple[GivenCamera, ...]
    changes: tuple[Change, ...]
    missing: tuple[str, ...]
    warnings: tuple[str, ...] = ()
    files: Mapping[Path, str] = field(default_factory=dict)
    scratch: Any = None  # the folder of files that were made, which lives as long as the scene

    @cached_property
    def loaded(self) -> Scene:
        """The scene under Mitsuba's current variant. Raises SceneFileError with Mitsuba's reason."""
        from gibench.rendering.backend import select_variant

        select_variant()
        import mitsuba as mi

        from gibench.rendering.scene import wrap

        root = self.with_files(absolute=True)
        for sensor in root.nodes("sensor"):
            root.remove(sensor)
        try:
            return wrap(mi.load_string(tostring(root, encoding="unicode"), optimize=False))
        except RuntimeError as problem:
            reason = " ".join(str(problem).split())
            raise SceneFileError(f"Mitsuba refuses {self.tree.file}: {reason}") from None

    def changed(self, changes: Iterable[Change]) -> ImportedScene:
        """The scene after its tree was rewritten; it is loaded anew."""
        return replace(self, changes=(*self.changes, *changes))

    def with_files(self, *, absolute: bool = False) -> Node:
        """A copy of the scene whose file names are absolute, or those of a room's folder."""
        copy = replace(self.tree, root=_copied(self.tree.root))
        for _, name, path in named_files(copy):
            name.set("value", str(path.resolve()) if absolute else self.files[path.resolve()])
        return copy.root


def _copied(node: Node) -> Node:
    copy = Node(node.tag, dict(node.attrib))
    copy.where = node.where
    copy[:] = [_copied(child) for child in node.nodes()]
    return copy


def import_scene(file: Path, settings: ImportSettings | None = None) -> ImportedScene:
    """Import a Mitsuba scene file of any version from 0.5 on.

    Raises SceneFileError for whatever is wrong with it, its files or the settings.
    """
    settings = settings or ImportSettings()
    tree = read_tree(file, allow_outside=settings.allow_outside)
    legacy = is_legacy(tree.root)
    changes = upgrade(tree)

    def note(rule: str) -> Any:
        def take(node: Node, what: str, loss: bool = False) -> None:
            changes.append(Change(rule, what, node.where, loss))

        return take

    check_references(tree.root)
    missing = settle_missing(tree, allow_missing=settings.allow_missing)
    scratch = tempfile.TemporaryDirectory(prefix="gibench-scene-")
    single_channels(tree, Path(scratch.name), note("channels"), legacy=legacy)
    expand_instances(tree.root, note("instances"))
    name_everything(tree.root)
    mesh_shapes(tree, Path(scratch.name), note("analytic"))
    if not tree.root.nodes("shape"):
        raise SceneFileError(f"{file}: the scene has no shape, so there is nothing to see")
    up = up_axis(tree.root, settings.up)
    place(tree.root, up, settings.scale)
    cameras = cameras_of(tree.root, note("cameras"))
    if settings.cameras is not None:
        cameras += read_camera_file(settings.cameras, placed_matrix(up, settings.scale))
    warnings = []
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
        changes=tuple(changes),
        missing=tuple(missing),
        warnings=tuple(warnings),
        files=destinations(tree),
        scratch=scratch,
    )


def scene_title(file: Path) -> str:
    """What to call a scene: by its folder where the file is called scene.xml, else by the file."""
    return file.resolve().parent.name if file.stem == "scene" else file.stem


def fingerprint(file: Path, settings: ImportSettings) -> str:
    """SHA-256 of a scene file and all the files that it names, hexadecimal: what it looks like depends on them alone.

    Raises SceneFileError.
    """
    tree = read_tree(file, allow_outside=settings.allow_outside)
    digest = hashlib.sha256(tostring(tree.root))
    for _, name, path in named_files(tree):
        digest.update(name.get("value", "").encode() + b"\0")
        if path.is_file():
            with path.open("rb") as content:
                digest.update(hashlib.file_digest(content, "sha256").digest())
    return digest.hexdigest()
