"""`eitsim sensor design`: drives, choices of readings and electrodes by the bounds that they set to reading a touch."""

from pathlib import Path
from typing import Annotated

import typer

from touchcal.terminal import JsonOption, check_apart, check_out, counted, print_json
from touchcal.whole_file import written


def design(sensors: Annotated[list[Path], typer.Argument(
               metavar="SENSOR", help="Sensor files, or scene files, whose punch, force and diameter count; several "
                                         "are layouts of electrodes to compare.")],
           card: Annotated[Path, typer.Option("--card", help="Material card.")],
           noise_db: Annotated[float, typer.Option(help="Noise of one reading, dB below the RMS of the first sensor's "
                                                        "untouched readings.")] = 80.0,
           noise_v: Annotated[float | None, typer.Option("--noise-V", help="Noise of one reading, V, instead.")] = None,
           readings: Annotated[int | None, typer.Option(min=1, help="Choose this many readings.")] = None,
           candidates: Annotated[str, typer.Option(help="What they are chosen from: own, the readings of the sensor's "
                                                        "drive, or all, those of any four electrodes.")] = "own",
           unknown_diameter: Annotated[bool, typer.Option(
               "--unknown-diameter", help="The punch's diameter is read, too.")] = False,
           within_mm: Annotated[float | None, typer.Option(
               help="Touches lie within this distance of the centre, or of the centroid of an outline; else "
                    "as far as the punch fits.")] = None,
           places: Annotated[int, typer.Option(min=1, help="Touches that are solved; an even ring of a disc turns each "
                                                           "into one for every electrode.")] = 24,
           out: Annotated[Path | None, typer.Option(
               help="Write the chosen readings (CSV) here, as pairs in [drive] of a sensor file names them.")] = None,
           as_json: JsonOption = False) -> None:
    """Rank drives, choices of readings and layouts of electrodes by the least standard deviations of x, y and F that
    any unbiased reading of a touch can have (Cramer-Rao), over the skin and under white noise.

    Each sensor takes some 25 to 40 CPU seconds. Bounds hold for the same noise in every reading, however many there
    are, and count no error of a model.

    Example: eitsim sensor design sensor.toml --card card.json --readings 32 --out pairs.csv
    """
    from eitsim.cli.display import show_designs
    from eitsim.sensors.layout.sensor_design import design_document, design_sensor, read_layout
    from matcal.card import read_card

    if out is not None:
        check_out(out)
        check_apart({"--out": out}, [*sensors, card])
    if out is not None and readings is None:
        raise ValueError("--out is for chosen readings; give --readings N.")
    if out is not None and len(sensors) > 1:
        raise ValueError("--out holds the readings of one sensor; give one SENSOR.")
    scenes, material = {path: read_layout(path) for path in sensors}, read_card(card)
    made, noise = {}, noise_v
    for path, scene in scenes.items():
        made[path] = design_sensor(scene, material, noise_dB=noise_db, noise_V=noise, readings=readings,
                                   candidates=candidates, unknown_diameter=unknown_diameter,
                                   within_m=None if within_mm is None else within_mm / 1e3, places=places,
                                   each=counted("touches"))
        noise = made[path].noise_V
    if out is not None:
        import numpy as np

        with written(out) as file:
            np.savetxt(file, made[sensors[0]].pairs, fmt="%d", delimiter=",", header="source,sink,plus,minus",
                       comments="")
    if as_json:
        print_json({"sensors": [{"sensor": path} | design_document(one) for path, one in made.items()]})
        return
    show_designs(made)
    if out is not None:
        print(f"readings: {out} ({readings})")
