"""What tests of the page share: a small synthetic model, a running server, a browser."""

import json
import os
import shutil
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

import surrogate

WIDTH, HEIGHT, RECTANGLE_NOISE_V = 1280, 800, 1e-7
# Where a place, mm, is on the canvas of the skin, from its middle, pixels.
PIXEL = """const b = document.getElementById('skin').getBoundingClientRect(), v = viewOf(shown().skin.picture, b.width);
return [v.X(arguments[0]) - b.width / 2, v.Y(arguments[1]) - b.height / 2];"""


@pytest.fixture(scope="session")
def live_folder(inner_model: surrogate.Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a forward model."""
    folder = tmp_path_factory.mktemp("live") / "model"
    inner_model.save(folder)
    return folder


@pytest.fixture(scope="session")
def rectangle_folder(rectangle_model: surrogate.Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a forward model of a rectangle."""
    folder = tmp_path_factory.mktemp("live") / "rectangle"
    rectangle_model.save(folder)
    return folder


Start = Callable[..., tuple[subprocess.Popen[str], str]]


@contextmanager
def started() -> Iterator[Start]:
    """(words of `surrogate live`, standard input) -> its process, and the address that it prints; all end with it."""
    for name in ("starlette", "uvicorn", "websockets"):
        pytest.importorskip(name)
    running: list[subprocess.Popen[str]] = []

    def begin(*words: object, stdin: Any = subprocess.DEVNULL) -> tuple[subprocess.Popen[str], str]:
        process = subprocess.Popen([sys.executable, "-m", "surrogate", "live", *map(str, words)], text=True,
                                   stdin=stdin, stdout=subprocess.PIPE, stderr=subprocess.PIPE,
                                   env=os.environ | {"OMP_NUM_THREADS": "1"})
        running.append(process)
        assert process.stdout is not None
        return process, process.stdout.readline().strip()

    try:
        yield begin
    finally:
        for process in running:
            process.kill()
            process.wait()


@pytest.fixture
def start() -> Iterator[Start]:
    """`started`, for a test: what it starts goes on reading without a browser too."""
    with started() as begin:
        yield begin


@pytest.fixture(scope="module")
def address(live_folder: Path) -> Iterator[str]:
    """The address of a page whose presses the model's own map answers, in little noise."""
    with started() as begin:
        yield begin(live_folder, "--noise-V", "1e-6")[1]


@pytest.fixture(scope="module")
def rectangle_address(rectangle_folder: Path) -> Iterator[str]:
    """The address of a page of a rectangle, in less noise."""
    with started() as begin:
        yield begin(rectangle_folder, "--noise-V", str(RECTANGLE_NOISE_V))[1]


@dataclass(frozen=True)
class Page:
    """A page in a browser, as one handles it."""

    browser: Any

    def open(self, address: str) -> None:
        """Open an address and wait for frames."""
        self.browser.get(address)
        self.wait("window.shown && shown().count > 2")

    def run(self, script: str, *given: Any) -> Any:
        """What a script returns."""
        return self.browser.execute_script(script, *given)

    def wait(self, condition: str, timeout_s: float = 60.0) -> Any:
        """The value of an expression, as soon as it is true."""
        end = time.monotonic() + timeout_s
        while time.monotonic() < end:
            if found := self.run(f"return {condition}"):
                return found
            time.sleep(0.05)
        raise AssertionError(f"{condition} stays false")

    def element(self, name: str) -> Any:
        """An element by its id."""
        return self.browser.find_element("id", name)

    def text(self, name: str) -> str:
        """Its text."""
        return self.element(name).text

    def hold(self, x_mm: float, y_mm: float) -> Any:
        """Press the mouse at a place, and hold it."""
        from selenium.webdriver.common.action_chains import ActionChains

        hand = ActionChains(self.browser, duration=0)
        self.move(hand, x_mm, y_mm).click_and_hold().perform()
        return hand

    def move(self, hand: Any, x_mm: float, y_mm: float) -> Any:
        """What a hand does, and then a way to a place."""
        return hand.move_to_element_with_offset(self.element("skin"), *map(round, self.run(PIXEL, x_mm, y_mm)))

    def keys(self, *names: str) -> None:
        """Press keys one after the other."""
        from selenium.webdriver.common.action_chains import ActionChains

        ActionChains(self.browser).send_keys(*names).perform()

    def place(self) -> tuple[float, float]:
        """The place that the page's numbers state, mm, once a press is read."""
        self.wait("document.getElementById('read-x').textContent !== '–' && shown().frame.read")
        time.sleep(0.3)
        return float(self.text("read-x")), float(self.text("read-y"))

    def asked(self) -> list[str]:
        """Addresses that it asked for since the last call."""
        sent = [json.loads(one["message"])["message"] for one in self.browser.get_log("performance")]
        return [one["params"]["request"]["url"] for one in sent if one["method"] == "Network.requestWillBeSent"] + [
            one["params"]["url"] for one in sent if one["method"] == "Network.webSocketCreated"]

    def command(self, name: str, **given: Any) -> Any:
        """A command of the browser's own protocol."""
        return self.browser.execute_cdp_cmd(name, given)


@pytest.fixture(scope="module")
def chromium() -> Iterator[Any]:
    """Chromium without a window, whose log tells every request."""
    webdriver = pytest.importorskip("selenium.webdriver")
    chromium, driver = shutil.which("chromium"), shutil.which("chromedriver")
    if chromium is None or driver is None:
        pytest.skip("Chromium and chromedriver are not installed")
    options = webdriver.ChromeOptions()
    options.binary_location = chromium
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--no-first-run",
                 "--disable-background-networking", "--disable-component-update"):
        options.add_argument(word)
    options.set_capability("goog:loggingPrefs", {"performance": "ALL", "browser": "ALL"})
    window = webdriver.Chrome(options=options, service=webdriver.ChromeService(driver))
    yield window
    window.quit()


@pytest.fixture
def page(chromium: Any) -> Iterator[Page]:
    """A tab of its own: it ends with its test, and what was emulated in it."""
    from selenium.webdriver.common.action_chains import ActionChains

    first = chromium.current_window_handle
    chromium.switch_to.new_window("tab")
    chromium.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                             {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
    for kind in ("performance", "browser"):
        chromium.get_log(kind)
    yield Page(chromium)
    ActionChains(chromium).reset_actions()
    chromium.close()
    chromium.switch_to.window(first)
