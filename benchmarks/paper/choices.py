"""Section C: what the paper leaves open of skin and punch, and what that does to what the models read."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
import pandas as pd

from benchmarks.paper import touches, variants
from benchmarks.paper.learning import METHODS
from benchmarks.paper.networks_table import OUTPUTS
from benchmarks.paper.section import Number, Section
from benchmarks.paper.stages_plan import CHOICES, FOLLOWED, Run
from eitsim.sweeps.dataset.parquet import MANIFEST, read_dataset, read_manifest
from reports.document.numerals import number
from reports.document.page import Table

TITLE = "insulated or conducting punch, and which strain drives the skin"
NAMES: tuple[str, ...] = tuple(name for names in OUTPUTS.values() for name in names)
NOT_FOLLOWED = "What a model of one choice reads from a sensor of another is not there: {} was not run."


def taken(run: Run) -> tuple[str, int]:
    """The choice of the run's sweep; that of a scene that leaves it open where there is no sweep."""
    there = (run.sweep / MANIFEST).is_file()
    return touches.taken(read_manifest(run.sweep)["design"]["tables"] if there else {})


def section(run: Run) -> Section:
    """The signals of one touch under each choice, read by models of this run's own."""
    folder, followed = run.stages[CHOICES].folder, run.stages[FOLLOWED].folder / f"{FOLLOWED}.csv"
    if not (folder / "design.json").is_file():
        return Section("C", TITLE, "", "", "", (CHOICES,), missing=f"Not there: {CHOICES} was not run.")
    rows, own, search = read_dataset(folder).ok, taken(run), variants.read()
    shares = {strain: 100 * touches.conducting_share(rows, strain) for strain in touches.STRAINS}
    numbers = [Number(f"change of the signal by a conducting punch, strain {words}", "%", shares[strain])
               for strain, words in touches.STRAINS.items()]
    tables, said = [], NOT_FOLLOWED.format(FOLLOWED)
    if followed.is_file():
        table = pd.read_csv(followed)
        found = readings(table)
        tables.append(read_by(found, dict(zip(table["output"], table["unit"], strict=True)), own))
        said = misread(found, own)
    if search:
        tables.append(variants.table(search, NAMES))
    return Section("C", TITLE,
                   "Steel of 10⁷ S/m touches the skin, and the conductivity follows “the normal stretch ratio”; "
                   "neither is taken further.",
                   f"This report's own choice: {touches.in_words(*own)}. With β = 0 a free surface has no strain "
                   "through the thickness, so that with that strain the signal lives under the punch.",
                   f"A conducting punch changes the signal by {number(min(shares.values()))} to "
                   f"{number(max(shares.values()))} % (RMS) of what it is insulated. {said} "
                   + ("" if search else variants.NOT_RUN),
                   (CHOICES, FOLLOWED), (touches.choices("figure_C", rows, 16, own),), tuple(numbers), tuple(tables))


@dataclass(frozen=True)
class Reading:
    """What one model reads of the touch on a sensor of one choice."""

    model: str  # stage of the model
    choice: tuple[str, int]  # strain that drives the skin, and whether the punch conducts
    value: Mapping[str, float]  # output -> value; without those that cannot be read
    target: Mapping[str, float]  # output -> what it is


def readings(table: pd.DataFrame) -> list[Reading]:
    """The readings of a table of `followed`, in its order."""
    found: dict[tuple[str, tuple[str, int]], Reading] = {}
    for row in table.to_dict("records"):
        choice = (str(row[touches.CHOICE[0]]), int(row[touches.CHOICE[1]]))
        one = found.setdefault((row["model"], choice), Reading(row["model"], choice, {}, {}))
        found[row["model"], choice] = replace(
            one, target={**one.target, row["output"]: row["target"]},
            value={**one.value, row["output"]: row["value"]} if np.isfinite(row["value"]) else one.value)
    return list(found.values())


def read_by(found: Sequence[Reading], units: Mapping[str, str], own: tuple[str, int]) -> Table:
    """A row a model and choice, a column an output: what is read of the touch, below units and what it is."""
    rows = [["unit", "", *(units[name].replace("2", "²") for name in NAMES)],
            ["the touch itself", "", *_cells(found[0].target)]]
    for one in found:
        strain, conductor = one.choice
        rows.append([METHODS[one.model], f"{strain}, {touches.PUNCHES[conductor]}" + " (own)" * (one.choice == own),
                     *_cells(one.value)])
    heads = [variants.SHORT.get(name, name) for name in NAMES]
    return Table("The touch of figure 10 on sensors of each choice, read by models that were trained on touches of "
                 f"this report's own ({touches.in_words(*own)}): a wrong choice is read as another touch. Strains: "
                 f"{'; '.join(f'{key}, {words}' for key, words in touches.STRAINS.items() if key != words)}.",
                 ["read by", "strain, punch", *heads], rows, "lw" + "r" * len(heads))


def _cells(value: Mapping[str, float]) -> list[str]:
    return [number(value[name]) if name in value else "–" for name in NAMES]


def misread(found: Sequence[Reading], own: tuple[str, int]) -> str:
    """The largest error of the force that each model reads from the other choices, in words."""
    said = []
    for model in METHODS:
        error = {one.choice: abs(one.value["F"] - one.target["F"]) for one in found
                 if one.model == model and "F" in one.value}
        if own in error and len(error) > 1:
            most = max(value for choice, value in error.items() if choice != own)
            said.append(f"the {METHODS[model]} by up to {number(most, 2)} N ({number(error[own], 2)} N on their own)")
    return ("A model of one choice misreads the force of a touch on a sensor of another: " + ", ".join(said) + "."
            if said else "")
