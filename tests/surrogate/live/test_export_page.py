"""The page as one file: small, without a request, and read as `predict` reads."""

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import surrogate
from surrogate.forward_map.forward_map import linearise
from surrogate.forward_map.load_coordinates import to_unknown
from surrogate.live.export_page import MOST_BYTES, UNFLAGGED, export_page, pressable
from surrogate.live.skins import limits_of

PLACE_MM = 0.2  # the most that a place read in the browser may differ from that of `predict`
READ = "return arguments[0].map(s => learned.read(s, arguments[1], null).read).map(r => [r.x_mm, r.y_mm])"


def opened(page: Any, path: Path) -> None:
    """Open a file in a browser without a network."""
    page.command("Network.enable")
    page.command("Network.emulateNetworkConditions", offline=True, latency=0, downloadThroughput=0, uploadThroughput=0)
    page.open(path.as_uri())


def differs_mm(page: Any, model: surrogate.Model, signal_V: np.ndarray, noise_V: float) -> float:
    """The largest distance of places read in the browser and by `predict`."""
    found = model.predict(model.baseline_V + signal_V, model.baseline_V, noise_V=noise_V)[["x0_m", "y0_m"]]
    read = np.array(page.run(READ, signal_V.tolist(), noise_V))
    return float(np.hypot(*(read - 1e3 * found.to_numpy()).T).max())


@pytest.mark.slow
def test_one_file_presses_and_reads_without_a_network(page: Any, inner_model: surrogate.Model, tmp_path: Path) -> None:
    export_page(inner_model, tmp_path / "page.html")
    assert (tmp_path / "page.html").stat().st_size < MOST_BYTES
    opened(page, tmp_path / "page.html")
    page.run("document.getElementById('noise').value = 0; "
             "document.getElementById('noise').dispatchEvent(new Event('change'))")
    page.hold(15, -20)
    assert page.place() == pytest.approx((float(page.text("true-x")), float(page.text("true-y"))), abs=0.3)
    assert page.place() == pytest.approx((15, -20), abs=0.6)
    assert [url for url in page.asked() if not url.startswith(("data:", tmp_path.as_uri()))] == []
    assert page.browser.get_log("browser") == []


def test_noise_and_drift_alone_are_no_touch(page: Any, inner_model: surrogate.Model, tmp_path: Path) -> None:
    export_page(inner_model, tmp_path / "page.html")
    page.open((tmp_path / "page.html").as_uri())
    page.run("window.touches = 0; const read = learned.read; "
             "learned.read = (...given) => { const found = read(...given); touches += found !== null; return found; };"
             "for (const id of ['noise', 'drift']) { const one = document.getElementById(id); one.value = one.max; "
             "one.dispatchEvent(new Event('input')); one.dispatchEvent(new Event('change')); }")
    begun = page.run("return shown().count")
    page.wait(f"shown().count > {begun} + 150")
    assert page.run("return touches") == 0


def test_a_request_would_be_refused(page: Any, inner_model: surrogate.Model, tmp_path: Path) -> None:
    export_page(inner_model, tmp_path / "page.html")
    page.open((tmp_path / "page.html").as_uri())
    page.run("window.went = null; fetch('http://127.0.0.1:9/').catch(e => { went = e.name; })")
    page.wait("went")
    assert any("Content Security Policy" in one["message"] for one in page.browser.get_log("browser"))


@pytest.mark.slow
@pytest.mark.parametrize("noise", [0.0, 1e-4])
def test_unseen_touches_are_read_as_predict_reads_them(
        page: Any, inner_model: surrogate.Model, synthetic: Callable[..., Any], tmp_path: Path, noise: float) -> None:
    export_page(inner_model, tmp_path / "page.html")
    opened(page, tmp_path / "page.html")
    _, signal_V = synthetic(40, 77)
    noise_V = noise * float(np.sqrt(np.mean(inner_model.baseline_V**2)))
    noisy = signal_V + noise_V * np.random.default_rng(5).normal(size=signal_V.shape)
    assert differs_mm(page, inner_model, noisy, noise_V) < PLACE_MM


@pytest.mark.slow
def test_the_map_in_the_browser_is_that_of_the_model(
        page: Any, make_dataset: Callable[..., Path], synthetic: Callable[..., Any], untouched_V: np.ndarray,
        tmp_path: Path) -> None:
    """Near the rim as well, where the skin's answer and the electrodes' metal are counted."""
    touch, signal_V = synthetic(460, 4, (), 86.0)
    columns = {f"{name}_{part:03d}": values for name, frames in (("v", signal_V + untouched_V), ("dv", signal_V))
               for part, values in enumerate(frames.T)}
    columns |= dict(zip(("x_mm", "y_mm", "d_mm", "F_N"), touch.T, strict=True))
    model = surrogate.train(make_dataset(tmp_path / "disc", 460, 4, **columns), "forward", seed=1)
    forward = model.learner.forward
    assert len(forward.correction.rim.process.nodes)
    assert len(forward.correction.polarization.nodes)
    assert limits_of(model).gap_mm < 14.5
    assert pressable(model).gap_mm == pytest.approx(15.0)
    export_page(model, tmp_path / "page.html")
    opened(page, tmp_path / "page.html")
    asked, fresh_V = synthetic(30, 5, (), 86.0)
    expected = linearise(forward, to_unknown(asked, forward.p0)).signal_V
    found = np.array(page.run("return arguments[0].map(t => Array.from(learned.press(...t)))", asked.tolist()))
    off = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    assert off.max() < 1e-8
    assert differs_mm(page, model, fresh_V, 2e-4) < PLACE_MM


def test_the_page_says_that_it_flags_no_other_punch(inner_model: surrogate.Model, tmp_path: Path) -> None:
    export_page(inner_model, tmp_path / "page.html")
    text = (tmp_path / "page.html").read_text(encoding="utf-8")
    assumes = json.loads(re.findall(r'id="learned">(.*)</script>', text)[0])["hello"]["assumes"]
    assert assumes.startswith("one punch, profile flat")
    assert assumes.endswith(UNFLAGGED)


def test_other_methods_have_no_map_to_export(sweep: Path, tmp_path: Path) -> None:
    with pytest.raises(ValueError, match="only forward"):
        export_page(surrogate.train(sweep, "ridge", seed=1), tmp_path / "page.html")
    assert not (tmp_path / "page.html").exists()
