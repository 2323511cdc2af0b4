"""A trained model, whatever it was learnt from: of a sweep, of recorded presses, or of several touches at once."""

from pathlib import Path

from surrogate.learners.registry import METHODS
from surrogate.model import store
from surrogate.model.recorded.press_model import BY_FAMILIES, PressModel
from surrogate.model.recorded.set_model import SUPERPOSITION, SetModel
from surrogate.model.sweep_model import SweepModel
from touchcal.errors import InputFileError

Model = SweepModel | PressModel


def load(folder: Path | str) -> Model | SetModel:
    """Read a model that its `save`, `surrogate train` or `surrogate learn` wrote.

    Parameters
    ----------
    folder : path
        Folder of the model.

    Returns
    -------
    SweepModel, PressModel or SetModel

    Raises
    ------
    InputFileError
        Where the folder holds no model, one of another schema, or a damaged one.

    Examples
    --------
    >>> surrogate.load("model").method
    'forward'
    """
    return store.read(Path(folder), (SweepModel, PressModel, SetModel), (*METHODS, BY_FAMILIES, SUPERPOSITION))


def load_of_sweep(folder: Path | str) -> SweepModel:
    """A model of a sweep, for what reads no other; InputFileError as `load`, and for one of recorded presses."""
    model = load(folder)
    if isinstance(model, PressModel | SetModel):
        raise InputFileError(folder, "a model of a recording, whose presses alone it knows; this needs one of a sweep. "
                                     "Read it with `surrogate predict`; `surrogate report` has its scores.")
    return model


def load_single(folder: Path | str) -> Model:
    """A model that reads one touch a frame; InputFileError as `load`, and for one of several touches at once."""
    model = load(folder)
    if isinstance(model, SetModel):
        raise InputFileError(folder, "a model of several touches at once, which `surrogate predict` and `surrogate "
                                     "evaluate` read with a recording; this needs a model of one touch a frame.")
    return model
