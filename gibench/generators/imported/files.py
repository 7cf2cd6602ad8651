"""Files that a scene names: found, missing, no image, and under which name they go into a room's folder."""

from __future__ import annotations

from pathlib import Path

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.reading import Node, SceneTree, new

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


def named_files(tree: SceneTree) -> list[tuple[Node, Node, Path | str]]:
    """(plugin, its filename, `SceneTree.source`) of every file that a scene names.

    Raises SceneFileError for one outside the scene's folder.
    """
    found = []
    for node in tree.root.everything():
        name = node.property("filename")
        if name is not None and name.tag == "string":
            found.append((node, name, tree.source(name.get("value", ""), name.where)))
    return found


def settle_missing(tree: SceneTree, *, allow_missing: bool) -> list[str]:
    """Look for every file; what is missing is left out of the scene, in place, where that is allowed.

    Shapes and environments go; a texture becomes grey. Returns the missing files as the scene names them. Raises
    SceneFileError with all of them where that is not allowed, and for a texture that is no image.
    """
    named = named_files(tree)
    missing = [(node, name) for node, name, path in named if isinstance(path, Path) and not path.is_file()]
    if missing and not allow_missing:
        listed = ", ".join(dict.fromkeys(name.get("value", "") for _, name in missing))
        raise SceneFileError(
            f"{tree.file}: {len(missing)} files are missing: {listed}; get them, or leave out what needs them with "
            "--allow-missing"
        )
    for node, _, path in named:
        if isinstance(path, Path) and path.is_file() and node.tag in ("texture", "emitter"):
            _check_image(node, path)
    parents = {id(child): node for node in tree.root.everything() for child in node}
    for node, _ in missing:
        parent = parents[id(node)]
        if node.tag == "texture":
            grey = new("rgb", node, name=node.get("name", ""), value=str(MISSING_COLOR))
            if node.get("id"):
                raise SceneFileError(f"{node.where}: the image of a texture that others refer to is missing")
            parent[list(parent).index(node)] = grey
        else:
            parent.remove(node)
    return list(dict.fromkeys(name.get("value", "") for _, name in missing))


def _check_image(node: Node, path: Path) -> None:
    with path.open("rb") as file:
        start = file.read(8)
    if not start.startswith(SIGNATURES) and path.suffix.lower() != ".tga":
        raise SceneFileError(
            f"{node.where}: {path.name} is no image that Mitsuba reads: PNG, JPEG, EXR, HDR, PFM, BMP, TGA"
        )


def destinations(tree: SceneTree) -> dict[Path | str, str]:
    """File → its name in a room's folder: meshes/… for shapes, textures/… for images. Equal names are told apart."""
    result: dict[Path | str, str] = {}
    taken: set[str] = set()
    for node, _, source in named_files(tree):
        if source in result:
            continue
        folder = "meshes" if node.tag == "shape" else "textures"
        # No blanks: they trip over shells and other programs' parsers.
        path = Path(source)
        stem, number = path.stem.replace(" ", "_"), 1
        name = f"{folder}/{stem}{path.suffix}"
        while name.lower() in taken:
            number += 1
            name = f"{folder}/{stem}-{number}{path.suffix}"
        taken.add(name.lower())
        result[source] = name
    return result
