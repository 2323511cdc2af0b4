"""Two clocks: the shift is found from tearing or from motion, within the error that is stated."""

import numpy as np
import pytest

from matcal.reduction.electric.clock_alignment import Shift, combined, shift_by_break, shift_by_motion

FRAME = np.arange(0, 400, 0.1)
SHIFT = 1234.567


def _strain(cycles: int) -> np.ndarray:
    if cycles:
        return np.where((FRAME > 20) & (FRAME < 380), 0.03 * (1 - np.cos(2 * np.pi * cycles * (FRAME - 20) / 360)), 0.0)
    return np.interp(FRAME, [0, 20, 380, 400], [0, 0, 0.4, 0.4])


def _conductance(time: np.ndarray, strain: np.ndarray, rng: np.random.Generator, settling: float) -> np.ndarray:
    e = np.interp(time - SHIFT, FRAME, strain)
    true = 5e-4 * (1 - 2 * e + 2 * e**2 - e**3) / (1 + e) * (1 - settling * np.exp(-(time - SHIFT) / 150))
    return true + 1e-6 * rng.standard_normal(time.size)


@pytest.mark.parametrize(("cycles", "settling"), [(0, 0.0), (8, 0.0), (8, 0.2)])
def test_motion_gives_the_shift_within_its_error(cycles: int, settling: float) -> None:
    rng, strain = np.random.default_rng(cycles), _strain(cycles)
    time = np.arange(-30, 405, 0.5) + SHIFT
    found = [shift_by_motion(FRAME, strain, time, _conductance(time, strain, rng, settling), settling > 0)
             for _ in range(6)]
    z = np.array([(f.seconds - SHIFT) / f.sd_s for f in found])
    print(f"{cycles} cycles: sd {found[0].sd_s:.3f} s, z {z.round(1)}")
    assert np.abs(z).max() < 3.5
    assert found[0].sd_s < 0.3


def test_a_strip_held_stretched_beyond_the_potentiostats_end_does_not_move_there() -> None:
    frame = np.arange(0, 500, 0.1)
    strain = np.interp(frame, [0, 20, 380, 500], [0, 0, 0.4, 0.4])
    time = np.arange(-4, 385, 0.5) + SHIFT
    e = np.interp(time - SHIFT, frame, strain)
    conductance = 5e-4 * (1 - 2 * e + 2 * e**2 - e**3) / (1 + e)
    conductance = conductance + 1e-6 * np.random.default_rng(3).standard_normal(time.size)
    found = shift_by_motion(frame, strain, time, conductance, False)
    assert abs(found.seconds - SHIFT) < 3.5 * found.sd_s
    assert found.sd_s < 0.3


def test_records_that_cannot_overlap_are_refused() -> None:
    time = np.arange(0, 60, 0.5)
    with pytest.raises(ValueError, match="too short for a motion of"):
        shift_by_motion(FRAME, _strain(0), time, np.full(time.size, 5e-4), False)


def test_tearing_gives_the_shift_within_a_sample() -> None:
    time = np.arange(-30, 405, 0.5) + SHIFT
    for torn in (300.0, 300.03, 300.26, 300.49):
        load = np.where(torn > FRAME, 4.0, 0.0) * np.clip((FRAME - 20) / 300, 0, 1)
        current = np.where(time - SHIFT < torn, 2e-4, 0.0)
        found = shift_by_break(FRAME, load, time, current)
        assert found is not None
        assert abs(found.seconds - SHIFT) <= 0.5 * (0.5 + 0.1) + 1e-9
        assert found.sd_s == pytest.approx(np.hypot(0.5, 0.1) / np.sqrt(12))


def test_a_strip_that_holds_has_no_tearing() -> None:
    time = np.arange(0, 400, 0.5)
    rng = np.random.default_rng(0)
    load = np.interp(FRAME, [0, 400], [0, 5]) + 0.25 * rng.standard_normal(FRAME.size)
    assert shift_by_break(FRAME, load, time, np.full(time.size, 2e-4)) is None
    assert shift_by_break(FRAME, np.where(FRAME < 300, load, 0.0), time, np.linspace(3e-4, 1e-4, time.size)) is None


def test_two_shifts_are_weighted_by_what_they_are_worth() -> None:
    both = combined(Shift(10.0, 0.1, "a"), Shift(11.0, 0.3, "b"))
    assert both.seconds == pytest.approx(10.1)
    assert both.sd_s == pytest.approx(0.3 / np.sqrt(10))
