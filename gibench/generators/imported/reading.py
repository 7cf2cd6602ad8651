"""Scene files with all that they include, their parameters filled in.

A scene file may include others, and names meshes and images. None of them may lie outside the scene's folder unless the
user allows it (`locating`).
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from gibench.generators.imported import locating
from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.parsing import DEEPEST, Budget, parsed
from gibench.generators.imported.tree import Node

REPLACED = {"integrator": "path", "sampler": "independent", "rfilter": "box", "film": "hdrfilm"}
"""Elements that gibench has its own of, so that a parameter without a value does no harm in them; and their types."""


@dataclass(frozen=True)
class SceneTree:
    """A scene file with everything that it includes.

    root: its `<scene>`. file: where it came from. allow_outside: whether files may lie outside its folder. searched:
    more folders that files are looked for in. made: content of files that were made during the import, by name.
    changes: what was done while it was read. unused: parameters that were given and that nothing asks for.
    """

    root: Node
    file: Path
    allow_outside: bool = False
    searched: list[Path] = field(default_factory=list)
    made: dict[str, bytes] = field(default_factory=dict)
    changes: list[Change] = field(default_factory=list)
    unused: set[str] = field(default_factory=set)

    @property
    def folder(self) -> Path:
        """Folder that file names count from."""
        return self.file.parent

    def source(self, name: str, where: str) -> Path | str:
        """Path of a file that the scene names; the name itself where it was made during the import."""
        return name if name in self.made else self.located(name, where)

    def content(self, source: Path | str) -> bytes:
        """Content of a file."""
        return self.made[source] if isinstance(source, str) else source.read_bytes()

    def located(self, name: str, where: str) -> Path:
        """As `locating.located`, in the folders of this scene."""
        return locating.located(name, where, (self.folder, *self.searched), allow_outside=self.allow_outside)

    def make(self, stem: str, ending: str, content: bytes) -> str:
        """Keep a file that was made during the import; its name, which no other has.

        stem: what the name begins with, of any letters; ending: what it ends with, such as ".turned.ply".
        """
        plain = re.sub(r"[^A-Za-z0-9_.-]", "_", stem)[:100]
        taken = {name.lower() for name in self.made}
        name, number = f"{plain}{ending}", 1
        while name.lower() in taken:
            number += 1
            name = f"{plain}-{number}{ending}"
        self.made[name] = content
        return name


def read_tree(
    file: Path, *, allow_outside: bool = False, parameters: Mapping[str, str] | None = None
) -> SceneTree:
    """Read a scene file and all that it includes, with parameters filled in.

    parameters: values that count before any `<default>`. Raises SceneFileError for a file that cannot be read or is no
    scene, a cyclic include, an undefined `$parameter`.
    """
    budget = Budget()
    root = parsed(file, file.name, budget)
    if root.tag != "scene":
        raise SceneFileError(f"{file}: it is XML, but no Mitsuba scene: its first element is <{root.tag}>")
    tree = SceneTree(root, file, allow_outside, unused=set(parameters or {}))
    reader = _Reader(tree, budget, dict(parameters or {}))
    reader.include(root, (file.resolve(),))
    reader.fill(root, replaced=False)
    return tree


_PARAMETER = re.compile(r"\$(?:\{(\w+)\}|(\w+))")


class _Undefined(Exception):
    """A parameter without a value."""


@dataclass
class _Reader:
    tree: SceneTree
    budget: Budget
    values: dict[str, str]

    def include(self, node: Node, open_files: tuple[Path, ...]) -> None:
        """Put what is included in the place of `<include>`, note the folders of `<path>` and the values of `<default>`.

        In the order of the file, as Mitsuba does: the first `<default>` of a name counts, and may use those before it.
        """
        children: list[Node] = []
        for child in node.nodes():
            if child.tag == "default":
                name = child.get("name", "")
                if name and name not in self.values:
                    self.values[name] = self._text(child, "value")
            elif child.tag == "path":
                folder = self.tree.folder / self._text(child, "value").strip().replace("\\", "/")
                if not self.tree.allow_outside and not locating.is_inside(folder, self.tree.folder):
                    raise SceneFileError(
                        f"{child.where}: <path> leads outside the folder of the scene: allow it with --allow-outside"
                    )
                self.tree.searched.append(folder)
            elif child.tag == "include":
                children += self._included(child, open_files)
            else:
                self.include(child, open_files)
                children.append(child)
        node[:] = children

    def _included(self, child: Node, open_files: tuple[Path, ...]) -> list[Node]:
        self.budget.include(child.where)
        path = self.tree.located(self._text(child, "filename"), child.where)
        if path.resolve() in open_files:
            raise SceneFileError(f"{child.where}: '{path.name}' includes itself: remove this <include>")
        if len(open_files) > DEEPEST:
            raise SceneFileError(f"{child.where}: more than {DEEPEST} includes in one another")
        if not path.is_file():
            raise SceneFileError(f"{child.where}: the included file '{path.name}' is missing: get it")
        included = parsed(path, path.name, self.budget, legacy=child.legacy)
        self.include(included, (*open_files, path.resolve()))
        return included.nodes() if included.tag == "scene" else [included]

    def fill(self, node: Node, *, replaced: bool) -> None:
        """Replace `$name` by its value in all attributes."""
        for child in node.nodes():
            within = replaced or child.tag in REPLACED
            try:
                for key, text in child.attrib.items():
                    if "$" in text:
                        child.set(key, self._filled(child, text))
            except _Undefined as undefined:
                if not within:
                    raise SceneFileError(
                        f"{child.where}: ${undefined} has no value: add <default name=… value=…/>, or give one with "
                        f"-D {undefined}=…"
                    ) from None
                if key != "type" or child.tag not in REPLACED:
                    self._drop(node, child, str(undefined))
                    continue
                child.set("type", REPLACED[child.tag])
                what = f"${undefined} has no value, so the {child.tag} is {child.type}"
                self.tree.changes.append(Change("parameters", what, child.where))
            self.fill(child, replaced=within)

    def _drop(self, parent: Node, child: Node, name: str) -> None:
        what = (
            f"${name} has no value, so the {child.get('name') or child.tag} of the {parent.tag} is left out"
        )
        self.tree.changes.append(Change("parameters", what, child.where))
        parent.remove(child)

    def _text(self, node: Node, key: str) -> str:
        try:
            return self._filled(node, node.get(key, ""))
        except _Undefined as undefined:
            raise SceneFileError(
                f"{node.where}: ${undefined} has no value here: put its <default> before, or give one with "
                f"-D {undefined}=…"
            ) from None

    def _filled(self, node: Node, text: str) -> str:
        parts, at = [], 0
        for match in _PARAMETER.finditer(text):
            word = match[1] or match[2]
            # The longest name that fits, as Mitsuba does.
            name = next((word[:n] for n in range(len(word), 0, -1) if word[:n] in self.values), None)
            if name is None:
                raise _Undefined(word)
            self.tree.unused.discard(name)
            self.budget.expand(len(self.values[name]), node.where)
            parts += [text[at : match.start()], self.values[name], word[len(name) :]]
            at = match.end()
        return "".join([*parts, text[at:]])
