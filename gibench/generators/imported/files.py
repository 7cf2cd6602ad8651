"""Files that a scene names: found, missing, no image, and under which name they go into a room's folder."""

from __future__ import annotations

import itertools
import re
from dataclasses import dataclass
from pathlib import Path

from gibench.generators.imported.changes import Note
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import SceneTree
from gibench.generators.imported.tree import Node, new, parents_of, replaced, wrapped

SIGNATURES = (
    b"\x89PNG",
    b"\xff\xd8\xff",  # JPEG
    b"\x76\x2f\x31\x01",  # OpenEXR
    b"#?",  # Radiance HDR
    b"BM",
    *(b"PF", b"Pf"),  # portable float maps
    *(b"P5", b"P6"),
)
"""First bytes of the images that Mitsuba reads; TGA alone has none."""

MISSING_COLOR = 0.5

NEED_FILES = {
    "texture": ("bitmap",),
    "emitter": ("envmap",),
    "shape": (
        "ply",
        "obj",
        "serialized",
        "linearcurve",
        "bsplinecurve",
        "sdfgrid",
        "hair",
        "ellipsoids",
        "ellipsoidsmesh",
    ),
    "bsdf": ("measured", "measured_polarized"),
    "volume": ("gridvolume",),
}
"""Plugins that end the process, or at best fail, where they are given no file."""


@dataclass(frozen=True)
class NamedFile:
    """A file that Mitsuba would open.

    owner: the plugin that wants it. element: what names it, in its `attribute`. source: `SceneTree.source`.
    """

    owner: Node
    element: Node
    attribute: str
    source: Path | str

    @property
    def name(self) -> str:
        """As the scene names it."""
        return self.element.get(self.attribute, "")

    @property
    def is_missing(self) -> bool:
        """Whether there is no such file."""
        return isinstance(self.source, Path) and not self.source.is_file()


def named_files(tree: SceneTree) -> list[NamedFile]:
    """Every file that a scene names and Mitsuba opens.

    Raises SceneFileError for one outside the scene's folder, and for a plugin that names none and needs one.
    """
    found = []
    for owner in tree.root.everything():
        elements = [(child, "value") for child in owner.nodes("string") if child.get("name") == "filename"]
        elements += [
            (child, "filename") for child in owner.nodes("spectrum") if child.get("filename") is not None
        ]
        for element, attribute in elements:
            source = tree.source(element.get(attribute, ""), element.where)
            found.append(NamedFile(owner, element, attribute, source))
        if (
            not elements
            and owner.type in NEED_FILES.get(owner.tag, ())
            and not owner.nodes("tensor", "object")
        ):
            raise SceneFileError(
                f'{owner.where}: the {owner.type} names no file: add <string name="filename" value="…"/>'
            )
        material = owner.property("material")
        if (
            material is not None
            and owner.tag == "bsdf"
            and not re.fullmatch(r"[\w-]+", material.get("value", ""))
        ):
            # Mitsuba makes a file name of it, with whatever folders it leads through.
            raise SceneFileError(
                f"{material.where}: '{material.get('value')}' is no material of a conductor: give one such as Au, or "
                "none"
            )
    return found


def settle_missing(tree: SceneTree, note: Note, *, allow_missing: bool) -> list[str]:
    """Look for every file; what is missing is left out of the scene, in place, where that is allowed.

    Shapes and environments go; a texture, a spectrum and a measured material become grey, and bumps and normal maps
    what they are on. Returns the missing files as the scene names them. Raises SceneFileError with all of them where
    that is not allowed, and for a texture that is no image.
    """
    named = named_files(tree)
    missing = [file for file in named if file.is_missing]
    names = list(dict.fromkeys(file.name for file in missing))
    if missing and not allow_missing:
        raise SceneFileError(
            f"{tree.file}: {len(names)} files are missing: {', '.join(names)}; get them, or leave out what needs them "
            "with --allow-missing"
        )
    for file in named:
        if not isinstance(file.source, Path) or file.is_missing:
            continue
        if file.source.name != Path(file.name.strip().replace("\\", "/")).name:
            note(file.element, f"{file.name} is {file.source.name}")
        if file.owner.tag in ("texture", "emitter") and file.element.tag == "string":
            _check_image(file.owner, file.source)
        elif file.element.tag == "spectrum":
            _check_spectrum(file)
    for file in missing:
        _leave_out(tree.root, file)
    return names


def _leave_out(root: Node, file: NamedFile) -> None:
    parents = parents_of(root)
    element, owner = file.element, file.owner
    if element.tag == "spectrum":
        if owner.type in ("conductor", "roughconductor"):
            for part in [part for part in owner.nodes() if part.get("name") in ("eta", "k", "material")]:
                owner.remove(part)
            owner.append(new("string", owner, name="material", value="none"))
        elif owner.tag == "emitter":
            parents[id(owner)].remove(owner)
        elif id(element) in parents:
            replaced(owner, element, _grey(element))
        return
    if id(owner) not in parents:  # it went with something that needed another file
        return
    if owner.tag == "bsdf":
        grey = new(
            "bsdf", owner, type="diffuse", **{k: v for k, v in owner.attrib.items() if k in ("id", "name")}
        )
        replaced(parents[id(owner)], owner, grey)
    elif owner.tag == "texture":
        _without_texture(root, owner, parents)
    else:
        parents[id(owner)].remove(owner)


def _without_texture(root: Node, texture: Node, parents: dict[int, Node]) -> None:
    """Grey in the place of a texture and of every reference to it; bumps and normals of it are left out."""
    uses = [texture]
    if texture.get("id"):
        uses += [
            node for node in root.everything() if node.tag == "ref" and node.get("id") == texture.get("id")
        ]
    for use in uses:
        parent = parents.get(id(use))
        if parent is None:
            continue
        if parent.type == "heightfield" and id(parent) in parents:
            replaced(parents[id(parent)], parent, None)
            continue
        if parent.type in ("bumpmap", "normalmap"):
            inner = next(iter(parent.nodes("bsdf")), None)
            if inner is None:
                inner = next((node for node in parent.nodes("ref") if node is not use), None)
            if inner is not None and parents.get(id(parent)) is not None:
                _unwrap(parent, inner, parents)
                continue
        replaced(parent, use, None if parent.tag == "scene" else _grey(use))


def _unwrap(wrapper: Node, inner: Node, parents: dict[int, Node]) -> None:
    """Put the material of a wrapper in its place, under its names."""
    if inner.tag == "ref" or inner.get("id"):
        wrapped(wrapper, inner)  # both have names of their own
        return
    outer = parents[id(wrapper)]
    inner.attrib.pop("name", None)
    for key in ("id", "name"):
        if wrapper.get(key):
            inner.set(key, wrapper.get(key, ""))
    replaced(outer, wrapper, inner)
    parents[id(inner)] = outer


def _grey(like: Node) -> Node:
    return new("rgb", like, name=like.get("name", ""), value=str(MISSING_COLOR))


def _check_image(node: Node, path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(8)
    if not start.startswith(SIGNATURES) and path.suffix.lower() != ".tga":
        raise SceneFileError(
            f"{node.where}: {path.name} is no image that Mitsuba reads: PNG, JPEG, EXR, HDR, PFM, BMP, TGA"
        )


MOST_SPECTRUM_BYTES = 1 << 20


def _check_spectrum(file: NamedFile) -> None:
    """Raises SceneFileError where a file is no list of wavelengths and values; never quotes what is in it."""
    path = Path(file.source)
    where, wrong = file.element.where, f"{path.name} is no spectrum of two numbers a line (nm, value)"
    if path.stat().st_size > MOST_SPECTRUM_BYTES:
        raise SceneFileError(f"{where}: {wrong}: it has more than a megabyte")
    wavelengths = []
    for number, line in enumerate(path.read_bytes().decode("latin-1").splitlines(), 1):
        words = line.split("#")[0].split()
        if not words:
            continue
        try:
            wavelength, value = map(float, words)
        except ValueError:
            raise SceneFileError(f"{where}: {wrong}: look at its line {number}") from None
        if not (0 < wavelength < float("inf") and abs(value) < float("inf")):
            raise SceneFileError(f"{where}: {wrong}: look at its line {number}")
        wavelengths.append(wavelength)
    if len(wavelengths) < 2 or any(b <= a for a, b in itertools.pairwise(wavelengths)):
        raise SceneFileError(f"{where}: {wrong}, of at least two wavelengths in rising order")


FOLDERS = {"shape": "meshes", "spectrum": "spectra"}
"""Of a room, by what needs a file; textures are all others."""


def destinations(tree: SceneTree) -> dict[Path | str, str]:
    """File → its name in a room's folder: meshes/… for shapes, textures/… for images. Equal names are told apart."""
    result: dict[Path | str, str] = {}
    taken: set[str] = set()
    for file in named_files(tree):
        if file.source in result:
            continue
        tag = "spectrum" if file.element.tag == "spectrum" else file.owner.tag
        folder = FOLDERS.get(tag, "textures")
        # No blanks: they trip over shells and other programs' parsers.
        path = Path(file.source)
        stem, number = path.stem.replace(" ", "_"), 1
        name = f"{folder}/{stem}{path.suffix}"
        while name.lower() in taken:
            number += 1
            name = f"{folder}/{stem}-{number}{path.suffix}"
        taken.add(name.lower())
        result[file.source] = name
    return result
