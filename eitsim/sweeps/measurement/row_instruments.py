"""What as many instruments as rows make of clean frames: each row has levels of its own, all rows at once.

Terms are those of `eitsim.sweeps.measurement.instrument`, without quantisation, and two of the electrodes themselves:
how far their contact impedances differ, and that they lie elsewhere, which is the frames' own.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from eitsim.sweeps.measurement.instrument import below
from touchcal.arrays import Array

# Level of a term -> what it is; all are standard deviations but the last, a probability.
LEVELS = {
    "snr_db": "r.m.s. of the untouched readings over the noise of one reading of one frame, dB",
    "noise_V": "noise of one reading of one frame, V",
    "gain": "relative error of each reading's gain, in both frames",
    "offset_V": "offset of each reading, in both frames, V",
    "contact_spread": "relative deviation of each electrode's contact impedance, in both frames",
    "contact_impedance": "relative change of each electrode's contact impedance between the frames",
    "position_mm": "distance of each electrode from its place along the rim, mm",
    "drift": "relative change of all readings between the frames",
    "drift_channel": "relative change of each reading between the frames",
    "dead": "probability that a reading is dead, NaN in both frames",
}
CONTACTS = ("contact_spread", "contact_impedance")  # those that need derivatives by the contact impedances


@dataclass(frozen=True)
class RowFrames:
    """Frames as the instrument of each row gives them."""

    # (rows, readings), V
    touched_V: Array
    untouched_V: Array
    noise_V: Array  # (rows,) noise of one reading of one frame, V


def measured_by_rows(levels: Mapping[str, Array], touched_V: Array, untouched_V: Array,
                     generator: Callable[[str], np.random.Generator], by_contact_V: Array | None = None) -> RowFrames:
    """Clean frames (rows, readings), V, as b' = (b + C spread)(1 + gain) + offset + noise, and of the touched ones
    t' = (t + C (spread + contact))(1 + drift)(1 + drift_channel)(1 + gain) + offset + noise.

    levels: level of LEVELS -> (rows,) values, a term that is missing is none; generator: the stream of each term, so
    that switching one leaves the draws of others; by_contact_V: (readings, electrodes) C, V.
    """
    def normal(term: str, columns: int, stream: str = "") -> Array:
        return levels[term][:, None] * generator(stream or term).standard_normal((len(touched_V), columns))

    readings = touched_V.shape[1]
    touched, still = touched_V, untouched_V
    if by_contact_V is not None:
        for term in CONTACTS:
            if term in levels:
                moved = normal(term, by_contact_V.shape[1]) @ by_contact_V.T
                touched = touched + moved
                still = still + moved if term == "contact_spread" else still
    if "drift" in levels:
        touched = touched * (1 + normal("drift", 1))
    if "drift_channel" in levels:
        touched = touched * (1 + normal("drift_channel", readings))
    if "gain" in levels:
        gain = 1 + normal("gain", readings)
        touched, still = touched * gain, still * gain
    if "offset_V" in levels:
        offset = normal("offset_V", readings)
        touched, still = touched + offset, still + offset
    noise = levels.get("noise_V", np.zeros(len(touched)))
    if "snr_db" in levels:
        noise = np.hypot(noise, below(levels["snr_db"], np.sqrt(np.mean(untouched_V**2, axis=1))))
    if np.any(noise):
        each = generator("noise")
        touched, still = (one + noise[:, None] * each.standard_normal(one.shape) for one in (touched, still))
    if "dead" in levels:
        dead = generator("dead").random(touched.shape) < levels["dead"][:, None]
        touched, still = (np.where(dead, np.nan, one) for one in (touched, still))
    return RowFrames(touched, still, noise)
