"""Relaxation where the times of a Prony series lie far apart, or far from the steps of a test or of a hold.

A ramp of 100 steps and a hold of 100 in simple shear, in a law whose stress is linear in the shear (alpha = 2, nu = 0),
so that the hereditary integral has a closed form; the error is the largest over the history, relative to the largest
stress. Then touches held under their force, whose creep is solved in steps of time. Run by `make bench`; writes
results/relaxation_stiff.csv.
"""

from collections.abc import Iterator
from functools import partial

import numpy as np
from conditions import quick, shown, written
from materials import SKIN_LAW, TABLE_1
from numpy.typing import NDArray
from timing import least_cpu_s

from eitsim.scene.scene import Hold, Punch, Scene
from eitsim.simulation.simulate import simulate
from matcal.card import MaterialCard
from matcal.laws.deformation_modes import hereditary_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony

RATIOS = (1.0, 1e3, 1e6, 1e9, 1e12)
STEPS = (1e-9, 1e-6, 1e-3, 1.0, 1e3, 1e6)
CREEPING = quick((1.0, 1e3, 1e6, 1e9), (1e3,))
SHARES, MODULUS_Pa, COUNT = np.array([0.4, 0.5]), 1e4, 100


def closed_form(prony: Prony, t: NDArray[np.float64], ramp_s: float) -> NDArray[np.float64]:
    """Stress over the modulus of a ramp to a shear of 1 in `ramp_s` and a hold, (n,), in extended precision."""
    now, end = t.astype(np.longdouble), np.longdouble(ramp_s)
    loaded = np.minimum(now, end)
    out = loaded.copy()
    for g, tau in zip(prony.g, prony.tau_s.astype(np.longdouble), strict=True):
        remembered = tau * np.exp(-(now - loaded) / tau) * -np.expm1(-loaded / tau)
        out -= g * (loaded - remembered)
    return np.asarray(out / end, dtype=float)


def histories() -> Iterator[dict[str, object]]:
    law = Hyperfoam([MODULUS_Pa], [2.0], [0.0], "instantaneous")
    for ratio in RATIOS:
        for step in STEPS:
            prony = Prony(SHARES, np.array([1.0, ratio]) * (1.0 if ratio > 1 else np.array([1.0, 1.0 + 1e-9])))
            t = step * np.arange(2 * COUNT + 1)
            convolved = partial(hereditary_stress, law, prony, "shear", t, np.minimum(t / t[COUNT], 1.0))
            found = convolved() / MODULUS_Pa
            expected = closed_form(prony, t, float(t[COUNT]))
            yield {"what": "history in shear", "ratio": ratio, "step_over_tau_1": step, "outcome": "ok",
                   "error": np.abs(found - expected).max() / np.abs(expected).max(), "cpu_s": least_cpu_s(convolved)}


def creeps() -> Iterator[dict[str, object]]:
    """Touches under a force; the error is what the result states of the depth."""
    foam = Hyperfoam(TABLE_1.mu_Pa, TABLE_1.alpha, TABLE_1.nu, "instantaneous")
    for ratio in CREEPING:
        card = MaterialCard("Table 1", foam, Prony(np.array([0.1, 0.1]), np.array([1.0, 1.5 * ratio])), SKIN_LAW)
        scene = Scene(punches=(Punch(0.02, -0.01, 0.014, 1.0),), hold=Hold(time_s=(2.0, 60.0), control="force"))
        result = simulate(scene, card)
        yield {"what": "touch held at 1 N", "ratio": 1.5 * ratio, "step_over_tau_1": np.nan, "outcome": result.outcome,
               "error": result.numerical_error.get("depth"), "cpu_s": result.cost["cpu_s"]}


def main() -> None:
    shown(written([*histories(), *creeps()], "relaxation_stiff", 3))


if __name__ == "__main__":
    main()
