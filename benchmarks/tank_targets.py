"""Targets in a water tank, the calibration of its untouched frame frozen: what stays unexplained of their readings.

Usage: python benchmarks/tank_targets.py. Writes results/tank_targets.csv, a row a target and calibration. The tank of
the Kuopio tomography challenge 2023, ../shared/real/tank, which is not part of the repository. Known of a target: its
mask, 0 water, 1 resistive, 2 conductive. Fitted to its own frame: one conductance for each of the two over that of
water, and which way the picture of the mask lies, the same for all; no parameter of the sensor is. "usual": contacts
and width alone were calibrated; "full": all groups.
"""

from pathlib import Path
from typing import Any

import numpy as np
from conditions import shown, written
from scipy.optimize import minimize

from eitsim.electrics.cem.assembly import SkinMesh, impedance
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.electrodes import contact_impedances
from eitsim.sensors.calibration.calibrate import calibrate, untouched
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, instrument_readings
from eitsim.sensors.calibration.stages import Untouched, fit
from eitsim.sensors.recording import read_recording
from eitsim.sensors.sensor_file import read_sensor
from touchcal.arrays import Array, Index

TANK = Path(__file__).parents[2] / "shared" / "real" / "tank"
# Conductance over that of water that a fit starts from, resistive and conductive, and its limits.
FIRST, LIMITS = {1: 0.05, 2: 20.0}, (1e-3, 1e3)


def meshed(instrument: Instrument, state: Array) -> SkinMesh:
    """The disc with a state's electrodes, rings of 4 mm and finer ones at the rim: 0.05 % of the untouched readings off
    the driven electrodes."""
    built = instrument.built(state)
    angles, owner = rim_angles(instrument.body, built, 2)
    radii = instrument.body.radius_m * np.concatenate([np.linspace(0, 0.94, 27), 1 - np.geomspace(0.04, 1e-3, 10), [1]])
    return ring_mesh(radii, np.zeros((len(radii), 2)), angles, owner, built.count)


def shares(mesh: SkinMesh, mask: Array, radius_m: float) -> Array:
    """(cells, 3) part of a cell's nodes in water, resistive and conductive material, by a picture of the disc."""
    places = mesh.nodes_m[mesh.cells] / radius_m
    pixel = np.clip((places + 1) / 2 * len(mask), 0, len(mask) - 1).astype(np.intp)
    kind = mask.ravel()[pixel[..., 1] * len(mask) + pixel[..., 0]]
    return np.stack([(kind == k).mean(axis=1) for k in range(3)], axis=1)


def left(instrument: Instrument, state: Array, mesh: SkinMesh, frame: Untouched, part: Array, factors: Array) -> float:
    """2-norm of the readings off the driven electrodes that a target leaves unexplained, over theirs."""
    conductance = np.exp(state[0] + part @ np.concatenate([[0.0], np.log(factors)]))
    z = impedance(mesh, conductance, contact_impedances(instrument.built(state)))
    model = instrument_readings(instrument, frame.asked, state, np.asarray(np.linalg.pinv(z), dtype=float))
    where = frame.off_driven
    return float(np.linalg.norm((frame.volts - model)[where]) / np.linalg.norm(frame.volts[where]))


def turned(mask: Array, way: int) -> Array:
    """One of the eight ways in which a picture may lie."""
    return np.rot90(mask if way < 4 else mask.T, way % 4)


def main() -> None:
    """Write the table and print it."""
    known = read_sensor(TANK / "sensor.toml")
    recording = read_recording(TANK / "frames.csv", kind=known.kind)
    found, water = calibrate(known, recording), untouched(known, recording)
    assert found.instrument is not None
    assert found.fit is not None
    held = found.instrument
    states = {"usual": fit(held, water, tuple(GROUPS)[:3], held.prior_mean).state, "full": found.fit.state}
    meshes = {name: meshed(held, state) for name, state in states.items()}
    masks = {name: np.array([list(map(int, line)) for line in (
        TANK / f"target_{name}_mask.csv").read_text(encoding="utf-8").split()]) for name in (1, 2)}
    frames = {name: Untouched(water.asked, recording.readings[name].reshape(water.volts.shape)) for name in masks}
    first = np.array([FIRST[1], FIRST[2]])
    ways = [sum(left(held, states["full"], meshes["full"], frames[name],
                     shares(meshes["full"], turned(mask, way), held.body.radius_m), first)
                for name, mask in masks.items()) for way in range(8)]
    way = int(np.argmin(ways))
    rows: list[dict[str, Any]] = []
    for name, mask in masks.items():
        for calibration, state in states.items():
            mesh = meshes[calibration]
            part = shares(mesh, turned(mask, way), held.body.radius_m)
            there: Index = np.flatnonzero(part[:, 1:].any(axis=0))

            def loss(log: Array, there: Index = there, state: Array = state, mesh: SkinMesh = mesh, part: Array = part,
                     frame: Untouched = frames[name]) -> float:
                factors = first.copy()
                factors[there] = np.exp(log)
                return left(held, state, mesh, frame, part, factors)

            best = minimize(loss, np.log(first[there]), method="Nelder-Mead", bounds=[np.log(LIMITS)] * len(there),
                            options={"maxfev": 40, "xatol": 0.02, "fatol": 1e-4})
            rows.append({"target": name, "calibration": calibration, "way": way, "unexplained": best.fun,
                         "water_unexplained": left(held, state, mesh, water, part * 0 + [1, 0, 0], first),
                         **{f"factor_{kind + 1}": value for kind, value in zip(there, np.exp(best.x), strict=True)}})
    shown(written(rows, "tank_targets"))


if __name__ == "__main__":
    main()
