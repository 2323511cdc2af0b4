"""The material card: what calibration writes and everything else reads, as JSON with a schema version."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.errors import InputFileError
from touchcal.input_file import read_text
from touchcal.json_file import write_json

SCHEMA = 1
_FREE = ("fit", "stability", "posterior", "provenance")
# what a stage of `matcal.fitting.calibrate.Calibration` is called
STAGES = {"records": "all records", "relaxation": "relaxation", "law": "hyperfoam law", "checks": "checks of the law",
          "skin": "conductivity"}


@dataclass(frozen=True)
class MaterialCard:
    """A calibrated material; a part that was not fitted is None (absent in the file)."""

    name: str
    hyperfoam: Hyperfoam | None = None
    prony: Prony | None = None
    conductivity: Conductivity | None = None
    fit: Mapping[str, Any] = field(default_factory=dict)  # experiment -> {rms, relative_rms, r2, n, weight}
    stability: Mapping[str, Any] = field(default_factory=dict)  # criterion -> mode -> {stable, unstable_strain}
    posterior: Mapping[str, Any] = field(default_factory=dict)  # {file, n, checks, ...}
    provenance: Mapping[str, Any] = field(default_factory=dict)  # files with sha256, versions, seed, date, decisions
    # folder of reduced experiments and posterior, relative to the card; None when the card stands alone
    data: str | None = None
    schema: int = SCHEMA
    # file that it was read from or written to, next to which its data lie; None for a card that has none
    file: Path | None = field(default=None, compare=False, repr=False)


def require(card: MaterialCard, part: str, purpose: str) -> Any:
    """The card's `part`; ValueError naming it and the `matcal fit` input that would give it when it is absent."""
    value = getattr(card, part)
    if value is None:
        needs = {"hyperfoam": "a uniaxial or shear file", "prony": "a relaxation file",
                 "conductivity": "a conductivity file"}[part]
        raise ValueError(f"card '{card.name}' has no {part}, which {purpose} needs. "
                         f"Add it with `matcal fit` and {needs}.")
    return value


def with_moduli(card: MaterialCard, moduli: str) -> Hyperfoam:
    """The hyperfoam law with `moduli` "card" (as labelled), "instantaneous" or "longterm"; mu scales by g_inf."""
    law: Hyperfoam = require(card, "hyperfoam", "the mechanics")
    if moduli in ("card", law.moduli):
        return law
    if moduli not in ("instantaneous", "longterm"):
        raise ValueError(f"moduli '{moduli}' is unknown; known: card, instantaneous, longterm.")
    factor = require(card, "prony", f"changing {law.moduli} into {moduli} moduli").g_infinity
    return replace(law, mu_Pa=law.mu_Pa * (factor if moduli == "longterm" else 1 / factor), moduli=moduli)


def read_card(path: Path | str) -> MaterialCard:
    """Read a material card.

    Parameters
    ----------
    path
        JSON that `matcal fit` or `write_card` wrote.

    Returns
    -------
    MaterialCard
        With `file` set to the path, next to which its data folder and draws lie.

    Raises
    ------
    InputFileError
        Naming the key that is missing or wrong.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import matcal
    >>> path = Path(tempfile.mkdtemp()) / "foam.json"
    >>> matcal.write_card(matcal.MaterialCard("foam", matcal.Hyperfoam([12e3], [2.0], [0.0])), path)
    >>> matcal.read_card(path).hyperfoam.mu_0_Pa
    12000.0
    """
    path = Path(path)
    text = read_text(path)
    try:
        raw = json.loads(text)
    except json.JSONDecodeError as error:
        raise InputFileError(path, f"not a card: {error.msg}. A card is the JSON that `matcal fit` writes.",
                             line=error.lineno) from None
    if not isinstance(raw, dict) or "schema" not in raw:
        raise InputFileError(path, "not a card: no key 'schema'. A card is the JSON that `matcal fit` writes.")
    if raw["schema"] != SCHEMA:
        raise InputFileError(path, f"card schema {raw['schema']!r} is not {SCHEMA}. Fit it again with this version.")
    known = {"schema", "name", "hyperfoam", "prony", "conductivity", "data", *_FREE}
    if unknown := sorted(set(raw) - known):
        raise InputFileError(path, f"unknown key '{unknown[0]}'; known: {', '.join(sorted(known))}.")
    try:
        parts: dict[str, Any] = {}
        if "hyperfoam" in raw:
            h = raw["hyperfoam"]
            ranges = {mode: (float(lo), float(hi)) for mode, (lo, hi) in h.get("strain_range", {}).items()}
            parts["hyperfoam"] = Hyperfoam(h["mu_Pa"], h["alpha"], h["nu"], h["moduli"], ranges)
        if "prony" in raw:
            parts["prony"] = Prony(raw["prony"]["g"], raw["prony"]["tau_s"])
        if "conductivity" in raw:
            c = raw["conductivity"]
            parts["conductivity"] = Conductivity(float(c["c0_S_per_m"]), c["a"], tuple(c["strain_range"]))
    except KeyError as error:
        raise InputFileError(path, f"the key {error} is missing.") from None
    except (TypeError, ValueError) as error:
        raise InputFileError(path, str(error)) from None
    free = {key: raw[key] for key in _FREE if key in raw}
    return MaterialCard(name=str(raw.get("name", path.stem)), data=raw.get("data"), file=path, **parts, **free)


def as_card(card: MaterialCard | Path | str) -> MaterialCard:
    """The card itself, or the one that a file holds; errors as those of `read_card`."""
    if not isinstance(card, MaterialCard | Path | str):
        raise ValueError(f"a card is a MaterialCard or the path of one, got {type(card).__name__}; of a Calibration "
                         "give its `card`.")
    return card if isinstance(card, MaterialCard) else read_card(card)


def as_json(card: MaterialCard) -> dict[str, Any]:
    """The card as plain JSON values, keys as in the command-line contract; absent parts are left out."""
    out: dict[str, Any] = {"schema": card.schema, "name": card.name}
    if (h := card.hyperfoam) is not None:
        out["hyperfoam"] = {"mu_Pa": h.mu_Pa.tolist(), "alpha": h.alpha.tolist(), "nu": h.nu.tolist(),
                            "moduli": h.moduli, "strain_range": {m: list(r) for m, r in h.strain_range.items()}}
    if (p := card.prony) is not None:
        out["prony"] = {"g": p.g.tolist(), "tau_s": p.tau_s.tolist()}
    if (c := card.conductivity) is not None:
        out["conductivity"] = {"c0_S_per_m": c.c0_S_per_m, "a": c.a.tolist(), "strain_range": list(c.strain_range)}
    out |= {key: value for key in _FREE if (value := getattr(card, key))}
    if card.data is not None:
        out["data"] = card.data
    return out


def card_identity(card: MaterialCard) -> dict[str, Any]:
    """Name, file (None for a card that has none) and content hash (of the material's parts) of a card, and whether
    synthetic data made it."""
    parts = {key: value for key, value in as_json(card).items() if key in ("hyperfoam", "prony", "conductivity")}
    text = json.dumps(parts, sort_keys=True)
    return {"name": card.name, "file": card.file and card.file.name,
            "sha256": hashlib.sha256(text.encode()).hexdigest(),
            "synthetic": bool(card.provenance.get("synthetic", False))}


def write_card(card: MaterialCard, path: Path | str) -> None:
    """Write a card in one step, so that a reader never sees half of it.

    Parameters
    ----------
    card
        Any card; draws of a posterior are not part of it (`Calibration.save` writes them).
    path
        JSON file to write; one of that name is replaced.
    """
    write_json(as_json(card), path)


def grouped(card: MaterialCard) -> list[tuple[str, list[str]]]:
    """(test with its files, or stage; its decisions) in order; one group where the card does not part them."""
    sentences: Sequence[str] = card.provenance.get("decisions", ())
    counts: Mapping[str, int] = card.provenance.get("decisions_of", {})
    if sum(counts.values()) != len(sentences):
        return [("in order", [*sentences])] if sentences else []
    out, first = [], 0
    for name, count in counts.items():
        out.append((_title(card, name), [s.removeprefix(f"{name}: ") for s in sentences[first:first + count]]))
        first += count
    return out


def _title(card: MaterialCard, name: str) -> str:
    row = card.fit.get(name)
    if isinstance(row, Mapping) and row.get("source"):
        return f"{name} ({', '.join(row['source'])})"
    return STAGES.get(name, name)
