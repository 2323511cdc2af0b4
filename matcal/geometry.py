"""Which sizes belong to a test: those given, the file's own, or a TOML beside it; and what to do where they differ."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from matcal.errors import TestFileError
from matcal.readers.recording import Recording
from matcal.specimen import Block, Strip, read_specimen, sheet

# sizes that differ by less are one
_SAME = 0.01


def specimen_of(kind: str, recording: Recording,
                given: Path | None) -> tuple[Block | Strip, tuple[str, ...], tuple[Path, ...]]:
    """Sizes for `kind`, sentences that say where they are from, and the files that were used.

    `given` comes first, and a file that states other sizes is mentioned. Without it a TOML of the file's name, else
    specimen.toml beside it, serves together with the file's own sizes where these agree, and either serves alone.
    TestFileError where the two differ, or where nothing gives the sizes.
    """
    own, path = own_sizes(kind, recording.properties), recording.paths[0]
    if given is not None:
        if (sizes := read_specimen(given).get(kind)) is None:
            raise TestFileError(given, f"no table [{kind}], and {recording.label} is a {kind} test. Add one.")
        return sizes, (f"Specimen from [{kind}] of {given.name}.", *_differing(sizes, own, recording)), (given,)
    beside, candidate = _beside(kind, path)
    if beside is not None:
        assert candidate is not None
        if differing := _differing(beside, own, recording):
            raise TestFileError(path, f"{differing[0][:-1]}, as [{kind}] of {candidate.name} says. Correct "
                                      f"one of them, or give --specimen {candidate.name}.")
        agrees = " and agrees with what the file itself states" if own is not None else ""
        return beside, (f"Specimen from [{kind}] of {candidate.name}{agrees}.",), (candidate,)
    if own is not None:
        return own, (f"Specimen from the file's own sizes: {_words(recording.properties)}.",), ()
    raise TestFileError(path, f"displacement and force need the specimen's size: {path.name} does not state it, and "
                              f"{path.with_suffix('.toml')} or {path.parent / 'specimen.toml'} has no table [{kind}]. "
                              "Give --specimen specimen.toml.")


def own_sizes(kind: str, sizes: Mapping[str, float]) -> Block | None:
    """The specimen that a file's own sizes (keys of `readers.recording.SIZES`, SI) make for `kind`; None where they do
    not suffice."""
    area, thickness = sizes.get("area"), sizes.get("thickness", sizes.get("depth"))
    if kind in ("uniaxial", "relaxation"):
        if area is None and "diameter" in sizes:
            area = float(np.pi * sizes["diameter"] ** 2 / 4)
        if area is None and "width" in sizes and thickness is not None:
            area = sizes["width"] * thickness
        length = sizes.get("height", sizes.get("length"))
        if length is None and "diameter" in sizes:
            length = thickness
        return Block(area, length) if area and length else None
    if kind in ("biaxial", "planar") and {"length", "width"} <= set(sizes) and thickness:
        return sheet(kind, sizes["length"], sizes["width"], thickness)
    if kind == "shear" and area and thickness:
        return Block(area, thickness)
    return None


def _beside(kind: str, path: Path) -> tuple[Block | Strip | None, Path | None]:
    for candidate in (path.with_suffix(".toml"), path.parent / "specimen.toml"):
        if candidate.exists() and (sizes := read_specimen(candidate).get(kind)) is not None:
            return sizes, candidate
    return None, None


def _differing(chosen: Block | Strip, own: Block | None, recording: Recording) -> tuple[str, ...]:
    if own is None or not isinstance(chosen, Block):
        return ()
    if abs(own.area_m2 / chosen.area_m2 - 1) < _SAME and abs(own.length_m / chosen.length_m - 1) < _SAME:
        return ()
    return (f"{recording.paths[0].name} itself states {_words(recording.properties)}: an area of "
            f"{own.area_m2 * 1e6:.4g} mm2 and a length of {own.length_m * 1e3:.4g} mm instead of "
            f"{chosen.area_m2 * 1e6:.4g} mm2 and {chosen.length_m * 1e3:.4g} mm.",)


def _words(sizes: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value * 1e6:.4g} mm2" if name == "area" else f"{name} {value * 1e3:.4g} mm"
                     for name, value in sizes.items())
