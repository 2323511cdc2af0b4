"""Words of the command line of `matcal` as values, and which of them a given call cannot use."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from matcal.fitting.calibrate import Choices, is_curve
from matcal.fitting.hyperfoam.poisson import FITTED
from matcal.laws.deformation_modes import MODES
from matcal.reduction.experiment import Experiment
from touchcal.terminal import numbers


def input_of(text: str) -> tuple[str | None, tuple[Path, ...]]:
    """(kind or None, files) of `[KIND=]FILE[,FILE]`; a file of that very name goes first."""
    kind, _, rest = text.rpartition("=") if "=" in text and not Path(text).exists() else ("", "", text)
    return kind or None, tuple(Path(part) for part in (rest.split(",") if not Path(rest).exists() else [rest]))


def choices(order: str, poisson: str, stable: str | None, stable_range: str | None, residual: str,
            weight: Sequence[str], prony_terms: str) -> Choices:
    """The choices behind the flags of `matcal fit`; ValueError names the flag that cannot be read."""
    if stable_range is not None and stable is None:
        raise ValueError(f"--stable-range {stable_range}: no law is held stable, so there is nothing to hold it over. "
                         "Add --stable drucker or --stable elliptic, or leave it out.")
    return Choices(_count("--order", order), _poisson(poisson), stable, _stretches(stable_range), residual,
                   _weights(weight), prony_terms=_count("--prony-terms", prony_terms))


def check_used(chosen: Choices, experiments: Sequence[Experiment]) -> None:
    """ValueError for a choice that no test of the call can obey."""
    kinds = ", ".join(dict.fromkeys(e.kind for e in experiments))
    plain = Choices()
    of_law = {"--order": chosen.order != plain.order, "--poisson": chosen.poisson != plain.poisson,
              "--stable": chosen.stable is not None, "--residual": chosen.residual != plain.residual,
              "--weight": bool(chosen.weights)}
    given = [flag for flag, differs in of_law.items() if differs]
    if given and not any(is_curve(e) for e in experiments):
        raise ValueError(f"{given[0]} is about the law of a stress-strain curve, and the tests are {kinds} only. Leave "
                         f"it out, or add one of {', '.join(MODES)}.")
    if chosen.prony_terms != plain.prony_terms and not any(e.kind == "relaxation" for e in experiments):
        raise ValueError(f"--prony-terms {chosen.prony_terms}: the tests are {kinds} only, and a Prony series needs a "
                         "relaxation test. Leave it out, or add relaxation=FILE.")


def points(mode: str, strain: str | None, time: str | None) -> np.ndarray:
    """Where `matcal predict` evaluates a mode, (n,); ValueError where the wrong flag is given."""
    flag, text, other = ("--time", time, strain) if mode == "relaxation" else ("--strain", strain, time)
    if text is None or other is not None:
        raise ValueError(f"{mode} takes {flag} A,B,... and nothing else to evaluate at.")
    return np.array(numbers(text, flag, "1,10,100" if mode == "relaxation" else "-0.1,-0.5"))


def _count(flag: str, text: str) -> int | str:
    if text != "auto" and not text.isdecimal():
        raise ValueError(f"{flag} '{text}' is unknown; give 1 to 6 or auto.")
    return text if text == "auto" else int(text)


def _poisson(text: str) -> float | str | tuple[float, ...]:
    if text in FITTED:
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
