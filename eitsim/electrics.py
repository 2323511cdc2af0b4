"""From touches to readings: what a touch changes in the complete electrode model of the skin."""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from eitsim.beyond import first_order_change
from eitsim.cem import impedance, quadrature_points, sparsity
from eitsim.drive import read_out
from eitsim.multipole import impedance_change, scattering
from eitsim.results import Readings, Touch
from eitsim.rim import HARMONICS, solve_rim
from eitsim.scene import Body, Drive, Electrodes, Punch, Skin
from eitsim.skin import extrapolated_fraction, sheet_conductance, untouched_conductance
from eitsim.template import template
from matcal.conductivity import Conductivity

Array = NDArray[np.float64]

METHODS = ("auto", "multipole", "mesh")
# Harmonics about the punch, and the parts that the gaps between the touch's samples are cut into, until it suffices.
ORDERS, PARTS = 16, (1, 2, 4, 8, 16)
# Refinements of the mesh, until it suffices.
LEVELS = (1, 2, 4)


@dataclass(frozen=True)
class _Sensor:
    body: Body
    skin: Skin
    electrodes: Electrodes
    drive: Drive
    law: Conductivity

    @property
    def conductance_S(self) -> float:
        return untouched_conductance(self.law, self.skin)


@dataclass(frozen=True)
class _Change:
    """Change of the impedance matrix by a touch, Ohm, the estimated relative error of its readings, the unknowns."""

    impedance_Ohm: Array
    error: float
    unknowns: int
    method: str


def solve(body: Body, skin: Skin, electrodes: Electrodes, drive: Drive, touches: tuple[tuple[Punch, Touch], ...],
          law: Conductivity, *, signal: float = 0.002, method: str = "auto") -> Readings:
    """Readings of a touched skin; the relative error of dV, 2-norm, is at most `signal` where that can be reached.

    The untouched skin is solved on its rim alone (`solve_rim`, once a sensor). "multipole" adds what the touch, a
    stack of rings about the punch, scatters; the strain beyond the largest circle about the punch that fits in the
    disc counts to first order. "mesh" takes dV from two solutions on one mesh that follows the touch. "auto" takes the
    first where it meets `signal`, else the better of both.

    signal_error adds, for "multipole", the change by half as many rings over 3 (second order), by three quarters of
    the harmonics, and the first-order part times four times the scattering of the first harmonic (the touch turns the
    field there by that much, twice over by the rim, for both electrodes); for "mesh" it is the change by the coarser
    mesh over 3. It does not hold what interpolation between the touch's own samples costs.

    A touch that the rim changes is not axisymmetric and takes the mesh.

    ValueError for several touches, patch electrodes, an unknown method, "multipole" for a touch near the rim, a
    conducting punch on a mesh, and where the conductivity is not positive.
    """
    start = time.process_time()
    if method not in METHODS:
        raise ValueError(f"method '{method}' is unknown; known: {', '.join(METHODS)}.")
    if len(touches) != 1:
        raise ValueError(f"{len(touches)} touches at once are not built; give one.")
    (punch, touch), = touches
    sensor = _Sensor(body, skin, electrodes, drive, law)
    change = min(_changes(sensor, punch, touch, signal, method), key=lambda c: c.error)
    untouched = solve_rim(body, electrodes, sensor.conductance_S).impedance_Ohm
    baseline, dv = read_out(drive, untouched), read_out(drive, change.impedance_Ohm)
    return Readings(baseline + dv, baseline, dv, untouched + change.impedance_Ohm, change.error,
                    extrapolated_fraction(body, punch, touch, skin, law), change.unknowns,
                    time.process_time() - start, change.method)


def _changes(sensor: _Sensor, punch: Punch, touch: Touch, signal: float, method: str) -> Iterator[_Change]:
    """Attempts in the order of their cost; the last one meets the wanted error, or none does."""
    if method == "multipole" and touch.rim is not None:
        raise ValueError("method 'multipole' needs an axisymmetric touch; near the rim use 'mesh' or 'auto'.")
    if method != "mesh" and touch.rim is None:
        change = _by_multipole(sensor, punch, touch, signal)
        yield change
        if method == "multipole" or change.error <= signal or punch.conductor:
            return
    if punch.conductor:
        raise ValueError("conductor = true is built for method 'multipole' only.")
    yield _by_mesh(sensor, punch, touch, signal)


def _by_multipole(sensor: _Sensor, punch: Punch, touch: Touch, signal: float) -> _Change:
    """Rings are cut until they no longer matter; then the harmonics are varied once."""
    body, electrodes, sheet = sensor.body, sensor.electrodes, sensor.conductance_S
    room = body.radius_m - math.hypot(punch.x_m, punch.y_m)
    if room <= touch.contact_radius_m:
        raise ValueError(f"the contact reaches {(touch.contact_radius_m - room) * 1e3:.1f} mm beyond the rim of the "
                         "disc; move the punch inwards.")
    rim = solve_rim(body, electrodes, sheet)

    def tau(parts: int) -> Array:
        return scattering(punch, touch, sensor.skin, sensor.law, room, ORDERS, parts)

    def scattered(tau: Array, harmonics: int = HARMONICS) -> Array:
        return impedance_change(rim, body, electrodes, sheet, punch, room, tau, harmonics)

    coarse, fine = tau(PARTS[0]), tau(PARTS[1])
    for parts in PARTS[2:]:
        if _difference(sensor, scattered(fine), scattered(coarse)) <= 3 * signal / 4:
            break
        coarse, fine = fine, tau(parts)
    near = scattered(fine)
    beyond = first_order_change(body, electrodes, sheet, punch, touch, sensor.skin, sensor.law, room)
    error = _difference(sensor, near, scattered(coarse)) / 3
    error += _difference(sensor, near, scattered(fine[:3 * ORDERS // 4], 3 * HARMONICS // 4))
    error += 4 * abs(fine[0]) * _difference(sensor, near + beyond, near)
    return _Change(near + beyond, error, 2 * ORDERS, "multipole")


def _by_mesh(sensor: _Sensor, punch: Punch, touch: Touch, signal: float) -> _Change:
    """The mesh is refined until the coarser one agrees."""
    coarse, _ = _on_mesh(sensor, punch, touch, LEVELS[0])
    change, unknowns, error = coarse, 0, math.inf
    for level in LEVELS[1:]:
        change, unknowns = _on_mesh(sensor, punch, touch, level)
        error = _difference(sensor, change, coarse) / 3
        if error <= signal:
            break
        coarse = change
    return _Change(change, error, unknowns, "mesh")


def _on_mesh(sensor: _Sensor, punch: Punch, touch: Touch, level: int) -> tuple[Array, int]:
    mesh = template(sensor.body, sensor.electrodes, punch, touch, level)
    pattern, z = sparsity(mesh), sensor.electrodes.contact_impedance_Ohm_m
    touched = sheet_conductance(quadrature_points(mesh), punch, touch, sensor.skin, sensor.law)
    untouched = np.full(len(mesh.cells), sensor.conductance_S)
    first, second = (impedance(mesh, s, z, pattern=pattern, refinements=0) for s in (touched, untouched))
    return first - second, pattern.size - 1


def _difference(sensor: _Sensor, change: Array, other: Array) -> float:
    """Relative difference of the readings of two changes, 2-norm; 0 where neither changes anything."""
    signal, gap = (np.linalg.norm(read_out(sensor.drive, z)) for z in (change, other - change))
    return float(gap / signal) if gap > 0 else 0.0
