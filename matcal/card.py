"""The material card: what calibration writes and everything else reads, as JSON with a schema version."""

from __future__ import annotations

import json
import os
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from matcal.conductivity import Conductivity
from matcal.errors import TestFileError
from matcal.hyperfoam import Hyperfoam
from matcal.prony import Prony

SCHEMA = 1
_FREE = ("fit", "stability", "posterior", "provenance")


@dataclass(frozen=True)
class MaterialCard:
    """A calibrated material; a part that was not fitted is None (absent in the file)."""

    name: str
    hyperfoam: Hyperfoam | None = None
    prony: Prony | None = None
    conductivity: Conductivity | None = None
    # experiment -> {rms, relative_rms, r2, n, weight}
    fit: Mapping[str, Any] = field(default_factory=dict)
    # criterion -> mode -> {stable, unstable_strain}
    stability: Mapping[str, Any] = field(default_factory=dict)
    # {file, n, checks, ...}
    posterior: Mapping[str, Any] = field(default_factory=dict)
    # files with sha256, versions, seed, date, decisions
    provenance: Mapping[str, Any] = field(default_factory=dict)
    # folder of reduced experiments and posterior, relative to the card; None when the card stands alone
    data: str | None = None
    schema: int = SCHEMA


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
    """Read a card; TestFileError names the key that is missing or wrong."""
    path = Path(path)
    text = path.read_text(encoding="utf-8")
    try:
        raw = json.loads(text)
    except json.JSONDecodeError as error:
        raise TestFileError(path, f"not a card: {error.msg}. A card is the JSON that `matcal fit` writes.",
                            line=error.lineno) from None
    if not isinstance(raw, dict) or "schema" not in raw:
        raise TestFileError(path, "not a card: no key 'schema'. A card is the JSON that `matcal fit` writes.")
    if raw["schema"] != SCHEMA:
        raise TestFileError(path, f"card schema {raw['schema']!r} is not {SCHEMA}. Fit it again with this version.")
    known = {"schema", "name", "hyperfoam", "prony", "conductivity", "data", *_FREE}
    if unknown := sorted(set(raw) - known):
        raise TestFileError(path, f"unknown key '{unknown[0]}'; known: {', '.join(sorted(known))}.")
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
        raise TestFileError(path, f"the key {error} is missing.") from None
    except (TypeError, ValueError) as error:
        raise TestFileError(path, str(error)) from None
    free = {key: raw[key] for key in _FREE if key in raw}
    return MaterialCard(name=str(raw.get("name", path.stem)), data=raw.get("data"), **parts, **free)


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


def write_card(card: MaterialCard, path: Path | str) -> None:
    """Write a card in one step, so that a reader never sees half of it."""
    write_json(as_json(card), path)


def write_json(value: Mapping[str, Any], path: Path | str) -> None:
    """Write JSON atomically (a temporary file beside it, then a rename); NaN is refused."""
    path = Path(path)
    text = json.dumps(value, indent=1, allow_nan=False, default=_plain) + "\n"
    handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=path.name, suffix=".part")
    try:
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except BaseException:
        Path(temporary).unlink(missing_ok=True)
        raise


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    raise TypeError(f"{type(value).__name__} has no JSON form")
