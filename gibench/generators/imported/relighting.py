"""Other light for an imported scene: one area light, or an environment, in place of all that it brings along."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from pathlib import Path
from xml.etree.ElementTree import Element

from gibench.generators.imported.changes import Change
from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import destinations
from gibench.generators.imported.scene import ImportedScene
from gibench.generators.imported.tree import Node, copied, new
from gibench.generators.light_shapes import LAMP_MATERIAL
from gibench.generators.panorama import write_panorama
from gibench.generators.parts import Environment, Light
from gibench.generators.scene_files import light_element


def lit_by_area_light(scene: ImportedScene, light: Light) -> ImportedScene:
    """The scene with no light but this lamp (Z up, metres, lumens and kelvin). Raises BadLight."""
    root = _unlit(scene)
    if any(node.get("id") == light.name for node in root.everything()):
        raise SceneFileError(
            f"the scene has something called '{light.name}' already: give the light another name"
        )
    taken = {node.get("id") for node in root.everything()}
    name = LAMP_MATERIAL
    while name in taken:
        name += "."
    material = new("bsdf", root, type="diffuse", id=name)
    material.append(new("rgb", root, name="reflectance", value="0"))
    lamp = _node(light_element(light), root.where)
    lamp.nodes("ref")[0].set("id", name)
    root.extend([material, lamp])
    return _relit(scene, root, f"all light is that of '{light.name}'")


def lit_by_environment(scene: ImportedScene, environment: Environment) -> ImportedScene:
    """The scene with no light but an environment; the kind "none" leaves it dark. Raises BadEnvironment."""
    root = _unlit(scene)
    # A file of each environment, as the scene may be lit by another one later.
    number = sum(name.startswith("environment") for name in scene.tree.made)
    name = f"environment{number}.hdr"
    with tempfile.TemporaryDirectory(prefix="gibench-") as scratch:
        emitter = write_panorama(environment, Path(scratch), name)
        if emitter is None:
            return _relit(scene, root, "there is no light")
        made = {**scene.tree.made, name: (Path(scratch) / name).read_bytes()}
    root.append(_node(emitter, root.where))
    return _relit(scene, root, f"all light is that of an environment ({environment.kind})", made)


def _unlit(scene: ImportedScene) -> Node:
    """A copy of the tree without emitters; shapes that shone stay, as what they are made of."""
    root = copied(scene.tree.root)
    for node in list(root.everything()):
        for emitter in node.nodes("emitter"):
            node.remove(emitter)
    return root


def _node(element: Element, where: str) -> Node:
    node = Node(element.tag, dict(element.attrib))
    node.where = where
    node[:] = [_node(child, where) for child in element]
    return node


def _relit(
    scene: ImportedScene, root: Node, what: str, made: dict[str, bytes] | None = None
) -> ImportedScene:
    tree = replace(scene.tree, root=root, made=scene.tree.made if made is None else made)
    change = Change("relighting", what, root.where, loss=True)
    dark = "the scene has no light: everything in it is black"
    return replace(
        scene,
        tree=tree,
        files=destinations(tree),
        changes=(*scene.changes, change),
        warnings=tuple(warning for warning in scene.warnings if warning != dark),
    )
