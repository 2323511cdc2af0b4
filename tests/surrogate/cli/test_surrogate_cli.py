import contextlib
import io
import json
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from rich.console import Console

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.dataset.parquet import read_dataset, read_manifest, write_manifest, write_part
from eitsim.sweeps.measurement.instrument import Measurement
from eitsim.sweeps.run.measure import measure
from surrogate.cli import main
from touchcal.arrays import Array

Synthetic = Callable[[int, int], tuple[Array, Array]]
Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run `surrogate` with these arguments: exit status, standard output, standard error."""

    def run(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr("sys.argv", ["surrogate", *map(str, arguments)])
        status = 0
        try:
            main.main()
        except SystemExit as end:
            status = int(end.code or 0)
        out, err = capsys.readouterr()
        return status, out, err

    return run


def trained(sweep: Path, out: Path, *options: str) -> Path:
    """A model of a sweep, trained on the command line."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sys.argv", ["surrogate", "train", str(sweep), "--out", str(out), "--seed", "1", *options])
        with pytest.raises(SystemExit) as end:
            main.main()
    assert not end.value.code
    return out


@pytest.fixture(scope="module")
def forward(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A forward model of the synthetic sweep, which learns the rim too: for what is said of its answers."""
    return trained(sweep, tmp_path_factory.mktemp("models") / "forward", "--noise-db", "80")


@pytest.fixture(scope="module")
def inner(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A forward model of so few touches that it learns nothing of the rim, for what the commands do with any."""
    return trained(part_of(sweep, tmp_path_factory.mktemp("hundred"), 100),
                   tmp_path_factory.mktemp("models") / "inner", "--noise-db", "80")


@pytest.fixture(scope="module")
def ridge(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A model of the quickest method, for what the commands do with any."""
    return trained(sweep, tmp_path_factory.mktemp("models") / "ridge", "--method", "ridge")


@pytest.fixture(scope="module")
def few(sweep: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The first 50 rows of the synthetic sweep, as a set of their own."""
    return part_of(sweep, tmp_path_factory.mktemp("few"), 50)


def part_of(sweep: Path, folder: Path, rows: int) -> Path:
    """A set of the first rows of a sweep."""
    write_part(folder, read_dataset(sweep).table.head(rows).to_dict("records"))
    write_manifest(folder, read_manifest(sweep))
    return folder


def write_frames(path: Path, frames: Array, header: list[str] | None = None) -> Path:
    pd.DataFrame(frames).to_csv(path, index=False, header=header or False)
    return path


def test_training_leaves_a_model_its_scores_and_its_predictions(inner: Path) -> None:
    model, scores = (json.loads((inner / name).read_text()) for name in ("model.json", "evaluation.json"))
    assert (model["schema"], model["method"], model["seed"]) == (15, "forward", 1)
    assert model["dataset"]["split"] == {"train": 70, "val": 15, "test": 15}
    assert len(model["dataset"]["sha256"]) == 64
    assert {"touchcal", "numpy", "scipy"} <= set(model["versions"])
    table = pd.read_parquet(inner / "predictions.parquet")
    rows = table[(table["output"] == "x0") & (table["part"] == "test")]
    rmse = float(np.sqrt(np.mean((rows["value"] - rows["target"]) ** 2)))
    assert rmse == pytest.approx(scores["outputs"]["x0"]["test"]["rmse"])


@pytest.mark.thorough
def test_evaluate_prints_one_object(call: Call, inner: Path, few: Path) -> None:
    status, out, _ = call("evaluate", inner, few, "--noise-db", "100,80", "--json")
    scores = json.loads(out)
    assert status == 0
    assert {"mse", "rmse", "r2", "mae", "n", "coverage_50", "coverage_90", "coverage_95",
            "half_width_90", "unit"} == set(scores["outputs"]["F"]["test"])
    assert scores["fit_s"] > 0
    assert scores["predict_ms"] > 0
    assert [level["noise_db"] for level in scores["noise"]] == [100, 80]
    assert scores["noise"][0]["noise_V"] == pytest.approx(scores["baseline_rms_V"] * 1e-5)


@pytest.mark.thorough
def test_report_writes_a_pdf(call: Call, inner: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The same figures as SVG, which take as long as the page, are left out."""
    monkeypatch.setattr("reports.document.style.save_svg", lambda figure, svg: svg.touch())
    status, out, _ = call("report", inner, "--out", tmp_path / "forward.pdf")
    assert status == 0
    assert "forward.pdf" in out
    assert (tmp_path / "forward.pdf").read_bytes().startswith(b"%PDF")


def test_evaluate_prints_a_table(call: Call, ridge: Path, few: Path) -> None:
    status, out, _ = call("evaluate", ridge, few, "--noise-db", "100,90")
    assert status == 0
    assert len(out.splitlines()) <= 40
    for words in ("100 dB", "90 dB", "delta_max", "+-90 %", "caution: 30 calibrating rows are few"):
        assert words in out, words
    status, out, _ = call("evaluate", ridge, few, "--noise-db", "90", "--verbose")
    assert status == 0
    assert "90.0 dB below the baseline" in out
    assert "30 rows calibrate the 90 % intervals" in out
    assert "caution: 30 calibrating rows are few" in out
    assert "+-90 %" in out


def test_evaluate_prints_the_signal_over_force(call: Call, inner: Path, few: Path) -> None:
    status, out, _ = call("evaluate", inner, few, "--verbose")
    assert status == 0
    assert "signal over force" in out
    stored = json.loads((inner / "evaluation.json").read_text())["amplitude"]
    assert f"{1e3 * max(stored['diameters'][0]['rms_V']):.3g}" in out


def test_least_errors_stand_beside_those_of_their_data_set_alone(call: Call, ridge: Path, few: Path, sweep: Path,
                                                                 tmp_path: Path) -> None:
    model = Path(shutil.copytree(ridge, tmp_path / "model"))
    own = json.loads(call("evaluate", model, few, "--json")[1])["dataset"]["sha256"]
    pd.DataFrame({"dataset": own, "noise_db": 80.0, "material": ["known", "posterior"], "output": "F",
                  "limit": [0.0123, 0.0456]}).to_csv(model / "limits.csv", index=False)
    (level,) = json.loads(call("evaluate", model, few, "--noise-db", "80", "--json")[1])["noise"]
    assert level["limits"] == {"known": {"F": 0.0123}, "posterior": {"F": 0.0456}}
    assert "0.0456" in call("evaluate", model, few, "--noise-db", "80", "--verbose")[1]
    assert json.loads(call("evaluate", model, sweep, "--noise-db", "80", "--json")[1])["noise"][0]["limits"] == {}


def test_several_sets_are_compared(call: Call, ridge: Path, few: Path, make_dataset: Callable[..., Path],
                                   tmp_path: Path) -> None:
    other = make_dataset(tmp_path / "other", 12, 9)
    printed = call("evaluate", ridge, few, other, "--noise-db", "80,60")[1]
    assert "over first" in printed
    assert len(printed.splitlines()) <= 40
    status, out, _ = call("evaluate", ridge, few, other, "--json")
    result = json.loads(out)
    assert status == 0
    assert list(result["sets"]) == [str(few), str(other)]
    rows = result["transfer"]["x0"]
    assert [(row["part"], row["set"]) for row in rows] == [("test", str(few)), ("all", str(other))]
    assert rows[1]["rmse_over_first"] == pytest.approx(rows[1]["rmse"] / rows[0]["rmse"])


def test_training_shows_its_steps_on_a_terminal_alone(call: Call, sweep: Path, tmp_path: Path,
                                                      monkeypatch: pytest.MonkeyPatch) -> None:
    train = ("train", sweep, "--out", tmp_path / "m", "--method", "ridge", "--outputs", "y0,F", "--json")
    assert call(*train)[::2] == (0, "")
    terminal = Console(stderr=True, force_terminal=True, _environ={"TERM": "xterm", "COLUMNS": "100"})
    monkeypatch.setattr("touchcal.terminal._terminal", lambda: terminal)
    status, out, err = call(*train)
    assert status == 0
    assert json.loads(out)["method"] == "ridge"
    assert 0 <= err.find("learning the touches") < err.find("scoring the model")


@pytest.mark.parametrize(("method", "extra"), [("trainbr", ["--epochs", "20"]), ("gp", [])])
def test_other_methods_and_chosen_outputs(call: Call, sweep: Path, tmp_path: Path, method: str,
                                          extra: list[str]) -> None:
    status, out, _ = call("train", sweep, "--out", tmp_path / "m", "--method", method, "--outputs", "y0,F", *extra,
                          "--json")
    result = json.loads(out)
    assert status == 0
    assert list(result["outputs"]) == ["y0", "F"]
    if method == "trainbr":
        net = result["training"]["y0"]
        assert net["parameters"] == 4201
        assert net["epochs"] <= 20
        assert 0 < net["gamma"] < 140


@pytest.mark.slow
def test_predict_reads_recorded_frames(call: Call, forward: Path, synthetic: Synthetic, untouched_V: Array,
                                       tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("TOUCHCAL_CACHE", str(tmp_path / "cache"))
    touch, signal = synthetic(6, 50)
    rng, noise = np.random.default_rng(0), 2e-6
    frames = untouched_V + np.vstack([signal, np.zeros(208)])
    frames += noise * rng.normal(size=frames.shape)
    frames_file = write_frames(tmp_path / "frames.csv", frames, voltage_columns(208))
    untouched = write_frames(tmp_path / "untouched.csv", untouched_V + noise * rng.normal(size=(20, 208)))
    asked = ("predict", forward, frames_file, "--baseline", untouched, "--out", tmp_path / "p.csv")
    first, again = call(*asked), call(*asked)
    assert (first[0], again[0]) == (0, 0)
    waits = ("surrogate: the intervals are calibrated at this noise first, which takes a while; they are kept for the "
             "next time.")
    assert waits in first[2].splitlines()
    assert [line for line in first[2].splitlines() if line != waits] == again[2].splitlines()
    assert len(again[2].splitlines()) == 2
    assert "answers assume one punch, profile flat" in again[2]
    assert "30 calibrating rows are few: the 90 % intervals may hold as little as 80 %" in again[2]
    assert "7 frames" in first[1]
    table = pd.read_csv(tmp_path / "p.csv")
    assert list(table.columns[:4]) == ["line", "x0_mm", "x0_lo90_mm", "x0_hi90_mm"]
    assert np.allclose(table["x0_mm"][:6], touch[:, 0], atol=0.5)
    assert np.all(table["F_lo90_N"][:6] < table["F_hi90_N"][:6])
    assert table["flag"].fillna("").tolist()[6] == "no touch"
    assert table.iloc[6, 1:-1].isna().all()


def test_the_first_frame_serves_as_the_baseline(call: Call, inner: Path, synthetic: Synthetic, untouched_V: Array,
                                                tmp_path: Path) -> None:
    touch, signal = synthetic(3, 51)
    frames = write_frames(tmp_path / "frames.csv", np.vstack([untouched_V, untouched_V + signal]))
    status, out, err = call("predict", inner, frames)
    table = pd.read_csv(io.StringIO(out))
    assert status == 0
    assert "noise of the readings is unknown" in err
    assert "frames.csv, line 1 is taken as the untouched frame" in err
    assert np.allclose(table[["x0_mm", "y0_mm"]], touch[:, :2], atol=0.05)
    assert table["line"].tolist() == [2, 3, 4]


def test_named_columns_may_come_in_any_order(call: Call, ridge: Path, synthetic: Synthetic, untouched_V: Array,
                                             tmp_path: Path) -> None:
    frames = np.vstack([untouched_V, untouched_V + synthetic(2, 52)[1]])
    order = np.random.default_rng(0).permutation(208)
    straight = call("predict", ridge, write_frames(tmp_path / "a.csv", frames), "--noise-V", "1e-6")[1]
    turned = write_frames(tmp_path / "b.csv", frames[:, order], [voltage_columns(208)[i] for i in order])
    mixed = call("predict", ridge, turned, "--noise-V", "1e-6")[1]
    one, other = (pd.read_csv(io.StringIO(text)).drop(columns=["line", "flag"]) for text in (straight, mixed))
    assert np.allclose(one, other)


@pytest.mark.slow
def test_odd_frames_are_flagged(call: Call, forward: Path, synthetic: Synthetic, untouched_V: Array,
                                tmp_path: Path) -> None:
    _, signal = synthetic(3, 53)
    odd = signal[0].copy()
    odd[40] += 0.5 * np.abs(signal[0]).max()
    strong = 40 * signal[1]
    frames = write_frames(tmp_path / "f.csv", untouched_V + np.vstack([signal[0], odd, strong]))
    base = write_frames(tmp_path / "b.csv", untouched_V[None])
    table = pd.read_csv(io.StringIO(call("predict", forward, frames, "--baseline", base, "--noise-V", "1e-6")[1]))
    flags = table["flag"].fillna("").tolist()
    assert flags[0] == ""
    assert "unlike the trained touches" in flags[1]
    assert "outside the training range" in flags[2]


class Interrupted(io.BytesIO):
    """Lines, and then Ctrl-C."""

    def read1(self, size: int | None = -1) -> bytes:
        if waiting := super().read1(size):
            return waiting
        raise KeyboardInterrupt


@pytest.mark.parametrize("kind", ["inner", "ridge"])
def test_a_stream_that_ctrl_c_ends_keeps_its_rows(call: Call, request: pytest.FixtureRequest, kind: str,
                                                  untouched_V: Array, tmp_path: Path,
                                                  monkeypatch: pytest.MonkeyPatch) -> None:
    line = ",".join(map(repr, untouched_V.tolist()))
    monkeypatch.setattr("surrogate.data.frame_source.opened",
                        lambda *given: contextlib.nullcontext(Interrupted(f"{line}\n{line}\n".encode())))
    status, _, err = call("predict", request.getfixturevalue(kind), "-", "--noise-V", "1e-4", "--out",
                          tmp_path / "rows.csv")
    assert status == 130
    assert err.endswith(f"surrogate: stopped by Ctrl-C; {tmp_path / 'rows.csv'} holds all rows so far.\n")
    assert len(pd.read_csv(tmp_path / "rows.csv")) == 2 - (kind == "ridge")  # to which the first frame is the untouched


@pytest.mark.parametrize(("spoil", "message"), [
    (lambda f: f[:, :200], "line 1: unreadable: 200 columns, expected 208 voltages separated by commas; no line of it"),
    (lambda f: np.where(np.arange(208) < 110, 0.0, f), "line 1: dead channels: columns 1, 2, 3, 4 and 106 more"),
    (lambda f: f[:1], "one frame only"),
    (lambda f: f[:0], "holds no frame. Expected rows of 208 voltages"),
])
def test_bad_frames_name_the_line(call: Call, inner: Path, synthetic: Synthetic, untouched_V: Array, tmp_path: Path,
                                  spoil: Callable[[Array], Array], message: str) -> None:
    frames = write_frames(tmp_path / "frames.csv", spoil(untouched_V + np.vstack([np.zeros(208), synthetic(3, 1)[1]])))
    status, out, err = call("predict", inner, frames)
    assert (status, out) == (2, "")
    assert message in err
    assert "frames.csv" in err


def test_bad_input_is_told_plainly(call: Call, inner: Path, sweep: Path, make_dataset: Callable[..., Path],
                                   tmp_path: Path) -> None:
    failed = make_dataset(tmp_path / "failed", 5, 0, outcome=["refused"] * 3 + ["not_converged"] * 2)
    holed = make_dataset(tmp_path / "holed", 30, 0, dv_017=[0.1] * 29 + [np.nan])
    small = make_dataset(tmp_path / "small", 12, 0)
    out = tmp_path / "m"
    cases = [(("train", tmp_path / "absent", "--out", out), "absent: no such folder"),
             (("train", tmp_path, "--out", out), "not a data set"),
             (("train", failed, "--out", out), "none of its 5 rows is ok (3 refused, 2 not_converged)"),
             (("train", holed, "--out", out), "dv_017 of scene 29 is nan"),
             (("train", small, "--out", out), "12 ok rows are too few"),
             (("train", sweep, "--out", out, "--method", "svm"), "unknown; known: trainbr, network, forward, ridge,"),
             (("export", inner, "--out", out), "method 'forward' is no network"),
             (("train", sweep, "--out", out, "--outputs", "depth"), "output 'depth' is unknown"),
             (("evaluate", inner, sweep, "--noise-db", "60,loud"), "--noise-db: 'loud' is not a number"),
             (("evaluate", sweep, sweep), "not a model"),
             (("evaluate", inner, sweep, "--labels", tmp_path / "none.csv"), "--labels are those of a recording"),
             (("predict", inner, tmp_path / "none.csv"), "none.csv: no such file")]
    for arguments, message in cases:
        status, printed, err = call(*arguments)
        assert (status, printed) == (2, ""), arguments
        assert message in err
        assert "Traceback" not in err
    assert not out.exists()


def test_a_sweep_with_a_missing_electrode_is_refused_for_that_and_not_for_its_empty_readings(
        call: Call, make_dataset: Callable[..., Path], tmp_path: Path) -> None:
    holed = make_dataset(tmp_path / "holed", 30, 0, dv_017=[np.nan] * 30)
    manifest = json.loads((holed / "design.json").read_text())
    manifest["design"]["tables"] = {"electrodes": {"missing": [5]}}
    (holed / "design.json").write_text(json.dumps(manifest))
    status, _, err = call("train", holed, "--out", tmp_path / "m")
    assert status == 2
    assert "electrodes 5 (from 0) are missing" in " ".join(err.split())
    assert "learn from all readings" in " ".join(err.split())
    assert "Sweep that part again" not in " ".join(err.split())


@pytest.mark.slow
def test_measured_rows_are_told_apart_as_the_clean_ones_that_they_were(call: Call, forward: Path, few: Path,
                                                                       tmp_path: Path) -> None:
    measure(few, tmp_path / "measured", Measurement(snr_db=70, relative_to="rms"))
    scores = {}
    for name, folder in (("clean", few), ("measured", tmp_path / "measured")):
        status, out, _ = call("evaluate", forward, folder, "--json")
        assert status == 0
        scores[name] = json.loads(out)
    clean, measured = (scores[name]["outputs"]["x0"] for name in ("clean", "measured"))
    assert {part: score["n"] for part, score in measured.items()} == {part: score["n"] for part, score in clean.items()}
    assert measured["test"]["rmse"] > 2 * clean["test"]["rmse"]
    assert scores["clean"]["dataset"]["sha256"] != scores["measured"]["dataset"]["sha256"]
    assert scores["clean"]["interval_caution"] == ""
    assert "without noise, and these are measured with snr_db = 70" in scores["measured"]["interval_caution"]


def test_intervals_of_rows_measured_otherwise_are_cautioned(call: Call, few: Path, tmp_path: Path) -> None:
    """Another seed is the same measurement; a model that does not tell is not doubted."""
    for name, seed in (("a", 0), ("b", 5)):
        measure(few, tmp_path / name, Measurement(snr_db=70, relative_to="rms", seed=seed))
    assert call("train", tmp_path / "a", "--out", tmp_path / "m", "--method", "ridge")[0] == 0
    told = [call("evaluate", tmp_path / "m", folder)[1] for folder in (tmp_path / "a", tmp_path / "b", few)]
    assert ["caution: intervals" in text for text in told] == [False, False, True]
    description = json.loads((tmp_path / "m" / "model.json").read_text())
    del description["dataset"]["measurement"], description["calibration"]
    (tmp_path / "m" / "model.json").write_text(json.dumps(description))
    assert "caution: intervals were" not in call("evaluate", tmp_path / "m", few)[1]


def test_more_noise_than_any_instrument_reads_is_refused(call: Call, ridge: Path, tmp_path: Path) -> None:
    status, _, said = call("predict", ridge, tmp_path / "absent.csv", "--noise-V", "1e300")
    assert status == 2
    assert "--noise-V must be 0 to 1000 V, got 1e+300" in said


def test_gains_of_the_instrument_are_taken_out_unless_told_otherwise(call: Call, ridge: Path, synthetic: Synthetic,
                                                                     untouched_V: Array, tmp_path: Path) -> None:
    gain = 1 + 0.03 * np.random.default_rng(4).normal(size=208)
    frames = np.vstack([untouched_V, untouched_V + synthetic(3, 53)[1]])
    plain, worn = write_frames(tmp_path / "plain.csv", frames), write_frames(tmp_path / "worn.csv", gain * frames)
    exact, scaled, left = (pd.read_csv(io.StringIO(call("predict", ridge, *asked)[1])) for asked in (
        (plain,), (worn,), (worn, "--scale-baseline", "no")))
    assert np.allclose(scaled["F_N"], exact["F_N"], rtol=1e-4)
    assert not np.allclose(left["F_N"], exact["F_N"], rtol=1e-3)
    assert "All readings are multiplied by" in call("predict", ridge, worn)[2]
    assert "would take it out" in call("predict", ridge, worn, "--scale-baseline", "no")[2]


def test_choices_of_frames_that_do_not_go_together_are_refused(call: Call, ridge: Path, untouched_V: Array,
                                                               tmp_path: Path) -> None:
    frames = write_frames(tmp_path / "f.csv", np.vstack([untouched_V, untouched_V]))
    for asked, words in ((("--held", "5"), "no Prony series"), (("--held", "5", "--posterior"), "plain predictions"),
                         (("--scale-baseline", "maybe"), "auto, yes, no")):
        status, printed, said = call("predict", ridge, frames, *asked)
        assert (status, printed) == (2, "")
        assert words in said


def test_rows_that_are_missing_are_counted(call: Call, sweep: Path, ridge: Path, tmp_path: Path) -> None:
    folder = Path(shutil.copytree(sweep, tmp_path / "sweep"))
    manifest = json.loads((folder / "design.json").read_text())
    manifest["design"]["scenes"] += 4
    (folder / "design.json").write_text(json.dumps(manifest))
    status, _, said = call("evaluate", ridge, folder)
    assert status == 0
    assert f"4 of its {manifest['design']['scenes']} scenes have no row" in said
