"""Paths of the files of a scene: each has to be a regular file below the folder of the scene.

A scene names files by `<include>`, `<path>`, `<string name="filename">` of any plugin, `<spectrum filename>`, the
`material` of a conductor, which Mitsuba puts into a file name, and the `mtllib` of an OBJ file with the images in it.
`files.named_files` lists those that Mitsuba would open; the others are read, or refused, by gibench alone. Links are
followed before a path is judged.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path

from gibench.generators.imported.errors import SceneFileError


def is_inside(path: Path, folder: Path) -> bool:
    """Whether a path lies below a folder once all links are followed."""
    return path.resolve().is_relative_to(folder.resolve())


def located(name: str, where: str, folders: Sequence[Path], *, allow_outside: bool) -> Path:
    """Path of a file that a scene names, whether it is there or not.

    folders: where it is looked for; the first is that of the scene. A name that differs in case alone will do, as
    scenes made on Windows have such. Raises SceneFileError for what lies outside of the scene's folder and is not
    allowed, and for what can be no file name.
    """
    # Windows' separators are common in old scenes; no file of such a scene has one in its name.
    name = name.strip().replace("\\", "/")
    if not name or "\0" in name:
        raise SceneFileError(f"{where}: the file name is empty: name a file")
    try:
        candidates = [folder / name for folder in folders]
        path = next((c for c in candidates if c.is_file()), None)
        if path is None:
            others = (_of_other_case(folder, name) for folder in folders)
            path = next((c for c in others if c is not None), candidates[0])
        inside = is_inside(path, folders[0])
    except (OSError, ValueError, RuntimeError) as problem:
        reason = problem.strerror if isinstance(problem, OSError) else problem
        raise SceneFileError(f"{where}: '{name[:60]}' is no file name: {reason}") from None
    if not inside and not allow_outside:
        raise SceneFileError(
            f"{where}: '{name}' lies outside the folder of the scene: move it inside, or allow it with "
            "--allow-outside if you trust the file"
        )
    return path


def _of_other_case(folder: Path, name: str) -> Path | None:
    """The file whose name differs in case alone; none where the way to it leads upwards or there is no such file."""
    path = folder
    parts = Path(name).parts
    if Path(name).is_absolute() or ".." in parts:
        return None
    for part in parts:
        if not (path / part).exists():
            if not path.is_dir():
                return None
            same = sorted(entry for entry in os.listdir(path) if entry.casefold() == part.casefold())
            if not same:
                return None
            part = same[0]
        path = path / part
    return path if path.is_file() else None
