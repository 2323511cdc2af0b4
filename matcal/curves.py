"""Stress-strain curves as a fit sees them: each with its weights and with the hereditary kernel of its own history."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from matcal.experiment import Experiment
from matcal.hyperfoam import Hyperfoam
from matcal.modes import MODES, design, hereditary_kernel, push_forward, second_piola
from matcal.prony import Prony

Array = NDArray[np.float64]

RESIDUALS = ("relative", "absolute", "deviation")
# share of a curve's largest stress below which "deviation" divides by that floor instead of the stress
_FLOOR = 0.05


@dataclass(frozen=True)
class Curve:
    """One experiment, weighed."""

    # KIND_i, as in the card and its folder
    label: str
    # the reduced test
    experiment: Experiment
    # (n,) stress that counts as one unit of residual, Pa; over all curves the squares of residual/scale sum to a mean
    scale_Pa: Array
    # share of this curve in the sum of squares; all curves together have 1
    weight: float
    # (n, n) from long-term second Piola-Kirchhoff history to relaxed history; None: the record is taken as long-term
    kernel: Array | None = None

    def design(self, alpha: Array, nu: float) -> Array:
        """d stress/d mu_longterm, (n, N)."""
        return design(self.experiment.kind, self.experiment.strain, alpha, nu, self.kernel)

    def model(self, law: Hyperfoam) -> Array:
        """Nominal stress of a long-term law with any nu along the curve's own history, Pa, (n,)."""
        kind, e = self.experiment.kind, self.experiment.strain
        history = second_piola(law, kind, e)
        return np.sum(push_forward(kind, e) * (history if self.kernel is None else self.kernel @ history), axis=-1)


def weigh(experiments: Sequence[Experiment], residual: str = "relative",
          weights: Mapping[str, float] | None = None) -> tuple[Curve, ...]:
    """Curves of the elastic experiments, residuals measured one of three ways and kinds weighted.

    relative (default): by the rms stress of the curve, so that the sum is each curve's squared relative RMS; absolute:
    in Pa, by the rms stress of all curves together; deviation: point by point by the stress itself, not less than 5 %
    of the largest. `weights`: kind -> weight (default 1), shared by the replicates of a kind. Raises ValueError for
    an unknown choice or kind, a weight that is not positive, a curve without stress or of the wrong sign.
    """
    chosen = [e for e in experiments if e.kind in MODES]
    if residual not in RESIDUALS:
        raise ValueError(f"residual '{residual}' is unknown; known: {', '.join(RESIDUALS)}.")
    weights = _checked_weights(weights or {}, chosen)
    for experiment in chosen:
        _check(experiment)
    count = Counter(e.kind for e in chosen)
    share = np.array([weights.get(e.kind, 1.0) / count[e.kind] for e in chosen])
    share = share / share.sum() if chosen else share
    overall = np.sqrt(np.mean([np.mean(e.value**2) for e in chosen])) if chosen else 0.0
    seen: Counter[str] = Counter()
    out = []
    for experiment, weight in zip(chosen, share, strict=True):
        seen[experiment.kind] += 1
        unit = _unit(experiment.value, residual, float(overall)) * np.sqrt(experiment.value.size / weight)
        out.append(Curve(f"{experiment.kind}_{seen[experiment.kind]}", experiment, unit, float(weight)))
    return tuple(out)


def with_history(curve: Curve, prony: Prony) -> Curve:
    """The curve with the kernel of its own loading history; unchanged where the record has no clock."""
    time = curve.experiment.time_s
    if time is None:
        return curve
    if curve.experiment.strain[0] != (1.0 if curve.experiment.kind == "volumetric" else 0.0):
        raise ValueError(f"{curve.label} ({', '.join(curve.experiment.source)}): the rate correction needs a record "
                         f"that starts at rest, this one starts at a strain of {curve.experiment.strain[0]:g}. "
                         "Add a first row without strain and stress, or leave the time column out.")
    return replace(curve, kernel=hereditary_kernel(prony, time) / prony.g_infinity)


def weighted_operator(curve: Curve) -> Array:
    """(n, n C) matrix from the second Piola-Kirchhoff history (n, C), flattened, to the curve's weighted stress."""
    e = curve.experiment.strain
    push = push_forward(curve.experiment.kind, e) / curve.scale_Pa[:, None]
    kernel = np.eye(e.size) if curve.kernel is None else curve.kernel
    return (push[:, None, :] * kernel[:, :, None]).reshape(e.size, -1)


def weighted_design(curves: Sequence[Curve], alpha: Array, nu: float) -> Array:
    """Design of all curves over their scales, (n, N); its residual's squares sum to the weighted mean square."""
    return np.vstack([c.design(alpha, nu) / c.scale_Pa[:, None] for c in curves])


def weighted_model(curves: Sequence[Curve], law: Hyperfoam) -> Array:
    """Stresses of a long-term law, each term with its own nu, over the scales of the curves, (n,)."""
    return np.concatenate([c.model(law) / c.scale_Pa for c in curves])


def weighted_stress(curves: Sequence[Curve]) -> Array:
    """Measured stresses over their scales, (n,)."""
    return np.concatenate([c.experiment.value / c.scale_Pa for c in curves])


def largest_log_stretch(curves: Sequence[Curve]) -> float:
    """Largest |ln lambda| over all curves."""
    sizes = []
    for curve in curves:
        e = curve.experiment.strain
        logs = {"shear": np.arcsinh(e / 2), "volumetric": np.log(np.where(e > 0, e, 1.0)) / 3}
        sizes.append(np.abs(logs.get(curve.experiment.kind, np.log1p(np.maximum(e, -1 + 1e-9)))).max())
    return float(max(sizes))


def _unit(stress: Array, residual: str, overall: float) -> Array:
    size = np.abs(stress)
    if residual == "deviation":
        return np.maximum(size, _FLOOR * size.max())
    return np.full(stress.size, overall if residual == "absolute" else np.sqrt(np.mean(stress**2)))


def _checked_weights(weights: Mapping[str, float], experiments: Sequence[Experiment]) -> Mapping[str, float]:
    kinds = sorted({e.kind for e in experiments})
    if unknown := sorted(set(weights) - set(kinds)):
        raise ValueError(f"weight for '{unknown[0]}': no such curve is being fitted; there are: {', '.join(kinds)}.")
    if bad := [k for k, w in weights.items() if not (np.isfinite(w) and w > 0)]:
        raise ValueError(f"weight {bad[0]}={weights[bad[0]]:g} must be a positive number.")
    return weights


def _check(experiment: Experiment) -> None:
    where = f"{experiment.kind} ({', '.join(experiment.source) or 'no file'})"
    rest = 1.0 if experiment.kind == "volumetric" else 0.0
    if experiment.strain.size < 3 or not np.any(experiment.value):
        raise ValueError(f"{where}: {experiment.strain.size} points, or no stress at all; a fit needs at least three.")
    if np.sum((experiment.strain - rest) * experiment.value) <= 0:
        raise ValueError(f"{where}: stress and strain have opposite signs. Compression is negative in both; "
                         "turn the sign of one column.")
