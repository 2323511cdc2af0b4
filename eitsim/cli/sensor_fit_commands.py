"""Commands of `eitsim sensor` that need a model: fit, which calibrates it, predict and correct, which read it out."""

from collections.abc import Callable
from pathlib import Path
from typing import Annotated

import typer

from eitsim.cli.sweep_commands import check_pdf
from touchcal.errors import InputFileError
from touchcal.json_file import write_json
from touchcal.number_words import counted
from touchcal.terminal import JsonOption, check_apart, check_out, print_json, waiting


def fit(recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="CSV of one row a frame, touch empty in "
                                                                            "untouched ones, whose mean is fitted; or "
                                                                            "a board's file.")],
        sensor: Annotated[Path, typer.Option(help="Sensor file (TOML) with [body], [electrodes], [drive] and "
                                                  "[readings]; its contact impedances are where the fit starts.")],
        out: Annotated[Path, typer.Option(help="Write the calibrated sensor (JSON) here.")],
        labels: Annotated[Path | None, typer.Option(
            help="CSV of labelled presses (touch, x_mm, y_mm): the size of the signal, and a gain for each reading "
                 "where the absolute model is refused; with d_mm and F_N or depth_mm, the skin of --card.")] = None,
        card: Annotated[Path | None, typer.Option(
            help="Material card of the skin, with --labels: its conductivity and moduli are fitted to the presses, and "
                 "the card of this skin is written next to --out.")] = None,
        thickness_sd: Annotated[float | None, typer.Option(
            help="Standard deviation of a layer's thickness about thickness_mm in [skin], relative, with --card; 0.05 "
                 "by default.")] = None,
        report: Annotated[Path | None, typer.Option(help="Write a PDF report here.")] = None,
        as_json: JsonOption = False) -> None:
    """Calibrate the model of an untouched sensor: conductance and how it varies, contact impedances, widths and places
    of electrodes, gains against ground, source currents, leaks to ground; or refuse it with the reason.

    Groups of parameters are freed in turn on a random half of the drives, each left out where the others are predicted
    worse by it; the last fit, of all drives, frees all. Every parameter comes with its standard deviation after and
    before. A refused model ends with status 0: the readings can be used for changes alone, and the file, of the kind
    "changes only", says why; `surrogate train` takes it.

    With --labels and --card, presses of known punch and force fit the amplitude and shape of the conductivity's law, a
    factor of the foam's moduli and an offset of the places, of a layer its thickness, each kept where presses left out
    are better read by it. The card of this skin, sensor.card.json, then serves scenes and sweeps with calibrated =
    "sensor.json".

    Example: eitsim sensor fit frames.csv --sensor sensor.toml --out sensor.json

    Example: eitsim sensor fit frames.csv --labels touches.csv --card card.json --sensor sensor.toml --out sensor.json
    """
    from eitsim.cli.display import show_calibration
    from eitsim.sensors.calibration.calibrate import calibrate
    from eitsim.sensors.calibration.calibration_file import calibration_document
    from eitsim.sensors.calibration.skin_card import card_path, remove_skin_card, write_skin_card
    from eitsim.sensors.calibration.skin_law import THICKNESS_SD, check_skin, check_thickness_sd, held_label
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.labels import read_labels
    from eitsim.sensors.sensor_file import read_sensor
    from matcal.card import read_card

    if card is not None and labels is None:
        raise ValueError("--card is fitted to labelled presses; give --labels too, or leave it out.")
    outs = {"--out": out} | ({"--report": report} if report is not None else {}) | (
        {"the skin's card": card_path(out)} if card is not None else {})
    for flag, place in outs.items():
        check_out(place, flag)
    check_apart(outs, [path for path in (recording, sensor, labels, card) if path is not None])
    check_pdf(report, "--report")
    known = read_sensor(sensor)
    if thickness_sd is not None:
        if card is None or not known.skin.fills:
            raise ValueError("--thickness-sd has no effect without --card and a layer (kind in [skin]); leave it out.")
        check_thickness_sd(thickness_sd)
    patterns, each = known.protocol.shape
    frames = open_recording(recording, kind=known.kind, readings=patterns * each)
    pressed, material = read_labels(labels) if labels else None, read_card(card) if card else None
    if labels and pressed and card and material:
        _named(labels, lambda: held_label(pressed))
        _named(card, lambda: check_skin(material))
    with waiting("calibrating the sensor"):
        found = calibrate(known, frames, pressed, material, thickness_sd=thickness_sd or THICKNESS_SD)
    skin_card = write_skin_card(found.skin, out).name if found.skin is not None else None
    removed = found.skin is None and remove_skin_card(out)
    document = calibration_document(found, skin_card)
    write_json(document, out)
    if report is not None:
        from reports.sensor import sensor_report

        sensor_report.write(out, report)
    if as_json:
        print_json({key: value for key, value in document.items() if key != "sensor"})
    else:
        show_calibration(document, out)
        if len(frames.touch) > 1 and frames.untouched.all():
            print(f"untouched: the mean of all {len(frames.touch)} frames, as none is marked as touched")
        if card is not None and found.skin is None:
            print("the skin is not fitted, since that needs a usable absolute model")
        if removed:
            print(f"removed: {card_path(out)}, the skin's card of an earlier fit")
        if report is not None:
            print(f"report: {report}")


def _named(path: Path, check: Callable[[], object]) -> None:
    """InputFileError, which names the file, where a check of what it holds fails."""
    try:
        check()
    except ValueError as error:
        raise InputFileError(path, str(error)) from None


def predict(sensor: Annotated[Path, typer.Argument(metavar="SENSOR", help="Calibrated sensor (JSON), as `eitsim sensor "
                                                                          "fit` writes it.")],
            out: Annotated[Path, typer.Option(help="Write one untouched frame (CSV) here.")],
            currents: Annotated[Path | None, typer.Option(
                help="CSV of currents, a pattern a row and a column an electrode, in units of the sensor's "
                     "current_mA; with --measurements.")] = None,
            measurements: Annotated[Path | None, typer.Option(
                help="CSV of weights of the electrodes' voltages, a reading a row; with a first column `pattern` "
                     "where patterns differ.")] = None,
            as_json: JsonOption = False) -> None:
    """Untouched readings of a calibrated sensor: of its own drive, or of currents and measurements.

    Example: eitsim sensor predict sensor.json --out frames.csv
    """
    from eitsim.scene.drive import voltage_columns
    from eitsim.sensors.calibration.calibration_file import protocol_of_files, read_calibration
    from touchcal.csv_numbers import write_numbers

    check_out(out)
    check_apart({"--out": out}, [path for path in (sensor, currents, measurements) if path is not None])
    calibrated = read_calibration(sensor)
    if (currents is None) != (measurements is None):
        raise ValueError("--currents and --measurements belong together; give both, or none for the sensor's own "
                         "drive.")
    asked = protocol_of_files(calibrated.sensor, currents, measurements) if currents and measurements else None
    frame = calibrated.readings(asked).ravel()
    write_numbers(out, voltage_columns(frame.size), frame[None])
    if as_json:
        print_json({"out": out, "readings": frame.size})
    else:
        print(f"frame: {out} ({frame.size} readings)")


def correct(recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="CSV of one row a frame, touch empty "
                                                                                "in untouched ones.")],
            sensor: Annotated[Path, typer.Option(help="Calibrated sensor (JSON), as `eitsim sensor fit` writes it.")],
            out: Annotated[Path, typer.Option(help="Write the corrected frames (CSV) here.")],
            as_json: JsonOption = False) -> None:
    """Frames of a calibrated sensor as the sensor of its file would read them, so that models of that one serve.

    Untouched frames are those of the ideal sensor; what touches add to the untouched frame before them goes through the
    least-squares map from the calibrated sensor to the ideal one.

    Example: eitsim sensor correct frames.csv --sensor sensor.json --out corrected.csv
    """
    from eitsim.sensors.calibration.calibration_file import read_calibration
    from eitsim.sensors.calibration.ideal_frames import (
        changed_since,
        frame_noise,
        ideal_frames,
        live_readings,
        to_ideal,
    )
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.reading_checks import without_drop_outs
    from eitsim.sensors.recording import write_recording
    from eitsim.sensors.untouched_scatter import change_noise

    check_out(out)
    check_apart({"--out": out}, (recording, sensor))
    calibrated = read_calibration(sensor)
    known = calibrated.sensor
    patterns, each = known.protocol.shape
    read, dropped = without_drop_outs(open_recording(recording, kind=known.kind, readings=patterns * each))
    there = live_readings(read)
    caution = changed_since(calibrated, read, there)
    found = to_ideal(calibrated, there)
    frames = ideal_frames(found, calibrated, read)
    write_recording(frames, out)
    scatter = change_noise(read, there, found.matrix)
    noise = frame_noise(calibrated, found, change_V=scatter)
    if as_json:
        print_json({"out": out, "frames": len(frames.readings), "left": found.left, "change_noise_V": scatter,
                    "noise_V": noise, "caution": caution or None, "dropped_frames": dropped})
    else:
        if caution:
            print(f"caution: {caution}")
        if dropped:
            print(f"caution: {counted(dropped, 'frame')} left out, in which a reading is 0 that is never near it in "
                  "the others: a channel was lost there")
        print(f"frames: {out} ({len(frames.readings)}); {100 * found.left:.2g} % of the ideal sensor's signals are "
              f"not in the calibrated one's")
        print("noise of a touched less an untouched frame, corrected: "
              + ("not known from one untouched frame; the misfit of the calibration stands for it" if scatter is None
                 else f"{scatter:.3g} V a reading, by untouched frames as far from each other in time"))
        print(f"with the error of the map: {noise:.3g} V a reading (--noise-V of `surrogate predict`)")
