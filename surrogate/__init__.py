"""Learning touches from electrode voltages.

>>> import surrogate
>>> model = surrogate.train("sweep", method="forward", seed=1)     # doctest: +SKIP
>>> model.predict(frames_V, baseline_V)                            # doctest: +SKIP
>>> list(surrogate.METHODS)
['trainbr', 'network', 'forward', 'mlp', 'ridge', 'gp']
"""

from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from surrogate.bounds.cramer_rao import cramer_rao as cramer_rao
    from surrogate.learners.base import Learner as Learner
    from surrogate.learners.registry import METHODS as METHODS
    from surrogate.model.evaluate import evaluate as evaluate
    from surrogate.model.model import Model as Model
    from surrogate.model.model import load as load
    from surrogate.model.tracked import Tracked as Tracked
    from surrogate.model.tracker import Tracker as Tracker
    from surrogate.model.train import train as train

__getattr__, __dir__, __all__ = attach(__name__, {
    "METHODS": "surrogate.learners.registry", "Learner": "surrogate.learners.base", "Model": "surrogate.model.model",
    "cramer_rao": "surrogate.bounds.cramer_rao", "evaluate": "surrogate.model.evaluate",
    "load": "surrogate.model.model", "train": "surrogate.model.train",
    "Tracked": "surrogate.model.tracked", "Tracker": "surrogate.model.tracker"})
