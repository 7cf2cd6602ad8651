"""The page in a real headless Chromium, opened from disk."""

from __future__ import annotations

import re
import time

import numpy as np
import pytest

from gibench.benchmarks.report.image_files import decode, encode, image_name, write_images
from gibench.benchmarks.report.page import write_page
from gibench.benchmarks.report.summary import summarise
from gibench.metrics import flip, tone_map
from gibench.metrics.tone_map import srgb_from_linear
from tests.benchmarks.report.synthetic import Setting, SyntheticRun

PIXELS = (
    """canvas => Array.from(canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height).data)"""
)


@pytest.fixture
def opened(browser, page_file):
    """A function that opens the page; nothing may go wrong or be asked of a network while it is open."""
    pages = []

    def open_page(width=1280, height=900, **context):
        page = browser.new_context(viewport={"width": width, "height": height}, **context).new_page()
        page.requested, page.problems = [], []
        page.on("request", lambda request: page.requested.append(request.url))
        page.on("console", lambda said: page.problems.append(said.text) if is_problem(said) else None)
        page.on("pageerror", lambda problem: page.problems.append(str(problem)))
        page.goto(page_file.as_uri())
        pages.append(page)
        return page

    yield open_page
    for page in pages:
        assert page.problems == []
        assert all(url.startswith(("file://", "data:")) for url in page.requested)
        page.context.close()


def is_problem(said):
    # The one warning that is left out is about reading pixels back, which these tests do.
    return said.type in ("error", "warning") and "willReadFrequently" not in said.text


def result_of(run, label, scene="room-000000"):
    table = run.results.set_index(["label", "scene"])
    return table.loc[(label, scene), "result"]


def images_asked(page):
    return [url for url in page.requested if re.search(r"/(images|errors)/", url)]


def labels(page):
    return page.locator("#board tbody th").all_inner_texts()


def look_at_images(page):
    page.locator("#split").scroll_into_view_if_needed()
    page.wait_for_function("document.querySelectorAll('#split canvas[data-shows]').length === 2")


def pixels(page, selector):
    canvas = page.locator(selector)
    height, width = canvas.evaluate("canvas => [canvas.height, canvas.width]")
    return np.array(canvas.evaluate(PIXELS), float).reshape(height, width, 4)[..., :3]


def eventually(holds, seconds=15):
    """Images are drawn when they have arrived and are in sight; that takes a moment."""
    end = time.monotonic() + seconds
    while not holds():
        assert time.monotonic() < end
        time.sleep(0.05)


def shown(page, selector, name):
    """Wait until a canvas, scrolled to, shows a file."""
    page.locator(selector).scroll_into_view_if_needed()
    page.wait_for_function(
        "([where, name]) => document.querySelector(where).dataset.shows === name", arg=[selector, name]
    )


def test_nothing_of_the_images_is_loaded_before_it_is_looked_at(opened):
    page = opened()
    page.wait_for_timeout(300)
    assert images_asked(page) == []
    look_at_images(page)
    first = images_asked(page)
    assert 2 <= len(first) < 14
    assert not any("/errors/" in url for url in first)
    page.locator("#tiles figure").last.scroll_into_view_if_needed()
    page.wait_for_function(
        "document.querySelectorAll('#tiles figure:last-child canvas[data-shows]').length === 1"
    )
    assert len(images_asked(page)) > len(first)
    assert len(set(images_asked(page))) == len(images_asked(page))  # each once


def test_columns_sort_by_mouse_and_keyboard_and_say_so(opened, summary):
    page = opened()
    order = summary.entries.sort_values("ms_median", kind="stable")["label"].tolist()
    header = page.get_by_role("columnheader", name="ms / frame")
    header.get_by_role("button").click()
    assert labels(page) == order
    assert header.get_attribute("aria-sort") == "ascending"
    header.get_by_role("button").press("Enter")
    assert labels(page) == order[::-1]
    assert header.get_attribute("aria-sort") == "descending"
    assert page.evaluate("document.activeElement.dataset.key") == "ms"  # the focus is where it was
    assert page.locator("#sorted").inner_text() == "Sorted by ms / frame, descending"
    assert page.locator("th[aria-sort=ascending], th[aria-sort=descending]").count() == 1
    page.get_by_role("columnheader", name="Method").first.get_by_role("button").press("Space")
    assert labels(page) == sorted(
        order, key=lambda text: [int(w) if w.isdigit() else w for w in re.split(r"(\d+)", text)]
    )


def test_the_board_starts_with_the_best_and_follows_the_filters(opened, run, summary):
    page = opened()

    def best_first(part, metric, rising=True):
        scores = summary.scores[(summary.scores["part"] == part) & (summary.scores["metric"] == metric)]
        means = scores.set_index(summary.entries["label"].loc[scores["entry"]])["mean"]
        return means.sort_values(ascending=rising).index.tolist()

    assert labels(page) == best_first("full", "rmse")
    page.select_option("#metric", "psnr")
    assert labels(page) == best_first("full", "psnr", rising=False)
    page.select_option("#part", "specular")
    assert labels(page)[: len(best_first("specular", "psnr"))] == best_first("specular", "psnr", rising=False)
    page.select_option("#metric", "rmse")
    page.select_option("#scene", "room-000001")
    frames = run.frames.merge(run.results[["result", "label", "scene"]], on="result")
    own = frames[
        (frames["scene"] == "room-000001") & (frames["metric"] == "rmse") & (frames["part"] == "specular")
    ]
    expected = own.groupby("label")["value"].mean().sort_values()
    assert labels(page)[: len(expected)] == expected.index.tolist()
    value = page.locator(f'#board tr[data-label="{expected.index[0]}"] td').first.inner_text()
    assert float(value) == pytest.approx(expected.iloc[0], rel=6e-3)


def test_differences_and_failures_are_told(opened):
    page = opened()
    assert "worse" in page.locator('#board tr[data-label="lightmap"]').inner_text()
    assert "2 of 3" in page.locator('#board tr[data-label="ulr"]').inner_text()
    assert "1 of 33 results failed" in page.locator("#warnings").inner_text()
    assert "MemoryError: <b>no</b> room" in page.locator("#failures summary").inner_text()


def test_the_divider_moves_by_mouse_and_keyboard(opened):
    page = opened()
    look_at_images(page)
    divider, pane = page.get_by_role("slider", name="Divider"), page.locator("#split").bounding_box()
    now = lambda: int(divider.get_attribute("aria-valuenow"))  # noqa: E731
    assert now() == 50
    page.mouse.move(pane["x"] + pane["width"] / 2, pane["y"] + pane["height"] / 2)
    page.mouse.down()
    page.mouse.move(pane["x"] + pane["width"] / 4, pane["y"] + pane["height"] / 2, steps=4)
    page.mouse.up()
    assert now() == 25
    place = divider.bounding_box()
    assert place["x"] + place["width"] / 2 == pytest.approx(pane["x"] + pane["width"] / 4, abs=2)
    clip = page.locator("#split .over").evaluate("node => getComputedStyle(node).clipPath")
    assert clip == "inset(0px 0px 0px 25%)" or clip.startswith("inset(0px 0px 0px 25.")
    divider.focus()
    for key, expected in (("ArrowRight", 27), ("ArrowLeft", 25), ("PageUp", 35), ("Home", 0), ("End", 100)):
        page.keyboard.press(key)
        assert now() == expected


def test_an_image_is_what_was_stored_under_the_exposure_that_is_set(opened, run):
    page = opened()
    look_at_images(page)
    left = "#split .layer:not(.over) canvas"
    reference = run.reference("room-000000", 0, "full") * run.exposure("room-000000", 0)
    for stops in ("0", "2", "-3.25"):
        page.locator("#exposure").fill(stops)
        page.locator("#split").scroll_into_view_if_needed()
        expected = 255 * srgb_from_linear(np.minimum(1, decode(encode(reference)) * 2 ** float(stops)))
        # And no farther from the true picture than its 1.1 % can be seen.
        true = 255 * np.asarray(tone_map(reference.astype(np.float64), 2 ** float(stops)))
        for image, distance in ((expected, 0.51), (true, 1.6)):
            eventually(lambda: np.abs(pixels(page, left) - image).max() <= distance)  # noqa: B023
    assert page.locator("#exposure-shown").inner_text() == "−3.25 EV"
    page.click("#exposure-reset")
    assert page.locator("#exposure-shown").inner_text() == "0 EV"


def test_error_maps_have_a_scale_and_its_colours(opened, run):
    from matplotlib import colormaps

    page = opened()
    look_at_images(page)
    assert not page.locator("#error-legend").is_visible()
    page.get_by_label("error maps").check()
    assert page.locator("#error-legend").is_visible()
    assert "FLIP" in page.locator("#error-legend").inner_text()
    result = run.results[(run.results["label"] == "lightmap") & (run.results["scene"] == "room-000000")].iloc[
        0
    ]["result"]
    page.select_option("#right", label="lightmap")
    shown(page, "#split .over canvas", image_name("errors", result, 0, "full"))
    exposure = run.exposure("room-000000", 0)
    pair = (run.prediction(result, 0, "full"), run.reference("room-000000", 0, "full"))
    error = np.rint(255 * flip(*(tone_map(image, exposure) for image in pair), map=True))
    for top in ("1", "0.25"):
        page.select_option("#error-range", top)
        page.locator("#split").scroll_into_view_if_needed()
        codes = np.minimum(255, np.floor(error / float(top) + 0.5)).astype(int)
        colours = colormaps["magma"](codes, bytes=True)[..., :3]
        eventually(lambda: (pixels(page, "#split .over canvas") == colours).all())  # noqa: B023
    # The reference has no error: it stays an image.
    assert "images/room" in page.locator("#split .layer:not(.over) canvas").get_attribute("data-shows")


def where(page, selector):
    """What share of an image is in the middle of its pane, and how large it is drawn."""
    return page.locator(selector).evaluate(
        """canvas => { const a = canvas.getBoundingClientRect(), b = canvas.closest(".pane").getBoundingClientRect();
        return [(b.x + b.width / 2 - a.x) / a.width, (b.y + b.height / 2 - a.y) / a.height, a.width / b.width]; }"""
    )


def test_all_images_zoom_and_move_to_the_same_spot(opened):
    page = opened()
    look_at_images(page)
    everywhere = [
        "#split .over canvas",
        "#tiles figure:nth-child(1) canvas",
        "#tiles figure:nth-child(5) canvas",
    ]
    pane = page.locator("#split").bounding_box()
    spot = (pane["x"] + 0.3 * pane["width"], pane["y"] + 0.4 * pane["height"])
    page.mouse.move(*spot)
    scrolled = page.evaluate("scrollY")
    page.mouse.wheel(0, 40)  # the image has no focus yet: the page scrolls
    page.wait_for_function("before => scrollY > before", arg=scrolled)
    assert where(page, everywhere[0])[2] == pytest.approx(1)
    pane = page.locator("#split").bounding_box()
    spot = (pane["x"] + 0.3 * pane["width"], pane["y"] + 0.4 * pane["height"])
    page.mouse.click(*spot)
    page.mouse.wheel(0, -500)
    page.wait_for_function("document.querySelector('#images').classList.contains('zoomed')")
    first = where(page, everywhere[0])
    assert first[2] > 2
    # What was under the pointer still is.
    assert first[0] + (0.3 - 0.5) / first[2] == pytest.approx(0.3, abs=0.01)
    assert first[1] + (0.4 - 0.5) / first[2] == pytest.approx(0.4, abs=0.01)
    for selector in everywhere:
        assert where(page, selector) == pytest.approx(first, abs=1e-3)
    page.mouse.down()
    page.mouse.move(spot[0] + 60, spot[1] + 30, steps=3)
    page.mouse.up()
    moved = where(page, everywhere[2])
    assert moved[0] == pytest.approx(first[0] - 60 / pane["width"] / first[2], abs=0.01)
    assert where(page, everywhere[1]) == pytest.approx(moved, abs=1e-3)
    page.keyboard.press("ArrowRight")
    assert where(page, everywhere[1])[0] > moved[0]
    page.keyboard.press("+")
    assert where(page, everywhere[1])[2] == pytest.approx(1.5 * moved[2])
    page.keyboard.press("0")
    for selector in everywhere:
        assert where(page, selector) == pytest.approx([0.5, 0.5, 1], abs=1e-3)


def test_two_fingers_zoom(opened):
    page = opened(360, 740, has_touch=True, is_mobile=True)
    look_at_images(page)
    pane = page.locator("#split").bounding_box()
    middle = (pane["x"] + 0.25 * pane["width"], pane["y"] + pane["height"] / 2)
    session = page.context.new_cdp_session(page)

    def touch(kind, *apart):
        points = [
            {"x": middle[0] + side * apart[0], "y": middle[1], "id": n} for n, side in enumerate((-1, 1))
        ]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points if apart[0] else []})

    touch("touchStart", 15)
    for apart in (20, 30, 40):
        touch("touchMove", apart)
    touch("touchEnd", 0)
    page.wait_for_function("document.querySelector('#images').classList.contains('zoomed')")
    assert where(page, "#split .over canvas")[2] == pytest.approx(40 / 15, rel=0.15)


def test_frames_change_by_slider_buttons_and_keys_and_show_their_numbers(opened, run):
    page = opened()
    look_at_images(page)
    page.locator("#frame").focus()
    page.keyboard.press("ArrowRight")
    assert page.locator("#frame-shown").inner_text() == "1 of 2"
    page.click("#frame-on")
    shown(page, "#split .layer:not(.over) canvas", image_name("images", "room-000000", 2, "full"))
    page.locator("#split").focus()
    page.keyboard.press(",")
    shown(page, "#split .layer:not(.over) canvas", image_name("images", "room-000000", 1, "full"))
    row = page.locator("#numbers tbody tr", has_text="isg").locator("td").all_inner_texts()
    head = page.locator("#numbers thead th").all_inner_texts()[1:]
    result = run.results[(run.results["label"] == "isg") & (run.results["scene"] == "room-000000")].iloc[0][
        "result"
    ]
    frames = run.frames[
        (run.frames["result"] == result) & (run.frames["frame"] == 1) & (run.frames["part"] == "full")
    ]
    values = frames.set_index("metric")["value"]
    told = dict(zip(head, map(float, row), strict=True))
    for title, metric in (("RMSE", "rmse"), ("PSNR (dB)", "psnr"), ("FLIP", "flip")):
        assert told[title] == pytest.approx(values[metric], rel=6e-3)


def test_a_method_that_tells_no_specular_part_has_no_such_image(opened):
    page = opened()
    page.select_option("#part", "specular")
    page.locator("#images-title").scroll_into_view_if_needed()
    names = page.locator("#right option").all_inner_texts()
    assert "isg" in names
    assert "lightmap" not in names
    look_at_images(page)
    assert "-specular.js" in page.locator("#split .over canvas").get_attribute("data-shows")


def test_an_image_that_is_missing_is_told_and_no_error(opened, page_file, run):
    result = run.results[(run.results["label"] == "isg") & (run.results["scene"] == "room-000001")].iloc[0][
        "result"
    ]
    name = image_name("images", result, 0, "full")
    (page_file.parent / name).rename(page_file.parent / f"{name}.away")
    try:
        page = opened()
        page.select_option("#scene", "room-000001")
        look_at_images(page)
        page.select_option("#right", label="isg")
        lost = page.locator("#split .lost")
        lost.wait_for(state="visible")
        assert lost.inner_text() == f"{name} is missing"
        page.problems.clear()  # the browser itself reports the file that it did not find
    finally:
        (page_file.parent / f"{name}.away").rename(page_file.parent / name)


def overlapping(page, selector):
    """Pairs of texts of a plot that lie on each other, and those that leave it."""
    return page.locator(selector).evaluate(
        """svg => {
            const page = svg.getBoundingClientRect();
            const texts = [...svg.querySelectorAll("text")];
            const all = texts.map((node) => [node.textContent, node.getBoundingClientRect()]);
            const meet = (a, b) => a.left < b.right - 1 && b.left < a.right - 1
                && a.top < b.bottom - 2 && b.top < a.bottom - 2;
            const cut = all.filter(([, box]) => box.left < page.left - 1 || box.right > page.right + 1
                || box.top < page.top - 1 || box.bottom > page.bottom + 1).map(([text]) => text);
            const pairs = all.flatMap(([one, a], at) => all.slice(at + 1).filter(([, b]) => meet(a, b))
                .map(([other]) => `${one} | ${other}`));
            return [...cut, ...pairs];
        }"""
    )


@pytest.mark.parametrize("width", [1280, 360])
def test_plots_have_names_that_do_not_lie_on_each_other(opened, width):
    page = opened(width)
    for cost in ("ms", "prepare", "bytes"):
        page.locator(f'[name=cost][value="{cost}"]').check()
        for metric in ("rmse", "psnr", "flip"):
            page.select_option("#metric", metric)
            assert overlapping(page, "#scatter svg") == []
            assert overlapping(page, "#along svg") == []
            texts = page.locator("#scatter svg text").all_text_contents()
            assert {"lightmap", "rtrt", "path-traced oidn", "Pareto front"} <= set(texts)
            assert any(text.startswith("noise floor") for text in texts)
    page.select_option("#metric", "warping_error")
    assert "whole path" in page.locator("#along").inner_text()


@pytest.fixture(scope="module")
def trained_file(tmp_path_factory):
    """The page of a run with networks, stills, and a training whose errors were not finite at its end."""
    out = tmp_path_factory.mktemp("trained")
    chosen = [
        Setting(name, kind="network", blur=blur) for name, blur in (("a", 2), ("a:plain", 1), ("b", 30))
    ]
    chosen.append(Setting("rtrt", kind="lightmap"))
    run = SyntheticRun(out, chosen=chosen, frames=5, stills=2, scenes=2, seeds=(1, 2), measured=False)
    first = run.curves["result"].iloc[0]
    run.curves.loc[(run.curves["result"] == first) & (run.curves["step"] > 700), "error"] = np.nan
    summary = summarise(run)
    write_images(run, summary.results, out)
    return write_page(run, summary, out)


@pytest.mark.parametrize("width", [1280, 360])
def test_trainings_are_drawn_a_panel_a_method(opened, trained_file, width):
    page = opened(width)
    assert page.locator("#training").is_hidden()  # nothing was trained there
    page.goto(trained_file.as_uri())
    assert page.locator("#training").is_visible()
    panels = page.locator("#training-charts svg")
    captions = page.locator("#training-charts figcaption").all_inner_texts()
    assert [text.split(":")[0] for text in captions] == ["a, 8 trainings", "b, 4 trainings"]
    assert all("its own measure" in text for text in captions)
    assert "never between panels" in page.locator("#training-note").inner_text()
    crosses = "path[d*='l6 6m0 -6l-6 6']"
    for against, words in (
        ("seconds", "seconds of training, looks included"),
        ("steps", "steps of training"),
    ):
        page.locator(f'[name=training-against][value="{against}"]').check()
        for panel in range(2):
            assert overlapping(page, f"#training-charts figure:nth-child({panel + 1}) svg") == []
            assert words in panels.nth(panel).locator("text").all_text_contents()
        assert panels.nth(0).locator("path[fill=none][stroke-opacity]").count() == 8
        assert [panels.nth(panel).locator(crosses).count() for panel in range(2)] == [4, 0]
        assert {"a", "a:plain", "0"} <= set(panels.nth(0).locator("text").all_text_contents())
    page.select_option("#scene", "room-000000")
    assert panels.nth(0).locator("path[fill=none][stroke-opacity]").count() == 4
    assert page.evaluate("document.documentElement.scrollWidth") == width


def test_no_line_runs_through_stills(opened, trained_file):
    page = opened()
    page.goto(trained_file.as_uri())
    paths = page.locator("#along svg path[stroke-width='1.5']").evaluate_all(
        "all => all.map((p) => p.getAttribute('d'))"
    )
    assert len(paths) == 4
    for path in paths:
        # Two stills, each by itself, then a sequence of three frames.
        assert re.sub(r"[^ML]", "", path) == "MMMLL"


def test_a_click_in_the_path_plot_goes_to_that_frame(opened):
    page = opened()
    along = page.locator("#along svg")
    along.scroll_into_view_if_needed()
    box = along.bounding_box()
    page.mouse.click(box["x"] + 0.75 * box["width"], box["y"] + box["height"] / 2)
    assert page.locator("#frame-shown").inner_text() == "2 of 2"


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_phone_scrolls_in_one_direction_only(opened, scheme):
    page = opened(360, 740, has_touch=True, is_mobile=True, color_scheme=scheme)
    actions = (
        lambda: None,
        lambda: page.select_option("#metric", "psnr"),
        lambda: page.locator("[name=show][value=errors]").check(),
    )
    for action in actions:
        action()
        assert page.evaluate("document.documentElement.scrollWidth") == 360
        outside = page.evaluate(
            """[...document.querySelectorAll("button, select, input, summary, h1, h2, h3, p")].filter((node) => {
                const box = node.getBoundingClientRect();
                const hidden = node.closest(".scroll, .unseen, .pane") || node.matches(".skip");
                return box.width && !hidden && (box.left < 0 || box.right > 360.5);
            }).map((node) => node.outerHTML.slice(0, 80))"""
        )
        assert outside == []


def luminance(colour):
    red, green, blue = (int(part) / 255 for part in re.findall(r"\d+", colour)[:3])
    linear = [c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in (red, green, blue)]
    return 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2]


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_text_stands_out_in_both_themes(opened, scheme):
    """WCAG 2.2, success criterion 1.4.3: a contrast of at least 4.5 to 1."""
    page = opened(color_scheme=scheme)
    for _ in range(3):
        for selector in (
            "h1",
            ".note",
            "#board tbody td",
            "#board thead button",
            "nav a",
            ".warning",
            "label",
        ):
            text, behind = page.locator(selector).first.evaluate(
                """node => {
                    const behind = (at) => getComputedStyle(at).backgroundColor;
                    let at = node;
                    while (at.parentElement && behind(at) === "rgba(0, 0, 0, 0)") at = at.parentElement;
                    return [getComputedStyle(node).color, behind(at)];
                }"""
            )
            lighter, darker = sorted((luminance(text), luminance(behind)), reverse=True)
            assert (lighter + 0.05) / (darker + 0.05) >= 4.5, (scheme, selector, text, behind)
        page.click("#theme")


def test_the_keyboard_reaches_everything_in_the_order_of_the_page(opened):
    page = opened()
    seen = []
    for _ in range(80):
        page.keyboard.press("Tab")
        name = page.evaluate(
            """(() => {
                const at = document.activeElement;
                return (at.id || at.name || at.dataset.key || at.textContent).slice(0, 20);
            })()"""
        )
        if seen and name == seen[0]:
            break
        seen.append(name)
    wanted = ["To the leaderboard", "theme", "track", "metric", "label", "mean", "ms", "cost"]
    wanted += ["frame", "exposure", "show", "left", "right", "split", "divider"]
    positions = [seen.index(name) for name in wanted]
    assert positions == sorted(positions)
    names = page.evaluate(
        """[...document.querySelectorAll("button, select, input, [role=slider], [tabindex]")].filter((node) => {
            const named = node.labels?.length || node.matches("[aria-label], [aria-labelledby]");
            return node.offsetParent && !named && !(node.tagName === "BUTTON" && node.textContent.trim());
        }).map((node) => node.outerHTML.slice(0, 80))"""
    )
    assert names == []  # every control has a name


def test_two_machines_are_warned_about_and_never_ranked_by_time(browser, run, tmp_path):
    from gibench.benchmarks.report.page import write_page
    from gibench.benchmarks.report.summary import summarise
    from tests.benchmarks.report.synthetic import SyntheticRun

    two = SyntheticRun(tmp_path, scenes=1, frames=1, machines=("slow", "fast"))
    two.results.loc[two.results["machine"] == "fast", "ms_median"] /= 10
    page = browser.new_page()
    page.goto(write_page(two, summarise(two), tmp_path).as_uri())
    assert "Times of different machines must not be compared" in page.locator("#warnings").inner_text()
    page.get_by_role("columnheader", name="ms / frame").get_by_role("button").click()
    machines = page.locator("#board tbody tr td:nth-child(2)").all_inner_texts()
    assert machines == sorted(machines, reverse=True)  # slow, then fast: the order of the run, not of time
    assert "Choose one machine" in page.locator("#scatter").inner_text()
    page.select_option("#on-machine", "fast")
    assert set(page.locator("#board tbody tr td:nth-child(2)").all_inner_texts()) == {"fast"}
    assert page.locator("#scatter svg").is_visible()
    page.close()


def test_a_page_of_failures_only_opens(browser, run, tmp_path):
    from gibench.benchmarks.report.page import write_page
    from gibench.benchmarks.report.summary import summarise
    from tests.benchmarks.report.synthetic import SyntheticRun

    lost = SyntheticRun(tmp_path, scenes=1, frames=1, failed=tuple(setting.label for setting in run.settings))
    page, problems = browser.new_page(), []
    page.on("pageerror", lambda problem: problems.append(str(problem)))
    page.goto(write_page(lost, summarise(lost), tmp_path).as_uri())
    assert problems == []
    assert page.locator("#board tbody tr.failed").count() == len(run.settings)
    assert page.locator("#failures details").count() == len(run.settings)
    page.close()
