"""Held touches against the elastic ones that stand for them near edges, together and with friction.

Lone touches drawn from a seed, without friction, are stepped in time; at every time of the hold an elastic touch of the
instantaneous law is solved at the same depth. Differences are of the moments of the strains about the punch, which make
dV to first order, and of the strains over the surface (L2), by what drives the skin; `share` is the held force over the
elastic one. Run by `make bench`; writes results/elastic_holds.csv next to this file.
"""

import time
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from conditions import quick, written

from eitsim.mechanics.axisymmetric.hold import solve_hold
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.scene.results import Touch
from eitsim.scene.scene import STRAINS, Body, Hold, Punch
from eitsim.sheet.sheet_conductance import driving_strains, stretches
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.arrays import Array
from touchcal.errors import NotConverged

FOAM = Hyperfoam([14420.0, 16780.0, -21670.0], [0.288, 4.249, 0.741], [0.0, 0.0, 0.0], "instantaneous")
TOUCHES, SEED = quick(24, 2), 11


def drawn(rng: np.random.Generator) -> tuple[Body, Punch, Hold, Prony]:
    """A touch, its hold and a series that lets go of 20 to 60 % of the stress."""
    thickness, width = rng.uniform(4e-3, 16e-3), rng.uniform(6e-3, 20e-3)
    profile = str(rng.choice(["flat", "sphere", "cone"], p=[0.6, 0.25, 0.15]))
    load = {"depth_m": rng.uniform(0.1, 0.4) * thickness} if rng.random() < 0.3 else {
        "force_N": rng.uniform(0.1, 1.2) * (width / 0.014) ** 2}
    control, loading = str(rng.choice(["force", "depth"])), float(rng.choice([0.5, 1, 5]))
    hold = Hold(time_s=(2.0, 60.0), control=control, loading_s=loading)
    weights = rng.dirichlet([1.0, 1.0]) * rng.uniform(0.2, 0.6)
    return (Body(thickness_m=thickness), Punch(0.0, 0.0, width, profile=profile, **load), hold,
            Prony(weights, [10 ** rng.uniform(-1, 0.5), 10 ** rng.uniform(0.5, 2)]))


def differences(held: Touch, elastic: Touch) -> dict[str, float]:
    """Relative differences of the moments and of the strains, by what drives the skin."""
    radius = np.linspace(0, float(held.radius_m[-1]), 6001)[1:]
    one, other = (driving_strains(*stretches(touch, radius)) for touch in (held, elastic))

    def share(away: Array, whole: Array) -> float:
        return float(away / whole) if whole > 0 else np.nan

    out = {}
    for k, strain in enumerate(STRAINS):
        away, whole = one[k] - other[k], other[k]
        out[f"moment_{strain}"] = share(abs(radius @ away), abs(radius @ whole))
        out[f"strain_{strain}"] = share(np.sqrt(radius @ away**2), np.sqrt(radius @ whole**2))
    return out


def rows() -> Iterator[dict[str, object]]:
    rng = np.random.default_rng(SEED)
    for number in range(TOUCHES):
        body, punch, hold, series = drawn(rng)
        begun = time.process_time()
        try:
            held = solve_hold(FOAM, series, body, punch, hold)
            for at, touch in held:
                elastic = solve_touch(FOAM, body, replace(punch, force_N=None, depth_m=touch.depth_m))
                yield {"touch": number, "profile": punch.profile, "control": hold.control, "loading_s": hold.loading_s,
                       "time_s": at, "depth": touch.depth_m / body.thickness_m,
                       "share": touch.force_N / elastic.force_N, **differences(touch, elastic),
                       "cpu_s": time.process_time() - begun}
        except NotConverged as error:
            print(f"touch {number} is left out: {error}")


if __name__ == "__main__":
    table = written(rows(), "elastic_holds")
    print(table.filter(regex="moment|strain").describe().loc[["count", "50%", "max"]].T.to_string())
