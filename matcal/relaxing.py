"""A fast ramp and a hold: relaxation in compression (ISO 3384-1)."""

from __future__ import annotations

import numpy as np

from matcal.errors import TestFileError
from matcal.experiment import Experiment
from matcal.loading import correct
from matcal.readers.recording import Recording
from matcal.specimen import Block
from matcal.thinning import block_means, log_blocks

# points left of the hold, and the strain below which the toe is not the material's
_POINTS, _TOE_STRAIN = 120, 0.01


def reduce_relaxation(recording: Recording, block: Block) -> Experiment:
    """Nominal stress against time of a ramp and its hold, with the strain history that belongs to it.

    The ramp keeps every sample: its stress is far from linear in time for a foam that densifies, so a fit should
    convolve the whole history rather than assume a step or a linear ramp. The hold is thinned to means of blocks equal
    in log time, `samples` says of how many. Raises TestFileError as `matcal.loading.correct`, and where there is no
    clock or no hold.
    """
    record = correct("relaxation", recording, block)
    path, time = recording.paths[0], record.time_s
    if time is None:
        raise TestFileError(path, f"a relaxation needs a time column; found: {', '.join(recording.names.values())}.")
    ramp_s = float(time[record.end])
    if time[-1] < 2 * ramp_s:
        raise TestFileError(path, f"the record ends {time[-1] - ramp_s:.3g} s after a ramp of {ramp_s:.3g} s, so there "
                                  "is no hold to fit. Give the whole test.")
    toe = int(np.argmax(np.abs(record.strain) >= _TOE_STRAIN))
    edges = np.concatenate([np.arange(toe, record.end), record.end + log_blocks(time[record.end:], _POINTS)])
    t, e, p = (np.concatenate([[0.0], block_means(x, edges)]) for x in (time, record.strain, record.stress_Pa))
    samples = np.concatenate([[1.0], np.diff(edges)])
    hold = record.strain[record.end:]
    facts = {**record.facts, "ramp_s": ramp_s, "hold_s": float(time[-1] - ramp_s),
             "hold_strain": float(hold.mean()), "hold_strain_change": float(hold[-1] - hold[0])}
    said = (f"Ramp of {ramp_s:.3f} s kept sample by sample from a strain of {_TOE_STRAIN:.0%}, hold of "
            f"{facts['hold_s']:.1f} s thinned to {t.size - 1 - (record.end - toe)} means equal in log time, the state "
            f"of rest put first; the hold strain is {facts['hold_strain']:.4f} and changes by "
            f"{facts['hold_strain_change']:.1g} over the hold.",)
    return Experiment(kind="relaxation", strain=e, value=p, time_s=t, samples=samples, noise=record.noise_Pa,
                      source=tuple(p.name for p in recording.paths), decisions=record.decisions + said, facts=facts)
