"""What is fuzzed: every kind of file that gibench reads. Libraries are imported where they are used: see `fuzzing`."""

from __future__ import annotations

import json
from pathlib import Path

from tests.robustness.fuzzing import Target


def _all_files(root: Path) -> list[str]:
    return sorted(str(path.relative_to(root)) for path in root.rglob("*") if path.is_file())


def _dataset(root: Path) -> None:
    from tests.robustness import samples

    samples.dataset(root)


def _read_dataset(root: Path) -> None:
    from gibench.cli.making import describe
    from gibench.datasets import open_dataset
    from gibench.datasets.manifest import read_manifest
    from gibench.datasets.previews import contact_sheet
    from gibench.datasets.verifying import verify

    assert all("\n" not in problem.what for problem in verify(root))
    describe(root, read_manifest(root))
    dataset = open_dataset(root)
    for frame in dataset:
        frame.read()
    dataset.names(0)
    contact_sheet(root, dataset.frames)


def _run(root: Path) -> None:
    from gibench.benchmarks import scoring
    from tests.robustness import samples

    folder = samples.run(root)
    scoring.default_threads = lambda workers: 1  # no processes of its own
    scoring.score(folder)


def _read_run(root: Path) -> None:
    from gibench.benchmarks import scoring, statistics
    from gibench.benchmarks.report.csv_files import write_csv_files
    from gibench.benchmarks.report.runs import Runs
    from gibench.benchmarks.report.summary import summarise
    from gibench.benchmarks.report.tables import write_tables
    from gibench.benchmarks.result_files import RunFolder
    from gibench.benchmarks.results import load
    from gibench.cli.bench_board import print_board, print_columns
    from gibench.cli.bench_printing import print_results

    folder = RunFolder(root)
    with folder.claimed():
        scoring.default_threads = lambda workers: 1
        scoring.score(folder)
    results = load(root)
    for table in ("results", "times", "stages", "frames", "sequences", "floor", "skipped"):
        getattr(results, table)
    if not results.frames.empty:
        runs = Runs([results])
        summary = summarise(runs)
        write_csv_files(runs, summary, root)
        write_tables(runs, summary, root)
        statistics.leaderboard(results, results.run["metrics"][0])
    print_results(root)
    print_board(results)
    if not results.frames.empty:
        print_columns(results, results.run["metrics"], ("full",))
    for id in folder.ids():
        if results.results.set_index("result")["status"].get(id) == "ok":
            results.prediction(id, 0)


def _frames(root: Path) -> None:
    from gibench.datasets.exr import encode
    from tests.datasets.fakes import pixels

    for number, channels in enumerate((("color",), ("color", "position", "shape_id"))):
        (root / f"{number}.exr").write_bytes(encode(pixels(channels, (24, 18), number)))


def _read_frames(root: Path) -> None:
    from gibench.datasets.exr import decode

    for path in sorted(root.glob("*.exr")):
        decode(path)
        decode(path.read_bytes(), widen=True)


def _bakes(root: Path) -> None:
    from gibench.baselines.bakes import BakeCache

    for kind in ("lightmap", "probes"):
        BakeCache(root, "a scene", {"cpu": "one"}).get(kind, {"texels": 4}, _bake)


def _bake(folder: Path) -> None:
    (folder / "content").write_bytes(b"x" * 100)


def _panoramas(root: Path) -> None:
    import numpy as np
    import OpenEXR

    values = np.random.default_rng(0).random((16, 32, 3)).astype(np.float32)
    OpenEXR.File({}, {"RGB": values}).write(str(root / "sky.exr"))
    mantissas = (255 * values).astype(np.uint8)
    exponents = np.full((16, 32, 1), 128, np.uint8)
    rows = np.concatenate([mantissas, exponents], -1).tobytes()
    (root / "sky.hdr").write_bytes(b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 16 +X 32\n" + rows)


def _read_panoramas(root: Path) -> None:
    from gibench.generators.daylight import hdr

    for path in sorted(root.iterdir()):
        hdr(path=str(path), rotation=0.0, lux=10.0)


RECIPE = """
# A recipe with every kind of key.
rooms = 3
seed = 7
kinds = ["living", "office"]
views = 2
resolution = [64, 48]
spp = 16
max_depth = 6
denoise = true
channels = ["radiance", "surface"]
environment = "auto"
path = "walk"
path_views = 4
licence = "CC0-1.0"
splits = { train = 0.5, test = 0.5 }
"""


def _recipes(root: Path) -> None:
    from importlib import resources

    (root / "recipe.toml").write_text(RECIPE)
    track = resources.files("gibench.benchmarks") / "tracks" / "walkthrough.toml"
    (root / "track.toml").write_text(track.read_text("utf-8"))


def _read_recipes(root: Path) -> None:
    from gibench.benchmarks.track import load_track
    from gibench.datasets.recipes import load_recipe

    load_recipe(root / "recipe.toml")
    load_track(str(root / "track.toml"))


SCENE = """<scene version="3.0.0">
  <default name="spp" value="4"/>
  <integrator type="path"><integer name="max_depth" value="4"/></integrator>
  <sensor type="perspective">
    <float name="fov" value="60"/>
    <transform name="to_world"><lookat origin="0, -3, 1" target="0, 0, 1" up="0, 0, 1"/></transform>
    <film type="hdrfilm"><integer name="width" value="32"/><integer name="height" value="24"/></film>
    <sampler type="independent"><integer name="sample_count" value="$spp"/></sampler>
  </sensor>
  <bsdf type="diffuse" id="grey"><rgb name="reflectance" value="0.5, 0.4, 0.3"/></bsdf>
  <bsdf type="twosided" id="picture"><bsdf type="diffuse">
    <texture type="bitmap" name="reflectance"><string name="filename" value="picture.png"/></texture>
  </bsdf></bsdf>
  <shape type="obj"><string name="filename" value="box.obj"/><ref id="grey"/></shape>
  <shape type="ply"><string name="filename" value="tetrahedron.ply"/><ref id="picture"/>
    <transform name="to_world"><rotate z="1" angle="30"/><translate x="1"/></transform>
  </shape>
  <shape type="rectangle"><transform name="to_world"><scale value="4"/></transform><ref id="grey"/></shape>
  <shape type="sphere"><point name="center" x="0" y="0" z="3"/><float name="radius" value="0.2"/>
    <emitter type="area"><spectrum name="radiance" value="400:10, 700:12"/></emitter>
  </shape>
  <include filename="more.xml"/>
</scene>
"""
MORE = """<scene version="3.0.0"><emitter type="constant"><rgb name="radiance" value="0.1"/></emitter></scene>
"""
OBJ = """mtllib box.mtl
v 0 0 0
v 1 0 0
v 1 1 0
v 0 1 0.5
vt 0 0
vt 1 0
vt 1 1
vn 0 0 1
usemtl red
f 1/1/1 2/2/1 3/3/1
f 1/1/1 3/3/1 4/1/1
"""
PLY = """ply
format ascii 1.0
element vertex 4
property float x
property float y
property float z
element face 4
property list uchar int vertex_indices
end_header
0 0 0
1 0 0
0 1 0
0 0 1
3 0 2 1
3 0 1 3
3 1 2 3
3 0 3 2
"""


def _scenes(root: Path) -> None:
    import numpy as np
    from PIL import Image

    for name, text in {
        "scene.xml": SCENE,
        "more.xml": MORE,
        "box.obj": OBJ,
        "box.mtl": "newmtl red\nKd 1 0 0\n",
        "tetrahedron.ply": PLY,
    }.items():
        (root / name).write_text(text)
    Image.fromarray(np.zeros((4, 4, 3), np.uint8)).save(root / "picture.png")
    cameras = [
        {"origin": [0, -2, 1], "target": [0, 0, 1], "fov_degrees": 60},
        {"matrix": np.eye(4).tolist(), "fov_degrees": 45, "principal_point": [0.1, -0.2]},
        {"origin": [0, -2, 1], "target": [0, 0, 1], "up": [1, 0, 1], "fov_degrees": 60},
    ]
    (root / "cameras.json").write_text(json.dumps(cameras))


def _read_scenes(root: Path) -> None:
    from gibench.generators.imported.room import import_room, write_imported_room
    from gibench.generators.imported.scene import ImportSettings, import_scene
    from gibench.rendering.backend import select_variant

    select_variant("auto")
    scene = import_scene(root / "scene.xml", ImportSettings("z", 1.0, False, False, root / "cameras.json"))
    room = import_room(scene, resolution=(32, 24), views=0)
    out = root / "out"
    out.mkdir()
    write_imported_room(room, out, max_depth=3, resolution=(32, 24), spp=1)


def _packed(root: Path) -> None:
    from gibench.benchmarks.report.archive import pack

    report = root / "report"
    (report / "plots").mkdir(parents=True)
    for name in ("index.html", "leaderboard.csv", "plots/a.svg"):
        (report / name).write_text(name * 50)
    pack(report, root / "report.zip")


def _read_packed(root: Path) -> None:
    from gibench.benchmarks.report.archive import unpack

    unpack(root / "report.zip", root / "new")


TARGETS = {
    "dataset": Target(_dataset, _all_files, _read_dataset),
    "run": Target(_run, _all_files, _read_run),
    "frames": Target(_frames, _all_files, _read_frames),
    "bakes": Target(_bakes, _all_files, _bakes),
    "panoramas": Target(_panoramas, _all_files, _read_panoramas),
    "recipes": Target(_recipes, _all_files, _read_recipes),
    "scenes": Target(_scenes, _all_files, _read_scenes),
    "archives": Target(_packed, lambda root: ["report.zip"], _read_packed),
}
