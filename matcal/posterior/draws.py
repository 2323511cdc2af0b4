"""Draws of whole parameter sets: the file next to the card, cards made from them, bands of what they predict."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from matcal.card import MaterialCard, as_card
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import law_of
from matcal.laws.law import Law
from matcal.laws.prony import Prony
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked, regular

FILE = "posterior.nc"
_SERIES = ("prony_g", "prony_tau_s", "conductivity_S_per_m", "omega")


@dataclass(frozen=True)
class Draws:
    """D parameter sets; row k of every array belongs to one and the same material."""

    # parameter of the long-term law -> (D, terms), terms = 1 of a single number; empty without a law
    law: Mapping[str, Array]
    kind: type[Law] = Hyperfoam  # of the law
    g: Array | None = None  # (D, M) relaxing fractions; None without a relaxation test
    tau_s: Array | None = None  # (D, M) their times, s
    conductivity_S_per_m: Array | None = None  # (D, 1 + m) c_0 (1, a), S/m, of the card's law; None without a test
    omega: Array | None = None  # (D,) standard deviation of ln stiffness between specimens; None without replicates

    def __len__(self) -> int:
        every = (*self.law.values(), self.g, self.conductivity_S_per_m)
        return next((len(array) for array in every if array is not None), 0)

    def taken(self, rows: NDArray[np.int64]) -> Draws:
        """The draws of some rows."""
        others = {name: part[rows] for name in ("g", "tau_s", "conductivity_S_per_m", "omega")
                  if (part := getattr(self, name)) is not None}
        return replace(self, law={name: array[rows] for name, array in self.law.items()}, **others)


def foam_draws(mu_Pa: Array, alpha: Array, nu: Array | float, **others: Any) -> Draws:
    """Draws of hyperfoams with mu_Pa, alpha (D, N) and nu (D, N), or one number where it is one for all."""
    ratio = np.broadcast_to(np.asarray(nu, dtype=float), mu_Pa.shape)
    return Draws({"mu_Pa": mu_Pa, "alpha": alpha, "nu": ratio}, **others)


def read_draws(card: MaterialCard | Path | str) -> Draws:
    """The draws next to a card's file; ValueError where it has none, InputFileError where their file is missing or
    broken."""
    card = as_card(card)
    if not card.posterior:
        raise ValueError(f"{card.file or card.name}: the card has no posterior. Fit it again with one: `matcal fit "
                         "--posterior`.")
    if (path := card.file) is None or "file" not in card.posterior:
        raise ValueError(f"card '{card.name}' was not saved, and its draws lie next to its file. Save the calibration "
                         "first.")
    file = path.parent / str(card.posterior["file"])
    if not file.exists():
        raise InputFileError(file, f"the posterior that {path.name} names is not there. Keep {file.parent.name} "
                                   "next to the card, or fit it again with the posterior.")
    try:
        kind = Hyperfoam if card.law is None else type(card.law)
        found = _stored(regular(file), [p.name for p in kind.parameters])
        count = next(iter(found.values())).shape[0]
        if any(len(array) != count or not np.isfinite(array).all() for array in found.values()):
            raise ValueError("its draws are not all finite, or not all as many")
    except InputFileError:
        raise
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, StopIteration) as error:
        why = str(error) or "it holds no draws"
        raise InputFileError(file, f"no posterior that `matcal fit --posterior` wrote, or a damaged one ({why}). "
                                   "Restore it from a copy, or fit it again.") from None
    omega = None if (omega := found.get("omega")) is None else np.ravel(omega)
    law = {p.name: found[p.name] for p in kind.parameters if p.name in found}
    return Draws(law, kind, found.get("prony_g"), found.get("prony_tau_s"), found.get("conductivity_S_per_m"), omega)


def _stored(file: Path, parameters: Sequence[str]) -> dict[str, Array]:
    """Arrays (D, n) of a posterior's file, n = 1 of single numbers, none of which lies in another file."""
    import h5py

    with h5py.File(file) as stored:
        if not isinstance(stored.get("posterior", getlink=True), h5py.HardLink):
            raise ValueError("it holds no group posterior of its own")
        group: Any = stored["posterior"]
        held = {name: group[name] for name in (*parameters, *_SERIES) if name in group}
        if any(not isinstance(group.get(name, getlink=True), h5py.HardLink) or held[name].external for name in held):
            raise ValueError("it points to another file")
        check_unpacked(file, sum(8.0 * held[name].size for name in held))
        return {name: np.array(held[name], dtype=float).reshape(-1, 1 if held[name].ndim == 2 else held[name].shape[-1])
                for name in held}


def card_of(draws: Draws, card: MaterialCard, k: int) -> MaterialCard:
    """The card with the parameters of draw k; parts that were not drawn stay as they are."""
    law = card.law
    if law is not None and draws.law:
        law = law_of(draws.kind.name, parameters(draws, k), law.moduli, law.strain_range)
    prony = card.prony if draws.g is None or draws.tau_s is None else Prony(draws.g[k], draws.tau_s[k])
    skin = card.conductivity
    if skin is not None and draws.conductivity_S_per_m is not None:
        c = draws.conductivity_S_per_m[k]
        skin = replace(skin, c0_S_per_m=float(c[0]), a=c[1:] / c[0])
    return replace(card, law=law, prony=prony, conductivity=skin)


def parameters(draws: Draws, k: int) -> list[list[float]]:
    """Plain numbers of the long-term law of draw k, as `matcal.laws.known_laws.law_of` takes them."""
    return [array[k].tolist() for array in draws.law.values()]


def quantiles(value: Callable[[int], ArrayLike], count: int, level: float = 0.95) -> tuple[Array, Array]:
    """Pointwise quantiles over draws 0 ... count - 1 of value(k), an array of one shape."""
    values = np.stack([np.asarray(value(k), dtype=float) for k in range(count)])
    low, high = np.quantile(values, [(1 - level) / 2, (1 + level) / 2], axis=0)
    return low, high


def write_draws(draws: Draws, path: Path, derived: Mapping[str, Array], log_density: Array | None = None,
                about: Mapping[str, str | int | float] | None = None) -> None:
    """Store draws as NetCDF for arviz: group `posterior`, (1, D, ...) arrays thinned from all chains, with what follows
    from them, `derived` (name -> (D,)), group `sample_stats` with their log density (D,), and `about` as attributes."""
    import arviz

    values = dict(derived) | ({} if draws.omega is None else {"omega": draws.omega})
    for name, array in (*draws.law.items(), ("prony_g", draws.g), ("prony_tau_s", draws.tau_s),
                        ("conductivity_S_per_m", draws.conductivity_S_per_m)):
        if array is not None and array.shape[1]:
            values[name] = array
    stats = {} if log_density is None else {"lp": log_density[None]}
    stored = arviz.from_dict(posterior={name: np.asarray(array)[None] for name, array in values.items()},
                             sample_stats=stats or None, posterior_attrs=dict(about or {}), attrs=dict(about or {}))
    stored.to_netcdf(str(path), engine="h5netcdf")
