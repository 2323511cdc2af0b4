"""Commands of `eitsim sensor` that need a model: fit, which calibrates it, and predict, which reads it out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from touchcal.json_file import write_json
from touchcal.terminal import JsonOption, check_apart, check_out, print_json


def fit(recording: Annotated[Path, typer.Argument(metavar="RECORDING", help="CSV of one row a frame, touch empty in "
                                                                            "untouched ones, whose mean is fitted; or "
                                                                            "a board's file.")],
        sensor: Annotated[Path, typer.Option(help="Sensor file (TOML) with [body], [electrodes], [drive] and "
                                                  "[readings]; its contact impedances are where the fit starts.")],
        out: Annotated[Path, typer.Option(help="Write the calibrated sensor (JSON) here.")],
        as_json: JsonOption = False) -> None:
    """Calibrate the model of an untouched sensor: conductance, contact impedances, width and places of electrodes,
    gains against ground, source currents, leaks to ground; or refuse it with the reason.

    Each group of parameters is left out where drives that were not fitted, a random half, are predicted worse by it.
    Every parameter comes with its standard deviation after and before. A refused model ends with status 0: the readings
    can be used for changes alone, and the file says why.

    Example: eitsim sensor fit frames.csv --sensor sensor.toml --out sensor.json
    """
    from eitsim.cli.display import show_calibration
    from eitsim.sensors.calibration.calibrate import calibrate
    from eitsim.sensors.calibration.calibration_file import calibration_document
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.sensor_file import read_sensor

    check_out(out)
    check_apart({"--out": out}, (recording, sensor))
    known = read_sensor(sensor)
    patterns, each = known.protocol.shape
    frames = open_recording(recording, kind=known.kind, readings=patterns * each)
    document = calibration_document(calibrate(known, frames))
    write_json(document, out)
    if as_json:
        print_json({key: value for key, value in document.items() if key != "sensor"})
    else:
        show_calibration(document, out)


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
