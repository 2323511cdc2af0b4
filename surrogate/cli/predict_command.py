"""`surrogate predict`: touches from recorded frames, from frames as they come, and one frame in depth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from surrogate.cli.given_frames import (
    compared_with,
    counted_frames,
    frames_of,
    noise_of,
    say,
    say_assumed,
    say_holding,
    say_intervals,
)
from surrogate.cli.predicted_stream import predict_stream, track_stream
from surrogate.cli.recording_command import predict_recording
from touchcal.terminal import JsonOption, SeedOption, check_apart, check_out, counted, print_json, waiting
from touchcal.whole_file import written

if TYPE_CHECKING:
    import pandas as pd

    from surrogate.data.baseline_frame import Untouched
    from surrogate.data.frame_drift import FrameDrift
    from surrogate.data.frame_rows import Lines
    from surrogate.data.reading_noise import ReadingNoise
    from surrogate.model.model import Model
    from surrogate.single_frame.simulator_likelihood import Simulator
    from touchcal.arrays import Mask

ModelFolder = Annotated[Path, typer.Argument(metavar="MODEL_DIR", help="Model that `surrogate train` wrote.")]
FRAMES_HELP = ("CSV, one frame of voltages a row, or a board's file (.mat, .npy ...); - reads lines from standard "
               "input and answers each as it comes, serial:PORT or serial:PORT@BAUD those of a serial port.")
BASELINE_HELP = ("CSV of untouched frames; else the first row of FRAMES, or the first 20 frames of a stream (method "
                 "forward). Two or more of them also give the noise.")
DIRECT_HELP = "Invert the simulator itself, from the learned answer on; needs --card."
POSTERIOR_HELP = "Sample the posterior of each frame with emcee, on the learned map, or with --card by the simulator."
TOUCHES_HELP = "2 reads two touches from each frame, and says where one explains it as well."
CARD_HELP = "Card of foam and skin, for --direct, and for --posterior by the simulator."
MOST_NOISE_V = 1000.0  # no instrument reads more, and equations of more noise are singular
SCALE_HELP = ("Multiply all readings by the training's untouched ones over those measured: yes, no, or auto, where "
              "that explains a difference larger than noise.")
RATE_HELP = "Frames a second of - or a serial port, for how fast touches and drift may move between two lines."
RATE_HZ = 50.0
HELD_HELP = "Time since loading, s: F and stresses are those of a foam that has relaxed so long, by the card's series."
DRIFT_HELP = ("What may have changed between the untouched and the touched frames, as relative standard deviations: "
              "gain=0.001,contact=0.01; contact needs --scene or --data. Method forward.")
NoiseV = Annotated[float | None, typer.Option("--noise-V", help="Standard deviation of one reading, V, where known.")]


def predict(model_folder: ModelFolder, frames: Annotated[str, typer.Argument(metavar="FRAMES", help=FRAMES_HELP)],
            baseline: Annotated[Path | None, typer.Option(help=BASELINE_HELP)] = None, noise_v: NoiseV = None,
            direct: Annotated[bool, typer.Option("--direct", help=DIRECT_HELP)] = False,
            posterior: Annotated[bool, typer.Option("--posterior", help=POSTERIOR_HELP)] = False,
            scale_baseline: Annotated[str, typer.Option(help=SCALE_HELP)] = "auto",
            held: Annotated[float | None, typer.Option(help=HELD_HELP)] = None,
            drift: Annotated[str, typer.Option(metavar="gain=SD,contact=SD", help=DRIFT_HELP)] = "",
            rate: Annotated[float, typer.Option(min=1e-3, max=1e6, help=RATE_HELP)] = RATE_HZ,
            touches: Annotated[int, typer.Option(min=1, max=2, help=TOUCHES_HELP)] = 1,
            card: Annotated[Path | None, typer.Option(help=CARD_HELP)] = None,
            data: Annotated[Path | None, typer.Option(help="Data set whose design describes the sensor of --card or "
                                                           "--drift.")] = None,
            scene: Annotated[Path | None, typer.Option(help="Scene that describes the sensor of --card or "
                                                            "--drift.")] = None,
            seed: SeedOption = 0,
            out: Annotated[Path | None, typer.Option(help="CSV to write; else standard output.")] = None,
            as_json: JsonOption = False) -> None:
    """Read touches from recorded frames, or from frames as they come.

    A frame is a row of voltages separated by commas, in the order of the readings or under a header that names
    v_000 ... in any order; a header of other names is refused. A line that is no frame gives a row without values,
    whose flag says why; other rows stay as they are. A cell that is empty or no finite number is a dead channel:
    method forward reads the frame without it, other methods cannot read the frame. A channel that is stuck at one
    value is noticed in a file of three or more frames, not in a stream. --direct, --posterior and --touches 2 do not
    read frames with dead channels.

    A model of a recording reads a recording: a row a touched frame, against the untouched frames tracked to its time.

    Intervals hold for single touches of the trained kind of punch within the trained ranges, which `surrogate
    evaluate` prints. A touch outside them is flagged where its signal or its answer shows it; where the signal
    leaves open a diameter outside them, the intervals of d and F reach as far. A heavier touch, or a punch of
    another profile, may look like one within with no flag.

    Example: surrogate predict forward frames.csv --baseline untouched.csv --out predictions.csv
    """
    import surrogate
    from surrogate.data.frame_source import check_no_port, comes_live
    from surrogate.learners.registry import METHODS
    from surrogate.model.assumed_punch import assumed_punch
    from surrogate.recordings.trained.reader_store import is_reader, load_reader

    check_no_port(frames)
    live = comes_live(frames)
    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [Path(path) for path in (None if live else frames, baseline, card, scene)
                                     if path is not None])
    if noise_v is not None and not 0 <= noise_v <= MOST_NOISE_V:
        raise ValueError(f"--noise-V must be 0 to {MOST_NOISE_V:g} V, got {noise_v:g}. Give the standard deviation of "
                         "one reading in volts.")
    changes = _drift_of(drift)
    if changes and (live or direct or posterior or touches == 2):
        raise ValueError("--drift is for plain predictions from a file; leave it out with -, --direct, --posterior and "
                         "--touches 2.")
    _check_choice(live, direct, direct or posterior, card, None if changes.get("contact") else data or scene,
                  posterior or touches == 2 or as_json)
    if direct + posterior + (touches == 2) > 1:
        raise ValueError("give one of --direct, --posterior and --touches 2: each reads a frame in its own way.")
    if direct and card is None:
        raise ValueError("--direct inverts the simulator, which needs the material; give --card CARD, and --data DIR "
                         "or --scene FILE for the sensor.")
    if is_reader(model_folder):
        given = {"--card": card, "--data": data, "--scene": scene, "--held": held, "--direct": direct or None,
                 "--posterior": posterior or None, "--drift": drift or None, "--touches": touches - 1 or None,
                 "--seed": seed or None, "--scale-baseline": None if scale_baseline == "auto" else scale_baseline}
        if not live:
            given |= {"--baseline": baseline, "--noise-V": noise_v, "--rate": None if rate == RATE_HZ else rate}
        if odd := [flag for flag, value in given.items() if value is not None]:
            raise ValueError(f"{model_folder} was trained on a recording: it reads a CSV of frames, whose untouched "
                             f"rows are the baseline, or a stream. Leave out {', '.join(odd)}.")
        if live:
            track_stream(load_reader(model_folder), frames, baseline, noise_v, out, rate)
            return
        with waiting("reading frames"):
            table = predict_recording(model_folder, Path(frames))
        _written(table, model_folder, out, as_json)
        return
    model = surrogate.load(model_folder)
    if held is not None and (direct or posterior or touches == 2):
        raise ValueError("--held is for plain predictions; leave it out with --direct, --posterior and --touches 2.")
    if live and METHODS[model.method].separates_errors:
        say_holding(model, held)
        track_stream(model, frames, baseline, noise_v, out, rate, scale_baseline, held)
        return
    if live:
        predict_stream(model, frames, baseline, noise_v, out, scale_baseline, held)
        return
    read, reference, dead = frames_of(model, Path(frames), baseline)
    noise = noise_of(reference, noise_v)
    found = compared_with(model, reference, noise, scale_baseline)
    read, noise = replace(read, volts=read.volts * found.gain), noise.scaled(found.gain)
    reference = replace(reference, volts=reference.volts * found.gain)
    say_holding(model, held)
    say_assumed(model)
    if touches == 2:
        table = _pairs(model, read, reference, dead, noise.rms_V)
    elif direct or posterior:
        simulator = None if card is None else _simulator(model, card, data, scene, reference)
        table = _in_depth(model, simulator, read, reference, dead, noise.rms_V, seed if posterior else None)
    else:
        table = _plain_table(model, read, reference, dead, noise, held, _frame_drift(model, changes, data, scene))
    _written(table, model_folder, out, as_json, {"assumes": assumed_punch(model)})


def _drift_of(text: str) -> dict[str, float]:
    """Standard deviations by what drifts; ValueError names the option."""
    found: dict[str, float] = {}
    for pair in filter(None, text.split(",")):
        name, _, value = pair.partition("=")
        if name not in ("gain", "contact") or name in found:
            raise _no_drift(text, pair, f"names {name} again" if name in found else "is not known")
        try:
            found[name] = float(value)
        except ValueError:
            raise _no_drift(text, pair, "holds no number") from None
    return found


def _no_drift(text: str, pair: str, why: str) -> ValueError:
    return ValueError(f"--drift {text}: '{pair}' {why}; give --drift gain=0.001,contact=0.01, or one of them.")


def _frame_drift(model: Model, changes: dict[str, float], data: Path | None, scene: Path | None) -> FrameDrift:
    from eitsim.electrics.forward.untouched import sensor_of
    from eitsim.scene.scene import read_scene
    from eitsim.sweeps.dataset.parquet import read_manifest
    from surrogate.data.frame_drift import frame_drift
    from surrogate.data.sensor_ring import ring_of, same_ring

    sensor = None
    if changes.get("contact"):
        sensor = read_scene(scene) if scene is not None else None if data is None else sensor_of(
            read_manifest(data)["design"]["tables"])
    if sensor is not None and not same_ring(ring_of(sensor), model.ring):
        raise ValueError("--drift: the scene has another sensor than the model; give the one of its sweep.")
    return frame_drift(model.ring, model.baseline_V, changes.get("gain", 0.0), changes.get("contact", 0.0), sensor)


def _check_choice(live: bool, direct: bool, simulated: bool, card: Path | None, sensor: Path | None,
                  whole: bool) -> None:
    if live and (direct or whole):
        raise ValueError("frames of - or a serial port are answered one by one as they come; --direct, --posterior, "
                         "--touches 2 and --json need a file of frames.")
    if (card is not None or sensor is not None) and not simulated:
        raise ValueError("--card, --data and --scene describe the simulator of --direct or --posterior, and --data and "
                         "--scene the sensor of --drift contact=SD; add one, or leave them out.")
    if card is None and sensor is not None:
        raise ValueError("--data and --scene describe the sensor of the simulator, which needs --card CARD too.")


def _plain_table(model: Model, frames: Lines, reference: Untouched, dead: Mask, noise: ReadingNoise,
                 held_s: float | None, drift: FrameDrift) -> pd.DataFrame:
    from surrogate.model.predict import prepare, sign_caution, table_of

    say_intervals(model, noise)
    with waiting("reading frames"):
        table = table_of(prepare(model, reference.volts, noise, dead, held_s=held_s, drift=drift), frames)
    if words := sign_caution(table["flag"].tolist()):
        say(words)
    return table


def _pairs(model: Model, frames: Lines, reference: Untouched, dead: Mask, noise: float) -> pd.DataFrame:
    import pandas as pd

    from surrogate.model.missing_channels import silent
    from surrogate.single_frame.rows import check_whole, pair_row, whole

    check_whole(dead | silent(reference.volts[None], model.baseline_V)[0])
    lines = whole(frames, model)
    each = zip(lines.line.tolist(), lines.volts - reference.volts, lines.problem, strict=True)
    rows = [{"line": line, "flag": problem} if problem else pair_row(model, line, signal, noise)
            for line, signal, problem in counted("frames")(each)]
    names = max((list(row) for row in rows), key=len)
    return pd.DataFrame(rows, columns=names)


def _simulator(model: Model, card: Path, data: Path | None, scene: Path | None, reference: Untouched) -> Simulator:
    from surrogate.single_frame.rows import check_baseline
    from surrogate.single_frame.simulator_likelihood import check_sensor, simulator_of, untouched_of

    simulator = simulator_of(card, data=data, scene=scene)
    check_sensor(simulator, model.ring)
    check_baseline(untouched_of(simulator), reference.volts)
    if not simulator.spread.parameters:
        say(f"{card} has no posterior, so the material is taken as exact.")
    elif model.ring.sheet is not None:
        say("what the card's posterior leaves open does not count: sensitivities by the material are not built for "
            "skins with an outline.")
    return simulator


def _in_depth(model: Model, simulator: Simulator | None, frames: Lines, reference: Untouched, dead: Mask,
              noise: float, seed: int | None) -> pd.DataFrame:
    """A row a frame, by the posterior where there is a seed; each shows on a terminal as it is done."""
    import pandas as pd

    from surrogate.model.predict import prepare
    from surrogate.single_frame.rows import direct_row, learner_of, ones, posterior_row

    learner_of(model)
    if seed is not None:
        exact = model.ring.sheet is not None
        whose = ("the learned map's, its error counted, the material the model's" if simulator is None else
                 "the simulator's, the material exact" if exact else
                 "the simulator's, with what the card's posterior leaves open")
        say("prior: places uniform where the punch fits, d and F uniform over the training touches' ranges, whatever "
            f"punches these share; the likelihood is {whose}.")
    rows = []
    with waiting("preparing the model"):
        ready = prepare(model, reference.volts, noise, dead, calibrate=seed is None)
    for one in counted("frames")(ones(ready, frames)):
        if seed is not None:
            rows.append(posterior_row(model, simulator, one, noise, seed))
        elif simulator is not None:
            rows.append(direct_row(model, simulator, one, noise))
    names = dict.fromkeys(name for row in rows for name in row if name != "flag")
    return pd.DataFrame(rows, columns=[*names, "flag"])


def _written(table: pd.DataFrame, model: Path, out: Path | None, as_json: bool,
             stated: dict[str, str] | None = None) -> None:
    if out is not None:
        with written(out) as file:
            file.write(table.to_csv(index=False, float_format="%.6g").encode())
    if as_json:
        print_json({"model": model, **(stated or {}), "frames": [_plain(row) for row in table.to_dict("records")]})
    elif out is None:
        print(table.to_csv(index=False, float_format="%.6g"), end="")
    else:
        print(f"{out}: {counted_frames(len(table), sum(bool(flag) for flag in table['flag']))}")


def _plain(row: dict[Any, Any]) -> dict[str, Any]:
    """A row without NaN, which JSON has not."""
    return {str(key): None if isinstance(value, float) and value != value else value for key, value in row.items()}
