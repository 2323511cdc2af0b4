"""What the readings of an untouched sensor say of their order: scrambled simulated frames, named, asked or wrong.

Usage: python benchmarks/sensor_inspect.py. Writes results/sensor_inspect.csv, a row a baseline. Synthetic: discs with
8, 16 or 32 electrodes on the rim, by the complete electrode model on meshes of the disc, in a convention drawn from
those that are searched. Unknown to the inspection: electrodes of 0.25 to 0.6 of their spacing, displaced by 1 % of it
(standard deviation), contact impedances that differ by 20 %, a sheet that varies smoothly by some 10 %, channels whose
gains differ by 0.5 %, white noise 40 dB below the frame's r.m.s., the electrodes' place on the body, and all of the
convention; a third of the frames are magnitudes. Other cases, fewer each: "even", without any imperfection but noise,
where many orders look the same; "dead", a voltage channel gives 0; "exchanged", the leads of two neighbours.
"""

import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from conditions import quick, written

from eitsim.electrics.cem.assembly import impedance
from eitsim.electrics.mesh.ring_mesh import rim_angles, ring_mesh
from eitsim.scene.electrodes import Electrodes
from eitsim.scene.scene import Body
from eitsim.sensors.conventions import MEAN, Convention, forms
from eitsim.sensors.inspection import Inspection, inspect
from eitsim.sensors.recording import Recording
from touchcal.arrays import Array, Index

BASELINES, NOISE_DB = {"imperfect": 200, "even": 40, "dead": 40, "exchanged": 40}, 40.0
COUNTS = (8, 16, 16, 32)
DISPLACED, CONTACTS, SHEET, GAINS = 0.01, 0.2, 0.05, 0.005


@dataclass(frozen=True)
class Scrambled:
    """One simulated untouched frame and how it was made."""

    frame: Array  # (readings,)
    convention: Convention
    sign: int  # 1, -1, or 0 for magnitudes
    case: str  # one of BASELINES


def scrambled(seed: int, case: str = "imperfect") -> Scrambled:
    """A baseline of a disc, in a convention drawn at random."""
    rng = np.random.default_rng([22, seed])
    convention = drawn(rng, int(rng.choice(COUNTS)))
    place = transfer(rng, convention.count, 0.0 if case == "even" else 1.0)
    if case == "exchanged":
        leads = np.arange(convention.count)
        leads[:2] = 1, 0
        place = place[np.ix_(leads, leads)]
    pairs = convention.pairs()
    moved = np.where(pairs == MEAN, MEAN, (rng.choice([-1, 1]) * pairs + rng.integers(convention.count))
                     % convention.count)
    source, sink, plus, minus = moved.T
    high = place[plus, source] - place[plus, sink]
    low = np.where(minus == MEAN, 0.0, place[minus, source] - place[minus, sink])
    _, channel = np.unique(pairs[:, 2:], axis=0, return_inverse=True)
    gains = 1 + (case != "even") * GAINS * rng.normal(size=channel.max() + 1)
    frame = (high - low) * gains[np.ravel(channel)]
    frame += 10 ** (-NOISE_DB / 20) * np.sqrt(np.mean(frame**2)) * rng.normal(size=frame.shape)
    if case == "dead":
        frame[(pairs[:, 2:] == rng.integers(convention.count)).any(axis=1)] = 0.0
    sign = int(rng.choice([1, -1, 0]))
    return Scrambled(np.abs(frame) if sign == 0 else sign * frame, convention, sign, case)


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


def transfer(rng: np.random.Generator, count: int, imperfect: float) -> Array:
    """(count, count) impedance matrix of a disc of 1 S whose electrodes, sheet and contacts are that imperfect."""
    body, pitch = Body(), 2 * np.pi / count
    angles = pitch * (np.arange(count) + imperfect * DISPLACED * rng.normal(size=count)) + 1.0
    width = rng.uniform(0.25, 0.6) * pitch * body.radius_m
    contact = 10 ** rng.uniform(-2.5, -0.5) * body.radius_m * np.exp(imperfect * CONTACTS * rng.normal(size=count))
    ring = Electrodes(count=count, width_m=width, angles_rad=tuple(angles), contact_impedance_Ohm_m=tuple(contact))
    rim, owner = rim_angles(body, ring, 1)
    radii = body.radius_m * np.concatenate([[0.0], 1 - np.geomspace(0.9, 5e-3, 16), [1.0]])
    mesh = ring_mesh(radii, np.zeros((len(radii), 2)), rim, owner, count)
    x, y = mesh.nodes_m[mesh.cells].mean(axis=1).T / body.radius_m
    waves = np.stack([x, y, x**2 - y**2, 2 * x * y, x**2 + y**2 - 0.5], axis=1)
    return impedance(mesh, np.exp(waves @ (imperfect * 2 * SHEET * rng.normal(size=5))), contact)


def verdict(given: Scrambled, found: Inspection) -> str:
    """ "named" where pattern, order, turn, direction and sign are said and right, "asked" where one of them is left
    open and what is said is right, else "wrong"; "missed" where exchanged leads are not said and all else is right."""
    order = found.identified.order
    if order is None:
        pattern = found.identified.words()["pattern"]
        return "asked" if pattern in (None, given.convention.pattern) else "wrong"
    relation = ring_sign(given.convention.pairs(), order.pairs, given.convention.count)
    if order.count != given.convention.count or not relation:
        return "wrong"
    one_sign = bool((given.frame >= 0).all())
    right = {"magnitude": given.sign == 0, "either": one_sign, "positive": given.sign == relation,
             "negative": given.sign == -relation}
    if found.identified.sign == "unknown":
        return "asked"
    if not right[found.identified.sign] or (found.identified.swapped and given.case != "exchanged"):
        return "wrong"
    return "missed" if given.case == "exchanged" and not found.identified.swapped else "named"


def ring_sign(one: Index, other: Index, count: int) -> int:
    """1 or -1 where lists of pairs differ by a turn or a mirror of the ring and by that sign throughout, else 0."""
    if one.shape != other.shape:
        return 0
    target = forms(other, True)
    for way in (1, -1):
        for turn in range(count):
            found = forms(np.where(one == MEAN, MEAN, (way * one + turn) % count), True)
            signs = np.unique(found[:, 4] * target[:, 4])
            if np.array_equal(found[:, :4], target[:, :4]) and len(signs) == 1:
                return int(signs[0])
    return 0


def row(seed: int, case: str) -> dict[str, Any]:
    """One baseline: what it was, what was said of it, and the time that took."""
    given = scrambled(seed, case)
    frame = given.frame[None]
    recording = Recording(frame, np.zeros(1, dtype=np.int64), None, np.array([""]), "voltage", Path("simulated"))
    begun = time.process_time()
    found = inspect(recording)
    one = given.convention
    return {"case": case, "seed": seed, "electrodes": one.count, "readings": given.frame.size, "pattern": one.pattern,
            "reference": one.reference, "read_step": one.read_step, "kept": one.kept, "rotating": one.rotating,
            "first": one.first, "advance": one.advance, "by_reading": one.by_reading, "sign": given.sign,
            "verdict": verdict(given, found), "plausible": len(found.identified.plausible),
            "unexplained": found.identified.unexplained, "cpu_s": time.process_time() - begun}


def main() -> None:
    """Write the table and print its summary."""
    rows = [row(seed, case) for case, most in BASELINES.items() for seed in range(quick(most, 6))]
    table = written(rows, "sensor_inspect")
    print(table.groupby("case")["verdict"].value_counts().unstack(fill_value=0).to_string())


if __name__ == "__main__":
    main()
