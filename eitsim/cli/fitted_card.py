"""A warning where a card is given that is not the one fitted to the presses of a calibrated sensor."""

import sys
from pathlib import Path

from eitsim.scene.calibrated_electrodes import same_card
from eitsim.scene.scene_files import with_files
from touchcal.toml_file import read_toml


def warn_of_other_card(card: Path, own: Path, size_error: float, where: str) -> None:
    """On standard error, that the error of the size of signals is not of `card`, where it is not the sensor's `own`."""
    if not same_card(card, own):
        print(f"eitsim: --card {card} is not {own}, the card of this scene's calibrated sensor: the size error of "
              f"{size_error:.2g} in {where} is not of the card given, and may be far too small.", file=sys.stderr)


def check_card_of_design(card: Path, design: Path) -> None:
    """The same warning for the rows of a design, or of the scene file of a table of scenes (TOML)."""
    tables = with_files(read_toml(design), design.parent)
    own, size_error = tables.get("card"), tables.get("channels", {}).get("size_error")
    if isinstance(own, str) and size_error:
        warn_of_other_card(card, design.parent / own, size_error[0], "the rows")
