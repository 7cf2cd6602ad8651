import numpy as np
import pytest
from PIL import Image

from gibench.datasets import open_dataset
from gibench.datasets.channel_pictures import id_colors, picture_of, scale_colors
from gibench.datasets.previews import (
    SHEET_FRAMES,
    SHEET_WIDTH,
    contact_sheet,
    frame_panel,
    grid,
    remark_of,
)
from gibench.rendering.channels import CHANNELS
from tests.datasets.fakes import pixels


@pytest.mark.parametrize("name", CHANNELS)
@pytest.mark.parametrize("fill", ["noise", "nothing"])
def test_every_channel_has_a_picture(name, fill):
    values = pixels((name,), (16, 12), seed=1)[name]
    picture, legend = picture_of(CHANNELS[name], values if fill == "noise" else np.zeros_like(values), 1.0)
    assert picture.shape == (12, 16, 3)
    assert picture.min() >= 0
    assert picture.max() <= 1
    assert legend.isprintable()


def test_parts_share_the_exposure_of_the_frame():
    values = np.full((2, 2, 3), 0.18, np.float32)
    bright, _ = picture_of(CHANNELS["direct_diffuse"], values, 2.0)
    # IEC 61966-2-1 of 0.36
    np.testing.assert_allclose(bright, 1.055 * 0.36 ** (1 / 2.4) - 0.055, rtol=1e-5)


def test_axes_of_a_normal_are_the_colours_that_everybody_knows():
    normal = np.array([[[0, 0, 1], [1, 0, 0], [0, 0, 0]]], np.float32)
    picture, _ = picture_of(CHANNELS["normal"], normal, 1.0)
    np.testing.assert_allclose(picture[0], [[0.5, 0.5, 1], [1, 0.5, 0.5], [0, 0, 0]])


def test_ids_get_colours_that_differ_and_misses_are_black():
    ids = np.arange(121).reshape(11, 11).astype(np.uint32)
    colors = id_colors(ids).reshape(-1, 3)
    assert not colors[0].any()
    differences = np.abs(colors[1:, None] - colors[None, 1:]).max(-1) + np.eye(120)
    assert differences.min() > 0.01
    assert np.abs(np.diff(colors[1:], axis=0)).max(1).min() > 0.15


def test_the_scale_of_distances_grows_evenly_in_lightness():
    ramp = scale_colors(np.linspace(0, 1, 101)[None])[0].astype(np.float64)
    linear = np.where(ramp <= 0.04045, ramp / 12.92, ((ramp + 0.055) / 1.055) ** 2.4)
    luminance = linear @ [0.2126, 0.7152, 0.0722]
    lightness = 116 * np.cbrt(luminance) - 16  # CIE 1976 L*
    assert np.all(np.diff(lightness) > 0)
    np.testing.assert_allclose(np.diff(lightness), np.diff(lightness).mean(), rtol=0.1)


def test_a_sheet_shows_as_many_rooms_as_it_can(rooms_made):
    table = open_dataset(rooms_made).frames
    sheet = contact_sheet(rooms_made, table)
    assert Image.open(rooms_made / "preview.png").size == sheet.size
    columns = sheet.width // SHEET_WIDTH
    assert 4 <= columns <= 7  # 24 frames of 4:3
    assert np.asarray(sheet).std() > 10
    assert contact_sheet(rooms_made, table.head(1)).width < 2 * SHEET_WIDTH
    assert len(table) < SHEET_FRAMES


def test_a_remark_names_the_sequence_and_the_map_where_there_is_one():
    still = {"kind": "office", "path": ""}
    assert remark_of(still) == "office"
    assert remark_of(still | {"lighting": "area-light", "environment": ""}) == "office"
    assert remark_of(still | {"environment": "esplanade"}) == "esplanade, office"
    assert remark_of(still | {"path": "turning", "environment": "lebombo"}) == "turning, lebombo, office"
    assert remark_of({"kind": "a\nb\r", "path": ""}) == "a b"  # of a stranger


def written_at(sheet, tile):
    """Columns of a sheet with text in them, in the rows above the first tile."""
    above = np.asarray(sheet)[: sheet.height - tile.height - 6].max(axis=(0, 2))
    return np.flatnonzero(above > 60)


def test_a_remark_is_written_whatever_its_length_and_stays_above_its_tile():
    tile = Image.new("RGB", (SHEET_WIDTH, 20))
    title, short, long = "room 0  view 10", "office", "turning, st_peters_square_night, dining-kitchen"
    alone = written_at(grid([(tile, title, "")], 1), tile)
    assert written_at(grid([(tile, title, short)], 1), tile).max() > alone.max()
    bare, whole, cut = (grid([(tile, title, remark)], 1) for remark in ("", long[:25], 3 * long))
    assert whole.height == cut.height > bare.height
    for sheet in (whole, cut):
        assert written_at(sheet, tile).max() > alone.max()
        assert written_at(sheet, tile).max() <= 6 + SHEET_WIDTH
    # One that is long moves those of all tiles, which stay in line.
    assert grid([(tile, title, short), (tile, title, long)], 2).height == whole.height


def test_a_panel_shows_every_channel(rooms_made):
    panel = frame_panel(open_dataset(rooms_made)[0])
    rows, columns = -(-len(CHANNELS) // 6), 6
    assert panel.width // columns >= 256
    assert panel.height // rows >= 192
