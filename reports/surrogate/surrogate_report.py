"""The report of a model, from the folder that `surrogate train` or `surrogate learn` wrote."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from reports.document import provenance
from reports.document.numerals import counted, interval, number, percent, r_squared, typeset
from reports.document.page import Report, write_pdf
from reports.document.style import house
from reports.document.verdict import GOOD, NOT_USABLE, SHORTFALL, UNEXPLAINED, USABLE, Verdict, graded, worst
from reports.surrogate import (
    amplitude_figures,
    bound_figures,
    noise_figures,
    parity_figures,
    surrogate_tables,
    training_figures,
)
from reports.surrogate.parity_figures import label, unit, unseen
from surrogate.bounds import bound_files
from surrogate.learners.registry import METHODS

DESCRIPTION, EVALUATION, PREDICTIONS = "model.json", "evaluation.json", "predictions.parquet"
NO_NOISE = "No noise was added for these scores: the stored evaluation holds no noise level."


def write(model_dir: Path, out: Path) -> None:
    """Write the PDF of a model: predictions against targets, scores, training record; of one of recorded presses its
    scores, families and errors over the skin. InputFileError where `model_dir` lacks what the command wrote; ValueError
    where the folder of `out` is missing."""
    with house():
        write_pdf(report(model_dir), out)


def report(model_dir: Path) -> Report:
    """Everything that the template of a model shows."""
    from reports.surrogate import reader_report
    from surrogate.model.model import load_single
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.model.store import histories, of_recording, read_evaluation

    if of_recording(model_dir) and isinstance(found := load_single(model_dir), PressModel):
        return reader_report.report(found, model_dir)
    model, evaluation, predictions = read_evaluation(model_dir)
    sources = [provenance.source(model_dir / name) for name in (DESCRIPTION, EVALUATION, PREDICTIONS)]
    scores = evaluation["outputs"]
    limits, prose = _limits(model_dir, evaluation)
    if limits is not None:
        sources.append(provenance.source(model_dir / bound_files.LIMITS))
    plates = [parity_figures.plate(name, parity_figures.points(predictions, name), parts)
              for name, parts in scores.items()]
    if trained := histories(model_dir, [output["name"] for output in model.get("outputs", [])]):
        plates.append(training_figures.history(trained, model["dataset"]["split"]["train"]))
    if amplitude := evaluation.get("amplitude"):
        plates.append(amplitude_figures.plate(amplitude))
    tables = {"scores": surrogate_tables.scores(scores, predictions),
              "training": surrogate_tables.training(model["training"])}
    absent = {}
    if (found := bound_files.read_map(model_dir)) is not None:
        sources.append(provenance.source(model_dir / bound_files.MAP))
        plates += bound_figures.plates(found)
    if evaluation["noise"]:
        tables["noise"] = surrogate_tables.noise(scores, evaluation["noise"], limits)
        plates.append(noise_figures.plate(scores, evaluation["noise"], limits))
    else:
        absent["noise"] = NO_NOISE
    subtitle = f"Method {model['method']}, {counted(evaluation['dataset']['rows'], 'scene')}"
    footer = provenance.footer(sources, provenance.seed_words(model.get("seed")))
    if words := evaluation.get("scored", ""):
        prose["scored"] = words[0].upper() + words[1:]
    return Report("surrogates", "Surrogate of the touch", subtitle, footer, _findings(model, evaluation), plates,
                  tables, absent, _prose(model) | prose, _cautions(evaluation), verdict=_verdict(model, evaluation))


def _limits(model_dir: Path, evaluation: Mapping[str, Any]) -> tuple[pd.DataFrame | None, dict[str, str]]:
    """The least possible errors of the evaluated data set, and prose that says why there are none."""
    found = bound_files.read_limits(model_dir)
    limits = bound_files.of_dataset(found, evaluation)
    if limits is not None or not evaluation["noise"]:
        return limits, {}
    why = "is not there" if found is None else "is of another data set"
    return None, {"limits": f"The least error that any reading can reach is not known: {bound_files.LIMITS} {why}; "
                            f"`surrogate limit CARD --data DIR --out MODEL_DIR/{bound_files.LIMITS}` writes it."}


def _verdict(model: Mapping[str, Any], evaluation: Mapping[str, Any]) -> list[Verdict]:
    """Outputs by what they are good for on unseen rows, their intervals, and measured frames."""
    scores = {name: parts[unseen(parts)] for name, parts in evaluation["outputs"].items()}
    grades = {name: NOT_USABLE if s["r2"] is None else graded(1 - s["r2"], UNEXPLAINED) for name, s in scores.items()}
    found = []
    for grade in (GOOD, USABLE, NOT_USABLE):
        if names := [name for name in scores if grades[name] == grade]:
            words = ", ".join(label(name).lower() for name in names)
            known = [r2 for name in names if (r2 := scores[name]["r2"]) is not None]
            least = f"R² {r_squared(min(known))}" if known else "no R²: the targets do not vary"
            found.append(Verdict(words[0].upper() + words[1:], grade, least + (" or more" if len(known) > 1 else "")))
    name = min(scores, key=lambda name: scores[name]["coverage_90"])
    held, few = scores[name]["coverage_90"], evaluation.get("few_interval_rows", "")
    found.append(Verdict("90 % intervals", worst(graded(0.9 - held, SHORTFALL), USABLE if few else GOOD),
                         f"hold {percent(held)} of {scores[name]['n']} rows of {label(name).lower()}, the least of all"
                         + (f"; calibrated on {evaluation['interval_rows']} rows, which are few" if few else "")))
    if model["dataset"].get("measurement") == {}:
        found.append(Verdict("Measured frames", NOT_USABLE, "trained on simulated frames without noise"))
    return found


def _cautions(evaluation: Mapping[str, Any]) -> list[str]:
    """What `surrogate evaluate` warns of, in its words; an evaluation of an earlier version may lack them."""
    said = [evaluation.get(key, "") for key in ("few_interval_rows", "interval_caution", "material")]
    if spans := evaluation.get("trained_range"):
        units = {name: unit(parts) for name, parts in evaluation["outputs"].items()}
        said.append("Intervals hold within the trained range: " + ", ".join(
            f"{label(name).lower()} {interval(*ends)} {units[name]}" for name, ends in spans.items()
            if name in units) + ".")
    return [typeset(words[0].upper() + words[1:]) for words in said if words]


def _findings(model: Mapping[str, Any], evaluation: Mapping[str, Any]) -> list[str]:
    found = [f"Training took {number(model['fit_s'])} s of CPU, a frame takes {number(evaluation['predict_ms'])} ms."]
    if evaluation["dataset"]["sha256"] != model["dataset"]["sha256"]:
        found.append("The scores are of another data set than the one that the model was trained on.")
    networks = {name: net for name, net in model["training"].items() if isinstance(net, dict)}
    if collapsed := [label(name) for name, net in networks.items() if net.get("collapsed")]:
        found.append(f"The evidence collapsed for {', '.join(collapsed)}: there it says little more than the mean.")
    return found


def _prose(model: Mapping[str, Any]) -> dict[str, Any]:
    split, words = model["dataset"]["split"], {"train": "train", "val": "calibrate the intervals", "test": "test"}
    rows = ", ".join(f"{counted(split[part], 'row')} {word}" for part, word in words.items())
    method = METHODS.get(model["method"])
    return {"method": typeset(method.description) if method else f"Method {model['method']}.",
            "split": f"{rows}; drawn by the seed.",
            "dataset": f"Data set of {counted(model['dataset']['rows'], 'row')}, sha256 {model['dataset']['sha256']}.",
            "versions": f"Trained with {provenance.version_lines(model['versions'])}."}
