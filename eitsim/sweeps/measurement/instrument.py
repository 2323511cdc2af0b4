"""What an instrument makes of clean voltages: impedance and drift between frames, gain, offset, noise, quantisation.

Terms are independent of each other: switching one on or off leaves the draws of the others as they are. They depend on
the seed and the scene's number alone, not on the order of rows or on which of them are there.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from eitsim.scene.drive import Drive, protocol
from touchcal.arrays import Array

Indices = NDArray[np.integer]

# Voltages of a row's untouched frame that an SNR may be given of.
REFERENCES = ("largest", "rms")
CHANNELS = ("reading", "electrode")
BITS = 32
# What the draws of a term begin with; they are a scene's, or one for all scenes.
_GAIN, _OFFSET, _CONTACT, _DRIFT, _DRIFT_CHANNEL, _DRIFT_V, _DRIFT_CHANNEL_V, _NOISE = range(1, 9)
_BASELINE, _TOUCHED = range(2)
_DOMAIN = 0x6D656173  # Keeps these draws separate from those of designs, which may have the same seed.


@dataclass(frozen=True)
class Measurement:
    """An instrument, applied to clean readings; a term of 0 is switched off. Draws are normal, sizes are rms."""

    seed: int = 0  # seed of every draw
    noise_V: float = 0.0  # white noise of one frame, V; 0 where it is given by snr_db
    # 20 log10 of the reference voltage over the noise of one frame; None: the noise is noise_V
    snr_db: float | None = None
    relative_to: str | float | None = None  # that voltage: one of REFERENCES, or a number of V
    gain: float = 0.0  # relative error of each channel's gain, one draw for all scenes and frames
    offset_V: float = 0.0  # offset of each channel, V, one draw for all scenes and frames
    # relative change of all readings, and of each channel's, from the untouched frame to the touched one
    drift: float = 0.0
    drift_channel: float = 0.0
    # the same, V
    drift_V: float = 0.0
    drift_channel_V: float = 0.0
    # relative change of each electrode's contact impedance from the untouched frame to the touched one
    contact_impedance: float = 0.0
    # 2^bits steps from -full_scale_V to full_scale_V, V, beyond which readings are clipped; None: no such range
    bits: int | None = None
    full_scale_V: float | None = None
    lsb_V: float = 0.0  # or one step without a range, V
    # frames averaged, each with its own noise and quantised by itself; of the untouched one, None: as many
    frames: int = 1
    baseline_frames: int | None = None
    # whether the untouched frame has neither noise nor steps, as if averaged over very many
    clean_baseline: bool = False
    channels: str = "reading"  # what has one gain, offset and drift: every reading, or all readings of one electrode

    @property
    def step_V(self) -> float:
        """One step of the quantisation, V; 0 without one."""
        if self.bits is None or self.full_scale_V is None:
            return self.lsb_V
        return 2 * self.full_scale_V / 2**self.bits


@dataclass(frozen=True)
class Measured:
    """Readings as an instrument gives them."""

    # (rows, readings) of the touched and the untouched skin, V
    touched_V: Array
    baseline_V: Array
    clipped: NDArray[np.int64]  # (rows,) samples that were clipped at the full scale, of all frames averaged

    @property
    def signal_V(self) -> Array:
        """(rows, readings) touched minus untouched, V."""
        return self.touched_V - self.baseline_V


def measured(measurement: Measurement, touched_V: ArrayLike, baseline_V: ArrayLike, scenes: Sequence[int] | Indices, *,
             by_contact_V: ArrayLike | None = None, channels: Indices | None = None) -> Measured:
    """Clean frames (rows, readings), V, as an instrument reads them.

    b' = b (1 + gain) + offset of the untouched readings b, and of the touched ones t, with C the derivative by the
    logarithms of the contact impedances, t' = (t + C contact)(1 + drift)(1 + drift_channel)(1 + gain) + offset +
    drift_V + drift_channel_V; then of either the mean over its frames of what noise and rounding make of it. Without a
    term the values come back as they are.

    scenes: (rows,) numbers of the scenes; by_contact_V: (readings, electrodes) or (rows, readings, electrodes), V, for
    contact_impedance (contact_slopes.by_contact); channels: (readings,) number of each reading's channel (channels_of),
    by default its own. NaN stays NaN. ValueError for frames of other shapes, or where by_contact_V or channels are
    needed and missing.
    """
    touched, baseline = (np.asarray(values, dtype=float) for values in (touched_V, baseline_V))
    numbers = np.asarray(scenes, dtype=np.int64)
    if touched.ndim != 2 or touched.shape != baseline.shape or numbers.shape != touched.shape[:1]:
        raise ValueError(f"frames of shape {touched.shape} and {baseline.shape} with {numbers.size} scene numbers; "
                         "give both frames as (rows, readings), and one number a row.")
    if channels is None and measurement.channels != "reading":
        raise ValueError(f"channels = '{measurement.channels}' needs the channel of each reading; take it from "
                         "eitsim.sweeps.measurement.instrument.channels_of.")
    own = np.arange(touched.shape[1]) if channels is None else np.asarray(channels)
    noise = noise_of(measurement, baseline)
    changed = _amplified(measurement, _changed(measurement, touched, numbers, own, by_contact_V), own)
    if measurement.drift_V:
        changed = changed + measurement.drift_V * _draws(measurement, _DRIFT_V, numbers, 1)
    if measurement.drift_channel_V:
        changed = changed + measurement.drift_channel_V * _by_channel(measurement, _DRIFT_CHANNEL_V, numbers, own)
    still = _amplified(measurement, baseline, own)
    frames = measurement.frames
    touched, clipped = _read(measurement, changed, numbers, _TOUCHED, noise, frames)
    if measurement.clean_baseline:
        return Measured(touched, still, clipped)
    frames = measurement.baseline_frames or frames
    still, clipped_still = _read(measurement, still, numbers, _BASELINE, noise, frames)
    return Measured(touched, still, clipped + clipped_still)


def channels_of(measurement: Measurement, drive: Drive, count: int) -> Indices:
    """(readings,) number of each reading's channel: its own, or that of the electrode that it weighs most."""
    weights = protocol(drive, count).weights.reshape(-1, count)
    return np.arange(len(weights)) if measurement.channels == "reading" else weights.argmax(axis=1)


def noise_of(measurement: Measurement, baseline_V: Array) -> Array:
    """Rms of one frame's white noise (rows,), V, of rows with these untouched readings (rows, readings), V."""
    if measurement.snr_db is None:
        return np.full(len(baseline_V), measurement.noise_V)
    return below(measurement.snr_db, reference_of(measurement, baseline_V))


def reference_of(measurement: Measurement, baseline_V: Array) -> Array:
    """Voltage (rows,), V, that the SNR refers to; NaN where a row has no readings."""
    given = measurement.relative_to
    if isinstance(given, int | float):
        return np.full(len(baseline_V), float(given))
    there = np.isfinite(baseline_V)
    read = np.where(there, baseline_V, 0.0)
    count = np.where(there.any(axis=1), there.sum(axis=1), np.nan)
    return np.abs(read).max(axis=1) if given == "largest" else np.sqrt((read**2).sum(axis=1) / count)


def below(level_db: Any, reference_V: Any) -> Any:
    """Rms voltage, V, that lies level_db below a reference: reference 10^(-level/20)."""
    return reference_V * 10 ** (-level_db / 20)


def level_db(noise_V: float, reference_V: float) -> float:
    """How far an rms voltage lies below a reference, dB."""
    return float(20 * np.log10(reference_V / noise_V))


def _changed(measurement: Measurement, touched: Array, scenes: Indices, channels: Indices,
             by_contact_V: ArrayLike | None) -> Array:
    """Touched readings after what has changed in the skin and its electrodes since the untouched frame."""
    if measurement.contact_impedance:
        if by_contact_V is None:
            raise ValueError("contact_impedance needs the derivatives by_contact_V; take them from "
                             "eitsim.electrics.forward.untouched, or set contact_impedance = 0.")
        slopes = np.asarray(by_contact_V, dtype=float)
        draws = _draws(measurement, _CONTACT, scenes, slopes.shape[-1])
        touched = touched + measurement.contact_impedance * np.einsum("...re,...e->...r", slopes, draws)
    if measurement.drift:
        touched = touched * (1 + measurement.drift * _draws(measurement, _DRIFT, scenes, 1))
    if measurement.drift_channel:
        touched = touched * (1 + measurement.drift_channel * _by_channel(measurement, _DRIFT_CHANNEL, scenes, channels))
    return touched


def _amplified(measurement: Measurement, volts: Array, channels: Indices) -> Array:
    """Readings by channels whose gains and offsets never change."""
    if measurement.gain:
        volts = volts * (1 + measurement.gain * _by_channel(measurement, _GAIN, None, channels))
    if measurement.offset_V:
        volts = volts + measurement.offset_V * _by_channel(measurement, _OFFSET, None, channels)
    return volts


def _read(measurement: Measurement, volts: Array, scenes: Indices, which: int, noise: Array,
          frames: int) -> tuple[Array, NDArray[np.int64]]:
    """The mean (rows, readings), V, of that many noisy, quantised frames, and how many samples of them were clipped.
    """
    noisy, step = bool(np.any(noise > 0)), measurement.step_V
    clipped = np.zeros(len(volts), dtype=np.int64)
    if not step:
        mean = noise[:, None] / np.sqrt(frames)
        each = _draws(measurement, _NOISE, scenes, volts.shape[1], which, 0) if noisy else 0.0
        return (volts + mean * each if noisy else volts), clipped
    total = np.zeros_like(volts)
    for frame in range(frames if noisy else 1):
        each = _draws(measurement, _NOISE, scenes, volts.shape[1], which, frame) if noisy else 0.0
        codes = np.round((volts + noise[:, None] * each) / step)
        if measurement.bits is not None:
            half = 2 ** (measurement.bits - 1)
            clipped += np.sum((codes < -half) | (codes > half - 1), axis=1)
            codes = np.clip(codes, -half, half - 1)
        total += codes
    return total * (step / (frames if noisy else 1)), clipped


def _by_channel(measurement: Measurement, term: int, scenes: Indices | None, channels: Indices) -> Array:
    """Draws (rows or 1, readings), the same for readings of one channel."""
    return _draws(measurement, term, scenes, int(channels.max()) + 1)[:, channels]


def _draws(measurement: Measurement, term: int, scenes: Indices | None, count: int, *key: int) -> Array:
    """Standard normal draws (rows, count) of a term in each scene, or (1, count) of one that all scenes share."""
    keys = [(term, 0)] if scenes is None else [(term, int(scene) + 1, *key) for scene in scenes]
    return np.stack([np.random.default_rng(np.random.SeedSequence(measurement.seed, spawn_key=(_DOMAIN, *one))
                                           ).standard_normal(count) for one in keys])
