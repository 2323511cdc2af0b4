"""Learning touches from electrode voltages.

>>> import surrogate
>>> model = surrogate.train("sweep", method="forward", seed=1)     # doctest: +SKIP
>>> model.predict(frames_V, baseline_V)                            # doctest: +SKIP
>>> labels = surrogate.read_labels("touches.csv")                  # doctest: +SKIP
>>> reader = surrogate.train_reader(recording, labels, seed=1)     # doctest: +SKIP
>>> surrogate.read_touches(reader, recording)                      # doctest: +SKIP
>>> list(surrogate.METHODS)
['trainbr', 'network', 'forward', 'ridge', 'gp']
"""

from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from eitsim.sensors.labels import Labels as Labels
    from eitsim.sensors.labels import read_labels as read_labels
    from surrogate.bounds.cramer_rao import cramer_rao as cramer_rao
    from surrogate.learners.base import Learner as Learner
    from surrogate.learners.registry import METHODS as METHODS
    from surrogate.model.evaluate import evaluate as evaluate
    from surrogate.model.model import Model as Model
    from surrogate.model.model import load as load
    from surrogate.model.tracking.tracked import Tracked as Tracked
    from surrogate.model.tracking.tracker import Tracker as Tracker
    from surrogate.model.train import train as train
    from surrogate.recordings.trained.reader_store import load_reader as load_reader
    from surrogate.recordings.trained.reader_store import save_reader as save_reader
    from surrogate.recordings.trained.reader_table import read_touches as read_touches
    from surrogate.recordings.trained.train_reader import TrainedReader as TrainedReader
    from surrogate.recordings.trained.train_reader import train_reader as train_reader

__getattr__, __dir__, __all__ = attach(__name__, {
    "METHODS": "surrogate.learners.registry", "Labels": "eitsim.sensors.labels",
    "Learner": "surrogate.learners.base", "Model": "surrogate.model.model",
    "TrainedReader": "surrogate.recordings.trained.train_reader",
    "cramer_rao": "surrogate.bounds.cramer_rao", "evaluate": "surrogate.model.evaluate",
    "load": "surrogate.model.model", "load_reader": "surrogate.recordings.trained.reader_store",
    "read_labels": "eitsim.sensors.labels", "read_touches": "surrogate.recordings.trained.reader_table",
    "save_reader": "surrogate.recordings.trained.reader_store", "train": "surrogate.model.train",
    "train_reader": "surrogate.recordings.trained.train_reader",
    "Tracked": "surrogate.model.tracking.tracked", "Tracker": "surrogate.model.tracking.tracker"})
