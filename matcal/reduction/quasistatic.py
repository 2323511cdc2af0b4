"""Slow loading: uniaxial (ISO 3386-1), lap shear (ISO 1827), equibiaxial and planar sheets, volumetric tests."""

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.experiment import Experiment
from matcal.reduction.load_frame import FEW_ROWS, correct
from matcal.reduction.loading_doubts import hold_doubts
from matcal.reduction.specimen import Block
from matcal.statistics.block_means import block_means, equal_blocks
from touchcal.errors import InputFileError

_FEWEST = 10  # samples of a loading, at least
_POINTS, _TOE_STRAIN = 200, 0.01  # points left of a loading, and the strain below which the toe is not the material's


def reduce_quasistatic(kind: str, recording: Recording, block: Block, branch: str = "last") -> Experiment:
    """Nominal stress against nominal strain of one loading, thinned to means of equally many samples.

    Uniaxial: stress = force/area, strain = travel/height. Shear: stress = force over all faces, gamma =
    travel/thickness (paper, section 3.1). Equibiaxial and planar: stress = force/(width x thickness), strain =
    travel/length of one axis. Volumetric: J = 1 + travel/length and the mean stress, see `specimen.Block`. `branch` is
    the loading of a cyclic test that is used, one of `branches.BRANCHES`. The state of rest at contact is the first
    point, so that a history that starts there can be convolved. Raises InputFileError as
    `matcal.reduction.load_frame.correct`.
    """
    record = correct(kind, recording, block, branch)
    strain, stress = record.strain[:record.end + 1], record.stress_Pa[:record.end + 1]
    if strain.size < _FEWEST:
        raise InputFileError(recording.paths[0], f"only {strain.size} samples lie in the loading from contact on; "
                                                 f"{_FEWEST} are needed. Give more of them. {FEW_ROWS}")
    time = None if record.time_s is None else record.time_s[:record.end + 1]
    warned = (*record.cautions, *hold_doubts(recording.label, time, strain, stress))
    toe = int(np.argmax(np.abs(strain) >= _TOE_STRAIN)) if record.from_rest else 0
    edges = toe + equal_blocks(strain.size - toe, _POINTS)
    size = int(edges[1] - edges[0])
    rest = [0.0] if record.from_rest else []
    e, p = (np.concatenate([rest, block_means(x, edges)]) for x in (strain, stress))
    time = None if record.time_s is None else np.concatenate([rest, block_means(record.time_s[:strain.size], edges)])
    if kind == "volumetric":
        e, p = 1 + e, block.mean_share * p
    left = f"Strains below {_TOE_STRAIN:.0%} left out as toe, the state of rest put first; " if record.from_rest else ""
    said = (f"{left}{'means' if left else 'Means'} of {size} samples, {e.size - len(rest)} points.",)
    return Experiment(kind=kind, strain=e, value=p, time_s=time, source=tuple(p.name for p in recording.paths),
                      noise=block.mean_share * record.noise_Pa / np.sqrt(size), cycles=record.cycles, path=record.path,
                      decisions=record.decisions + said, cautions=warned,
                      facts={**record.facts, "samples_per_point": float(size)})
