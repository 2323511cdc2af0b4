"""The material card: what calibration writes and everything else reads, as JSON with a schema version."""

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from matcal.laws.conduction_laws import CUBIC
from matcal.laws.conductivity import Conductivity
from matcal.laws.histories.damage import Damage
from matcal.laws.histories.time_temperature import Arrhenius, Shift, Wlf
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import law_of, law_type
from matcal.laws.law import Law, scaled, values_of
from matcal.laws.prony import Prony
from touchcal.document import Keys, Number, check
from touchcal.errors import InputFileError
from touchcal.json_file import read_json, write_json

SCHEMA = 1
SOFTENING = "ogden_roxburgh"  # the law of softening
_FREE = ("fit", "stability", "posterior", "provenance")
# Least exponent in size, and moduli, Pa, of any solid: softer than any gel, stiffer than diamond.
_LEAST_ALPHA, _LEAST_PA, _MOST_PA = 1e-6, 1e-3, 1e13
_STRAINS = [Number(-1e3, 1e3)] * 2
# What each part of the file must hold; the laws check themselves how their numbers go together.
_SHAPE = Keys({"schema": Number()}, {
    "name": str, "data": str,
    "hyperfoam": Keys({"mu_Pa": [Number(-1e15, 1e15)], "alpha": [Number(-1e3, 1e3)], "nu": [Number(-1, 0.5)],
                       "moduli": str}, {"strain_range": {str: _STRAINS}}, further=False),
    "hyperelastic": Keys({"law": str, "parameters": {str: (Number(-1e15, 1e15), [Number(-1e15, 1e15)])}, "moduli": str},
                         {"compressible": bool, "strain_range": {str: _STRAINS}}, further=False),
    "prony": Keys({"g": [Number(0, 1)], "tau_s": [Number(1e-40, 1e40)]}, further=False),
    "shift": Keys({"law": str, "reference_K": Number(1, 1e4)},
                  {"C1": Number(0, 1e6), "C2_K": Number(0, 1e6), "activation_J_per_mol": Number(-1e9, 1e9)},
                  further=False),
    "softening": Keys({"law": str, "r": Number(1, 1e6), "m_Pa": Number(0, 1e13), "beta": Number(0, 1e6),
                       "set_share": Number(0, 1)}, {"loop_share": Number(0, 1), "loop_turn": Number(0, 1e6)},
                      further=False),
    "conductivity": Keys({"c0_S_per_m": Number(), "a": [Number(-1e6, 1e6)], "strain_range": _STRAINS}, {"law": str},
                         further=False),
    "fit": Keys(allowed={"derived": {str: {str: (Number(), None)}}, "parameters": {str: {str: (Number(), None)}},
                         "orders": [dict], "data_stability": [dict], "predicted": [dict], "prony": dict,
                         "softening": dict, "material": {str: (bool, str)}, "laws": [dict], "deciding_test": dict,
                         "conductivity": dict, "cross_prediction": {str: dict}, "without_stability": dict,
                         "next_specimen": {str: {str: Number()}},
                         "other_nu": Keys({"parameters": [[Number()]], "reach": Number(0)})}),
    "stability": {str: {str: dict}},
    "posterior": Keys(allowed={"file": str, "n": Number(0, whole=True), "checks": dict, "derived": {str: dict}}),
    "provenance": Keys(allowed={"files": [Keys({"name": str, "sha256": str})], "versions": {str: str},
                                "synthetic": bool, "seed": (Number(0, whole=True), None), "date": str,
                                "decisions": [str], "decisions_of": {str: Number(0, whole=True)}, "cautions": [str],
                                "cpu_s": {str: Number(0)}})}, further=False)
# what a stage of `matcal.fitting.calibrate.Calibration` is called
STAGES = {"records": "all records", "relaxation": "relaxation", "law": "hyperelastic law",
          "checks": "checks of the law", "skin": "conductivity"}


@dataclass(frozen=True)
class MaterialCard:
    """A calibrated material; a part that was not fitted is None (absent in the file)."""

    name: str  # of the material
    law: Law | None = None  # the foam's law
    prony: Prony | None = None  # how it relaxes
    conductivity: Conductivity | None = None  # of the coating
    fit: Mapping[str, Any] = field(default_factory=dict, repr=False)  # experiment -> {rms, relative_rms, r2, n, weight}
    # criterion -> mode -> {stable, unstable_strain}
    stability: Mapping[str, Any] = field(default_factory=dict, repr=False)
    posterior: Mapping[str, Any] = field(default_factory=dict, repr=False)  # {file, n, checks, ...}
    # files with sha256, versions, seed, date, decisions
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    # folder of reduced experiments and posterior, relative to the card; None when the card stands alone
    data: str | None = None
    schema: int = SCHEMA  # version of the file's layout
    # file that it was read from or written to, next to which its data lie; None for a card that has none
    file: Path | None = field(default=None, compare=False, repr=False)
    shift: Shift | None = None  # of the times of `prony` with temperature
    softening: Damage | None = None  # by earlier loading, around `law`, with set and loop

    @property
    def hyperfoam(self) -> Hyperfoam | None:
        """The foam's law where it is a hyperfoam."""
        return self.law if isinstance(self.law, Hyperfoam) else None


def lacking(card: MaterialCard, part: str, purpose: str) -> str:
    """That a card lacks a part which something needs, and the `matcal fit` input that would give it; empty where it
    has it."""
    if getattr(card, part) is not None:
        return ""
    needs = {"law": "a uniaxial or shear file", "prony": "a relaxation, creep or dma file",
             "shift": "a dma file of several temperatures", "softening": "a cyclic file and --unloading",
             "conductivity": "a conductivity file, or by hand in Python with matcal.Conductivity"}[part]
    what = "hyperelastic law" if part == "law" else part
    return f"card '{card.name}' has no {what}, which {purpose} needs. Add it with `matcal fit` and {needs}."


def require(card: MaterialCard, part: str, purpose: str) -> Any:
    """The card's `part`; ValueError, as `lacking` says it, when it is absent."""
    if problem := lacking(card, part, purpose):
        raise ValueError(problem)
    return getattr(card, part)


def with_moduli(card: MaterialCard, moduli: str) -> Law:
    """The foam's law with `moduli` "card" (as labelled), "instantaneous" or "longterm"; stresses scale by g_inf."""
    law: Law = require(card, "law", "the mechanics")
    if moduli in ("card", law.moduli):
        return law
    if moduli not in ("instantaneous", "longterm"):
        raise ValueError(f"moduli '{moduli}' is unknown; known: card, instantaneous, longterm.")
    factor = require(card, "prony", f"changing {law.moduli} into {moduli} moduli").g_infinity
    return replace(scaled(law, factor if moduli == "longterm" else 1 / factor), moduli=moduli)


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
    raw = read_json(path, "a card", "A card is the JSON that `matcal fit` writes.", Keys({"schema": object}))
    if raw["schema"] != SCHEMA:
        raise InputFileError(path, f"card schema {raw['schema']!r} is not {SCHEMA}. Fit it again with this version.")
    parts: dict[str, Any] = {}
    try:
        check(raw, _SHAPE)
        if "hyperfoam" in raw and "hyperelastic" in raw:
            raise ValueError("the card has hyperfoam and hyperelastic, two laws of one foam. Remove one.")
        if "hyperfoam" in raw:
            parts["law"] = _hyperfoam(raw["hyperfoam"])
        if "hyperelastic" in raw:
            parts["law"] = _hyperelastic(raw["hyperelastic"])
        if "prony" in raw:
            parts["prony"] = Prony(raw["prony"]["g"], raw["prony"]["tau_s"])
        if "shift" in raw:
            parts["shift"] = _shift(raw["shift"])
        if "softening" in raw:
            parts["softening"] = _softening(raw["softening"])
        if "conductivity" in raw:
            c = raw["conductivity"]
            parts["conductivity"] = Conductivity(float(c["c0_S_per_m"]), c["a"], _range("conductivity", c),
                                                 c.get("law", CUBIC))
        for key, place in (("data", raw.get("data")), ("posterior.file", raw.get("posterior", {}).get("file"))):
            if place is not None and (Path(place).is_absolute() or ".." in Path(place).parts):
                raise ValueError(f"{key} must lie next to the card, as foam.d lies next to foam.json, got {place!r}. "
                                 "Move it there, and name it without its folder.")
    except ValueError as error:
        raise InputFileError(path, str(error)) from None
    free = {key: raw[key] for key in _FREE if key in raw}
    return MaterialCard(name=raw.get("name", path.stem), data=raw.get("data"), file=path, **parts, **free)


def _shift(raw: Mapping[str, Any]) -> Shift:
    kinds: dict[str, type[Wlf] | type[Arrhenius]] = {"wlf": Wlf, "arrhenius": Arrhenius}
    if raw["law"] not in kinds:
        raise ValueError(f"shift.law '{raw['law']}' is unknown; known: {', '.join(kinds)}.")
    kind, given = kinds[raw["law"]], {key: value for key, value in raw.items() if key != "law"}
    names = [f.name for f in fields(kind)]
    if wrong := sorted(set(names) ^ set(given)):
        raise ValueError(f"shift.{wrong[0]} is {'missing' if wrong[0] in names else 'unknown'}; {raw['law']} has "
                         f"{', '.join(names)}.")
    return kind(**given)


def _softening(raw: Mapping[str, Any]) -> Damage:
    if raw["law"] != SOFTENING:
        raise ValueError(f"softening.law '{raw['law']}' is unknown; known: {SOFTENING}.")
    return Damage(**{name: float(value) for name, value in raw.items() if name != "law"})


def _hyperfoam(raw: Mapping[str, Any]) -> Law:
    law = law_of("hyperfoam", [raw[name] for name in ("mu_Pa", "alpha", "nu")], raw["moduli"],
                 _ranges("hyperfoam", raw))
    if min(map(abs, raw["alpha"])) < _LEAST_ALPHA:
        raise ValueError(f"hyperfoam.alpha must be at least {_LEAST_ALPHA:g} in size, got {raw['alpha']}.")
    return _of_a_solid(law, "mu_0 = sum of mu_Pa")


def _hyperelastic(raw: Mapping[str, Any]) -> Law:
    """The law that a card names; hyperfoam has its own key."""
    kind, given = law_type(raw["law"]), raw["parameters"]
    names = [p.name for p in kind.parameters]
    if wrong := sorted(set(names) ^ set(given)):
        raise ValueError(f"hyperelastic.parameters: '{wrong[0]}' is {'missing' if wrong[0] in names else 'unknown'}; "
                         f"{kind.name} has {', '.join(names)}.")
    if wrong := [p.name for p in kind.parameters if isinstance(given[p.name], list) != p.each_term]:
        raise ValueError(f"hyperelastic.parameters.{wrong[0]} must be "
                         f"{'one number' if isinstance(given[wrong[0]], list) else 'a list, a number a term'}.")
    values = [given[name] if isinstance(given[name], list) else [given[name]] for name in names]
    return _of_a_solid(law_of(kind.name, values, raw["moduli"], _ranges("hyperelastic", raw)), "mu_0")


def _of_a_solid(law: Law, words: str) -> Law:
    if not _LEAST_PA <= law.mu_0_Pa <= _MOST_PA:
        raise ValueError(f"{law.name}: {words} must be from {_LEAST_PA:g} to {_MOST_PA:g} Pa, got {law.mu_0_Pa:g} Pa; "
                         "check its unit.")
    return law


def _ranges(where: str, raw: Mapping[str, Any]) -> dict[str, tuple[float, float]]:
    return {mode: _range(f"{where}.strain_range.{mode}", {"strain_range": ends})
            for mode, ends in raw.get("strain_range", {}).items()}


def _range(where: str, raw: Mapping[str, Any]) -> tuple[float, float]:
    low, high = map(float, raw["strain_range"])
    if low > high:
        raise ValueError(f"{where}: the lowest strain {low:g} is above the highest {high:g}; exchange them.")
    return low, high


def as_card(card: MaterialCard | Path | str) -> MaterialCard:
    """The card itself, or the one that a file holds; errors as those of `read_card`."""
    if not isinstance(card, MaterialCard | Path | str):
        raise ValueError(f"a card is a MaterialCard or the path of one, got {type(card).__name__}; of a Calibration "
                         "give its `card`.")
    return card if isinstance(card, MaterialCard) else read_card(card)


def as_json(card: MaterialCard) -> dict[str, Any]:
    """The card as plain JSON values, keys as in the command-line contract; absent parts are left out."""
    out: dict[str, Any] = {"schema": card.schema, "name": card.name}
    if (law := card.law) is not None:
        numbers = {p.name: list(values) if p.each_term else values[0]
                   for p, values in zip(law.parameters, values_of(law), strict=True)}
        fitted = {"moduli": law.moduli, "strain_range": {m: list(r) for m, r in law.strain_range.items()}}
        out |= {"hyperfoam": numbers | fitted} if card.hyperfoam else {
            "hyperelastic": {"law": law.name, "parameters": numbers, "compressible": not law.incompressible, **fitted}}
    if (p := card.prony) is not None:
        out["prony"] = {"g": p.g.tolist(), "tau_s": p.tau_s.tolist()}
    if (shift := card.shift) is not None:
        out["shift"] = {"law": type(shift).__name__.lower(), **asdict(shift)}
    if card.softening is not None:
        loop = ("loop_share", "loop_turn") if not card.softening.loop_share else ()
        out["softening"] = {"law": SOFTENING} | {k: v for k, v in asdict(card.softening).items() if k not in loop}
    if (c := card.conductivity) is not None:
        out["conductivity"] = ({} if c.kind == CUBIC else {"law": c.kind}) | {
            "c0_S_per_m": c.c0_S_per_m, "a": c.a.tolist(), "strain_range": list(c.strain_range)}
    out |= {key: value for key in _FREE if (value := getattr(card, key))}
    if card.data is not None:
        out["data"] = card.data
    return out


def card_identity(card: MaterialCard) -> dict[str, Any]:
    """Name, file (None for a card that has none), laws and content hash (of the material's parts) of a card, and
    whether synthetic data made it."""
    names = ("hyperfoam", "hyperelastic", "prony", "shift", "softening", "conductivity")
    text = json.dumps({key: value for key, value in as_json(card).items() if key in names}, sort_keys=True)
    laws = {"law": card.law and card.law.name, "conductivity": card.conductivity and card.conductivity.kind}
    return {"name": card.name, "file": card.file and card.file.name, "laws": laws,
            "sha256": hashlib.sha256(text.encode()).hexdigest(),
            "synthetic": bool(card.provenance.get("synthetic", False))}


def cards_identity(card: MaterialCard, base_card: str = "") -> dict[str, Any]:
    """As `card_identity`, of a card and that of a soft base together: one hash, synthetic where either is."""
    own = card_identity(card)
    if not base_card:
        return own
    base = card_identity(read_card(base_card))
    return own | {"sha256": hashlib.sha256((own["sha256"] + base["sha256"]).encode()).hexdigest(),
                  "synthetic": own["synthetic"] or base["synthetic"], "base": base}


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
    return f"{card.law.name} law" if name == "law" and card.law else STAGES.get(name, name)
