"""Which sizes belong to a test: those given, the file's own, or a TOML next to it; and what to do where they differ."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from matcal.readers.recording import Recording
from matcal.reduction.specimen import KEYS, SAME, SECTIONS, Block, Strip, known_direction, make_specimen, read_tables
from touchcal.errors import InputFileError

# kind -> size that a file may state -> key of that kind's table; of several for one key the first counts
_DISC = {"area": "area_mm2", "diameter": "diameter_mm", "width": "width_mm", "depth": "depth_mm",
         "thickness": "depth_mm", "height": "height_mm", "length": "height_mm"}
_SHEET = {"length": "length_mm", "width": "width_mm", "thickness": "thickness_mm", "depth": "thickness_mm"}
_OWN = {"uniaxial": _DISC, "relaxation": _DISC, "biaxial": _SHEET, "planar": _SHEET,
        "shear": {"area": "area_mm2", "thickness": "thickness_mm", "depth": "thickness_mm"}}
# kind -> keys that give its cross-section in one way or another
_SECTION = {**dict.fromkeys(("uniaxial", "relaxation"), frozenset(key for way in SECTIONS for key in way)),
            "shear": frozenset(("area_mm2", "faces", "length_mm", "width_mm"))}


def specimen_of(kind: str, recording: Recording, given: Path | None, *,
                needed: bool = True) -> tuple[Block | Strip | None, tuple[str, ...], tuple[Path, ...]]:
    """Sizes for `kind`, a sentence that says where they are from, a second where the file states others, and the files
    that were used; None where they are not `needed` and nothing states a whole specimen.

    `given` comes first, and a file that states other sizes is minded; without it a TOML of the file's name, else
    specimen.toml next to it, where the two must agree. A table that lacks a size is completed by the file's own, and
    where no table is there the file's own serve alone. InputFileError where two sources differ, or sizes are missing.
    """
    own, path = own_table(kind, recording.properties), recording.paths[0]
    toml, table = _table(kind, path, given)
    if not needed and not set(table or {}) - {"direction"}:
        try:
            return make_specimen(kind, own, path), (_by_its_own(recording, kind, given),), ()
        except InputFileError:
            return None, (), () if toml is None else (toml,)
    if table is None:
        return _own_alone(kind, recording, own, given)
    assert toml is not None
    added = _added(kind, table, own)
    try:
        sizes = make_specimen(kind, {**added, **table}, toml)
    except InputFileError as error:
        if not recording.properties:
            raise
        stated = f"{recording.label} itself states {_words(recording.properties)}, which does not complete it"
        raise InputFileError(toml, f"{error.problem} {stated}.", line=error.line) from None
    differing = _differing(sizes, _by_file(kind, table, own, path), recording)
    another = f"give another specimen its own [{kind}] in {path.with_suffix('.toml').name} next to {path.name}"
    if differing and given is None:
        raise InputFileError(path, f"{differing}, as [{kind}] of {toml.name} says. Correct one of them, or {another}. "
                                   f"With `specimen` {toml.name} its sizes count.")
    said = f"Specimen from [{kind}] of {toml.name}"
    if added:
        said += f", completed by what {path.name} itself states: {_keys(added)}"
    elif own and not differing:
        said += " and agrees with what the file itself states"
    minded = (f"{differing}, as [{kind}] of {toml.name} says, which counts. Correct one of them, or {another}, and "
              "leave --specimen out.",) if differing else ()
    return sizes, (f"{said}.", *minded), (toml,)


def stated_direction(kind: str, recording: Recording, given: Path | None) -> str | None:
    """The direction that the specimen's table of `kind` states, one of DIRECTIONS; None where it states none."""
    toml, table = _table(kind, recording.paths[0], given)
    direction = (table or {}).get("direction")
    return None if direction is None or toml is None else known_direction(direction, kind, toml)


def own_table(kind: str, sizes: Mapping[str, float]) -> dict[str, float]:
    """The file's own sizes as keys of the table of `kind`, in mm and mm2."""
    out: dict[str, float] = {}
    for size, key in _OWN.get(kind, {}).items():
        if size in sizes:
            out.setdefault(key, sizes[size] * (1e6 if key == "area_mm2" else 1e3))
    if kind in ("uniaxial", "relaxation") and "diameter_mm" in out and "width_mm" not in out and "depth_mm" in out:
        out.setdefault("height_mm", out["depth_mm"])  # a disc's thickness is its height
    lone = {"width_mm", "depth_mm"} - set(out) if kind in ("uniaxial", "relaxation") else set()
    return {key: value for key, value in out.items() if not (lone and key in ("width_mm", "depth_mm"))}


def _table(kind: str, path: Path, given: Path | None) -> tuple[Path | None, Mapping[str, Any] | None]:
    if given is not None:
        return given, read_tables(given).get(kind)
    for candidate in (path.with_suffix(".toml"), path.parent / "specimen.toml"):
        if candidate.exists() and (table := read_tables(candidate).get(kind)) is not None:
            return candidate, table
    return None, None


def _own_alone(kind: str, recording: Recording, own: Mapping[str, float],
               given: Path | None) -> tuple[Block | Strip, tuple[str, ...], tuple[Path, ...]]:
    path = recording.paths[0]
    try:
        sizes = make_specimen(kind, own, path)
    except InputFileError as error:
        if own:
            own_toml = f"{'or without it' if given else 'or'} in {path.with_suffix('.toml').name} next to {path.name}"
            raise InputFileError(path, f"{error.problem} The file itself states {_words(recording.properties)}; a "
                                       f"table [{kind}] in `specimen` {given.name if given else 'specimen.toml'}, "
                                       f"{own_toml}, completes it.") from None
        if given is not None:
            raise InputFileError(given, f"no table [{kind}], and {recording.label} is a {kind} test. Add one with "
                                        f"{_needed(kind, recording)}.") from None
        read = "a resistance needs" if kind == "conductivity" else "displacement and force need"
        raise InputFileError(path, f"{read} the specimen's size: {path.name} does not state it, "
                                   f"and {path.with_suffix('.toml')} or {path.parent / 'specimen.toml'} has no table "
                                   f"[{kind}]. Give `specimen` specimen.toml with {_needed(kind, recording)} "
                                   f"below [{kind}]."
                             ) from None
    return sizes, (_by_its_own(recording, kind, given),), ()


def _by_its_own(recording: Recording, kind: str, given: Path | None) -> str:
    missing = f"; {given.name} has no table [{kind}]" if given is not None else ""
    return f"Specimen from the file's own sizes: {_words(recording.properties)}{missing}."


def _needed(kind: str, recording: Recording) -> str:
    """The keys that a table of `kind` needs for a record, in words."""
    relative = "relative_resistance" in recording.columns and "resistance" not in recording.columns
    sizes = sorted(key for key in KEYS[kind] if key.endswith(("_mm", "_um")))
    block = "height_mm and diameter_mm (or width_mm and depth_mm, or area_mm2)"
    return {"uniaxial": block, "relaxation": block,
            "shear": "faces, length_mm, width_mm and thickness_mm", "volumetric": "method and its sizes"
            }.get(kind, ", ".join(sizes) + (", and rest_resistance_Ohm" if relative else ""))


def _added(kind: str, table: Mapping[str, Any], own: Mapping[str, float]) -> dict[str, float]:
    """The file's own sizes that the table lacks; its cross-section only where the table has none."""
    section = _SECTION.get(kind, frozenset())
    known = section if section & set(table) else frozenset()
    return {key: value for key, value in own.items() if key not in table and key not in known}


def _by_file(kind: str, table: Mapping[str, Any], own: Mapping[str, float], path: Path) -> Block | Strip:
    """The specimen where what the file states goes before the table."""
    section = _SECTION.get(kind, frozenset())
    replaced = section if section & set(own) else frozenset()
    return make_specimen(kind, {**{k: v for k, v in table.items() if k not in replaced}, **own}, path)


def _differing(chosen: Block | Strip, other: Block | Strip, recording: Recording) -> str:
    """What the file states otherwise, in words; "" where both agree."""
    if not (isinstance(chosen, Block) and isinstance(other, Block)) or (
            abs(other.area_m2 / chosen.area_m2 - 1) < SAME and abs(other.length_m / chosen.length_m - 1) < SAME):
        return ""
    return (f"{recording.paths[0].name} itself states {_words(recording.properties)}: an area of "
            f"{other.area_m2 * 1e6:.4g} mm2 and a length of {other.length_m * 1e3:.4g} mm instead of "
            f"{chosen.area_m2 * 1e6:.4g} mm2 and {chosen.length_m * 1e3:.4g} mm")


def _keys(table: Mapping[str, float]) -> str:
    return ", ".join(f"{key} = {value:.4g}" for key, value in table.items())


def _words(sizes: Mapping[str, float]) -> str:
    return ", ".join(f"{name} {value * 1e6:.4g} mm2" if name == "area" else f"{name} {value * 1e3:.4g} mm"
                     for name, value in sizes.items())
