"""Which card serves a row: the card itself, or a whole parameter set drawn from its posterior."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from matcal.card import MaterialCard, require
from matcal.laws.law import moduli_of
from matcal.posterior.draws import Draws, card_of, read_draws
from touchcal.arrays import Array
from touchcal.document import Number, check, check_keys
from touchcal.provenance import file_identity

PARTS = ("law", "prony", "conductivity")
_ALSO = {"hyperfoam": "law"}  # further words for a part
_CHOICE, _ORDER, _SPECIMEN = 1, 2, 3  # What the seed is split for.
_DOMAIN = 0x63617264  # Keeps these draws separate from those of scenes and measurements of the same seed.


@dataclass(frozen=True)
class Material:
    """The table [material] of a design."""

    draws: int = 0  # number of distinct cards; 0: as many as the posterior holds
    rows_per_draw: int = 1  # neighbouring rows that share a card
    parts: tuple[str, ...] = ()  # parts of the card that vary, some of PARTS; empty: all that the posterior holds
    # whether each card is that of a further specimen, stiffer or softer as replicates scatter; None: where the
    # posterior says how they do
    specimen: bool | None = None


@dataclass(frozen=True, eq=False)
class Cards:
    """The cards that serve the rows of a design, small enough to be sent to every worker."""

    card: MaterialCard  # the card itself; parts that do not vary stay as they are in it
    # D parameter sets of the parts that vary, moduli as the card labels them; None: the card itself serves every row
    draws: Draws | None = None
    # (D,) their rows in the file of the posterior
    samples: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    each: int = 1  # neighbouring numbers that share a card
    seed: int = 0  # seed of the order
    # name and hash of the posterior's file; empty where the card itself serves
    source: Mapping[str, str] = field(default_factory=dict)
    in_pairs: bool = False  # whether numbers 2 b and 2 b + 1 meet cards that differ
    further: bool | None = None  # whether each is of a further specimen, not of the mean; None: scatter is not known

    @property
    def cycle(self) -> int:
        """How many cards serve before one serves again: all, but of an odd number in pairs one sits out, each time
        another."""
        return len(self.samples) - (len(self.samples) % 2 if self.in_pairs else 0)


_SHAPES = {"posterior": bool, "draws": Number(0, whole=True), "rows_per_draw": Number(1, whole=True), "parts": object,
           "specimen": bool}


def material_from(raw: Any) -> Material | None:
    """The checked table [material]; None with posterior = false. ValueError names the key."""
    check_keys(raw, _SHAPES, "material")
    for key, value in raw.items():
        check(value, _SHAPES[key], f"{key} in [material]")
    given = raw.get("parts", [])
    parts = [_ALSO.get(part, part) if isinstance(part, str) else part for part in given] if isinstance(
        given, list) else given
    if not isinstance(parts, list) or any(part not in PARTS for part in parts) or ("parts" in raw and not parts):
        raise ValueError(f"parts in [material] must be a list of some of {', '.join(PARTS)}, got {given!r}.")
    if raw.get("specimen") and parts and "law" not in parts:
        raise ValueError("specimen in [material] is true, and parts leaves the law out, whose moduli scatter. "
                         "Add \"law\" to parts, or leave specimen out.")
    if not raw.get("posterior", True):
        return None
    return Material(int(raw.get("draws", 0)), int(raw.get("rows_per_draw", 1)), tuple(p for p in PARTS if p in parts),
                    raw.get("specimen"))


def cards_for(material: Material | None, seed: int, card: MaterialCard, *, in_pairs: bool = False) -> Cards:
    """The cards of a design, read from the posterior next to the card once.

    Which draws are chosen, and a specimen's factor exp(omega z) on the moduli, follow from seed and number in the file
    alone. in_pairs: whether numbers 2 b and 2 b + 1 meet cards that differ. ValueError where the card has no posterior
    that can be used, or it lacks what is asked for.
    """
    if material is None:
        return Cards(card)
    if (card_path := card.file) is None:
        raise ValueError(f"[material] takes cards from a posterior, whose file lies next to that of its card, and card "
                         f"'{card.name}' has no file. Save it and give its file, or leave out [material].")
    if card.posterior and not card.posterior.get("checks", {}).get("converged", True):
        raise ValueError(f"{card_path}: its posterior did not converge, so that its draws are not the material's. Fit "
                         "it again as the fit advises, or leave out [material].")
    held = read_draws(card_path)
    there = tuple(held_by(held))
    if missing := [part for part in material.parts if part not in there]:
        raise ValueError(f"parts in [material] names {missing[0]}, and the posterior of {card_path} holds "
                         f"{', '.join(there)}. Leave it out, or fit the card again with its test and --posterior.")
    parts = material.parts or there
    if material.draws > len(held):
        raise ValueError(f"draws in [material] is {material.draws}, and the posterior of {card_path} holds "
                         f"{len(held)}. Ask for {len(held)} or fewer.")
    if in_pairs and len(held) < 2:
        raise ValueError(f"a nested design gives each block two cards, and the posterior of {card_path} holds "
                         f"{len(held)}. Fit the card again with more draws.")
    chosen = _rng(seed, _CHOICE, 0).permutation(len(held))[:material.draws or len(held)]
    scatter = "law" in parts and held.omega is not None and bool(np.any(held.omega))
    further = scatter if material.specimen is None else material.specimen
    factor = _stiffness(held, chosen, seed, card_path) if further else np.ones(len(chosen))
    source = file_identity(card_path.parent / str(card.posterior["file"]), card_path.parent)
    return Cards(card, _as_labelled(_taken(held, chosen, parts), card, factor), chosen, material.rows_per_draw, seed,
                 source, in_pairs, further if scatter else None)


def draw_of(cards: Cards, number: int) -> int:
    """Which of the D cards serves this number, -1 for the card itself; every `cycle` blocks of numbers meet each card
    once at most, in an order of their own, so that it depends on (seed, number) only and is no function of a design's
    points."""
    if cards.draws is None:
        return -1
    cycle, place = divmod(number // cards.each, cards.cycle)
    return int(_order(cards, cycle)[place])


def _order(cards: Cards, cycle: int) -> NDArray[np.int64]:
    """Which of the D cards serve in a cycle, one after another."""
    return _rng(cards.seed, _ORDER, cycle).permutation(len(cards.samples))[:cards.cycle]


def count_in_use(cards: Cards, numbers: int) -> int:
    """How many cards serve the numbers from 0 on, so many of them."""
    if cards.draws is None:
        return 1
    left, used = -(-numbers // cards.each), set[int]()
    for cycle in range(-(-left // cards.cycle)):
        used.update(_order(cards, cycle)[:left - cycle * cards.cycle].tolist())
        if len(used) == len(cards.samples):
            break
    return len(used)


def card_at(cards: Cards, number: int) -> MaterialCard:
    """The card for this number; ValueError where its parameters make no material."""
    return cards.card if cards.draws is None else card_of(cards.draws, cards.card, draw_of(cards, number))


def recorded(cards: Cards, number: int) -> dict[str, Any]:
    """`card_sample` and the parameters of this number's card, those of parts that vary, names as in `columns`."""
    if cards.draws is None:
        return {"card_sample": -1}
    k = draw_of(cards, number)
    values = np.concatenate([block[k] for block in _blocks(cards.draws).values()])
    return {"card_sample": int(cards.samples[k])} | dict(zip(columns(cards), values.tolist(), strict=True))


def columns(cards: Cards) -> list[str]:
    """Names of the parameters that vary: of the law, as mu_1_Pa ..., alpha_1 ..., nu_1 ..., of a hyperfoam, then
    g_1 ..., tau_1_s ..., c0_S_per_m, a_1 ...."""
    blocks = {} if cards.draws is None else _blocks(cards.draws)
    return [name.format(i + 1) for name, block in blocks.items() for i in range(block.shape[1])]


def foam_varies(cards: Cards) -> bool:
    """Whether rows have laws of the foam of their own."""
    return cards.draws is not None and bool(cards.draws.law)


def _blocks(draws: Draws) -> dict[str, Array]:
    """Name -> (D, terms) of the parameters that are drawn."""
    blocks = {}
    for p in draws.kind.parameters if draws.law else ():
        blocks[p.numbered] = draws.law[p.name]
    if draws.g is not None and draws.tau_s is not None:
        blocks |= {"g_{}": draws.g, "tau_{}_s": draws.tau_s}
    if (c := draws.conductivity_S_per_m) is not None:
        blocks |= {"c0_S_per_m": c[:, :1], "a_{}": c[:, 1:] / c[:, :1]}
    return blocks


def held_by(draws: Draws) -> Iterator[str]:
    """Names of the parts that draws hold, some of PARTS."""
    if draws.law:
        yield "law"
    if draws.g is not None:
        yield "prony"
    if draws.conductivity_S_per_m is not None:
        yield "conductivity"


def _taken(held: Draws, chosen: NDArray[np.int64], parts: tuple[str, ...]) -> Draws:
    left_out = {name: None for part, names in (("prony", ("g", "tau_s")), ("conductivity", ("conductivity_S_per_m",)))
                for name in names if part not in parts}
    return replace(held, law=held.law if "law" in parts else {}, omega=None, **left_out).taken(chosen)


def _as_labelled(draws: Draws, card: MaterialCard, factor: Array) -> Draws:
    """Draws whose moduli, long-term in the posterior, are times a factor (D,) and as the card labels its own."""
    if card.law is not None and card.law.moduli == "instantaneous" and draws.law:
        left = 1 - draws.g.sum(axis=1) if draws.g is not None else require(
            card, "prony", "turning long-term draws into instantaneous moduli").g_infinity
        factor = factor / left
    moduli = moduli_of(draws.kind) if draws.law else []
    return replace(draws, law={**draws.law, **{name: draws.law[name] * factor[:, None] for name in moduli}})


def _stiffness(held: Draws, chosen: NDArray[np.int64], seed: int, path: Path) -> Array:
    """Factors (D,) of specimens like those tested, one for each draw, whatever else is chosen."""
    if held.omega is None or not np.any(held.omega):
        raise ValueError(f"specimen in [material] is true, and the posterior of {path} holds no scatter between "
                         "specimens. Fit replicates (repeated files of one kind) with --posterior, or leave it out.")
    normal = _rng(seed, _SPECIMEN, 0).standard_normal(len(held))
    return np.exp(held.omega * normal)[chosen]


def _rng(seed: int, purpose: int, number: int) -> np.random.Generator:
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_DOMAIN, purpose, number)))
