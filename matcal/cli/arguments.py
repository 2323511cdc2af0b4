"""Words of the command line of `matcal` as values."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from touchcal.terminal import numbers

if TYPE_CHECKING:
    from matcal.card import MaterialCard
    from matcal.fitting.fit_options import FitOptions

# rows of `matcal predict` over what was fitted
_POINTS = 11


def fit_options(order: str, poisson: str | None, stable: str | None, stable_range: str | None, residual: str,
                weight: Sequence[str], prony_terms: str, strain_zero: float, law: str, prony_times: str | None,
                reference: float | None, conduction: str) -> FitOptions:
    """The options behind the flags of `matcal fit`; ValueError names the flag that cannot be read."""
    from matcal.fitting.fit_options import FitOptions

    return FitOptions(_count("--order", order), _poisson(poisson), stable, _stretches(stable_range), residual,
                      _weights(weight), _count("--prony-terms", prony_terms), strain_zero,
                      law.replace("-", "_"), _times(prony_times), reference, conduction)


def points(card: MaterialCard, mode: str, strain: str | None, time: str | None) -> np.ndarray:
    """Where `matcal predict` evaluates a mode, (n,), by default over what was fitted; ValueError where the wrong flag
    is given, or neither where the card does not say what was fitted."""
    from matcal.record.predict import check_mode, fitted_range

    check_mode(mode)
    flag, text, other = ("--time", time, strain) if mode == "relaxation" else ("--strain", strain, time)
    ends = fitted_range(card, mode)
    if other is not None:
        raise ValueError(f"{mode} takes {flag} A,B,... and nothing else to evaluate at.")
    if text is None and ends is None:
        raise ValueError(f"no {mode} test was fitted, whose range could be taken. Give {flag} A,B,...")
    if text is None and ends is not None:
        return np.linspace(*ends, _POINTS)
    return np.array(numbers(text or "", flag, "1,10,100" if mode == "relaxation" else "-0.1,-0.5"))


def _count(flag: str, text: str) -> int | str:
    if text != "auto" and not text.isdecimal():
        raise ValueError(f"{flag} '{text}' is unknown; give 1 to 6 or auto.")
    return text if text == "auto" else int(text)


def _times(text: str | None) -> tuple[float, ...] | None:
    """Times as numbers A,B,... or as FROM:TO:COUNT, evenly in log time."""
    if text is None or ":" not in text:
        return None if text is None else tuple(numbers(text, "--prony-times", "0.1,1,10"))
    ends = numbers(text.replace(":", ","), "--prony-times", "0.01:1e4:13")
    if len(ends) != 3 or not (0 < ends[0] < ends[1] and ends[2] == int(ends[2]) > 1):
        raise ValueError(f"--prony-times '{text}': write FROM:TO:COUNT, for example 0.01:1e4:13.")
    return tuple(np.geomspace(ends[0], ends[1], int(ends[2])).tolist())


def _poisson(text: str | None) -> float | str | tuple[float, ...] | None:
    from matcal.fitting.hyperfoam.poisson import FITTED

    if text is None or text in FITTED:
        return text
    values = tuple(numbers(text, "--poisson", f"0.1 or 0.1,0.2, or one of {', '.join(FITTED)}"))
    return values[0] if len(values) == 1 else values


def _stretches(text: str | None) -> tuple[float, float] | None:
    if text is None:
        return None
    ends = numbers(text, "--stable-range", "0.3,1.5")
    if len(ends) != 2:
        raise ValueError(f"--stable-range '{text}': write two principal stretches LO,HI, for example 0.3,1.5.")
    return ends[0], ends[1]


def _weights(texts: Sequence[str]) -> dict[str, float]:
    out: dict[str, float] = {}
    for text in texts:
        kind, equals, value = text.partition("=")
        if not equals:
            raise ValueError(f"--weight '{text}': write KIND=W, for example --weight shear=2.")
        if kind in out:
            raise ValueError(f"--weight {kind} is given twice. Give one weight a kind.")
        try:
            out[kind] = float(value)
        except ValueError:
            raise ValueError(f"--weight {text}: '{value}' is not a number. Give one weight, for example --weight "
                             f"{kind}=2.") from None
    return out
