"""How the law that was chosen is fitted: a hyperfoam by variable projection, any other by least squares."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from matcal.fitting.fit_options import FitOptions
from matcal.fitting.general_fit import fit_law
from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.hyperfoam.hyperfoam_fit import Fit, fit, quick_law
from matcal.fitting.hyperfoam.poisson import FITTED, FOAM
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.known_laws import law_type
from matcal.laws.law import Law, vector

_FEW = 3  # starts of a fit on the way


class Fitter(Protocol):
    """Fits of one law, with what was chosen about it."""

    @property
    def seeks_load_zero(self) -> bool:
        """Whether the zero of a table's load is sought where nothing states it."""
        ...

    def shape(self, curves: Sequence[Curve]) -> Law:
        """A law for the shape of the curves, on the way."""
        ...

    def quick(self, curves: Sequence[Curve], order: int | None = None) -> Fit:
        """A fit that refines the records, of an order where the law has one; without laws of single modes."""
        ...

    def again(self, curves: Sequence[Curve], law: Law) -> Fit:
        """A quick fit of the order of a law that was fitted to nearly the same curves."""
        ...

    def fit(self, curves: Sequence[Curve]) -> Fit:
        """The fit that is reported."""
        ...


def fitter_of(options: FitOptions, near: Law | None = None) -> Fitter:
    """The fitter of the law that is chosen, from `near` where it was fitted before; ValueError for an unknown law."""
    return _ByProjection(options) if law_type(options.law) is Hyperfoam else _ByLeastSquares(options, near)


@dataclass(frozen=True)
class _ByProjection:
    options: FitOptions

    @property
    def seeks_load_zero(self) -> bool:
        """No: it moved the known mu_0 of a foam by 0.5 %, and its intervals hold without."""
        return False

    def shape(self, curves: Sequence[Curve]) -> Law:
        nu = self.options.poisson
        return quick_law(curves, self.options.order,
                         FOAM if nu is None or isinstance(nu, str) else float(np.mean(nu)))

    def quick(self, curves: Sequence[Curve], order: int | None = None) -> Fit:
        own, nu = _with_one_nu(self.options)
        return fit(curves, order or own, nu, starts=_FEW, thorough=False)

    def again(self, curves: Sequence[Curve], law: Law) -> Fit:
        return self.quick(curves, np.size(vector(law)) // len(law.parameters))

    def fit(self, curves: Sequence[Curve]) -> Fit:
        chosen = self.options
        return fit(curves, chosen.order, chosen.poisson, stable=chosen.stable, stable_range=chosen.stable_range)


@dataclass(frozen=True)
class _ByLeastSquares:
    options: FitOptions
    near: Law | None  # where a search begins and ends; None: anywhere

    @property
    def seeks_load_zero(self) -> bool:
        """Yes: intervals of a rubber's mu_0 held in a quarter to a half of sets without."""
        return True

    def shape(self, curves: Sequence[Curve]) -> Law:
        return self.quick(curves).law

    def quick(self, curves: Sequence[Curve], order: int | None = None) -> Fit:
        return fit_law(curves, law_type(self.options.law), self.options.given, order or self.options.order, False,
                       self.near if order is None else None)

    def again(self, curves: Sequence[Curve], law: Law) -> Fit:
        return fit_law(curves, law_type(self.options.law), self.options.given, self.options.order, False, law)

    def fit(self, curves: Sequence[Curve]) -> Fit:
        return fit_law(curves, law_type(self.options.law), self.options.given, self.options.order, near=self.near)


def _with_one_nu(options: FitOptions) -> tuple[int | str, float | str | None]:
    """Order and nu of the fit that refines the records: one nu for all terms."""
    if options.poisson is None:
        return options.order, None
    if isinstance(options.poisson, str):
        return options.order, "fit" if options.poisson in FITTED else options.poisson
    values = np.atleast_1d(options.poisson)
    return options.order if values.size == 1 else values.size, float(values.mean())
