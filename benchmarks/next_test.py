"""Does the test that `matcal next` names narrow mu_0, and the depth of a touch, as no other does, and as promised?

Synthetic foams of two terms, drawn at random: compression to -0.5 with 1 % noise, and in every other one tension to
0.2. The best test of each family is simulated and fitted with the others, two terms as in the foam; planar tests are
biaxial ones again, for nu is 0. All of it, the first tests too, is repeated with other noise, and mean widths are
compared: a part of each interval, what one more term changes, is a draw of the noise itself. A row a foam and quantity
into results/next_test.csv: what the named test was promised to narrow, what it did, and what the family that did best
in the mean did. `python benchmarks/next_test.py FIRST LAST [QUANTITY]` does some foams.
"""

import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written

import matcal
from matcal.reduction.experiment import Experiment

NAME = "next_test"
REPEATS = {"mu_0": 5, "touch": 2}


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
    scene = folder / "scene.toml"
    scene.write_text(f"[punch]\ndiameter_mm = 14\nforce_N = {mu_0 * 1e-4 * rng.uniform(0.4, 1.0):.4g}\n", "utf-8")
    asked = f"touch:{scene}" if quantity == "touch" else quantity
    out: dict[str, object] = {"foam": number, "quantity": quantity, "tests": len(ends)}
    try:
        drawn = [widths(law, ends, asked, np.random.default_rng([number, k])) for k in range(REPEATS[quantity])]
    except (RuntimeError, ValueError) as error:
        return out | {"outcome": f"{type(error).__name__}: {str(error)[:60]}"}
    before, after = sum(each[0] for each in drawn), pd.DataFrame([each[1] for each in drawn]).sum(min_count=len(drawn))
    reached = 1 - sum(next(iter(each[1].values())) for each in drawn) / before
    best, promised = max(float((1 - after / before).max()), reached), float(np.mean([each[2] for each in drawn]))
    return out | {"named": Counter(each[3] for each in drawn).most_common(1)[0][0], "promised": f"{promised:.3f}",
                  "reached": f"{reached:.3f}", "best": f"{best:.3f}", "of_best": f"{reached / best:.3f}",
                  "nearly_best": int(reached >= 0.9 * best), "promise_off": f"{abs(promised / reached - 1):.3f}",
                  "cpu_s": f"{time.process_time() - begun:.1f}", "outcome": "ok"}


def widths(law: matcal.Hyperfoam, ends: tuple[float, ...], asked: str, rng: np.random.Generator
           ) -> tuple[float, dict[tuple[object, ...], float], float, str]:
    """With one draw of all noise: standard deviation before and, by family, after its best test, that of the named test
    first; what this was promised to narrow, and what it is."""
    tests = [measured(law, "uniaxial", end, rng) for end in ends]
    found = matcal.next_tests(matcal.fit(tests, order=2).card, asked)
    tried = [each for each in found.families if each.test.kind != "planar"]
    after = {each.test.family: matcal.next_tests(matcal.fit([*tests, measured(
        law, each.test.kind, each.test.strain_to, rng)], order=2).card, asked).sd for each in tried}
    return found.sd, after, tried[0].narrows_by, f"{tried[0].test.kind} to {tried[0].test.strain_to:.3g}"


def main() -> None:
    """Simulate and write all rows, those of an earlier run kept where they are other foams."""
    first, last = (int(word) for word in sys.argv[1:3]) if len(sys.argv) > 2 else (0, quick(30, 1))
    quantities = sys.argv[3:4] or ("mu_0", "touch")
    rows = earlier(NAME).to_dict("records")
    with tempfile.TemporaryDirectory() as place:
        for quantity in quantities:
            for number in range(first, last):
                rows = [*(one for one in rows if (one["foam"], one["quantity"]) != (number, quantity)),
                        row(number, quantity, Path(place))]
                written(rows, NAME)
    shown(earlier(NAME))


if __name__ == "__main__":
    main()
