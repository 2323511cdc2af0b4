"""What speaks against the kind in which a record was taken, or against the unit of its strain."""

import numpy as np

from matcal.readers.recording import Recording
from matcal.readers.shear_angle import is_angle
from matcal.reduction.loading_direction import named_direction
from matcal.reduction.test_kind import named_kind
from touchcal.errors import InputFileError

_NOISE = 0.02  # share of the range of a column below 0 that its noise may be above it
_LARGE = 1.0  # strain from which on one without a unit may as well be in per cent
# kinds that are one loading each, of which a name can name another
_MODES = ("uniaxial", "biaxial", "planar", "shear", "volumetric")


def doubts(kind: str, recording: Recording) -> list[str]:
    """Cautions about a record that was taken as `kind`. InputFileError where it is of another kind for sure."""
    return [*_of_unit(kind, recording), *_of_name(kind, recording), *_of_shear(kind, recording)]


def _of_unit(kind: str, recording: Recording) -> list[str]:
    strain, name = recording.columns.get("strain"), recording.names.get("strain", "")
    if strain is None:
        return []
    unit = recording.units.get("strain", "")
    if is_angle(unit) and kind != "shear":
        raise InputFileError(recording.paths[0], f"column '{name}' is an angle ({unit}), which a {kind} test has not. "
                                                 "Give the test as shear=FILE, or choose another column of strain.")
    reach = float(np.max(np.abs(strain)))
    if unit or recording.vendor == "arrays" or kind == "volumetric" or not reach > _LARGE or (
            "displacement" in recording.columns):
        return []
    return [f"Column '{name}' of {recording.label} has no unit and reaches {reach:.3g}: it was read as a ratio, "
            f"{100 * reach:.3g} %. If it is in per cent, every modulus is 100 times larger: give it with --columns "
            f"strain={name}:% (or strain={name}:- to say that it is a ratio)."]


def _of_name(kind: str, recording: Recording) -> list[str]:
    """A name that says another mode than the one given."""
    named = named_kind(recording)
    if kind not in _MODES or named not in _MODES or named == kind or (
            named == "uniaxial" and kind in ("planar", "biaxial")):
        return []
    return [f"{recording.label} was taken as {kind}, as given, and its name says {named}."]


def _of_shear(kind: str, recording: Recording) -> list[str]:
    """Columns of compression or tension, or signs of compression, in a test that was taken as shear."""
    if kind != "shear":
        return []
    named = named_direction([*recording.names.values()])
    if named is not None:
        return [f"{recording.label} was taken as shear, and its columns are named after {named}."]
    strain, stress = (recording.columns.get(q) for q in ("strain", "stress"))
    if strain is not None and stress is not None and -1 < strain.min() < 0 and all(
            column.max() <= -_NOISE * column.min() for column in (strain, stress)):
        return [f"{recording.label} was taken as shear, and its strain and stress are negative throughout, as those of "
                "compression are."]
    return []
