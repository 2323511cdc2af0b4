"""A trained model of a sweep as users have it: it predicts arrays of voltages and is kept in a folder."""

import warnings
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from eitsim.scene.scene import Scene
from surrogate.data import outputs
from surrogate.data.baseline_frame import compared, untouched
from surrogate.data.frame_drift import by_gain, frame_drift
from surrogate.data.reading_noise import white_noise
from surrogate.data.sensor_ring import Ring
from surrogate.learners.registry import METHODS
from surrogate.model import sticking, store
from surrogate.model.assumed_punch import assumed_punch
from surrogate.model.holding_time import holding_caution
from surrogate.model.missing_channels import silent, stuck
from surrogate.model.predict import lost_words, predict, prepare, si_table
from surrogate.model.trained import Calibration, Range, Rows, TrainedModel, estimate
from touchcal.array_store import Arrays, flat, rebuilt
from touchcal.arrays import Array
from touchcal.document import Keys, Number

_COUNT = Number(0, 1e15, whole=True)
_ROWS = Keys(allowed={"rows": _COUNT, "cards": _COUNT, "measurement": dict, "split": {str: _COUNT}})
_SHAPE = store.shape_of({"outputs": [Keys({"name": str})], "dataset": _ROWS, "training": dict},
                        {"calibration": _ROWS, "relaxation": dict, "versions": {str: str}})


@dataclass(frozen=True)
class SweepModel(TrainedModel):
    """A learner for some outputs of one sensor, made by `train` or `load`."""

    kind: ClassVar[str] = "voltage"  # of the readings
    LEARNT_FROM: ClassVar[str] = "sweep"
    SHAPE: ClassVar[Keys] = _SHAPE

    def predict(self, frames_V: ArrayLike, baseline_V: ArrayLike | None = None, *,
                noise_V: float | None = None, scale_baseline: str = "auto",
                held_s: float | None = None, gain_drift: float = 0.0, contact_drift: float = 0.0,
                scene: Scene | None = None) -> pd.DataFrame:
        """Read a touch from each frame of voltages.

        Parameters
        ----------
        frames_V : (n, readings), (readings,) or (patterns, readings of one)
            Voltages of touched frames, V, in the order of the sensor's protocol. NaN is a dead channel, and one that
            sticks at a value to the last frame, while most others change, is taken for one.
        baseline_V : (readings,) or (k, readings), optional
            The untouched frame, V, or several, whose mean is taken; the mean one of the training where left out.
        noise_V : float, optional
            Standard deviation of one reading, V, of independent noise. Where left out, the noise follows from the
            scatter of two or more untouched frames, from 8 on with what their readings share; with fewer, intervals
            leave noise out.
        scale_baseline : "auto", "yes" or "no"
            Whether all readings are multiplied by the training's untouched ones over those of `baseline_V`, which takes
            out gains and the sheet's conductance; "auto": where factors of readings explain what differs by more than
            noise. What is found and done is warned of.
        held_s : float, optional
            Time since loading, s, for which the foam has relaxed: F, sigma_max and sigma_ave are those then. Where left
            out they are those of the training, long-term ones as a rule.
        gain_drift, contact_drift : float
            Standard deviations of the relative changes of the channels' gains against ground and of the contact
            impedances between the untouched and the touched frames; method forward.
        scene : Scene, optional
            The sensor's scene, for contact_drift.

        Returns
        -------
        pandas.DataFrame
            One row a frame. For each output, in SI units: the value, as `x0_m`, and the lowest and highest of its 90 %
            interval, as `x0_lo90_m` and `x0_hi90_m`; NaN where no touch can be read. Where the method says what a
            force's error is due to, its standard deviations `F_sd_noise_N`, `F_sd_material_N`, `F_sd_model_N`. Last,
            `flag`: in words what is to be known of the frame, else empty. `attrs["assumes"]` says which punch all
            answers assume; another one may not be noticed.

        Raises
        ------
        ValueError
            For frames of another number of readings, a noise that is no finite number from 0, another word for
            scale_baseline, a drift that `frame_drift` refuses, or a holding time that the model has no relaxation for.

        Examples
        --------
        >>> model = surrogate.load("model")
        >>> model.predict(frames_V, baseline_V)[["x0_m", "y0_m", "F_N"]].shape
        (5, 3)
        """
        frames = sticking.off(self._frames("frames_V", frames_V))
        reference = self._frames("baseline_V", self.baseline_V if baseline_V is None else baseline_V)
        dead = stuck(frames) | stuck(reference) | silent(reference, self.baseline_V).any(axis=0)
        known = untouched(reference, self.ring)
        white = white_noise(noise_V or 0.0, len(known.volts))
        noise = white if noise_V is not None or known.noise is None else known.noise
        found = compared(self.baseline_V, self.ring, known.volts, noise.rms_V, scale_baseline)
        for words in filter(None, (found.words, holding_caution(self, held_s))):
            warnings.warn(words, stacklevel=2)
        drift = frame_drift(self.ring, self.baseline_V, gain_drift, contact_drift, scene)
        ready = prepare(self, known.volts * found.gain, noise.scaled(found.gain), dead, held_s=held_s,
                        drift=drift)
        if words := lost_words(ready, frames):
            warnings.warn(words, stacklevel=2)
        table = si_table(self, predict(ready, frames * found.gain))
        table.attrs["assumes"] = assumed_punch(self)
        return table

    def save(self, folder: Path | str) -> None:
        """Write the model as a folder that `load` reads; nothing in it is ever executed.

        Parameters
        ----------
        folder : path
            Folder to write, made where it is missing.
        """
        store.save(self, Path(folder))

    def described(self) -> dict[str, Any]:
        """What model.json says."""
        return {"outputs": [{"name": n, "unit": u} for n, u in zip(self.names, self.units, strict=True)], **self.record}

    def arrays(self) -> Arrays:
        """What arrays.npz holds."""
        parts = {name: getattr(self, name) for name in ("ring", "learner", "calibration", "rows", "trained",
                                                        "baseline_V")}
        return {key: value for name, part in parts.items() for key, value in flat(part, name)}

    @classmethod
    def assembled(cls, text: Mapping[str, Any], arrays: Arrays) -> Self:
        """The inverse of both; an error of any kind where parts do not fit each other: their shapes are checked, and
        one of the calibrating rows is read."""
        own = ("schema", "learnt_from", "method", "outputs", "seed", "fit_s")
        names = tuple(output["name"] for output in text["outputs"])
        if not names or names != outputs.chosen(names):
            raise ValueError(f"its outputs {', '.join(names)} are not some of {', '.join(outputs.NAMES)}, in that "
                             "order")
        model = cls(text["method"], rebuilt(Ring, "ring", arrays), names,
                    rebuilt(METHODS[text["method"]].learner(), "learner", arrays),
                    rebuilt(Calibration, "calibration", arrays), rebuilt(Rows, "rows", arrays),
                    rebuilt(Range, "trained", arrays), arrays["baseline_V"], text["seed"], text["fit_s"],
                    {key: value for key, value in text.items() if key not in own})
        _try_out(model)
        return model

    def _frames(self, name: str, volts: ArrayLike) -> Array:
        found, count = np.asarray(volts, np.float64), len(self.baseline_V)
        patterns = len(np.unique(np.column_stack([self.ring.source, self.ring.sink]), axis=0))
        if found.shape[-1:] != (count,) and found.shape[-2:] != (patterns, count // patterns):
            raise ValueError(f"{name} has the shape {found.shape}; expected (n, {count}) volts, a row a frame of the "
                             "trained sensor, or patterns by readings.")
        return found.reshape(-1, count)


def _try_out(model: TrainedModel) -> None:
    ring, rows, span = model.ring, model.calibration, model.trained
    readings, each, count = ring.read.shape, (len(model.names),), len(rows.target)
    for name, part, shape in (("baseline_V", model.baseline_V, readings),
                              ("signals", rows.signal_V, (max(count, 1), *readings)),
                              ("targets", rows.target, (max(count, 1), *each)),
                              ("errors of signals", rows.signal_sd, (max(count, 1),)),
                              ("lowest", span.lowest, each), ("highest", span.highest, each),
                              ("weakest", np.array(span.weakest_V), ()), ("misfit", np.array(span.misfit), ())):
        if part.shape != shape or part.dtype.kind != "f" or not np.isfinite(part).all():
            raise ValueError(f"{name} holds {part.dtype} {part.shape} and not finite numbers {shape}")
    if ring.angle_rad.ndim != 1 or ring.angle_rad.dtype.kind != "f" or not np.isfinite(ring.angle_rad).all():
        raise ValueError("the angles of its electrodes are no finite numbers")
    for ends in (ring.source, ring.sink, ring.read, ring.ground):
        if ends.shape != readings or ends.dtype.kind != "i" or not np.isin(ends, np.arange(len(ring.angle_rad))).all():
            raise ValueError("its readings are not of its electrodes")
    with np.errstate(all="ignore"):
        found, gains = estimate(model, rows.signal_V[:1]), np.zeros(0)
        with suppress(ValueError):  # some untouched frames foresee no drift of gains
            gains = by_gain(ring, model.baseline_V)
    if {part.shape for part in (found.value, found.sd, found.below, found.above)} != {(min(count, 1), *each)}:
        raise ValueError("its learner has other outputs")
    if not (np.isfinite(found.value).all() and np.isfinite(gains).all()):
        raise ValueError("its learner, or its electrodes, give no finite numbers")
    holding_caution(model, None)
