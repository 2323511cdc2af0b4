"""A constant added to a clock changes nothing, in any reader and any reduction; tables of a step have true times."""

import re
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import matcal
from matcal.card import read_card
from matcal.fitting.relaxation.relaxation_fit import fit_prony
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony, relaxation
from matcal.readers.detect import read
from matcal.readers.recording import Recording
from matcal.readers.test_inputs import Input
from matcal.record.cautions import cautions
from matcal.reduction.experiment import Experiment
from matcal.reduction.reduce import read_and_reduce

RAW = Path("data_raw")
CASES = Path(__file__).parents[4] / "shared" / "cases"
SERIES = Prony(np.array([0.3, 0.2]), np.array([1.0, 50.0]))
LAW = Hyperfoam(np.array([18e3, 2e3]), np.array([8.0, -1.8]), np.zeros(2), "instantaneous")
ZEROS = (-123.4, 10.0, 1000.0, 1.7e9)


def _moved(recording: Recording, seconds: float) -> Recording:
    return replace(recording, columns={**recording.columns, "time": recording.columns["time"] + seconds})


def _reduced(kind: str, recordings: Sequence[Recording]) -> Experiment:
    given: list[Input | Experiment] = [(kind, tuple(recordings))]
    (found,) = read_and_reduce(given, RAW / "specimen.toml").experiments
    return found


def _equal(one: Experiment, other: Experiment, within_s: float) -> None:
    """Values to 1e-6 of their range, times to the rounding of the clock."""
    for name in ("strain", "value"):
        a, b = getattr(one, name), getattr(other, name)
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-6 * np.ptp(a) + 1e-12, err_msg=name)
    if one.time_s is not None and other.time_s is not None:
        np.testing.assert_allclose(one.time_s, other.time_s, rtol=0, atol=within_s)
    for name in set(one.facts) - {"clock_shift_s"}:
        assert one.facts[name] == pytest.approx(other.facts[name], rel=1e-3, abs=1e-9), name


@pytest.mark.thorough
@pytest.mark.parametrize("seconds", ZEROS)
@pytest.mark.parametrize(("kind", "name"), [("uniaxial", "mts_uniaxial.txt"), ("shear", "mts_shear.txt"),
                                            ("relaxation", "mts_relaxation.txt")])
def test_the_zero_of_a_load_frames_clock_changes_nothing(kind: str, name: str, seconds: float) -> None:
    recording = read(RAW / name)
    _equal(_reduced(kind, [recording]), _reduced(kind, [_moved(recording, seconds)]), 1e-5)


@pytest.mark.slow
@pytest.mark.parametrize("seconds", [(0.0, 1000.0), (1.7e9, -50.0), (-77.0, 1.7e9), (1.7e9, 1.7e9 + 3)])
@pytest.mark.parametrize("test", ["stretch", "cyclic"])
def test_the_zeros_of_two_clocks_change_nothing(test: str, seconds: tuple[float, float]) -> None:
    both = [read(RAW / f"mts_{test}.txt"), read(RAW / f"nova_{test}.txt")]
    plain, moved = (_reduced("conductivity", [_moved(r, s) for r, s in zip(both, shifts, strict=True)])
                    for shifts in ((0.0, 0.0), seconds))
    _equal(plain, moved, 1e-3)
    between = moved.facts["clock_shift_s"] - plain.facts["clock_shift_s"]
    assert between == pytest.approx(seconds[1] - seconds[0], abs=1e-3)


def test_the_zero_of_the_clock_of_cycles_changes_nothing() -> None:
    time = np.arange(0, 240, 0.5)
    travel = 1e-2 * np.abs(((time / 40 + 1) % 2) - 1)
    force = 1e3 * travel + 2e4 * travel**2
    columns = {"time": time, "displacement": travel, "force": force}
    names = {name: name for name in columns}
    recording = Recording((Path("cycles"),), "arrays", columns, names, {name: "" for name in columns}, None)
    plain = _reduced("shear", [recording])
    assert plain.facts["loadings"] == 3
    for seconds in ZEROS:
        _equal(plain, _reduced("shear", [_moved(recording, seconds)]), 1e-5)


def _ramp(rest_s: float, noise: float = 0.0) -> dict[str, np.ndarray]:
    """A ramp of 1 s to -0.5 and a hold of 200 s, after a rest."""
    time = np.r_[np.linspace(0, 1, 60), 1 + np.geomspace(0.01, 200, 160)]
    strain = np.interp(time, [0, 1, 201], [0, -0.5, -0.5])
    stress = hereditary_stress(LAW, SERIES, "uniaxial", time, strain)
    before = np.arange(0, rest_s, 0.1)
    out = {"strain": np.r_[np.zeros(before.size), strain], "stress_Pa": np.r_[np.zeros(before.size), stress],
           "time_s": np.r_[before, rest_s + time]}
    out["stress_Pa"] = out["stress_Pa"] * (1 + noise * np.random.default_rng(0).normal(size=out["strain"].size))
    return out


@pytest.mark.thorough
@pytest.mark.parametrize("rest_s", [0.0, 10.0])
@pytest.mark.parametrize("seconds", [0.0, *ZEROS])
def test_the_zero_of_a_tables_clock_changes_nothing(seconds: float, rest_s: float) -> None:
    table = _ramp(rest_s)
    table["time_s"] = table["time_s"] + seconds
    found = fit_prony([matcal.read_test({"relaxation": table})], None, 2)
    np.testing.assert_allclose(found.prony.g, SERIES.g, rtol=2e-3)
    np.testing.assert_allclose(found.prony.tau_s, SERIES.tau_s, rtol=5e-3)
    direct = Experiment("relaxation", table["strain"], table["stress_Pa"], table["time_s"])
    np.testing.assert_allclose(fit_prony([direct], None, 2).prony.g, found.prony.g, rtol=1e-4)


@pytest.mark.thorough
def test_published_table_with_four_zeros() -> None:
    folder = CASES / "attack" / "07"
    if not folder.is_dir():
        pytest.skip("the case's files are not here")
    cards = [matcal.fit([folder / "a_uniaxial.csv", folder / f"{name}_relaxation.csv"]).card for name in "bcdf"]
    for quantity, true in (("mu_0_Pa", 20000), ("plateau_Pa", 12959)):
        found = [[card.fit["derived"][quantity][end] for end in ("lo", "value", "hi")] for card in cards]
        lo, value, hi = found[0]
        assert lo < true < hi
        assert value == pytest.approx(true, rel=5e-3)
        np.testing.assert_allclose(found, [found[0]] * 4, rtol=1e-5)
    for card in cards:
        assert card.prony is not None
        np.testing.assert_allclose(card.prony.tau_s, [0.295, 5.88, 85.9], rtol=2e-3)


def _step(first_s: float, clock_s: float = 0.0, points: int = 60, noise: float = 0.0, seed: int = 0) -> dict:
    time = np.r_[0, np.geomspace(0.1, 200, points)] if first_s == 0 else np.geomspace(first_s, 200, points)
    value = -12e3 * relaxation(SERIES, time) * (1 + noise * np.random.default_rng(seed).normal(size=time.size))
    return {"strain": np.full(time.size, -0.3), "stress_Pa": value, "time_s": clock_s + time}


@pytest.mark.parametrize("first_s", [0.0, 0.1, 0.5, 1.0, 2.0])
def test_a_table_whose_strain_is_held_from_its_first_row_is_a_step(first_s: float) -> None:
    found = matcal.fit({"relaxation": _step(first_s)})
    assert found.card.prony is not None
    np.testing.assert_allclose(found.card.prony.g, SERIES.g, rtol=5e-3)
    np.testing.assert_allclose(found.card.prony.tau_s, SERIES.tau_s, rtol=5e-3)
    assert any("begins" in sentence for sentence in cautions(found.card)) == (first_s > 0)


@pytest.mark.thorough
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("first_s", [0.1, 0.5, 1.0])
def test_errors_of_a_step_seen_late_hold_the_truth(first_s: float, seed: int) -> None:
    found = matcal.fit({"relaxation": _step(first_s, noise=3e-3, seed=seed)}).laws.prony
    assert found is not None
    assert abs(found.prony.g_infinity - 0.5) < 2 * found.g_infinity_sd
    assert abs(found.prony.g[0] - 0.3) < 2 * found.g_sd[0]


@pytest.mark.parametrize("clock_s", [100.0, 5e3, 1.7e9, -40.0])
def test_a_steps_table_whose_stress_falls_too_fast_for_its_times_has_a_clock(clock_s: float) -> None:
    found = matcal.fit({"relaxation": _step(0.0, clock_s, noise=1e-4)})
    assert found.card.prony is not None
    np.testing.assert_allclose(found.card.prony.g, SERIES.g, rtol=2e-2)
    assert any("taken as the step" in sentence for sentence in cautions(found.card)) == (clock_s > 0)


@pytest.mark.parametrize(("name", "rtol"), [("a_from0", 1e-3), ("c_from1", 1e-3), ("d_clock100", 1e-3)])
def test_published_tables_of_a_step(name: str, rtol: float) -> None:
    path = CASES / "material" / "21_step_table" / f"{name}.csv"
    if not path.exists():
        pytest.skip("the case's files are not here")
    card = matcal.fit(f"relaxation={path}").card
    assert card.prony is not None
    np.testing.assert_allclose(card.prony.g, SERIES.g, rtol=rtol)
    np.testing.assert_allclose(card.prony.tau_s, SERIES.tau_s, rtol=rtol)


@pytest.mark.thorough
@pytest.mark.parametrize(("head", "scale", "symbol"), [
    ("g_R,time\n-,s", 1.0, None), ("G(t)/G0,time (s)", 1.0, None), ("normalised_stress,time_s", 1.0, None),
    ("E [MPa],t [s]", 5.0, "E_0"), ("G (kPa),Time (s)", 50.0, "G_0"), ("E_relax,t\nMPa,s", 5.0, "E_0"),
    ("Relaxation modulus (Pa),time (s)", 5e4, "modulus_0")])
def test_a_modulus_over_time_needs_no_strain(head: str, scale: float, symbol: str | None, tmp_path: Path) -> None:
    time = np.r_[0, np.geomspace(0.05, 300, 80)]
    rows = np.column_stack([scale * relaxation(SERIES, time), time])
    np.savetxt(tmp_path / "table.csv", rows, delimiter=",", header=head, comments="", fmt="%.9g")
    found = matcal.fit(f"relaxation={tmp_path / 'table.csv'}")
    assert found.card.prony is not None
    np.testing.assert_allclose(found.card.prony.g, SERIES.g, rtol=1e-3)
    moduli = found.card.fit["prony"].get("instantaneous", {})
    assert list(moduli) == ([] if symbol is None else [f"{symbol}_Pa"])
    unit = {"MPa": 1e6, "kPa": 1e3}.get(next((u for u in ("MPa", "kPa") if u in head), ""), 1.0)
    assert all(row["value"] == pytest.approx(scale * unit, rel=1e-3) for row in moduli.values())
    assert not any("other tests" in sentence or "ramp" in sentence for sentence in cautions(found.card))


@pytest.mark.slow
def test_a_record_of_many_decades_gets_a_term_a_decade(tmp_path: Path) -> None:
    truth = Prony(np.full(13, 0.05), np.logspace(-2, 10, 13))
    time = np.geomspace(1e-3, 1e13, 300)
    rows = np.column_stack([time, 1739.0 * relaxation(truth, time)])
    np.savetxt(tmp_path / "master.csv", rows, delimiter=",", header="t,E_relax\ns,MPa", comments="")
    found = matcal.fit(f"relaxation={tmp_path / 'master.csv'}").save(tmp_path / "card.json")
    card = read_card(tmp_path / "card.json")
    assert card.prony is not None
    assert card.prony.g.size > 8
    assert found.card.fit["relaxation_1"]["relative_rms"] < 5e-4
    low, high = (card.fit["prony"]["instantaneous"]["E_0_Pa"][name] for name in ("value", "sd"))
    assert abs(low - 1739e6) < 2 * high


@pytest.mark.slow
def test_the_published_master_curve() -> None:
    path = CASES / "material" / "12_relaxation_modulus_master" / "time_user_master.csv"
    if not path.exists():
        pytest.skip("the case's files are not here")
    card = matcal.fit(f"relaxation={path}").card
    assert card.fit["relaxation_1"]["relative_rms"] < 1e-3
    assert card.fit["prony"]["instantaneous"]["E_0_Pa"]["value"] == pytest.approx(1739e6, rel=0.01)


@pytest.mark.thorough
def test_the_direction_of_a_relaxation_is_in_doubt_next_to_a_law_alone(tmp_path: Path) -> None:
    strain = np.linspace(0.0, 0.6, 30)
    law = np.column_stack([strain, 12e3 * strain + 40e3 * strain**3])
    held = {"strain": np.full(60, 0.3), "stress_Pa": 12e3 * relaxation(SERIES, time := np.geomspace(0.1, 200, 60)),
            "time_s": time}
    alone = matcal.fit([{"relaxation": held}]).card
    both = matcal.fit([{"uniaxial": {"strain": law[:, 0], "stress_Pa": law[:, 1]}}, {"relaxation": held}]).card
    assert [any("compression from tension in relaxation" in said for said in cautions(card))
            for card in (alone, both)] == [False, True]


def _loaded_before(turns_s: Sequence[float], turns: Sequence[float], fine_s: float) -> dict[str, np.ndarray]:
    """A record of strains that turn at given times, sampled twice a second and finer on the last ramp of a second."""
    last = turns_s[-2] - 1.0
    time = np.unique(np.r_[np.arange(0, last, 0.5), np.arange(last, last + 1, fine_s),
                           last + 1 + np.geomspace(0.05, turns_s[-1] - last - 1, 150)])
    strain = np.interp(time, turns_s, turns)
    finest = np.unique(np.r_[time, np.arange(0, turns_s[-1], 0.05)])
    stress = hereditary_stress(LAW, Prony(np.array([0.2, 0.2]), np.array([0.4, 40.0])), "uniaxial", finest,
                               np.interp(finest, turns_s, turns))
    return {"time_s": time, "strain": strain, "stress_Pa": np.interp(time, finest, stress)}


@pytest.mark.parametrize(("turns_s", "turns"), [
    ((0, 1, 200), (0, -0.4, -0.4)), ((0, 10, 20, 30, 40, 200, 201, 400), (0, -0.4, 0, -0.4, 0, 0, -0.4, -0.4))],
    ids=["at once", "preconditioned"])
def test_fast_times_are_searched_whatever_was_recorded_before_the_last_ramp(
        turns_s: tuple[float, ...], turns: tuple[float, ...]) -> None:
    columns = _loaded_before(turns_s, turns, 0.05)
    found = fit_prony([matcal.read_test({"relaxation": columns})], None, 2).prony
    assert found.tau_s[0] == pytest.approx(0.4, rel=0.2)
    assert found.g[0] == pytest.approx(0.2, rel=0.1)


@pytest.mark.thorough
@pytest.mark.parametrize("columns", [("strain", "stress"), ("displacement", "force"), ("force",)])
def test_a_hold_whose_ramp_was_cut_off_says_what_a_ramp_would_change(columns: tuple[str, ...], tmp_path: Path) -> None:
    series, time = Prony(np.array([0.15, 0.15]), np.array([0.3, 5.0])), np.arange(0, 60, 0.1)
    each = series.g * series.tau_s * -np.expm1(-1 / series.tau_s)  # after a linear ramp of 1 s
    load = 30 * (series.g_infinity + np.exp(-time[:, None] / series.tau_s) @ each)
    values = {"strain": ("-", 0.4 + 0 * time), "stress": ("Pa", load), "displacement": ("mm", 8 + 0 * time),
              "force": ("N", load)}
    heads = ",".join(f"{name} ({values[name][0]})" for name in columns)
    np.savetxt(tmp_path / "relaxation.csv", np.column_stack([time, *(values[name][1] for name in columns)]),
               delimiter=",", header=f"time (s),{heads}", comments="")
    (said,) = (one for one in cautions(matcal.fit(tmp_path / "relaxation.csv").card) if "ramp of 1 s" in one)
    assert re.search(r"g_1 is near 0\.1[4-6].*, not 0\.0[45].*g_infinity near 0\.(69\d|70\d|7),", said)


def test_a_record_that_begins_in_its_ramp_says_that_its_load_counts_as_none(tmp_path: Path) -> None:
    """Begun 0.4 s into the ramp, g comes out a third too large; begun at rest, nothing is said."""
    time = np.arange(0, 600) * 0.02
    strain = np.minimum(0.4 * time, 0.4)
    load = 100 * strain * (1 - 0.35 * (1 - np.exp(-time / 3)))
    specimen = tmp_path / "specimen.toml"
    specimen.write_text('[relaxation]\ndirection = "compression"\ndiameter_mm = 50\nheight_mm = 20\n')
    for first, says in ((0, False), (20, True)):
        path = tmp_path / f"relaxation_{first}.csv"
        rows = (f"{t:.2f},{20 * e:.5f},{f:.5f}" for t, e, f in zip(time[first:], strain[first:], load[first:],
                                                                  strict=True))
        path.write_text("\n".join(["Time (s),Displacement (mm),Force (N)", *rows, ""]))
        (found,) = read_and_reduce([("relaxation", (path,))], specimen).experiments
        assert any("which count as zero load" in said for said in found.cautions) == says
