"""Slow loading of a block: uniaxial compression or tension (ISO 3386-1) and lap shear (ISO 1827)."""

from __future__ import annotations

import numpy as np

from matcal.experiment import Experiment
from matcal.loading import correct
from matcal.readers.recording import Recording
from matcal.specimen import Block
from matcal.thinning import block_means, equal_blocks

# points left of a loading, and the strain below which the toe is not the material's
_POINTS, _TOE_STRAIN = 200, 0.01


def reduce_quasistatic(kind: str, recording: Recording, block: Block) -> Experiment:
    """Nominal stress against nominal strain of the first loading, thinned to means of equally many samples.

    Uniaxial: stress = force/area, strain = travel/height. Shear: stress = force over all faces, gamma =
    travel/thickness (paper, section 3.1). The state of rest at contact is the first point, so that a history that
    starts there can be convolved. Raises TestFileError as `matcal.loading.correct`.
    """
    record = correct(kind, recording, block)
    strain, stress = record.strain[:record.end + 1], record.stress_Pa[:record.end + 1]
    toe = int(np.argmax(np.abs(strain) >= _TOE_STRAIN))
    edges = toe + equal_blocks(strain.size - toe, _POINTS)
    size = int(edges[1] - edges[0])
    e, p = (np.concatenate([[0.0], block_means(x, edges)]) for x in (strain, stress))
    time = None if record.time_s is None else np.concatenate([[0.0], block_means(record.time_s, edges)])
    said = (f"Strains below {_TOE_STRAIN:.0%} left out as toe, the state of rest put first; means of {size} samples, "
            f"{e.size - 1} points.",)
    return Experiment(kind=kind, strain=e, value=p, time_s=time, source=tuple(p.name for p in recording.paths),
                      noise=record.noise_Pa / np.sqrt(size), decisions=record.decisions + said,
                      facts={**record.facts, "samples_per_point": float(size)})
