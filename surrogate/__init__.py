"""Learning touches from electrode voltages, simulated or recorded.

>>> import surrogate
>>> list(surrogate.METHODS)
['trainbr', 'network', 'forward', 'ridge', 'gp']
"""

from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from eitsim.sensors.labels import Labels as Labels
    from eitsim.sensors.labels import read_labels as read_labels
    from eitsim.sensors.touch_sets import TouchSets as TouchSets
    from eitsim.sensors.touch_sets import read_touch_sets as read_touch_sets
    from surrogate.bounds.cramer_rao import cramer_rao as cramer_rao
    from surrogate.learners.base import Estimate as Estimate
    from surrogate.learners.base import Learner as Learner
    from surrogate.learners.base import Training as Training
    from surrogate.learners.registry import METHODS as METHODS
    from surrogate.model.evaluate import evaluate as evaluate
    from surrogate.model.model import Model as Model
    from surrogate.model.model import load as load
    from surrogate.model.recorded.learn_presses import learn as learn
    from surrogate.model.recorded.learn_presses import learn_session as learn_session
    from surrogate.model.recorded.learn_sets import learn_sets as learn_sets
    from surrogate.model.recorded.press_model import PressModel as PressModel
    from surrogate.model.recorded.set_model import SetModel as SetModel
    from surrogate.model.simulated.skin_module import Skin as Skin
    from surrogate.model.simulated.touch_map import TouchMap as TouchMap
    from surrogate.model.simulated.touch_map import touch_map as touch_map
    from surrogate.model.sweep_model import SweepModel as SweepModel
    from surrogate.model.tracking.tracked import Tracked as Tracked
    from surrogate.model.tracking.tracker import Tracker as Tracker
    from surrogate.model.train import train as train

__getattr__, __dir__, __all__ = attach(__name__, __file__)
