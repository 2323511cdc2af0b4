"""Columns of dynamic tests by the names and units that instruments and people give them."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from matcal.reduction.reduce import reduce_tests
from touchcal.errors import InputFileError

FREQUENCY = np.geomspace(0.1, 10, 7)
STORAGE, LOSS = 1e6 * FREQUENCY**0.1, 2e5 * FREQUENCY**0.05


def table(folder: Path, names: str, units: str, *columns: np.ndarray) -> Path:
    path = folder / "sweep.csv"
    rows = "".join(",".join(f"{v:.10g}" for v in row) + "\n" for row in zip(*columns, strict=True))
    path.write_text(f"{names}\n{units}\n{rows}", encoding="utf-8")
    return path


@pytest.mark.parametrize(("names", "units", "scale"), [
    ("Frequency,Storage modulus,Loss modulus", "Hz,Pa,Pa", (1, 1, 1)),
    ("Angular frequency,G',G''", "rad/s,kPa,kPa", (2 * np.pi, 1e-3, 1e-3)),
    ("omega,G_stor,G_loss", "1/s,MPa,MPa", (2 * np.pi, 1e-6, 1e-6)),
    ("Frequenz,Speichermodul,Verlustmodul", "Hz,MPa,MPa", (1, 1e-6, 1e-6)),
    ("f,E',E\"", "mHz,Pa,Pa", (1e3, 1, 1)),
])
def test_a_sweep_is_read_whatever_its_columns_are_called(names: str, units: str, scale: tuple[float, ...],
                                                         tmp_path: Path) -> None:
    path = table(tmp_path, names, units, *(s * c for s, c in zip(scale, (FREQUENCY, STORAGE, LOSS), strict=True)))
    (found,) = reduce_tests([(None, (path,))])
    assert found.kind == "dma"
    assert found.sweep is not None
    np.testing.assert_allclose([found.sweep.frequency_Hz, found.value, found.sweep.loss_Pa],
                               [FREQUENCY, STORAGE, LOSS], rtol=1e-9)


@pytest.mark.parametrize(("names", "units", "per"), [
    ("Period,Storage modulus,Loss modulus", "s,Pa,Pa", 1.0), ("Periodendauer,K',K''", "ms,N/mm,N/mm", 1e3),
    ("period,Dynamic stiffness,Loss factor", "s,kN/m,-", 1.0)])
def test_a_period_and_a_stiffness_give_the_same_series(names: str, units: str, per: float, tmp_path: Path) -> None:
    stiff, of = "Pa" not in units, 2e-2
    first = np.hypot(STORAGE, LOSS) if "Loss factor" in names else STORAGE
    second = LOSS / STORAGE if "Loss factor" in names else LOSS * (1e-3 * of if stiff else 1)
    path = table(tmp_path, names, units, per / FREQUENCY, first * (1e-3 * of if stiff else 1), second)
    (found,) = reduce_tests([(None, (path,))])
    assert found.sweep is not None
    scale = STORAGE.max() if stiff else 1.0
    np.testing.assert_allclose([found.sweep.frequency_Hz, found.value, found.sweep.loss_Pa],
                               [FREQUENCY, STORAGE / scale, LOSS / scale], rtol=1e-8)
    assert ("table_normalised" in found.facts) == stiff
    with pytest.raises(InputFileError, match=r"storage|unit|fewer"):  # a modulus is no stiffness
        reduce_tests([(None, (table(tmp_path, "f,Storage modulus,Loss modulus", "Hz,N/mm,N/mm", FREQUENCY, STORAGE,
                                    LOSS),))])


@pytest.mark.parametrize("names", ["E',tan delta", "|E*|,tan(delta)", "E'',tan_d", "E',loss factor η"])
def test_the_loss_tangent_gives_the_modulus_that_is_missing(names: str, tmp_path: Path) -> None:
    tangent = LOSS / STORAGE
    first = {"E'": STORAGE, "|E*|": np.hypot(STORAGE, LOSS), "E''": LOSS}[names.split(",")[0]]
    path = table(tmp_path, f"frequency,{names}", "Hz,Pa,-", FREQUENCY, first, tangent)
    (found,) = reduce_tests([("dma", (path,))])
    assert found.sweep is not None
    np.testing.assert_allclose([found.value, found.sweep.loss_Pa], [STORAGE, LOSS], rtol=1e-8)


@pytest.mark.parametrize(("names", "units"), [("f,|G*|,Phase", "Hz,Pa,deg"), ("f,E*,loss angle", "Hz,Pa,rad")])
def test_the_phase_is_the_angle_of_the_loss_tangent(names: str, units: str, tmp_path: Path) -> None:
    phase = np.arctan2(LOSS, STORAGE) * (180 / np.pi if units.endswith("deg") else 1)
    (found,) = reduce_tests([(None, (table(tmp_path, names, units, FREQUENCY, np.hypot(STORAGE, LOSS), phase),))])
    assert found.sweep is not None
    np.testing.assert_allclose([found.value, found.sweep.loss_Pa], [STORAGE, LOSS], rtol=1e-8)
    with pytest.raises(InputFileError, match=r"no unit.*loss_tangent=3:deg"):
        reduce_tests([(None, (table(tmp_path, "f,|G*|,phase", "Hz,Pa,", FREQUENCY, STORAGE, phase),))])


def test_a_logarithm_is_asked_for_as_the_number(tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match="'log f' is a logarithm: give the number itself"):
        reduce_tests([("dma", (table(tmp_path, "log f,E',E''", "-,Pa,Pa", np.log10(FREQUENCY), STORAGE, LOSS),))])


@pytest.mark.parametrize(("unit", "of"), [("C", lambda k: k - 273.15), ("K", lambda k: k),
                                          ("°F", lambda k: 1.8 * k - 459.67)])
def test_rows_of_one_temperature_are_one_sweep_in_any_order_and_unit(unit: str, of, tmp_path: Path) -> None:
    rng = np.random.default_rng(0)
    means = np.array([313.15, 293.15, 303.15])
    kelvin = np.repeat(means, 7) + rng.uniform(-0.2, 0.2, 21)
    path = table(tmp_path, "f,E_stor,E_loss,T", f"Hz,Pa,Pa,{unit}", np.tile(FREQUENCY, 3), np.tile(STORAGE, 3),
                 np.tile(LOSS, 3), of(kelvin))
    (found,) = reduce_tests([(None, (path,))])
    assert found.sweep is not None
    np.testing.assert_allclose(found.sweep.temperature_K, np.sort(means), atol=0.2)
    assert [*np.bincount(found.sweep.group)] == [7, 7, 7]
    assert [*found.sweep.group[::7]] == [2, 0, 1]


def test_a_sweep_given_as_another_kind_is_refused(tmp_path: Path) -> None:
    path = table(tmp_path, "f,G',G''", "Hz,Pa,Pa", FREQUENCY, STORAGE, LOSS)
    with pytest.raises(InputFileError, match=r"dma=sweep\.csv"):
        reduce_tests([("relaxation", (path,))])
