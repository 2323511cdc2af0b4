"""Stresses of the next specimen: ln stress is normal over specimens.

Specimen k of n is stiffer than a law by d_k, the logarithm of the least-squares factor of its record in one part of the
strains that all have in common; d_k ~ N(m, omega^2), m of each part and kind, omega of all; a record's own errors are
small next to that. The mean of n specimens is then known to omega/sqrt(n) and the next one to omega sqrt(1 + 1/n), with
omega as likely as its prior and the squares about m, the mean over parts, make it (`specimen_factors.reach`). What the
law misses is in m, so that it does not count as scatter. Each specimen is left out in turn: what share of it lies where
the others expect the next one.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from matcal.fitting.hyperfoam.curves import Curve, of_mean_foam
from matcal.fitting.hyperfoam.specimen_factors import reach, replicates
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.law import Law
from touchcal.arrays import Array

_PARTS = 10  # of the strains that all specimens have in common
_SHOWN = (1, 5, 9)  # parts whose stresses are given


@dataclass(frozen=True)
class NextSpecimen:
    """What specimens of one kind say of the next."""

    kind: str
    strain: Array  # (m,) middles of the parts
    stress_Pa: Array  # (m,) geometric mean of the specimens
    mean: float  # half the 95 % interval of its logarithm
    further: float  # half that of the next specimen's
    held: Mapping[str, float]  # curve -> share of it within the others' interval; empty for two curves in all

    def rows(self) -> dict[str, dict[str, float]]:
        """Quantity -> value, ends of the interval of the mean and of the next specimen, Pa."""
        return {f"{self.kind} stress at {self.strain[k]:.3g}": _row(float(abs(self.stress_Pa[k])), self.mean,
                                                                    self.further)
                for k in _SHOWN if k < self.strain.size}


def next_specimens(curves: Sequence[Curve], law: Law) -> tuple[NextSpecimen, ...]:
    """Of every kind that was tested twice or more over the same strains."""
    groups = [(group, strain, d) for group in replicates(curves) for strain, d in [_deviations(group, law)] if d.size]
    squares, spare = [_squares(d) for _, _, d in groups], sum(len(d) - 1 for _, _, d in groups)
    out = []
    for k, (group, strain, d) in enumerate(groups):
        kind, n, one = group[0].experiment.kind, len(group), reach(sum(squares), spare)
        held = {}
        for row, curve in enumerate(group if spare > 1 else ()):
            others = np.delete(d, row, axis=0)
            half = reach(sum(squares) - squares[k] + _squares(others), spare - 1) * np.sqrt(1 + 1 / (n - 1))
            held[curve.label] = float(np.mean(np.abs(d[row] - others.mean(axis=0)) <= half))
        stress = nominal_stress(law, kind, strain) * np.exp(d.mean(axis=0))
        out.append(NextSpecimen(kind, strain, stress, one / n**0.5, one * (1 + 1 / n) ** 0.5, held))
    return tuple(out)


def of_modulus(value: float, lo: float, hi: float, further: float) -> dict[str, float]:
    """As `NextSpecimen.rows`, of a modulus with its interval and the reach of one specimen's ln factor."""
    least, most = value * np.expm1([-further, further])
    return {"value": value, "lo": lo, "hi": hi, "next_lo": value - float(np.hypot(value - lo, least)),
            "next_hi": value + float(np.hypot(hi - value, most))}


def _row(value: float, mean: float, further: float) -> dict[str, float]:
    ends = {"lo": -mean, "hi": mean, "next_lo": -further, "next_hi": further}
    return {"value": value} | {name: value * float(np.exp(end)) for name, end in ends.items()}


def _squares(d: Array) -> float:
    """Sum of squares of specimens (n, m) about their mean, the mean over parts."""
    return float(np.var(d, axis=0).mean() * len(d))


def _deviations(group: Sequence[Curve], law: Law) -> tuple[Array, Array]:
    """(m,) middles of the parts and (n, m) ln factors of the specimens there."""
    rest = 1.0 if group[0].experiment.kind == "volumetric" else 0.0
    away = [c.experiment.strain - rest for c in group]
    side = float(np.sign(away[0][np.argmax(np.abs(away[0]))]))
    far = min(float((side * one).max()) for one in away)
    factor = np.array([_factors(c, law, side * one / far) for c, one in zip(group, away, strict=True)])
    there = np.all(factor > 0, axis=0)
    return rest + side * far * ((np.arange(_PARTS) + 0.5) / _PARTS)[there], np.log(factor[:, there])


def _factors(curve: Curve, law: Law, place: Array) -> Array:
    """(_PARTS,) least-squares factors of a record over the law, place (n,) being 1 where the common strains end; 0
    where there is none."""
    value, model = curve.experiment.value, of_mean_foam(curve).model(law)
    part = np.minimum(np.floor(place * _PARTS), _PARTS).astype(int)
    part[np.isclose(place, 1.0)] = _PARTS - 1
    inside = (part >= 0) & (part < _PARTS) & (place > 0)
    up, down = (np.bincount(part[inside], (one * model)[inside], _PARTS) for one in (value, model))
    return np.divide(up, down, out=np.zeros(_PARTS), where=down > 0)
