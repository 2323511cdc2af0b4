"""Sections of the surrogates: the networks and their predictions (paper, figures 12 to 19)."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pandas as pd

from benchmarks.paper import network, variants
from benchmarks.paper.networks_table import OUTPUTS, RADIUS_MM, SYMBOLS
from benchmarks.paper.section import Number, Section, against, paper_value, renamed, value_of
from benchmarks.paper.stages_plan import FORWARD, NETWORKS, SWEEP, Run
from benchmarks.report.stored_tables import Rows
from matcal.card import read_card
from matcal.record.compare import quoted
from reports.document.numerals import number, percent, r_squared
from reports.document.page import ReportFigure
from reports.surrogate import amplitude_figures, parity_figures
from reports.surrogate.surrogate_report import DESCRIPTION, EVALUATION, PREDICTIONS
from surrogate.statistics.metrics import rms

# what the methods are called next to each other
METHODS = {NETWORKS: "networks", FORWARD: "forward map"}
STRESSES = ("F", "sigma_max", "sigma_ave")  # outputs in proportion to the moduli of one deformation
PARTS = {"train": "training rows", "test": "test rows"}
SQUARED = ("mse",)  # scores that carry the unit squared
LENGTHS = ("rmse", "mae", "half_width_90")  # scores that carry the unit
OPEN = {"13": "Positions are divided by the radius of the disc, as in the paper, whose MSE is of x₀/r and y₀/r. The "
              "table has the RMSE in mm as well.",
        "16": "The caption's unit, kPa, is read as MPa²: nothing else agrees with its scale. Peak pressure is that of "
              "a filleted punch.",
        "17": "The caption's unit, kPa, is read as MPa². Mean pressure is force over contact area.",
        "18": "Depth is that of the punch's face.",
        "19": "Area is that on the punch's face; that on its side is counted separately."}


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
    scores = {METHODS[name]: one[1]["outputs"] for name, one in found.items()}
    by_method = {METHODS[name]: pd.read_parquet(one[2]) for name, one in found.items()}
    model, search, spread = found[NETWORKS][0], variants.read(), modulus_spread(run)
    return [_structure(model, run),
            *(replace(_scored(figure, names, by_method, scores, _collapsed(model, names)),
                      followed=followed(names, by_method[METHODS[NETWORKS]], search, spread))
              for figure, names in OUTPUTS.items())]


def modulus_spread(run: Run) -> float | None:
    """Relative standard deviation of the card's mu_0; None where the card does not tell it."""
    card = read_card(run.card) if run.card.is_file() else None
    row = None if card is None else quoted(card, "mu_0_Pa")
    return None if row is None else row["sd"] / row["value"]


def followed(names: tuple[str, ...], predictions: pd.DataFrame, search: Rows, spread: float | None) -> str:
    """What another sensor, and what is not known of the foam's modulus, do to the errors of some outputs, in words."""
    said = [words] if (words := variants.followed(search, names)) else []
    for name in names:
        if name not in STRESSES or spread is None:
            continue
        rows = parity_figures.points(predictions, name)
        target = rows.loc[rows["part"] == "test", "target"].to_numpy(dtype=float)
        said.append("Forces and pressures of one deformation are in proportion to the foam's moduli, which the tests "
                    f"leave open by {percent(spread)} (standard deviation of μ₀): that alone is "
                    f"{number(spread * rms(target))} {rows['unit'].iloc[0]} (RMS of the test rows), for any method.")
    return " ".join(said)


def amplitude(run: Run) -> Section:
    """Section A: how the signal grows with force and diameter, by the trained forward map."""
    title = "size of the signal over force and diameter"
    found = model_of(run, FORWARD)
    if found is None or not (own := found[1].get("amplitude")):
        return Section("A", title, "", "", "", (FORWARD,), missing="Not there: no forward map was trained or scored.")
    turned = [one for one in own["diameters"] if one["peak_N"] is not None]
    numbers = tuple(Number(f"force of the signal's first top, punch of {number(one['d_mm'])} mm", "N", one["peak_N"])
                    for one in turned)
    differs = ("" if not turned else
               f"Under {len(turned)} of {len(own['diameters'])} diameters the signal turns back within the paper's "
               "forces, so that its size alone has two answers there: what separates d from F is the small change of "
               "its shape, which a network on min–max voltages must find (figures 14 to 19).")
    return Section("A", title, "Nothing: the paper shows no signal over force or diameter.",
                   "RMS of all readings by the forward map, at the trained place nearest to the centre.", differs,
                   (FORWARD,), (renamed(amplitude_figures.plate(own), "figure_A"),), numbers)


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


def _scored(figure: str, names: tuple[str, ...], predictions: Mapping[str, pd.DataFrame],
            scores: Mapping[str, Mapping[str, Any]], collapsed: str) -> Section:
    networks, numbers = scores[METHODS[NETWORKS]], []
    for method, outputs in scores.items():
        for name in names:
            rows = parity_figures.points(predictions[method], name)
            numbers += _numbers(name, outputs[name], method, parity_figures.correlations(rows))
    drawn = [_plate(name, parity_figures.points(predictions[METHODS[NETWORKS]], name), networks[name])
             for name in names]
    plates = tuple(renamed(plate, f"figure_{figure}{'ab'[k] if len(names) > 1 else ''}")
                   for k, plate in enumerate(drawn))
    title = " and ".join(parity_figures.label(name).lower() for name in names)
    return Section(figure, f"{title}, predicted against target", _says(figure, names),
                   OPEN.get(figure, "MSE is in the unit squared, which the caption's unit is not."),
                   _differs(figure, names, numbers, networks) + collapsed, (NETWORKS, FORWARD, SWEEP), plates,
                   tuple(numbers))


def _plate(name: str, rows: pd.DataFrame, parts: Mapping[str, Any]) -> ReportFigure:
    by = f" by the {METHODS[NETWORKS]}"
    if name not in SYMBOLS:
        return parity_figures.plate(name, rows, parts, by)
    own = rows.assign(unit="–", **{column: rows[column] / RADIUS_MM for column in ("target", "value", "half_width_90")})
    return parity_figures.plate(name, own, {part: over_radius(score) for part, score in parts.items()}, by,
                                f"{SYMBOLS[name]}/r")


def over_radius(score: Mapping[str, Any]) -> dict[str, Any]:
    """Scores of a position in mm as those of the position over the radius."""
    return {**score, "unit": "–"} | {key: score[key] / RADIUS_MM for key in LENGTHS if key in score} | {
        key: score[key] / RADIUS_MM**2 for key in SQUARED}


def _numbers(name: str, parts: Mapping[str, Any], method: str, correlation: Mapping[str, float]) -> list[Number]:
    sign, of = parity_figures.unit(parts), f" of {SYMBOLS[name]}" if name in SYMBOLS else ""
    scale, over, squared = (RADIUS_MM**-2, "/r", "–") if of else (1.0, "", {"mm²": "mm⁴"}.get(sign, f"{sign}²"))
    found = [Number(f"MSE{of}{over}, {words}", squared, scale * parts[part]["mse"], method)
             for part, words in PARTS.items() if part in parts]
    if "test" in parts:
        found.append(Number(f"RMSE{of}, test rows", sign, parts["test"]["rmse"], method))
        if parts["test"]["r2"] is not None:
            found.append(Number(f"R²{of}, test rows", "–", parts["test"]["r2"], method))
        if "test" in correlation:
            found.append(Number(f"R{of}, test rows", "–", correlation["test"], method))
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
