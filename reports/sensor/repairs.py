"""What a calibration says is to be repaired, electrode by electrode."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from eitsim.scene.calibrated_electrodes import NAMES
from reports.document.numerals import number, percent

# Contact impedance over the ring's median, and prior standard deviations of a parameter, from which it is named where
# its interval allows no other reading of it.
POOR_CONTACT, UNUSUAL = 5.0, 3.0
NONE = "Nothing that this calibration shows."
_SURE = 1.96  # standard deviations of a 95 % interval
_CHANNEL = {"gains": ("the gain of channel {k} is {value} of the mean: check its amplifier and its lead", 1.0),
            "currents": ("the current from electrode {k} is {value} of the mean: check the source and its lead", 1.0),
            "leaks": ("electrode {k} leaks {value} uS to ground: insulate and dry its lead", 0.0),
            "positions": ("electrode {k} lies {value} mm from where the sensor file puts it along the edge: measure it",
                          0.0)}


def repairs(document: Mapping[str, Any]) -> list[str]:
    """One sentence for each thing to repair; NONE where nothing shows."""
    found = [f"Electrode {k} is left out, since {why}: check its contact, its lead and its channel."
             for k, why in document["left_out"].items()]
    if document["dead_readings"]:
        first, more = document["dead_readings"][0], len(document["dead_readings"]) - 1
        found.append(f"{more + 1} readings are dead, first {first}: check their channels." if more else
                     f"Reading {first} is dead: check its channel.")
    if document["absolute_model"] != "usable":
        return [*found, f"The instrument, before any electrode: {document['reason']}"]
    return [*found, *_contacts(document["parameters"]), *_channels(document["parameters"])] or [NONE]


def values(parameters: Mapping[str, Any], group: str) -> dict[int, dict[str, float]]:
    """Electrode -> value and standard deviations of a group's parameter."""
    start = f"{NAMES[group]}_"
    return {int(name.removeprefix(start)): one for name, one in parameters.items()
            if name.startswith(start) and name.removeprefix(start).isdigit()}


def _contacts(parameters: Mapping[str, Any]) -> Iterator[str]:
    each = values(parameters, "contacts")
    median = float(np.median([one["value"] for one in each.values()])) if each else 0.0
    for k, one in each.items():
        if one["value"] - median - _SURE * one["sd"] > np.log(POOR_CONTACT):
            yield (f"The contact impedance of electrode {k} is {number(float(np.exp(one['value'] - median)), 2)} times "
                   "the ring's median: clean it or glue it again.")


def _channels(parameters: Mapping[str, Any]) -> Iterator[str]:
    for group, (words, usual) in _CHANNEL.items():
        for k, one in values(parameters, group).items():
            off = abs(one["value"] - usual)
            if off > UNUSUAL * one["prior_sd"] and off > _SURE * one["sd"]:
                value = percent(one["value"]) if usual else number(one["value"], 3)
                yield words.format(k=k, value=value)[0].upper() + words.format(k=k, value=value)[1:] + "."
