"""What the user may choose about a calibration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from matcal.fitting.hyperfoam.poisson import Poisson
from matcal.laws.conduction_laws import conduction_law
from matcal.laws.deformation_modes import MODES
from matcal.laws.known_laws import law_type
from matcal.laws.law import has_terms
from matcal.reduction.experiment import Experiment

AUTO = "auto"  # in place of a law: chosen from the tests
GENERAL_ORDERS = (1, 2, 3, 4)  # terms of a law other than hyperfoam that has them
RELAXING = ("relaxation", "creep", "dma")  # kinds of tests that a Prony series is fitted to
_MOST_ZERO = 0.1  # most standard deviation of a strain zero


@dataclass(frozen=True)
class FitOptions:
    """What the user may choose about a calibration.

    ValueError for a range over which no law is held stable.

    >>> FitOptions(order=2, weights={"shear": 2.0}).prony_terms
    'auto'
    """

    order: int | str = "auto"  # terms of the law: 1 to 6, or "auto"
    # one Poisson-like ratio for all terms, one a term, "fit" (one), "fit-each", or None: a foam's 0
    poisson: Poisson | None = None
    stable: str | None = None  # criterion that the law must satisfy, one of matcal.laws.stability.CRITERIA, or None
    stable_range: tuple[float, float] | None = None  # principal stretches between which it must; None: the curves'
    residual: str = "relative"  # how residuals are measured, one of matcal.fitting.hyperfoam.curves.RESIDUALS
    weights: Mapping[str, float] = field(default_factory=dict)  # kind -> weight
    prony_terms: int | str = "auto"  # terms of the Prony series: 1 to 30, or "auto"
    strain_zero_sd: float = 0.0  # standard deviation of the strain zero of tests that do not state one
    law: str = "hyperfoam"  # name of the law, one of matcal.laws.known_laws, or AUTO
    prony_times_s: tuple[float, ...] | None = None  # relaxation times, s, where they are not fitted
    reference_C: float | None = None  # temperature of the series of sweeps at several; None: that nearest 20 C
    conduction: str = AUTO  # name of the skin's law, one of matcal.laws.conduction_laws, or AUTO

    def __post_init__(self) -> None:
        if not 0 <= self.strain_zero_sd < _MOST_ZERO:
            raise ValueError(f"`strain_zero_sd` {self.strain_zero_sd:g}: the standard deviation of a strain zero lies "
                             f"between 0 and {_MOST_ZERO:g}, for example 0.002.")
        self._check_law()
        if self.conduction != AUTO:
            conduction_law(self.conduction)
        if self.prony_times_s is not None and not (
                len(self.prony_times_s) and all(t > 0 for t in self.prony_times_s)
                and all(a < b for a, b in zip(self.prony_times_s, self.prony_times_s[1:], strict=False))):
            raise ValueError(f"`prony_times` {','.join(f'{t:g}' for t in self.prony_times_s)}: relaxation times are "
                             "above 0 s and increase, for example 0.1,1,10.")
        if self.stable_range is not None and self.stable is None:
            raise ValueError(f"`stable_range` {','.join(f'{end:g}' for end in self.stable_range)}: no law is held "
                             "stable, so there is nothing to hold it over. Add `stable` drucker or `stable` elliptic, "
                             "or leave it out.")

    def _check_law(self) -> None:
        """ValueError for an unknown law, and for a choice that it does not have."""
        if self.law == AUTO:
            return
        kind = law_type(self.law)
        names = [p.name for p in kind.parameters]
        if has_terms(kind) and not kind.keeps_volume:
            return
        if kind.keeps_volume and isinstance(self.poisson, int | float) and not 0 <= self.poisson <= 0.5:
            raise ValueError(f"`poisson` {self.poisson:g}: that of {self.law} lies between 0 and 0.5, which keeps the "
                             "volume.")
        if has_terms(kind) and self.order not in ("auto", *GENERAL_ORDERS):
            raise ValueError(f"`order` {self.order}: {self.law} is fitted with {GENERAL_ORDERS[0]} to "
                             f"{GENERAL_ORDERS[-1]} terms.")
        given = {"order": self.order != "auto" and not has_terms(kind), "stable": self.stable is not None,
                 "poisson": self.poisson not in (None, "fit") and not (
                     "nu" in names and isinstance(self.poisson, int | float))}
        if wrong := [flag for flag, used in given.items() if used]:
            raise ValueError(f"`{wrong[0]}` is not a choice of the law {self.law}, whose parameters are "
                             f"{', '.join(names)}; it is one of a law with terms. Leave it out, or leave `law` out.")

    @property
    def given(self) -> dict[str, float]:
        """Parameters of a law other than hyperfoam that are not fitted."""
        return {"nu": float(self.poisson)} if isinstance(self.poisson, int | float) else {}

    def check_used(self, experiments: Sequence[Experiment]) -> None:
        """ValueError for a choice that no test can obey."""
        kinds, plain = ", ".join(dict.fromkeys(e.kind for e in experiments)), FitOptions()
        of_law = {"law": self.law != plain.law, "order": self.order != plain.order,
                  "poisson": self.poisson != plain.poisson,
                  "stable": self.stable is not None, "residual": self.residual != plain.residual,
                  "weights": bool(self.weights)}
        given = [flag for flag, differs in of_law.items() if differs]
        if given and not any(e.kind in MODES for e in experiments):
            raise ValueError(f"`{given[0]}` is about the law of a stress-strain curve, and the tests are {kinds} only. "
                             f"Leave it out, or add one of {', '.join(MODES)}.")
        if (self.prony_terms != plain.prony_terms or self.prony_times_s is not None) and not any(
                e.kind in RELAXING for e in experiments):
            flag = "prony_terms" if self.prony_times_s is None else "prony_times"
            raise ValueError(f"`{flag}`: the tests are {kinds} only, and a Prony series needs a relaxation, creep or "
                             "dynamic test. Leave it out, or add relaxation=FILE.")
        if self.conduction != plain.conduction and not any(e.kind == "conductivity" for e in experiments):
            raise ValueError(f"`conduction` {self.conduction}: the tests are {kinds} only. Leave it out, or add "
                             "conductivity=FILE.")
        if self.reference_C is not None and not any(
                e.sweep is not None and e.sweep.temperature_K.size > 1 for e in experiments):
            raise ValueError(f"`reference_temperature` {self.reference_C:g}: no dynamic test has several temperatures. "
                             "Leave it out.")
