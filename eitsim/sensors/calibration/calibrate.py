"""Calibrate the absolute model of a sensor to its untouched frame, or refuse it with the reason."""

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace

import numpy as np

from eitsim.electrics.forward.small_touch import signal_by_touch
from eitsim.electrics.forward.untouched import untouched_impedance
from eitsim.scene.channels import Channels, channel_readings, sinks
from eitsim.scene.drive import Protocol
from eitsim.scene.scene import from_edge_m
from eitsim.sensors.calibration.faults import dead_electrodes, left_by_electrode, suspect, unexplained, without
from eitsim.sensors.calibration.instrument_model import GROUPS, Instrument, sources, voltages
from eitsim.sensors.calibration.labelled_presses import Presses, SignalSize, labelled_presses, signal_size
from eitsim.sensors.calibration.ohm_tests import OhmTests, ohm_tests
from eitsim.sensors.calibration.placement import Placement, placement
from eitsim.sensors.calibration.skin_errors import errors_of_instrument
from eitsim.sensors.calibration.skin_fit import FEWEST, SkinFit, fit_skin
from eitsim.sensors.calibration.skin_law import (
    THICKNESS_SD,
    Paths,
    SkinPresses,
    check_skin,
    check_thickness_sd,
    held_label,
    skin_presses,
)
from eitsim.sensors.calibration.stages import Fit, Stage, Untouched, driven, fit, jointly, staged
from eitsim.sensors.labels import Labels, labels_of
from eitsim.sensors.reading_checks import NO_OHMMETER, dead_readings, mean_frame
from eitsim.sensors.recording import Recording
from eitsim.sensors.sensor_file import Sensor
from eitsim.sensors.taken_readings import idle_readings
from eitsim.sensors.untouched_scatter import change_noise
from matcal.card import MaterialCard
from touchcal.arrays import Array

# Part of the readings off the driven electrodes, unexplained on drives not fitted, from which the model is of no use
MOST_UNEXPLAINED = 0.1
_FIRST_CONDUCTANCE = 1e-3  # S, from which the readings' size gives the one that the fit starts at
_DIFFERENCES = ("the readings are differences to an untouched frame that is not here; record voltages or magnitudes to "
                "calibrate the absolute model.")
_WORDS = {"repeats": "readings of the same drive differ",
          "source_against_sink": "readings with source and sink exchanged differ",
          "reciprocity": "readings with drive and measurement exchanged differ",
          "superposition": "readings differ from what is linear in the currents"}


@dataclass(frozen=True, eq=False)
class FittedSkin:
    """The skin of labelled presses."""

    card: MaterialCard  # that the fit began with
    presses: int  # that load paths serve
    left_out: tuple[str, ...]  # touches near the rim, or deeper than load paths are stored
    too_deep: tuple[str, ...]  # of them, the deeper ones
    odd: tuple[str, ...]  # touches that are missed by far more than the others
    lies: Placement  # where the sensor lies in the coordinates of the labels, before the offset that is fitted
    fit: SkinFit


@dataclass(frozen=True, eq=False)
class Calibration:
    """What the untouched readings of a sensor, and labelled presses where there are any, gave."""

    sensor: Sensor
    frames: int  # untouched frames, whose mean is fitted
    tests: OhmTests | None  # None of differences
    reason: str = ""  # why the absolute model is refused; empty where it is usable
    stages: Mapping[str, Stage] = field(default_factory=dict)  # by group of parameters, on half of the drives
    kept: tuple[str, ...] = ()  # groups that half of the drives determine, in the order in which they were freed
    instrument: Instrument | None = None  # None where nothing was fitted
    fit: Fit | None = None  # of all drives
    # readings without a number, from 0, but for those of driven electrodes that the board does not take
    dead: tuple[int, ...] = ()
    left_out: Mapping[int, str] = field(default_factory=dict)  # electrode -> why its readings and drives are left out
    by_electrode: tuple[float, ...] = ()  # (N,) part of the readings that use one, off driven ones, not explained
    size: SignalSize | None = None  # of labelled presses
    skin: FittedSkin | None = None  # what they say of a card, where one is given and the absolute model is usable


def calibrate(sensor: Sensor, recording: Recording, labels: Labels | None = None, card: MaterialCard | None = None, *,
              thickness_sd: float = THICKNESS_SD, seed: int = 0) -> Calibration:
    """Fit conductance and how it varies, contacts, widths, places, gains, currents and leaks of a sensor to the mean of
    its untouched frames, stage by stage, the most probable state under Gaussian priors.

    A stage is left out where drives that were not fitted, a random half by `seed`, are clearly worse predicted by it;
    the last fit takes all drives, and frees all parameters under their priors, `instrument_model.GROUPS`. Readings may
    be volts or the counts of a board; then conductances are by the same unknown factor. Readings and drives of
    electrodes that are dead, or that no state explains (`faults`), are left out and named. Refused, with the reason and
    no state: differences, which have no untouched frame, and readings that are no ohmmeter's (`ohm_tests`). Refused
    with its state: a model that leaves more than MOST_UNEXPLAINED. Labelled presses give the size of the signal, and
    where the absolute model is refused a gain for each reading (`labelled_presses`). With a card, labels of places,
    punches and forces or depths fit its laws on a usable model (`skin_law`, `skin_fit`), a layer's thickness with the
    relative standard deviation `thickness_sd`.

    ValueError where the sensor has electrodes that are no lines or have no contact, several sinks at once, fewer than
    two drives, no reading off the driven electrodes, or the recording no untouched frame; for labels as
    `labelled_presses`.

    >>> import eitsim, numpy as np
    >>> sensor = eitsim.Sensor(eitsim.Body(), eitsim.Skin(), eitsim.Electrodes(), eitsim.Drive(), "difference")
    >>> touched = eitsim.Recording(np.ones((1, 208)), np.array([0]), None, np.array(["a"]), "difference", "frames.csv")
    >>> eitsim.calibrate(sensor, touched).reason
    'the readings are differences to an untouched frame that is not here; ...'
    """
    if labels is not None and card is not None:
        held_label(labels)
        check_skin(card)
        check_thickness_sd(thickness_sd)
    found = _absolute(sensor, recording, seed)
    if labels is None:
        return found
    check_electrodes(sensor)
    presses = labelled_presses(recording, labels)
    found = replace(found, size=_size(found, presses, seed))
    if card is None or found.reason:
        return found
    return replace(found, skin=_skin(found, presses, labels, card, recording, thickness_sd, seed))


def _absolute(sensor: Sensor, recording: Recording, seed: int) -> Calibration:
    """The absolute model, or why there is none."""
    if sensor.kind == "difference":
        return Calibration(sensor, 0, None, _DIFFERENCES)
    frame, count = untouched(sensor, recording), int(recording.untouched.sum())
    lost = ~np.isfinite(frame.volts).ravel()
    dead, left_out = tuple(np.flatnonzero(lost & ~idle_readings(frame.asked, lost)).tolist()), dead_electrodes(frame)
    frame = without(frame, left_out)
    _check_left(frame)
    tests = ohm_tests(sensor, frame.volts)
    if reason := no_ohmmeter(tests):
        return Calibration(sensor, count, tests, reason, dead=dead, left_out=left_out)
    instrument = Instrument(sensor.body, sensor.electrodes, sources(frame.asked), _FIRST_CONDUCTANCE)
    roughly = _of_size(instrument, frame)
    stages, kept, found, instrument = _fitted(roughly, frame, seed)
    by_electrode = left_by_electrode(frame, voltages(instrument, frame.asked, found.state))
    if (odd := suspect(by_electrode)) is not None:
        others = without(frame, [odd])
        alone = jointly(instrument, others, found.state, seed)
        if why := unexplained(found.misfit, alone.misfit):
            left_out, frame = {**left_out, odd: why}, others
            _check_left(frame)
            stages, kept, found, instrument = _fitted(roughly, frame, seed)
            by_electrode = left_by_electrode(frame, voltages(instrument, frame.asked, found.state))
    left = stages[kept[-1]].held_out
    reason = "" if left <= MOST_UNEXPLAINED else (
        f"{left:.0%} of the readings off the driven electrodes stay unexplained on drives that were not fitted, and "
        f"{MOST_UNEXPLAINED:.0%} are the most; only changes of readings can be used. If that surprises, check [drive] "
        "by `eitsim sensor inspect`, and the sizes in [body].")
    return Calibration(sensor, count, tests, reason, stages, kept, instrument, found, dead, left_out, by_electrode)


def _fitted(instrument: Instrument, frame: Untouched,
            seed: int) -> tuple[dict[str, Stage], tuple[str, ...], Fit, Instrument]:
    """Stages on half of the drives, what they keep, the fit of all groups to all drives, and the instrument of that,
    whose mesh, where it has one, is made for the electrodes that were found."""
    stages, kept, half = staged(instrument, frame, seed)
    found = jointly(instrument, frame, half.state, seed)
    closely = instrument.around(found.state)
    return stages, kept, found if closely is instrument else fit(closely, frame, tuple(GROUPS), found.state), closely


def _size(found: Calibration, presses: Presses, seed: int) -> SignalSize:
    """The size of the presses' signals, by the calibrated sensor where it is usable, else by the sensor as its file
    describes it with a gain for each reading; of differences, which may be of magnitudes, by what explains more."""
    sensor, asked = found.sensor, found.sensor.protocol
    electrodes, channels = sensor.electrodes, Channels(conductance_S=(_FIRST_CONDUCTANCE,))
    if not found.reason and found.instrument is not None and found.fit is not None:
        electrodes, channels = found.instrument.built(found.fit.state), found.instrument.channels(found.fit.state)
    sheet = channels.conductance_S[0]
    rest = channel_readings(asked, channels, untouched_impedance(sensor.body, electrodes, sheet)).ravel()
    there = np.asarray(np.isfinite(presses.signal).all(axis=0))

    def sized(sign: Array) -> SignalSize:
        def shape_of(places_m: Array) -> Array:
            return 1e-6 * (sign * signal_by_touch(sensor.body, electrodes, sheet, channels, asked, places_m))[:, there]

        lies = placement(presses.place_m, presses.signal[:, there], shape_of, sensor.body)
        return signal_size(presses, there, shape_of(lies.placed(presses.place_m)), lies, seed,
                           gains=bool(found.reason))

    one, magnitudes = np.ones(rest.size), np.sign(rest)
    signs = {"voltage": [one], "magnitude": [magnitudes], "difference": [one, magnitudes]}[sensor.kind]
    return min((sized(sign) for sign in signs), key=lambda each: each.held_out)


def _skin(found: Calibration, presses: Presses, labels: Labels, card: MaterialCard, recording: Recording,
          thickness_sd: float, seed: int) -> FittedSkin:
    """What the presses say of a card's skin and foam, on the calibrated sensor."""
    assert found.instrument is not None
    assert found.fit is not None
    assert found.size is not None
    sensor, state = found.sensor, found.fit.state
    scene = replace(sensor.scene, electrodes=found.instrument.built(state), channels=found.instrument.channels(state))
    own, there = labels_of(labels, presses.rows), np.asarray(np.isfinite(presses.signal).all(axis=0))
    sign = np.ones(there.sum())
    if sensor.kind == "magnitude":
        sign = np.sign(untouched_readings(found.instrument, state, sensor.protocol, "voltage").ravel())[there]

    def pressed(lies: Placement, paths: Paths | None = None) -> tuple[float, SkinPresses, Placement]:
        """What the card as it is leaves of the presses there, m. s. of one, and the presses."""
        held = skin_presses(scene, card, own, lies.placed(presses.place_m), paths, thickness_sd)
        if len(held.rows) < FEWEST:
            return np.inf, held, lies
        left = sign * held.signals({})[:, there] - presses.signal[held.rows][:, there]
        return float(np.mean(left**2)), held, lies

    ways = [pressed(found.size.lies)]
    if found.size.lies != Placement() and from_edge_m(sensor.body, presses.place_m).min() > 0:
        # small touches, by which the labels were placed, are less than the whole model
        ways.append(pressed(Placement(), ways[0][1].paths))
    _, held, lies = min(ways, key=lambda one: one[0])
    if len(held.rows) < FEWEST:
        deep = len(held.too_deep)
        raise ValueError(f"{len(held.rows)} labelled presses serve, of {len(own.touch)}; {deep} are deeper than load "
                         f"paths are stored and {len(own.touch) - len(held.rows) - deep} lie near the rim. A skin's "
                         f"law needs {FEWEST}. Label more, or leave out --card.")

    def signals(values: Mapping[str, float]) -> Array:
        return sign * held.signals(values)[:, there]

    common = errors_of_instrument(found.instrument, found.fit, replace(scene, punches=held.punches), held.signals({}),
                                  seed)
    fit = fit_skin(signals, presses.signal[held.rows][:, there], held.groups, common=sign * common[..., there],
                   noise_V=change_noise(recording, there) or 0.0, seed=seed)
    return FittedSkin(card, len(held.rows), (*np.delete(own.touch, held.rows).tolist(),),
                      (*own.touch[held.too_deep].tolist(),), (*own.touch[held.rows][fit.odd].tolist(),), lies, fit)


def untouched(sensor: Sensor, recording: Recording) -> Untouched:
    """The mean of a recording's untouched frames, of complex readings the real part; ValueError as `calibrate`."""
    check_electrodes(sensor)
    if recording.kind != sensor.kind:
        raise ValueError(f"{recording.source}: its readings are of kind '{recording.kind}', and kind in [readings] of "
                         f"the sensor is '{sensor.kind}'; correct one of them.")
    asked = sensor.protocol
    sinks(asked)
    rows = np.real(recording.readings[recording.untouched])
    if not len(rows):
        raise ValueError(f"{recording.source}: no frame is untouched; leave `touch` empty in rows without a touch.")
    volts = np.where(dead_readings(recording), np.nan, mean_frame(rows))
    frame = Untouched(asked, volts.reshape(asked.shape), sensor.kind == "voltage")
    _check_left(frame)
    return frame


def _check_left(frame: Untouched) -> None:
    """ValueError where a frame has too little to judge a calibration by."""
    asked = frame.of(np.asarray(np.isfinite(frame.volts).any(axis=1))).asked
    if len(np.unique(driven(asked), axis=0)) < 2:
        raise ValueError("[drive] has one drive alone, and a calibration is judged on drives that were not fitted.")
    if not frame.volts[frame.off_driven].any():
        raise ValueError("no reading uses electrodes without current alone, and a calibration is judged by those.")


def check_electrodes(sensor: Sensor) -> None:
    """ValueError where the instrument model is not built for a sensor's electrodes."""
    if not sensor.electrodes.along_edge:
        raise ValueError("the instrument model is not built for electrodes on the surface (kind in [electrodes]), only "
                         "for line electrodes; from labelled presses `surrogate learn` learns without it.")
    if not sensor.electrodes.over_thickness:
        raise ValueError("low_mm, high_mm in [electrodes]: the instrument model is that of a sheet, which a layer is "
                         "where electrodes cover the whole height of its rim. Leave them out where they nearly do; "
                         "from labelled presses `surrogate learn` learns without it.")
    if sensor.electrodes.missing:
        raise ValueError("the instrument model takes no missing in [electrodes]; leave it out, and leave the cells of "
                         "readings that need these electrodes empty in the recording.")


def no_ohmmeter(tests: OhmTests) -> str:
    """Why readings are not those of an ohmmeter; empty where no test says so."""
    values = {one.name: getattr(tests, one.name) for one in fields(tests)}
    apart = {name: value for name, value in values.items() if value is not None and value >= NO_OHMMETER}
    return "" if not apart else "the instrument is no ohmmeter: " + ", ".join(
        f"{_WORDS[name]} by {value:.0%} of their norm" for name, value in apart.items()) + (
        "; only changes of readings can be used.")


def untouched_readings(instrument: Instrument, state: Array, asked: Protocol, kind: str) -> Array:
    """Readings (patterns, readings) of a calibrated sensor by a protocol, V; sizes alone of magnitudes."""
    model = voltages(instrument, asked, state)
    return np.abs(model) if kind == "magnitude" else model


def _of_size(instrument: Instrument, frame: Untouched) -> Instrument:
    """The instrument with the conductance at which the model's readings have the size of the frame's."""
    where = frame.off_driven
    size = np.linalg.norm(voltages(instrument, frame.asked, instrument.prior_mean)[where])
    conductance = instrument.start_conductance_S * float(size / np.linalg.norm(frame.volts[where]))
    return replace(instrument, start_conductance_S=conductance)
