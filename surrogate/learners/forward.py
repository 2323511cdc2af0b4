"""The forward method: invert the learned forward map for the touch, then read its response off the learned response."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from surrogate.data import material_states, outputs
from surrogate.data.samples import Samples, SweepSamples, take
from surrogate.data.sensor_ring import Ring, radial
from surrogate.forward_map import forward_map, rim_correction
from surrogate.forward_map.amplitude import amplitude
from surrogate.forward_map.forward_map import ForwardMap, near_an_edge, places_at
from surrogate.forward_map.inversion import mechanical_response, other_profiles
from surrogate.forward_map.inversion.diameter_force_posterior import RADII, Table, drawn, moments, one_sided
from surrogate.forward_map.inversion.edge_errors import with_places_held
from surrogate.forward_map.inversion.invert import FORCE, LEAST_SIDE, Inversion, Peak, invert
from surrogate.forward_map.inversion.mechanical_response import Answer, Response
from surrogate.forward_map.inversion.other_profiles import ForceRatio
from surrogate.forward_map.inversion.reading_covariance import Drift, drift_of
from surrogate.forward_map.known_places import MIN_ROWS, by_one_edge, known_place, series_suffices
from surrogate.learners.base import Estimate, Learner, Parts, Training, joined
from surrogate.statistics.metrics import rms
from touchcal.arrays import Array, Mask

BATCH = 64  # frames solved together, to bound the memory


@dataclass(frozen=True, eq=False)
class TouchInversion(Learner):
    """A forward map and the response of the requested mechanical outputs, if any."""

    forward: ForwardMap
    response: Response
    columns: NDArray[np.int64]  # positions of the requested outputs among the touch's four and the response's
    profiles: tuple[ForceRatio, ...] = ()  # what other profiles than the trained one change of the force

    @classmethod
    def fit(cls, rows: Samples, training: Training) -> TouchInversion:
        """Fit the map from touch and state of the material to signal, and the response of the requested outputs; on a
        skin with an outline from touches that no edge is near to, or one straight edge alone."""
        if not isinstance(rows, SweepSamples):
            raise ValueError('method "forward" learns from a sweep, whose sensor and punches it knows; take another '
                             "one for recorded presses.")
        if rows.ring.curved is not None:
            raise ValueError('method "forward" learns from flat skins; this sweep is of a curved one. Take `method` '
                             "gp, ridge or network.")
        if rows.ring.sheet is not None:
            if rows.ring.sheet.on_surface:
                raise ValueError('method "forward" learns from electrodes along the edge; those of this sweep lie on '
                                 'the surface (kind = "surface" in [electrodes]). Take `method` ridge, network or gp.')
            rows = _by_one_edge_at_most(rows)
        states = material_states.states(material_states.fit(rows.material), rows.material)
        touch = rows.target[:, :outputs.TOUCH]
        mechanical = tuple(name for name in outputs.RESPONSES if name in training.names)
        response = mechanical_response.fit(rows.ring, touch, rows.targets(mechanical), mechanical, states)
        order = [*outputs.TOUCHES, *mechanical]
        near = rows.near_edge if rows.ring.sheet is not None else None
        forward, error_V = forward_map.fit_with_errors(rows.ring, touch, rows.signal_V, states, rows.signal_sd, near)
        if not training.known_punches:
            forward = replace(forward, known_mm=np.zeros(0))
        forward = with_places_held(forward, touch, error_V)
        others = () if training.known_punches else other_profiles.learned(forward, rows.others)
        return cls(forward, response, np.array([order.index(name) for name in training.names]), others)

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """Requested outputs of signals (n, readings) under white noise."""
        return self._estimate(signal_V, noise_V, None)

    def _estimate(self, signal_V: Array, noise_V: float, drift: Drift | None) -> Estimate:
        return joined([_estimate(self, signal_V[i:i + BATCH], noise_V, drift)
                       for i in range(0, len(signal_V), BATCH)])

    def record(self, training: Training) -> dict[str, Any]:
        """Modes of the series, relative errors of a reading in the interior and of the simulator's signals, and states
        of the material."""
        return {"modes": len(self.forward.field), "signal_floor": self.forward.floor,
                "simulator_error": rms(self.forward.simulator.sd), "material_states": self.forward.materials}

    def amplitude(self) -> dict[str, Any]:
        """The signal over force for each diameter."""
        return amplitude(self.forward)

    def branched(self, names: tuple[str, ...]) -> Mask:
        """(outputs,) the diameter where punches are known, and all but the place where two forces of one punch have
        one amplitude."""
        known = len(self.forward.known_mm) > 0
        twice = any(curve["two_answers_N"] for curve in self.amplitude()["diameters"])
        return np.array([(known and name == "d") or (twice and name not in outputs.PLACES) for name in names])

    def reads(self, touch: Array) -> Mask:
        """(n,) whether touches (n, 4) lie where the map holds: on a skin with an outline no nearer to its edges than
        the touches that taught it, and near one of them at most."""
        known = self.forward
        return known_place(known.ring, float(known.bounds[1, 0]), known.near_edges, touch)

    def without(self, whole: Ring, ring: Ring, kept: Mask) -> TouchInversion:
        """The inversion whose misfit leaves out the readings of the whole ring that are not kept."""
        rim = rim_correction.without(self.forward.correction, whole, kept)
        return replace(self, forward=replace(self.forward, ring=ring, correction=rim))

    def drifting(self, root: Array) -> DriftingInversion:
        """The inversion with a drift in the covariance of the readings."""
        return DriftingInversion(self.forward, self.response, self.columns, self.profiles, drift=drift_of(root))


def _by_one_edge_at_most(rows: SweepSamples) -> SweepSamples:
    """The rows of touches that no edge is near to, and of those near one straight edge alone."""
    far = ~rows.near_edge
    if np.sum(far) < MIN_ROWS:
        raise ValueError(f"{np.sum(far)} of {len(rows)} training rows are touches that no edge is near to, too few for "
                         f"the forward map; it needs {MIN_ROWS} or more. Sweep more of them: without gap_mm in place "
                         "they keep from edges by themselves.")
    alone = by_one_edge(rows.ring, rows.target, float(radial(rows.ring, rows.target[far]).max()))
    return take(rows, far | (alone & series_suffices(rows.ring, rows.target)))


@dataclass(frozen=True, eq=False)
class DriftingInversion(TouchInversion):
    """An inversion of frames between which the instrument may have drifted."""

    drift: Drift = field(kw_only=True)

    def estimate(self, signal_V: Array, noise_V: float) -> Estimate:
        """As TouchInversion, with the drift in the covariance of the readings."""
        return self._estimate(signal_V, noise_V, self.drift)


def _estimate(learner: TouchInversion, signal: Array, noise_V: float, drift: Drift | None) -> Estimate:
    return answered(learner, invert(learner.forward, signal, noise_V, drift))


def answered(learner: TouchInversion, found: Inversion) -> Estimate:
    """Requested outputs of touches that were found."""
    value, sd, own = found.touch, np.sqrt(np.einsum("npp->np", found.covariance)), 0.0
    sides, past = np.stack([found.below, found.above]), found.past
    slope = np.concatenate([np.broadcast_to(np.eye(4), (len(value), 4, 4)),
                            np.zeros((len(value), 4, found.material.shape[1]))], axis=2)
    if learner.response.processes:
        answer = mechanical_response.respond(learner.response, learner.forward.ring, found.touch, found.material)
        mechanical = np.concatenate([np.zeros((*answer.sd.shape, 2)), answer.slope], axis=2)
        slope, own = np.concatenate([slope, mechanical], axis=1), np.column_stack([0 * value, answer.sd])
        mean, spread, both = _response(learner, found, answer)
        value, sd, sides, past = (np.concatenate(pair, axis=-1) for pair in (
            (value, mean), (sd, spread), (sides, both), (past, _past(learner, found, mean))))
    ratio = np.ones((*value.shape, 1 + len(learner.profiles)))
    ratio_sd = np.zeros_like(ratio)
    ratio[:, FORCE], ratio_sd[:, FORCE] = other_profiles.at(learner.profiles, found.touch)
    c = learner.columns
    parts = _parts(found.peak, slope, own, sd)
    return Estimate(value[:, c], sd[:, c], found.misfit, found.inside, sides[0][:, c], sides[1][:, c],
                    near_an_edge(learner.forward, found.touch), found.map_part, found.left,
                    past[0][:, c], past[1][:, c], found.other, ratio[:, c], ratio_sd[:, c],
                    Parts(parts.noise[:, c], parts.material[:, c]))


def _parts(peak: Peak, slope: Array, own: Array | float, sd: Array) -> Parts:
    """Parts of standard deviations (n, outputs), in the shares that they have about the peak, for outputs of these
    derivatives (n, outputs, 4 + k) by touch and material and their own standard deviation."""
    whole, known, noise = (np.einsum("nop,npq,noq->no", slope[..., :c.shape[1]], c, slope[..., :c.shape[1]])
                           for c in (peak.joint, peak.known, peak.noise))
    per_variance = sd**2 / (whole + own**2)
    known = np.minimum(known, whole)
    return Parts(np.sqrt(np.minimum(noise, known) * per_variance), np.sqrt((whole - known) * per_variance))


def _response(learner: TouchInversion, found: Inversion, answer: Answer) -> tuple[Array, Array, Array]:
    """Mechanical outputs, their standard deviations and the one-sided ones (2, n, outputs); over the posterior of the
    punches where that speaks, none of these below LEAST_SIDE of the whole."""
    carried = np.einsum("nop,npq,noq->no", answer.slope, found.peak.joint[:, 2:, 2:], answer.slope)
    peak = np.sqrt(carried + answer.sd**2)
    if found.punches is None:
        return answer.value, peak, np.stack([peak, peak])
    nodes, variance = _table_response(learner, found.punches.table)
    discrepancy, k = drawn(found.punches, variance), found.broad
    mean, covariance = moments(drawn(found.punches, nodes))
    own, widened = np.maximum(discrepancy.mean(axis=1), 0.0), np.maximum(found.misfit[k], 1.0)[:, None]
    value, whole, sides = answer.value.copy(), peak.copy(), np.stack([peak, peak])
    value[k], whole[k] = mean, np.sqrt(np.einsum("npp->np", covariance) * widened + own)
    likely = np.sqrt(one_sided(found.punches, nodes, mean) ** 2 * widened + own)
    sides[:, k] = np.maximum(likely, LEAST_SIDE * whole[k])
    return value, whole, sides


def _past(learner: TouchInversion, found: Inversion, value: Array) -> Array:
    """(2, n, outputs) one-sided standard deviations of mechanical outputs that reach the punches outside the training
    range."""
    past = np.zeros((2, *value.shape))
    if found.outer is not None and found.smallest is not None:
        k, nodes = found.broad, _table_response(learner, found.outer.table)[0]
        touch = np.concatenate([np.repeat(found.touch[k, None, :2], 2, axis=1), found.smallest], axis=2).reshape(-1, 4)
        small = mechanical_response.respond(learner.response, learner.forward.ring, touch, np.zeros(
            (len(touch), learner.forward.materials))).value.reshape(-1, 2, value.shape[1])
        past[:, k] = found.reached(value[k], nodes, small)
    return past


@lru_cache(maxsize=16)
def _table_response(learner: TouchInversion, table: Table) -> tuple[Array, Array]:
    """(RADII, D, G, outputs) outputs of a table's punches and the variances of their own errors and materials."""
    forward, nodes = learner.forward, table.touch
    touch = np.zeros((len(RADII), *nodes.shape[:2], 4))
    touch[..., :2], touch[..., 2:] = places_at(forward, np.sqrt(RADII))[:, None, None], nodes
    flat = touch.reshape(-1, 4)
    answer = mechanical_response.respond(learner.response, forward.ring, flat, np.zeros((len(flat), forward.materials)))
    variance = answer.sd**2 + np.sum(answer.slope[..., 2:] ** 2, axis=-1)
    return answer.value.reshape(*touch.shape[:3], -1), variance.reshape(*touch.shape[:3], -1)
