"""Temporal metrics on sequences whose change is known, and which pixels the frame before shows."""

import math

import numpy as np
import pytest

from gibench import metrics

TEMPORAL = ["warping_error", "mabd", "temporal_difference"]


def pan(texture, steps, size, shift=(2, 1)):
    """A camera that moves over a still texture by whole pixels: frames, motion, visibility."""
    height, width = size
    frames, visible = [], []
    for step in range(steps):
        x, y = step * shift[0], step * shift[1]
        frames.append(texture[y : y + height, x : x + width])
        rows, columns = np.mgrid[:height, :width]
        visible.append((columns + shift[0] < width) & (rows + shift[1] < height))
    # The window moves right, so a point lay further right in the frame before.
    motion = np.broadcast_to(np.array(shift, dtype=np.float32), (steps, height, width, 2))
    return np.stack(frames), motion, np.stack(visible)


@pytest.fixture
def panned(rng):
    return pan(rng.random((60, 70, 3)), 5, (30, 31))


@pytest.mark.parametrize("name", TEMPORAL)
def test_rigid_pan_of_a_still_texture_is_exactly_zero(name, panned):
    frames, motion, visible = panned
    error = metrics.metric(name)(frames, frames, motion=motion, visible=visible)
    assert error.value == error.prediction == error.reference == 0
    assert error.value_frames.shape == (4,)


def test_without_motion_the_pan_is_not_zero(panned):
    frames, _, _ = panned
    expected = np.abs(np.diff(frames, axis=0) @ [0.2126, 0.7152, 0.0722]).mean()
    assert metrics.mabd(frames, frames).prediction == pytest.approx(expected)
    assert metrics.mabd(frames, frames).value == 0
    assert metrics.temporal_difference(frames, frames).reference == pytest.approx(
        np.abs(np.diff(frames, axis=0)).mean()
    )


def test_pan_by_fractions_of_a_pixel_of_a_linear_ramp(rng):
    # Bilinear interpolation is exact on a ramp, so the sign and the order of the motion's components show.
    rows, columns = np.mgrid[:20, :30]
    shift = np.array([0.3, -0.6])
    frames = np.stack(
        [0.2 + 0.01 * (columns + t * shift[0]) + 0.02 * (rows + t * shift[1]) for t in range(4)]
    )
    frames = np.repeat(frames[..., None], 3, axis=-1)
    motion = np.broadcast_to(shift, (4, 20, 30, 2))
    visible = np.zeros((4, 20, 30), bool)
    visible[:, 1:-1, 1:-1] = True
    assert metrics.warping_error(frames, frames, motion=motion, visible=visible).value < 1e-28
    wrong = metrics.warping_error(frames, frames, motion=-motion, visible=visible)
    assert wrong.value == pytest.approx((2 * (0.01 * 0.3 - 0.02 * 0.6)) ** 2)


@pytest.mark.parametrize("amplitude", [0.001, 0.1, 0.2])
def test_planted_flicker_gives_its_amplitude(panned, amplitude):
    frames, motion, visible = panned
    ref = 0.25 + 0.5 * frames
    sign = np.array([0.5, -0.5, 0.5, -0.5, 0.5])[:, None, None, None]
    pred = ref + amplitude * sign
    along = {"motion": motion, "visible": visible}
    warping = metrics.warping_error(pred, ref, **along)
    assert math.sqrt(warping.value) == pytest.approx(amplitude)
    assert warping.reference == pytest.approx(0, abs=1e-30)
    assert metrics.temporal_difference(pred, ref, **along).value == pytest.approx(amplitude)
    brightness = metrics.mabd(pred, ref, **along)
    assert brightness.prediction == pytest.approx(amplitude)
    assert math.sqrt(brightness.value) == pytest.approx(amplitude)


def test_a_steady_error_costs_no_temporal_difference(panned):
    frames, motion, visible = panned
    error = metrics.temporal_difference(0.5 * frames + 0.3, 0.5 * frames, motion=motion, visible=visible)
    assert error.value == pytest.approx(0, abs=1e-15)


def test_light_that_depends_on_the_view_shows_in_the_references_value(panned):
    frames, motion, visible = panned
    ref = 0.5 * frames + np.linspace(0, 0.4, 5)[:, None, None, None]
    error = metrics.warping_error(ref, ref, motion=motion, visible=visible)
    assert error.value == error.reference == pytest.approx(0.01)


@pytest.mark.parametrize("name", TEMPORAL)
def test_fully_occluded_frame_is_nan_with_a_warning(name, panned):
    frames, motion, visible = panned
    visible = visible.copy()
    visible[3] = False
    with pytest.warns(metrics.EmptyMaskWarning, match="frame 3"):
        error = metrics.metric(name)(frames, frames, motion=motion, visible=visible)
    for values in (error.value_frames, error.prediction_frames, error.reference_frames):
        assert np.isnan(values).tolist() == [False, False, True, False]
    assert error.value == 0
    with pytest.warns(metrics.EmptyMaskWarning, match="frame 1, 2, 3, 4"):
        error = metrics.metric(name)(frames, frames, motion=motion, visible=np.zeros_like(visible))
    assert math.isnan(error.value)
    assert math.isnan(error.prediction)


def test_hidden_pixels_do_not_count(panned, rng):
    frames, motion, visible = (array[:2] for array in panned)
    pred = frames.copy()
    pred[1][~visible[1]] = rng.random((int((~visible[1]).sum()), 3))
    assert metrics.warping_error(pred, frames, motion=motion, visible=visible).value == 0
    assert metrics.warping_error(pred, frames, motion=motion).value > 0


@pytest.mark.parametrize("name", TEMPORAL)
def test_against_a_plain_loop(name, rng):
    pred, ref = rng.random((2, 3, 6, 7, 3))
    motion = rng.uniform(-1.5, 1.5, (3, 6, 7, 2))
    visible = rng.random((3, 6, 7)) < 0.6
    luma = np.array([0.2126, 0.7152, 0.0722])
    values = []
    for t in (1, 2):
        changes = []
        for frames in (pred, ref):
            change = []
            for y, x in zip(*np.nonzero(visible[t]), strict=True):
                u = min(max(x + motion[t, y, x, 0], 0), 6)
                v = min(max(y + motion[t, y, x, 1], 0), 5)
                before = np.zeros(3)
                for row in range(6):
                    for column in range(7):
                        before += (
                            max(0, 1 - abs(u - column))
                            * max(0, 1 - abs(v - row))
                            * frames[t - 1, row, column]
                        )
                change.append(frames[t, y, x] - before)
            changes.append(np.array(change))
        p, r = changes
        values.append(
            {
                "warping_error": (p**2).mean(),
                "mabd": (np.abs(p @ luma).mean() - np.abs(r @ luma).mean()) ** 2,
                "temporal_difference": np.abs(p - r).mean(),
            }[name]
        )
    error = metrics.metric(name)(pred, ref, motion=motion, visible=visible)
    np.testing.assert_allclose(error.value_frames, values, rtol=1e-10)
    assert error.value == pytest.approx(np.mean(values))


def test_bad_sequences(panned):
    frames, motion, visible = panned
    with pytest.raises(metrics.ShapeError, match="at least two frames"):
        metrics.mabd(frames[0], frames[0])
    with pytest.raises(metrics.ShapeError, match="at least two frames"):
        metrics.mabd(frames[:1], frames[:1])
    with pytest.raises(metrics.ShapeError, match="motion"):
        metrics.warping_error(frames, frames, motion=motion[..., :1])
    with pytest.raises(metrics.ShapeError, match="motion has shape"):
        metrics.warping_error(frames, frames, motion=motion[:, 1:])
    broken = motion.copy()
    broken[2, 3, 4, 0] = np.nan
    with pytest.raises(metrics.NonFiniteError, match="motion has 1 non-finite value"):
        metrics.warping_error(frames, frames, motion=broken)
    with pytest.raises(metrics.ShapeError, match="mask has shape"):
        metrics.warping_error(frames, frames, motion=motion, visible=visible[1:])
    with pytest.raises(metrics.RangeError, match="outside"):
        metrics.warping_error(frames + 1, frames, motion=motion)


# A pinhole camera that slides to the right along a wall, with a nearer panel in front of the wall.
WALL, PANEL = 4.0, 2.0
EDGE, STRIDE, FOCAL = 0.413, 0.113, 40.0


def slide(steps, stride=STRIDE, size=(24, 48), panel_id=2):
    """Exact ids, positions and motion of the scene, by intersecting it analytically."""
    height, width = size
    rows, columns = np.mgrid[:height, :width].astype(float)
    across, down = (columns - width / 2) / FOCAL, (rows - height / 2) / FOCAL
    ids, positions, motions = [], [], []
    for step in range(steps):
        camera = step * stride
        on_panel = np.abs(camera + across * PANEL) < EDGE
        depth = np.where(on_panel, PANEL, WALL)
        position = np.stack([camera + across * depth, depth, down * depth], axis=-1)
        ids.append(np.where(on_panel, panel_id, 1))
        positions.append(position)
        motions.append(np.stack([FOCAL * stride / depth, np.zeros_like(depth)], axis=-1))
    return np.stack(motions).astype(np.float32), np.stack(ids), np.stack(positions).astype(np.float32)


def truly_visible(motion, ids, position, stride=STRIDE):
    """Whether the ray from the camera before to each point is free, by the geometry alone."""
    result = np.zeros(ids.shape, bool)
    for step in range(1, len(ids)):
        before = (step - 1) * stride
        x, depth = position[step, ..., 0].astype(float), position[step, ..., 1].astype(float)
        crossing = before + (x - before) * PANEL / depth
        hidden = (depth > PANEL) & (np.abs(crossing) < EDGE)
        column = np.arange(ids.shape[2]) + motion[step, ..., 0]
        result[step] = ~hidden & (column <= ids.shape[2] - 1)
    return result


@pytest.mark.parametrize("panel_id", [1, 2])
def test_visibility_finds_what_was_hidden(panel_id):
    # With one id for both surfaces, only the position can tell.
    motion, ids, position = slide(4, panel_id=panel_id)
    found, truth = metrics.visibility(motion, ids, position), truly_visible(motion, ids, position)
    assert not found[0].any()
    assert truth[1:].any()
    assert not truth[1:].all()
    assert not (found & ~truth).any()
    # At silhouettes a pixel half of which was hidden is left out: one column a side of the panel.
    assert (truth & ~found)[1:].sum(axis=2).max() <= 2


def test_visibility_survives_rotation_of_a_slanted_surface(rng):
    # A plane seen by a turning camera: interpolated positions are off, but by little.
    height, width = 30, 40
    rows, columns = np.mgrid[:height, :width].astype(float)
    positions, directions = [], []
    for angle in (0.0, 0.03):
        ray = np.stack([(columns - 20) / 30, np.ones_like(rows), (rows - 15) / 30], axis=-1)
        turn = np.array([[np.cos(angle), np.sin(angle), 0], [-np.sin(angle), np.cos(angle), 0], [0, 0, 1]])
        ray = ray @ turn.T
        distance = 3.0 / (ray @ np.array([0.6, 0.8, 0.1]))
        positions.append(ray * distance[..., None])
        directions.append(turn)
    local = positions[1] @ directions[0]
    before = np.stack(
        [local[..., 0] / local[..., 1] * 30 + 20, local[..., 2] / local[..., 1] * 30 + 15], axis=-1
    )
    motion = np.stack([np.zeros_like(before), before - np.stack([columns, rows], axis=-1)])
    inside = (
        (before[..., 0] <= width - 1)
        & (before[..., 0] >= 0)
        & (before[..., 1] >= 0)
        & (before[..., 1] <= height - 1)
    )
    found = metrics.visibility(
        motion.astype(np.float32), np.ones((2, height, width), int), np.stack(positions)
    )
    assert np.array_equal(found[1], inside)


def test_visibility_of_a_still_camera_is_everywhere(rng):
    position = np.repeat(rng.normal(size=(1, 9, 8, 3)), 3, axis=0)
    ids = np.repeat(rng.integers(0, 5, (1, 9, 8)), 3, axis=0)
    found = metrics.visibility(np.zeros((3, 9, 8, 2)), ids, position)
    assert found[1:].all()


def test_visibility_of_bad_arrays():
    motion, ids, position = slide(2)
    with pytest.raises(metrics.DtypeError, match="ids must be integers"):
        metrics.visibility(motion, ids.astype(float), position)
    with pytest.raises(metrics.ShapeError, match="do not belong"):
        metrics.visibility(motion, ids[:, 1:], position)
    with pytest.raises(metrics.ShapeError, match="do not belong"):
        metrics.visibility(motion, ids, position[..., :2])
    position[1, 2, 3, 0] = np.inf
    with pytest.raises(metrics.NonFiniteError, match="position has 1 non-finite value"):
        metrics.visibility(motion, ids, position)


@pytest.mark.parametrize("size", [(1, 1), (1, 5), (5, 1)])
def test_thin_images(size, rng):
    frames = rng.random((3, *size, 3))
    motion = np.zeros((3, *size, 2))
    assert metrics.warping_error(frames, np.zeros_like(frames), motion=motion).value == pytest.approx(
        (np.diff(frames, axis=0) ** 2).mean()
    )
