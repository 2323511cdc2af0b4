"""The methods of surrogates: one line a method. A class is imported when it is needed."""

from __future__ import annotations

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from surrogate.learners.base import Learner


@dataclass(frozen=True)
class Method:
    """A way to learn touches from voltages."""

    name: str  # word on the command line and in model files
    where: str  # its learner, "module:Class"
    summary: str  # in a few words, for lists
    description: str  # in a sentence or two, for reports
    epochs: int = 0  # steps of an iterated method where none are given; 0 for the others
    slow: bool = False  # whether an estimate takes long enough for the scales of intervals to be kept between runs
    # whether estimates say what of their standard deviation is due to noise and to the material
    separates_errors: bool = False
    most_scored: int | None = None  # training rows that are scored after the training, at most; None for all
    most_noisy: int | None = None  # rows that are scored under each level of noise then, at most; None for all

    def learner(self) -> type[Learner]:
        """The class of its learner, imported now."""
        return pkgutil.resolve_name(self.where)


METHODS = {method.name: method for method in (
    Method("trainbr", "surrogate.learners.trainbr:Trainbr", "the paper's networks",
           "One network with one hidden layer an output, on min-max voltages, trained by Levenberg–Marquardt with "
           "Bayesian regularisation: it minimises β E_D + α E_W, the weighted squares of errors and of weights, "
           "and takes α and β from the evidence.", epochs=300),
    Method("network", "surrogate.learners.network:FeatureNetworks", "the same made robust",
           "One network with one hidden layer an output, on the direction and the logarithmic size of the signal, "
           "trained by Levenberg–Marquardt with Bayesian regularisation after a warm-up, anew where it collapses.",
           epochs=300),
    Method("forward", "surrogate.learners.forward:TouchInversion", "learned forward map, inverted",
           "A learned map from a touch to its signal, inverted by least squares for every frame; the mechanical "
           "outputs follow from the touch that was found.",
           slow=True, separates_errors=True, most_scored=600, most_noisy=200),
    Method("ridge", "surrogate.learners.ridge:Ridge", "ridge regression",
           "Ridge regression on quadratic features of the signal's direction and size."),
    Method("gp", "surrogate.learners.gp:Processes", "Gaussian processes",
           "A Gaussian process of each output on the signal's direction and size.", slow=True),
)}


def method_of(name: str) -> Method:
    """The method of this name; ValueError lists the known."""
    if name not in METHODS:
        raise ValueError(f"method '{name}' is unknown; known: {', '.join(METHODS)}.")
    return METHODS[name]


def listed(which: Callable[[Method], object]) -> str:
    """Names of the methods of which something holds, separated by commas."""
    return ", ".join(method.name for method in METHODS.values() if which(method))
