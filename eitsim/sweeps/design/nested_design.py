"""Nested designs: blocks of four rows, two touches with two cards each, that part the variance of touch and card.

Row i belongs to block i // 4; touches 2b and 2b + 1 of block b meet cards 2b and 2b + 1. Each block holds the base
sample, the second one and both mixed ones of the pick-freeze scheme (Saltelli et al. 2010,
DOI 10.1016/j.cpc.2009.09.018), and depends on nothing but its number.
"""

from eitsim.sweeps.design.card_draws import Material

SAMPLER = "nested"
# touches and cards of a block
SHAPE = (2, 2)
BLOCK = 4


def check(scenes: int, material: Material | None, listed: bool) -> None:
    """ValueError where a number of rows makes no whole blocks, touches are listed, or the two cards of a block cannot
    differ."""
    if listed:
        raise ValueError(f"sampler \"{SAMPLER}\" draws touches by chance, and a key goes through a list. Give ranges, "
                         "laws or {choice = [...]} in place of lists, grids and rows.")
    if scenes % BLOCK:
        raise ValueError(f"scenes = {scenes}: sampler \"{SAMPLER}\" makes blocks of {BLOCK} rows, two touches with two "
                         f"cards each. Give {scenes + -scenes % BLOCK}.")
    if material is None:
        raise ValueError(f"sampler \"{SAMPLER}\" parts the variance of touch and card, and all rows have one card. "
                         "Add a table [material], or use \"random\".")
    if material.rows_per_draw > 1 or material.draws == 1:
        raise ValueError(f"sampler \"{SAMPLER}\" gives each block two cards of its own; leave rows_per_draw out of "
                         "[material], and ask for 2 draws or more.")


def touch_number(row: int) -> int:
    """Number of the touch that a row of a nested design holds: rows (touch, card) 00, 01, 10, 11 make a block."""
    return 2 * (row // BLOCK) + row % BLOCK // 2


def card_number(row: int) -> int:
    """Number of the card that a row of a nested design is solved with."""
    return 2 * (row // BLOCK) + row % 2
