"""Every way by which a scene names a file leads through one gate."""

from __future__ import annotations

import os
import random

import pytest

from gibench.generators.imported.errors import SceneFileError
from gibench.generators.imported.files import NEED_FILES
from gibench.generators.imported.scene import ImportSettings, import_scene

from .files import SQUARE, image, written

SECRET = "nobody must read this"

SPHERE = '<shape type="sphere"><bsdf type="{}">{}</bsdf></shape>'
MESH = '<shape type="ply"><string name="filename" value="{name}"/></shape>'

WAYS = {
    "include": '<include filename="{name}"/>',
    "path": '<path value="{name}"/>',
    "spectrum": SPHERE.format("diffuse", '<spectrum name="reflectance" filename="{name}"/>'),
    "emitter spectrum": '<emitter type="constant"><spectrum name="radiance" filename="{name}"/></emitter>',
    "conductor": SPHERE.format("conductor", '<string name="material" value="{name}"/>'),
    "obj library": '<shape type="obj"><string name="filename" value="a.obj"/></shape>',
    "default": '<default name="f" value="{name}"/>' + MESH.replace("{name}", "$f"),
    "nested": f'<shape type="shapegroup" id="g">{MESH}</shape>',
    **{
        f"{tag} {type_}": {
            "texture": '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="{type}">{file}'
            "</texture></bsdf></shape>",
            "volume": '<shape type="sphere"><bsdf type="diffuse"><texture name="reflectance" type="volume"><volume '
            'type="{type}">{file}</volume></texture></bsdf></shape>',
            "bsdf": '<shape type="sphere"><bsdf type="{type}">{file}</bsdf></shape>',
        }.get(tag, f'<{tag} type="{{type}}">{{file}}</{tag}>').replace("{type}", type_)
        for tag, types in NEED_FILES.items()
        for type_ in types
    },
}


def body(way: str, name: str) -> str:
    return WAYS[way].replace("{file}", f'<string name="filename" value="{name}"/>').replace("{name}", name)


@pytest.fixture
def folders(tmp_path):
    (tmp_path / "secret.xml").write_text(
        f'<scene version="3.0.0"><default name="x" value="{SECRET}"/></scene>'
    )
    (tmp_path / "outside").mkdir()
    (tmp_path / "outside/secret").write_text(SECRET)
    inside = tmp_path / "scene"
    inside.mkdir()
    (inside / "link").symlink_to(tmp_path / "secret.xml")
    (inside / "folder").symlink_to(tmp_path / "outside", target_is_directory=True)
    return inside


def outside_names(folder) -> list[str]:
    secret = folder.parent / "secret.xml"
    return [
        "/etc/passwd",
        str(secret),
        "../secret.xml",
        "..\\secret.xml",
        "./../scene/../secret.xml",
        "link",
        "LINK",
        "folder/secret",
        "Folder/SECRET",
        " ../secret.xml ",
        "/dev/zero",
        "/proc/self/environ",
    ]


@pytest.mark.parametrize("way", WAYS)
def test_no_way_leads_outside(folders, way):
    for name in outside_names(folders):
        if way == "obj library":
            (folders / "a.obj").write_text(f"mtllib {name}\nusemtl m\nv 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
        for version in ("0.6.0", "3.0.0"):
            if way == "obj library" and version == "3.0.0":
                continue  # Mitsuba 3 does not read it
            scene = written(folders, body(way, name) + SQUARE, version=version)
            if way == "path" and name in ("LINK", "Folder/SECRET"):
                continue  # a folder that is not there
            if way == "conductor" and name in ("link", "LINK"):
                continue  # a name like those of metals, which leads nowhere
            with pytest.raises(SceneFileError) as refused:
                import_scene(scene, ImportSettings(allow_missing=True))
            said = str(refused.value)
            for secret in (SECRET, "root:", "\n"):
                assert secret not in said, (name, said)
            assert "scene.xml:2" in said, (name, said)


def opened(scene):
    """Files that Mitsuba would open, and what is said where the scene is refused."""
    try:
        return list(import_scene(scene, ImportSettings(allow_missing=True)).files), ""
    except SceneFileError as refused:
        return [], str(refused)


def test_random_names_never_leave_the_folder(folders):
    """Names put together from what leads upwards, aside and through links."""
    seed = int(os.environ.get("GIBENCH_FUZZ_SEED", "7"))
    rng = random.Random(seed)
    words = [
        "..",
        ".",
        "link",
        "folder",
        "secret",
        "secret.xml",
        "",
        "a",
        "~",
        "%2e%2e",
        "SECRET.XML",
        "etc",
        "passwd",
    ]
    for _ in range(300):
        parts = [rng.choice(words) for _ in range(rng.randint(1, 5))]
        name = rng.choice(["", "/", "\\", " "]) + rng.choice(["/", "\\"]).join(parts)
        way = rng.choice([way for way in WAYS if way not in ("path", "obj library")])
        scene = written(folders, body(way, name) + SQUARE, version=rng.choice(["0.6.0", "3.0.0"]))
        files, said = opened(scene)
        assert SECRET not in said, (seed, way, name)
        for file in files:
            if not isinstance(file, str):
                assert file.resolve().is_relative_to(folders.resolve()), (seed, way, name)


def test_a_name_of_another_case_will_do(tmp_path):
    image(tmp_path / "Textures/Wall.PNG")
    texture = '<texture type="bitmap" name="reflectance"><string name="filename" value="textures\\wall.png"/></texture>'
    scene = import_scene(
        written(tmp_path, f'<shape type="sphere"><bsdf type="diffuse">{texture}</bsdf></shape>')
    )
    assert [str(file.relative_to(tmp_path)) for file in scene.files if not isinstance(file, str)] == [
        "Textures/Wall.PNG"
    ]
    assert "textures\\wall.png is Wall.PNG" in [change.what for change in scene.changes]


@pytest.mark.parametrize("tag", NEED_FILES)
def test_a_plugin_without_its_file_is_named(tmp_path, tag):
    """Mitsuba ends the process over some of them."""
    for type_ in NEED_FILES[tag]:
        scene = written(
            tmp_path, body(f"{tag} {type_}", "x").replace('<string name="filename" value="x"/>', "")
        )
        with pytest.raises(SceneFileError, match=rf"scene\.xml:2: the {type_} names no file"):
            import_scene(scene, ImportSettings(allow_missing=True))


@pytest.mark.parametrize(
    ("content", "says"),
    [
        (f"root:x:0:0:{SECRET}\n", "line 1"),
        ("400 0.5\n700\n", "line 2"),
        ("400 0.5\n", "two wavelengths"),
        ("500 0.5\n400 0.5\n", "rising order"),
        ("400 nan\n700 1\n", "line 1"),
        ("", "two wavelengths"),
    ],
)
def test_a_spectrum_that_is_none_is_named_and_not_quoted(tmp_path, content, says):
    (tmp_path / "a.spd").write_text(content)
    with pytest.raises(SceneFileError, match=rf"scene\.xml:2: a\.spd is no spectrum .*{says}") as refused:
        import_scene(written(tmp_path, body("spectrum", "a.spd")))
    assert SECRET not in str(refused.value)
