"""Forces of a touch that has been held for a time: the foam's relaxation scales stresses and nothing else."""

import io
import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from eitsim.sweeps.dataset.parquet import RELAXATION, read_dataset, read_manifest, write_manifest, write_part
from matcal.laws.prony import Prony, relaxation
from surrogate.data.samples import SweepSamples, read_samples, take
from surrogate.model.model import Model
from surrogate.model.stream import answer
from surrogate.model.train import train
from touchcal.arrays import Array

SERIES = {"g": [0.2, 0.1], "tau_s": [1.0, 30.0], "moduli": "longterm"}
NAMES = ("x0", "d", "F", "sigma_ave")


@pytest.fixture(scope="module")
def model(samples: SweepSamples) -> Model:
    return train(replace(samples, relaxation=SERIES), "ridge", NAMES, 1)


def table(model: Model, frames: Array, untouched_V: Array, **asked: Any) -> pd.DataFrame:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return model.predict(frames, untouched_V, **asked)


@pytest.mark.parametrize(("moduli", "over"), [("longterm", 0.7), ("instantaneous", 1.0)])
def test_stresses_follow_the_series_and_nothing_else_changes(model: Model, synthetic: Callable[..., Any],
                                                             untouched_V: Array, moduli: str, over: float) -> None:
    of = replace(model, record=model.record | {"relaxation": SERIES | {"moduli": moduli}})
    frames = untouched_V + synthetic(4, 70)[1]
    plain, held = (table(of, frames, untouched_V, **asked) for asked in ({}, {"held_s": 10.0}))
    factor = float(relaxation(Prony(np.array(SERIES["g"]), np.array(SERIES["tau_s"])), 10.0)) / over
    for name in plain.columns.drop("flag"):
        stress = name.startswith(("F", "sigma_ave"))
        assert np.allclose(held[name], plain[name] * (factor if stress else 1.0), rtol=1e-12), name


def test_without_a_time_it_is_said_how_much_stiffer_a_held_foam_is(model: Model, synthetic: Callable[..., Any],
                                                                   untouched_V: Array) -> None:
    frames = untouched_V + synthetic(2, 71)[1]
    stiffer = 100 * (float(relaxation(Prony(np.array(SERIES["g"]), np.array(SERIES["tau_s"])), 1.0)) / 0.7 - 1)
    with pytest.warns(UserWarning, match=rf"{stiffer:+.0f} % after 1 s".replace("+", r"\+")):
        model.predict(frames, untouched_V)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model.predict(frames, untouched_V, held_s=1.0)


def test_a_time_that_means_nothing_is_refused(model: Model, untouched_V: Array) -> None:
    frames = untouched_V[None] * 1.01
    for of, held_s, words in ((model, -1.0, "from 0, got -1"), (model, np.nan, "finite number"),
                              (replace(model, record={}), 1.0, "no Prony series")):
        with pytest.raises(ValueError, match=words):
            of.predict(frames, untouched_V, held_s=held_s)


def test_a_stream_takes_the_time_and_the_scaling(model: Model, synthetic: Callable[..., Any],
                                                 untouched_V: Array) -> None:
    frames, said = 1.1 * (untouched_V + np.vstack([np.zeros(208), synthetic(3, 72)[1]])), []
    lines, sink = "\n".join(",".join(f"{volt!r}" for volt in frame) for frame in frames.tolist()), io.StringIO()
    answer(model, io.BytesIO(lines.encode()), sink, 0.0, say=said.append, held_s=10.0)
    assert any("all readings are 1.1 times" in words for words in said)
    known = table(model, frames[1:] / 1.1, untouched_V, held_s=10.0)
    found = pd.read_csv(io.StringIO(sink.getvalue()))
    assert np.allclose(found[["x0_mm", "F_N"]], known[["x0_m", "F_N"]] * [1e3, 1.0], rtol=1e-4)


def test_the_series_comes_from_the_data_set(sweep: Path, tmp_path: Path) -> None:
    write_part(tmp_path, read_dataset(sweep).table.head(60).to_dict("records"))
    write_manifest(tmp_path, read_manifest(sweep) | {RELAXATION: SERIES})
    samples = read_samples(tmp_path)
    assert samples.relaxation == SERIES
    assert take(samples, np.arange(40)).relaxation == SERIES
    assert train(samples, "ridge", NAMES, 1).record["relaxation"] == SERIES
