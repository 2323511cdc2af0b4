"""Whether a specimen's sizes can belong to a record, before anything is made of both."""

import numpy as np

from matcal.readers.recording import Recording
from matcal.reduction.specimen import Block
from matcal.reduction.stroke_segments import Stroke
from matcal.statistics.block_means import sample_noise
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.number_words import percent

# a loading that ends below is no test of foam, nor is one above the next, nor a stress above, Pa
_LEAST_STRAIN, _LARGEST_STRAIN, _LARGEST_STRESS = 0.03, 20.0, 1e9
# what a usual frame with its load cell gives, m/N, and the share of the travel from which on it matters
_FRAME_m_per_N, _MATTERS = 1e-6, 0.01
# kind -> keys of the specimen's table behind its length and its area
_KEYS = {"shear": ("thickness_mm", "faces, length_mm and width_mm"), "volumetric": ("height_mm or volume_mm3",
         "diameter_mm or piston_diameter_mm"), "biaxial": ("length_mm", "width_mm and thickness_mm"),
         "planar": ("length_mm", "width_mm and thickness_mm")}
_DISC = ("height_mm", "diameter_mm or width_mm and depth_mm")


def fix_of_sizes(kind: str) -> str:
    """The keys of the specimen's table that a record of `kind` depends on, in words."""
    length, area = _KEYS.get(kind, _DISC)
    return f"{length}, {area} and compliance_mm_per_N"


def check_sizes(kind: str, recording: Recording, block: Block, stroke: Stroke, load: Array, sign: float) -> None:
    """InputFileError where the whole travel is no strain, where the travel under load is more than the specimen has,
    where the frame would give more than the travel, or where the stress is more than that of any foam. `load` (n,), N,
    grows in the direction of loading; `sign` is -1 for compression."""
    length, area = _KEYS.get(kind, _DISC)
    moving = slice(stroke.start, stroke.end + 1)
    travel, rise = stroke.travel[moving], load[moving] - float(np.median(load[:max(stroke.start, 1)]))
    reach, top = float(travel[-1] - travel[0]), float(np.max(rise))
    given = block.compliance_m_per_N * top
    if given > reach:
        raise _error(recording, f"the frame would give {given * 1e3:.3g} mm under {top:.3g} N, more than the whole "
                                f"travel of {reach * 1e3:.3g} mm. Check compliance_mm_per_N = "
                                f"{block.compliance_m_per_N * 1e3:g}: it is in mm/N.")
    if reach / block.length_m < _LEAST_STRAIN:
        raise _error(recording, f"the whole travel of {reach * 1e3:.3g} mm is a strain of {reach / block.length_m:.2g} "
                                f"of a length of {block.length_m * 1e3:.4g} mm. Check {length}, in mm, and the unit of "
                                "the displacement.")
    clear = np.flatnonzero(rise > max(0.1 * top, 6 * sample_noise(load)))
    loaded = (float(travel[-1] - travel[clear[0]]) - given) / block.length_m if clear.size else 0.0
    if loaded > (1.0 if sign < 0 else _LARGEST_STRAIN):
        raise _error(recording, f"under load it travels {loaded:.3g} times the length of {block.length_m * 1e3:.4g} "
                                f"mm. Check {length}, in mm, the direction, and the unit of the displacement.")
    if top / block.area_m2 > _LARGEST_STRESS:
        raise _error(recording, f"{top:.3g} N on {block.area_m2 * 1e6:.3g} mm2 are {top / block.area_m2 / 1e6:.3g} "
                                f"MPa, more than any foam bears. Check {area}, in mm, and the unit of the force.")


def compliance_doubt(recording: Recording, block: Block) -> list[str]:
    """What is said of a stiff specimen whose strain is the travel of a frame of unknown compliance."""
    if block.compliance_stated or not {"displacement", "force"} <= set(recording.columns):
        return []
    force, travel = (float(np.ptp(recording.columns[q])) for q in ("force", "displacement"))
    share = _FRAME_m_per_N * force / travel if travel > 0 else 0.0
    if share < _MATTERS:
        return []
    return [f"What the frame gives is not known for {recording.label}: a frame of {_FRAME_m_per_N * 1e3:g} mm/N, which "
            f"many are, makes {percent(share, 2)} of its largest travel, and the law is softer by as much. Press the "
            "plates on each other, and give compliance_mm_per_N in the specimen file (0 where the travel is without "
            "it)."]


def check_reach(kind: str, recording: Recording, strain: float) -> None:
    """InputFileError where a loading ends at a strain that no test of foam ends at."""
    if strain <= -1 or abs(strain) < _LEAST_STRAIN:
        raise _error(recording, f"the loading ends at a strain of {strain:.3g}. Check the sizes of the specimen "
                                f"({fix_of_sizes(kind)}) and the unit of the displacement.")


def _error(recording: Recording, problem: str) -> InputFileError:
    return InputFileError(recording.paths[0], problem)
