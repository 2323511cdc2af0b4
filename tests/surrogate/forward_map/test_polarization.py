import numpy as np

from surrogate.data.edge_frame import edge_frame
from surrogate.data.sensor_ring import Ring
from surrogate.forward_map import multipole_series, polarization
from surrogate.statistics import coefficient_process
from surrogate.statistics.coefficient_process import SharedProcess
from touchcal.arrays import Array


def test_rows_that_single_determine_little_teach_coefficients_together() -> None:
    """Two readings a row, three smooth coefficients: no row determines its own, all together do, and the gradient."""
    rng = np.random.default_rng(0)
    x, design = rng.random((300, 2)), rng.normal(size=(300, 2, 3))

    def truth(at: Array) -> Array:
        return np.column_stack([np.sin(2 * at[:, 0]), at[:, 1] ** 2, 1 + at.sum(1)])

    process = coefficient_process.fit(x, design, (design @ truth(x)[..., None])[..., 0], np.ones(2), x[:, 0])
    at = 0.1 + 0.8 * rng.random((20, 2))
    mean, gradient = coefficient_process.predict(process, at)
    assert np.allclose(mean, truth(at), atol=2e-3)
    for j, h in enumerate(1e-5 * np.eye(2)):
        change = (
            coefficient_process.predict(process, at + h)[0] - coefficient_process.predict(process, at - h)[0]
        ) / 2e-5
        assert np.allclose(gradient[..., j], change, atol=1e-5)


def test_readings_that_share_an_error_are_one_observation() -> None:
    """100 readings of a row that are off together by a standard deviation of 0.1 say no more than one: rows are
    smoothed, and the coefficient errs by half of what a row does."""
    x = np.linspace(0, 1, 60)[:, None]
    errors = []
    for seed in range(3):
        off = 0.1 * np.random.default_rng(seed).normal(size=60)
        rows = (np.sin(2 * x[:, 0]) + off)[:, None] * np.ones(100)
        process = coefficient_process.fit(x, np.ones((60, 100, 1)), rows, np.array([0.1]), x[:, 0])
        errors.append(coefficient_process.predict(process, x)[0][:, 0] - np.sin(2 * x[:, 0]))
    error = np.sqrt(np.mean(np.square(errors)))
    print("RMS error of the coefficient:", error)
    assert error < 0.055


def test_signals_of_a_bilinear_form_give_it_back(ring: Ring) -> None:
    """Coefficients that are linear in log d, load and the gap's logarithm lie in the span of the trend, so rows of
    exact signals determine them at any other touch; the signals have no other part that could be learned instead."""
    rng = np.random.default_rng(0)
    z = np.asarray(rng.uniform(0.45, 0.85, 500) * np.exp(2j * np.pi * rng.random(500)), np.complex128)
    punch = np.column_stack([np.log(rng.uniform(10, 18, 500)), rng.uniform(0.2, 2.0, 500)])
    dipole, count = rng.uniform(0.5, 2.0, 500), 2 * len(polarization.pairs(polarization.RIM[0]))
    weights = np.vstack([rng.normal(size=(4, count)) * np.array([[1.0], [0.3], [0.3], [0.3]]), np.zeros((2, count))])
    truth = SharedProcess(np.zeros((1, 4)), np.array([2.6, 1.0, -1.5, 0.0]), np.array([1.0, 1.0, 0.5, 1.0]), weights)
    side = np.zeros(500)
    fields = multipole_series.electrode_fields(ring, ring.modes, z, polarization.RIM[0] + 1)
    signal = polarization.effect(truth, ring, fields, edge_frame(ring, z), punch, side).value * dipole[:, None]
    taught, asked = np.arange(400), np.arange(400, 500)
    learned = polarization.fit(ring, ring.modes, z[taught], punch[taught], side[taught], signal[taught],
                               dipole[taught], np.linalg.norm(signal[taught], axis=1))
    effect = polarization.effect(learned, ring, fields[:, asked], edge_frame(ring, z[asked]), punch[asked], side[asked])
    found = effect.value * dipole[asked, None]
    error = np.linalg.norm(found - signal[asked], axis=1) / np.linalg.norm(signal[asked], axis=1)
    print("relative error, median and largest:", np.median(error), error.max())
    assert error.max() < 1e-5
