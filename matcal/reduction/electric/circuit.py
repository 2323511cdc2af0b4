"""The resistance that a recording holds: as its own column, as voltage over current, or relative to that at rest."""

from dataclasses import dataclass, replace

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.specimen import Strip
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import percent

_SAME = 0.01  # share by which a resistance and a voltage over a current may differ
# share of the first conductance below which the specimen has torn or lost its contacts
_OPEN = 0.02
# quantities of which one makes a circuit
ELECTRIC = ("resistance", "current", "relative_resistance")


@dataclass(frozen=True)
class Circuit:
    """The electrical record while the specimen was whole."""

    resistance_Ohm: Array  # (n,) resistance, Ohm, of the first n samples
    signal: Array  # (m,) what collapses where the specimen tears, of all samples: current, or conductance
    notes: tuple[str, ...] = ()  # what was assumed
    cautions: tuple[str, ...] = ()  # where two columns differ


def circuit_of(recording: Recording, strip: Strip) -> Circuit:
    """The resistance of a recording, by its own column first. InputFileError where nothing gives it, or where what
    does contradicts the specimen."""
    if "resistance" in recording.columns:
        return _measured(recording, strip)
    if "current" in recording.columns:
        current = np.abs(recording.columns["current"])
        voltage, notes = _voltage(recording, strip, current.size)
        return _while_whole(recording, current, np.divide(current, voltage), notes, "current")
    if "relative_resistance" in recording.columns:
        return _relative(recording, strip)
    if "potential" in recording.columns and strip.series_resistance_Ohm is not None:
        return _divided(recording, strip.series_resistance_Ohm, strip.voltage_V)
    raise no_resistance(recording)


def no_resistance(recording: Recording) -> InputFileError:
    """Why a recording gives no resistance, and what would."""
    found = ", ".join(recording.names.values())
    if "potential" in recording.columns:
        return InputFileError(recording.paths[0], f"its voltage alone gives no resistance (found: {found}). Of a "
                              "divider, whose known resistor is in series with the specimen, write "
                              "series_resistance_Ohm and voltage_V, the supply's, below [conductivity] of the specimen "
                              "file; the column is the specimen's voltage.")
    return InputFileError(recording.paths[0], f"no resistance, and no current, stands in it; found: {found}. Name a "
                                              "column resistance, or give it with --columns resistance=COLUMN:ohm.")


def _measured(recording: Recording, strip: Strip) -> Circuit:
    resistance, name = recording.columns["resistance"], recording.names["resistance"]
    if resistance.min() <= 0:
        row = int(np.argmin(resistance))
        raise InputFileError(recording.paths[0], f"column '{name}' is {resistance[row]:.4g} Ohm in sample {row + 1}, "
                                                 "and a resistance is above 0. Delete the row.")
    found = _while_whole(recording, 1 / resistance, 1 / resistance, (f"Resistance by column '{name}'.",), name)
    found = _with_ratio(found, recording)
    current = recording.columns.get("current")
    if current is None or ("potential" not in recording.columns and strip.voltage_V is None):
        return found
    voltage, _ = _voltage(recording, strip, current.size)
    used = slice(0, found.resistance_Ohm.size)
    with np.errstate(divide="ignore"):
        other = float(np.median(np.abs(voltage / current)[used] / found.resistance_Ohm)) - 1
    if abs(other) < _SAME:
        return found
    said = (f"Two measures of the resistance differ in {recording.label}: column '{name}' is used, and voltage over "
            f"current is {percent(abs(other), 2)} {'higher' if other > 0 else 'lower'} (median).")
    return Circuit(found.resistance_Ohm, found.signal, found.notes, (*found.cautions, said))


def _with_ratio(found: Circuit, recording: Recording) -> Circuit:
    """With what is to be minded where a column of ratios to the resistance at rest contradicts that of resistance."""
    ratio = recording.columns.get("relative_resistance")
    if ratio is None:
        return found
    used = found.resistance_Ohm
    with np.errstate(divide="ignore", invalid="ignore"):
        rest = used / ratio[:used.size]
    off = float(np.ptp(rest) / abs(np.median(rest))) if np.all(np.isfinite(rest)) else np.inf
    if off < _SAME:
        return found
    names = recording.names
    return replace(found, cautions=(*found.cautions, f"Column '{names['resistance']}' of {recording.label} is used, "
                                    f"and '{names['relative_resistance']}' is not it over one resistance at rest: that "
                                    f"would change by {percent(off, 2)} from row to row."))


def _relative(recording: Recording, strip: Strip) -> Circuit:
    ratio, name = recording.columns["relative_resistance"], recording.names["relative_resistance"]
    if strip.rest_resistance_Ohm is None:
        raise InputFileError(recording.paths[0], f"column '{name}' is relative to the resistance at rest. Write "
                                                 "rest_resistance_Ohm, in Ohm, below [conductivity] of the specimen "
                                                 "file.")
    if ratio.min() <= 0:
        raise InputFileError(recording.paths[0], f"column '{name}' falls to {ratio.min():.4g}, and a ratio of "
                                                 "resistances is above 0. If it is the change, add 1.")
    conductance = 1 / (ratio * strip.rest_resistance_Ohm)
    return _while_whole(recording, conductance, conductance,
                        (f"Resistance by column '{name}' times {strip.rest_resistance_Ohm:g} Ohm at rest.",), name)


def _divided(recording: Recording, series_Ohm: float, supply_V: float | None) -> Circuit:
    """R = R_s V / (V_s - V) of the specimen's voltage V in a divider, V_s the supply's."""
    voltage, name = recording.columns["potential"], recording.names["potential"]
    if supply_V is None:
        raise InputFileError(recording.paths[0], "series_resistance_Ohm is of a divider: write voltage_V, the supply's "
                                                 "voltage over both resistors, below [conductivity] too.")
    odd = np.flatnonzero((voltage <= 0) | (voltage >= supply_V))
    if odd.size:
        raise InputFileError(recording.paths[0], f"column '{name}' is {voltage[odd[0]]:.4g} V in sample {odd[0] + 1}, "
                                                 "and the specimen's voltage in a divider is between 0 and voltage_V "
                                                 f"= {supply_V:g}. Correct voltage_V, or delete the row.")
    conductance = (supply_V - voltage) / (series_Ohm * voltage)
    note = (f"Resistance by column '{name}', the specimen's voltage in a divider of {supply_V:g} V with {series_Ohm:g} "
            "Ohm.")
    return _while_whole(recording, conductance, conductance, (note,), name)


def _voltage(recording: Recording, strip: Strip, size: int) -> tuple[Array, tuple[str, ...]]:
    """(n,) voltage, V, and what was assumed of it."""
    if "potential" not in recording.columns:
        if strip.voltage_V is None:
            raise InputFileError(recording.paths[0], "no potential column, and the specimen has no voltage_V. Give "
                                                     "either.")
        return np.full(size, strip.voltage_V), (f"No potential column: {strip.voltage_V:g} V taken from the specimen.",)
    voltage = np.abs(recording.columns["potential"])
    if strip.voltage_V is not None and abs(np.median(voltage) / strip.voltage_V - 1) > 0.05:
        raise InputFileError(recording.paths[0], f"its potential is {np.median(voltage):.4g} V but the specimen says "
                                                 f"voltage_V = {strip.voltage_V:g}. Correct one of them.")
    return voltage, ()


def _while_whole(recording: Recording, signal: Array, conductance: Array, notes: tuple[str, ...], what: str) -> Circuit:
    """The record until what flows collapses for the first time."""
    whole = signal > _OPEN * np.median(signal[:max(10, signal.size // 50)])
    if not whole[0]:
        raise InputFileError(recording.paths[0], "no current flows at the start. Check the contacts.",
                             line=recording.first_line)
    until = signal.size if whole.all() else int(np.argmin(whole)) - 1
    if until < signal.size:
        said = "Current collapses" if what == "current" else "The conductance collapses"
        notes += (f"{said} after {until} of {signal.size} samples; the rest is left out.",)
    return Circuit(1 / conductance[:until], signal, notes)
