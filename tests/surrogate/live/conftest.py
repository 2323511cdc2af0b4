"""What tests of the page share: a small synthetic model, a running server, a browser."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import surrogate

WIDTH, HEIGHT = 1280, 800


@pytest.fixture(scope="session")
def live_model(sweep: Path) -> surrogate.Model:
    """A forward model of synthetic touches."""
    return surrogate.train(sweep, "forward", seed=1)


@pytest.fixture(scope="session")
def live_folder(live_model: surrogate.Model, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Its folder."""
    folder = tmp_path_factory.mktemp("live") / "model"
    live_model.save(folder)
    return folder


Start = Callable[..., tuple[subprocess.Popen[str], str]]


@pytest.fixture(scope="session")
def start() -> Iterator[Start]:
    """(words of `surrogate live`, standard input) -> its process, and the address that it prints."""
    for name in ("starlette", "uvicorn", "websockets"):
        pytest.importorskip(name)
    running: list[subprocess.Popen[str]] = []

    def begin(*words: object, stdin: Any = subprocess.DEVNULL) -> tuple[subprocess.Popen[str], str]:
        process = subprocess.Popen([sys.executable, "-m", "surrogate", "live", *map(str, words)], text=True, stdin=stdin,
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | {"OMP_NUM_THREADS": "1"})
        running.append(process)
        assert process.stdout is not None
        return process, process.stdout.readline().strip()

    yield begin
    for process in running:
        process.kill()
        process.wait()


@pytest.fixture(scope="session")
def address(start: Start, live_folder: Path) -> str:
    """The address of a page whose presses the model's own map answers, in little noise."""
    return start(live_folder, "--noise-V", "1e-6")[1]


@pytest.fixture
def browser() -> Iterator[Any]:
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
    window.execute_cdp_cmd("Emulation.setDeviceMetricsOverride",
                           {"width": WIDTH, "height": HEIGHT, "deviceScaleFactor": 1, "mobile": False})
    yield window
    window.quit()
