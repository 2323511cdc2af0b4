"""Intervals of six rubber laws against the truth, 50 sets each: noise that is white or correlated, or a strain zero off
by as much as `strain_zero_sd` states."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.signal import lfilter

from matcal.fitting.calibrate import calibrate
from matcal.fitting.fit_options import FitOptions
from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import weigh
from matcal.fitting.uncertainty.intervals import intervals, linearised
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.rubbers.arruda_boyce import ArrudaBoyce
from matcal.laws.rubbers.extended_tube import ExtendedTube
from matcal.laws.rubbers.gent import Gent
from matcal.laws.rubbers.mooney_rivlin import MooneyRivlin
from matcal.laws.rubbers.ogden import Ogden
from matcal.laws.rubbers.yeoh import Yeoh
from matcal.reduction.experiment import Experiment

LAWS = (MooneyRivlin(9e4, 2e4), Yeoh(1e5, -1e3, 60.0), Ogden([1.5e5, 4e3], [1.7, 5.0]), Gent(2e5, 40.0),
        ArrudaBoyce(2e5, 3.0), ExtendedTube(1e5, 0.15, 1e5, 0.4))
STRAIN = {"uniaxial": np.linspace(0.02, 2.5, 80), "biaxial": np.linspace(0.02, 1.2, 60)}
SETS, ZERO = 50, 0.004  # and the standard deviation of a strain zero


def noise(kind: str, size: int, draw: np.random.Generator) -> np.ndarray:
    """Standard deviation 1, white or correlated over some six points."""
    if kind == "correlated":
        return lfilter([np.sqrt(1 - 0.85**2)], [1, -0.85], draw.normal(size=size + 50))[50:]
    return draw.normal(size=size)


def inside(law, kind: str) -> tuple[float, float]:
    """Share of sets whose 95 % intervals hold mu_0, and planar stress at a strain of one."""
    hits = []
    for seed in range(SETS):
        draw = np.random.default_rng(seed)
        tests = []
        for mode, strain in STRAIN.items():
            stress = nominal_stress(law, mode, strain)
            error = 0.01 * float(np.sqrt(np.mean(stress**2))) * noise(kind, strain.size, draw)
            off = ZERO * draw.normal() if kind == "zero" else 0.0
            tests.append(Experiment(mode, strain + off, stress + error))
        order = np.size(getattr(law, "alpha", 1)) if law.name == "ogden" else "auto"
        if kind == "zero":
            about = calibrate(tests, FitOptions(law=law.name, order=order, strain_zero_sd=ZERO)).uncertainty
        else:
            about = linearised(fit_law(weigh(tests), type(law), {}, order, thorough=False))
        assert about is not None
        found = intervals(about, lambda one: {"mu_0": one.mu_0_Pa, "planar": float(nominal_stress(one, "planar", 1.0))})
        truth = {"mu_0": law.mu_0_Pa, "planar": float(nominal_stress(law, "planar", 1.0))}
        hits.append([found[name].lo < truth[name] < found[name].hi for name in truth])
    first, second = np.mean(hits, axis=0)
    print(f"{law.name}, {kind}: mu_0 {first:.0%}, planar {second:.0%}")
    return float(first), float(second)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "correlated", "zero"])
@pytest.mark.parametrize("law", LAWS, ids=lambda law: law.name)
def test_intervals_hold_the_truth(law, kind) -> None:
    """Of 50 sets with 95 % each at least 42 hold in 99.5 of 100 runs."""
    assert min(inside(law, kind)) >= 42 / SETS
