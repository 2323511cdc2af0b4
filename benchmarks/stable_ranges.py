"""Where along each test mode the laws of the random scenes keep Drucker's condition and strong ellipticity.

results/stable_ranges.csv: the strains of every law, mode and criterion, in stretches that are kept or lost;
results/stable_functions.csv: h(lambda) = sum mu_i lambda^alpha_i over mu_0, whose sign is Drucker's condition where
every nu is 0. Run by `make bench`.
"""

from collections.abc import Iterator, Sequence

import numpy as np
from conditions import written
from random_scenes import LAWS

from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.stability import stability

STRETCHES = np.linspace(0.05, 2.0, 196)


def pieces(scanned: Sequence[float], lost: Sequence[Sequence[float]]) -> Iterator[tuple[float, float, str]]:
    """The scanned strains from end to end, cut where a condition is lost or regained."""
    at = scanned[0]
    for low, high in lost:
        if low > at:
            yield at, low, "kept"
        yield low, high, "lost"
        at = high
    if at < scanned[1]:
        yield at, scanned[1], "kept"


def ranges(name: str, law: Hyperfoam) -> Iterator[dict[str, object]]:
    for criterion, modes in stability(law).items():
        for mode, found in modes.items():
            for low, high, state in pieces(found["scanned"], found["unstable_strain"]):  # type: ignore[arg-type]
                yield {"law": name, "criterion": criterion, "mode": mode, "strain_from": low, "strain_to": high,
                       "state": state}


def function(name: str, law: Hyperfoam) -> Iterator[dict[str, object]]:
    if np.any(law.nu):
        return
    for stretch in STRETCHES:
        yield {"law": name, "stretch": stretch,
               "h_over_mu_0": float(np.sum(law.mu_Pa * stretch**law.alpha)) / law.mu_0_Pa}


def main() -> None:
    table = written([row for name, law in LAWS.items() for row in ranges(name, law)], "stable_ranges", 6)
    written([row for name, law in LAWS.items() for row in function(name, law)], "stable_functions", 6)
    print(table[table["state"] == "lost"].to_string(index=False))


if __name__ == "__main__":
    main()
