"""Real skins that others measured, in ../shared/real; skipped where they are not there."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

from surrogate.recordings import templates
from surrogate.recordings.blocks import time_blocks
from surrogate.recordings.trained.reader_scores import read_rows

BENCHMARKS = Path(__file__).parents[3] / "benchmarks"
sys.path.insert(0, str(BENCHMARKS))
from real_skins import REAL, Case, recorded, rows_of, with_drift  # noqa: E402  # pyright: ignore

pytestmark = pytest.mark.skipif(not REAL.is_dir(), reason="the recordings of real skins are not here")

# Mean distance, mm, that 100 labels just before the test must reach on the last fifth of the presses in time.
HUNDRED = {"skin_plain": 3.0, "skin_radial": 5.0, "skin_carbon": 7.5, "hydrogel": 3.0}


def test_templates_read_the_hydrogel_from_a_hundred_presses() -> None:
    _, presses, labels = recorded("hydrogel")
    place = labels.values[:, :2]
    train, test = rows_of(Case("hydrogel", 100, "time", "last"), len(place))
    fitted = templates.fit(presses.signal[train], place[train], time_blocks(100), compress=False)
    error = fitted.templates.read(presses.signal[test])[0] - place[test]
    assert np.linalg.norm(error, axis=1).mean() <= 3.0


@pytest.mark.slow
@pytest.mark.parametrize("skin", HUNDRED)
def test_a_hundred_presses_suffice(skin: str) -> None:
    _, presses, labels = recorded(skin)
    train, test = rows_of(Case(skin, 100, "time", "last"), len(labels.touch))
    found = read_rows(presses, labels, train, test, "time", 0)[0].score
    assert found.error <= HUNDRED[skin]
    assert found.error < found.ridge_error
    assert 0.85 <= np.mean(found.coverage) <= 0.95  # x and y together: the hydrogel has 70 tested presses


@pytest.mark.slow
@pytest.mark.parametrize(("drift", "most"), [("20 old", 5.5), ("every 10", 4.0)])
def test_the_hydrogel_is_read_through_drift(drift: str, most: float) -> None:
    recording, presses, labels = recorded("hydrogel")
    train, test = rows_of(Case("hydrogel", 100, "time", "last"), len(labels.touch))
    found = read_rows(with_drift(recording, presses, drift), labels, train, test, "time", 0)[0].score
    assert found.error <= most
