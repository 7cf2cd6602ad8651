"""`gibench noise` on a scene file: what it prints, what it refuses."""

from __future__ import annotations

import json
import subprocess
import sys

import pytest

from gibench.cli import run
from gibench.cli.app import app
from gibench.datasets.making import make
from tests.datasets.fakes import fake_work, tiny

SCENE = """<scene version="3.0.0">
<sensor type="perspective"><float name="fov" value="60"/><transform name="to_world">
<lookat origin="0,-3,1" target="0,0,0.5" up="0,0,1"/></transform></sensor>
<bsdf type="diffuse" id="grey"/>
<shape type="rectangle" id="floor"><transform name="to_world"><scale value="2"/></transform><ref id="grey"/></shape>
<shape type="sphere" id="a-lamp-whose-name-is-far-too-long-for-a-column-of-a-table">
<point name="center" x="0" y="0" z="1"/><float name="radius" value="0.1"/><ref id="grey"/>
<emitter type="area"><rgb name="radiance" value="RADIANCE"/></emitter></shape>
</scene>"""


@pytest.fixture
def scene(tmp_path):
    file = tmp_path / "scene.xml"
    file.write_text(SCENE.replace("RADIANCE", "5 4 3"))
    return file


def test_help_loads_nothing_heavy():
    code = (
        "import sys\nfrom gibench.cli import run\nfrom gibench.cli.app import app\n"
        "assert run(app, ['noise', '--help']) == 0\n"
        "print('loaded:', *sorted({'mitsuba', 'drjit', 'torch', 'numpy', 'scipy'} & set(sys.modules)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.splitlines()[-1] == "loaded:"
    assert "--paths" in done.stdout


def test_a_scene_is_read_as_other_commands_read_it(scene, capsys):
    text = scene.read_text()
    lost = '<shape type="ply"><string name="filename" value="lost.ply"/><ref id="grey"/></shape></scene>'
    scene.write_text(text.replace("</scene>", lost))
    words = ["noise", str(scene), "--resolution", "8x8", "--spp", "4"]
    assert run(app, words) == 2
    assert "--allow-missing" in capsys.readouterr().err
    assert run(app, [*words, "--allow-missing"]) == 0


def test_a_scene_is_split_in_eighty_columns_and_for_programs(scene, capsys):
    words = ["noise", str(scene), "--resolution", "12x8", "--spp", "16"]
    assert run(app, words) == 0
    said = capsys.readouterr().out
    assert all(len(line) <= 80 for line in said.splitlines())
    for part in (
        "by depth",
        "by lobe",
        "by light",
        "by technique",
        "covariances",
        "light sampling",
        "worst paths",
    ):
        assert part in said
    assert run(app, [*words, "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert set(facts["splits"]) == {"depth", "lobe", "light", "technique"}
    for split in facts["splits"].values():
        whole = sum(term["variance"] for term in split["terms"]) + split["covariance"]
        assert whole == pytest.approx(facts["variance"])
    assert len(facts["paths"]) == 5
    assert facts["sampling"] == "plain"


def test_a_black_scene_has_no_noise(scene, capsys):
    scene.write_text(SCENE.replace("RADIANCE", "0 0 0"))
    assert run(app, ["noise", str(scene.parent), "--resolution", "8x6", "--spp", "4"]) == 0
    assert "no light, and no noise" in capsys.readouterr().out


def test_a_room_of_a_dataset_is_seen_by_its_own_camera(scene, tmp_path, capsys):
    root = tmp_path / "d"
    make(root, tiny(1), command="make-dataset --rooms 1", work=fake_work(root, tiny(1)))
    room = root / "rooms" / "000000"
    (room / "scene.xml").write_text(scene.read_text())
    words = ["noise", str(room), "--resolution", "8x6", "--spp", "4"]
    assert run(app, [*words, "--view", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scene"] == "room 0 of d, view 1"
    assert run(app, [*words, "--view", "7"]) == 2
    assert "views 0 to 1" in capsys.readouterr().err
    (room / "scene.xml").write_text(SCENE.replace("<sensor", '<include filename="/etc/passwd"/><sensor', 1))
    assert run(app, words) == 2
    assert "<include>" in capsys.readouterr().err


def test_what_is_refused(scene, capsys):
    (scene.parent / "data").mkdir()
    (scene.parent / "data" / "dataset.json").write_text("{}")
    for words, code, told in (
        (["nowhere.xml"], 2, "there is no nowhere.xml"),
        ([str(scene.parent / "data")], 2, "name one of its rooms"),
        ([str(scene), "--view", "3"], 2, "cameras 0 to 0"),
        ([str(scene), "--resolution", "big"], 2, "WIDTHxHEIGHT"),
        ([str(scene), "--sampling", "best"], 2, "plain or guided"),
    ):
        assert run(app, ["noise", *words]) == code
        assert told in capsys.readouterr().err
