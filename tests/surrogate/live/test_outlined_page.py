"""The page of a skin with an outline in Chromium: pressed and read, refused near edges, exported, and replayed."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surrogate
from surrogate.forward_map.forward_map import linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.live.controls import Controls
from surrogate.live.export_page import MOST_BYTES, export_page
from surrogate.live.pictured import pictured
from surrogate.live.skins import learned_skin, limits_of
from touchcal.arrays import Array
from touchcal.csv_numbers import write_numbers

NOISE_V = 1e-7
PLACE_MM = 0.2  # the most that a place read in the browser may differ from that of `predict`
NEAR_EDGE = "not pressed: nearer to an edge than the model knows"


def steady(page: Any) -> None:
    """The force does not grow."""
    page.run("document.getElementById('grow').checked = false")


@pytest.mark.slow
def test_a_press_on_a_rectangle_is_read_as_predict_reads_it(page: Any, rectangle_address: str,
                                                            rectangle_model: surrogate.Model) -> None:
    page.open(rectangle_address)
    steady(page)
    hand = page.hold(30, -14)
    place = page.place()
    signal_mV = page.run("return shown().frame.difference")
    found = rectangle_model.predict(rectangle_model.baseline_V + np.array(signal_mV) / 1e3, noise_V=NOISE_V)
    known = [found[f"{name}_{unit}"].iloc[0] * scale for name, unit, scale in
             (("x0", "m", 1e3), ("y0", "m", 1e3), ("d", "m", 1e3), ("F", "N", 1.0))]
    assert place == pytest.approx(tuple(known[:2]), abs=0.15)  # tenths are shown
    half = [(found[f"{name}_hi90_{unit}"] - found[f"{name}_lo90_{unit}"]).iloc[0] * scale / 2 for name, unit, scale in
            (("d", "m", 1e3), ("F", "N", 1.0))]
    assert float(page.text("read-d")) == pytest.approx(known[2], abs=half[0])
    assert float(page.text("read-F")) == pytest.approx(known[3], abs=half[1])
    assert (float(page.text("true-x")), float(page.text("true-y"))) == pytest.approx((30, -14), abs=0.45)  # two pixels
    assert page.run("const e = shown().frame.ellipse; return e.long_mm >= e.short_mm && e.short_mm > 0")
    hand.release().perform()
    page.wait("!shown().frame.read && document.getElementById('read-x').textContent === '–'")
    assert page.browser.get_log("browser") == []


@pytest.mark.slow
def test_near_an_edge_nothing_is_pressed_and_the_page_says_why(page: Any, rectangle_address: str) -> None:
    page.open(rectangle_address)
    steady(page)
    hand = page.hold(10, 10)
    page.wait("shown().frame.true && shown().frame.read")
    page.move(hand, 10, 38).perform()
    page.wait("!shown().frame.true && !shown().frame.read")
    page.wait(f"document.getElementById('state').textContent.includes('{NEAR_EDGE}')")
    page.move(hand, 10, 12).perform()
    page.wait("shown().frame.true && shown().frame.read")
    assert NEAR_EDGE not in page.text("state")
    hand.release().perform()
    page.hold(10, 49)
    page.wait("document.getElementById('state').textContent.includes('the punch does not lie on the skin')")
    assert page.run("return shown().frame.true") is None


@pytest.mark.slow
def test_the_keyboard_presses_a_rectangle_and_stays_on_its_picture(page: Any, rectangle_address: str) -> None:
    from selenium.webdriver.common.keys import Keys

    page.open(rectangle_address)
    page.keys(Keys.TAB)
    page.keys(*[Keys.ARROW_RIGHT] * 9, *[Keys.ARROW_DOWN] * 4, *"+" * 5, " ")
    assert page.place() == pytest.approx((9, -4), abs=0.5)
    assert (float(page.text("true-x")), float(page.text("true-y"))) == (9, -4)
    page.browser.execute_cdp_cmd("Emulation.setCPUThrottlingRate", {"rate": 1})
    page.run("for (let k = 0; k < 90; k++) document.getElementById('skin').dispatchEvent("
             "new KeyboardEvent('keydown', {key: 'ArrowUp', bubbles: true}))")
    page.wait(f"document.getElementById('state').textContent.includes('{NEAR_EDGE}')"
              " || document.getElementById('state').textContent.includes('does not lie on the skin')")
    page.keys(*[Keys.ARROW_DOWN] * 45)  # from the upper edge, where it was held
    page.wait("shown().frame.true && shown().frame.true.y_mm === 5")


@pytest.mark.slow
@pytest.mark.parametrize("width", [390, 1280])
def test_a_rectangle_is_drawn_whole_and_as_long_as_it_is(page: Any, rectangle_address: str, width: int) -> None:
    page.command("Emulation.setDeviceMetricsOverride", width=width, height=844, deviceScaleFactor=2, mobile=width < 500)
    page.open(rectangle_address)
    assert page.run("return document.documentElement.scrollWidth") <= width
    box = page.element("skin").rect
    assert box["width"] > 300
    assert box["height"] < 0.8 * box["width"]
    ends = page.run("const b = document.getElementById('skin').getBoundingClientRect(), "
                    "v = viewOf(shown().skin.picture, b.width); return shown().skin.hello.skin.electrodes.flatMap("
                    "e => [...e.along_mm, e.label_mm]).map(([x, y]) => [v.X(x) / b.width, v.Y(y) / b.height])")
    assert len(ends) > 32
    assert 0 < np.min(ends) < np.max(ends) < 1


@pytest.mark.slow
def test_an_exported_rectangle_is_the_model_s_map_and_reads_as_predict(
        page: Any, rectangle_model: surrogate.Model, rectangle_signal: Callable[[Array], Array],
        tmp_path: Path) -> None:
    export_page(rectangle_model, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < MOST_BYTES
    page.command("Network.enable")
    page.command("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)
    page.open((tmp_path / "page.html").as_uri())
    forward, rng = rectangle_model.learner.forward, np.random.default_rng(2)  # pyright: ignore
    touch = np.column_stack([rng.uniform(-50, 50, 25), rng.uniform(-25, 25, 25), rng.uniform(8, 12, 25),
                             rng.uniform(0.3, 1.0, 25)])
    expected = linearise(forward, to_unknown(touch, forward.p0)).signal_V
    found = np.array(page.run("return arguments[0].map(t => Array.from(learned.press(...t)))", touch.tolist()))
    assert np.max(np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)) < 1e-8
    rest = rectangle_model.baseline_V
    signal_V = rectangle_signal(touch) + NOISE_V * rng.normal(size=expected.shape)
    known = rectangle_model.predict(rest + signal_V, rest, noise_V=NOISE_V)[["x0_m", "y0_m"]]
    read = page.run("return arguments[0].map(s => learned.read(s, arguments[1], null).read).map(r => [r.x_mm, r.y_mm])",
                    signal_V.tolist(), NOISE_V)
    off = np.hypot(*(np.array(read) - 1e3 * known.to_numpy()).T)
    print("places differ by", np.sort(off)[-3:], "mm at most; off the truth by",
          np.sort(np.hypot(*(np.array(read) - touch[:, :2]).T))[-3:])
    assert off.max() < PLACE_MM
    page.hold(0, 42)
    page.wait(f"document.getElementById('state').textContent.includes('{NEAR_EDGE}')")
    assert [url for url in page.asked() if not url.startswith(("data:", tmp_path.as_uri()))] == []


@pytest.mark.slow
def test_an_exported_map_is_the_model_s_near_one_edge_and_refuses_corners(page: Any, edge_model: surrogate.Model,
                                                                         tmp_path: Path) -> None:
    export_page(edge_model, tmp_path / "page.html")
    page.open((tmp_path / "page.html").as_uri())
    forward = edge_model.learner.forward  # pyright: ignore
    touch = np.array([[10.0, 41.0, 10.0, 0.5], [-66.0, 8.0, 9.0, 0.3], [20.0, -27.0, 11.0, 0.8], [5.0, 3.0, 10.0, 0.4]])
    expected = linearise(forward, to_unknown(touch, forward.p0)).signal_V
    found = np.array(page.run("return arguments[0].map(t => Array.from(learned.press(...t)))", touch.tolist()))
    assert np.max(np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)) < 1e-8
    page.hold(0, 40)
    page.wait("!document.getElementById('state').textContent.includes('not pressed')")
    page.hold(62, 38)
    page.wait("document.getElementById('state').textContent.includes('nearer to two edges than the model knows')")


@pytest.mark.slow
def test_a_recording_of_a_rectangle_is_shown_with_its_outline(
        page: Any, start: Callable[..., Any], rectangle_folder: Path, rectangle_model: surrogate.Model,
        rectangle_signal: Callable[[Array], Array], tmp_path: Path) -> None:
    signal_V = rectangle_signal(np.array([[-20.0, 8.0, 10.0, 0.8]]))
    frames = rectangle_model.baseline_V + np.outer(np.arange(200) >= 60, signal_V[0])
    frames += NOISE_V * np.random.default_rng(1).normal(size=frames.shape)
    write_numbers(tmp_path / "frames.csv", [f"v_{k:03d}" for k in range(frames.shape[1])], frames)
    page.open(start(rectangle_folder, "--replay", tmp_path / "frames.csv")[1])
    assert page.place() == pytest.approx((-20, 8), abs=0.2)
    assert page.run("return shown().skin.hello.skin.loops_mm[0].length") == 4
    assert page.run("return shown().skin.hello.limits") is None


def test_what_may_be_pressed_on_a_rectangle_is_what_taught_its_map(rectangle_model: surrogate.Model) -> None:
    limits, learner = limits_of(rectangle_model), rectangle_model.learner
    inner, outer = (np.array([[0.0, 50 - limits.gap_mm + off, 10, 1]]) for off in (-0.01, 0.01))
    assert learner.reads(inner).all()
    assert not learner.reads(outer).any()
    assert limits.start_mm == (0.0, 0.0)
    assert not limits.edges.refuses((0.0, float(inner[0, 1])), 10.0, limits.gap_mm)
    assert limits.edges.refuses((0.0, float(outer[0, 1])), 10.0, limits.gap_mm)


def test_a_map_learned_on_a_rectangle_answers_a_press(rectangle_model: surrogate.Model,
                                                      rectangle_signal: Callable[[Array], Array]) -> None:
    found = learned_skin(rectangle_model).pressed(Controls(12.0, -9.0, 10.0, 0.6)).signal_V
    known = rectangle_signal(np.array([[12.0, -9.0, 10.0, 0.6]]))[0]
    assert np.linalg.norm(found - known) < 0.01 * np.linalg.norm(known)


def test_numbers_of_electrodes_stand_outside_the_edge(rectangle_model: surrogate.Model) -> None:
    skin = pictured(rectangle_model)
    assert len(skin.electrodes) == 16
    for one in skin.electrodes:
        assert skin.edges.refuses((float(one.label_mm[0]), float(one.label_mm[1])), 0.0, 0.0)
        assert np.linalg.norm(one.label_mm - one.along_mm.mean(axis=0)) < 10


def test_other_methods_have_a_gap_of_their_own(rectangle_samples: Any) -> None:
    ridge = surrogate.train(rectangle_samples, "ridge", "x0,y0,d,F", seed=1)
    gap = limits_of(ridge).gap_mm
    away = 50 - np.abs(ridge.calibration.target[:, 1]), 75 - np.abs(ridge.calibration.target[:, 0])
    assert gap == pytest.approx(np.minimum(*away).min(), abs=1e-6)
    with pytest.raises(ValueError, match="only forward"):
        learned_skin(replace(ridge))
