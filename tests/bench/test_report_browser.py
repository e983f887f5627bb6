"""The report in a real browser: it opens from a file, and its buttons work."""

import re
from contextlib import contextmanager
from itertools import pairwise

import pytest

from sautereau.analysis.report.build import About, build_report
from sautereau.analysis.report.contents import gather
from sautereau.commands.folder import report
from sautereau.commands.output import FileOutput
from sautereau.rig.load import with_values
from sautereau.robot.experiment.plan import Plan, Row
from sautereau.robot.experiment.session_folder import SessionFolder
from tests.bench.browser import MONOSPACED, OVERLAPS, WIDE, observed
from tests.budget import slow

PRESSES = 4


@pytest.fixture(scope="module")
def session(write_session, tmp_path_factory):
    """A session folder with its report."""
    path = tmp_path_factory.mktemp("sessions") / "evening"
    rig = write_session.one.rig
    folder = SessionFolder(path, Plan(rig, (Row(rig, PRESSES),)), None, 0)
    folder.start()
    write_session(path, PRESSES, session=folder.session)
    assert report(path, output=FileOutput(json=True, force=True)) == 0
    return path


@contextmanager
def opened(browser, path, **options):
    """Open a page; errors, dialogs and requests to a network fail the test."""
    page, faults, requests = observed(browser, **options)
    load(page, path)
    yield page
    assert faults == []
    assert all(request.url.startswith(("file:", "blob:", "data:")) for request in requests)
    page.close()


def load(page, path):
    page.goto(path.as_uri())
    page.wait_for_selector("html[data-ready=yes]")


@pytest.fixture(scope="module")
def shown(browser, session):
    """The page as another test may have left it, whose faults are seen at the end."""
    with opened(browser, session / "report.html") as page:
        yield page


@pytest.fixture
def page(shown, session):
    """The page as it opens."""
    shown.emulate_media(media="screen", color_scheme="light")
    load(shown, session / "report.html")
    return shown


def opacities(page, plot):
    return page.evaluate(
        "id => document.getElementById(id).data.filter(t => t.meta).map(t => [t.meta, t.opacity])",
        plot,
    )


def ranges(page):
    return page.evaluate(
        "() => { const l = document.getElementById('over-time')._fullLayout;"
        " return [l.xaxis3.range, l.yaxis3.range]; }"
    )


@pytest.mark.slow
def test_every_plot_is_drawn(shown):
    for plot in ("over-time", "over-session", "force-on-deflection"):
        assert shown.locator(f"#{plot} .main-svg").count() > 0
    lines = shown.locator("#over-time .scatterlayer .trace path.js-line")
    assert lines.count() == 3 * PRESSES


@pytest.mark.slow
def test_a_click_highlights_a_press(page):
    button = page.get_by_role("button", name="press 3", exact=True)
    button.click()
    assert button.get_attribute("aria-pressed") == "true"
    assert page.get_by_role("status").inner_text() == "press 3 is highlighted"
    assert page.locator("details[data-press='3']").get_attribute("open") is not None
    for plot in ("over-time", "force-on-deflection"):
        for press, opacity in opacities(page, plot):
            assert opacity == (1 if press == 3 else 0.1)
    button.press("Enter")
    assert button.get_attribute("aria-pressed") == "false"
    assert {opacity for _, opacity in opacities(page, "over-time")} == {0.6}


def shows(page, part):
    """Return the page's button that shows a part of the plot."""
    return page.locator("button[data-plot]").filter(has_text=part)


@pytest.mark.slow
def test_the_plot_zooms_by_buttons_and_by_mouse(page):
    full, _ = ranges(page)
    shows(page, "Release").press("Enter")
    release, force = ranges(page)
    assert full[0] < release[0] < release[1] < full[1]
    assert release[1] - release[0] < 10
    assert 0 < force[1] < 2
    shows(page, "Zoom out").click()
    wider, _ = ranges(page)
    assert wider[1] - wider[0] == pytest.approx(2 * (release[1] - release[0]))
    shows(page, "Later").click()
    later, _ = ranges(page)
    assert later[0] == pytest.approx((wider[0] + wider[1]) / 2)
    shows(page, "Key going down").click()
    plot = page.locator("#over-time .nsewdrag").first
    plot.scroll_into_view_if_needed()
    box = plot.bounding_box()
    page.mouse.move(box["x"] + 0.3 * box["width"], box["y"] + 0.5 * box["height"])
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"], steps=5)
    page.mouse.up()
    until(page, lambda: ranges(page)[0] != full)
    dragged, _ = ranges(page)
    assert dragged[1] - dragged[0] == pytest.approx(0.2 * (full[1] - full[0]), rel=0.05)


def until(page, condition):
    """Wait for a condition; the page's security policy forbids Playwright's own function."""
    for _ in range(2400):
        if condition():
            return
        page.wait_for_timeout(25)
    raise AssertionError("the condition was not fulfilled within 60 s")


DRAWN = """() => [...document.querySelectorAll('.plot')].every(plot =>
  Math.abs(plot.querySelector('.main-svg').clientWidth - plot.clientWidth) < 2)"""
"""Plotly draws again some time after the page was resized."""


def brightness(page):
    colour = page.evaluate("() => getComputedStyle(document.body).backgroundColor")
    return sum(map(int, re.findall(r"\d+", colour)[:3])) / 3


EXTREME = ([1e-12, 2e-12, 3e-12, 5e-12], [1e9, -2e9, 3e9, 4e9], [1 + k * 1e-9 for k in range(4)])
"""Values from press to press with many digits."""


@pytest.mark.parametrize(
    ("style", "schemes", "zoomed"),
    [
        (WIDE, ("light", "dark", "light"), {390}),
        slow(WIDE, ("light", "dark", "light"), {1280, 800}),
        slow("", ("dark", "light", "dark"), {1280, 800, 390}),
        slow(MONOSPACED, ("light", "light", "dark"), {1280, 800, 390}),
    ],
)
def test_no_text_overlaps_another_and_nothing_is_cut(browser, session, style, schemes, zoomed):
    """At widths that are zoomed in every part of the plot over time; with values of many digits."""
    path = session / "styled.html"
    text = (session / "report.html").read_text(encoding="utf-8")
    path.write_text(text.replace("</style>", style + "</style>", 1), encoding="utf-8")
    with opened(browser, path) as page:
        for width, scheme in zip((1280, 800, 390), schemes, strict=True):
            page.emulate_media(color_scheme=scheme)
            page.set_viewport_size({"width": width, "height": 900})
            until(page, lambda: page.evaluate(DRAWN))
            check_layout(page, width)
            for button in page.locator("button[data-range]").all() if width in zoomed else ():
                button.press("Enter")
                check_layout(page, width)
        page.evaluate("y => Plotly.restyle('over-session', { y }, [0, 1, 2])", EXTREME)
        check_layout(page, width)


def check_layout(page, width):
    found = page.evaluate(OVERLAPS)
    assert found["texts"] > 100
    assert found["overlaps"] == []
    assert found["cut"] == []
    assert found["wide"] <= width


@pytest.mark.slow
def test_features_from_press_to_press_have_uncertainties(page):
    """No axis spans less than they."""
    drawn = page.evaluate(
        "() => { const p = document.getElementById('over-session');"
        " return p._fullData.map(t => [t.yaxis, t.error_y.array, t.y,"
        " p._fullLayout[t.yaxis.replace('y', 'yaxis')].range]); }"
    )
    assert len({axis for axis, *_ in drawn}) == 3
    for _, stds, values, (low, high) in drawn:
        assert len(stds) == len(values) == PRESSES
        for std, value in zip(stds, values, strict=True):
            assert std > 0
            assert low <= value - std
            assert value + std <= high


@pytest.mark.slow
def test_the_theme_follows_the_system_and_the_button(page):
    def text():
        return page.evaluate("() => document.getElementById('over-time').layout.font.color")

    assert brightness(page) > 200
    light = text()
    page.emulate_media(color_scheme="dark")
    until(page, lambda: text() != light)
    assert brightness(page) < 60
    toggle = page.get_by_role("button", name="Dark")
    assert toggle.get_attribute("aria-pressed") == "true"
    toggle.click()
    until(page, lambda: text() == light)
    assert brightness(page) > 200
    assert toggle.get_attribute("aria-pressed") == "false"


@pytest.mark.slow
def test_keyboard_and_screen_reader(page):
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.textContent") == "Skip to the presses"
    page.keyboard.press("Tab")
    assert page.evaluate("() => document.activeElement.id") == "theme"
    levels = page.eval_on_selector_all("h1, h2, h3", "e => e.map(h => Number(h.tagName[1]))")
    assert levels[0] == 1
    assert all(after <= before + 1 for before, after in pairwise(levels))
    unnamed = page.eval_on_selector_all(
        "button", "e => e.filter(b => !(b.ariaLabel || b.textContent.trim())).length"
    )
    assert unnamed == 0
    for plot in page.locator(".plot").all():
        about = plot.get_attribute("aria-labelledby")
        assert page.locator(f"#{about}").inner_text()


def frame(page):
    """Return the slider's frame, and the places of plectrum, wire and reading in it."""
    return page.evaluate(
        "() => [Number(document.getElementById('frame').value),"
        " ...[['head-1-plectrum', 'points'], ['head-1-wire', 'transform']].map(([id, name]) =>"
        " document.getElementById(id).getAttribute(name)),"
        " document.getElementById('reading-1').textContent,"
        " document.getElementById('frame').getAttribute('aria-valuetext')]"
    )


@pytest.mark.slow
def test_the_slow_motion_follows_the_slider(page):
    """By keyboard and mouse, with all parts."""
    slider = page.get_by_role("slider", name="Frame")
    number, plectrum, wire, *_ = frame(page)
    slider.press("ArrowLeft")
    before, other, _, time, description = frame(page)
    assert before == number - 1
    assert other != plectrum
    assert description.startswith(f"{time}, string held, ")
    slider.press("Home")
    first, straight, rest, *_ = frame(page)
    assert first == 0
    # Top and bottom edge of a straight plectrum.
    assert len({pair.split(",")[1] for pair in straight.split()}) == 2
    assert rest == "translate(0 0)"
    slider.press("End")
    assert "string released" in frame(page)[-1]
    box = slider.bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert frame(page)[0] == pytest.approx(50, abs=1)
    slider.fill(str(number))
    assert frame(page)[:3] == [number, plectrum, wire]


@pytest.mark.slow
def test_it_plays_and_pauses(page):
    button = page.locator("#play")
    start, still = frame(page)[0], frame(page)
    page.wait_for_timeout(200)
    assert frame(page) == still  # it does not start by itself
    button.press("Enter")
    assert button.inner_text() == "Pause"
    until(page, lambda: frame(page)[0] > start + 2)
    button.press("Enter")
    assert button.inner_text() == "Play"
    paused = frame(page)
    page.wait_for_timeout(200)
    assert frame(page) == paused
    page.locator("#frame").press("End")
    button.click()
    until(page, lambda: 2 < frame(page)[0] < 90)  # from its beginning again
    page.locator("#frame").press("End")
    assert button.inner_text() == "Play"


@pytest.mark.slow
def test_the_slow_motion_prints_the_frame_before_release(page):
    initial = frame(page)
    page.locator("#frame").press("Home")
    page.evaluate("() => dispatchEvent(new Event('beforeprint'))")
    assert frame(page) == initial
    page.evaluate("() => dispatchEvent(new Event('afterprint'))")
    assert frame(page)[0] == 0


@pytest.mark.slow
def test_it_prints(page):
    page.emulate_media(color_scheme="dark")
    assert page.pdf().startswith(b"%PDF")
    page.emulate_media(media="print")
    assert not page.get_by_role("button", name="Dark").is_visible()


@pytest.mark.slow
def test_the_tables_need_no_scripts(browser, session):
    page = browser.new_page(java_script_enabled=False)
    page.goto((session / "report.html").as_uri())
    assert "The plots need JavaScript" in page.inner_text("noscript")
    assert page.locator("tbody tr button").count() == PRESSES
    assert page.locator("#head-1-plectrum").is_visible()
    assert page.locator("#reading-2").inner_text() == "string held"
    assert not page.locator("#play").is_visible()
    page.close()


@pytest.mark.slow
def test_malformed_texts_run_nothing(browser, write_session, tmp_path):
    odd = "</script></pre><script>alert(1)</script><img src=x onerror=alert(2)>\x00\u202e"
    rig = with_values(write_session.one.rig, {"name": odd, "daq.channels.0.sensor": odd})
    paths = write_session(
        tmp_path, 3, rig=rig, events=(("fault", odd),), notes=odd, controller=odd, scene=odd
    )
    about = About(odd, odd, (odd,), (odd,), scene=odd)
    out = tmp_path / "report.html"
    out.write_text(build_report(gather(paths, "elastica"), about), encoding="utf-8")
    with opened(browser, out) as page:
        page.get_by_role("button", name="press 2", exact=True).click()
        assert "alert(1)" in page.get_by_role("heading", level=1).inner_text()
        assert page.locator("img").count() == 0
