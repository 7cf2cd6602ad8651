from gibench.datasets.estimating import estimate
from gibench.datasets.pool import Work
from tests.datasets.fakes import Answer, tiny

MEASURED = {
    "paths_per_second": 1e4,
    "pixel_seconds": 1e-3,
    "pixel_bytes": 10.0,
    "room_bytes": 1000,
    "load_seconds": 0.5,
}


def estimated(recipe, **measured):
    answer = {
        "frames": len(recipe.rendered_views()),
        "rejections": {"view: too close": 2},
        "seconds": 0.25,
        "measured": {**MEASURED, **measured},
    }
    return estimate(recipe, work=Work(Answer({"variant": "fake"}), Answer(answer)))


def test_time_and_disk_are_scaled_to_the_recipe():
    result = estimated(tiny(3))  # 3 rooms of 2 views of 16 × 12 pixels with 4 samples
    frame = 16 * 12 * (4 / 1e4 + 1e-3)
    assert result.seconds_per_frame == frame
    assert abs(result.seconds - (3 * (0.25 + 0.5) + 6 * frame)) < 1e-9
    assert result.bytes == 3 * 1000 + 6 * 16 * 12 * 10
    assert result.rejections == {"view: too close": 6}


def test_frames_without_radiance_have_no_paths():
    result = estimated(tiny(1, channels=("surface",)), paths_per_second=0.0)
    assert result.seconds_per_frame == 16 * 12 * 1e-3


def test_of_many_rooms_some_are_built_and_counts_are_scaled():
    done = []
    recipe = tiny(1500)
    answer = {"frames": 2, "rejections": {}, "seconds": 0.25, "measured": MEASURED}
    work = Work(Answer({"variant": "fake"}), Answer(answer))
    result = estimate(recipe, work=work, workers=2, on_room=lambda n, of: done.append((n, of)))
    assert done[-1] == (100, 100)
    assert (result.checked, result.rooms, result.frames) == (100, 1500, 3000)
    assert abs(result.build_seconds - 0.25) < 1e-9
