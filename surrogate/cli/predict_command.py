"""`surrogate predict`: touches from recorded frames, and from frames as they come."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from surrogate.cli.frame_command import frame
from surrogate.cli.given_frames import (
    BASELINE_HELP,
    ModelFolder,
    NoiseV,
    Scaling,
    check_noise,
    check_written,
    compared_frames,
    recorded,
    say,
    say_assumed,
    say_holding,
    say_intervals,
    write_rows,
)
from surrogate.cli.predicted_stream import predict_stream, track_stream
from touchcal.terminal import JsonOption, SeedOption, waiting

if TYPE_CHECKING:
    import pandas as pd

    from surrogate.cli.given_frames import ComparedFrames
    from surrogate.data.frame_drift import FrameDrift
    from surrogate.model.sweep_model import SweepModel

FRAMES_HELP = ("CSV, one frame of voltages a row, or a board's file (.mat, .npy ...); - reads lines from standard "
               "input and answers each as it comes, serial:PORT or serial:PORT@BAUD those of a serial port.")
RATE_HELP = "Frames a second of - or a serial port, for how fast touches and drift may move between two lines."
RATE_HZ = 50.0
HELD_HELP = "Time since loading, s: F and stresses are those of a foam that has relaxed so long, by the card's series."
DRIFT_HELP = ("What may have changed between the untouched and the touched frames, as relative standard deviations: "
              "gain=0.001,contact=0.01; contact needs --scene or --data. Method forward.")


def predict(model_folder: ModelFolder, frames: Annotated[str, typer.Argument(metavar="FRAMES", help=FRAMES_HELP)],
            baseline: Annotated[Path | None, typer.Option(help=BASELINE_HELP)] = None, noise_v: NoiseV = None,
            scale_baseline: Scaling = "auto",
            held: Annotated[float | None, typer.Option(help=HELD_HELP)] = None,
            drift: Annotated[str, typer.Option(metavar="gain=SD,contact=SD", help=DRIFT_HELP)] = "",
            data: Annotated[Path | None, typer.Option(help="Data set whose design describes the sensor of "
                                                           "--drift.")] = None,
            scene: Annotated[Path | None, typer.Option(help="Scene that describes the sensor of --drift.")] = None,
            rate: Annotated[float, typer.Option(min=1e-3, max=1e6, help=RATE_HELP)] = RATE_HZ,
            posterior: Annotated[bool, typer.Option("--posterior", hidden=True)] = False,
            direct: Annotated[bool, typer.Option("--direct", hidden=True)] = False,
            touches: Annotated[int, typer.Option(min=1, max=4, hidden=True)] = 1,
            card: Annotated[Path | None, typer.Option(hidden=True)] = None, seed: SeedOption = 0,
            out: Annotated[Path | None, typer.Option(help="CSV to write; else standard output.")] = None,
            as_json: JsonOption = False) -> None:
    """Read touches from recorded frames, or from frames as they come.

    A frame is a row of voltages separated by commas, in the order of the readings or under a header that names
    v_000 ... in any order; a header of other names is refused. A line that is no frame gives a row without values,
    whose flag says why; other rows stay as they are. A cell that is empty or no finite number is a dead channel:
    the frame is read without it. So is a channel that sticks at a value while most others change. Intervals widen
    where channels are dead, which is said once and flags no frame.

    A model of a recording reads a recording: a row a touched frame, against the untouched frames tracked to its time.

    Intervals hold for single touches of the trained kind of punch within the trained ranges, which `surrogate
    evaluate` prints. A touch outside them is flagged where its signal or its answer shows it; where the signal
    leaves open a diameter outside them, the intervals of d and F reach as far; those of F hold the forces of other
    profiles that the sweep solved. A heavier touch may look like one within with no flag. One frame in depth:
    `surrogate frame`.

    Example: surrogate predict forward frames.csv --baseline untouched.csv --out predictions.csv
    """
    import surrogate
    from surrogate.data.frame_source import check_no_port, comes_live
    from surrogate.learners.registry import METHODS
    from surrogate.model.assumed_punch import assumed_punch
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.model.recorded.set_model import SetModel

    check_no_port(frames)
    live = comes_live(frames)
    if posterior or direct or touches > 1:  # as `surrogate frame`, by the words of an earlier version
        if (held, drift) != (None, ""):
            raise ValueError("--held and --drift are for plain predictions; leave them out with --posterior, --direct "
                             "and --touches.")
        frame(model_folder, frames, baseline, noise_v, scale_baseline, posterior, direct, touches, card, data, scene,
              seed, out, as_json)
        return
    if card is not None:
        raise ValueError("--card is for frames in depth: give it to `surrogate frame` with --direct or --posterior.")
    check_written(out, [None if live else frames, baseline, scene])
    check_noise(noise_v)
    changes = _drift_of(drift)
    if live and (changes or as_json):
        raise ValueError("frames of - or a serial port are answered one by one as they come; --drift and --json need a "
                         "file of frames.")
    if not changes.get("contact") and (data or scene) is not None:
        raise ValueError("--data and --scene describe the sensor of --drift contact=SD. Add it, or leave them out.")
    model = surrogate.load(model_folder)
    if isinstance(model, PressModel | SetModel):
        given = {"--data": data, "--scene": scene, "--held": held, "--drift": drift or None,
                 "--scale-baseline": None if scale_baseline == "auto" else scale_baseline}
        if not live or isinstance(model, SetModel):
            given |= {"--baseline": baseline, "--noise-V": noise_v, "--rate": None if rate == RATE_HZ else rate}
        if odd := [flag for flag, value in given.items() if value is not None]:
            raise ValueError(f"{model_folder} was trained on a recording: it reads a CSV of frames, whose untouched "
                             f"rows are the baseline, or a stream. Leave out {', '.join(odd)}.")
        if isinstance(model, SetModel) and live:
            raise ValueError(f"{model_folder} reads several touches at once, from recordings and not from streams: "
                             "give a CSV of frames whose untouched rows have an empty touch.")
        if live and not isinstance(model, SetModel):
            track_stream(model, frames, baseline, noise_v, out, rate)
            return
        with waiting("reading frames"):
            table = model.predict(recorded(model, Path(frames)), say)
        write_rows(table, model_folder, out, as_json, a_press=isinstance(model, SetModel) and "touch" in table)
        return
    if live and METHODS[model.method].separates_errors:
        say_holding(model, held)
        track_stream(model, frames, baseline, noise_v, out, rate, scale_baseline, held)
        return
    if live:
        predict_stream(model, frames, baseline, noise_v, out, scale_baseline, held)
        return
    compared = compared_frames(model, Path(frames), baseline, noise_v, scale_baseline)
    say_holding(model, held)
    say_assumed(model)
    table = _plain_table(model, compared, held, _frame_drift(model, changes, data, scene))
    write_rows(table, model_folder, out, as_json, {"assumes": assumed_punch(model)})


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


def _frame_drift(model: SweepModel, changes: dict[str, float], data: Path | None, scene: Path | None) -> FrameDrift:
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


def _plain_table(model: SweepModel, frames: ComparedFrames, held_s: float | None, drift: FrameDrift) -> pd.DataFrame:
    from surrogate.model.predict import lost_words, prepare, read_touches, sign_caution, table_of

    say_intervals(model, frames.noise)
    lines = frames.lines
    with waiting("reading frames"):
        ready = prepare(model, frames.untouched_V, frames.noise, frames.dead, held_s=held_s, drift=drift)
        found = read_touches(ready, lines)
        lost = lost_words(ready, lines.volts[[not one for one in lines.problem]], lines.columns)
    for words in filter(None, (lost, sign_caution(found.kinds))):
        say(words)
    return table_of(model, frames.lines, found)
