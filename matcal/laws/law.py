"""What a hyperelastic law is: its parameters, and energy, stress, tangent and divided difference of its stretches.

A law is isotropic and hyperelastic: U(x) of the logarithmic principal stretches x_k = ln lambda_k, per unit volume,
with principal Kirchhoff stresses tau_k = dU/dx_k. It is a frozen dataclass that inherits `Law`, in a file of its
own, and a line in `matcal.laws.known_laws`. Its four functions of numbers or arrays serve arrays and, by
`matcal.laws.compiled_response`, the compiled loops of the finite elements.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, ClassVar, TypeVar

import numpy as np
from numpy.typing import ArrayLike

from touchcal.arrays import Array
from touchcal.jit import where

Real = Array | float  # an array, or a number inside a compiled loop
Ranges = Mapping[str, tuple[float, float]]
MODULI = ("instantaneous", "longterm")
L = TypeVar("L", bound="Law")


@dataclass(frozen=True)
class Parameter:
    """A parameter of a law, named as in the card, with its unit at the end of the name."""

    name: str
    bounds: tuple[float, float]  # least and largest value that a fit tries; the card may hold others
    start: float  # where a fit begins; moduli are then scaled together to the data
    each_term: bool = False  # whether a law has one a term, and so an array of them
    varied: bool = True  # whether derivatives by it are taken; not by what is chosen for a material, as a foam's nu

    @property
    def numbered(self) -> str:
        """Its name with a place for the number of the term, if there are terms: mu_{}_Pa."""
        stem, pascal, _ = self.name.partition("_Pa")
        return f"{stem}_{{}}{pascal}" if self.each_term else self.name


class Law:
    """An isotropic hyperelastic law with its parameters."""

    __dataclass_fields__: ClassVar[dict[str, Any]]
    name: ClassVar[str]  # in a card, and after --law
    parameters: ClassVar[tuple[Parameter, ...]]  # each an attribute: a number, or an array of one number a term
    linear_parameters: ClassVar[tuple[str, ...]] = ()  # in which the nominal stress of every mode is linear
    keeps_volume: ClassVar[bool] = False  # whether nu is 1/2 where no test says another
    # fills the response of many points, as in `matcal.laws.compiled_response`; None: by the functions below
    respond: ClassVar[Callable[..., None] | None] = None
    moduli: str  # whether the moduli are those before or after relaxation, one of MODULI
    strain_range: Ranges  # mode -> (lowest, highest) fitted nominal strain (gamma for shear, J for volumetric)

    @staticmethod
    def energy_at(p: Any, x_1: Any, x_2: Any, x_3: Any) -> Any:
        """U, Pa, for the `numbers` p at logarithmic stretches: numbers, or arrays of one shape."""
        raise NotImplementedError

    @staticmethod
    def stress_at(p: Any, x_1: Any, x_2: Any, x_3: Any) -> Any:
        """(tau_1, tau_2, tau_3), Pa, as `energy_at`."""
        raise NotImplementedError

    @staticmethod
    def tangent_at(p: Any, x_1: Any, x_2: Any, x_3: Any) -> Any:
        """d tau_k/dx_l, Pa, at k l of ENTRIES, as `energy_at`."""
        raise NotImplementedError

    @staticmethod
    def difference_at(p: Any, mean: Any, half: Any, x_3: Any) -> Any:
        """(tau_1 - tau_2)/(x_1 - x_2), Pa, at x_1, x_2 = mean +- half, without cancellation at half = 0."""
        raise NotImplementedError

    def __post_init__(self) -> None:
        check(self)

    @property
    def numbers(self) -> Array:
        """What `energy_at` and its like take as p."""
        return vector(self)

    @property
    def incompressible(self) -> bool:
        """Whether the law keeps its volume at every state: its nu is 1/2."""
        return bool(np.all(np.asarray(getattr(self, "nu", 0.0)) == 0.5))

    @property
    def body(self) -> str:
        """What it is a law of: "rubber" where nu is 1/2, or is unless a test says another; else "foam"."""
        return "rubber" if self.keeps_volume or self.incompressible else "foam"

    @property
    def mu_0_Pa(self) -> float:
        """Initial shear modulus, Pa."""
        return float(self._at_rest[0, 0] - self._at_rest[0, 1]) / 2

    @property
    def kappa_0_Pa(self) -> float:
        """Initial bulk modulus, Pa."""
        return float(self._at_rest[0, 0] + 2 * self._at_rest[0, 1]) / 3

    @cached_property
    def _at_rest(self) -> Array:
        return self.tangent(np.zeros(3))

    @property
    def E_0_Pa(self) -> float:
        """Initial Young's modulus, Pa."""
        bulk = self.kappa_0_Pa
        if self.incompressible:
            return 3 * self.mu_0_Pa
        return 9 * bulk * self.mu_0_Pa / (3 * bulk + self.mu_0_Pa)

    @property
    def hencky_ratio(self) -> tuple[float, bool]:
        """-x_free/x_driven of faces without stress, uniaxial and near rest, and whether nu is that at every strain."""
        if self.incompressible:
            return 0.5, True
        bulk, mu_0 = self.kappa_0_Pa, self.mu_0_Pa
        return (3 * bulk - 2 * mu_0) / (6 * bulk + 2 * mu_0), False

    def energy(self, x: ArrayLike) -> Array:
        """Strain energy per reference volume, Pa, (...), at logarithmic stretches x (..., 3)."""
        with np.errstate(over="ignore", invalid="ignore"):
            return np.asarray(self.energy_at(self.numbers, *_columns(x)))

    def kirchhoff(self, x: ArrayLike) -> Array:
        """Principal Kirchhoff stresses tau_k = dU/dx_k, Pa, (..., 3), at logarithmic stretches x (..., 3)."""
        return kirchhoff_of(type(self), self.numbers, x)

    def tangent(self, x: ArrayLike) -> Array:
        """d tau_k/dx_l = d2U/dx_k dx_l, Pa, (..., 3, 3), symmetric, at logarithmic stretches x (..., 3)."""
        return tangent_of(type(self), self.numbers, x)

    def difference(self, mean: ArrayLike, half: ArrayLike, third: ArrayLike) -> Array:
        """Divided difference (tau_1 - tau_2)/(x_1 - x_2), Pa, at x_1, x_2 = mean +- half and x_3, of any one shape."""
        at = (np.asarray(value, dtype=float) for value in (mean, half, third))
        return np.asarray(self.difference_at(self.numbers, *np.broadcast_arrays(*at)))


# Rows and columns that `Law.tangent_at` gives.
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def kirchhoff_of(kind: type[Law], numbers: Array, x: ArrayLike) -> Array:
    """`Law.kirchhoff` of the numbers of one law, or (K, D, 1) of D laws at x (D, n, 3)."""
    return np.stack(np.broadcast_arrays(*kind.stress_at(numbers, *_columns(x))), axis=-1)


def tangent_of(kind: type[Law], numbers: Array, x: ArrayLike) -> Array:
    """`Law.tangent`, as `kirchhoff_of`."""
    columns = _columns(x)
    out = np.empty((*columns[0].shape, 3, 3))
    for (k, m), value in zip(ENTRIES, kind.tangent_at(numbers, *columns), strict=True):
        out[..., k, m] = out[..., m, k] = value
    return out


def has_terms(kind: type[Law]) -> bool:
    """Whether a law is a sum of terms, whose number a fit chooses."""
    return any(p.each_term for p in kind.parameters)


def check(law: Law) -> None:
    """ValueError for parameters that are no finite numbers, for no positive mu_0, and for an unknown kind of moduli."""
    if bad := [p.name for p in law.parameters if not np.all(np.isfinite(getattr(law, p.name)))]:
        raise ValueError(f"{law.name}: {', '.join(bad)} must be finite.")
    if not law.mu_0_Pa > 0:
        raise ValueError(f"{law.name}: mu_0 must be positive, got {law.mu_0_Pa:g} Pa.")
    if law.moduli not in MODULI:
        raise ValueError(f"{law.name}: moduli '{law.moduli}' is unknown; known: {', '.join(MODULI)}.")


def vector(law: Law) -> Array:
    """(K,) all parameters of a law, one after another."""
    return np.concatenate([np.ravel(getattr(law, p.name)) for p in law.parameters]).astype(float)


def with_vector(law: L, values: ArrayLike) -> L:
    """The law with these parameters (K,)."""
    shapes = [np.shape(getattr(law, p.name)) for p in law.parameters]
    ends = np.cumsum([math.prod(shape) for shape in shapes])[:-1]
    parts = zip(law.parameters, shapes, np.split(np.asarray(values, dtype=float), ends), strict=True)
    return replace(law, **{p.name: part if shape else float(part[0]) for p, shape, part in parts})


def expanded(law: Law) -> list[tuple[Parameter, str]]:
    """Each of `vector`: its parameter, and its name, as mu_1_Pa."""
    return [(p, p.numbered.format(k + 1)) for p in law.parameters for k in range(np.size(getattr(law, p.name)))]


def differentiable(law: Law) -> list[tuple[str, Array]]:
    """Name, as mu_1_Pa, and unit vector (K,) of each parameter by which derivatives are taken."""
    named = expanded(law)
    return [(name, one) for (p, name), one in zip(named, np.eye(len(named)), strict=True) if p.varied]


def units(law: Law) -> Array:
    """(K,) size in which each of `vector` is measured: mu_0 of moduli, else 1."""
    return np.concatenate([np.full(np.size(getattr(law, p.name)), law.mu_0_Pa if p.name in moduli_of(law) else 1.0)
                           for p in law.parameters])


def values_of(law: Law) -> tuple[tuple[float, ...], ...]:
    """The parameters of a law as plain numbers, of terms too."""
    return tuple(tuple(np.ravel(getattr(law, p.name)).tolist()) for p in law.parameters)


def scaled(law: L, factor: float) -> L:
    """The law with its moduli, and so all stresses, times a factor."""
    return replace(law, **{name: getattr(law, name) * factor for name in moduli_of(law)})


def over(law: L, unit_Pa: float) -> L:
    """The law with its moduli, and so all stresses, in this unit."""
    return replace(law, **{name: getattr(law, name) / unit_Pa for name in moduli_of(law)})


def moduli_of(law: Law | type[Law]) -> list[str]:
    """Names of parameters whose unit is Pa: stresses are homogeneous of degree 1 in all of them together."""
    return [p.name for p in law.parameters if p.name.endswith("_Pa")]


def sinh_ratio(z: Real) -> Real:
    """sinh(z)/z without cancellation, 1 at 0."""
    small = np.abs(z) < 1e-4
    return where(small, 1 + z * z / 6, np.sinh(z) / where(small, 1.0, z))


def _columns(x: ArrayLike) -> tuple[Array, ...]:
    return tuple(np.moveaxis(np.asarray(x, dtype=float), -1, 0))
