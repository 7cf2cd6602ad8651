"""The depth of paths is that of a preset's rooms, for the references and for whatever methods trace and bake."""

import copy
import json

from gibench.baselines.nearest_probe import METHOD as NEAREST_PROBE
from gibench.baselines.path_traced import METHOD as PATH_TRACED
from gibench.benchmarks.orders import Order, ordered_methods
from gibench.benchmarks.registry import Found
from gibench.benchmarks.results import load
from gibench.benchmarks.running import run
from gibench.benchmarks.track import check_track
from tests.benchmarks.conftest import TINY


def track():
    values = copy.deepcopy(TINY)
    preset = values["presets"]["tiny"]
    del preset["training"], preset["methods"]
    preset["room"] |= {"views": 1, "path_views": 2, "max_depth": 1}
    preset["reference"]["spp"] = 2
    preset["knobs"] = {"texels": 4, "lightmap_spp": 16, "probes": 8, "probe_width": 64, "probe_spp": 1}
    preset["budget"] = {"prepare": 600, "render": 600}
    return check_track({**values, "parts": ["full", "specular", "indirect"], "metrics": ["rmse"]})


def test_it_arrives_where_light_is_traced_and_baked(tmp_path):
    methods = [Found(method, "gibench", "0") for method in (PATH_TRACED, NEAREST_PROBE)]
    set_to = {"path-traced": {"spp": (1,), "denoise": (False,)}}
    chosen = ordered_methods(track(), "tiny", methods, set_to)
    run(tmp_path, Order(track=track(), preset="tiny", methods=chosen))
    results = load(tmp_path)
    assert set(results.results["status"]) == {"ok"}
    (traced,) = results.results.query("method == 'path-traced'")["result"]
    for frame in (0, 1):
        # Light that was scattered once is direct light.
        assert not results.prediction(traced, frame, "indirect").any()
        assert not results.reference("room-000000", frame, "indirect").any()
        assert results.prediction(traced, frame).max() > 0
    bakes = [json.loads(file.read_text())["key"] for file in tmp_path.rglob("bake.json")]
    depths = {
        (bake["kind"], bake["settings"].get("part")): bake["settings"].get("max_depth") for bake in bakes
    }
    assert {bake for bake, depth in depths.items() if depth is not None} == {
        ("lightmap", None),
        ("probes", "radiance"),
    }
    assert {depth for depth in depths.values() if depth is not None} == {1}
