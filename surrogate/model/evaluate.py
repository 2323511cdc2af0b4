"""Scores of a model on a data set: per output, per part of the split, per noise level."""

import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from eitsim.sensors.formats.open_file import open_recording
from eitsim.sensors.labels import Labels, read_labels
from eitsim.sensors.recording import Recording
from eitsim.sweeps.dataset.parquet import Dataset
from eitsim.sweeps.measurement.instrument import below, level_db
from surrogate.data import outputs
from surrogate.data.samples import PARTS, SweepSamples, content_hash, read_samples, take
from surrogate.data.sensor_ring import same_ring
from surrogate.learners.base import Estimate
from surrogate.learners.registry import METHODS, listed
from surrogate.model.model import Model
from surrogate.model.recorded.press_model import PressModel
from surrogate.model.recorded.reader_evaluation import evaluate_reader
from surrogate.model.sweep_model import SweepModel
from surrogate.model.trained import estimate, interval_scales
from surrogate.statistics.conformal import describe_rows, few, normal
from surrogate.statistics.gaussian_process import spread_evenly
from surrogate.statistics.metrics import COVERAGES, NOISE_REFERENCES, Score, rms, score
from touchcal.arrays import Array, Index, Mask

# Columns of the distances from a value to the ends of its intervals, one for each of COVERAGES.
BELOW, ABOVE = (tuple(f"{side}_{coverage:.0%}".rstrip("%") for coverage in COVERAGES) for side in ("below", "above"))
# Rows that the model has not seen, by what their part is called, the first that a set has.
UNSEEN = ("test", "new", "all")


def parts_of(model: SweepModel, samples: SweepSamples) -> NDArray[np.str_]:
    """(n,) the part of the model's own split that each row was in; "new" for others, "all" where no row is known."""
    known = dict(zip(model.rows.row_hash.tolist(), model.rows.part.tolist(), strict=True))
    found = np.array([PARTS[known[h]] if h in known else "new" for h in samples.row_hash.tolist()])
    return np.full(len(samples), "all") if np.all(found == "new") else found


def check_sensor(model: SweepModel, samples: SweepSamples) -> None:
    """ValueError where the data set is of another disc, other electrodes or another drive."""
    if not same_ring(model.ring, samples.ring):
        raise ValueError("the data set is of another sensor than the model: its disc, electrodes or drive differ. "
                         "Evaluate it on a set of the same [body], [electrodes] and [drive].")


def interval_caution(model: SweepModel, samples: SweepSamples) -> str:
    """In words, that intervals are not those of this data set, whose rows are measured otherwise than those that the
    model was calibrated on; empty where they are not, or the model is too old to tell."""
    calibrated = model.record.get("calibration", model.record["dataset"]).get("measurement")
    here = samples.measurement
    if calibrated is None or calibrated == here:
        return ""
    return (f"intervals were calibrated on rows {_measured(calibrated)}, and these are {_measured(here)}: they do not "
            "count the difference in noise. Train on a set that is measured as this one is.")


def _measured(measurement: Mapping[str, Any]) -> str:
    listed = ", ".join(f"{key} = {value}" for key, value in measurement.items())
    return f"measured with {listed}" if listed else "without noise"


@dataclass(frozen=True)
class Evaluation:
    """Scores, and the noise-free predictions behind them."""

    scores: Mapping[str, Any]  # scores as JSON
    # one row a scene and output: part, scene, output, unit, target, value, BELOW, ABOVE, half_width_90, in its unit
    predictions: pd.DataFrame


def evaluate(model: Model, data: SweepSamples | Dataset | Recording | Path | str, noise_dB: Sequence[float] = (),
             reference: str = "baseline", most_trained: int | None = None, most_noisy: int | None = None, *,
             labels: Labels | Path | str | None = None) -> Evaluation:
    """Score a model on a data set, or on labelled presses of a recording; rows that it was trained on have scores of
    their own.

    Parameters
    ----------
    model : SweepModel
    data : Dataset, path, SweepSamples or Recording
        Solved scenes of the model's sensor, or the folder that `eitsim sweep` wrote; for a model of presses a recording
        or its file.
    noise_dB : sequence of float
        Levels of noise, dB below the reference. Noise is white, added to the touched frame (the untouched one is taken
        as averaged over many frames), and the model knows its standard deviation. Under noise the unseen rows alone
        are scored, where there are any.
    reference : "baseline" or "signal"
        What a level lies below: the RMS of the untouched voltages, or of the signals.
    most_trained : int, optional
        Training rows that are scored at most, spread evenly; all where left out.
    most_noisy : int, optional
        Rows that are scored at each level of noise at most, spread evenly; all where left out.
    labels : Labels or path, optional
        What is known of the touches of a recording.

    Returns
    -------
    Evaluation

    Raises
    ------
    ValueError
        For an unknown reference, another sensor, or rows that all lie nearer to an edge than the method reads; for a
        recording without labels, or of whose labelled presses none can be read.

    Examples
    --------
    >>> scores = surrogate.evaluate(surrogate.load("model"), "sweep", noise_dB=[80, 60]).scores
    >>> scores["outputs"]["F"]["test"]["rmse"] < 0.2
    True
    """
    if isinstance(model, PressModel):
        return Evaluation(_of_presses(model, data, labels), pd.DataFrame())
    if isinstance(data, Recording):
        raise ValueError("a model of a sweep is scored on sweeps; give one in place of a recording.")
    samples = read_samples(data)
    if reference not in NOISE_REFERENCES:
        raise ValueError(f"noise reference '{reference}' is unknown; known: {', '.join(NOISE_REFERENCES)}.")
    check_sensor(model, samples)
    volts = {"baseline": rms(samples.baseline_V), "signal": rms(samples.signal_V)}
    samples, left_out = _readable(model, samples)
    part = parts_of(model, samples)
    clean, noisy = (take(samples, rows) for rows in (_spread(part, most_trained), _noisy(part, most_noisy)))
    table, predict_ms, force_sd = _predictions(model, clean, 0.0)
    calibrating = len(model.calibration.target)
    ends = zip(model.trained.lowest.tolist(), model.trained.highest.tolist(), strict=True)
    scores = {"method": model.method, "dataset": {"sha256": content_hash(samples), "rows": len(samples)},
              "scored": " ".join(filter(None, (left_out, _scored_words(part, clean, noisy if noise_dB else None)))),
              "fit_s": model.fit_s, "predict_ms": predict_ms, "intervals": describe_rows(calibrating),
              "interval_rows": calibrating, "few_interval_rows": few(calibrating),
              "interval_caution": interval_caution(model, samples),
              "trained_range": dict(zip(model.names, ends, strict=True)),
              "material": material_told(model, samples), "force_sd": force_sd,
              "amplitude": model.learner.amplitude(), "outputs": _scores(model, table),
              "baseline_rms_V": volts["baseline"], "signal_rms_V": volts["signal"],
              "noise": [_at_level(model, noisy, level, reference, volts) for level in noise_dB]}
    return Evaluation(scores, table)


def _of_presses(model: PressModel, data: object, labels: Labels | Path | str | None) -> dict[str, Any]:
    if isinstance(data, Path | str):
        data = open_recording(data, kind=model.kind, readings=model.readings)
    if not isinstance(data, Recording) or labels is None:
        raise ValueError("a model of presses is scored on a recording and its labels; give both.")
    known = labels if isinstance(labels, Labels) else read_labels(labels)
    return evaluate_reader(model, data, known, "labels" if known is labels else str(labels))


def _readable(model: SweepModel, samples: SweepSamples) -> tuple[SweepSamples, str]:
    """The rows that the model's method can read, and in words how many are not scored; ValueError where none is."""
    kept = model.learner.reads(samples.target[:, :outputs.TOUCH])
    if kept.all():
        return samples, ""
    words = (f"{np.sum(~kept)} of {len(kept)} rows lie nearer to an edge than the touches that taught the "
             f"{model.method} method, or near two edges; it flags such frames")
    if not kept.any():
        raise ValueError(f"{words}; there is nothing to score. Evaluate it on touches farther from edges.")
    return take(samples, kept), f"{words}; they are left out."


def _spread(part: NDArray[np.str_], most_trained: int | None) -> Index:
    """Places of all rows but the training ones, and of at most so many of these, spread evenly."""
    trained = np.flatnonzero(part == "train")
    kept = trained[spread_evenly(len(trained), len(trained) if most_trained is None else most_trained)]
    return np.sort(np.concatenate([np.flatnonzero(part != "train"), kept]))


def _unseen(part: NDArray[np.str_]) -> Mask:
    """Rows that the model has not seen; all where it has seen each."""
    found = np.isin(part, UNSEEN)
    return found if found.any() else np.ones(len(part), bool)


def _noisy(part: NDArray[np.str_], most: int | None) -> Index:
    """Places of the unseen rows, of at most so many, spread evenly."""
    unseen = np.flatnonzero(_unseen(part))
    return unseen[spread_evenly(len(unseen), len(unseen) if most is None else most)]


def _scored_words(part: NDArray[np.str_], clean: SweepSamples, noisy: SweepSamples | None) -> str:
    """Which rows have scores where not all have; empty where they do."""
    left, whole = len(part) - len(clean), int(np.sum(part == "train"))
    words = [f"{whole - left} of {whole} training rows are scored, spread evenly"] * (left > 0)
    unseen = int(np.sum(_unseen(part)))
    if noisy is not None and len(noisy) < len(part):
        words.append(f"under noise {len(noisy)} unseen rows alone" if len(noisy) == unseen else
                     f"under noise {len(noisy)} of {unseen} unseen rows, spread evenly")
    return "; ".join(words) + "." if words else ""


def _at_level(model: SweepModel, samples: SweepSamples, level_dB: float, reference: str,
              volts: dict[str, float]) -> dict[str, Any]:
    noise = below(level_dB, volts[reference])
    table, _, force_sd = _predictions(model, samples, noise)
    return {"noise_db": level_dB, "noise_reference": reference, "noise_V": noise,
            "db_below_baseline": level_db(noise, volts["baseline"]),
            "db_below_signal": level_db(noise, volts["signal"]),
            "outputs": _scores(model, table), "force_sd": force_sd}


def material_told(model: SweepModel, samples: SweepSamples) -> str:
    """In words, whether intervals hold what is not known of the material, as far as the model remembers."""
    cards = model.record["dataset"].get("cards")
    if cards is None:
        return ""
    here = len(np.unique(samples.card))
    if cards > 1 and model.record.get("calibration", {}).get("cards", cards) == 1:
        return (f"the training rows have {cards} cards, but intervals are scaled to rows of one card, and may be too "
                "narrow for others. Calibrate on a set with draws in [material].")
    if cards > 1:
        return f"intervals hold the spread of {cards} cards of the posterior" + (
            "." if METHODS[model.method].separates_errors else ", as one of all errors: only the "
            f"{listed(lambda method: method.separates_errors)} method separates it.")
    return "material uncertainty is not in the intervals: the training rows have one card." + (
        f" These rows have {here}: train on a sweep with draws in [material]." if here > 1 else "")


def _force_sd(model: SweepModel, found: Estimate, part: NDArray[np.str_]) -> dict[str, float] | None:
    """RMS over the unseen rows, or all, of the parts of the force's standard deviation before calibration, N; None
    where the model does not tell them."""
    if found.parts is None or "F" not in model.names:
        return None
    rows, k = _unseen(part), model.names.index("F")
    each = {"noise": found.parts.noise, "material": found.parts.material, "model": found.parts.model(found.sd),
            "whole": found.sd}
    return {name: rms(sd[rows, k]) for name, sd in each.items()}


def _predictions(model: SweepModel, samples: SweepSamples, noise: float
                 ) -> tuple[pd.DataFrame, float, dict[str, float] | None]:
    """The table of predictions under noise, the CPU time of one, ms, and the parts of the force's sd."""
    noisy = samples.signal_V + noise * np.random.default_rng(model.seed).normal(size=samples.signal_V.shape)
    begun = time.process_time()
    found = estimate(model, noisy, noise)
    predict_ms = (time.process_time() - begun) / len(samples) * 1e3
    scales = np.stack([scale.of(found.sd, found.near_edge) for scale in interval_scales(model, noise, COVERAGES)])
    part, target = parts_of(model, samples), samples.targets(model.names)
    below, above = found.ends(scales, np.array([normal(coverage) for coverage in COVERAGES])[:, None, None])
    tables = [_long(model, samples.scene, part, k, target[:, k], found.value[:, k],
                    below[..., k], above[..., k])
              for k in range(len(model.names))]
    return pd.concat(tables, ignore_index=True), predict_ms, _force_sd(model, found, part)


def _long(model: SweepModel, scene: NDArray[np.int64], part: NDArray[np.str_], k: int, target: Array, value: Array,
          below: Array, above: Array) -> pd.DataFrame:
    """Distances (3, n) to the ends of intervals as BELOW and ABOVE."""
    ends = dict(zip((*BELOW, *ABOVE), (*below, *above), strict=True))
    table = pd.DataFrame({"part": part, "scene": scene, "output": model.names[k], "unit": model.units[k],
                          "target": target, "value": value, **ends})
    table["half_width_90"] = (table["below_90"] + table["above_90"]) / 2
    order = [*PARTS, "new", "all"]
    return table.iloc[np.argsort([order.index(p) for p in part], kind="stable")]


def _scores(model: SweepModel, table: pd.DataFrame) -> dict[str, dict[str, Any]]:
    scored: dict[str, dict[str, Any]] = {}
    for name, unit in zip(model.names, model.units, strict=True):
        rows = table.loc[table["output"] == name]
        scored[name] = {str(part): asdict(_score(group, unit)) for part, group in rows.groupby("part", sort=False)}
    return scored


def _score(group: pd.DataFrame, unit: str) -> Score:
    target, value = (group[key].to_numpy(np.float64) for key in ("target", "value"))
    below, above = (group[list(keys)].to_numpy(np.float64).T for keys in (BELOW, ABOVE))
    return score(target, value, below, above, unit)


def transfer(sets: Mapping[str, Mapping[str, Any]]) -> dict[str, list[dict[str, Any]]]:
    """Scores of several sets side by side, without noise: of each output, the unseen rows of each set, with the RMSE
    over that on the first set.

    sets: name -> scores as `evaluate` gives them; one that holds seen rows alone is left out.
    """
    table: dict[str, list[dict[str, Any]]] = {}
    for name, scores in sets.items():
        for output, parts in scores["outputs"].items():
            part = next((p for p in UNSEEN if p in parts), None)
            if part is None:
                continue
            rows = table.setdefault(output, [])
            first = rows[0]["rmse"] if rows else parts[part]["rmse"]
            rows.append({"set": name, "part": part, **parts[part],
                         "rmse_over_first": parts[part]["rmse"] / first if first > 0 else None})
    return table
