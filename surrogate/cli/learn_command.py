"""`surrogate learn`: touches learnt from recorded presses."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import typer

from touchcal.terminal import JsonOption, SeedOption, check_out, print_json, print_table, waiting

if TYPE_CHECKING:
    from eitsim.sensors.labels import Labels
    from eitsim.sensors.sensor_file import Sensor
    from surrogate.model.recorded.press_model import PressModel
    from surrogate.recordings.physics.expectation import Expectation
    from surrogate.recordings.suggestion.next_presses import NextPresses

LABELS_HELP = ("CSV of what is known of a recording's touches: touch and any of x_mm, y_mm, d_mm, F_N, depth_mm, "
               "z_mm; press where several touches are frames of one press. Several touches a frame: several rows of "
               "one touch with place (or x_mm, y_mm), or a column of 0 and 1 a place.")
SENSOR_HELP = ("Sensor of a recording: a sensor file (TOML), or the JSON that `eitsim sensor fit` wrote. Without it "
               "readings are plain channels, taken as signed voltages.")
SIMULATED_HELP = ("Data set that `eitsim sweep` wrote, of the sensor's electrodes and drive: what its touches say of a "
                  "recording's patterns is used in place of the sensitivity of a uniform disc.")
SUGGEST_HELP = ("Number of places to press next; they are printed and written to suggested.csv in the folder of "
                "--out. Before the first press neither labels nor a recording are needed.")
CONTINUE_HELP = ("Model of an earlier session of the same skin: five labelled presses or more of this session bring it "
                 "up to date.")
WORKERS_HELP = "Processes that share the model and the splits of its scores; by default one a core."
METHOD_HELP = ("families: all families of readers, weighted by held-out presses; or a method of `surrogate train` that "
               "needs no sensor: ridge, gp, trainbr, network.")
NO_DISC = "The body is no disc, so that no model of the sensor is used."
NO_SENSOR = ("No sensor file is given: readings are plain channels, taken as signed voltages, and no model of the "
             "sensor is used.")
# Part of the skin's width, within less of which places may be in cm; and how far they are rounded, m.
_LITTLE, _ROUNDED_M = 0.2, 1e-5
SLOW = "surrogate: the presses are learnt once for the model and once a split for its scores, which takes minutes."


def learn(recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="Recorded frames.")],
          out: Annotated[Path, typer.Option(help="Folder of the model.")],
          labels: Annotated[Path | None, typer.Option(help=LABELS_HELP)] = None,
          sensor: Annotated[Path | None, typer.Option(help=SENSOR_HELP)] = None,
          simulated: Annotated[Path | None, typer.Option(help=SIMULATED_HELP)] = None,
          suggest: Annotated[int | None, typer.Option(min=1, help=SUGGEST_HELP)] = None,
          method: Annotated[str, typer.Option(help=METHOD_HELP)] = "families",
          first: Annotated[Path | None, typer.Option("--continue", help=CONTINUE_HELP)] = None, seed: SeedOption = 0,
          workers: Annotated[int | None, typer.Option(min=1, help=WORKERS_HELP)] = None,
          as_json: JsonOption = False) -> None:
    """Learn touches from recorded presses: the model learns from all of them, and scores are those of readers of four
    fifths of them; with --suggest also the places to press next, and these alone where labels are too few.

    Example: surrogate learn frames.csv --labels touches.csv --sensor sensor.toml --out model --seed 1

    Example: surrogate learn today.csv --labels five.csv --continue model --out model_today
    """
    import surrogate
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import read_labels, spans
    from eitsim.sensors.touch_sets import holds_several
    from surrogate.cli.several_command import check_alone, learn_several
    from surrogate.data.skin_from_above import skin_of
    from surrogate.model.store import check_own
    from surrogate.recordings.presses import unmatched
    from surrogate.recordings.signals import FEWEST
    from surrogate.recordings.worth import NothingToRead

    check_out(out, folder=True)
    check_own(out)
    if first is not None:
        if labels is None or (sensor, simulated, suggest, method) != (None, None, None, "families"):
            raise ValueError("--continue takes labels of the new session and the model of the first, which knows its "
                             "sensor: give --labels touches.csv, and leave out --sensor, --simulated, --suggest and "
                             "--method.")
        _learn_session(recording, labels, first, out, as_json)
        return
    if labels is not None and holds_several(labels):
        check_alone(labels, {"--simulated": simulated, "--suggest": suggest,
                             "--method": None if method == "families" else method})
        learn_several(recording, labels, sensor, out, as_json)
        return
    if labels is None and suggest is None:
        raise ValueError(f"{recording} is a recording, which needs its labels: give --labels touches.csv, and --sensor "
                         "sensor.toml where it has one. Where nothing is pressed yet, give --sensor and --suggest 20, "
                         "which names the places to press first.")
    if sensor is None and (suggest, simulated) != (None, None):
        raise ValueError("--suggest and --simulated need the sensor: give --sensor sensor.toml, or leave them out.")
    given = read_labels(labels) if labels is not None else None
    known, file_kind, expectation, ahead = (None, None, None, None) if sensor is None else _expected(
        sensor, given, labels, simulated, suggest)
    if given is None or (ahead is not None and len(given.touch) < FEWEST):
        _write_suggested(ahead, out)
        _say_untrained(0 if given is None else len(given.touch), FEWEST, ahead, out, as_json)
        return
    frames = open_recording(recording) if known is None else open_recording(
        recording, kind=known.kind, readings=known.protocol.weights.size // known.electrodes.count)
    odd = unmatched(frames, given)
    if not as_json and method == "families" and (known is None or len(given.touch) >= FEWEST):
        print(SLOW, file=sys.stderr)
    try:
        with waiting("learning the presses"):
            model = surrogate.learn(frames, given, seed, workers or cores(), expectation, method)
    except NothingToRead as error:
        _write_suggested(ahead, out)
        if not as_json:
            _print_suggested(ahead)
        raise NothingToRead(" ".join([str(error), *odd])) from None
    model = replace(model, left_out=(*model.left_out, *odd))
    if known is None:
        model = replace(model, left_out=(*model.left_out, NO_SENSOR))
    elif expectation is None:
        model = replace(model, left_out=(*model.left_out, NO_DISC), skin=skin_of(known.body.outline, known.electrodes))
    model.save(out)
    _write_suggested(ahead, out)
    if as_json:
        print_json(_described(model) | {"model": out, "sensor": file_kind, "labels": spans(given),
                                         "caution": known and _misfit(given, known)} | _listed(ahead))
        return
    _print_trained(model)
    print("labels: " + ", ".join(f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in spans(given).items()))
    if known is not None:
        print(f"sensor: {sensor}, a {file_kind}")
        if words := _misfit(given, known):
            print(f"caution: {words}")
    print(f"model: {out}\nnext: surrogate predict {out} new.csv --out predictions.csv")
    _print_suggested(ahead)


def _misfit(labels: Labels, sensor: Sensor) -> str | None:
    """A caution where labelled places lie off the skin, or in so little of it that their unit may be another one."""
    from eitsim.sensors.labels import PLACE, places_of

    if not {*PLACE} <= {*labels.names}:
        return None
    places, (low, high) = places_of(labels), (1e3 * side for side in sensor.body.edge.box_m)
    off = int((sensor.body.edge.gap_m(1e-3 * places) < -_ROUNDED_M).sum())
    skin = " by ".join(f"{side:.3g}" for side in high - low)
    if off:
        return (f"{off} of {len(places)} labelled places lie off the skin, which is {skin} mm. Give x_mm and y_mm in "
                "mm, from the origin of the sensor file.")
    if (np.ptp(places, axis=0) < _LITTLE * (high - low)).all():
        return (f"labelled places span {' by '.join(f'{side:.3g}' for side in np.ptp(places, axis=0))} mm of a skin of "
                f"{skin} mm. Check that x_mm and y_mm are in mm.")
    return None


def _learn_session(recording: Path, labels: Path, first: Path, out: Path, as_json: bool) -> None:
    """Bring the model of a first session up to date, write it and say what the labelled presses say of it."""
    import surrogate
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import read_labels
    from surrogate.model.recorded.press_model import PressModel

    model = surrogate.load(first)
    if not isinstance(model, PressModel):
        raise ValueError(f"{first} is no model of single recorded presses, which alone are continued in another "
                         "session. Give one that `surrogate learn` wrote.")
    frames = open_recording(recording, kind=model.kind, readings=model.readings)
    with waiting("learning the session"):
        made = surrogate.learn_session(model, frames, read_labels(labels))
    made.save(out)
    if as_json:
        print_json(_described(made) | {"model": out, "continued": first})
        return
    print(f"{made.left_out[-1]}\nfit {made.fit_s:.1f} CPU s\nmodel: {out}")


def cores() -> int:
    """Cores that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _expected(sensor: Path, given: Labels | None, labels: Path | None, simulated: Path | None, suggest: int | None
              ) -> tuple[Sensor, str, Expectation | None, NextPresses | None]:
    """The sensor of a file, what kind of file that is, what a model of the sensor expects, where its body is a disc,
    and the places to press next, where so many are asked for."""
    from eitsim.sensors.calibration.calibration_file import read_described_sensor
    from eitsim.sensors.labels import PLACE, places_of
    from surrogate.recordings.physics.expectation import expectation_of
    from surrogate.recordings.suggestion.next_presses import next_presses

    known, file_kind = read_described_sensor(sensor)
    is_disc = known.body.edge.is_round
    if not is_disc and (suggest, simulated) != (None, None):
        raise ValueError(f"--suggest and --simulated are for discs, and the body of {sensor} has the outline "
                         f"'{known.body.outline.kind}'. Leave them out.")
    if simulated is not None and given is not None and not {*PLACE} <= {*given.names}:
        raise ValueError(f"--simulated says how patterns depend on the place, and {labels} lacks {' or '.join(PLACE)}. "
                         "Add them, or leave it out.")
    expectation = expectation_of(known, simulated) if is_disc else None
    ahead = None if suggest is None else next_presses(
        known.body.radius_m * 1e3, np.empty((0, 2)) if given is None else places_of(given), suggest)
    return known, file_kind, expectation, ahead


def _write_suggested(ahead: NextPresses | None, out: Path) -> None:
    """The places to press next, if any, into the model's folder."""
    from surrogate.recordings.suggestion.next_presses import SUGGESTED
    from touchcal.whole_file import written

    if ahead is None:
        return
    out.mkdir(parents=True, exist_ok=True)
    with written(out / SUGGESTED) as file:
        file.write(ahead.table().to_csv(index=False, float_format="%.6g").encode())


def _say_untrained(labels: int, fewest: int, ahead: NextPresses | None, out: Path, as_json: bool) -> None:
    from surrogate.model.store import DESCRIPTION

    earlier = (out / DESCRIPTION).exists()
    if as_json:
        print_json({"presses": labels, "model": None, "earlier_model": out if earlier else None} | _listed(ahead))
        return
    print(f"{labels} labelled presses, and {fewest} are the fewest to learn from: no model is trained yet"
          + f"; that of an earlier training stays in {out}" * earlier)
    _print_suggested(ahead)


def _listed(ahead: NextPresses | None) -> dict[str, Any]:
    return {} if ahead is None else {"suggested": ahead.table().to_dict("records")}


def _print_suggested(ahead: NextPresses | None) -> None:
    if ahead is None:
        return
    from rich.table import Table

    from surrogate.recordings.suggestion.next_presses import SHARE, SUGGESTED

    table = Table("press", "x, mm", "y, mm", "gain, %", title="press next")
    for number, ((x, y), gain) in enumerate(zip(ahead.place, ahead.gain, strict=True), start=1):
        table.add_row(str(number), f"{x:.1f}", f"{y:.1f}", f"{100 * gain:.1f}")
    print_table(table)
    x, y = ahead.middle
    print(f"places to press next, the best first, within {100 * SHARE:.0f} % of the radius about ({x:.4g}, {y:.4g}) "
          f"mm, also in {SUGGESTED}; gain: the part of the map's variance that a press takes away after those before")


def _described(model: PressModel) -> dict[str, Any]:
    from dataclasses import asdict

    from surrogate.model.recorded.learn_presses import choice
    from surrogate.model.recorded.reader_scores import found_wanting

    return {"presses": model.presses, "frames": model.frames, "fit_s": model.fit_s, "choice": choice(model.reader),
            "left_out": model.left_out, "scores": [asdict(one.score) for one in model.tested],
            **found_wanting(one.score for one in model.tested)}


def _print_trained(model: PressModel) -> None:
    from rich import box
    from rich.table import Table

    from surrogate.model.recorded.learn_presses import choice
    from surrogate.model.recorded.reader_scores import wanting_words
    from surrogate.recordings.press_frames import counted

    table = Table("split", "trained", "tested", "output", "error", "kernel ridge", "mean", "in 90 %", "+-90 %",
                  "in ellipse", box=box.SIMPLE_HEAD, show_edge=False)
    for one in (tested.score for tested in model.tested):
        table.add_row(one.split, str(one.trained), str(one.tested), one.output, f"{one.error:.3g} {one.unit}",
                      f"{one.ridge_error:.3g}", f"{one.mean_error:.3g}",
                      ", ".join(f"{100 * part:.0f}" for part in one.coverage),
                      ", ".join(f"{half:.3g}" for half in one.half_width),
                      "-" if one.in_ellipse is None else f"{100 * one.in_ellipse:.0f}")
    print_table(table)
    print("mean error on presses that were not trained on; of a place, the distance, and x, y of its intervals\n"
          "in 90 %: presses that the 90 % intervals hold; +-90 %: their half width; in ellipse: of the 90 % ellipses")
    for line in (*model.left_out, *choice(model.reader)):
        print(line)
    print(f"fit {model.fit_s:.1f} CPU s on {counted(model.presses, model.frames)}, without the scores")
    for caution in wanting_words(one.score for one in model.tested):
        print(f"caution: {caution}")
