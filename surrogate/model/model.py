"""A trained model, whatever it was learnt from: of a sweep or of recorded presses."""

from pathlib import Path

from surrogate.learners.registry import METHODS
from surrogate.model import store
from surrogate.model.recorded.press_model import BY_FAMILIES, PressModel
from surrogate.model.sweep_model import SweepModel
from touchcal.errors import InputFileError

Model = SweepModel | PressModel


def load(folder: Path | str) -> Model:
    """Read a model that its `save`, `surrogate train` or `surrogate learn` wrote.

    Parameters
    ----------
    folder : path
        Folder of the model.

    Returns
    -------
    SweepModel or PressModel

    Raises
    ------
    InputFileError
        Where the folder holds no model, one of another schema, or a damaged one.
    """
    return store.read(Path(folder), (SweepModel, PressModel), (*METHODS, BY_FAMILIES))


def load_of_sweep(folder: Path | str) -> SweepModel:
    """A model of a sweep, for what reads no other; InputFileError as `load`, and for one of recorded presses."""
    model = load(folder)
    if isinstance(model, PressModel):
        raise InputFileError(folder, "a model of a recording, whose presses alone it knows; this needs one of a sweep. "
                                     "Read it with `surrogate predict`; `surrogate report` has its scores.")
    return model
