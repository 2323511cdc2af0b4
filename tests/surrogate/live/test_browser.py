"""The page in Chromium: pressed by mouse and by keys alone, narrow and dark, and without a request to elsewhere."""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surrogate


def test_a_mouse_press_is_read_as_predict_reads_it(page: Any, address: str, inner_model: surrogate.Model) -> None:
    page.open(address)
    page.run("document.getElementById('grow').checked = false")
    hand = page.hold(20, -10)
    place = page.place()
    signal_mV = page.run("return shown().frame.difference")
    rest_V = inner_model.baseline_V
    found = inner_model.predict(rest_V + np.array(signal_mV) / 1e3, rest_V, noise_V=1e-6)
    assert place == pytest.approx(tuple(1e3 * found[["x0_m", "y0_m"]].iloc[0]), abs=0.15)  # tenths are shown
    assert place == pytest.approx((float(page.text("true-x")), float(page.text("true-y"))), abs=0.3)
    assert place == pytest.approx((20, -10), abs=0.6)  # a pixel is a third of a millimetre
    hand.release().perform()
    page.wait("!shown().frame.read && document.getElementById('read-x').textContent === '–'")
    asked = page.asked()
    assert any(url.startswith("ws") for url in asked)
    own = (address, address.replace("http", "ws", 1), "data:")
    assert [url for url in asked if not url.startswith(own)] == []
    assert page.browser.get_log("browser") == []


@pytest.mark.slow
@pytest.mark.parametrize("noise_V", [5e-6, 3e-5])
def test_the_noise_to_begin_with_is_the_one_given(page: Any, start: Callable[..., Any], live_folder: Any,
                                                  noise_V: float) -> None:
    page.open(start(live_folder, "--noise-V", str(noise_V))[1])
    assert float(page.element("noise").get_attribute("value")) == pytest.approx(1e3 * noise_V)
    assert float(page.text("noise-now")) == pytest.approx(1e3 * noise_V)


def test_a_press_outside_what_was_trained_says_that_it_was_moved(page: Any, address: str) -> None:
    page.open(address)
    page.run("document.getElementById('grow').checked = false")  # at a force that does not leave the training range
    hand = page.hold(90, 10)
    page.wait("document.getElementById('state').textContent.includes('moved onto the dotted circle')")
    assert page.place() == pytest.approx((float(page.text("true-x")), float(page.text("true-y"))), abs=0.3)
    assert "outside the training range" not in page.text("state")
    hand.release().perform()
    hand = page.hold(20, 10)
    page.wait("document.getElementById('state').textContent === 'touch'")
    hand.release().perform()


@pytest.mark.slow
def test_what_a_recording_ends_with_is_written(page: Any, start: Callable[..., Any], live_folder: Any,
                                               inner_model: surrogate.Model, tmp_path: Path) -> None:
    np.savetxt(tmp_path / "frames.csv", np.tile(inner_model.baseline_V, (8, 1)), delimiter=",")
    page.open(start(live_folder, "--replay", tmp_path / "frames.csv", "--noise-V", "1e-6")[1])
    page.wait("document.getElementById('state').textContent === "
              "'the recording ended; start the command again to see it again'")
    page.wait("document.getElementById('rate').textContent === '–'")


def test_force_grows_while_held_and_follows_the_wheel(page: Any, address: str) -> None:
    page.open(address)
    page.hold(0, 15)
    first = page.wait("shown().frame.true && shown().frame.true.F_N")
    page.wait(f"shown().frame.true.F_N > {first} + 0.3")
    set_N, grown_N = map(float, page.text("force-now").split(" → "))
    assert set_N == float(page.element("force").get_attribute("value")) < grown_N
    page.run("document.getElementById('grow').checked = false")
    slider = float(page.element("force").get_attribute("value"))
    page.run("document.getElementById('skin').dispatchEvent(new WheelEvent('wheel', {deltaY: -1}))")
    assert float(page.element("force").get_attribute("value")) == pytest.approx(slider + 0.05)


def test_the_keyboard_alone_moves_presses_and_lifts(page: Any, address: str) -> None:
    from selenium.webdriver.common.keys import Keys

    page.open(address)
    page.keys(Keys.TAB)
    assert page.browser.switch_to.active_element.get_attribute("id") == "skin"
    outline = page.run("return getComputedStyle(document.activeElement).outlineStyle")
    assert outline == "solid"
    page.keys(*[Keys.ARROW_RIGHT] * 12, *[Keys.ARROW_UP] * 7, "+", "+", " ")
    place = page.place()
    assert (float(page.text("true-x")), float(page.text("true-y"))) == (12, 7)
    assert place == pytest.approx((12, 7), abs=0.3)
    assert "read x 12, y 7" in page.wait("document.getElementById('spoken').textContent.includes('read x 12') && "
                                               "document.getElementById('spoken').textContent")
    force = float(page.text("true-F"))
    page.keys("-")
    page.wait(f"Math.abs(shown().frame.true.F_N - {force} + 0.05) < 1e-6")
    page.keys(" ")
    page.wait("!shown().frame.true && !shown().frame.read")


@pytest.mark.parametrize("width", [390, 768, 1280])
def test_nothing_is_cut_off(page: Any, address: str, width: int) -> None:
    page.command("Emulation.setDeviceMetricsOverride", width=width, height=844, deviceScaleFactor=2, mobile=width < 500)
    page.open(address)
    assert page.run("return document.documentElement.scrollWidth") <= width
    ends = page.run("return [...document.querySelectorAll('canvas, table, input, select')].filter(e => e.offsetParent)"
                    ".map(e => e.getBoundingClientRect()).map(b => [b.left, b.right, b.width])")
    assert len(ends) > 8
    assert all(left >= 0 and right <= width and wide > 10 for left, right, wide in ends)


def test_a_finger_presses(page: Any, address: str) -> None:
    page.open(address)
    box = page.element("skin").rect
    at = {"x": box["x"] + box["width"] * 0.6, "y": box["y"] + box["height"] * 0.5}
    page.command("Emulation.setTouchEmulationEnabled", enabled=True)
    page.command("Input.dispatchTouchEvent", type="touchStart", touchPoints=[at])
    assert page.place() == pytest.approx((100 * 2 * 1.13 * 0.1, 0), abs=0.6)
    page.command("Input.dispatchTouchEvent", type="touchEnd", touchPoints=[])
    page.wait("!shown().frame.true")


def luminance(page: Any) -> tuple[float, float]:
    """Mean brightness of the page's ground, and of the middle of the skin's picture."""
    ground = page.run("return getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)")
    skin = page.run("const c = document.getElementById('skin'); return [...c.getContext('2d')"
                                  ".getImageData(c.width * 0.4, c.height * 0.4, 1, 1).data].slice(0, 3)")
    return float(np.mean(ground)), float(np.mean(skin))


@pytest.mark.thorough
def test_dark_mode_is_dark(page: Any, address: str) -> None:
    found: dict[str, tuple[float, float]] = {}
    for mode in ("light", "dark"):
        page.command("Emulation.setEmulatedMedia", features=[{"name": "prefers-color-scheme", "value": mode}])
        page.open(address)
        time.sleep(0.3)
        found[mode] = luminance(page)
    assert min(found["light"]) > 200
    assert max(found["dark"]) < 60


@pytest.mark.slow
def test_a_connection_that_closes_is_opened_again(page: Any, start: Callable[..., Any], live_folder: Any) -> None:
    process, address = start(live_folder)
    page.open(address)
    process.kill()
    page.wait("document.getElementById('state').textContent.includes('connection')")
    assert page.text("rate") == "–"
