"""Does the test that `matcal next` names narrow mu_0, and the depth of a touch, as no other does, and as promised?

Synthetic foams of two terms, drawn at random: compression to -0.5 with 1 % noise, and in every other one tension to
0.2.
The best test of each family is simulated three times and fitted with the others, two terms as in the foam; a row a foam
and quantity into results/next_test.csv: what the named test was promised to narrow, what it did in the median, and what
the best of all did. `python benchmarks/next_test.py FIRST LAST` does some foams.
"""

import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from conditions import earlier, quick, shown, written

import matcal
from matcal.reduction.experiment import Experiment

NAME = "next_test"
FAMILIES, REPEATS = 4, 3  # tests that are simulated, and how often each


def measured(law: matcal.Hyperfoam, kind: str, end: float, rng: np.random.Generator) -> Experiment:
    """One test, 1 % noise."""
    strain = np.linspace(1.0 if kind == "volumetric" else 0.0, end, 60)[1:]
    stress = matcal.nominal_stress(law, kind, strain)
    return Experiment(kind, strain, stress * (1 + 0.01 * rng.normal(size=strain.size)))


def row(number: int, quantity: str, folder: Path) -> dict[str, object]:
    """One foam."""
    rng, begun = np.random.default_rng([152, number]), time.process_time()
    mu_0, share = float(np.exp(rng.uniform(np.log(5e3), np.log(4e4)))), rng.uniform(0.1, 0.4)
    law = matcal.Hyperfoam([mu_0 * (1 - share), mu_0 * share], [rng.uniform(4, 14), rng.uniform(-4, -1)], [0.0, 0.0])
    ends = (-0.5, 0.2) if number % 2 else (-0.5,)
    tests = [measured(law, "uniaxial", end, rng) for end in ends]
    scene = folder / "scene.toml"
    scene.write_text(f"[punch]\ndiameter_mm = 14\nforce_N = {mu_0 * 1e-4 * rng.uniform(0.4, 1.0):.4g}\n", "utf-8")
    asked = f"touch:{scene}" if quantity == "touch" else quantity
    out: dict[str, object] = {"foam": number, "quantity": quantity, "tests": len(ends)}
    try:
        found = matcal.next_tests(matcal.fit(tests, order=2).card, asked)
        reached = [1 - float(np.median([matcal.next_tests(matcal.fit([*tests, measured(
            law, each.test.kind, each.test.strain_to, np.random.default_rng([number, k]))], order=2).card, asked).sd
            for k in range(REPEATS)])) / found.sd for each in found.families[:FAMILIES]]
    except (RuntimeError, ValueError) as error:
        return out | {"outcome": f"{type(error).__name__}: {str(error)[:60]}"}
    named = found.families[0]
    return out | {"named": f"{named.test.kind} to {named.test.strain_to:.3g}", "promised": f"{named.narrows_by:.3f}",
                  "reached": f"{reached[0]:.3f}", "best": f"{max(reached):.3f}",
                  "of_best": f"{reached[0] / max(reached):.3f}", "nearly_best": int(reached[0] >= 0.9 * max(reached)),
                  "promise_off": f"{np.abs(np.divide(named.narrows_by, reached[0]) - 1):.3f}",
                  "cpu_s": f"{time.process_time() - begun:.1f}", "outcome": "ok"}


def main() -> None:
    """Simulate and write all rows, those of an earlier run kept where they are other foams."""
    first, last = (int(word) for word in sys.argv[1:3]) if len(sys.argv) > 2 else (0, quick(30, 1))
    rows = earlier(NAME).to_dict("records")
    with tempfile.TemporaryDirectory() as place:
        for quantity in ("mu_0", "touch"):
            for number in range(first, last):
                rows = [*(one for one in rows if (one["foam"], one["quantity"]) != (number, quantity)),
                        row(number, quantity, Path(place))]
                written(rows, NAME)
    shown(earlier(NAME))


if __name__ == "__main__":
    main()
