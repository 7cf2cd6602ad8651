"""Scene files as trees: parsed so that a file from the web can do no harm, includes and defaults resolved.

A scene file may include others, and names meshes and images. None of them may lie outside the scene's folder unless the
user allows it. Document type declarations are refused altogether: scenes have none, and entities are what XML bombs are
made of.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element
from xml.parsers import expat

from gibench.generators.imported.errors import SceneFileError

DEEPEST = 100
"""Of elements in one another, and of includes: Mitsuba's own scenes have about ten."""

PLUGINS = frozenset(
    {"bsdf", "emitter", "film", "integrator", "medium", "phase", "rfilter", "sampler", "sensor", "shape"}
) | {"spectrum", "subsurface", "texture", "volume"}
"""Tags of elements that are plugins; their type names which."""


class Node(Element):
    """An element that knows where it stands. where: "scene.xml:12"."""

    where = ""

    @property
    def type(self) -> str:
        """Name of the plugin, empty where the element is none."""
        return self.get("type", "")

    def property(self, *names: str) -> Node | None:
        """The first child of one of these names."""
        return next((child for child in self.nodes() if child.get("name") in names), None)

    def value(self, name: str, default: str = "") -> str:
        """The value of the child of that name."""
        child = self.property(name)
        return default if child is None else child.get("value", default)

    def nodes(self, *tags: str) -> list[Node]:
        """Children with one of these tags, or all of them."""
        return [child for child in self if isinstance(child, Node) and (not tags or child.tag in tags)]

    def everything(self) -> Iterator[Node]:
        """This element and all below it, in the order of the file."""
        return (node for node in self.iter() if isinstance(node, Node))


def new(tag: str, like: Node, **attributes: str) -> Node:
    """An element that stands in the file where another does."""
    node = Node(tag, attributes)
    node.where = like.where
    return node


def copied(node: Node) -> Node:
    """A copy of an element and all below it."""
    copy = Node(node.tag, dict(node.attrib))
    copy.where = node.where
    copy[:] = [copied(child) for child in node.nodes()]
    return copy


@dataclass(frozen=True)
class SceneTree:
    """A scene file with everything that it includes.

    root: its `<scene>`. file: where it came from. allow_outside: whether files may lie outside its folder. searched:
    more folders that files are looked for in. made: content of files that were made during the import, by name.
    """

    root: Node
    file: Path
    allow_outside: bool = False
    searched: list[Path] = field(default_factory=list)
    made: dict[str, bytes] = field(default_factory=dict)

    @property
    def folder(self) -> Path:
        """Folder that file names count from."""
        return self.file.parent

    def source(self, name: str, where: str) -> Path | str:
        """Where a file that the scene names lies; the name itself where it was made during the import."""
        return name if name in self.made else self.located(name, where)

    def content(self, source: Path | str) -> bytes:
        """Content of a file."""
        return self.made[source] if isinstance(source, str) else source.read_bytes()

    def located(self, name: str, where: str) -> Path:
        """Where a file that the scene names lies, whether it is there or not.

        Raises SceneFileError where that is outside the scene's folder and not allowed.
        """
        # Windows' separators are common in old scenes; no file of such a scene has one in its name.
        name = name.strip().replace("\\", "/")
        candidates = [folder / name for folder in (self.folder, *self.searched)]
        path = next((c for c in candidates if c.is_file()), candidates[0])
        inside = path.resolve().is_relative_to(self.folder.resolve())
        if not inside and not self.allow_outside:
            raise SceneFileError(
                f"{where}: '{name}' lies outside the folder of the scene: move it inside, or allow it with "
                "--allow-outside if you trust the file"
            )
        return path


def read_tree(file: Path, *, allow_outside: bool = False) -> SceneTree:
    """Read a scene file and all that it includes, with `<default>` values filled in.

    Raises SceneFileError for a file that cannot be read or is no scene, a cyclic include, an undefined `$parameter`.
    """
    root = _parsed(file, file.name)
    if root.tag != "scene":
        raise SceneFileError(f"{file}: it is XML, but no Mitsuba scene: its first element is <{root.tag}>")
    tree = SceneTree(root, file, allow_outside)
    _include(tree, root, (file.resolve(),))
    _fill_in(tree)
    return tree


def _parsed(file: Path, name: str) -> Node:
    try:
        content = file.read_bytes()
    except OSError as problem:
        raise SceneFileError(f"scene file {file} cannot be read: {problem.strerror}") from None
    parser = expat.ParserCreate()
    stack: list[Node] = []
    roots: list[Node] = []

    def refuse(*_: object) -> None:
        raise SceneFileError(
            f"{name}:{parser.CurrentLineNumber}: it has a document type declaration, which scenes do not need "
            "and which can make a small file expand without end: remove <!DOCTYPE …>"
        )

    def start(tag: str, attributes: dict[str, str]) -> None:
        node = Node(tag, attributes)
        node.where = f"{name}:{parser.CurrentLineNumber}"
        if len(stack) >= DEEPEST:
            raise SceneFileError(
                f"{node.where}: more than {DEEPEST} elements in one another: no scene needs that"
            )
        if stack:
            stack[-1].append(node)
        else:
            roots.append(node)
        stack.append(node)

    parser.StartDoctypeDeclHandler = refuse
    parser.StartElementHandler = start
    parser.EndElementHandler = lambda tag: stack.pop()
    try:
        parser.Parse(content, True)
    except expat.ExpatError as problem:
        raise SceneFileError(
            f"{file}: it is no XML: {expat.ErrorString(problem.code)} in line {problem.lineno}"
        ) from None
    return roots[0]


def _include(tree: SceneTree, node: Node, open_files: tuple[Path, ...]) -> None:
    """Put what is included in the place of `<include>`, and note the folders of `<path>`."""
    children: list[Node] = []
    for child in node.nodes():
        if child.tag == "path":
            folder = tree.folder / child.get("value", "")
            if not tree.allow_outside and not folder.resolve().is_relative_to(tree.folder.resolve()):
                raise SceneFileError(
                    f"{child.where}: <path> leads outside the folder of the scene: allow it with --allow-outside"
                )
            tree.searched.append(folder)
        elif child.tag == "include":
            path = tree.located(child.get("filename", ""), child.where)
            if path.resolve() in open_files:
                raise SceneFileError(f"{child.where}: '{path.name}' includes itself: remove this <include>")
            if len(open_files) > DEEPEST:
                raise SceneFileError(f"{child.where}: more than {DEEPEST} includes in one another")
            included = _parsed(path, path.name)
            _include(tree, included, (*open_files, path.resolve()))
            children += included.nodes() if included.tag == "scene" else [included]
        else:
            _include(tree, child, open_files)
            children.append(child)
    node[:] = children


_PARAMETER = re.compile(r"\$\{?(\w+)\}?")


def _fill_in(tree: SceneTree) -> None:
    """Replace `$name` by the `<default>` of that name, longest names first, as Mitsuba does."""
    defaults = {
        node.get("name", ""): node.get("value", "")
        for node in tree.root.everything()
        if node.tag == "default"
    }
    for node in tree.root.everything():
        node[:] = [child for child in node if child.tag != "default"]
        for key, text in node.attrib.items():
            if "$" not in text:
                continue

            def filled(match: re.Match[str], node: Node = node) -> str:
                name = next(
                    (n for n in sorted(defaults, key=len, reverse=True) if match[1].startswith(n)), None
                )
                if not name:
                    raise SceneFileError(
                        f"{node.where}: ${match[1]} has no value: add <default name=… value=…/>"
                    )
                return defaults[name] + match[1][len(name) :]

            node.set(key, _PARAMETER.sub(filled, text))
