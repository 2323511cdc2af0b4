"""A trained surrogate as users have it: it predicts arrays of voltages and is kept in a folder."""

import warnings
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from eitsim.scene.scene import Scene
from surrogate.data.baseline_frame import compared, untouched
from surrogate.data.frame_drift import frame_drift
from surrogate.data.reading_noise import white_noise
from surrogate.model import store
from surrogate.model.assumed_punch import assumed_punch
from surrogate.model.holding_time import holding_caution
from surrogate.model.missing_channels import silent, stuck
from surrogate.model.predict import predict, prepare, si_table
from surrogate.model.trained import TrainedModel
from touchcal.arrays import Array


@dataclass(frozen=True)
class Model(TrainedModel):
    """A learner for some outputs of one sensor, made by `train` or `load`."""

    def predict(self, frames_V: ArrayLike, baseline_V: ArrayLike | None = None, *,
                noise_V: float | None = None, scale_baseline: str = "auto",
                held_s: float | None = None, gain_drift: float = 0.0, contact_drift: float = 0.0,
                scene: Scene | None = None) -> pd.DataFrame:
        """Read a touch from each frame of voltages.

        Parameters
        ----------
        frames_V : (n, readings), (readings,) or (patterns, readings of one)
            Voltages of touched frames, V, in the order of the sensor's protocol. NaN is a dead channel.
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
        >>> model = surrogate.load("forward")                                   # doctest: +SKIP
        >>> model.predict(frames_V, baseline_V)[["x0_m", "y0_m", "F_N"]]        # doctest: +SKIP
        """
        frames = self._frames("frames_V", frames_V)
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

    def _frames(self, name: str, volts: ArrayLike) -> Array:
        found, count = np.asarray(volts, np.float64), len(self.baseline_V)
        patterns = len(np.unique(np.column_stack([self.ring.source, self.ring.sink]), axis=0))
        if found.shape[-1:] != (count,) and found.shape[-2:] != (patterns, count // patterns):
            raise ValueError(f"{name} has the shape {found.shape}; expected (n, {count}) volts, a row a frame of the "
                             "trained sensor, or patterns by readings.")
        return found.reshape(-1, count)


def load(folder: Path | str) -> Model:
    """Read a model that `Model.save` or `surrogate train` wrote.

    Parameters
    ----------
    folder : path
        Folder of the model.

    Returns
    -------
    Model

    Raises
    ------
    InputFileError
        Where the folder holds no model, one of another schema, or a damaged one.
    """
    return store.read(Model, Path(folder))
