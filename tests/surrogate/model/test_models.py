import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

import surrogate
from eitsim.sweeps.dataset import parquet
from surrogate.data import outputs
from surrogate.data.samples import SweepSamples, read_samples, split, take
from surrogate.data.sensor_ring import ring_of_design
from surrogate.learners.registry import METHODS
from surrogate.model import torchscript
from surrogate.model.evaluate import evaluate, parts_of
from surrogate.model.model import Model
from surrogate.model.train import train
from surrogate.model.trained import calibrated, estimate, interval_scale
from surrogate.statistics.conformal import one_factor
from touchcal.errors import InputFileError
from touchcal.json_file import digest, file_digest

NAMES = ("x0", "F", "delta_max")
EPOCHS = {"trainbr": 60, "network": 30}


@pytest.fixture(scope="module")
def models(samples: SweepSamples) -> dict[str, Model]:
    return {method: train(samples, method, NAMES, 1, epochs=EPOCHS.get(method)) for method in METHODS}


@pytest.mark.thorough
@pytest.mark.parametrize("method", METHODS)
def test_a_stored_model_predicts_the_same(models: dict[str, Model], samples: SweepSamples, tmp_path: Path,
                                          method: str) -> None:
    models[method].save(tmp_path / "model")
    again = surrogate.load(tmp_path / "model")
    for noise in (0.0, 1e-5):
        before, after = (estimate(m, samples.signal_V[:6], noise) for m in (models[method], again))
        assert np.array_equal(before.value, after.value)
        assert np.array_equal(before.sd, after.sd)
    assert np.array_equal(interval_scale(models[method]).factor, interval_scale(again).factor)
    assert (again.names, again.seed, again.method) == (NAMES, 1, method)
    assert again.record == json.loads(json.dumps(models[method].record))


def test_intervals_of_a_slow_method_are_calibrated_once(models: dict[str, Model], tmp_path: Path,
                                                        monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path))
    assert not calibrated(models["forward"], 0.0)
    first, worked_out = interval_scale(models["forward"]), []
    assert calibrated(models["forward"], 0.0)
    monkeypatch.setattr("surrogate.model.trained._scales",
                        lambda *_: worked_out.append(1) or [one_factor(np.ones(len(NAMES)))])
    assert np.array_equal(interval_scale(models["forward"]).factor, first.factor)
    assert not worked_out
    other = replace(models["forward"], calibration=replace(models["forward"].calibration,
                                                           target=models["forward"].calibration.target + 1))
    interval_scale(other)
    interval_scale(models["forward"], 1e-5)
    assert len(worked_out) == 2


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_one_seed_gives_one_model(models: dict[str, Model], samples: SweepSamples, method: str) -> None:
    again = train(samples, method, NAMES, 1, epochs=EPOCHS.get(method))
    rows = samples.signal_V[::5]
    assert np.array_equal(estimate(again, rows).value, estimate(models[method], rows).value)


@pytest.mark.slow
def test_errors_of_every_method_on_unseen_rows(models: dict[str, Model], samples: SweepSamples) -> None:
    scores = {method: evaluate(model, samples).scores for method, model in models.items()}
    rmse = {method: {name: s["outputs"][name]["test"]["rmse"] for name in NAMES} for method, s in scores.items()}
    print("test RMSE on synthetic touches:", rmse)
    assert rmse["forward"]["x0"] < 0.01
    assert rmse["forward"]["F"] < 0.02
    assert rmse["forward"]["delta_max"] < 0.05
    assert rmse["ridge"]["x0"] < 1.0
    assert rmse["network"]["x0"] < 2.0
    assert rmse["gp"]["x0"] < 1.0
    assert rmse["trainbr"]["x0"] < 10.0
    assert scores["trainbr"]["outputs"]["x0"]["test"]["r2"] > 0.9


@pytest.mark.slow
def test_all_eight_outputs_of_the_forward_method(forward_model: Model, samples: SweepSamples) -> None:
    found = evaluate(forward_model, samples)
    assert list(found.scores["outputs"]) == list(samples.names)
    for name, parts in found.scores["outputs"].items():
        assert {part: s["n"] for part, s in parts.items()} == {"train": 140, "val": 30, "test": 30}
        assert parts["test"]["r2"] > 0.99
        assert parts["test"]["unit"] == outputs.of(name).unit
    assert len(found.predictions) == 8 * 200


@pytest.mark.slow
def test_noise_grows_the_error_and_the_intervals_follow(models: dict[str, Model], samples: SweepSamples) -> None:
    scores = evaluate(models["forward"], samples, [100, 80], most_trained=20).scores
    quiet, loud = ({name: parts["test"] for name, parts in level["outputs"].items()} for level in scores["noise"])
    assert scores["outputs"]["x0"]["test"]["rmse"] < quiet["x0"]["rmse"] < loud["x0"]["rmse"]
    for level in scores["noise"]:
        assert level["db_below_baseline"] == pytest.approx(level["noise_db"])
        assert all(parts["test"]["coverage_90"] > 0.8 for parts in level["outputs"].values())
    by_signal = evaluate(models["ridge"], samples, [40], "signal").scores["noise"][0]
    assert by_signal["noise_V"] == pytest.approx(scores["signal_rms_V"] / 100)
    with pytest.raises(ValueError, match="noise reference 'peak' is unknown; known: baseline, signal"):
        evaluate(models["ridge"], samples, [40], "peak")


def test_under_noise_unseen_rows_alone_are_scored_and_without_it_some_training_rows(models: dict[str, Model],
                                                                                     samples: SweepSamples) -> None:
    found = evaluate(models["ridge"], samples, [80], most_trained=20)
    assert {part: s["n"] for part, s in found.scores["outputs"]["x0"].items()} == {"train": 20, "val": 30, "test": 30}
    assert {part: s["n"] for part, s in found.scores["noise"][0]["outputs"]["x0"].items()} == {"test": 30}
    assert found.scores["scored"] == ("20 of 140 training rows are scored, spread evenly; under noise 30 unseen rows "
                                      "alone.")
    few = evaluate(models["ridge"], samples, [80], most_noisy=10).scores
    assert few["noise"][0]["outputs"]["x0"]["test"]["n"] == 10
    assert few["scored"] == "under noise 10 of 30 unseen rows, spread evenly."
    whole, part = evaluate(models["ridge"], samples), parts_of(models["ridge"], samples)
    both = found.predictions.merge(whole.predictions, on=["part", "scene", "output"])
    assert len(both) == len(found.predictions)
    assert np.allclose(both["value_x"], both["value_y"], rtol=1e-9, atol=0)
    assert whole.scores["scored"] == ""
    seen = evaluate(models["ridge"], take(samples, part == "train"), [80]).scores["noise"][0]["outputs"]["x0"]
    assert seen["train"]["n"] == 140


def test_rows_are_recognised(models: dict[str, Model], samples: SweepSamples, make_dataset: Callable[..., Path],
                             tmp_path: Path) -> None:
    other = read_samples(make_dataset(tmp_path / "other", 25, 99))
    assert set(parts_of(models["ridge"], other)) == {"all"}
    some = take(samples, np.arange(50))
    assert np.array_equal(parts_of(models["ridge"], some), parts_of(models["ridge"], samples)[:50])
    scores = evaluate(models["forward"], other).scores["outputs"]["x0"]
    assert list(scores) == ["all"]
    assert scores["all"]["rmse"] < 0.02


def test_rows_of_several_touches_are_refused(make_dataset: Callable[..., Path], tmp_path: Path) -> None:
    folder = make_dataset(tmp_path / "pairs", 25, 99)
    table = parquet.read_dataset(folder).table
    parquet.write_part(folder, table.assign(touches=np.where(table["scene"] == 7, 2, 1)).to_dict("records"))
    with pytest.raises(InputFileError, match=r"1 rows have several touches \(scene 7: 2\).*one touch a row"):
        read_samples(folder)


def test_rows_of_one_touch_are_not_parted(make_dataset: Callable[..., Path], tmp_path: Path) -> None:
    """A nested design by its blocks, any other by touches that come again."""
    folder = make_dataset(tmp_path / "nested", 160, 99)
    manifest = json.loads((folder / parquet.MANIFEST).read_text())
    again = parquet.read_dataset(folder).table
    again[list(parquet.TOUCH)] = again[list(parquet.TOUCH)].to_numpy()[np.arange(160) // 2]
    for sampler, each in (("nested", 4), ("random", 2)):
        manifest["design"]["sampler"] = sampler
        parquet.write_manifest(folder, manifest)
        parquet.write_part(folder, again.to_dict("records"))
        found = read_samples(folder)
        part = split(found.group, 3).reshape(-1, each)
        assert np.all(part == part[:, :1])
        assert np.mean(part == "train") == pytest.approx(0.7)
    with pytest.raises(ValueError, match="40 ok rows of 10 different touches are too few"):
        split(np.arange(40) // 4, 0)


def test_another_drive_is_another_sensor(models: dict[str, Model], samples: SweepSamples) -> None:
    opposite = replace(samples, ring=ring_of_design({"drive": {"pattern": "opposite"}}))
    assert opposite.signal_V.shape == samples.signal_V.shape
    with pytest.raises(ValueError, match="another sensor than the model"):
        evaluate(models["ridge"], opposite)
    with pytest.raises(ValueError, match=r"width_mm in \[electrodes\] varies"):
        ring_of_design({"electrodes": {"width_mm": [5, 10]}})


def test_a_ring_reads_pairs_of_electrodes() -> None:
    ring = ring_of_design({"drive": {"reading": "differential"}})
    assert np.array_equal((ring.read - ring.ground) % 16, np.ones(208))
    currents, weights = np.eye(16)[:2] - np.eye(16)[[5, 9]], np.eye(16)[3:4] - np.eye(16)[7]
    drive = {"currents": currents.tolist(), "measurements": weights.tolist()}
    ring = ring_of_design({"drive": drive})
    ends = [end.tolist() for end in (ring.source, ring.sink, ring.read, ring.ground)]
    assert ends == [[0, 1], [5, 9], [3, 3], [7, 7]]
    with pytest.raises(ValueError, match=r"pattern of currents 0 .* pairs alone"):
        ring_of_design({"drive": drive | {"currents": (2 * currents).tolist()}})
    with pytest.raises(ValueError, match=r"measurement 0 .* pairs alone"):
        ring_of_design({"drive": drive | {"measurements": np.eye(16)[:1].tolist()}})


def test_what_cannot_be_trained_is_refused(samples: SweepSamples) -> None:
    with pytest.raises(ValueError, match="'svm' is unknown; known: trainbr, network, forward, ridge, gp"):
        train(samples, "svm")
    with pytest.raises(ValueError, match="epochs are steps of trainbr, network; ridge has none"):
        train(samples, "ridge", epochs=5)
    with pytest.raises(ValueError, match="8 ok rows are too few"):
        train(take(samples, np.arange(8)), "ridge")


def test_too_few_rows_are_refused_before_the_sensor_is_solved(
        tmp_path: Path, make_dataset: Callable[..., Path], monkeypatch: pytest.MonkeyPatch) -> None:
    folder, solved = make_dataset(tmp_path / "few", 8, 3), []
    monkeypatch.setattr("surrogate.data.samples.ring_of_design", lambda *_: solved.append(1))
    with pytest.raises(ValueError, match="8 ok rows are too few"):
        train(folder, "ridge")
    assert not solved


@pytest.mark.slow
def test_degenerate_rows(samples: SweepSamples) -> None:
    doubled = take(samples, np.repeat(np.arange(40), 2))
    assert np.all(np.isfinite(estimate(train(doubled, "forward", NAMES, 0), doubled.signal_V).value))
    fixed = replace(samples, target=samples.target.copy())
    fixed.target[:, 2] = 14.0
    scores = evaluate(train(fixed, "ridge", ("d",), 0), fixed).scores["outputs"]["d"]["test"]
    assert scores["r2"] is None
    with pytest.raises(ValueError, match="output 1 of 1 is 14 in every training row"):
        train(fixed, "trainbr", ("d",), 0)
    one = evaluate(train(fixed, "forward", ("x0", "d"), 0), fixed).scores["outputs"]
    assert one["d"]["test"]["rmse"] < 0.01
    silent = replace(samples, signal_V=samples.signal_V * (samples.scene != 17)[:, None])
    with pytest.raises(ValueError, match="scene 17 has no signal"):
        train(silent, "ridge", NAMES, 1)


def test_a_folder_that_is_no_model_is_refused(models: dict[str, Model], tmp_path: Path) -> None:
    with pytest.raises(InputFileError, match=r"not a model: it holds no model\.json"):
        surrogate.load(tmp_path)
    models["ridge"].save(tmp_path / "model")
    text = json.loads((tmp_path / "model" / "model.json").read_text())
    (tmp_path / "model" / "model.json").write_text(json.dumps({**text, "schema": 99}))
    with pytest.raises(InputFileError, match="schema 99"):
        surrogate.load(tmp_path / "model")
    (tmp_path / "model" / "model.json").write_text(json.dumps({**text, "method": "forward"}))
    with pytest.raises(InputFileError, match="do not belong"):
        surrogate.load(tmp_path / "model")
    for spoilt, said in (("[1, 2]", "must be an object"), (json.dumps({**text, "seed": "x"}), "seed must be a whole")):
        (tmp_path / "model" / "model.json").write_text(spoilt)
        with pytest.raises(InputFileError, match=said):
            surrogate.load(tmp_path / "model")
    (tmp_path / "model" / "model.json").write_text(json.dumps(text))
    (tmp_path / "model" / "arrays.npz").write_text("no arrays")
    with pytest.raises(InputFileError, match="do not belong together, or one is damaged"):
        surrogate.load(tmp_path / "model")


@pytest.mark.parametrize(("schema", "lacking"), [(13, {"learnt_from"}), (14, set())])
def test_a_model_of_a_schema_before_is_read(models: dict[str, Model], samples: SweepSamples, tmp_path: Path,
                                            schema: int, lacking: set[str]) -> None:
    models["ridge"].save(tmp_path)
    text = json.loads((tmp_path / "model.json").read_text())
    old = {key: value for key, value in text.items() if key not in lacking | {"arrays_sha256"}} | {"schema": schema}
    with np.load(tmp_path / "arrays.npz") as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(tmp_path / "arrays.npz", **arrays | {"description_sha256": np.array(digest(old))})
    old["arrays_sha256"] = file_digest(tmp_path / "arrays.npz")
    (tmp_path / "model.json").write_text(json.dumps(old))
    again = surrogate.load(tmp_path)
    assert np.array_equal(estimate(again, samples.signal_V).value, estimate(models["ridge"], samples.signal_V).value)
    (tmp_path / "model.json").write_text(json.dumps(old | {"schema": 12}))
    with pytest.raises(InputFileError, match=r"schema 12, method 'ridge' is not one that this version reads .* again"):
        surrogate.load(tmp_path)


def test_both_files_of_a_model_are_tied(models: dict[str, Model], tmp_path: Path) -> None:
    folder = tmp_path / "model"
    models["ridge"].save(folder)
    text, content = json.loads((folder / "model.json").read_text()), (folder / "arrays.npz").read_bytes()
    swapped = text | {"outputs": text["outputs"][::-1]}
    unhashed = {key: value for key, value in swapped.items() if key != "arrays_sha256"}
    for changed, said in ((swapped, r"model\.json was changed"), (unhashed, "the key 'arrays_sha256' is missing")):
        (folder / "model.json").write_text(json.dumps(changed))
        with pytest.raises(InputFileError, match=said):
            surrogate.load(folder)
    (folder / "model.json").write_text(json.dumps(text))
    assert surrogate.load(folder).names == NAMES
    with np.load(folder / "arrays.npz") as file:
        arrays = {name: file[name] for name in file.files}
    np.savez(folder / "arrays.npz", **arrays | {"baseline_V": 2 * arrays["baseline_V"]})
    with pytest.raises(InputFileError, match=r"arrays\.npz was changed"):
        surrogate.load(folder)
    (folder / "arrays.npz").write_bytes(content[:-9])
    with pytest.raises(InputFileError, match=r"arrays\.npz"):
        surrogate.load(folder)


def test_a_folder_of_other_things_is_left_alone(models: dict[str, Model], tmp_path: Path) -> None:
    (tmp_path / "letter.txt").write_text("dear")
    with pytest.raises(InputFileError, match=r"it holds letter\.txt and no model"):
        models["ridge"].save(tmp_path)
    assert [path.name for path in tmp_path.iterdir()] == ["letter.txt"]


def test_nothing_stored_is_pickled(models: dict[str, Model], tmp_path: Path) -> None:
    for method, model in models.items():
        model.save(tmp_path / method)
        with np.load(tmp_path / method / "arrays.npz", allow_pickle=False) as stored:
            assert all(stored[name].dtype != object for name in stored.files)


@pytest.mark.parametrize("method", ["trainbr", "network"])
def test_an_exported_network_gives_what_estimate_gives(models: dict[str, Model], samples: SweepSamples, tmp_path: Path,
                                                       method: str) -> None:
    path, told = tmp_path / "net.pt", {"outputs.txt": ""}
    said = torchscript.write(models[method], path)
    assert said["inputs"].startswith("208 differences")
    assert said["outputs"] == "x0 (mm), F (N), delta_max (mm)"
    module = torch.jit.load(str(path), _extra_files=told)
    found = module(torch.from_numpy(samples.signal_V[:50].copy())).numpy()
    assert np.allclose(found, estimate(models[method], samples.signal_V[:50]).value, rtol=1e-9, atol=1e-9)
    assert told["outputs.txt"] == b"x0 (mm), F (N), delta_max (mm)"


def test_only_networks_are_exported(models: dict[str, Model], tmp_path: Path) -> None:
    with pytest.raises(ValueError, match=r"method 'ridge' is no network\. Export a model of trainbr or network"):
        torchscript.write(models["ridge"], tmp_path / "net.pt")
    assert not (tmp_path / "net.pt").exists()


@pytest.mark.parametrize("method", METHODS)
def test_a_constant_reading_and_repeated_rows_are_learned_around(samples: SweepSamples, method: str) -> None:
    rows = np.repeat(np.arange(0, 200, 5), 2)
    few = take(samples, rows)
    signal = few.signal_V.copy()
    if method != "forward":
        signal[:, 3] = 1e-3
    few = replace(few, signal_V=signal)
    found = estimate(train(few, method, ("x0", "F"), 0, epochs=EPOCHS.get(method)), signal)
    assert np.isfinite(found.value).all()
    assert np.isfinite(found.sd).all()
    assert np.allclose(found.value[::2], found.value[1::2], rtol=1e-4, atol=1e-6)


@pytest.mark.parametrize("method", ["network", "gp", "trainbr"])
def test_what_is_not_finite_or_does_not_vary_is_told(samples: SweepSamples, method: str) -> None:
    holed = replace(samples, signal_V=samples.signal_V.copy())
    holed.signal_V[:, 7] = np.nan
    with pytest.raises(ValueError, match=r"scene \d+ holds a number that is not finite"):
        train(holed, method)
    alike = take(samples, np.repeat(4, 60))
    with pytest.raises(ValueError, match="60 ok rows of 1 different touches are too few"):
        train(alike, method)
    alike = replace(alike, group=np.arange(60))
    with pytest.raises(ValueError, match=r"42 training rows hold one signal|in every training row"):
        train(alike, method)


@pytest.mark.slow
def test_two_processes_give_the_networks_of_one(samples: SweepSamples, models: dict[str, Model]) -> None:
    shared = train(samples, "trainbr", NAMES, 1, epochs=60, workers=2)
    one = models["trainbr"]
    assert np.array_equal(estimate(shared, samples.signal_V).value, estimate(one, samples.signal_V).value)
    assert shared.record == one.record
    assert shared.fit_s > 0
