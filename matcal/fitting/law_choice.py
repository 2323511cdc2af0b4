"""What `law` auto takes: a foam's hyperfoam, or of the rubber laws that predict nearly best the one that fits best."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from matcal.fitting.fit_options import AUTO, FitOptions
from matcal.fitting.hyperfoam.curves import Curve
from matcal.fitting.law_ranking import Ranked, band_over, deciding, ranked
from matcal.fitting.rubber_or_foam import Kind, kind_of
from matcal.laws.law import Law, has_terms
from touchcal.number_words import percent

_NEARLY = 0.5  # weight over the largest from which on a law predicts nearly best

__all__ = ["LawChoice", "band_over", "chosen_law"]


@dataclass(frozen=True)
class LawChoice:
    """A law that was chosen for the tests."""

    kind: Kind  # what they are of
    laws: tuple[Ranked, ...] = ()  # those compared, the best first; none of a foam
    # mode without a test in which they differ most, and by how much over their mean; None where every mode has one
    deciding: tuple[str, float] | None = None
    law: Law | None = None  # the one that was taken, as compared

    @property
    def sentences(self) -> tuple[str, ...]:
        """What was decided."""
        said = [f"The tests are taken for those of a {'rubber' if self.kind.rubber else 'foam'}: {self.kind.because}."
                if self.kind.decided else f"Rubber or foam is not decided: {self.kind.because}. The law is a foam's."]
        if self.laws:
            said.append("Laws by how they predict what they were not fitted to: " + ", ".join(
                f"{row.law.name} {percent(row.predicted)} (weight {row.weight:.2g})" for row in self.laws) + ".")
        return tuple(said)


def chosen_law(curves: Sequence[Curve], options: FitOptions,
               corrected: Callable[[Sequence[Curve]], Sequence[Curve]]) -> tuple[FitOptions, LawChoice | None]:
    """The options with a law in place of auto, and how it was chosen; None where it was given, or there is no curve.
    `corrected` gives the curves of a rubber the histories with which the law is fitted. ValueError where a rubber's law
    does not have what the options ask for."""
    if options.law != AUTO:
        return options, None
    kind = kind_of(curves, options.poisson) if curves else None
    if kind is None or not kind.rubber:
        return replace(options, law="hyperfoam"), LawChoice(kind) if kind else None
    laws = ranked(corrected(curves), options.given)
    near = [row for row in laws if row.weight >= _NEARLY * laws[0].weight]
    best = min(near, key=lambda row: row.fitted)
    terms = np.size(getattr(best.law, best.law.parameters[0].name))
    order = terms if has_terms(type(best.law)) else options.order
    nu = 0.5 if not best.law.keeps_volume and options.poisson is None else options.poisson
    return replace(options, law=best.law.name, order=order, poisson=nu), LawChoice(
        kind, laws, deciding(laws), best.law)
