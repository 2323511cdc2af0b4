"""Rubbers in every mode: work against energy, the limit of a stiff volume, closed forms from the literature."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from matcal.laws.deformation_modes import MODES, log_stretches, nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import with_vector
from matcal.laws.neo_hooke import NeoHooke
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.mooney_rivlin_5 import MooneyRivlin5
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.laws.stability import stability
from matcal.laws.volumetric import nearly_incompressible

RUBBERS = {law.name: law for law in (
    NeoHooke(3e5, 0.5), MooneyRivlin(2e5, 3e4), MooneyRivlin5(2e5, 3e4, 1e3, -2e2, 30.0), Yeoh(2e5, -2e3, 40.0),
    Ogden([4e5, 3e3, 2e4], [1.3, 5.0, -2.0]), Gent(3e5, 60.0), ArrudaBoyce(3e5, 4.0),
    ExtendedTube(2e5, 0.09, 2e5, 0.3))}
STRETCH = np.array([0.6, 0.9, 1.3, 2.0, 2.8])


@pytest.fixture(params=RUBBERS.values(), ids=RUBBERS.keys())
def law(request):
    return request.param


@pytest.mark.parametrize("mode", MODES[:-1])
def test_the_stress_of_each_mode_does_the_work_of_the_energy(law, mode) -> None:
    """dU/de = P, and 2 P of two driven faces, along states that keep the volume."""
    strain, step = STRETCH - 1, 1e-5
    high, low = (law.energy(log_stretches(law, mode, strain + s)) for s in (step, -step))
    work = (high - low) / (2 * step) / (2 if mode == "biaxial" else 1)
    np.testing.assert_allclose(nominal_stress(law, mode, strain), work, rtol=1e-6, atol=1e-6 * law.mu_0_Pa)


@pytest.mark.parametrize("mode", MODES[:-1])
def test_a_stiff_volume_ends_in_one_that_is_kept(law, mode) -> None:
    strain = STRETCH - 1
    miss = [np.abs(nominal_stress(nearly_incompressible(law, nu), mode, strain) / nominal_stress(law, mode, strain) - 1)
            for nu in (0.4999, 0.49999)]
    assert np.max(miss[0]) < 5e-3
    np.testing.assert_allclose(miss[1], miss[0] / 10, rtol=0.2, atol=1e-9)


def test_the_volume_alone_has_its_own_law(law) -> None:
    with pytest.raises(ValueError, match="keeps its volume"):
        nominal_stress(law, "volumetric", 0.98)
    finite = nearly_incompressible(law)
    assert finite.kappa_0_Pa == pytest.approx(1000 * law.mu_0_Pa, rel=2e-3)
    if law.keeps_volume:
        assert nominal_stress(finite, "volumetric", 0.98) == pytest.approx(-0.02 * finite.kappa_0_Pa, rel=1e-9)
    assert set(stability(law)["drucker"]) == set(MODES[:-1])


def test_two_constants_are_five_and_one_exponent_pair() -> None:
    """Ogden with alpha 2 and -2 is Mooney-Rivlin: c_10 = mu_1/2, c_01 = mu_2/2; Yeoh without the others neo-Hooke."""
    pairs = [(MooneyRivlin(2e5, 3e4), MooneyRivlin5(2e5, 3e4, 0.0, 0.0, 0.0)),
             (MooneyRivlin(2e5, 3e4), Ogden([4e5, 6e4], [2.0, -2.0])), (NeoHooke(4e5, 0.5), Yeoh(2e5, 0.0, 0.0)),
             (NeoHooke(4e5, 0.5), Gent(4e5, 1e9)), (NeoHooke(4e5, 0.5), ArrudaBoyce(4e5, 1e4)),
             (MooneyRivlin(2e5, 3e4), ExtendedTube(4e5, 0.0, 6e4, 2.0))]
    for one, other in pairs:
        for mode in MODES[:-1]:
            np.testing.assert_allclose(nominal_stress(one, mode, STRETCH - 1), nominal_stress(other, mode, STRETCH - 1),
                                       rtol=1e-6)


def test_ogdens_own_constants_give_his_formula() -> None:
    """Ogden 1972, in kg/cm2: mu = 6.3, 0.012, -0.1, alpha = 1.3, 5, -2; his mu_i is 2 mu_i/alpha_i of here."""
    own, alpha = np.array([6.3, 0.012, -0.1]), np.array([1.3, 5.0, -2.0])
    law = Ogden(own * alpha / 2, alpha)
    stretch = np.array([1.5, 4.0, 7.6])
    expected = (own * (stretch[:, None] ** (alpha - 1) - stretch[:, None] ** (-alpha / 2 - 1))).sum(axis=1)
    np.testing.assert_allclose(nominal_stress(law, "uniaxial", stretch - 1), expected, rtol=1e-12)


def test_eight_chains_have_abaquss_modulus() -> None:
    """mu_0 = mu (1 + 3/(5 l^2) + 99/(175 l^4) + 513/(875 l^6) + 42039/(67375 l^8))."""
    l2 = 2.5**-2
    expected = 1 + 3 / 5 * l2 + 99 / 175 * l2**2 + 513 / 875 * l2**3 + 42039 / 67375 * l2**4
    assert ArrudaBoyce(1.0, 2.5).mu_0_Pa == pytest.approx(expected, rel=1e-12)
    tube = ExtendedTube(2.0, 0.3, 5.0, 0.4)
    assert tube.mu_0_Pa == pytest.approx(2.0 * (1 - 2 * 0.09) + 5.0, rel=1e-12)


def test_a_law_that_keeps_its_volume_is_a_rubbers() -> None:
    assert [law.body for law in (NeoHooke(1e4, 0.5), NeoHooke(1e4, 0.3), Yeoh(1e4, 0.0, 0.0, 0.499),
                                 Hyperfoam([1e4], [2.0], [0.0]))] == ["rubber", "foam", "rubber", "foam"]


def test_chains_that_are_straight_have_no_state() -> None:
    for rubber, limit in ((Gent(1.0, 10.0), 10.0), (ExtendedTube(1.0, 10**-0.5, 1.0, 0.5), 10.0)):
        at = log_stretches(rubber, "uniaxial", np.array([2.4, 2.6]))
        assert (np.exp(2 * at).sum(axis=1) - 3 < limit).tolist() == [True, False]
        assert np.isfinite(rubber.energy(at)).tolist() == [True, False]


@pytest.mark.parametrize("share", [0.0, 0.3])
def test_blatz_ko_is_a_hyperfoam(share) -> None:
    """Blatz & Ko 1962 at nu = 1/4, f its share of I_1: terms alpha = 2 and -2, so that it needs no law of its own."""
    mu, beta = 5e3, 0.5
    law = with_vector(Hyperfoam([1.0, 1.0], [2.0, -2.0], [0.25, 0.25]),
                      [max(share, 1e-12) * mu, (1 - share) * mu, 2, -2, 0.25, 0.25])
    x = np.random.default_rng(0).uniform(-0.5, 0.5, (20, 3))
    squares, j = np.exp(2 * x), np.exp(x.sum(axis=1))
    expected = mu / 2 * (share * (squares.sum(axis=1) - 3 + (j ** (-2 * beta) - 1) / beta)
                         + (1 - share) * ((1 / squares).sum(axis=1) - 3 + (j ** (2 * beta) - 1) / beta))
    np.testing.assert_allclose(law.energy(x), expected, rtol=1e-9)


ENERGY = """
import sys
from matcal.laws.compiled_response import energies
from matcal.laws.known_laws import law_of
for name, values in (("gent", [[1.0], [20.0], [0.4995]]), ("yeoh", [[0.5], [0.1], [0.01], [0.4995]])):
    if name in sys.argv:
        law, x = law_of(name, values), [[0.1, -0.05, -0.04]]
        import numpy
        assert numpy.allclose(energies(law, numpy.array(x)), law.energy(x), rtol=1e-12), name
"""


@pytest.mark.thorough
def test_laws_that_were_compiled_by_different_processes_serve_one(tmp_path: Path) -> None:
    """Numba links kept code by names, and functions of one name from two files would be taken for one another."""
    for names in (["gent"], ["yeoh"], ["gent", "yeoh"]):
        subprocess.run([sys.executable, "-c", ENERGY, *names], check=True,
                       env=os.environ | {"NUMBA_CACHE_DIR": str(tmp_path)})
