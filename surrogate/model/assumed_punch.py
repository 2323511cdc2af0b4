"""The punch that a model takes every touch to be made by, in words."""

from dataclasses import replace
from typing import TypeVar

import numpy as np

from surrogate.data.outputs import of
from surrogate.learners.forward import TouchInversion
from surrogate.model.trained import TrainedModel

Kind = TypeVar("Kind", bound=TrainedModel)
MOST = 8  # diameters that are listed; more are a range


def assumed_punch(model: TrainedModel) -> str:
    """What is assumed of the punch: its profile as trained, and the diameters that were."""
    profile = model.record["dataset"].get("profile", "as in the training sweep")
    d_mm = np.asarray(getattr(getattr(model.learner, "forward", None), "known_mm", ()))
    if 1 <= len(d_mm) <= MOST:
        sizes = "of no diameter but " + ", ".join(f"{d:g}" for d in d_mm) + " mm"
    elif (diameter := of("d").name) in model.names:
        k = model.names.index(diameter)
        sizes = f"of {model.trained.lowest[k]:g} to {model.trained.highest[k]:g} mm"
    else:
        sizes = "of the trained diameters"
    others = [one.profile for one in getattr(model.learner, "profiles", ())]
    held = f"; intervals of F hold the force of profile {', '.join(others)} too" if others else ""
    return f"one punch, {profile}, {sizes}{held}"


def of_trained_profile(model: Kind) -> Kind:
    """The model whose intervals hold for the trained profile alone."""
    learner = model.learner
    return replace(model, learner=replace(learner, profiles=())) if isinstance(learner, TouchInversion) else model
