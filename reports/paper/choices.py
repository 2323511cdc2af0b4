"""Section C: what the paper leaves open of skin and punch, and what that does to what the models read."""

import pandas as pd

from eitsim.sweeps.dataset.parquet import MANIFEST, read_dataset, read_manifest
from reports.document.numerals import number
from reports.document.page import Table
from reports.paper import touches, variants
from reports.paper.learning import METHODS
from reports.paper.networks_table import OUTPUTS
from reports.paper.section import Number, Section
from reports.paper.stages_plan import CHOICES, FOLLOWED, FORWARD, NETWORKS, Run

TITLE = "insulated or conducting punch, and which strain drives the skin"
NAMES = tuple(name for names in OUTPUTS.values() for name in names)
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
        tables.append(read_by(table, own))
        said = misread(table, own)
    if search is not None:
        tables.append(variants.table(search, list(NAMES)))
    return Section("C", TITLE,
                   "Steel of 10⁷ S/m touches the skin, and the conductivity follows “the normal stretch ratio”; "
                   "neither is taken further.",
                   f"This report's own choice: {touches.in_words(*own)}. With β = 0 a free surface has no strain "
                   "through the thickness, so that with that strain the signal lives under the punch.",
                   f"A conducting punch changes the signal by {number(min(shares.values()))} to "
                   f"{number(max(shares.values()))} % (RMS) of what it is insulated. {said} "
                   + ("" if search is not None else variants.NOT_RUN),
                   (CHOICES, FOLLOWED), (touches.choices("figure_C", rows, 16, own),), tuple(numbers), tuple(tables))


def read_by(table: pd.DataFrame, own: tuple[str, int]) -> Table:
    """A row a model and choice, a column an output: what is read of the touch, and in the first row what it is."""
    first = table.drop_duplicates("output").set_index("output").reindex(NAMES)
    rows = [["the touch itself", *(number(value) for value in first["target"])]]
    for model in (NETWORKS, FORWARD):
        for choice, part in table[table["model"] == model].groupby(list(touches.CHOICE), sort=False):
            value = part.set_index("output")["value"].reindex(NAMES)
            strain, conductor = choice
            mark = " (own)" if (strain, int(conductor)) == own else ""
            rows.append([f"{METHODS[model]}, {touches.STRAINS.get(strain, strain)}, "
                         f"{touches.PUNCHES[int(conductor)]}{mark}",
                         *("–" if pd.isna(one) else number(one) for one in value)])
    units = [str(unit).replace("2", "²") for unit in first["unit"]]
    heads = [f"{variants.short(name)} ({unit})" for name, unit in zip(NAMES, units, strict=True)]
    return Table("The touch of figure 10 on sensors of each choice, read by models that were trained on touches of "
                 f"this report's own ({touches.in_words(*own)}): a wrong choice is read as another touch.",
                 ["read by, strain, punch", *heads], rows, "w" + "r" * len(heads))


def misread(table: pd.DataFrame, own: tuple[str, int]) -> str:
    """The largest error of the force that each model reads from the other choices, in words."""
    said = []
    for model in (NETWORKS, FORWARD):
        force = table[(table["model"] == model) & (table["output"] == "F")]
        error = (force["value"] - force["target"]).abs()
        mine = (force[touches.CHOICE[0]] == own[0]) & (force[touches.CHOICE[1]].astype(int) == own[1])
        if mine.any() and (~mine).any():
            said.append(f"the {METHODS[model]} by up to {number(error[~mine].max(), 2)} N "
                        f"({number(error[mine].iloc[0], 2)} N on their own)")
    return ("A model of one choice misreads the force of a touch on a sensor of another: " + ", ".join(said) + "."
            if said else "")
