"""Laws of hidden layers from one flat and one round punch, the presses solved by another program.

Synthetic: foams and rubbers drawn at random are pressed by `peers/bonded_layer.py`; friction, thickness, contact
points, load cell and machine are hidden too, and what is read is noisy. A row a layer into results/identify.csv, as
they are done: errors of mu_0 and plateau, whether their 95 % intervals hold the truth, what is not determined.
`python benchmarks/identify.py FIRST LAST` does some of them. Pin threads to one as `make bench` does.
"""

import sys
import time

import numpy as np
from conditions import earlier, quick, shown, written
from peers.bonded_layer import RigidPunch, Slope, pressed
from scipy.interpolate import CubicSpline

from eitsim.presses.identify import identify
from eitsim.presses.press_file import Press, punch_of
from eitsim.presses.press_model import PressSetup
from matcal.card import MaterialCard
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law

NAME = "identify"
KAPPA = 1000.0  # of rubbers, over mu_0
THICKNESS_M, FILLET_M = 0.01, 0.0005
SIZE = 0.025  # of the peer's elements, over the thickness
SETUP = PressSetup(THICKNESS_M)
# Where fits start: never the hidden law, for rubbers not even its kind.
STARTS = {"foam": law_of("hyperfoam", [[8e3, 2e3], [8.0, -2.0], [0.0, 0.0]]),
          "rubber": law_of("yeoh", [[15e3], [100.0], [1.0], [0.5]])}


def hidden(kind: str, rng: np.random.Generator) -> tuple[Law, Slope]:
    """A law, and the derivatives of its energy by the stretches, over mu_0, written here again."""
    if kind == "foam":
        mu_0, share = float(np.exp(rng.uniform(np.log(4e3), np.log(4e4)))), rng.uniform(0.1, 0.5)
        mu, alpha = np.array([1 - share, share]), np.array([rng.uniform(4.0, 16.0), rng.uniform(-4.0, -1.0)])
        return (law_of("hyperfoam", [(mu_0 * mu).tolist(), alpha.tolist(), [0.0, 0.0]]),
                lambda x: sum(2 * m / a * (x**a - 1) / x for m, a in zip(mu, alpha, strict=True)))
    mu_0, most = float(np.exp(rng.uniform(np.log(2e4), np.log(3e5)))), rng.uniform(8.0, 60.0)

    def gent(x: np.ndarray) -> np.ndarray:
        volume = x.prod(axis=0) ** (-2 / 3)
        first = (x**2).sum(axis=0) * volume
        return 0.5 / (1 - (first - 3) / most) * (2 * x * volume - 2 / 3 * first / x)

    return law_of("gent", [[mu_0], [most], [0.5]]), gent


def presses(kind: str, law: Law, slope: Slope, rng: np.random.Generator, truth: dict[str, float]) -> list[Press]:
    """What the machine reads of both punches."""
    deepest = 0.35 if kind == "foam" else 0.14
    thickness = THICKNESS_M * (1 + truth["thicker"])
    depths = deepest * np.array([0.004, 0.01, 0.02, 0.04, 0.08, 0.12, 0.18, 0.25, 0.33, 0.42, 0.51, 0.6, 0.7, 0.8, 0.9,
                                 1.0])
    out = []
    for words in ("flat 14", "sphere 14"):
        radius = 0.007 / thickness
        punch = RigidPunch(radius, FILLET_M / thickness if words.startswith("flat") else radius)
        found = pressed(slope, KAPPA if kind == "rubber" else np.inf, punch, truth["friction"], depths, SIZE)
        line = np.log(found * np.array([thickness, law.mu_0_Pa * thickness**2]))
        depth = np.linspace(0.02, 1.0, 60) * np.exp(line[-1, 0])
        force = np.exp(_smooth(line, np.log(depth)))
        read = force * truth["gain"] * (1 + 0.005 * rng.normal(size=60)) + 2e-4 * force.max() * rng.normal(size=60)
        out.append(Press(words, punch_of(words), depth - rng.uniform(-1e-4, 1e-4) + truth["compliance"] * force, read))
    return out


def _smooth(line: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Cubic between points (n, 2), a power below the first."""
    found = CubicSpline(*line.T)
    slope = (line[1, 1] - line[0, 1]) / (line[1, 0] - line[0, 0])
    return np.where(at < line[0, 0], line[0, 1] + slope * (at - line[0, 0]), found(at))


def row(number: int) -> dict[str, object]:
    """One layer."""
    rng = np.random.default_rng([52, number])
    kind = ("foam", "rubber")[number % 2]
    law, slope = hidden(kind, rng)
    truth = {"friction": max(rng.uniform(-0.1, 0.6), 0.0), "thicker": rng.uniform(-0.03, 0.03),
             "gain": float(np.exp(0.005 * rng.normal())), "compliance": abs(SETUP.compliance_m_per_N * rng.normal())}
    out: dict[str, object] = {"layer": number, "kind": kind, "mu_0_Pa": f"{law.mu_0_Pa:.4g}",
                              **{name: f"{value:.3g}" for name, value in truth.items()}}
    begun = time.process_time()
    try:
        read = presses(kind, law, slope, rng, truth)
    except RuntimeError as error:
        return out | {"outcome": f"peer: {error}"}
    out["peer_cpu_s"] = f"{time.process_time() - begun:.1f}"
    try:
        found = identify(read, SETUP, MaterialCard("start", STARTS[kind]), seed=number)
    except (RuntimeError, ValueError) as error:
        return out | {"outcome": f"{type(error).__name__}: {str(error)[:60]}"}
    values = {"mu_0_Pa": law.mu_0_Pa, "plateau_Pa": -float(nominal_stress(law, "uniaxial", [-0.4])[0])}
    for name, value in values.items():
        one = found.derived[name]
        out |= {f"{name}_error": f"{one['value'] / value - 1:.4f}", f"{name}_sd": f"{one['sd'] / value:.4f}",
                f"{name}_held": int(one["lo"] <= value <= one["hi"])}
    rub = found.nuisances["friction"]
    return out | {"friction_lo": f"{rub['lo']:.3f}", "friction_hi": f"{rub['hi']:.3f}",
                  "friction_held": int(rub["lo"] <= truth["friction"] <= rub["hi"]),
                  "friction_open": int("friction" in found.not_determined), "misfit": f"{found.misfit.max():.4f}",
                  "converged": int(found.converged), "cpu_s": f"{found.cpu_s:.1f}", "outcome": "ok"}


def main() -> None:
    """Solve and write all rows, those of an earlier run kept where they are other layers."""
    first, last = (int(word) for word in sys.argv[1:3]) if len(sys.argv) > 2 else (0, quick(100, 2))
    rows = earlier(NAME).to_dict("records")
    for number in range(first, last):
        rows = [*(one for one in rows if one["layer"] != number), row(number)]
        written(rows, NAME)
    shown(earlier(NAME))


if __name__ == "__main__":
    main()
