"""What a measurement means for a data set: its noise against every voltage that an SNR may be given of."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import pandas as pd

from eitsim.scene.drive import voltage_columns
from eitsim.sweeps.measurement.instrument import Array, Measurement, level_db, noise_of, reference_of
from touchcal.number_words import counted

_MUCH_CLIPPED = 0.01  # Part of the samples from which on clipping is warned of.


@dataclass(frozen=True)
class NoiseSummary:
    """What a measurement means for a data set; rms over the readings of its ok rows, V, unless a comment says more."""

    # ok rows
    rows: int
    baseline_rms_V: float
    # largest absolute reading of an untouched frame
    baseline_largest_V: float
    signal_rms_V: float
    # noise of one frame, and the voltage that an SNR refers to, means over the rows; None where no SNR is given
    noise_V: float
    reference_V: float | None
    signal_noise_V: float  # noise of the signal: of both frames, after averaging
    signal_error_V: float  # everything that the measurement changes of the signals
    step_V: float  # step of the quantisation; 0 without one
    # samples clipped at the full scale, and part of all
    clipped: int
    clipped_share: float


def volts(rows: pd.DataFrame) -> tuple[Array, Array]:
    """Touched readings and signals (rows, readings), V."""
    count = sum(name.startswith("dv_") for name in rows.columns)
    touched, signal = (rows[voltage_columns(count, prefix)].to_numpy(np.float64, copy=True) for prefix in ("v", "dv"))
    return touched, signal


class Sums:
    """Sums over the ok rows of parts, one after the other."""

    def __init__(self) -> None:
        self.all_rows = self.rows = self.readings = self.clipped = 0
        self.largest = 0.0
        # squares of baseline, signal, noise of the signal, error of the signal; noise and reference, one a row
        self.squares, self.means = np.zeros(4), np.zeros(2)

    def add(self, measurement: Measurement, clean: pd.DataFrame, found: pd.DataFrame) -> None:
        ok = (clean["outcome"] == "ok").to_numpy()
        touched, signal = volts(clean.loc[ok])
        baseline, noise = touched - signal, noise_of(measurement, touched - signal)
        averaged = 0.0 if measurement.clean_baseline else 1 / (measurement.baseline_frames or measurement.frames)
        carried = noise**2 * (1 / measurement.frames + averaged)
        error = volts(found.loc[ok])[1] - signal
        read = np.isfinite(signal)
        self.squares += [np.nansum(baseline**2), np.nansum(signal**2), carried @ read.sum(axis=1), np.nansum(error**2)]
        self.means += [noise.sum(), np.nansum(reference_of(measurement, baseline))
                       if measurement.snr_db is not None else 0.0]
        self.largest = max(self.largest, float(np.nanmax(np.abs(baseline), initial=0.0)))
        self.all_rows, self.rows = self.all_rows + len(clean), self.rows + int(ok.sum())
        self.readings += int(read.sum())
        self.clipped += int(found["clipped"].to_numpy().sum())

    def summary(self, measurement: Measurement) -> NoiseSummary:
        baseline, signal, carried, error = np.sqrt(self.squares / max(self.readings, 1)).tolist()
        noise, reference = (self.means / max(self.rows, 1)).tolist()
        return NoiseSummary(self.rows, baseline, self.largest, signal, noise,
                            reference if measurement.snr_db is not None else None, carried, error, measurement.step_V,
                            self.clipped, self.clipped / max(self._samples(measurement), 1))

    def _samples(self, measurement: Measurement) -> int:
        """Readings of all frames, which are the same without noise and then read once."""
        still = 0 if measurement.clean_baseline else measurement.baseline_frames or measurement.frames
        counts = (measurement.frames, still)
        return self.readings * sum(count if self.means[0] > 0 else min(count, 1) for count in counts)


def in_words(made: NoiseSummary) -> str:
    """What a measurement means, its SNR of every voltage that it may be given of."""
    lines = [f"untouched readings {made.baseline_rms_V:.4g} V rms, {made.baseline_largest_V:.4g} V at most; signals dV "
             f"{made.signal_rms_V:.4g} V rms ({made.rows} ok rows)"]
    if made.noise_V > 0:
        of = {"the largest untouched reading": made.baseline_largest_V, "the untouched rms": made.baseline_rms_V,
              "the signals' rms": made.signal_rms_V}
        stated = "" if made.reference_V is None else f" (stated of {made.reference_V:.4g} V)"
        lines.append(f"noise of one frame {made.noise_V:.3g} V rms{stated}: " + ", ".join(
            f"{level_db(made.noise_V, volts):.1f} dB below {name}" for name, volts in of.items() if volts > 0))
        lines.append(f"noise of dV, both frames after averaging, {made.signal_noise_V:.3g} V rms: "
                     f"{level_db(made.signal_noise_V, made.signal_rms_V):.1f} dB below the signals' rms")
    if made.signal_error_V > 0:
        lines.append(f"all terms change dV by {made.signal_error_V:.3g} V rms: "
                     f"{level_db(made.signal_error_V, made.signal_rms_V):.1f} dB below the signals' rms")
    if made.step_V:
        lines.append(f"steps of {made.step_V:.3g} V; {counted(made.clipped, 'sample')} clipped at the full scale "
                     f"({100 * made.clipped_share:.3g} % of all)")
    return "\n".join([*lines, *_cautions(made)])


def _cautions(made: NoiseSummary) -> Iterator[str]:
    """What is right to ask for and seldom meant."""
    if made.signal_error_V == 0 and made.rows:
        yield "caution: every term is off, or changes nothing: these rows are the clean ones"
    if made.noise_V > made.baseline_largest_V > 0:
        yield ("caution: the noise of one frame is larger than every untouched reading; is noise_V in V, and snr_db "
               "above 0?")
    if made.clipped_share > _MUCH_CLIPPED:
        yield ("caution: so many clipped samples tell the full scale and not the touch; give a full_scale_V above "
               f"{made.baseline_largest_V:.3g} V")
