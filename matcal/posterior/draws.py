"""Draws of whole parameter sets: the file next to the card, cards made from them, bands of what they predict."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from matcal.card import MaterialCard, as_card
from matcal.laws.conductivity import Conductivity
from matcal.laws.deformation_modes import nominal_stress
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from touchcal.arrays import Array
from touchcal.errors import InputFileError
from touchcal.input_file import check_unpacked, regular

FILE = "posterior.nc"
_NAMES = ("mu_Pa", "alpha", "nu", "prony_g", "prony_tau_s", "conductivity_S_per_m")


@dataclass(frozen=True)
class Draws:
    """D parameter sets; row k of every array belongs to one and the same material."""

    mu_Pa: Array  # (D, N) long-term moduli, Pa; N = 0 without a law
    alpha: Array  # (D, N) exponents
    nu: Array  # (D, N) Poisson-like ratios; given as one number where they are all the same
    g: Array | None = None  # (D, M) relaxing fractions; None without a relaxation test
    tau_s: Array | None = None  # (D, M) their times, s
    conductivity_S_per_m: Array | None = None  # (D, 4) c_0 (1, a_1, a_2, a_3), S/m; None without a conductivity test
    omega: Array | None = None  # (D,) standard deviation of ln stiffness between specimens; None without replicates

    def __post_init__(self) -> None:
        object.__setattr__(self, "nu", np.broadcast_to(np.asarray(self.nu, dtype=float), self.mu_Pa.shape))

    def __len__(self) -> int:
        return self.mu_Pa.shape[0]


def read_draws(card: MaterialCard | Path | str) -> Draws:
    """The draws next to a card's file; ValueError where it has none, InputFileError where their file is missing or
    broken."""
    card = as_card(card)
    if not card.posterior:
        raise ValueError(f"{card.file or card.name}: the card has no posterior. Fit it again with --posterior.")
    if (path := card.file) is None or "file" not in card.posterior:
        raise ValueError(f"card '{card.name}' was not saved, and its draws lie next to its file. Save the calibration "
                         "first.")
    file = path.parent / str(card.posterior["file"])
    if not file.exists():
        raise InputFileError(file, f"the posterior that {path.name} names is not there. Keep {file.parent.name} "
                                   "next to the card, or fit it again with --posterior.")
    try:
        found = _stored(regular(file))
        count, omega = next(iter(found.values())).shape[0], found.pop("omega", None)
        if any(len(array) != count or not np.isfinite(array).all() for array in found.values()):
            raise ValueError("its draws are not all finite, or not all as many")
    except InputFileError:
        raise
    except (OSError, KeyError, ValueError, TypeError, AttributeError, RuntimeError, StopIteration) as error:
        why = str(error) or "it holds no draws"
        raise InputFileError(file, f"no posterior that `matcal fit --posterior` wrote, or a damaged one ({why}). "
                                   "Restore it from a copy, or fit it again with --posterior.") from None
    none, omega = np.empty((count, 0)), None if omega is None else np.ravel(omega)
    return Draws(found.get("mu_Pa", none), found.get("alpha", none), found.get("nu", none), found.get("prony_g"),
                 found.get("prony_tau_s"), found.get("conductivity_S_per_m"), omega)


def _stored(file: Path) -> dict[str, Array]:
    """Arrays (D, n) of a posterior's file, n = 1 of "omega", none of which lies in another file."""
    import h5py

    with h5py.File(file) as stored:
        if not isinstance(stored.get("posterior", getlink=True), h5py.HardLink):
            raise ValueError("it holds no group posterior of its own")
        group: Any = stored["posterior"]
        held = {name: group[name] for name in (*_NAMES, "omega") if name in group}
        if any(not isinstance(group.get(name, getlink=True), h5py.HardLink) or held[name].external for name in held):
            raise ValueError("it points to another file")
        check_unpacked(file, sum(8.0 * held[name].size for name in held))
        return {name: np.array(held[name], dtype=float).reshape(-1, 1 if name == "omega" else held[name].shape[-1])
                for name in held}


def card_of(draws: Draws, card: MaterialCard, k: int) -> MaterialCard:
    """The card with the parameters of draw k; parts that were not drawn stay as they are."""
    law = card.hyperfoam
    if law is not None and draws.mu_Pa.shape[1]:
        law = Hyperfoam(draws.mu_Pa[k], draws.alpha[k], draws.nu[k], law.moduli, law.strain_range)
    prony = card.prony if draws.g is None or draws.tau_s is None else Prony(draws.g[k], draws.tau_s[k])
    skin = card.conductivity
    if skin is not None and draws.conductivity_S_per_m is not None:
        c = draws.conductivity_S_per_m[k]
        skin = Conductivity(float(c[0]), c[1:] / c[0], skin.strain_range)
    return replace(card, law=law, prony=prony, conductivity=skin)


def law_of(draws: Draws, k: int) -> Hyperfoam:
    """The long-term law of draw k."""
    return Hyperfoam(draws.mu_Pa[k], draws.alpha[k], draws.nu[k])


def stress_band(draws: Draws, mode: str, strain: ArrayLike, level: float = 0.95) -> tuple[Array, Array]:
    """Pointwise quantiles of nominal stress at strains (n,), Pa: ((n,), (n,))."""
    return quantiles(lambda k: nominal_stress(law_of(draws, k), mode, strain), len(draws), level)


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
    for name, array in (("mu_Pa", draws.mu_Pa), ("alpha", draws.alpha), ("nu", draws.nu), ("prony_g", draws.g),
                        ("prony_tau_s", draws.tau_s), ("conductivity_S_per_m", draws.conductivity_S_per_m)):
        if array is not None and array.shape[1]:
            values[name] = array
    stats = {} if log_density is None else {"lp": log_density[None]}
    stored = arviz.from_dict(posterior={name: np.asarray(array)[None] for name, array in values.items()},
                             sample_stats=stats or None, posterior_attrs=dict(about or {}), attrs=dict(about or {}))
    stored.to_netcdf(str(path), engine="h5netcdf")
