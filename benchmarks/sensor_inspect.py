"""What the readings of an untouched sensor say of their order: scrambled simulated frames, named, asked or wrong.

Usage: python benchmarks/sensor_inspect.py. Writes results/sensor_inspect.csv, a row a baseline. Synthetic: discs with 8,
16 or 32 electrodes on the rim, by the complete electrode model on meshes of the disc. Unknown to the inspection:
electrodes of 0.25 to 0.6 of their spacing, displaced by 1 % of it (standard deviation), contact impedances that differ
by 20 %, a sheet that varies smoothly by some 10 %, channels whose gains differ by 0.5 %, white noise 40 dB below the
frame's r.m.s., the electrodes' place on the body, and all of the convention; a third of the frames are magnitudes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body
from eitsim.sensors.conventions import MEAN, Convention
from touchcal.arrays import Array

BASELINES, NOISE_DB = 200, 40.0
COUNTS = (8, 16, 16, 32)
DISPLACED, CONTACTS, SHEET, GAINS = 0.01, 0.2, 0.05, 0.005


@dataclass(frozen=True)
class Scrambled:
    """One simulated untouched frame and how it was made."""

    frame: Array  # (readings,)
    convention: Convention
    sign: int  # 1, -1, or 0 for magnitudes


def scrambled(seed: int) -> Scrambled:
    """A baseline of a disc that is not perfect, in a convention drawn at random."""
    rng = np.random.default_rng([22, seed])
    convention = drawn(rng, int(rng.choice(COUNTS)))
    place = transfer(rng, convention.count)
    pairs = convention.pairs()
    moved = np.where(pairs == MEAN, MEAN, (rng.choice([-1, 1]) * pairs + rng.integers(convention.count))
                     % convention.count)
    source, sink, plus, minus = moved.T
    high = place[plus, source] - place[plus, sink]
    low = np.where(minus == MEAN, 0.0, place[minus, source] - place[minus, sink])
    _, channel = np.unique(pairs[:, 2:], axis=0, return_inverse=True)
    frame = (high - low) * (1 + GAINS * rng.normal(size=channel.max() + 1))[np.ravel(channel)]
    frame += 10 ** (-NOISE_DB / 20) * np.sqrt(np.mean(frame**2)) * rng.normal(size=frame.shape)
    sign = int(rng.choice([1, -1, 0]))
    return Scrambled(np.abs(frame) if sign == 0 else sign * frame, convention, sign)


def drawn(rng: np.random.Generator, count: int) -> Convention:
    """A convention of the kinds that boards and programs have."""
    step = int(rng.choice([1, 1, 1, count // 2, 2, 3]))
    reference, read_step, kept = [("pair", 1, "undriven"), ("pair", 1, "undriven"), ("pair", 1, "all"),
                                  ("before", 0, "undriven"), ("mean", 0, "all")][int(rng.integers(5))]
    if reference == "pair" and step == 2 and rng.random() < 0.5:
        read_step = 2
    rotating = reference == "before" or bool(rng.random() < 0.5)
    return Convention(count, count, step, reference, read_step, kept, rotating, int(rng.integers(count)),
                      int(rng.choice([1, -1])), by_reading=rotating and bool(rng.random() < 0.25))


def transfer(rng: np.random.Generator, count: int) -> Array:
    """(count, count) impedance matrix of a disc of 1 S that is displaced, uneven and in uneven contact."""
    body, pitch = Body(), 2 * np.pi / count
    angles = pitch * (np.arange(count) + DISPLACED * rng.normal(size=count)) + 1.0
    width = rng.uniform(0.25, 0.6) * pitch * body.radius_m
    contact = 10 ** rng.uniform(-2.5, -0.5) * body.radius_m * np.exp(CONTACTS * rng.normal(size=count))
    ring = Electrodes(count=count, width_m=width, angles_rad=tuple(angles), contact_impedance_Ohm_m=tuple(contact))
    rim, owner = rim_angles(body, ring, 1)
    radii = body.radius_m * np.concatenate([[0.0], 1 - np.geomspace(0.9, 5e-3, 16), [1.0]])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), rim, owner, count)
    x, y = mesh.nodes_m[mesh.cells].mean(axis=1).T / body.radius_m
    waves = np.stack([x, y, x**2 - y**2, 2 * x * y, x**2 + y**2 - 0.5], axis=1)
    return impedance(mesh, np.exp(waves @ (2 * SHEET * rng.normal(size=5))), contact)
