"""Material calibration: load-frame and potentiostat files in, a material card with its uncertainty out."""

# ruff: noqa: F401
from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from matcal.card import MaterialCard, read_card, write_card
    from matcal.fitting.fit_options import FitOptions
    from matcal.laws.conductivity import Conductivity
    from matcal.laws.deformation_modes import nominal_stress
    from matcal.laws.histories.damage import Damage
    from matcal.laws.hyperfoam import Hyperfoam
    from matcal.laws.prony import Prony
    from matcal.laws.stability import stability
    from matcal.record.calibration import Calibration, fit
    from matcal.record.exporters.deck import export
    from matcal.record.importers.read_deck import import_deck
    from matcal.record.next_test.next_tests import next_tests
    from matcal.record.predict import check, follow_path, predict
    from matcal.reduction.experiment import Experiment
    from matcal.reduction.inspect import inspect
    from matcal.reduction.reduce import read_test

__getattr__, __dir__, __all__ = attach(__name__, __file__)
