"""The report of a calibrated sensor, from the `sensor.json` of `eitsim sensor fit`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from eitsim.scene.calibrated_electrodes import NAMES, calibrated_tables, read_fitted
from eitsim.scene.scene import scene_from
from reports.document import provenance
from reports.document.numerals import counted, number, percent
from reports.document.page import Report, ReportFigure, Table, write_pdf
from reports.document.style import house
from reports.document.verdict import GOOD, NOT_USABLE, USABLE, Limits, Verdict, graded
from reports.sensor import sensor_figures
from reports.sensor.repairs import repairs, values

HELD_OUT: Limits = (0.03, 0.1)  # part of the readings of drives that were not fitted
PRESSES: Limits = (0.3, 0.7)  # part of the signals of presses that were not fitted
_TESTS = {"repeats": "same drive twice", "source_against_sink": "source and sink exchanged",
          "reciprocity": "drive and measurement exchanged", "superposition": "drives that add up"}
_GROUPS = {"conductance": "ln of sheet conductance (S)", "contacts": "ln of contact impedance (Ω m)",
           "width": "ln of width over design (–)", "positions": "place along the edge (mm)", "gains": "gain (–)",
           "currents": "current over nominal (–)", "leaks": "leak to ground (uS)",
           "sheet": "mode of ln of sheet conductance (–)", "widths": "ln of one width over the others (–)"}
_OF_PRESSES = {"ln_moment_mm2": "ln of a press's moment (mm²)", "reading_gain": "gain of a reading (–)",
               "press_offset": "offset of the presses (mm)", "ln_law_amplitude": "ln of the law's amplitude (–)",
               "ln_modulus_factor": "ln of the foam's moduli over the card's (–)",
               "law_shape": "square and cube in the law, over its size (–)"}
_LEFT_OUT = ("Errors of readings are taken as independent, which errors of the model are not. A parameter whose "
             "standard deviation is not smaller than before the fit is not determined by the data.")


def write(source: Path, out: Path) -> None:
    """Write the PDF of a calibrated sensor. InputFileError where `source` is none; ValueError where the folder of `out`
    is missing."""
    with house():
        write_pdf(report(source), out)


def report(path: Path) -> Report:
    """Everything that the template `sensor.typ` shows; InputFileError where the file is no calibrated sensor."""
    document = read_fitted(path)
    plates, absent = _plates(path, document)
    tables = {"parameters": _parameter_table(document)} if document["parameters"] else {}
    if document["unexplained"]:
        tables["freed"] = _stage_table(document)
    if document["tests"]:
        tables["tests"] = _test_table(document["tests"])
    absent |= {name: f"Not there: {document['reason']}" for name in ("parameters", "freed", "tests")
               if name not in tables}
    sensor = document["sensor"]
    body = scene_from({"body": sensor["body"]}).body
    skin = f"along the edge of a skin of {number(1e6 * body.edge.area_m2)} mm²"
    subtitle = (f"{sensor['electrodes']['count']} electrodes {skin}; "
                f"{counted(document['untouched_frames'], 'untouched frame')}")
    footer = provenance.footer([provenance.source(path)], "seed 0: halves of the drives and starts")
    return Report("sensor", "Calibrated sensor", subtitle, footer, _findings(document), plates, tables, absent,
                  {"repairs": repairs(document), "left_out": _LEFT_OUT}, _cautions(document),
                  verdict=_verdict(document))


def _verdict(document: Mapping[str, Any]) -> list[Verdict]:
    """What the absolute model, changes of readings, and the signal's size are good for."""
    found = []
    if document["absolute_model"] == "usable":
        left = document["unexplained"][document["stage"]]["held_out"]
        found.append(Verdict("Absolute model", graded(left, HELD_OUT), f"{percent(left)} of the readings stay "
                             "unexplained on drives that were not fitted; serves scenes, sweeps and images"))
        found.append(Verdict("Changes of readings", GOOD, "channels and contacts are known"))
    else:
        found.append(Verdict("Absolute model", NOT_USABLE, document["reason"]))
        found.append(Verdict("Changes of readings", USABLE, "with labelled presses and surrogate learn; nothing of "
                             "the instrument is known"))
    if (presses := document["presses"]) is not None:
        left = min(one["held_out"] for one in presses["unexplained"].values()) if (
            presses["gains_kept"]) else presses["unexplained"]["size"]["held_out"]
        found.append(Verdict("Size of the signal", graded(left, PRESSES), f"{percent(left)} of the signals of presses "
                             "that were not fitted stay unexplained by a small touch at their places"))
    return found


def _cautions(document: Mapping[str, Any]) -> list[str]:
    if not document["stage"]:
        return []
    before, after = _held_out(document)
    if after <= max(before, HELD_OUT[0]):  # what is good may be worse than a sheet alone by noise
        return []
    return [f"The calibrated sensor predicts drives that were not fitted worse ({percent(after)} unexplained) than a "
            f"uniform sheet alone ({percent(before)}): what was fitted is not the sensor. See that nothing touched it, "
            "and record more untouched frames."]


def _held_out(document: Mapping[str, Any]) -> tuple[float, float]:
    """What a uniform sheet alone, and the calibrated sensor, leave of drives that were not fitted."""
    before, after = (document["unexplained"][stage]["held_out"] for stage in ("conductance", document["stage"]))
    return before, after


def _findings(document: Mapping[str, Any]) -> list[str]:
    found = []
    if document["stage"]:
        before, after = _held_out(document)
        found.append(f"On drives that were not fitted {percent(before)} of the readings stay unexplained by a uniform "
                     f"sheet alone, {percent(after)} by the calibrated sensor.")
        lost = [group for group in document["unexplained"] if group not in document["kept"]]
        found.append("Freed in the last fit alone, since half of the drives does not determine them: "
                     f"{', '.join(lost)}." if lost else
                     "Every group of parameters is kept: none makes those drives clearly worse.")
        open_ = len(document["not_determined"])
        count = len(document["parameters"])
        found.append(f"{count - open_} of {count} parameters are determined by the data.")
    else:
        found.append(f"No absolute model: {document['reason']}")
    if (presses := document["presses"]) is not None:
        one = document["parameters"]["ln_moment_mm2"]
        size = ("as large as no absolute model says" if document["absolute_model"] != "usable" else
                f"{number(float(np.exp(one['value'])), 2)} mm² in the median, as relative change of conductance times "
                "area")
        found.append(f"{counted(presses['count'], 'labelled press', 'labelled presses')}: moments are {size}, their "
                     f"mean within a factor of {number(float(np.exp(1.96 * one['sd'])), 3)} at 95 %.")
    if (skin := document.get("skin")) is not None:
        left = skin["unexplained"]
        found.append(f"Skin, of {counted(skin['count'], 'press', 'presses')}: the card as it is leaves "
                     f"{percent(left['card'])} of their signals, the fitted one {percent(left['kept'])} of presses "
                     f"left out; kept are {', '.join(skin['kept']) or 'none'}. Sizes are off by "
                     f"{percent(skin['size_error'])}, r.m.s.")
    return found


def _plates(path: Path, document: Mapping[str, Any]) -> tuple[list[ReportFigure], dict[str, str]]:
    plates: list[ReportFigure] = []
    absent: dict[str, str] = {}
    if document["absolute_model"] == "usable":
        sensor = scene_from(calibrated_tables(path))
        offset_mm = np.array([one["value"] for one in values(document["parameters"], "positions").values()])
        plates = [sensor_figures.electrodes(sensor, offset_mm), sensor_figures.channels(sensor, offset_mm)]
    else:
        absent["electrodes"] = (f"Not there: {document['reason']}")
    if document["unexplained"]:
        plates += [sensor_figures.stages(document), sensor_figures.residuals(document)]
    return plates, absent


def _stage_table(document: Mapping[str, Any]) -> Table:
    rows = [[group, percent(one["fitted"]), percent(one["held_out"]), "kept" if group in document["kept"] else
             "freed in the last fit alone"] for group, one in document["unexplained"].items()]
    return Table("Groups of parameters in the order in which they were freed.", ["freed", "fitted drives",
                 "other drives", ""], rows, "lrrw")


def _test_table(tests: Mapping[str, float | None]) -> Table:
    rows = [[_TESTS[name], "the drive does not say it" if value is None else percent(value)]
            for name, value in tests.items()]
    return Table("Readings that an ohmmeter makes the same: how far they are from each other, of their norm.",
                 ["readings", "difference"], rows, "lw")


def _range(value: list[float]) -> str:
    return number(value[0], 4) if len(value) == 1 else f"{number(min(value), 3)} to {number(max(value), 3)}"


def _parameter_table(document: Mapping[str, Any]) -> Table:
    rows = []
    for group, words in _GROUPS.items():
        own = [one for name, one in document["parameters"].items() if name.startswith(NAMES[group])]
        if not own:
            continue
        value, sd, prior = ([one[key] for one in own] for key in ("value", "sd", "prior_sd"))
        open_ = sum(name.startswith(NAMES[group]) for name in document["not_determined"])
        rows.append([words, _range(value), number(float(np.median(sd)), 2), number(float(np.median(prior)), 2),
                     f"{open_} of {len(own)}" if open_ else "none"])
    for name, words in _OF_PRESSES.items():
        own = [one for key, one in document["parameters"].items() if key.startswith(name)]
        if own:
            value = [one["value"] for one in own]
            rows.append([words, _range(value), number(float(np.median([one["sd"] for one in own])), 2),
                         number(float(np.median([one["prior_sd"] for one in own])), 2),
                         "none" if not any(k.startswith(name) for k in document["not_determined"]) else "some"])
    return Table("Parameters with the median standard deviation after and before the fit.",
                 ["parameter", "values", "sd", "prior sd", "not determined"], rows, "wrrrr")
