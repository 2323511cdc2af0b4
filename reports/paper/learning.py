"""Sections of the surrogates: the networks and their predictions (paper, figures 12 to 19)."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from reports.document.numerals import number, percent, r_squared
from reports.paper import network
from reports.paper.section import Number, Section, against, paper_value, renamed, value_of
from reports.paper.stages_plan import FORWARD, NETWORKS, SWEEP, Run
from reports.surrogate import parity_figures
from reports.surrogate.surrogate_report import DESCRIPTION, EVALUATION, PREDICTIONS

OUTPUTS = {"13": ("x0", "y0"), "14": ("d",), "15": ("F",), "16": ("sigma_max",), "17": ("sigma_ave",),
           "18": ("delta_max",), "19": ("A_c",)}
# what the methods are called next to each other
METHODS = {NETWORKS: "networks", FORWARD: "forward map"}
SYMBOLS = {"x0": "x₀", "y0": "y₀"}
PARTS = {"train": "training rows", "test": "test rows"}
RADIUS_MM = 100.0
OPEN = {"13": "Positions are normalised with the radius for the error, as in the paper, and drawn in mm.",
        "16": "The caption's unit, kPa, is read as MPa²: nothing else agrees with its scale. Peak pressure is that of "
              "a filleted punch.",
        "17": "The caption's unit, kPa, is read as MPa². Mean pressure is force over contact area.",
        "18": "Depth is that of the punch's face.",
        "19": "Area is that on the punch's face; the wall of the hole is counted separately."}


def model_of(run: Run, name: str) -> tuple[dict[str, Any], dict[str, Any], Path] | None:
    """Description, evaluation and predictions of a trained model; None where one is not there."""
    folder = run.stages[name].folder
    places = [folder / file for file in (DESCRIPTION, EVALUATION, PREDICTIONS)]
    if not all(place.is_file() for place in places):
        return None
    model, evaluation = (json.loads(place.read_text(encoding="utf-8")) for place in places[:2])
    return model, evaluation, places[2]


def sections(run: Run) -> list[Section]:
    """Figures 12 to 19 of a run's models."""
    found = {name: one for name in METHODS if (one := model_of(run, name)) is not None}
    if NETWORKS not in found:
        why = "Not there: the networks were not trained."
        return [Section(figure, "the networks", "", "", "", (NETWORKS,), missing=why) for figure in ("12", *OUTPUTS)]
    predictions = pd.read_parquet(found[NETWORKS][2])
    scores = {METHODS[name]: one[1]["outputs"] for name, one in found.items()}
    model = found[NETWORKS][0]
    return [_structure(model, run), *(_scored(figure, names, predictions, scores, _collapsed(model, names))
                                      for figure, names in OUTPUTS.items())]


def _collapsed(model: Mapping[str, Any], names: tuple[str, ...]) -> str:
    """That the evidence of one of these networks collapsed, in words; empty where none did."""
    if not any(model["training"].get(name, {}).get("collapsed") for name in names):
        return ""
    return " The evidence of this network collapsed in every start: it says little more than the mean."


def _structure(model: Mapping[str, Any], run: Run) -> Section:
    split, rows = model["dataset"]["split"], model["dataset"]["rows"]
    nets = [net for net in model["training"].values() if isinstance(net, Mapping)]
    hidden = network.hidden_units(nets[0]["parameters"])
    stopped = sum(net["stop"] == "epochs" for net in nets)
    numbers = (Number("scenes", "–", rows), Number("inputs of a network", "–", network.INPUTS),
               Number("hidden units", "–", hidden),
               Number("share of the training rows", "%", 100 * split["train"] / rows),
               Number("share of the test rows", "%", 100 * split["test"] / rows),
               Number("most steps", "–", run.setting.epochs))
    return Section("12", "structure of the networks",
                   "Eight networks with one hidden layer on 208 min–max voltages, trained by Bayesian regularisation; "
                   "70 % of 4,000 scenes train, 15 % validate, 15 % test.",
                   f"The width is not printed: {hidden} units here. Rows that validate in the paper calibrate the "
                   "intervals here. Only scenes that ended ok are learned from.",
                   f"{stopped} of {len(nets)} networks stopped at {run.setting.epochs} steps, before their training "
                   "was at its end; the paper does not say when its own stopped.", (NETWORKS, SWEEP),
                   (network.structure("figure_12", model),), numbers)


def _scored(figure: str, names: tuple[str, ...], predictions: pd.DataFrame,
            scores: Mapping[str, Mapping[str, Any]], collapsed: str) -> Section:
    networks, numbers = scores[METHODS[NETWORKS]], []
    for method, outputs in scores.items():
        for name in names:
            numbers += _numbers(name, outputs[name], method)
    drawn = [parity_figures.plate(name, parity_figures.points(predictions, name), networks[name],
                                  f" by the {METHODS[NETWORKS]}") for name in names]
    plates = tuple(renamed(plate, f"figure_{figure}{'ab'[k] if len(names) > 1 else ''}")
                   for k, plate in enumerate(drawn))
    title = " and ".join(parity_figures.label(name).lower() for name in names)
    return Section(figure, f"{title}, predicted against target", _says(figure, names),
                   OPEN.get(figure, "MSE is in the unit squared, which the caption's unit is not."),
                   _differs(figure, names, numbers, networks) + collapsed, (NETWORKS, FORWARD, SWEEP), plates,
                   tuple(numbers))


def _numbers(name: str, parts: Mapping[str, Any], method: str) -> list[Number]:
    sign, of = parity_figures.unit(parts), f" of {SYMBOLS[name]}" if name in SYMBOLS else ""
    scale, over, squared = (RADIUS_MM**-2, "/r", "–") if of else (1.0, "", {"mm²": "mm⁴"}.get(sign, f"{sign}²"))
    found = [Number(f"MSE{of}{over}, {words}", squared, scale * parts[part]["mse"], method)
             for part, words in PARTS.items() if part in parts]
    if "test" in parts:
        found.append(Number(f"RMSE{of}, test rows", sign, parts["test"]["rmse"], method))
        if parts["test"]["r2"] is not None:
            found.append(Number(f"R²{of}, test rows", "–", parts["test"]["r2"], method))
        found.append(Number(f"test rows{of} in their 90 % interval", "%", 100 * parts["test"]["coverage_90"], method))
    return found


def _says(figure: str, names: tuple[str, ...]) -> str:
    of = [(f" of {SYMBOLS[name]}" if name in SYMBOLS else "") for name in names]
    said = ", ".join(f"RMSE{one} {number(paper_value(figure, f'RMSE{one}, test rows'))}" for one in of)
    return f"On test rows, from the caption's MSE: {said} in the unit of the table; R² above 0.9 for every output."


def _differs(figure: str, names: tuple[str, ...], numbers: list[Number], networks: Mapping[str, Any]) -> str:
    said = []
    for name in names:
        quantity = f"RMSE of {SYMBOLS[name]}, test rows" if name in SYMBOLS else "RMSE, test rows"
        paper, ours = paper_value(figure, quantity), value_of(numbers, quantity, METHODS[NETWORKS])
        said.append(f"the networks' error of {parity_figures.label(name).lower()} is {against(ours, paper)}")
        best = [n.value for n in numbers if n.quantity == quantity and n.method == METHODS[FORWARD]]
        if best:
            said[-1] += f", the forward map's {against(best[0], paper)}"
    score = networks[names[0]].get("test")
    r2 = "" if score is None or score["r2"] is None else (
        f" The networks' R² is {r_squared(score['r2'])}, {'above' if score['r2'] > 0.9 else 'below'} the paper's 0.9; "
        f"{percent(score['coverage_90'])} of the rows lie in their 90 % interval.")
    return f"On test rows {'; '.join(said)}.{r2}"
