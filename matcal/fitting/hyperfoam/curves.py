"""Stress-strain curves as a fit sees them: each with its weights and with the hereditary kernel of its own history."""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.laws.deformation_modes import MODES, design, hereditary_kernel, push_forward, second_piola
from matcal.laws.law import Law
from matcal.laws.prony import Prony, convolve
from matcal.reduction.experiment import Experiment, StrainPath
from touchcal.arrays import Array

RESIDUALS = ("relative", "absolute", "deviation")
_FLOOR = 0.05  # share of a curve's largest stress below which "deviation" divides by that floor instead of the stress
_LEAST_DEVIATION = 0.2  # share of the median stated deviation that counts as the least one
_MOST_POINTS = 5000  # most points of a curve with a hereditary kernel, which is a matrix of that size


@dataclass(frozen=True)
class Curve:
    """One experiment, weighed."""

    label: str  # KIND_i, as in the card and its folder
    experiment: Experiment  # the reduced test
    # (n,) stress that counts as one unit of residual, Pa; over all curves the squares of residual/scale sum to a mean
    scale_Pa: Array
    weight: float  # share of this curve in the sum of squares; all curves together have 1
    unit: str = "the rms stress of the curve"  # what one unit of residual is, in words
    # (n, n) from long-term second Piola-Kirchhoff history to relaxed history; None: the record is taken as long-term
    kernel: Array | None = None
    factor: float = 1.0  # stiffness of this specimen over that of the mean foam, see `specimen_factors`

    def design(self, alpha: Array, nu: float) -> Array:
        """d stress/d mu_longterm, (n, N), of this specimen."""
        return self.factor * design(self.experiment.kind, self.experiment.strain, alpha, nu, self.kernel)

    def model(self, law: Law) -> Array:
        """Nominal stress of this specimen, for a long-term law of the mean foam with any nu, along the curve's own
        history, Pa, (n,)."""
        kind, e = self.experiment.kind, self.experiment.strain
        history = second_piola(law, kind, e)
        history = history if self.kernel is None else self.kernel @ history
        return self.factor * np.sum(push_forward(kind, e) * history, axis=-1)


def weigh(experiments: Sequence[Experiment], residual: str = "relative",
          weights: Mapping[str, float] | None = None) -> tuple[Curve, ...]:
    """Curves of the elastic experiments, residuals measured one of three ways and kinds weighted.

    relative (default): by the rms stress of the curve, so that the sum is each curve's squared relative RMS; absolute:
    in Pa, by the rms stress of all curves together; deviation: point by point by the standard deviation that the file
    states, not less than a fifth of its median; where no curve states one by the stress itself, not less than 5 % of
    the largest, and where only some do by 5 % of that. `weights`: kind -> weight (default 1), shared by the replicates
    of a kind. Raises ValueError for an unknown choice or kind, a weight that is not positive, a curve without stress,
    without three different strains, or of the wrong sign.
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
    units = _units(chosen, residual)
    seen: Counter[str] = Counter()
    out = []
    for experiment, weight, (size, words) in zip(chosen, share, units, strict=True):
        seen[experiment.kind] += 1
        scale = size * np.sqrt(experiment.value.size / weight)
        out.append(Curve(f"{experiment.kind}_{seen[experiment.kind]}", experiment, scale, float(weight), words))
    return tuple(out)


def of_mean_foam(curve: Curve) -> Curve:
    """The curve as the mean foam, not its own specimen, is compared with it."""
    return replace(curve, factor=1.0)


def weight_sentence(curves: Sequence[Curve]) -> str:
    """How residuals are measured and what share of the sum of squares each curve has."""
    units = {c.unit for c in curves}
    what = (f"Residuals are divided by {units.pop()}" if len(units) == 1 else
            "Residuals are divided: " + ", ".join(f"{c.label} by {c.unit}" for c in curves))
    return what + "; share of the sum: " + ", ".join(f"{c.label} {c.weight:.3g}" for c in curves) + "."


def with_history(curve: Curve, prony: Prony) -> Curve:
    """The curve with the kernel of its own loading history, of a cyclic test that of its whole path; unchanged where
    the record has no clock."""
    time, path = curve.experiment.time_s, curve.experiment.path
    if time is None:
        return curve
    if curve.experiment.strain[0] != _rest(curve.experiment):
        raise ValueError(f"{curve.label} ({', '.join(curve.experiment.source)}): the rate correction needs a record "
                         f"that starts at rest, this one starts at a strain of {curve.experiment.strain[0]:g}. "
                         "Add a first row without strain and stress, or leave the time column out.")
    if time.size > _MOST_POINTS:
        raise ValueError(f"{curve.label}: the rate correction of {time.size} points needs a matrix of that size; at "
                         f"most {_MOST_POINTS}. Thin the record with "
                         "matcal.fitting.relaxation.record_thinning.thinned.")
    kernel = hereditary_kernel(prony, time) if path is None or not path.timed else _path_kernel(
        prony, curve.experiment, path)
    return replace(curve, kernel=kernel / prony.g_infinity)


def _path_kernel(prony: Prony, experiment: Experiment, path: StrainPath) -> Array:
    """(n, n) from the stresses of the n first loadings to what they are after the whole path: along it the stress at
    each strain is that of the first loading there, linear between its points."""
    assert experiment.time_s is not None
    assert path.time_s is not None
    order = np.argsort(experiment.strain, kind="stable")
    grid = experiment.strain[order]
    along = np.column_stack([np.interp(path.strain, grid, one) for one in np.eye(grid.size)[:, order]])
    relaxed = convolve(prony, path.time_s, along)
    return np.column_stack([np.interp(experiment.time_s, path.time_s, one) for one in relaxed.T])


def projected_operator(curve: Curve, directions: Array) -> Array:
    """(r, n C) matrix from the second Piola-Kirchhoff history (n, C), flattened, to the curve's weighted stress along
    `directions` (n, r)."""
    e = curve.experiment.strain
    push = curve.factor * push_forward(curve.experiment.kind, e) / curve.scale_Pa[:, None]
    out = directions.T[:, :, None] * push
    if curve.kernel is not None:
        out = np.einsum("rnc,nm->rmc", out, curve.kernel, optimize=True)
    return out.reshape(directions.shape[1], -1)


def weighted_design(curves: Sequence[Curve], alpha: Array, nu: float) -> Array:
    """Design of all curves over their scales, (n, N); its residual's squares sum to the weighted mean square."""
    return np.vstack([c.design(alpha, nu) / c.scale_Pa[:, None] for c in curves])


def weighted_model(curves: Sequence[Curve], law: Law) -> Array:
    """Stresses of a long-term law, each term with its own nu, over the scales of the curves, (n,)."""
    return np.concatenate([c.model(law) / c.scale_Pa for c in curves])


def weighted_stress(curves: Sequence[Curve]) -> Array:
    """Measured stresses over their scales, (n,)."""
    return np.concatenate([c.experiment.value / c.scale_Pa for c in curves])


def different_strains(curves: Sequence[Curve]) -> int:
    """Number of different strains of each kind away from rest, summed over the kinds: repeats and the state of rest,
    where every law is right, teach nothing."""
    strains: dict[str, list[Array]] = {}
    for curve in curves:
        strains.setdefault(curve.experiment.kind, []).append(_away_from_rest(curve.experiment))
    return sum(np.unique(np.concatenate(each)).size for each in strains.values())


def reached(curves: Sequence[Curve]) -> tuple[float, float]:
    """Least and largest logarithmic principal stretch that all curves drive, 0 among them; free faces are left out."""
    ends = [0.0]
    for curve in curves:
        e, kind = curve.experiment.strain, curve.experiment.kind
        x = np.arcsinh(e / 2) if kind == "shear" else np.log(e) / 3 if kind == "volumetric" else np.log1p(e)
        ends += [float(x.min()), float(x.max())] + ([-float(x.max()), -float(x.min())] if kind == "shear" else [])
    return min(ends), max(ends)


def _rest(experiment: Experiment) -> float:
    """The strain, or the volume ratio, of the state without stress."""
    return 1.0 if experiment.kind == "volumetric" else 0.0


def _away_from_rest(experiment: Experiment) -> Array:
    return experiment.strain[experiment.strain != _rest(experiment)]


def _units(experiments: Sequence[Experiment], residual: str) -> list[tuple[Array, str]]:
    """(stress (n,) that counts as one unit of residual, Pa; that unit in words) of each experiment."""
    if residual == "deviation":
        stated = [e.deviation is not None for e in experiments]
        return [_stated(e) if e.deviation is not None else _by_stress(e, any(stated)) for e in experiments]
    if residual == "relative":
        return [(np.full(e.value.size, np.sqrt(np.mean(e.value**2))), "the rms stress of the curve")
                for e in experiments]
    overall = np.sqrt(np.mean([np.mean(e.value**2) for e in experiments])) if experiments else 0.0
    return [(np.full(e.value.size, overall), f"one stress for all curves, the rms of {overall:.4g} Pa")
            for e in experiments]


def _stated(experiment: Experiment) -> tuple[Array, str]:
    assert experiment.deviation is not None
    size = np.abs(experiment.deviation)
    floor = _LEAST_DEVIATION * float(np.median(size))
    if floor == 0:
        raise ValueError(f"{experiment.kind} ({', '.join(experiment.source)}): at least half of the stated deviations "
                         "are 0. Use `residual` relative or absolute.")
    return np.maximum(size, floor), f"the standard deviation stated in the file, not less than {floor:.3g} Pa"


def _by_stress(experiment: Experiment, others_state: bool) -> tuple[Array, str]:
    size = np.abs(experiment.value)
    unit, words = np.maximum(size, _FLOOR * size.max()), f"the stress itself, not less than {_FLOOR:.0%} of the largest"
    if not others_state:
        return unit, words
    return _FLOOR * unit, f"{_FLOOR:.0%} of {words}, as no deviation is stated"


def _checked_weights(weights: Mapping[str, float], experiments: Sequence[Experiment]) -> Mapping[str, float]:
    kinds = sorted({e.kind for e in experiments})
    if unknown := sorted(set(weights) - set(kinds)):
        raise ValueError(f"weight for '{unknown[0]}': no such curve is being fitted; there are: {', '.join(kinds)}.")
    if bad := [k for k, w in weights.items() if not (np.isfinite(w) and w > 0)]:
        raise ValueError(f"weight {bad[0]}={weights[bad[0]]:g} must be a positive number.")
    return weights


def _check(experiment: Experiment) -> None:
    where = f"{experiment.kind} ({', '.join(experiment.source) or 'no file'})"
    e, value, rest = experiment.strain, experiment.value, _rest(experiment)
    if not np.all(np.isfinite(e) & np.isfinite(value)):
        raise ValueError(f"{where}: strain or stress is not a number in {np.sum(~np.isfinite(e + value))} rows.")
    if e.size < 3 or not np.any(value):
        raise ValueError(f"{where}: {e.size} points, or no stress at all; a fit needs at least three.")
    if (different := np.unique(_away_from_rest(experiment)).size) < 3:
        raise ValueError(f"{where}: {different} different strains away from rest in {e.size} points; a fit needs at "
                         "least three. Is the strain column the right one?")
    if np.sum((e - rest) * value) <= 0:
        raise ValueError(f"{where}: stress and strain have opposite signs. Compression is negative in both; turn the "
                         "sign of one column.")
