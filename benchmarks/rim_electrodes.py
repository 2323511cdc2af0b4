"""What rigid electrodes on the rim change of a touch, against what the rim itself changes.

A strip as wide as an electrode and as high as given, bonded to the side of the foam where the rim is nearest to the
punch and free to move, is STIFF times as stiff as the foam; one as high as the foam is bonded to the ground too. It
stands in the part of the circles about the punch that the rim cuts off, where the problem of the clipped disc has a
weak tie only. "electrode" and "rim" are relative differences of the 208 touch signals (2-norm) at the worst bearing,
with and without the strip, and with and without the rim; empty where the solution is not found. Run by `make bench`,
which pins threads; writes results/rim_electrodes.csv.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pandas as pd
from conditions import quick, shown, written
from materials import TABLE_1
from rim import at

from eitsim.electrics.forward.nominal_sensor import signal_differences
from eitsim.mechanics.axisymmetric.indentation import IndentationProblem
from eitsim.mechanics.axisymmetric.solve_axisymmetric import solve_touch
from eitsim.mechanics.harmonics.arcs import AngularQuadrature, OffsetDisc, harmonics_at
from eitsim.mechanics.harmonics.clipped_disc import ClippedDisc, clipped_disc
from eitsim.mechanics.harmonics.equilibrium import solve
from eitsim.mechanics.rim.correction import no_correction
from eitsim.mechanics.rim.solve_near_rim import Resolution, Solution, change_of, set_up
from eitsim.scene.results import RimField
from eitsim.scene.scene import STRAINS, Body, Electrodes, Punch
from touchcal.errors import NotConverged

CASES = quick(((0.014, 1.0), (0.010, 2.0), (0.018, 0.3)), ((0.014, 1.0),))
GAPS_M = quick((0.002, 0.005, 0.01, 0.02), (0.005,))
HEIGHTS_M = quick((0.002, 0.005, 0.01), (0.01,))
# Stiffness of the strip over the foam's, its depth outwards, thicknesses, and the mesh that resolves it.
STIFF, DEEP = 100.0, 0.4
FINE = Resolution(5.0, 10, 20, widest=0.2)
OTHER = {"softer": (20.0, FINE), "stiffer": (500.0, FINE), "finer": (STIFF, Resolution(4.0, 14, 28, widest=0.15))}


def with_strip(disc: ClippedDisc, model: IndentationProblem, half: float, height: float, stiff: float) -> ClippedDisc:
    """The clipped disc with a strip outside the rim, half as wide and as high as given in thicknesses; points of the
    foam stay as they are."""
    foam, around, outline = disc.foam, disc.foam.circles, disc.outline
    assert isinstance(outline, OffsetDisc)
    shape = foam.shape[..., 2] / foam.shape[..., 2].sum(axis=1, keepdims=True)
    z = np.sum(shape * model.grid.nodes[foam.nodes, 1], axis=1)
    radius = np.zeros(len(around.weight))
    radius[foam.circle] = 1 / foam.shape[..., 2].sum(axis=1)
    # the strip's outer corner is seen from the punch at no larger angle than its inner one
    last = np.minimum(outline.start(radius), np.arcsin(np.minimum(1.0, half / np.maximum(radius, half))))[:, None]
    t, w = np.polynomial.legendre.leggauss(around.weight.shape[1])
    angle = last * (t + 1) / 2
    x, y = outline.offset + radius[:, None] * np.cos(angle), radius[:, None] * np.sin(angle)
    outwards = np.hypot(x, y) - outline.disc
    share = last / np.pi * w / 2 * ((outwards > 0) & (outwards < DEEP) & (y < half))
    cosine, sine = harmonics_at(angle, len(disc.fixed))
    circles = AngularQuadrature(np.hstack([around.weight, np.zeros_like(share)]),
                                np.concatenate([around.cosine, cosine], axis=-1),
                                np.concatenate([around.sine, sine], axis=-1))
    near = model.grid.nodes[model.grid.elements, 0].max(axis=1) <= model.grid.nodes[foam.nodes, 0].max() + 1e-9
    volume = model.grid.weight[near].ravel() * (z > -height)
    return replace(disc, foam=replace(foam, circles=circles),
                   weight=np.hstack([disc.weight, stiff * volume[:, None] * share[foam.circle]]))


def found(body: Body, punch: Punch, height_m: float, stiff: float, fineness: Resolution) -> RimField | None:
    """What the rim changes, with a strip of this height on it; 0: without; None where it is not found."""
    unit = body.thickness_m
    model, load = set_up(TABLE_1, body, punch, fineness)
    model, state = load.state(model, False)
    disc = clipped_disc(model, state, OffsetDisc(body.radius_m / unit, punch.x_m / unit), fineness.harmonics,
                        fineness.angles, model.punch.profile.radius + fineness.out_to)
    if height_m:
        disc = with_strip(disc, model, float(np.max(Electrodes().width_m)) / 2 / unit, height_m / unit, stiff)
    try:
        at = solve(disc, None)
    except NotConverged:
        return None
    return change_of(Solution(disc, model, state, at.x, at.residuals), body).field


def rows(diameter_m: float, force_N: float, gap_m: float, what: str, heights_m: Sequence[float], stiff: float,
         fineness: Resolution) -> list[dict[str, object]]:
    body, punch = Body(), at(diameter_m, force_N, gap_m)
    far = solve_touch(TABLE_1, body, punch)
    bare = found(body, punch, 0.0, stiff, fineness)
    if bare is None:
        return []
    rim = signal_differences(body, punch, far, no_correction(bare), bare)
    out = []
    for height_m in heights_m:
        begun = time.process_time()
        held = found(body, punch, height_m, stiff, fineness)
        strip = np.full(len(STRAINS), np.nan) if held is None else signal_differences(body, punch, far, held, bare)
        out.append({"what": what, "d_mm": diameter_m * 1e3, "force_N": force_N, "gap_mm": gap_m * 1e3,
                    "height_mm": height_m * 1e3,
                    **{f"rim_{name}": part for name, part in zip(STRAINS, rim, strict=True)},
                    **{f"electrode_{name}": part for name, part in zip(STRAINS, strip, strict=True)},
                    "cpu_s": time.process_time() - begun})
        print(pd.DataFrame(out[-1:]).to_string(index=False, header=len(out) == 1), flush=True)
    return out


def main() -> None:
    table = [row for (d, force), gap in itertools.product(CASES, GAPS_M)
             for row in rows(d, force, gap, "effect", HEIGHTS_M, STIFF, FINE)]
    table += [row for what, (stiff, fineness) in OTHER.items()
              for row in rows(0.014, 1.0, 0.005, what, HEIGHTS_M, stiff, fineness)]
    shown(written(table, "rim_electrodes"))


if __name__ == "__main__":
    main()
