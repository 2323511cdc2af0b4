"""Series of dynamic tests and creep: known materials come back, and pyvisco's as they were published."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import simpson
from scipy.optimize import least_squares

from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.relaxation.relaxation_fit import fit_prony
from matcal.fitting.relaxation.seen_sweep import seen_sweep
from matcal.fitting.relaxation.spectrum_fit import fit_spectrum
from matcal.fitting.relaxation.sweep_shift import _by_degree
from matcal.laws.deformation_modes import push_forward
from matcal.laws.histories.creep_series import relaxation_of
from matcal.laws.histories.time_temperature import Arrhenius, Shift, Wlf, decades
from matcal.laws.prony import Prony, convolve, dynamic, relaxation
from matcal.record.cautions import cautions
from matcal.record.write import make_card
from matcal.reduction.experiment import Experiment, Sweep
from matcal.reduction.reduce import reduce_tests

PYVISCO = Path(__file__).resolve().parents[4] / "shared/cases/material"
TEMPERATURE = np.arange(0.0, 61.0, 10.0) + 273.15
FREQUENCY = np.geomspace(0.1, 100, 16)


def material(seed: int) -> tuple[Prony, float, np.random.Generator]:
    """A broad spectrum, its instantaneous modulus, Pa, and numbers for noise."""
    rng = np.random.default_rng(seed)
    tau = np.logspace(-9, 6, 61)
    g = np.exp(-0.5 * ((np.log10(tau) - rng.uniform(-3, 0)) / rng.uniform(1.5, 3)) ** 2)
    return Prony(g / g.sum() * rng.uniform(0.3, 0.95), tau), 10 ** rng.uniform(5, 9), rng


def sweeps(true: Prony, modulus_Pa: float, law: Shift, noise: float, rng: np.random.Generator) -> Experiment:
    parts = [modulus_Pa * dynamic(true, 2 * np.pi * FREQUENCY * 10 ** decades(law, t)) for t in TEMPERATURE]
    z = np.concatenate(parts)
    storage, loss = (part * (1 + noise * rng.standard_normal(z.size)) for part in (z.real, z.imag))
    group = np.repeat(np.arange(TEMPERATURE.size), FREQUENCY.size)
    return Experiment("dma", np.zeros(z.size), storage, source=("sweeps",), facts={"table_of_E": 1.0},
                      sweep=Sweep(np.tile(FREQUENCY, TEMPERATURE.size), loss, group, TEMPERATURE))


def test_the_complex_modulus_is_the_transform_of_the_relaxation() -> None:
    """i w times the integral of E(t) exp(-i w t), by quadrature on a path where it decays."""
    law, omega = Prony(np.array([0.3, 0.2]), np.array([0.1, 4.0])), np.array([0.2, 1.0, 9.0])
    t = np.linspace(0, 200, 100_001)
    falling = (relaxation(law, t) - law.g_infinity) * np.exp(-1j * omega[:, None] * t)
    by_quadrature = law.g_infinity + 1j * omega * simpson(falling, t, axis=1)
    np.testing.assert_allclose(dynamic(law, omega), by_quadrature, rtol=1e-6)


@pytest.mark.thorough
def test_a_hold_of_the_same_material_is_predicted_to_one_per_cent() -> None:
    """Mean and worst over ten materials, a hold after a ramp of 0.5 s, sweeps at seven temperatures with 0.5 % noise
    (with 1 % the worst is 1.1 %)."""
    worst = []
    for seed in range(10):
        true, modulus_Pa, rng = material(seed)
        found = fit_spectrum(sweeps(true, modulus_Pa, Wlf(9.0, 110.0, 303.15), 0.005, rng), reference_K=303.15)
        time = np.r_[0.0, np.geomspace(0.5, found.bounds_s[1], 60)]
        strain = np.r_[0.0, np.full(60, 0.01)]
        measured = convolve(true, time, modulus_Pa * strain)[1:]
        predicted = convolve(found.prony, time, found.modulus_Pa * strain)[1:]
        worst.append(np.abs(predicted / measured - 1).max())
    assert np.mean(worst) < 0.005
    assert max(worst) < 0.01


@pytest.mark.thorough
@pytest.mark.parametrize("law", [Wlf(9.0, 110.0, 303.15), Arrhenius(90e3, 303.15)], ids=["wlf", "arrhenius"])
def test_shifts_and_their_law_lie_in_their_intervals(law: Shift) -> None:
    shifts, numbers, chosen = [], [], 0
    for seed in range(10):
        true, modulus_Pa, rng = material(seed)
        found = fit_spectrum(sweeps(true, modulus_Pa, law, 0.01, rng), reference_K=303.15).shift
        assert found is not None
        free = found.sd > 0
        error = (found.log10_a - decades(law, TEMPERATURE))[free]
        shifts += [*(np.abs(error) < 2.2 * found.sd[free])]
        assert np.median(np.abs(error)) < 0.05
        if type(found.law) is type(law):
            chosen += 1
            values = [v for k, v in vars(found.law).items() if k != "reference_K"]
            truth = [v for k, v in vars(law).items() if k != "reference_K"]
            numbers += [*(np.abs(np.subtract(values, truth)) < 2.2 * found.law_sd)]
    assert np.mean(shifts) > 0.9
    assert np.mean(numbers) > 0.85
    assert chosen >= 8


def test_a_short_table_is_followed_by_fewer_terms_than_it_has_frequencies() -> None:
    """Seven storage moduli with 1 % noise are not met to less than that by as many terms; 17 terms are refused."""
    omega = 2 * np.pi * np.geomspace(0.01, 10, 7)
    for seed in range(5):
        true, modulus_Pa, rng = material(seed)
        exact = modulus_Pa * dynamic(true, omega)
        storage, loss = (part * (1 + 0.01 * rng.standard_normal(omega.size)) for part in (exact.real, exact.imag))
        table = Experiment("dma", np.zeros(omega.size), storage, source=("seven.csv",), facts={"table_of_E": 1.0},
                           sweep=Sweep(omega / (2 * np.pi), loss, np.zeros(omega.size, dtype=int), np.zeros(1)))
        found = fit_spectrum(table)
        assert max(tried for tried, *_ in found.orders) < omega.size
        assert found.relative_rms[0] > 1e-3
        whole = np.sqrt(np.mean(np.square(found.relative_rms)))  # channels of as many values
        assert min(abs(rms / whole - 1) for _, rms, _ in found.orders) < 1e-12
        assert found.modulus_sd_Pa > 2e-3 * found.modulus_Pa
        followed = found.modulus_Pa * dynamic(found.prony, omega)
        assert np.sqrt(np.mean((followed.real / exact.real - 1) ** 2)) < 0.02  # twice the noise
        with pytest.raises(ValueError, match=r"17 Prony terms need more than the 14 values of seven\.csv"):
            fit_spectrum(table, 17)


@pytest.mark.parametrize(("seed", "noise"), [(0, 0.0), (1, 0.0), (2, 0.003)])
def test_a_sweep_of_three_terms_gives_these_three(seed: int, noise: float) -> None:
    """At times that lie on no grid: within 1 %, where it is exact within 1e-5, and within three standard errors."""
    rng = np.random.default_rng(seed)
    true = Prony(rng.uniform(0.1, 0.25, 3), 10 ** (np.array([-2.5, -0.8, 0.6]) + rng.uniform(-0.3, 0.3, 3)))
    frequency = np.geomspace(0.01, 100, 25)
    z = 2e6 * dynamic(true, 2 * np.pi * frequency)
    storage, loss = (part * (1 + noise * rng.standard_normal(25)) for part in (z.real, z.imag))
    found = fit_spectrum(Experiment("dma", np.zeros(25), storage, source=("three.csv",), facts={"table_of_E": 1.0},
                                    sweep=Sweep(frequency, loss, np.zeros(25, dtype=int), np.zeros(0))))
    np.testing.assert_allclose(found.prony.tau_s, true.tau_s, rtol=0.01 if noise else 1e-5)
    np.testing.assert_allclose(found.prony.g, true.g, rtol=0.01 if noise else 1e-5)
    if noise:
        off = np.r_[found.prony.g - true.g, found.prony.tau_s - true.tau_s]
        sd = np.r_[found.g_sd, found.tau_sd_s]
        assert np.all(np.abs(off) < 3 * sd)
        assert 0.5 < np.sqrt(np.mean((off / sd) ** 2)) < 2
        assert abs(found.modulus_Pa - 2e6) < 3 * found.modulus_sd_Pa


def test_a_card_states_errors_of_times_that_were_searched_and_cautions_of_no_ramp() -> None:
    omega = 2 * np.pi * np.geomspace(0.1, 100, 20)
    z = 1e6 * dynamic(Prony(np.array([0.2]), np.array([0.03])), omega)
    rng = np.random.default_rng(5)
    storage, loss = (part * (1 + 0.002 * rng.standard_normal(20)) for part in (z.real, z.imag))
    card = make_card(calibrate([Experiment(
        "dma", np.zeros(20), storage, source=("one.csv",), facts={"table_of_E": 1.0},
        sweep=Sweep(omega / (2 * np.pi), loss, np.zeros(20, dtype=int), np.zeros(0)))]), [], 0)
    (sd,) = card.fit["prony"]["tau_sd_s"]
    assert 1e-5 < sd < 1e-3
    assert not any("ramp" in caution for caution in cautions(card))


def test_creep_and_relaxation_are_inverse() -> None:
    """s J~(s) s E~(s) = 1 at real s, for random series of one to eight terms; and the standard linear solid."""
    for seed in range(30):
        rng = np.random.default_rng(seed)
        times = 10 ** np.sort(rng.uniform(-3, 5, rng.integers(1, 9)))
        J_0, J = 10 ** rng.uniform(-7, -4), 10 ** rng.uniform(-8, -4, times.size)
        rest, moduli, tau = relaxation_of(J_0, J, times)
        s = np.logspace(-6, 4, 30)[:, None]
        creeping = J_0 + np.sum(J / (1 + times * s), axis=1)
        relaxing = rest + np.sum(moduli * tau * s / (1 + tau * s), axis=1)
        np.testing.assert_allclose(creeping * relaxing, 1, rtol=1e-8)
        assert np.all(moduli > 0)
        assert np.all(np.diff(tau) > 0)
        np.testing.assert_allclose(moduli.sum() + rest, 1 / J_0)
    rest, moduli, tau = relaxation_of(1.0, np.array([3.0]), np.array([8.0]))
    np.testing.assert_allclose([rest, moduli[0], tau[0]], [0.25, 0.75, 2.0])


@pytest.mark.parametrize("seed", range(5))
def test_a_creep_gives_the_relaxation(seed: int) -> None:
    rng = np.random.default_rng(seed)
    J_0, J, times = 6e-6, rng.uniform(1e-6, 6e-6, 2), 10 ** rng.uniform([-0.5, 1.5], [0.5, 2.5])
    t = np.geomspace(0.05, 3000, 100)
    compliance = J_0 - np.sum(J * np.expm1(-t[:, None] / times), axis=1)
    found = fit_spectrum(Experiment("creep", np.zeros(100), compliance * (1 + 0.002 * rng.standard_normal(100)), t,
                                    source=("creep",)))
    rest, moduli, tau = relaxation_of(J_0, J, times)
    truth = rest + np.sum(moduli * np.exp(-t[:, None] / tau), axis=1)
    np.testing.assert_allclose(found.modulus_Pa * relaxation(found.prony, t), truth, rtol=0.01)
    assert abs(found.modulus_Pa * J_0 - 1) < 3 * found.modulus_sd_Pa * J_0


def test_a_loss_modulus_of_another_material_does_not_pull_the_storage_modulus() -> None:
    true, modulus_Pa, rng = material(3)
    test = sweeps(true, modulus_Pa, Wlf(9.0, 110.0, 303.15), 0.002, rng)
    assert test.sweep is not None
    spoilt = replace(test, sweep=replace(test.sweep, loss_Pa=test.sweep.loss_Pa * 1.5))
    assert fit_spectrum(spoilt).relative_rms[0] < 0.01 < 0.1 < fit_spectrum(spoilt).relative_rms[1]


def test_two_dynamic_tests_and_a_creep_with_a_hold_are_refused() -> None:
    true, modulus_Pa, rng = material(0)
    test = sweeps(true, modulus_Pa, Wlf(9.0, 110.0, 303.15), 0.01, rng)
    creep = Experiment("creep", np.zeros(9), np.linspace(1e-6, 2e-6, 9), np.geomspace(1, 100, 9), source=("creep.csv",))
    for pair in ([test, test], [a_hold(true, modulus_Pa, rng), creep]):
        with pytest.raises(ValueError, match="one dynamic test is fitted with holds"):
            calibrate(pair)


def one_sweep(true: Prony, modulus_Pa: float, rng: np.random.Generator) -> Experiment:
    """Of 0.3 to 50 Hz with 1 % noise."""
    frequency = np.geomspace(0.3, 50, 14)
    z = modulus_Pa * dynamic(true, 2 * np.pi * frequency)
    storage, loss = (part * (1 + 0.01 * rng.standard_normal(14)) for part in (z.real, z.imag))
    return Experiment("dma", np.zeros(14), storage, source=("sweep.csv",), facts={"table_of_E": 1.0},
                      sweep=Sweep(frequency, loss, np.zeros(14, dtype=int), np.zeros(0)))


def a_hold(true: Prony, modulus_Pa: float, rng: np.random.Generator) -> Experiment:
    """After a ramp of 0.5 s, 200 s long, with 0.2 % noise, of a specimen that is stiffer by a fifth."""
    time = np.r_[np.linspace(0, 0.5, 40), 0.5 + np.geomspace(0.03, 200, 90)]
    strain = 0.01 * np.minimum(time / 0.5, 1)
    stress = push_forward("uniaxial", strain)[:, 0] * convolve(true, time, 1.2 * modulus_Pa * strain)
    noise = 0.002 * float(stress.max())
    return Experiment("relaxation", strain, stress + noise * rng.standard_normal(time.size), time,
                      source=("hold.csv",), noise=noise, held=(time > 0.5).astype(float))


@pytest.mark.slow
def test_a_hold_and_a_dynamic_test_give_one_series_that_each_alone_does_not() -> None:
    """Of a broad spectrum: the loss modulus at frequencies that only the hold sees, and the relaxation at times that
    only the sweep sees, lie within three standard errors and a few per cent; the moduli of both specimens come back."""
    true, modulus_Pa, rng = material(14)
    tests = [a_hold(true, modulus_Pa, rng), one_sweep(true, modulus_Pa, rng)]
    found = calibrate(tests)
    series, sweep = found.prony, found.spectrum
    assert series is not None
    assert sweep is not None
    assert found.joint is not None
    assert not found.joint.disagree

    def courses(law: Prony) -> np.ndarray:
        """ln of loss over storage at 0.02 to 0.2 Hz, of the relaxation at 5 to 100 ms over that at 1 s."""
        z, left = dynamic(law, 2 * np.pi * np.geomspace(0.02, 0.2, 5)), relaxation(law, [0.005, 0.02, 0.1, 1.0])
        return np.log(np.r_[z.imag / z.real, left[:3] / left[3]])

    vector, terms = np.r_[series.prony.g, series.prony.tau_s], series.prony.g.size
    moves = np.diag(1e-4 * vector)
    by_number = np.column_stack([(courses(Prony(*np.split(vector + m, 2))) - courses(Prony(*np.split(vector - m, 2))))
                                 / (2e-4 * v) for m, v in zip(moves, vector, strict=True)])
    error = courses(series.prony) - courses(true)
    sd = np.sqrt(np.diag(by_number @ series.covariance @ by_number.T))
    assert np.all(np.abs(error) < 3 * sd)
    assert np.abs(error[:5]).max() < 0.1
    assert np.abs(error[5:]).max() < 0.01
    alone = [fit_prony(tests[:1], None, terms).prony, fit_spectrum(tests[1]).prony]
    assert np.abs(courses(alone[0]) - courses(true))[5:].max() > 3 * np.abs(error[5:]).max()
    assert np.abs(courses(alone[1]) - courses(true))[:5].max() > 3 * np.abs(error[:5]).max()
    held_Pa = series.holds[0].instantaneous[-1] @ series.sizes[0]
    assert held_Pa / 0.01 / sweep.modulus_Pa == pytest.approx(1.2, rel=0.02)


def test_a_sweep_next_to_holds_doubts_its_shifts() -> None:
    """One column for each two neighbours, by which all sweeps past it move: in all the stated error of every shift."""
    true, modulus_Pa, rng = material(2)
    test = sweeps(true, modulus_Pa, Wlf(9.0, 110.0, 303.15), 0.01, rng)
    alone = fit_spectrum(test, reference_K=303.15)
    assert alone.shift is not None
    np.testing.assert_allclose((alone.shift.moves**2).sum(axis=1), alone.shift.sd**2)
    seen, law = seen_sweep(test, alone), Prony(np.array([0.6]), np.array([1e-3]))
    z = dynamic(law, seen.omega_rad_per_s)
    omega = seen.omega_rad_per_s * 1e-3
    by_ln_omega = 0.6 * np.r_[2 * omega**2 / (1 + omega**2) ** 2, omega * (1 - omega**2) / (1 + omega**2) ** 2]
    decades_moved = np.tile(np.repeat(alone.shift.moves, FREQUENCY.size, axis=0), (2, 1))
    expected = (seen.precision * seen.size(law) * by_ln_omega)[:, None] * np.log(10) * decades_moved
    np.testing.assert_allclose(seen.unit(law), np.r_[z.real, z.imag])
    np.testing.assert_allclose(seen.doubts(law), expected, atol=0.03 * np.abs(expected).max())


def test_tests_of_materials_that_relax_at_other_times_disagree() -> None:
    solid = Prony(np.array([0.3, 0.2]), np.array([0.05, 8.0]))
    rng = np.random.default_rng(6)
    for factor in (1.0, 3.0):
        pair = [a_hold(solid, 1e6, rng), one_sweep(Prony(solid.g, factor * solid.tau_s), 1e6, rng)]
        card = make_card(calibrate(pair), [], 0)
        joint = card.fit["prony"]["joint"]
        assert joint["disagree"] == (factor > 1)
        assert set(joint["relative_rms_alone"]) == {"relaxation_1", "storage", "loss"}
        assert any("relax differently" in c for c in cautions(card)) == joint["disagree"]


@pytest.mark.skipif(not PYVISCO.exists(), reason="third-party files are not here")
def test_the_master_curve_of_pyvisco_as_published() -> None:
    """One term a decade: E_0 = 1,739 MPa and every share as published, which pyvisco fits by absolute residuals."""
    folder = PYVISCO / "12_relaxation_modulus_master"
    published = np.genfromtxt(folder / "published_prony.csv", delimiter=",")
    test = reduce_tests([("relaxation", (folder / "time_user_master.csv",))])
    found = calibrate(test, FitOptions(prony_times_s=tuple(published[:, 1]))).prony
    assert found is not None
    assert found.start_modulus(0)[0] == pytest.approx(1739.03e6, rel=2e-4)
    np.testing.assert_allclose(found.prony.g, published[:, 0], atol=2e-4)


@pytest.mark.skipif(not PYVISCO.exists(), reason="third-party files are not here")
def test_the_sweeps_of_pyvisco_shift_as_published_where_they_flow() -> None:
    """log10 a_T from 3 to 55 C, where storage moduli change most, within 0.05 decades of those published with the data.

    The published ones are of storage moduli alone. pyvisco's rule, the mean distance of two power laws, misses them on
    the same data by 0.07 decades from 3 to 55 C and by up to 0.67 in the glass; this program by 0.05 and 0.36. In the
    glass both leave the same misfit between neighbours, so the data do not say which is right; above 55 C these shifts
    leave less.
    """
    published = {3: 0.0, 10: -1.4985, 18: -3.1242, 25: -4.7738, 32: -6.5205, 40: -8.3648, 47: -10.1402, 55: -11.4439}
    test = reduce_tests([(None, (PYVISCO / "13_dma_sweep_csv/freq_user_raw.csv",))])
    shift = fit_spectrum(test[0], reference_K=276.15).shift
    assert shift is not None
    by_sweep = dict(zip(np.round(shift.temperature_K - 273.15).astype(int), shift.log10_a, strict=True))
    for celsius, decade in published.items():
        assert min(abs(v - decade) for t, v in by_sweep.items() if abs(t - celsius) <= 1) < 0.05


@pytest.mark.parametrize("outlier", [0.0, 8.0])
def test_a_shift_is_that_of_weighted_least_squares_with_its_variance(outlier: float) -> None:
    """Two sweeps on a line of slope b with residuals of one size, whose weights are 1; a residual beyond 1.5 of 1.4826
    times the median counts by what it exceeds that. Variance: square / (n - 3) over the curvature by the shift."""
    rng, shift, (a, b) = np.random.default_rng(2), 0.7, (3.0, 0.5)
    x = np.linspace(0.0, 3.0, 12)
    off = 0.01 * rng.permutation(np.resize([1.0, -1.0], 24))
    off[5] *= 1 + outlier
    y = np.split(np.r_[a + b * x, a + b * (x + shift)] + off, 2)
    _, by, variance = _by_degree([x, x], y, np.array([9.0]), 1, shift)

    def left(p: np.ndarray) -> np.ndarray:
        return np.r_[y[0] - p[0] - p[1] * x, y[1] - p[0] - p[1] * (x + p[2])]

    weight, p = np.ones(24), np.array([a, b, shift])
    for _ in range(60):
        p = least_squares(lambda q, w=weight: np.sqrt(w) * left(q), p, xtol=1e-14, ftol=1e-14).x
        size = np.abs(left(p))
        weight = 1 / np.maximum(1.0, size / (1.5 * 1.4826 * np.median(size)))
    slope = np.sqrt(weight)[:, None] * np.array([np.ones(24), np.r_[x, x + p[2]], np.repeat([0.0, p[1]], 12)]).T
    expected = weight @ left(p) ** 2 / 21 * np.linalg.inv(slope.T @ slope)[2, 2]
    assert (weight < 1).any() == (outlier > 0)
    assert by == pytest.approx(p[2], abs=1e-6)
    assert variance == pytest.approx(expected, rel=1e-3)


def test_a_series_without_given_times_has_the_terms_that_are_seen_alone() -> None:
    """Of a standard solid, whose other times have no share; given times are all kept, 0 among their shares."""
    time = np.geomspace(1.0, 1e4, 80)
    test = Experiment("creep", np.zeros(80), 2e-6 - 1e-6 * np.expm1(-time / 100.0), time, source=("creep",))
    found = fit_spectrum(test)
    assert (found.prony.g > 0).all()
    assert found.covariance.shape == (2 * found.prony.g.size,) * 2
    assert found.modulus_Pa == pytest.approx(5e5, rel=1e-3)
    assert found.prony.g.sum() == pytest.approx(1 / 3, rel=1e-3)


def test_a_material_that_flows_keeps_the_least_share_at_rest() -> None:
    """Of a Maxwell fluid of two terms shares of the whole modulus, with a thousandth of a millionth left."""
    omega, m, tau = 2 * np.pi * np.geomspace(1e-3, 1e2, 60), np.array([3e5, 1e5]), np.array([0.1, 10.0])
    turn = 1j * omega[:, None] * tau
    z = (turn / (1 + turn)) @ m
    test = Experiment("dma", np.zeros(60), z.real, source=("flows",), facts={"table_of_E": 1.0},
                      sweep=Sweep(omega / (2 * np.pi), z.imag, np.zeros(60, dtype=int), np.array([293.15])))
    found = fit_spectrum(test, times_s=(0.1, 10.0))
    assert 1 - found.prony.g.sum() == pytest.approx(1e-9, rel=1e-3)
    assert found.prony.g == pytest.approx([0.75, 0.25], rel=1e-6)
