"""Which kind of test a file holds: said by the user, by the file, by a TOML next to it, or by its name."""

import re
from collections.abc import Sequence

import numpy as np

from matcal.readers.recording import Recording
from matcal.readers.vocabulary import KINDS
from touchcal.errors import InputFileError
from touchcal.toml_file import read_toml

# word in a test's title or a file's name -> kind, in English, German, French, Spanish, Italian, Chinese and Japanese;
# the first match wins, so the more telling words stand first
_WORDS = (
    ("relaxation", r"relax|rilass|relaj|松弛|緩和"),
    ("creep", r"creep|kriech|fluage|fluencia|蠕变|クリープ"), ("dma", r"\bdma\b|\bdmta\b|frequency sweep"),
    ("conductivity", r"conductiv|resistiv|resistance|coated|leitf[äa]hig|widerstand|电阻|电导"),
    ("planar", r"planar|pure shear|平面"), ("shear", r"shear|\bss\b|scher|schub|cisaill|cizall|taglio|剪切|せん断"),
    ("biaxial", r"biax|zweiachs|双轴"), ("volumetric", r"volumetr|hydrostat|体积|静水"),
    ("uniaxial", r"uniax|\bcompres|\btension|\btensile|\buc\b|\but\b|einachs|druckvers|druckfest|stauch|zugvers"
                 r"|\bzug\b|\bdruck\b|traction|tracci[óo]n|trazione|单轴|压缩|拉伸|圧縮|引張"),
)
_STANDARD = re.compile(r"\b(ISO|ASTM|DIN|EN|JIS|GB/T) ?[A-Z]? ?\d[\d-]*")
_FEWEST = 8  # rows that show a creep
_HELD, _GROWN, _SLOWING = 0.05, 0.02, 1.5  # spread of a held load, growth of a strain, share of it in the first half


def decide_kind(explicit: str | None, recordings: Sequence[Recording]) -> tuple[str, str]:
    """(kind, sentence saying why) of the recordings of one test; InputFileError where nothing tells, or the columns are
    those of another kind; ValueError for an unknown explicit kind."""
    first = recordings[0]
    dynamic = {"storage", "loss", "complex_modulus"} & set(first.columns)
    if explicit not in (None, "dma") and dynamic:
        _known(explicit, explicit)
        raise InputFileError(first.paths[0], "it holds storage and loss modulus of a dynamic test. Write "
                                             f"dma={first.paths[0].name}.")
    if dynamic:
        return "dma", f"{first.label}: dynamic test, from its columns."
    if explicit not in (None, "relaxation", "creep", "conductivity", "volumetric") and _creeps(first):
        raise InputFileError(first.paths[0], "its stress is held and its strain grows, as in a creep test. Write "
                                             f"creep={first.paths[0].name}.")
    if explicit in (None, "relaxation", "creep") and ("compliance" in first.columns or _creeps(first)):
        how = "from its columns" if "compliance" in first.columns else "its stress is held and its strain grows"
        return "creep", f"{first.label}: creep, {how}."
    return _decided(explicit, recordings)


def _creeps(recording: Recording) -> bool:
    """Whether the stress is held in time and the strain grows, less in the second half of the time than in the first.
    """
    load, strain = (next((recording.columns[q] for q in names if q in recording.columns), None)
                    for names in (("stress", "force"), ("strain", "stretch", "displacement")))
    time = recording.columns.get("time")
    if load is None or strain is None or time is None or recording.rows < _FEWEST \
            or not np.all(np.diff(time) >= 0) or time[-1] <= time[0]:
        return False
    low, middle, high = np.quantile(load, (0.05, 0.5, 0.95))
    half = float(np.interp(0.5 * (time[0] + time[-1]), time, strain))
    early, late = half - strain[0], strain[-1] - half
    return bool(high - low <= _HELD * abs(middle) and early * late >= 0
                and abs(early + late) > _GROWN * np.max(np.abs(strain)) and abs(early) > _SLOWING * abs(late))


def _decided(explicit: str | None, recordings: Sequence[Recording]) -> tuple[str, str]:
    if explicit is not None:
        path = recordings[0].paths[0]
        return _known(explicit, f"{explicit}={path.name}"), f"{recordings[0].label}: {explicit}, as given."
    for recording in recordings:
        if (found := _stated_by(recording)) is not None:
            return found
    path = recordings[0].paths[0]
    raise InputFileError(path, f"the kind of test is not clear. Write KIND={path.name} with KIND one of "
                               f"{', '.join(KINDS)}.")


def _stated_by(recording: Recording) -> tuple[str, str] | None:
    path = recording.paths[0]
    for key, value in recording.titles:
        if (kind := _from_words(value)) is not None:
            return kind, f"{recording.label}: {kind}, from its own line '{key}: {value.strip()}'."
    sidecar = path.with_suffix(".toml")
    if sidecar.exists() and "kind" in (table := read_toml(sidecar)):
        return _known(str(table["kind"]), str(sidecar)), f"{recording.label}: {table['kind']}, from {sidecar.name}."
    electric = {"resistance", "relative_resistance"} & set(recording.columns)
    if {"current", "conductivity"} & set(recording.columns) or (
            electric and not {"force", "stress", "pressure"} & set(recording.columns)):
        return "conductivity", f"{recording.label}: conductivity, from its columns."
    if {"volume_ratio", "pressure"} & set(recording.columns) and "displacement" not in recording.columns:
        return "volumetric", f"{recording.label}: volumetric, from its columns."
    if {"modulus", "normalised"} & set(recording.columns) and "time" in recording.columns:
        return "relaxation", f"{recording.label}: relaxation, from its columns."
    if (kind := _from_words(path.stem)) is not None:
        return kind, f"{recording.label}: {kind}, from its name."
    # the controller calls every file specimen.dat and the folder by the name of the test
    if recording.vendor == "mts_793" and (kind := _from_words(path.absolute().parent.name)) is not None:
        return kind, f"{recording.label}: {kind}, from the name of its folder, '{path.absolute().parent.name}'."
    return None


def standards_of(recordings: Sequence[Recording]) -> tuple[str, ...]:
    """Standards that the lines above the tables of recordings, or their files' names, name."""
    texts = [text for one in recordings for text in (one.label, *(value for _, value in one.titles))]
    return tuple(dict.fromkeys(found[0] for text in texts for found in _STANDARD.finditer(text)))


def named_kind(recording: Recording) -> str | None:
    """The kind that the lines above a recording's table, or its file's name, name; None where they name none."""
    texts = [*(value for _, value in recording.titles), recording.paths[0].stem]
    return next((kind for text in texts if (kind := _from_words(text)) is not None), None)


def _known(kind: str, where: str) -> str:
    if kind not in KINDS:
        meant = _from_words(kind)
        raise ValueError(f"{where}: the kind '{kind}' is unknown; known: {', '.join(KINDS)}."
                         + (f" Write {meant} for it." if meant else ""))
    return kind


def _from_words(text: str) -> str | None:
    text = re.sub(r"[_\-.\d]+", " ", text.lower())
    return next((kind for kind, pattern in _WORDS if re.search(pattern, text)), None)
