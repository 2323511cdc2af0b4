"""Which sensor, and which way of learning, the paper's networks fit: the errors that it states against those found.

    python benchmarks/variants.py CARD [--stage screen best learners] [--scenes N] [--epochs N] [--only WORDS]

`screen` sweeps SCREENED touches of the paper within NEAR_MM of the disc's centre under one skin and punch after
another, all from one table of load paths: the strain that drives the conductivity, how steeply it does (the paper
prints no coefficients), a coating that thins as a layer of solids does, a punch that conducts over decades of contact
impedance, any diameter in place of five. It trains the paper's networks (`trainbr`: 208 readings, 20 hidden units) for
the eight outputs on 70 % of the rows, without noise. `best` sweeps the BEST of them, by the geometric mean of the
ratios to the paper's eight errors, at the places and with the rows of the paper. `learners` takes the first of those
and changes how it is learned: hidden units, scaling of readings, contact areas of whole elements of a mesh.

A row each variant and output: RMSE of training and of unseen rows and the paper's, and the second singular value of
the signals over the first, which tells how much more than one number they carry. All data are synthetic. Strains and
coatings that scenes have no word for take the place of the skin's rule in this process alone. Writes
results/variants.csv after each variant; rows that are not measured again stay.
"""

import argparse
import json
import math
import tempfile
from collections.abc import Iterator
from contextlib import nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from unittest.mock import patch

import numpy as np
import pandas as pd
from conditions import earlier, quick, shown, written
from faithful import PAPER

from benchmarks.paper.section import paper_value
from eitsim.scene.scene import STRAINS, Skin
from eitsim.sheet import sheet_conductance
from eitsim.sweeps.design.design import design_from
from eitsim.sweeps.run.sweep import sweep
from matcal.laws.conductivity import Conductivity, conductivity
from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.learners.bayesian_network import ensemble
from surrogate.learners.bayesian_network.bayesian_regularisation import Options
from surrogate.learners.bayesian_network.min_max import MinMax, min_max, scaled
from touchcal.arrays import Array

SEED, WORKERS, BEST = 1, 2, 4
SCREENED, NEAR_MM, SCREEN_STEPS = quick(600, 60), 45.0, quick(150, 5)
SCENES, STEPS = quick(4000, 60), quick(1000, 5)
FIVE, ANY = {"choice": [10, 12, 14, 16, 18]}, [10, 18]
# figure of the paper -> its output, for the errors on training rows
FIGURES = {"x0": "13", "y0": "13", "d": "14", "F": "15", "sigma_max": "16", "sigma_ave": "17", "delta_max": "18",
           "A_c": "19"}
RADIUS_MM = 100.0
# sides of the elements of the paper's mesh, 63,000 on the disc in some eight layers, mm
ELEMENT_MM = 2.0


@dataclass(frozen=True)
class Variant:
    """A skin and a punch."""

    strain: str = "principal"  # one of STRAINS, or of OWN
    contact_Ohm_m2: float | None = None  # contact impedance of a conducting punch; None where it insulates
    thins: bool = False  # whether the coating thins by the stretch normal to it, as a layer of solids does
    diameters: str = "five"  # or "any"
    slope: float = 1.0  # how steeply the conductivity follows the strain, over the card's

    @property
    def name(self) -> str:
        punch = "insulated" if self.contact_Ohm_m2 is None else f"conducting by {self.contact_Ohm_m2:g} Ohm m2"
        return (f"{self.strain}, {punch}" + f", {self.slope:g} times as steep" * (self.slope != 1)
                + ", thinning" * self.thins + ", any diameter" * (self.diameters == "any"))


# strains that scenes have no word for, of the stretches along the meridian, the hoop and the normal
OWN = {"meridian": lambda one, two, normal: one - 1, "hoop": lambda one, two, normal: two - 1,
       "volume": lambda one, two, normal: one * two * normal - 1}
IMPEDANCES, SLOPES = (1e-4, 1e-3, 1e-2), (0.25, 0.5, 2.0)
VARIANTS = (*(Variant(strain) for strain in (*STRAINS, *OWN)),
            *(Variant(strain, z) for strain in STRAINS for z in IMPEDANCES),
            *(Variant("principal", z, slope=slope) for z in (None, 1e-4) for slope in SLOPES),
            *(Variant(strain, z, thins=True) for strain in STRAINS for z in (None, 1e-3)),
            *(Variant(strain, z, diameters="any") for strain, z in (("normal", None), ("principal", None),
                                                                   ("principal", 1e-3))))


def samples_of(card: Path, variant: Variant, scenes: int, within_mm: float | None) -> SweepSamples:
    """The paper's touches under a variant, within a distance of the centre or wherever the punch fits."""
    punch: dict[str, Any] = {"diameter_mm": FIVE if variant.diameters == "five" else ANY, "force_N": [0.1, 2.0]}
    if within_mm is not None:
        punch["place"] = {"within_mm": within_mm}
    if variant.contact_Ohm_m2 is not None:
        punch |= {"conductor": True, "contact_impedance_Ohm_m2": variant.contact_Ohm_m2}
    own = variant.thins or variant.strain not in STRAINS
    # the meshes of a strain of this file are those of the in-plane one, which asks for most
    skin = {"strain": variant.strain if variant.strain in STRAINS else "principal"}
    design = design_from({"seed": SEED, "punch": punch, "skin": skin}, scenes)
    with tempfile.TemporaryDirectory() as folder, _rule(variant) if own else nullcontext():
        sweep(design, steeper(card, variant.slope, Path(folder)), Path(folder) / "sweep", workers=1 if own else WORKERS,
              reuse=True)
        return read_samples(Path(folder) / "sweep")


def steeper(card: Path, slope: float, folder: Path) -> Path:
    """The card with the strain's part of its conductivity times a factor."""
    document = json.loads(card.read_text(encoding="utf-8"))
    document["conductivity"]["a"] = [slope * a for a in document["conductivity"]["a"]]
    changed = folder / "card.json"
    changed.write_text(json.dumps(document), encoding="utf-8")
    return changed


def _rule(variant: Variant):
    """What gives the current sheet of a variant its conductance, in this process."""
    def conductance(law: Conductivity, skin: Skin, one: Array, two: Array, normal: Array) -> Array:
        one, two, normal = (np.asarray(value, float) for value in (one, two, normal))
        strain = (sheet_conductance.driving_strain(variant.strain, one, two, normal) if variant.strain in STRAINS else
                  OWN[variant.strain](one, two, normal))
        return conductivity(law, strain) * skin.thickness_m * (normal if variant.thins else 1.0)
    return patch.object(sheet_conductance, "_current_sheet", conductance)


@dataclass(frozen=True)
class Way:
    """A way of learning."""

    name: str = ""
    units: int = 20
    one_scale: bool = False  # one smallest and largest reading for all 208, not one each
    mesh_noise: bool = False  # areas as whole elements of a mesh


PAPERS = Way()
WAYS = (Way("10 units", 10), Way("40 units", 40), Way("one min-max of all readings", one_scale=True),
        Way("areas of whole elements", mesh_noise=True))


def scored(stage: str, sensor: str, samples: SweepSamples, within_mm: float | None, steps: int,
           way: Way) -> Iterator[dict[str, object]]:
    """One row an output."""
    rows_of = "" if stage == "screen" else f"{len(samples)} scenes" + f" within {within_mm:g} mm" * bool(within_mm)
    name = ", ".join(part for part in (sensor, rows_of, way.name) if part)
    singular = np.linalg.svd(samples.signal_V, compute_uv=False)
    part = split(samples.group, SEED)
    rows, unseen = take(samples, part == "train"), take(samples, part != "train")
    readings = _scaling(rows.signal_V, way)
    x, columns = scaled(readings, rows.signal_V), [outputs.NAMES.index(name) for name in PAPER]
    target = _meshed(rows.target, way)[:, columns]
    networks = ensemble.fit(x, target, SEED, Options(units=way.units, epochs=steps), WORKERS)
    found = [ensemble.predict(networks, scaled(readings, some.signal_V)).value for some in (rows, unseen)]
    for k, output in enumerate(PAPER):
        errors = [value[:, k] - _meshed(some.target, way)[:, columns[k]]
                  for value, some in zip(found, (rows, unseen), strict=True)]
        train, test = (float(np.sqrt(np.mean(error**2))) for error in errors)
        truth = _meshed(unseen.target, way)[:, columns[k]]
        yield {"stage": stage, "sensor": sensor, "variant": name, "output": output, "unit": outputs.of(output).unit,
               "train_rmse": train, "rmse": test, "paper_train_rmse": paper_training(output),
               "paper_rmse": PAPER[output], "over_paper": test / PAPER[output],
               "r2": 1 - test**2 / float(np.var(truth)), "r": float(np.corrcoef(found[1][:, k], truth)[0, 1]),
               "second_singular": singular[1] / singular[0], "within_mm": within_mm, "rows": len(rows),
               "scored_rows": len(unseen), "epochs": networks.trainings[k].epochs, "units": way.units}


def _scaling(signal_V: Array, way: Way) -> MinMax:
    each = min_max(signal_V)
    if not way.one_scale:
        return each
    return MinMax(np.full_like(each.lowest, each.lowest.min()), np.full_like(each.highest, each.highest.max()))


def _meshed(target: Array, way: Way) -> Array:
    """Targets, where asked with contact areas of whole elements and mean pressures to match."""
    if not way.mesh_noise:
        return target
    area, mean = (outputs.NAMES.index(name) for name in ("A_c", "sigma_ave"))
    out = target.copy()
    out[:, area] = np.maximum(np.round(target[:, area] / ELEMENT_MM**2), 1) * ELEMENT_MM**2
    out[:, mean] = target[:, mean] * target[:, area] / out[:, area]
    return out


def paper_training(output: str) -> float:
    """RMSE on training rows that the paper states, in the unit of the output."""
    of = {"x0": " of x₀/r", "y0": " of y₀/r"}.get(output, "")
    root = float(np.sqrt(paper_value(FIGURES[output], f"MSE{of}, training rows")))
    return root * RADIUS_MM if of else root


def ranked(rows: pd.DataFrame, stage: str) -> list[str]:
    """Sensors of a stage, the nearest to the paper's errors first, by the geometric mean of the ratios, at least 1."""
    over = rows.loc[rows["stage"] == stage, ["sensor", "over_paper"]].set_index("sensor")["over_paper"]
    return list(over.clip(lower=1.0).map(math.log).groupby(level=0).mean().sort_values().index)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("card", type=Path, help="material card that `matcal fit` wrote")
    parser.add_argument("--stage", nargs="+", choices=STAGES, default=STAGES)
    parser.add_argument("--scenes", type=int, default=SCENES, help="of the stages after the screening")
    parser.add_argument("--epochs", type=int, default=STEPS, help="most steps of these")
    parser.add_argument("--within", type=float, help="largest distance from the centre of these, mm")
    parser.add_argument("--only", default="", help="variants whose name has these words")
    asked = parser.parse_args()
    named = {variant.name: variant for variant in VARIANTS}
    before = earlier("variants")
    rows: list[dict[str, object]] = [] if before.empty else before.to_dict("records")

    def swept(stage: str, name: str, ways: tuple[Way, ...] = (PAPERS,)) -> None:
        scenes, within_mm, steps = (SCREENED, NEAR_MM, SCREEN_STEPS) if stage == "screen" else (
            asked.scenes, asked.within, asked.epochs)
        samples = samples_of(asked.card, named[name], scenes, within_mm)
        for way in ways:
            found = list(scored(stage, name, samples, within_mm, steps, way))
            rows[:] = [row for row in rows if (row["stage"], row["variant"]) != (stage, found[0]["variant"])] + found
            shown(written(rows, "variants"))

    if "screen" in asked.stage:
        for name in (name for name in named if asked.only in name):
            swept("screen", name)
    if "best" in asked.stage:
        for name in [name for name in ranked(pd.DataFrame(rows), "screen") if asked.only in name][:BEST]:
            swept("best", name)
    if "learners" in asked.stage:
        swept("learners", ranked(pd.DataFrame(rows), "best")[0], WAYS)


STAGES = ("screen", "best", "learners")


if __name__ == "__main__":
    main()
