"""Stresses of the next specimen: ln stress is normal over specimens, strain by strain.

Specimen k of n is stiffer than a law by d_k, the logarithm of the least-squares factor of its record in one part of the
strains that all have in common; d_k ~ N(m, omega^2), a record's own errors being small next to that. The mean of all
specimens is then known to omega/sqrt(n) and the next specimen to omega sqrt(1 + 1/n), with omega as likely as its prior
and the squares about m make it (`specimen_factors.reach`). What the law misses is in m, so that it does not count as
scatter. Each specimen is left out in turn: what share of it lies where the others expect the next one.
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
    mean: Array  # (m,) half the 95 % interval of its logarithm
    further: Array  # (m,) half that of the next specimen's
    held: Mapping[str, float]  # curve -> share of it within the others' interval; empty for two

    def rows(self) -> dict[str, dict[str, float]]:
        """Quantity -> value, ends of the interval of the mean and of the next specimen, Pa."""
        return {f"{self.kind} stress at {self.strain[k]:.3g}": _row(*map(float, (
            abs(self.stress_Pa[k]), self.mean[k], self.further[k]))) for k in _SHOWN if k < self.strain.size}


def next_specimens(curves: Sequence[Curve], law: Law) -> tuple[NextSpecimen, ...]:
    """Of every kind that was tested twice or more over the same strains."""
    return tuple(found for group in replicates(curves) if (found := _of(group, law)).strain.size)


def of_modulus(value: float, lo: float, hi: float, further: float) -> dict[str, float]:
    """As `NextSpecimen.rows`, of a modulus with its interval and the reach of one specimen's ln factor."""
    least, most = value * np.expm1([-further, further])
    return {"value": value, "lo": lo, "hi": hi, "next_lo": value - float(np.hypot(value - lo, least)),
            "next_hi": value + float(np.hypot(hi - value, most))}


def _row(value: float, mean: float, further: float) -> dict[str, float]:
    ends = {"lo": -mean, "hi": mean, "next_lo": -further, "next_hi": further}
    return {"value": value} | {name: value * float(np.exp(end)) for name, end in ends.items()}


def _of(group: Sequence[Curve], law: Law) -> NextSpecimen:
    kind, n = group[0].experiment.kind, len(group)
    rest = 1.0 if kind == "volumetric" else 0.0
    away = [c.experiment.strain - rest for c in group]
    side = float(np.sign(away[0][np.argmax(np.abs(away[0]))]))
    far = min(float((side * one).max()) for one in away)
    factor = np.array([_factors(c, law, side * one / far) for c, one in zip(group, away, strict=True)])
    there = np.all(factor > 0, axis=0)
    d = np.log(factor[:, there])
    strain = rest + side * far * ((np.arange(_PARTS) + 0.5) / _PARTS)[there]
    held = {} if n < 3 else {c.label: float(np.mean(np.abs(d[k] - others.mean(axis=0)) <= _half(others)))
                             for k, c in enumerate(group) for others in [np.delete(d, k, axis=0)]}
    half = _half(d)
    return NextSpecimen(kind, strain, nominal_stress(law, kind, strain) * np.exp(d.mean(axis=0)), half / np.sqrt(n + 1),
                        half, held)


def _factors(curve: Curve, law: Law, place: Array) -> Array:
    """(_PARTS,) least-squares factors of a record over the law, place (n,) being 1 where the common strains end; 0
    where there is none."""
    value, model = curve.experiment.value, of_mean_foam(curve).model(law)
    part = np.minimum(np.floor(place * _PARTS), _PARTS).astype(int)
    part[np.isclose(place, 1.0)] = _PARTS - 1
    inside = (part >= 0) & (part < _PARTS) & (place > 0)
    up, down = (np.bincount(part[inside], (one * model)[inside], _PARTS) for one in (value, model))
    return np.divide(up, down, out=np.zeros(_PARTS), where=down > 0)


def _half(d: Array) -> Array:
    """(m,) half the 95 % interval of the next of normal numbers, n of which (n, m) are known."""
    n = len(d)
    squares = np.sum((d - d.mean(axis=0)) ** 2, axis=0)
    return np.sqrt(1 + 1 / n) * np.array([reach(float(each), n - 1) for each in squares])
