"""The page where one presses the skin: from a press to its picture, and a minute at 50 frames a second.

Chromium without a window opens `surrogate live MODEL_DIR --simulate CARD` and is handed mouse events. `lone`: a press
somewhere else every fifth of a second; `sliding`: the mouse moves 50 times a second for a minute. latency_ms is from
the page's sending of a press to the end of drawing the first picture that answers it, by the browser's clock; the
screen shows it at its next refresh. missed: frames that the server made and the browser did not get. spent_ms: the
server's reading of a frame. server_cpu_ms and browser_cpu_ms: CPU time of each, a frame: 50 frames a second need both
below 20 ms on two cores of their own. load: processes that asked for the machine's cores in the minute before; those of
others lengthen latencies. Run as `python benchmarks/live_page.py MODEL_DIR CARD`; needs chromium, chromedriver and
selenium; writes results/live_page.csv next to this file.
"""

import contextlib
import math
import os
import shutil
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, shown, written

PRESSES, PAUSE_S, RATE_HZ, SLIDING_S = quick(200, 20), 0.2, 50, quick(60, 5)
CIRCLE = 0.1  # radius of the circle along which presses lie, over the width of the picture of the skin


def browser() -> Any:
    """Chromium without a window."""
    from selenium import webdriver

    options = webdriver.ChromeOptions()
    options.binary_location = str(shutil.which("chromium"))
    for word in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                 "--window-size=1280,800"):
        options.add_argument(word)
    return webdriver.Chrome(options=options, service=webdriver.ChromeService(shutil.which("chromedriver")))


def mouse(window: Any, kind: str, turn: float) -> None:
    """One event of the mouse so far along the circle."""
    box = window.find_element("id", "skin").rect if not hasattr(window, "skin") else window.skin
    window.skin = box
    x, y = (box[k] + box["width"] * (0.5 + CIRCLE * part(2 * math.pi * turn)) for k, part in
            (("x", math.cos), ("y", math.sin)))
    window.execute_cdp_cmd("Input.dispatchMouseEvent", {"type": kind, "x": x, "y": y, "button": "left", "buttons": 1,
                                                        "clickCount": 1})


def cpu_s(root: int) -> float:
    """CPU time of a process and of those that it began, s."""
    found: dict[int, tuple[int, float]] = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            cells = path.read_text().rpartition(")")[2].split()
            found[int(path.parent.name)] = int(cells[1]), (int(cells[11]) + int(cells[12])) / os.sysconf("SC_CLK_TCK")
    family = {root}
    for _ in range(4):  # a browser's processes lie a few generations deep
        family |= {one for one, (parent, _) in found.items() if parent in family}
    return sum(found[one][1] for one in family if one in found)


def lone(window: Any) -> None:
    """Presses one after the other, each somewhere else."""
    for k in range(PRESSES):
        mouse(window, "mousePressed", 0.382 * k)
        time.sleep(PAUSE_S / 2)
        mouse(window, "mouseReleased", 0.382 * k)
        time.sleep(PAUSE_S / 2)


def sliding(window: Any) -> None:
    """A press that slides."""
    mouse(window, "mousePressed", 0.0)
    begun = time.perf_counter()
    for k in range(RATE_HZ * SLIDING_S):
        time.sleep(max(begun + k / RATE_HZ - time.perf_counter(), 0.0))
        mouse(window, "mouseMoved", k / RATE_HZ / 5)
    mouse(window, "mouseReleased", 0.0)


def row(window: Any, server: int, name: str, work: Any) -> dict[str, object]:
    """What the page shows while this is done."""
    before = window.execute_script("const s = shown(); s.latencies.length = 0; window.spent = []; "
                                   "return [s.count, s.missed]")
    load, begun, roots = os.getloadavg()[0], time.perf_counter(), (server, window.service.process.pid)
    used = [cpu_s(one) for one in roots]
    work(window)
    seconds, used = time.perf_counter() - begun, [cpu_s(one) - was for one, was in zip(roots, used, strict=True)]
    count, missed, latency, spent = window.execute_script(
        "const s = shown(); return [s.count, s.missed, s.latencies, s.frame.spent_ms]")
    got = count - before[0] - (missed - before[1])
    return {"mode": name, "seconds": seconds, "frames": got, "frames_per_s": got / seconds,
            "missed": missed - before[1], "answered": len(latency), "latency_ms": float(np.median(latency)),
            "latency_95_ms": float(np.quantile(latency, 0.95)), "spent_ms": spent, "server_cpu_ms": 1e3 * used[0] / got,
            "browser_cpu_ms": 1e3 * used[1] / got, "load": load}


def main(model: str, card: str) -> None:
    process = subprocess.Popen([sys.executable, "-m", "surrogate", "live", model, "--simulate", card], text=True,
                               stdout=subprocess.PIPE)
    assert process.stdout is not None
    window = browser()
    try:
        window.get(process.stdout.readline().strip())
        time.sleep(3)
        done = [row(window, process.pid, name, work) for name, work in (("lone", lone), ("sliding", sliding))]
        shown(written(done, "live_page"))
    finally:
        window.quit()
        process.terminate()
        process.wait()


if __name__ == "__main__":
    if len(sys.argv) != 3:
        raise SystemExit("live_page.py: give a model's folder and a card.")
    main(*sys.argv[1:])
