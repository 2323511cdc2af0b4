"""What may change of an instrument between the untouched and the touched frame: gains of channels and contacts.

A channel of gain 1 + g reads its electrode's potential against ground (1 + g) times, so that a reading V_a - V_b
changes by g_a V_a - g_b V_b. Where ground is, the readings do not say: the instrument is taken to float, ground at the
mean of all electrodes. A contact impedance changes readings by its derivative. Both at first order, of the untouched
frame.
With S the covariance of these changes and G their derivatives, readings get the covariance G S G' (Jaaskelainen,
Toivanen, Hanninen, Kolehmainen, Hyvonen, arXiv 2412.15009, 2024, who project it off altogether).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from eitsim.electrics.forward.untouched import by_contact, conductance_of
from eitsim.scene.scene import Scene
from surrogate.data.sensor_ring import MODES, Ring
from touchcal.arrays import Array, Mask

# Relative difference, 2-norm, of a ring's foreseen untouched readings from those of a model, up to which its potentials
# are believed.
FORESEEN = 0.05


def by_gain(ring: Ring, baseline_V: Array) -> Array:
    """(readings, electrodes) derivatives of untouched readings (readings,), V, by the gains of the channels, V.

    The electrodes' potentials are those of the ring's foreseen fields, sum q_m^2 cos(m t) / m, or of a solved skin with
    an outline, scaled to the untouched readings. ValueError where these do not give the untouched readings, as of
    patches or of a very uneven ring.
    """
    kernel = _kernel(ring) if ring.sheet is None else ring.sheet.potential
    potential = kernel[:, ring.source] - kernel[:, ring.sink]
    potential -= potential.mean(axis=0)
    rows = np.arange(len(ring.read))
    foreseen = potential[ring.read, rows] - potential[ring.ground, rows]
    scale = float(foreseen @ baseline_V / (foreseen @ foreseen))
    if np.linalg.norm(scale * foreseen - baseline_V) > FORESEEN * np.linalg.norm(baseline_V):
        raise ValueError("the electrodes' potentials cannot be foreseen from the untouched frame of this sensor, and "
                         "drifts of gains are not known. Leave gain out of `drift`.")
    out = np.zeros((len(rows), len(ring.angle_rad)))
    out[rows, ring.read] = scale * potential[ring.read, rows]
    out[rows, ring.ground] = -scale * potential[ring.ground, rows]
    return out


def _kernel(ring: Ring) -> Array:
    """(electrodes, electrodes) potentials of a disc's electrodes by the driven one, times pi over the resistance."""
    mode = np.arange(1, MODES + 1)
    turns = ring.angle_rad[:, None] - ring.angle_rad
    return np.asarray(np.cos(turns[..., None] * mode) @ (ring.modes**2 / mode))


@dataclass(frozen=True, eq=False)
class FrameDrift:
    """G S^(1/2): what one standard deviation of each change adds to the readings, V."""

    gain: Array  # (readings, electrodes), no columns where gains do not drift
    contact: Array  # (readings, electrodes), likewise

    @property
    def root(self) -> Array:
        """(readings, k) both."""
        return np.hstack([self.gain, self.contact])

    def of(self, kept: Mask) -> FrameDrift:
        """That of the readings that are kept."""
        return FrameDrift(self.gain[kept], self.contact[kept])


def no_drift(readings: int) -> FrameDrift:
    """None of that many readings."""
    return FrameDrift(np.zeros((readings, 0)), np.zeros((readings, 0)))


def frame_drift(ring: Ring, baseline_V: Array, gain_sd: float = 0.0, contact_sd: float = 0.0,
                scene: Scene | None = None) -> FrameDrift:
    """Independent relative changes of gains and of contact impedances of these standard deviations; those of contacts
    need the scene of the sensor.

    ValueError for a standard deviation below 0, contacts without a scene, or as by_gain and conductance_of.
    """
    for name, sd in (("gain", gain_sd), ("contact", contact_sd)):
        if not 0 <= sd < 1:
            raise ValueError(f"the drift of a {name} is a relative standard deviation from 0 to 1, got {sd:g}.")
    found = no_drift(len(baseline_V))
    if gain_sd:
        found = replace(found, gain=gain_sd * by_gain(ring, baseline_V))
    if contact_sd:
        if scene is None:
            raise ValueError("what a contact impedance changes of the readings follows from the sensor's electrodes; "
                             "give `scene` FILE, or `data` DIR.")
        sheet = conductance_of(scene, baseline_V)
        found = replace(found, contact=contact_sd * by_contact(scene.body, scene.electrodes, scene.drive, sheet))
    return found
