"""Impedances next to a strain: a real part is the resistance, a magnitude with its phase gives it."""

import re

import numpy as np

from touchcal.arrays import Array

_MAGNITUDE = re.compile(r"\|z\||z|zmod|z ?(abs|mag|mod)|(abs(olute)? |modulus of |magnitude of )?(the )?impedance"
                        r"( (magnitude|modulus|\|z\|))?|impedanz(betrag)?|scheinwiderstand|阻抗|インピーダンス")
_REAL = re.compile(r"z'|z ?re(al)?|re ?\(?z\)?|real ?\(z\)|(real part of (the )?|real )impedance|impedance real")
_SAID = 0.01  # share by which a reactance in parallel would change the resistance from which on it is said


def is_magnitude(name: str) -> bool:
    """Whether a column name is that of the magnitude of an impedance."""
    return _MAGNITUDE.fullmatch(_plain(name)) is not None


def is_real_part(name: str) -> bool:
    """Whether a column name is that of the real part of an impedance."""
    return _REAL.fullmatch(_plain(name)) is not None


def resistance_of(magnitude_Ohm: Array, tangent: Array, name: str) -> tuple[Array, str, str | None]:
    """The resistance |Z| cos(phase) (n,), Ohm, of impedances (n,) by the tangent of their phase (n,), what was decided,
    and what is to be minded: a reactance in parallel makes the resistance |Z|/cos(phase)."""
    cosine = 1 / np.hypot(1.0, tangent)
    decided = f"column '{name}' is the magnitude of an impedance: resistance = |Z| cos(phase)."
    ratio = float(1 / np.min(cosine) ** 2)
    minded = None if ratio < 1 + _SAID else (
        f"The phase of the impedance '{name}' reaches {np.degrees(np.arccos(np.min(cosine))):.3g} deg: the resistance "
        f"is |Z| cos(phase), which takes the reactance in series (contacts). If it is in parallel, as a capacitance "
        f"over the specimen is, the resistance is up to {ratio:.3g} times as large: measure at a lower frequency.")
    return magnitude_Ohm * cosine, decided, minded


def _plain(name: str) -> str:
    return re.sub(r"[\s_]+", " ", name.strip().lower()).replace("’", "'").replace("′", "'")
