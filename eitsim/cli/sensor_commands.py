"""Commands of `eitsim sensor`: what recordings of real sensors say, and models calibrated to them."""

from pathlib import Path
from typing import Annotated

import typer

from eitsim.cli.sensor_design_command import design
from eitsim.cli.sensor_fit_commands import correct, fit, predict
from touchcal.errors import InputFileError
from touchcal.terminal import JsonOption, application, check_apart, check_out, print_json, waiting

app = application("Real sensors: their recordings, what the readings say of themselves, and models calibrated to them.")


@app.callback()
def group() -> None:
    """Real sensors: their recordings, what the readings say of themselves, and models calibrated to them."""


@app.command()
def inspect(recording: Annotated[Path, typer.Argument(
                metavar="RECORDING", help="CSV of one row a frame: index or time_s, touch (empty: untouched), v_000 "
                                          "...; or a board's file: Sciospec .eit, OpenEIT, EIT-kit, "
                                          ".mat, .npy.")],
            sensor: Annotated[Path | None, typer.Option(
                help="Sensor file (TOML) with [body], [electrodes], [drive] and [readings], whose drive is compared "
                     "with what the readings look like.")] = None,
            pairs: Annotated[Path | None, typer.Option(
                help="Write the order found here (CSV: source, sink, plus, minus of each reading), for pairs in "
                     "[drive] of a sensor file.")] = None,
            as_json: JsonOption = False) -> None:
    """Find order, sign, faults and noise of the readings, without a model and with one, and ask where the data do
    not decide.

    Example: eitsim sensor inspect frames.csv --sensor sensor.toml
    """
    from eitsim.cli.display import show_inspection
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.inspection import inspect as inspected
    from eitsim.sensors.inspection_words import document, pairs_as_read
    from eitsim.sensors.sensor_file import Sensor, pairs_of, read_sensor, write_pairs

    if pairs is not None:
        check_out(pairs)
        check_apart({"--pairs": pairs}, [path for path in (recording, sensor) if path is not None])
    known, readings = None, None
    if sensor is not None:
        known = read_sensor(sensor)
        try:
            readings = len(pairs_of(known))
        except ValueError as error:
            raise InputFileError(sensor, str(error)) from None
    frames = open_recording(recording, kind=known.kind if known else Sensor.kind, readings=readings)
    with waiting("comparing orders of readings"):
        found = inspected(frames, known)
    if as_json:
        print_json(document(found))
    else:
        show_inspection(found)
    if pairs is not None:
        order = pairs_as_read(found)
        if order is None:
            raise ValueError(f"--pairs {pairs}: no single order was found, so that none is written. "
                             "Answer the questions first.")
        write_pairs(order, pairs)


app.command()(fit)
app.command()(predict)
app.command()(design)
app.command()(correct)
