"""Single steps of the reduction worked out by hand: what counts as touched, drift, holds, sizes, a strip's circuit."""

from pathlib import Path

import numpy as np
import pytest

from matcal.readers.recording import Recording
from matcal.reduction import load_frame
from matcal.reduction.electric.clock_alignment import with_backlash
from matcal.reduction.electric.strip_conductivity import reduce_stretch
from matcal.reduction.holds import stress_relaxation
from matcal.reduction.holds.stress_relaxation import reduce_relaxation
from matcal.reduction.load_cycles import Loading
from matcal.reduction.specimen import Block, Strip, make_specimen, sheet
from matcal.reduction.stroke_segments import Stroke
from touchcal.errors import InputFileError

FILE = Path("made.csv")


def recording(**columns: np.ndarray) -> Recording:
    return Recording((FILE,), "plain", columns, {name: name for name in columns}, {}, 2)


def stroke_of(travel: np.ndarray, start: int, end: int, noise_m: float = 0.0) -> Stroke:
    return Stroke(travel, 1.0, start, end, ((start, end),), noise_m)


@pytest.mark.parametrize("moving", [40, 400, 4000])
def test_a_specimen_is_touched_where_the_load_rises_by_six_standard_errors(moving: int) -> None:
    """Of the mean of the last samples of the loading: a twentieth of them, one to twenty."""
    size = {40: 2, 400: 20, 4000: 20}[moving]
    load = np.r_[np.full(50, 3.0), np.linspace(3, 4, moving - size), np.full(size + 1, 4.0), np.full(30, 9.0)]
    stroke = stroke_of(np.zeros(load.size), 50, 50 + moving)
    limit = np.sqrt(size) / 6
    load_frame._check_touch(recording(force=load), stroke, load, 0.97 * limit)
    with pytest.raises(InputFileError, match=r"the load rises by 1 N where its noise is"):
        load_frame._check_touch(recording(force=load), stroke, load, 1.03 * limit)


def test_means_reach_a_level_at_their_block_or_between_two() -> None:
    """Blocks of five; samples that fill none are left out, and the last block stands where none passes."""
    for n in (10, 14):
        step = np.r_[np.zeros(5), np.ones(n - 5)]
        assert load_frame._first_above(step, 0.5, 5) == slice(5, 10)
        assert load_frame._reaches(np.arange(n, dtype=float), step, 0.5, 5) == pytest.approx(2 + 0.5 * 5)
    assert load_frame._first_above(np.zeros(9), 0.5, 5) == slice(0, 5)
    assert load_frame._reaches(np.arange(9.0), np.ones(9), 1.0, 5) == 2.0


def test_the_clock_starts_at_contact_between_two_samples() -> None:
    time, moved = np.array([5.0, 6.0, 8.0]), np.array([0.1, 0.3, 0.4])
    assert load_frame._contact_time(time, moved, 2, 0.375) == pytest.approx(7.5)
    assert load_frame._contact_time(time, moved, 1, 0.3) == pytest.approx(6.0)
    assert load_frame._contact_time(time, moved, 0, 0.05) == 5.0


@pytest.mark.parametrize(("gap_mm", "rest", "back", "measured"), [
    (1.0, 100, 100, True), (1.0, 19, 100, False), (1.0, 100, 15, False), (0.0, 100, 100, False)])
def test_drift_needs_two_rests_clear_of_the_specimen(gap_mm: float, rest: int, back: int, measured: bool) -> None:
    """0.1 mN/s under 1 mN of noise, twenty samples at least before and after, and a contact that is not at the rest
    position."""
    travel = 1e-3 * np.r_[np.zeros(rest), np.linspace(0, 5, 400), np.linspace(5, 0.1, 400), np.zeros(back)]
    time = 0.1 * np.arange(travel.size)
    noise = 1e-3 * np.random.default_rng(0).normal(size=travel.size)
    load = 4e3 * np.maximum(travel - 1e-3 * gap_mm, 0.0) + 1e-4 * time + noise
    stroke = stroke_of(travel, rest, rest + 399)
    left, rate, sd = load_frame._without_drift(stroke, load, time, Block(1e-4, 0.02), 1e-3)
    assert (sd is not None) is measured
    assert rate == pytest.approx(1e-4 if measured else 0.0, abs=8e-6)
    assert left[0] == load[0]
    if measured:
        assert left[-back:].mean() == pytest.approx(left[:rest].mean(), abs=1e-6)
        after = back + np.count_nonzero(travel[rest + 399:-back] < 5e-6)
        apart = time[-back:].mean() - time[:rest].mean()
        assert sd == pytest.approx(1e-3 * np.hypot(rest**-0.5, after**-0.5) / apart, rel=0.02)


@pytest.mark.parametrize(("kind", "sizes", "sign", "load_sign", "expected"), [
    ("shear", Block(1, 1), -1, 1, 1.0), ("volumetric", Block(1, 1), 1, 1, -1.0), ("planar", Block(1, 1), 1, 1, 1.0),
    ("biaxial", Block(1, 1), 1, -1, 1.0), ("uniaxial", Block(1, 1), -1, -1, -1.0),
    ("uniaxial", Block(1, 1, direction="tension"), -1, -1, 1.0), ("uniaxial", Block(1, 1), -1, 1, None),
    ("uniaxial", Block(1, 1), 1, -1, None)])
def test_compression_is_told_from_tension(kind: str, sizes: Block, sign: float, load_sign: float,
                                          expected: float | None) -> None:
    """By the kind, by the specimen, or by displacement and load that both fall; else it is asked for."""
    made = recording(force=np.zeros(3))
    if expected is None:
        with pytest.raises(InputFileError, match="nothing tells whether this is compression or tension"):
            load_frame._direction(kind, made, sizes, sign, load_sign)
    else:
        assert load_frame._direction(kind, made, sizes, sign, load_sign)[0] == expected


def loading(time: np.ndarray, strain: np.ndarray, stress: np.ndarray, end: int) -> Loading:
    return Loading(time, strain, stress, end, 1.0, (), {})


def test_facts_of_holds_count_from_the_end_of_the_hold_before() -> None:
    """Two holds of 20 samples: relaxed by the means of the first and the last two."""
    time = np.arange(100.0)
    stress = np.ones(100)
    stress[20:22], stress[22:38], stress[38:40] = [10.0, 8.0], 7.0, [5.0, 4.0]
    stress[60:62], stress[62:78], stress[78:80] = [20.0, 20.0], 9.0, [15.0, 15.0]
    strain = -0.2 - 1e-4 * time
    found = stress_relaxation._facts(loading(time, strain, stress, 20), time, [(20, 40), (60, 80)])
    assert found["holds"] == 2
    for end, ramp_s, relaxed, middle in (("", 20.0, 0.5, 29.5), ("_1", 20.0, 0.5, 29.5), ("_2", 21.0, 0.25, 69.5)):
        assert found["ramp_s" + end] == ramp_s
        assert found["hold_s" + end] == 19.0
        assert found["hold_relaxed" + end] == pytest.approx(relaxed)
        assert found["hold_strain" + end] == pytest.approx(-0.2 - 1e-4 * middle)
        assert found["hold_strain_change" + end] == pytest.approx(-19e-4)
    one = stress_relaxation._facts(loading(time, strain, stress, 20), time, [(20, 40)])
    assert set(one) == {"holds", "ramp_s", "hold_s", "hold_relaxed", "hold_strain", "hold_strain_change"}
    said = stress_relaxation._sentences(found, 2, 50)
    assert [s[:7] for s in said] == ["2 holds", "Hold 1:", "Hold 2:"]
    assert [s[:7] for s in stress_relaxation._sentences(one, 1, 50)] == ["1 hold,", "Hold 1:"]


def test_blocks_of_ramps_and_holds_take_every_sample_once() -> None:
    """From the toe to the end of the last hold: a short ramp sample by sample, a long one by 300 means, no hold by more
    than 120."""
    time = np.arange(3000.0)
    edges, held = stress_relaxation._edges(time, [(20, 1000), (2000, 2500)], 5)
    assert (edges[0], edges[-1]) == (5, 2500)
    assert np.all(np.diff(edges) > 0)
    ramp, hold = (edges[1:] <= 20), (edges[1:] > 20) & (edges[1:] <= 1000)
    assert np.diff(edges)[ramp].tolist() == [1] * 15
    assert held[ramp].tolist() == [0.0] * 15
    assert set(held[hold]) == {1.0}
    assert 60 < np.count_nonzero(hold) <= 120
    assert np.count_nonzero(held == 0) == 15 + 300
    assert len(held) == len(edges) - 1


@pytest.mark.parametrize(("hold_s", "kept"), [(30.0, False), (50.0, True)])
def test_a_hold_lasts_as_long_as_its_ramp_at_least(hold_s: float, kept: bool) -> None:
    """A ramp of 40 s from contact on, to a strain of 0.5, and a hold of 30 or 50 s."""
    time = np.arange(0, 45 + hold_s, 0.1)
    strain = 0.5 * np.clip((time - 5) / 40, 0, 1)
    noise = 1e-4 * np.random.default_rng(0).normal(size=time.size)
    made = recording(time=time, displacement=0.02 * strain, force=10 * strain + noise)
    block = Block(1e-4, 0.02, direction="compression")
    if not kept:
        with pytest.raises(InputFileError, match=rf"it holds for {hold_s - 0.1:.3g} s after a ramp of (40|39\.\d) s"):
            reduce_relaxation(made, block)
        return
    got = reduce_relaxation(made, block)
    assert got.held is not None
    assert got.samples is not None
    assert (got.samples[0], got.held[0], set(got.held)) == (1.0, 0.0, {0.0, 1.0})
    assert got.facts["ramp_s"] == pytest.approx(40.0, abs=0.3)
    assert np.abs(got.strain[1]) == pytest.approx(0.01 + 0.5 * 0.05 / 40, abs=1e-3)


@pytest.mark.parametrize(("key", "unit", "least", "most"), [
    ("height_mm", 1.0, 1e-3, 1e4), ("area_mm2", 1.0, 1e-6, 1e8), ("compliance_mm_per_N", 1.0, 0.0, 1e3),
    ("preload_N", 1.0, 0.0, 1e7)])
def test_sizes_lie_within_the_limits_of_their_unit(key: str, unit: float, least: float, most: float) -> None:
    table = {"height_mm": 20.0, "area_mm2": 400.0}
    for value in (max(least, 1e-6 * most) * 1.05, 0.99 * most):
        make_specimen("uniaxial", table | {key: value}, FILE)
    for value in (0.97 * least, 1.01 * most):
        if value:
            with pytest.raises(InputFileError, match=rf"\[uniaxial\] {key} = .* must be from {least:g} to {most:g}; "
                               .replace("+", r"\+")):
                make_specimen("uniaxial", table | {key: value}, FILE)


def test_a_coating_a_voltage_and_a_ratio_lie_within_theirs() -> None:
    strip = {"length_mm": 75.0, "width_mm": 20.0, "thickness_mm": 5.0, "coating_um": 30.0, "voltage_V": 0.5}
    sleeve = {"method": "confined", "diameter_mm": 10.0, "height_mm": 20.0, "lateral_ratio": 0.4}
    for kind, table, key, least, most in (("conductivity", strip, "coating_um", 1e-3, 1e5),
                                          ("conductivity", strip, "voltage_V", 1e-9, 1e5),
                                          ("volumetric", sleeve, "lateral_ratio", 0.0, 1.0)):
        for value in (least, most):
            if value:
                make_specimen(kind, table | {key: value}, FILE)
        for value in (0.97 * least, 1.03 * most):
            if value:
                with pytest.raises(InputFileError, match="check its unit"):
                    make_specimen(kind, table | {key: value}, FILE)
    piston = {"method": "hydrostatic", "piston_diameter_mm": 10.0, "volume_mm3": 1e12}
    make_specimen("volumetric", piston, FILE)
    with pytest.raises(InputFileError, match=r"volume_mm3 = .* must be from 1e-09 to 1e\+12"):
        make_specimen("volumetric", piston | {"volume_mm3": 1.01e12}, FILE)


def test_a_planar_sheet_is_four_times_as_wide_as_long() -> None:
    assert len(sheet("planar", 0.02, 0.0801, 0.005).notes) == 1
    assert len(sheet("planar", 0.02, 0.0799, 0.005).notes) == 2
    assert Block(1, 1).mean_share == 1


def test_areas_given_in_two_ways_are_one_within_a_hundredth() -> None:
    table = {"height_mm": 20.0, "width_mm": 10.0, "depth_mm": 40.0}
    for area in (400 * 1.0098, 400 * 0.9905):
        assert make_specimen("uniaxial", table | {"area_mm2": area}, FILE) == Block(area * 1e-6, 0.02)
    for area in (400 * 1.0105, 400 * 0.989, 800.0):
        with pytest.raises(InputFileError, match="two cross-sections"):
            make_specimen("uniaxial", table | {"area_mm2": area}, FILE)


STRIP = Strip(0.075, 1.5e-6, 0.5)


def stretched(torn: int | None = None, voltage: float | None = None, noise: float = 0.0) -> Recording:
    """One file: 10 s of rest, 50 s of stretch to 0.3 and a rest, c = 30 (1 - e) S/m, I = U c A/(L_0 (1 + e)) at 0.5 V.
    """
    time = np.arange(0, 70, 0.05)
    strain = 0.3 * np.clip((time - 10) / 50, 0, 1)
    current = 0.5 * 30 * (1 - strain) * 1.5e-6 / (0.075 * (1 + strain))
    current *= 1 + noise * np.random.default_rng(0).normal(size=time.size)
    if torn is not None:
        current[torn:] = 1e-3 * current[0]
    more = {} if voltage is None else {"potential": np.full(time.size, voltage)}
    return recording(time=time, displacement=0.075 * strain, current=current, **more)


def test_a_strip_gives_its_conductivity_back() -> None:
    """Against strain and time, in a hundred means; the resistance at rest is L_0/(c A)."""
    got = reduce_stretch([stretched()], STRIP)
    assert got.value == pytest.approx(30 * (1 - got.strain), rel=1e-4)
    assert got.time_s is not None
    moving = got.time_s > 11
    assert got.strain[moving] == pytest.approx(0.3 * (got.time_s[moving] - 10) / 50, abs=1e-6)
    assert got.facts["resistance_rest_Ohm"] == pytest.approx(0.075 / (30 * 1.5e-6))
    assert got.facts["samples_per_point"] == 12
    assert got.facts["strain_zero_sd"] == 0
    assert 98 <= got.value.size <= 102
    assert got.noise is not None
    assert reduce_stretch([stretched(noise=0.01)], STRIP).noise == pytest.approx(0.01 * 26 / 12**0.5, rel=0.15)


def test_a_torn_strip_is_read_until_the_sample_before() -> None:
    got = reduce_stretch([stretched(torn=800)], STRIP)
    assert got.strain.max() == pytest.approx(0.3 * 30 / 50, rel=0.02)
    assert any("Current collapses after 799 of 1400 samples" in said for said in got.decisions)
    assert not any("collapses" in said for said in reduce_stretch([stretched()], STRIP).decisions)


def test_the_stated_voltage_is_that_measured_within_a_twentieth() -> None:
    for voltage in (0.5 * 1.048, 0.5 * 0.952):
        found = reduce_stretch([stretched(voltage=voltage)], STRIP)
        assert found.value[0] == pytest.approx(30 * 0.5 / voltage, rel=1e-4)
    for voltage in (0.5 * 1.052, 0.5 * 0.948):
        with pytest.raises(InputFileError, match=r"but the specimen says voltage_V = 0.5"):
            reduce_stretch([stretched(voltage=voltage)], STRIP)


def test_a_cycled_strip_is_read_over_its_last_cycle_on_the_frames_clock() -> None:
    """Five cycles to 4 mm with 0.2 mm of backlash, the potentiostat's clock 30 s ahead, noise of 0.2 %; each number
    within its error, the doubt of strain that of the clock at 4 mm in 45 s."""
    time, rng = np.arange(0, 500, 0.25), np.random.default_rng(4)
    travel = np.interp(time, np.arange(11) * 45.0 + 5, 4e-3 * (np.arange(11) % 2))
    pot_time = np.arange(0.6, 480, 0.5)
    e = np.interp(pot_time, time, with_backlash(travel, 0.2e-3)) / 0.075
    current = 0.5 * 30 * (1 - e) * 1.5e-6 / (0.075 * (1 + e)) * (1 + 2e-3 * rng.normal(size=e.size))
    frame = recording(time=time, displacement=travel)
    pot = Recording((Path("pot.csv"),), "plain", {"time": pot_time + 30, "current": current},
                    {"time": "t", "current": "I"}, {}, 2)
    got = reduce_stretch([frame, pot], STRIP)
    facts = got.facts
    assert facts["clock_shift_s"] == pytest.approx(30.0, abs=4 * facts["clock_shift_sd_s"])
    assert facts["backlash_mm"] == pytest.approx(0.2, abs=4 * facts["backlash_sd_mm"])
    assert 1e-4 < facts["backlash_sd_mm"] < 0.1
    assert facts["strain_zero_sd"] == pytest.approx(facts["clock_shift_sd_s"] * 4 / 75 / 45, rel=0.03)
    assert got.value == pytest.approx(30 * (1 - got.strain), rel=0.01)
    assert got.time_s is not None
    assert np.ptp(got.time_s) == pytest.approx(90, rel=0.03)
    assert got.time_s[0] >= 0
    assert got.strain.max() == pytest.approx(4 / 75, rel=0.05)
    assert facts["resistance_rest_Ohm"] == pytest.approx(0.075 / (30 * 1.5e-6), rel=0.01)
