"""Loops of cycles that repeat themselves, fitted from noisy tables of rubbers and foams: by the card's own law, by laws
of others, and where there is none.

Run by `make bench`, or by hand with SEEDS [KIND ...]; writes results/steady_loops.csv next to this file, where kinds
that were not run keep their earlier rows. A table has two cycles at each of three random amplitudes, by turns of a
rubber in tension and of a foam in compression, with softening and set, and noise of 0.3 or 1 % of the largest stress,
white or correlated by 0.9 from row to row. Kinds: own; none; jump (a share of the stress is missing in unloading at
once); exponential (it comes exponentially in the strain, after every turn: Dahl); relaxation (two Prony terms that the
card lacks); friction (a spring of constant strength that slips, in parallel). Per seed: the loop of the card; relative
RMS along the path; what the last cycle loses of the work put in, true and of the card; relative RMS and loss of other
cycles, closed inside one another, without noise; whether each 95 % interval holds what was hidden.
"""

import argparse
import time
from collections.abc import Callable
from dataclasses import asdict, replace

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

import matcal
from matcal.laws.histories.strain_paths import follow
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.law import Law, scaled
from matcal.laws.prony import Prony

RUBBER = Hyperfoam(np.array([60e3]), np.array([2.5]), np.array([0.45]))
FOAM = Hyperfoam(np.array([18e3, 2e3]), np.array([8.0, -1.8]), np.zeros(2))
MOST = {1.0: 1.2, -1.0: 0.7}  # largest strain in tension and in compression
OTHER = (0.9, 0.4, 0.9, 0.0, 0.9, 0.6, 0.75, 0.2, 0.9, 0.0)  # turns of other cycles, over the largest strain
POINTS, AR = 60, 0.9
Stress = Callable[[np.ndarray], np.ndarray]


def path(turns: np.ndarray) -> np.ndarray:
    """Strains from rest to each turn, evenly spaced."""
    ends = np.r_[0.0, turns]
    steps = np.maximum((POINTS * np.abs(np.diff(ends)) / np.abs(turns).max()).astype(int), 8)
    return np.r_[0.0, *(np.linspace(a, b, n + 1)[1:] for a, b, n in zip(ends, turns, steps, strict=False))]


def own(law: Law, damage: matcal.Damage, rng: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    damage = replace(damage, loop_share=rng.uniform(0.05, 0.4), loop_turn=rng.uniform(0.1, 0.9))
    return damage, lambda e: follow(law, "uniaxial", e, damage)


def none(law: Law, damage: matcal.Damage, _: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    return damage, lambda e: follow(law, "uniaxial", e, damage)


def jump(law: Law, damage: matcal.Damage, rng: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    kept = rng.uniform(0.7, 0.95)
    return damage, lambda e: follow(law, "uniaxial", e, damage) * np.where(np.diff(np.abs(e), prepend=0) < 0, kept, 1)


def exponential(law: Law, damage: matcal.Damage, rng: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    share, length = rng.uniform(0.1, 0.35), rng.uniform(0.03, 0.2)

    def stress(e: np.ndarray) -> np.ndarray:
        q, out = 1.0, []
        for step in np.diff(np.abs(e), prepend=0.0):
            q = np.sign(step) + (q - np.sign(step)) * np.exp(-abs(step) / length) if step else q
            out.append(q)
        return follow(law, "uniaxial", e, damage) * (1 - share * (1 - np.array(out)) / 2)

    return damage, stress


def relaxation(law: Law, damage: matcal.Damage, rng: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    prony = Prony(0.1 * np.ones(2) * rng.uniform(0.5, 1.5), np.array([3.0, 30.0]))
    fast = scaled(replace(law, moduli="instantaneous"), 1 / prony.g_infinity)
    rate_per_s = rng.choice([0.01, 0.05])

    def stress(e: np.ndarray) -> np.ndarray:
        time_s = np.cumsum(np.abs(np.diff(e, prepend=0.0))) / rate_per_s
        return follow(fast, "uniaxial", e, damage, time_s, prony)

    return damage, stress


def friction(law: Law, damage: matcal.Damage, rng: np.random.Generator) -> tuple[matcal.Damage, Stress]:
    side = 1.0 if law is RUBBER else -1.0
    slip = rng.uniform(0.02, 0.1) * MOST[side]
    strength = rng.uniform(0.03, 0.1) * abs(float(matcal.nominal_stress(law, "uniaxial", 0.85 * side * MOST[side])))

    def stress(e: np.ndarray) -> np.ndarray:
        q, out = 0.0, []
        for step in np.diff(e, prepend=0.0):
            q = min(max(q + step / slip, -1.0), 1.0)
            out.append(q)
        return follow(law, "uniaxial", e, damage) + strength * np.array(out)

    return damage, stress


KINDS = {made.__name__: made for made in (own, none, jump, exponential, relaxation, friction)}


def loss(strain: np.ndarray, stress: np.ndarray) -> float:
    """Work lost along a path over the work put in."""
    work = 0.5 * (np.abs(stress)[1:] + np.abs(stress)[:-1]) * np.diff(np.abs(strain))
    return float(work.sum() / work[work > 0].sum())


def noise(count: int, correlated: bool, rng: np.random.Generator) -> np.ndarray:
    """Errors of unit size (count,)."""
    out = rng.standard_normal(count)
    for k in range(1, count if correlated else 0):
        out[k] = AR * out[k - 1] + np.sqrt(1 - AR**2) * out[k]
    return out


def row(kind: str, seed: int) -> dict[str, float | str]:
    """Row of one seed."""
    rng = np.random.default_rng([49, seed])
    side = 1.0 if seed % 2 == 0 else -1.0
    law, most = (RUBBER, MOST[side]) if side > 0 else (FOAM, MOST[side])
    turns = np.repeat(np.sort(rng.uniform(0.3, 1.0, 3)) * most, 2)
    damage = matcal.Damage(rng.uniform(1.3, 3), rng.uniform(2e3, 2e4) * (1.0 if side > 0 else 0.1), rng.uniform(0, 0.4),
                           float(rng.choice([0.0, rng.uniform(0, 0.1)])))
    hidden, stress = KINDS[kind](law, damage, rng)
    strain = side * path(np.column_stack([turns, np.zeros(6)]).ravel())
    true = stress(strain)
    size, correlated = float(rng.choice([0.003, 0.01])), bool(rng.choice([False, True]))
    seen = true + size * np.abs(true).max() * noise(true.size, correlated, rng)
    begun = time.process_time()
    card = matcal.fit([{"uniaxial": (strain, seen)}], branch="all", order=law.mu_Pa.size, poisson=float(law.nu[0])).card
    spent = time.process_time() - begun
    other = side * path(np.array(OTHER) * turns[-1])
    real, found = stress(other), matcal.follow_path(card, "uniaxial", other)["stress_Pa"]
    part = card.fit["softening"]
    measured, fitted = part["lost"][0]
    held = {f"{name}_held": int(low <= asdict(hidden)[name] <= high) for name, (low, high) in part["interval"].items()
            } if kind in ("own", "none") else {}
    return {"kind": kind, "seed": seed, "noise": size, "correlated": int(correlated),
            "loop_share": card.softening.loop_share, "loop_turn": card.softening.loop_turn,
            "looped": int(card.softening.loop_share > 0), "path_rms": part["relative_rms"][0],
            "last_loss": measured, "last_loss_fitted": fitted, "last_loss_error": abs(fitted - measured),
            "other_rms": float(np.sqrt(np.mean((found - real)**2) / np.mean(real**2))),
            "other_loss": loss(other, real), "other_loss_error": abs(loss(other, found) - loss(other, real)),
            **held, "cpu_s": spent}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("seeds", nargs="?", type=int, default=quick(50, 2))
    parser.add_argument("kinds", nargs="*", default=list(KINDS))
    asked = parser.parse_args()
    if unknown := set(asked.kinds) - set(KINDS):
        parser.error(f"unknown kind {', '.join(sorted(unknown))}; known: {', '.join(KINDS)}")
    table = pd.DataFrame([row(kind, seed) for kind in asked.kinds for seed in range(asked.seeds)])
    old = earlier("steady_loops")
    if len(old):
        table = pd.concat([old[~old["kind"].isin(asked.kinds)], table], ignore_index=True)
    shown(written(table, "steady_loops"))


if __name__ == "__main__":
    main()
