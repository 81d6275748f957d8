# SPDX-License-Identifier: MIT
"""The report of a run in a real browser: what it says, what it shows, and that it needs nothing but itself."""
import base64
import json
import re
import shutil
import zlib
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from selenium.webdriver import ActionChains, Keys
from selenium.webdriver.support.ui import Select

from browser import browser, complaints, opened, until
import harness
from harness import TOW, call, changed, run, texts, write_case
from made_up_ensemble import edited

POSTPROC = Path(__file__).resolve().parents[2] / "postproc"

from bergtow import _library
from bergtow import cli, writing
from bergtow.errors import BergtowError
from bergtow.plot import style
from bergtow.reporting import page as report
from bergtow.reporting import replay as replay_data
from bergtow.reporting import run as report_run
from bergtow.result import origins as report_case
from bergtow.result import overlaps as rafted
from bergtow.result.run import Run
from bergtow.stats import design_value as statement

HOSTILE = "</script><script>window.hacked = 1</script>\"'><img src=x onerror='window.hacked = 2'> {{ 7 * 6 }} & berg"
OLD = f"an old page, {writing.MARK}"
CASE = changed(TOW, output=None, run__title=HOSTILE, ice__concentration=0.7, reference__mean_force=3.0,
               reference__source="<b>nobody</b>", output__window_start=8)
#: in the map's frame, within a window that goes along, on a line that breaks
MOVING = changed(
    TOW,
    domain={"frame": "geographic", "length": 20, "width": 8, "ends": "moving", "sides": "periodic", "ahead": 10},
    body={"length": 2, "draft": 0.5},
    run__duration=60,
    tow={
        "mode": "line", "speed": 0.2, "ramp": 2, "line_length": 5, "line_stiffness": 50e3, "line_damping": 1000,
        "line": {"breaking_load": 1e6}
    })


RAFTS = changed(TOW, domain={"length": 15, "width": 8, "ends_closing": 0.15}, ice__concentration=0.75,
                ice__rafting={"kappa": 5}, run__duration=15)
#: the ice goes faster than the towed body, which lies on the seam of the sides
DOWNSTREAM = changed(TOW, output__window_start=2, domain={"length": 20, "width": 8, "ends": "periodic",
                                                          "sides": "periodic"}, body__y=3.8,
                     tow={"mode": "speed", "speed": 0.05}, water={"current_x": 0.4}, run__duration=6)


def script(*arguments):
    return harness.script("report", *arguments)


def page_without_pictures(folder, path, monkeypatch, *arguments):
    """A page made in this process; drawing its pictures would take most of the time."""
    monkeypatch.setattr(report_run, "pictures", lambda _: [])
    cli.perform("report", folder, "-o", path, *arguments)
    return path


@pytest.fixture(scope="module")
def chrome(tmp_path_factory):
    with browser(tmp_path_factory.mktemp("profile")) as driver:
        yield driver


@pytest.fixture(scope="module")
def tow(tmp_path_factory):
    """A run, and its page as the script writes it."""
    r = run(tmp_path_factory.mktemp("tow"), CASE)
    result = script(r.dir)
    assert result.returncode == 0, result.stderr
    assert result.stdout.startswith(str(r.dir / "report.html"))
    return r


@pytest.fixture(scope="module")
def alone(tow, tmp_path_factory):
    """The page, copied to where nothing else is."""
    return shutil.copy(tow.dir / "report.html", tmp_path_factory.mktemp("elsewhere") / "page.html")


def js(driver, code, *arguments):
    return driver.execute_script(code, *arguments)


def ready(driver, path):
    requests = opened(driver, path)
    until(lambda: js(driver, "return window.bergtow !== undefined && bergtow.ready"))
    return requests


def seek(driver, frame):
    """Go to a frame and wait until it is drawn."""
    driver.execute_async_script(
        "const done = arguments[1]; bergtow.seek(arguments[0]); requestAnimationFrame(() => "
        "requestAnimationFrame(done))",
        frame)


@pytest.fixture
def page(chrome, alone):
    """The page in its first state."""
    chrome.requests = ready(chrome, alone)
    yield chrome
    assert complaints(chrome) == []


def shown(driver, n):
    return np.array(js(driver, f"return [...Array({n}).keys()].map((i) => bergtow.pose(i))"))


def text(driver, selector):
    return [e.text for e in driver.find_elements("css selector", selector)]


# ---- the page

@pytest.mark.slow
class Drifting:
    """What Replay packs of a run whose floes all move, in ways that no packing makes small."""
    n_frames, n_floes, n_pieces, towed, period, box = 61, 12000, 0, None, (0, 0), (0, 1e4, 0, 1e4)
    area = np.ones(n_floes)
    rng = np.random.default_rng(1)

    def pose(self, frame):
        return self.rng.uniform(0, 1e4, (self.n_floes, 3))

    def wrap(self, places):
        return places

    def speed(self, frame):
        return self.rng.uniform(size=self.n_floes)

    least_contact_force = speed


def test_a_page_of_drifting_ice_can_be_mailed():
    """All floes, in fewer frames, within 15 MB with the pictures of so much ice. Red: the limit of before, 40 MB."""
    made = replay_data.Replay.__new__(replay_data.Replay)
    made.run, made.compress = Drifting(), True
    frames, floes = made._fit(replay_data.LIMIT)
    assert len(floes) == 12000 and 40 <= len(frames) < 61 and 6e6 < made.size < 8.1e6


def test_needs_nothing_but_itself(page, alone):
    assert [r for r in page.requests if not r.startswith("data:")] == [alone.resolve().as_uri()]
    assert all(js(page, "return [...document.querySelectorAll('figure svg')].map((s) => s.getBBox().width > 300)"))
    assert len(page.find_elements("css selector", "figure svg")) == 6
    # What it cannot do: ask the network.
    blocked = page.execute_async_script(
        "const done = arguments[0]; fetch('http://127.0.0.1:9/').then(() => done('reached'), (e) => done(e.name))")
    assert blocked == "TypeError" and any("Content Security Policy" in c for c in complaints(page))


def test_text_of_the_case_stays_text(page):
    assert js(page, "return window.hacked") is None
    assert text(page, "h1") == [HOSTILE] and page.title.startswith(HOSTILE)
    assert page.find_elements("css selector", "b") == []
    assert any("<b>nobody</b>" in t for t in text(page, "#numbers td"))


def test_says_the_numbers_of_the_run(page, tow):
    s = tow.summary
    body = page.find_element("tag name", "main").text
    mean, low, high = (s[f"mean_ice_resistance{end}_n"] for end in ("", "_low", "_high"))
    name = "mean" if s["window"]["verdict"] == "steady" else "mean over the window"
    said = re.search(rf"ice resistance, {name}\n([\d.]+) (k?)N\n95 % interval ([-\d.]+) to ([-\d.]+) \2N", body)
    value, kilo, *ends = said.groups()
    assert np.allclose(np.array([value, *ends], float) * (1e3 if kilo else 1), [mean, low, high], rtol=0.03,
                       atol=0.051 * (high - mean))
    assert s["window"]["verdict"] == "steady" or all(words in body for words in texts(s["window"]["reasons"]))
    assert text(page, ".warning li") == texts(s["warnings"]) and len(s["warnings"]) > 0
    rows = {
        r.find_element("tag name", "th").text: r.text
        for r in page.find_elements("css selector", "#estimates tbody tr")
    }
    names = {e["label"]: name for name, e in s["estimate_labels"].items()}
    assert list(
        names.values()) == [e["name"] for e in json.loads(call("--list-quantities", "--json").stdout)["estimates"]]
    assert set(rows) == set(names)
    for label, name in names.items():
        e = s["estimates"][name]
        assert float(re.search(r" ([\d.]+) N\b", rows[label])[1]) == pytest.approx(e["force_n"], rel=0.006)
        assert ("yes:" if e["valid"] else "no:") in rows[label]
        ratio = e["simulated_over_estimate"]
        assert (f" {style.short(ratio)} " in rows[label]) == e["compares"] if ratio else " – " in rows[label]
    assert s["state_hash"] in body and s["impacts"]["conversion"] in body and "measured mean force (reference)" in body
    assert style.short(mean / 3.0) in text(page, "#numbers td")


def test_fits_a_narrow_window_and_a_dark_one(page):
    page.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                         {"width": 380, "height": 800, "deviceScaleFactor": 1, "mobile": True})
    page.execute_cdp_cmd("Emulation.setEmulatedMedia",
                         {"features": [{"name": "prefers-color-scheme", "value": "dark"}]})
    try:
        assert js(page, "return document.documentElement.scrollWidth") <= 380
        paper = [
            int(v) for v in re.findall(r"\d+", js(page, "return getComputedStyle(document.body).backgroundColor"))[:3]
        ]
        ink = [int(v) for v in re.findall(r"\d+", js(page, "return getComputedStyle(document.body).color"))[:3]]
        assert max(paper) < 60 and min(ink) > 200
    finally:
        page.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
        page.execute_cdp_cmd("Emulation.setEmulatedMedia", {"features": []})


# ---- the replay

def test_poses_and_values_are_those_of_the_file(page, tow):
    pose, body, force, speed, time = (tow.dataset(f"frames/{n}")
                                      for n in ("pose", "body_pose", "contact_force", "speed", "time"))
    n, last = pose.shape[1], len(time) - 1
    quantum = np.ptp(pose[:, :, :2].reshape(-1, 2), axis=0) / 65535
    for frame in (0, 1, last // 2, last):
        seek(page, frame)
        assert js(page, "return bergtow.time") == pytest.approx(time[frame], abs=1e-9)
        error = shown(page, n) - pose[frame]
        assert np.all(np.abs(error[:, :2]) <= 0.5001 * quantum)
        assert np.abs((error[:, 2] + np.pi) % (2 * np.pi) - np.pi).max() <= np.pi / 65536 * 1.001
        assert np.allclose(js(page, "return bergtow.body(0)"), body[frame, 0], atol=1e-12)
        for kind, values in (("force", force[frame]), ("speed", speed[frame, :n])):
            got = np.array(js(page, f"return [...Array({n}).keys()].map((i) => bergtow.value('{kind}', i))"))
            assert np.all(
                np.abs(got - values) <= 2e-5 *
                np.sqrt(np.maximum(got, values) * {"force": force, "speed": speed}[kind].max()) + 1e-9)
    assert force.max() > 0
    seek(page, last // 2 + 0.25)
    between = 0.75 * pose[last // 2] + 0.25 * pose[last // 2 + 1]
    assert np.all(np.abs(shown(page, n)[:, :2] - between[:, :2]) <= 0.5001 * quantum) and np.ptp(
        pose[last // 2:last // 2 + 2], axis=0).max() > 3 * quantum.max()
    turn = np.abs(pose[1:, :, 2] - pose[:-1, :, 2]).max(axis=1)
    k = int(np.argmax(turn))
    seek(page, k + 0.25)
    wanted = (0.75 * pose[k] + 0.25 * pose[k + 1])[:, 2]
    assert turn[k] > 1e-3 and np.abs((shown(page, n)[:, 2] - wanted + np.pi) % (2 * np.pi) - np.pi).max() < 1e-4
    seek(page, last // 2 + 0.25)
    page.find_element("id", "replay-smooth").click()
    assert np.all(np.abs(shown(page, n)[:, :2] - pose[last // 2, :, :2]) <= 0.5001 * quantum)


@pytest.mark.slow
def test_plays_pauses_and_ends(page):
    assert js(page, "return [bergtow.playhead, bergtow.playing]") == [0, False]
    button = page.find_element("id", "replay-play")
    button.click()
    until(lambda: js(page, "return bergtow.playhead") > 2)
    assert js(page, "return bergtow.playing") and "pause" in button.text
    button.click()
    held = js(page, "return bergtow.playhead")
    assert not js(page, "return bergtow.playing")
    seek(page, held)
    last = js(page, "return bergtow.frames") - 1
    assert js(page, "return bergtow.playhead") == held < last
    field = page.find_element("id", "replay-field")
    seek(page, last - 3)
    field.send_keys(" ")
    until(lambda: js(page, "return bergtow.playhead") == last)
    assert not js(page, "return bergtow.playing")
    field.send_keys(Keys.ARROW_LEFT)
    assert js(page, "return bergtow.playhead") == last - 1
    field.send_keys(Keys.HOME)
    assert js(page, "return bergtow.playhead") == 0


def test_keys_need_no_click(page, tow):
    """As long as the replay is in sight; elsewhere they scroll, and other controls keep theirs."""
    def press(key):
        ActionChains(page).send_keys(key).perform()
        return js(page, "return bergtow.playhead")

    js(page, "document.getElementById('replay-field').scrollIntoView({block: 'center'})")
    assert js(page, "return document.activeElement.tagName") == "BODY"
    assert press(Keys.ARROW_RIGHT) == 1 and press(Keys.END) == js(page, "return bergtow.frames") - 1
    assert press(Keys.HOME) == 0
    press(" ")
    assert js(page, "return bergtow.playing")
    press(" ")
    assert not js(page, "return bergtow.playing")
    assert js(page, "window.scrollTo(0, document.body.scrollHeight); return window.scrollY") > 0
    until(lambda: js(page, "return document.getElementById('replay-field').getBoundingClientRect().bottom") < 0)
    seek(page, 5)
    assert press(Keys.ARROW_RIGHT) == 5 == press(Keys.HOME)
    js(page, "document.getElementById('replay-field').scrollIntoView({block: 'center'});"
       "const i = document.createElement('input'); i.id = 'other'; document.body.append(i);"
       "i.focus({preventScroll: true})")
    assert press("f") == 5 == press(Keys.HOME)
    assert js(page, "return document.getElementById('other').value") == "f"
    js(page, "document.getElementById('other').remove()")


def test_slider_scrubs(page, tow):
    slider = page.find_element("id", "replay-time")
    js(page, "arguments[0].value = 57; arguments[0].dispatchEvent(new Event('input'))", slider)
    assert js(page, "return bergtow.playhead") == 57
    assert shown(page, 1)[0, 0] == pytest.approx(tow.dataset("frames/pose")[57, 0, 0], abs=1e-3)
    until(lambda: text(page, "#replay-now")[0].startswith(f"{tow.dataset('frames/time')[57]:.1f} s"))


def pixel(driver, i):
    """Colour in the middle of a floe."""
    return js(
        driver,
        """const c = document.getElementById('replay-field'), ratio = c.width / c.clientWidth;
           const [x, y] = bergtow.screen(arguments[0]);
           return [...c.getContext('2d').getImageData(x * ratio, y * ratio, 1, 1).data].slice(0, 3)""",
        i)


def test_colours_by_speed_and_by_force(page, tow):
    speed, force, pose, body = (tow.dataset(f"frames/{n}") for n in ("speed", "contact_force", "pose", "body_pose"))
    # no body, line, arrow or track above the floe
    clear = np.hypot(*(pose[:, :, :2] - body[:, :1, :2]).transpose(2, 0, 1)) > 2.5
    clear &= np.abs(pose[:, :, 1] - body[:, :1, 1]) > 1.5
    top = np.percentile(force[force > 0], 99)
    frame, floe = np.unravel_index(np.argmin(np.where(clear & (force > 0), np.abs(force - 0.2 * top), np.inf)),
                                   force.shape)
    assert 0.1 * top < force[frame, floe] < 0.3 * top
    still = int(np.argmax(clear[frame] & (force[frame] == 0)))
    seek(page, int(frame))
    want = 255 * np.array(style.SPEED_MAP(min(1.0, speed[frame, floe] / 0.13))[:3])
    assert np.abs(np.array(pixel(page, int(floe))) - want).max() < 9
    Select(page.find_element("id", "replay-colour")).select_by_visible_text("contact force")
    seek(page, int(frame))
    shade = np.array(pixel(page, int(floe)))
    assert js(page, "return bergtow.colour") == "force" and text(
        page, "#replay-bar-label")[0].startswith("largest contact force")
    # The scale is a square root up to a limit near the largest forces of some of the frames.
    limit = js(
        page,
        "const c = JSON.parse(document.getElementById('replay-head').textContent).colouring[1]; return c.high * "
        "c.factor"
    )
    assert np.percentile(force[force > 0], 95) < limit < np.percentile(force[force > 0], 99.9)
    assert np.abs(shade - 255 * np.array(style.FORCE_MAP(np.sqrt(force[frame, floe] / limit))[:3])).max() < 9
    assert np.abs(shade - want).max() > 30
    assert np.abs(np.array(pixel(page, still)) - 255 * np.array(style.FORCE_MAP(0.0)[:3])).max() < 9


def test_a_click_on_the_curve_goes_there(page, tow):
    chart = page.find_element("id", "replay-curve")
    js(page, "arguments[0].scrollIntoView({block: 'center'})", chart)
    wide, times = chart.size["width"], []
    for share in (0.4, 0.8):
        ActionChains(page).move_to_element_with_offset(chart, int((share - 0.5) * wide), 0).click().perform()
        times.append(js(page, "return bergtow.time"))
        seek(page, js(page, "return bergtow.playhead"))
        columns = js(
            page,
            """const c = arguments[0], out = [];
               const d = c.getContext('2d').getImageData(0, Math.round(c.height / 2), c.width, 1).data;
               for (let x = 0; x < c.width; x++)
                 if (d[4 * x] > 180 && d[4 * x + 1] < 60 && d[4 * x + 2] > 70 && d[4 * x + 2] < 120)
                   out.push(x * c.clientWidth / c.width);
               return out""",
            chart)
        assert columns and abs(np.mean(columns) - int((share - 0.5) * wide) - wide / 2) < 3
    # The axis runs from 0 to the end of the run over most of the width.
    assert 0.85 < (times[1] - times[0]) / (0.4 * tow.summary["sim_time_s"]) < 1.25
    ActionChains(page).move_to_element_with_offset(chart, int(0.498 * wide), 0).click().perform()
    assert js(page, "return bergtow.playhead") == js(page, "return bergtow.frames") - 1


def test_pointing_at_a_floe_tells_its_values(page, tow):
    seek(page, 60)
    field = page.find_element("id", "replay-field")
    js(page, "arguments[0].scrollIntoView({block: 'center'})", field)
    pose, force = tow.dataset("frames/pose")[60], tow.dataset("frames/contact_force")[60]
    floe = int(np.argmax(np.where(pose[:, 0] > 5, force, -1)))
    x, y = js(page, "return bergtow.screen(arguments[0])", floe)
    ActionChains(page).move_to_element_with_offset(field, round(x - field.size["width"] / 2),
                                                   round(y - field.size["height"] / 2)).perform()
    lines = until(lambda: js(
        page, "const t = document.getElementById('replay-tip'); return t.hidden ? '' : t.textContent")).split("\n")
    assert lines[0] == f"floe {floe}" and float(re.search(r"force ([\d.e-]+) N", lines[2])[1]) == pytest.approx(
        force[floe], rel=0.006)


@pytest.mark.slow
def test_zoom_drag_and_fit(page):
    field = page.find_element("id", "replay-field")
    metre, at = js(page, "return bergtow.metre"), np.array(js(page, "return bergtow.screen(5)"))
    page.find_element("id", "replay-in").click()
    assert js(page, "return bergtow.metre") == pytest.approx(1.4 * metre)
    page.find_element("id", "replay-fit").click()
    assert np.allclose(js(page, "return bergtow.screen(5)"), at, atol=1e-6)
    ActionChains(page).drag_and_drop_by_offset(field, 40, -25).perform()
    assert np.allclose(js(page, "return bergtow.screen(5)") - at, [40, -25], atol=1.5)


@pytest.mark.slow
def test_follows_the_body_in_a_moving_window(chrome, tmp_path, monkeypatch):
    r = run(tmp_path, MOVING)
    ready(chrome, page_without_pictures(r.dir, tmp_path / "page.html", monkeypatch))
    pose, body, time = (r.dataset(f"frames/{n}") for n in ("pose", "body_pose", "time"))
    clock, way, window = r.series("time", "body_x", "window_x")
    frame = len(time) - 2
    sample = np.searchsorted(clock, time[frame] * (1 + 1e-9), side="right") - 1
    assert r.summary["moving_window"]["renewed"] > 0 and way[-1] - way[0] > 5
    for follow in (True, False):
        seek(chrome, frame)
        assert js(chrome, "return bergtow.follow") == follow and js(
            chrome, "return bergtow.body(0)[0]") == pytest.approx(way[sample], abs=1e-6)
        # A map: x points up, y to the right. Each floe stands at the image within the window; across, at the one
        # nearest to the middle of the view.
        centre = body[frame, 0, 1] if follow else 0.0
        north = window[sample] + (pose[frame, :, 0] - window[sample]) % 20 - way[sample]
        east = centre + (pose[frame, :, 1] - centre + 4) % 8 - 4 - (body[frame, 0, 1] + 4) % 8 + 4
        at = np.array(js(chrome, f"return [...Array({len(north)}).keys()].map((i) => bergtow.screen(i))")) - js(
            chrome, "return bergtow.towed()")
        # A floe within rounding of the seam may stand at either end.
        inside = (np.abs((pose[frame, :, 0] - window[sample] + 10) % 20 - 10) > 0.01) & (np.abs(
            (pose[frame, :, 1] - centre) % 8 - 4) > 0.01)
        assert inside.sum() > 0.9 * len(north)
        assert np.abs(at / js(chrome, "return bergtow.metre") - np.column_stack([east, -north]))[inside].max() < 0.01
        chrome.find_element("id", "replay-follow").click()
    assert complaints(chrome) == []


def test_floes_over_each_other_are_shown(chrome, tmp_path, monkeypatch):
    """As much area of them as pictures have, in their colour."""
    r = run(tmp_path, RAFTS)
    ready(chrome, page_without_pictures(r.dir, tmp_path / "page.html", monkeypatch))
    with Run(r.dir) as read:
        last = read.n_frames - 1
        over = rafted.overlaps(read.polygon_array(last, None)[0])
    seek(chrome, last)
    chrome.find_element("id", "replay-fit").click()
    assert len(over) > 3
    areas = [rafted.areas(p[None], np.array([len(p)]))[0] for p in over]
    assert js(chrome, "return bergtow.overlap") == pytest.approx(sum(areas), rel=0.01)
    middle = over[np.argmax(areas)].mean(axis=0)
    shade = js(chrome, """const c = document.getElementById('replay-field'), ratio = c.width / c.clientWidth;
        const [x, y] = bergtow.screen(0), p = bergtow.pose(0), m = bergtow.metre;
        const at = [x + m * (arguments[0] - p[0]), y - m * (arguments[1] - p[1])];
        return [...c.getContext('2d').getImageData(at[0] * ratio, at[1] * ratio, 1, 1).data].slice(0, 3)""",
               *map(float, middle))
    assert np.abs(np.array(shade) - [int(style.RAFTED[k:k + 2], 16) for k in (1, 3, 5)]).max() < 9
    assert "floes over each other" in text(chrome, "#replay-rafts")[0] and complaints(chrome) == []


def test_a_body_on_the_seam_that_the_ice_pushes_ahead(chrome, tmp_path, monkeypatch):
    """Red: the half beyond the seam beside the water and open water at the other side; a force axis up to 1 N; tenths
    of a second."""
    r = run(tmp_path, DOWNSTREAM)
    ready(chrome, page_without_pictures(r.dir, tmp_path / "page.html", monkeypatch))
    seek(chrome, 0)
    body = [int(style.BODY[k:k + 2], 16) for k in (1, 3, 5)]
    for metres, there in ((7.5, True), (-0.6, False)):
        shade = js(chrome, """const c = document.getElementById('replay-field'), ratio = c.width / c.clientWidth;
            const [x, y] = bergtow.towed(), at = y + bergtow.metre * arguments[0];
            return [...c.getContext('2d').getImageData(x * ratio, at * ratio, 1, 1).data].slice(0, 3)""", metres)
        assert (shade == body) == there
    low, high = js(chrome, "return bergtow.forces")
    assert low < r.summary["mean_tow_force_n"] < 0 and high < -low
    assert text(chrome, "#replay-now") == ["0.00 s of 6 s"] and complaints(chrome) == []


def test_rigid_floes_have_no_such_legend(page):
    assert not page.find_element("id", "replay-rafts").is_displayed()


def test_leaves_out_frames_and_floes_and_says_so(chrome, tow, tmp_path, monkeypatch):
    """A page of 0.1 MB, not packed: fewer frames, those floes that the body comes near to, and their own ids."""
    ready(chrome,
          page_without_pictures(tow.dir, tmp_path / "page.html", monkeypatch, "--size", "0.1", "--no-compression"))
    assert sum(
        len(t) for t in js(
            chrome,
            "return ['x', 'y', 'yaw', 'speed', 'force'].map((n) => document.getElementById('replay-' + n).textContent)")
    ) <= 0.101e6
    pose, body, time = (tow.dataset(f"frames/{n}") for n in ("pose", "body_pose", "time"))
    frames, floes = js(chrome, "return bergtow.frames"), js(chrome, "return bergtow.floes")
    assert 30 < frames < len(time) and 10 < floes < pose.shape[1]
    ids = js(chrome, f"return [...Array({floes}).keys()].map(bergtow.id)")
    near = np.hypot(*(pose[:, :, :2] - body[:, :1, :2]).transpose(2, 0, 1)).min(axis=0)
    assert near[ids].max() < np.quantile(near, floes / pose.shape[1] + 0.05)
    seek(chrome, frames - 1)
    assert js(chrome, "return bergtow.time") == time[-1]
    assert np.abs(shown(chrome, floes)[:, :2] - pose[-1, ids, :2]).max() < 1e-3
    notes = text(chrome, "#replay")[0]
    assert f"{frames} of the {len(time)} stored frames" in notes and f"{floes} of the {pose.shape[1]} floes" in notes
    assert complaints(chrome) == []


def test_says_when_the_browser_cannot_unpack(chrome, alone):
    hide = chrome.execute_cdp_cmd("Page.addScriptToEvaluateOnNewDocument",
                                  {"source": "delete window.DecompressionStream"})
    try:
        opened(chrome, alone)
        said = until(lambda: text(chrome, "#replay-state.warning"))
        assert "--no-compression" in said[0]
    finally:
        chrome.execute_cdp_cmd("Page.removeScriptToEvaluateOnNewDocument", hide)


# ---- without a browser

@pytest.mark.slow
def test_run_without_towed_body_and_with_a_broken_line(tmp_path):
    """Every section that a run has nothing for is left out; a picture of a line of which nothing is left is drawn."""
    adrift = run(tmp_path / "adrift", changed(MOVING, domain={"length": 15, "width": 8}, ice__concentration=0.2,
                                              run__duration=6, tow__line__breaking_load=10))
    assert [e["kind"] for e in adrift.summary["events"]] == ["line_broken", "adrift"]
    assert script(adrift.dir).returncode == 0
    page = (adrift.dir / "report.html").read_text()
    # none of estimates, against which a body that nothing tows is not held
    assert "<td>line broken</td>" in page and page.count("<svg ") == 5
    drift = run(tmp_path / "drift", changed(TOW, run__duration=2, body={"shape": "none"}, tow=None, air={"wind_x": 5}))
    assert script(drift.dir).returncode == 0
    page = (drift.dir / "report.html").read_text()
    assert "No body was towed" in page and "<nav" in page and "Estimates" not in page and page.count(
        "<svg ") == 2


@pytest.mark.parametrize("harm, words", [("folder", "no such folder"), ("summary", "the run has not ended"),
                                         ("truncated", "is truncated"), ("frames", "/frames/pose"),
                                         ("key", "summary.json: has no collisions_whole_run; ")])
def test_unusable_folders_are_reported_and_leave_the_old_page(tow, tmp_path, harm, words):
    folder = tmp_path / "run"
    if harm != "folder":
        folder.mkdir()
        shutil.copy(tow.dir / "result.h5", folder)
        (folder / "summary.json").write_text(json.dumps(tow.summary))
        (folder / "report.html").write_text(OLD)
    if harm == "summary":
        (folder / "summary.json").unlink()
    elif harm == "key":
        less = {k: v for k, v in tow.summary["impacts"].items() if k != "collisions_whole_run"}
        (folder / "summary.json").write_text(json.dumps(tow.summary | {"impacts": less}))
    elif harm == "truncated":
        (folder / "result.h5").write_bytes((tow.dir / "result.h5").read_bytes()[:5000])
    elif harm == "frames":
        with edited(folder / "result.h5") as f:
            f["frames/pose"][3, 4, 0] = np.nan
            del f["frames/pose"]
    result = script(folder)
    assert result.returncode == 4 and words in result.stderr and str(
        folder) in result.stderr and "Traceback" not in result.stderr
    assert harm == "folder" or (folder / "report.html").read_text() == OLD
    assert sorted(p.name for p in folder.glob("report*")) == ([] if harm == "folder" else ["report.html"])


def test_usage():
    for arguments in (["x", "-o", "page.png"], ["x", "--size", "0"], ["x", "--size", "nan"], []):
        with pytest.raises(BergtowError) as left:
            cli.perform("report", *arguments)
        assert left.value.status == 2


GIVEN = """# Title.
#
# ASSUMED: the rest.
run: {dt: 0.1 s, title: "a # b"}   # Somebody 2001
ice:
  size: 1 m           # Yulmetov & Løset 2017
  thickness: 0.04 m   # assumed: thin
  friction: 0.05
  length: 72 m        # from memory
tow:
  speed: 0.13 m/s
  waypoints: [[1, 2], [3, 4]]  # assumed
"""
RESOLVED = """run:
  dt: 0.1 s  # time step [Yulmetov & Løset 2017]
  title: "a # b"  # one line
ice:
  size: 1 m  # size
  thickness: 0.04 m  # mean floe thickness, assumed
  friction: 0.05  # friction [Sukhorukov & Løset 2013]
  length: 72 m  # extent
  density: 910 kg/m3  # density of the floes [Hunke & Comeau 2011]
  shake: 15  # displacement, 0 = none, assumed
  basin: 10 m  # the default is HSVA's large ice tank, from memory
  shape: polygons
  sides: 6  # corners, by [[x, y], ...]
tow:
  speed: 0.2 m/s  # speed
  waypoints: [[1, 2], [3, 4]]  # places
"""


class Stated:
    path = Path("nowhere/run")
    case_text, resolved_text, attributes = GIVEN, RESOLVED, {
        "command_line": "bergtow run a.yml --set tow.speed=0.2 --set=ice.sides=6 -o 'x y'"
    }


def test_where_each_value_comes_from():
    values = {v.key: v for v in report_case.values(Stated)}
    kinds = {k: v.kind for k, v in values.items()}
    assert kinds == {
        "run.dt": "given", "run.title": "given", "ice.size": "source", "ice.thickness": "assumed",
        "ice.friction": "given", "ice.length": "memory", "ice.density": "source", "ice.shake": "assumed",
        "ice.basin": "memory", "ice.shape": "default", "ice.sides": "set", "tow.speed": "set",
        "tow.waypoints": "assumed"
    }
    assert values["ice.size"].origin == "Yulmetov & Løset 2017" and values["run.title"].value == "a # b" and values[
        "tow.waypoints"].value == "[[1, 2], [3, 4]]"
    assert "no source stated" in values["ice.friction"].origin and "Sukhorukov" not in values["ice.friction"].origin
    assert values["ice.density"].origin == "default: Hunke & Comeau 2011" and values[
        "ice.shake"].origin == "default, assumed" and values["tow.speed"].value == "0.2 m/s"
    assert report_case.preface(GIVEN) == ["Title.", "ASSUMED: the rest."]
    assert report_case.preface("# A line\n# goes on.\n#\n# Made by\n#   make x\n# - one\n# two\nrun:") == [
        "A line goes on.", "Made by\n  make x\n- one two"]


def test_keys_without_effect_are_those_of_the_program():
    """With a list of them in Python, keys of a line stood among the values of a tow without one."""
    unused = _library.unused("run: {dt: 0.1 s, duration: 9 s}\nbody: {shape: disc}\ntow: {mode: speed}\n"
                             "water: {current_table: nowhere.csv}\nno_such: {key: 1}\n")
    assert "tow.line.type" in unused and "tow.speed" not in unused and "ice.concentration" not in unused
    assert unused["water.current_x"] == "with water.current_table, which gives the whole current"


@pytest.mark.parametrize("words, kind", [
    ("[A]", "assumed"), ("[A] large blocks [P], of a size not reported", "assumed"),
    ("[R] less than 10 cm", "reported"), ("[R] less than 10 cm; [A] the value", "assumed"),
    ("[P] 10 to 20 cm", "source"), ("", None)
])
def test_the_marks_of_the_field_cases_are_read(words, kind):
    """A value marked [A] was once labelled as one with a source."""
    assert report_case.classify(words) == kind


def test_what_a_study_sets_is_not_of_the_case_file(tmp_path):
    (tmp_path / "study.yml").write_text(
        "base: b.yml\nset:\n  ice.size: 2 m  # assumed: larger\n  run.dt: 0.2 s\nparameters: {ice.friction: [0.1, "
        "0.2]}\nvariants: {thin: {ice.thickness: 1 cm}}\nwith:\n  ice.friction=0.1:\n    ice.sides: 6  # a book\n"
    )

    class Member(Stated):
        path, attributes = tmp_path / "members" / "c001-r001", {}

    values = {v.key: v for v in report_case.values(Member)}
    assert {k
            for k, v in values.items()
            if v.origin.startswith("set by the study")} == {"ice.size", "run.dt", "ice.friction", "ice.thickness",
                                                            "ice.sides"}
    assert values["ice.size"].kind == "assumed" and values[
        "ice.size"].origin == "set by the study: assumed: larger" and values["run.dt"].kind == "study"
    assert values["ice.length"].kind == "memory" and values["ice.sides"].origin == "set by the study: a book"
    Member.case_text = GIVEN + '\n---\n{"set": {"ice.size": "2 m", "ice.friction": "0.2", "run.dt": "0.2 s"}}'
    member = {v.key: v for v in report_case.values(Member)}  # neither its variant nor its `with` gives the others
    assert {k for k, v in member.items() if v.origin.startswith("set by the study")} == {"ice.size", "run.dt",
                                                                                        "ice.friction"}
    assert member["ice.size"].kind == "assumed"


def test_a_value_that_was_set_has_not_the_source_of_the_one_in_the_file(tmp_path):
    """Nor after a resume, whose command line is another."""
    (tmp_path / "a.yml").write_text("""\
run: {dt: 0.1, duration: 0.4}
domain: {length: 15, width: 8}
ice:
  concentration: 0.5
  size: 0.7        # measured, Jones 2018
  thickness: 0.04  # measured, Smith 2017
body: {x: 3, length: 2, draft: 0.5}
tow: {speed: 0.13, ramp: 0.1}
""")
    arguments = "--set", "ice.thickness=3 cm", "--set", "ice.thickness=5 cm", "--steps", 2
    assert call("run", "a.yml", "-o", "r", *arguments, cwd=tmp_path).returncode == 0
    for again in False, True:
        if again:
            assert call("resume", "r", cwd=tmp_path).returncode == 0
        with Run(tmp_path / "r") as r:
            assert '"ice.thickness": "5 cm"' in r.case_text and "3 cm" not in r.case_text
            values = {v.key: (v.value, v.kind) for v in report_case.values(r)}
        assert values["ice.thickness"] == ("0.05 m", "set") and values["ice.size"] == ("0.7 m", "source"), again


def test_paper_has_every_key_with_its_meaning(tow, monkeypatch):
    """What a page folds away, paper shows; numbers with the digits that they are worth."""
    monkeypatch.setattr(report_run, "pictures", lambda _: [])
    with Run(tow.dir) as run:
        context = report_run.context(run)
        keys = [v.key for v in report_case.values(run)]
    on_paper = report.render("run.html", context, paper=True).partition('id="keys"')[2].replace("<wbr>", "")
    assert len(keys) > 100 and all(f"<code>{key}</code>" in on_paper for key in keys)
    assert not re.search(r"<td class=.n.>-?\d+\.\d{9}", on_paper)
    assert 'id="keys"' not in report.render("run.html", context)


def test_every_key_is_labelled(tow):
    with Run(tow.dir) as r:
        values = report_case.values(r)
        assert {v.key for v in values} >= set(r.case) and {v.kind for v in values} <= set(report_case.KINDS)
        by_key = {v.key: v for v in values}
        assert by_key["tow.ramp"].kind == "given" and by_key["ice.size_spread"].kind == "assumed" and by_key[
            "ice.density"].kind == "source"
        assert {key for keys in report_run.KEY_VALUES.values() for key in keys} <= set(by_key)


def test_ice_that_is_read_is_reported_as_it_is(tmp_path, monkeypatch):
    """Real size, thickness and concentration of the floes, not the defaults of a field that nobody made."""
    assert call("field", write_case(tmp_path, changed(TOW, ice__concentration=0.3)), "-o",
                tmp_path / "made.geojson").returncode == 0
    drawn = json.loads((tmp_path / "made.geojson").read_text())

    said = []  # of a design statement

    def run_of(name, thicknesses):
        for feature, t in zip(drawn["features"], thicknesses):
            feature["properties"] = {} if t is None else {"thickness": t}
        (tmp_path / "o.geojson").write_text(json.dumps(drawn))
        r = run(tmp_path, changed(TOW, run__duration=4, ice={"outlines": "o.geojson", "friction": 0.3}), name=name)
        with Run(r.dir) as opened_run:
            values = report_case.values(opened_run)
            groups = report_run.key_values(opened_run, values)
            members = SimpleNamespace(each=lambda rows, measure: iter([measure(opened_run)]), n=1, summary={},
                                      texts=lambda m: [])
            said.append({k: statement.case_of(members, [0]).texts[k] for k in ("ice.size", "ice.thickness")})
        return r, {v.key: (v.value, v.kind) for v in groups["Ice"]}, {v.key: v for v in values}

    n = len(drawn["features"])
    r, ice, every = run_of("own", [0.5 + 0.4 * k / (n - 1) for k in range(n)])
    thickness = r.summary["estimates"]["thickness_m"]  # red: the plain mean
    assert ice["floes"] == (str(n), "field") and ice["floe thickness"] == (
        f"{thickness:.3g} m, 0.5 to 0.9 m", "field")
    assert ice["concentration"] == (f"{r.summary['concentration']:.4g}", "field")
    assert 0.29 < r.summary["concentration"] < 0.31
    size = np.sqrt(4 * r.dataset("floes/area") / np.pi)
    assert ice["floe size"] == (f"{size.mean():.3g} m, {size.min():.3g} to {size.max():.3g} m",
                                "field") and 0.6 < size.mean() < 0.8
    assert not {
        "ice.concentration", "ice.shape", "ice.size", "ice.size_law", "ice.thickness", "ice.thickness_law", "ice.seed"
    } & set(ice) and "ice.friction" in ice
    assert (every["ice.size"].kind == "unused"
            and every["ice.size"].origin == "not used: no effect on ice that is read from a file")
    assert said == [{"ice.size": f"{size.mean():.3g} m", "ice.thickness": f"{thickness:.3g} m"}]
    text = page_without_pictures(r.dir, tmp_path / "page.html", monkeypatch).read_text()
    assert ice["floe size"][0] in text and "as read" in text
    some = run_of("some", [None] + [0.5] * (n - 1))[1]  # the case's thickness is that of the first
    assert some["floe thickness"][0].endswith(
        ", 0.04 to 0.5 m") and some["ice.thickness"][0] == "0.04 m" and "ice.size" not in some


def test_numbers_survive_packing():
    rng = np.random.default_rng(1)
    q = rng.integers(0, 65536, (7, 13)).astype(np.uint16)
    raw = np.frombuffer(zlib.decompress(base64.b64decode(replay_data.pack_frames(q))),
                        np.uint8).reshape(2, 7, 13).astype(np.uint16)
    assert np.array_equal(np.cumsum(raw[0] + 256 * raw[1], axis=0).astype(np.uint16), q)
    x = np.array([0.0, 0.1, 9.99999, 5.0])
    numbers, low, step = replay_data.quantise(x, 0.0, 10.0, 10.0)
    assert np.abs((low + step * numbers - x + 5) % 10 - 5).max() <= step / 2 and low + step * 65536 == 10.0
    assert list(replay_data.thinned(10, 4)) == [0, 3, 6, 9] and list(replay_data.thinned(3, 8)) == [0, 1, 2]


def test_the_largest_load_may_lie_before_the_window():
    """Red with "0 N" for the largest load of a tow that met 1 MN before its window, and no row of its collisions."""
    numbers = {"peak_ice_resistance_n": 0.0, "window.series.ice_resistance.start_peak_n": 1.04e6,
               "start_peak_line_tension_n": 1.3e6, "impacts.start_largest_peak_n": 2.65e6, "impacts.hours": 0.4,
               "window.series.line_tension_2.peak_n": 3.45e5}
    impacts = {"conversion": "half-sine", "collisions": 0, "collisions_whole_run": 2, "largest": None, "exceedance": []}
    run = SimpleNamespace(
        towed=0, window=(921.0, 2400.0), window_name="window", mean_name="over the window",
        number=lambda key: numbers.get(key, np.nan), interval=lambda key: (0.0, np.nan, np.nan),
        summary={"impacts": impacts, "peak_conversion": "impulse / dt", "window": None},
        by_role=lambda *roles: ["line_tension_2"], attribute=lambda name, key: None,
        label=lambda name: "tension of the second branch", description=lambda name: "")
    words = {label: f"{value} {below}" for label, value, below in report_run.figures(run)}
    assert "in the start before it 1040 kN" in words["largest ice resistance in a step"]
    assert "in the start before it 1300 kN" in words["largest line tension"]
    assert "in the start before it 2.65 MN" in words["largest peak of a collision"]
    assert ("largest peak", "none in the window; in the start before it 2.65 MN") in report_run.impacts(run)["rows"]
    parted, = [row for row in report_run.forces(run) if "second branch" in row[0]]
    assert parted[1] == "345 kN" and "it parted" in parted[3]


@pytest.mark.parametrize("time, said", [(np.nan, ""), (3.0, "correlation time 3.00 s")])
def test_an_unknown_correlation_time_is_left_out(time, said):
    """Red: "correlation time nan s"."""
    run = SimpleNamespace(towed=None, window=(10.0, 20.0), window_name="window", verdict=("steady", ""),
                          number=lambda key, other=0.0: time if "correlation" in key else 0.0, summary={"window": {}})
    assert dict((what, remark) for what, _, remark in report_run.quality(run))["independent samples in it"] == said


def test_the_first_of_two_branches_is_named_as_the_second(tmp_path):
    """Red: as the whole line is."""
    for branches, names in (1, ["line tension"]), (2, ["tension of the first branch", "tension of the second branch"]):
        case = changed(MOVING, run__duration=4, tow__line={"branches": branches})
        with Run(run(tmp_path / str(branches), case).dir) as r:
            assert [r.label(s) for s in ("line_tension_1", "line_tension_2") if np.isfinite(r[s]).any()] == names
