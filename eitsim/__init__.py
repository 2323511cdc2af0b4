"""Touch simulation: large-strain contact of a foam disc, its conductive skin and the electrode voltages."""

# ruff: noqa: F401
from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from eitsim.electrics.curved.solve_curved import solve_curved_skin
    from eitsim.electrics.imaging.images import reconstruct
    from eitsim.electrics.interop.solve_file import solve_sheet_model
    from eitsim.presses.identify import Identified, identify
    from eitsim.presses.next_press import next_presses
    from eitsim.presses.press_file import Press, punch_of, read_presses
    from eitsim.presses.press_model import PressSetup
    from eitsim.scene.curved_skin import CurvedSkin, read_curved_skin
    from eitsim.scene.drive import Drive
    from eitsim.scene.edges.disc import Disc
    from eitsim.scene.edges.outline import Outline
    from eitsim.scene.electrodes import Electrodes
    from eitsim.scene.results import Result
    from eitsim.scene.scene import Accuracy, Body, Hold, Punch, Scene, Skin, read_scene
    from eitsim.sensors.calibration.calibrate import Calibration, calibrate
    from eitsim.sensors.calibration.calibration_file import CalibratedSensor, calibration_document, read_calibration
    from eitsim.sensors.calibration.skin_card import write_skin_card
    from eitsim.sensors.formats.open_file import open_recording
    from eitsim.sensors.inspection import Inspection, inspect
    from eitsim.sensors.layout.sensor_design import SensorDesign, design_sensor
    from eitsim.sensors.recording import Recording, read_recording
    from eitsim.sensors.sensor_file import Sensor, read_sensor
    from eitsim.simulation.press_series import press_of, write_press
    from eitsim.simulation.result_json import result_document
    from eitsim.simulation.simulate import plan, simulate
    from eitsim.sweeps.dataset.parquet import Dataset, open_dataset
    from eitsim.sweeps.design.design import Design, read_design
    from eitsim.sweeps.endless.frame_blocks import Frames, frames
    from eitsim.sweeps.run.measure import measure
    from eitsim.sweeps.run.sweep import sweep

__getattr__, __dir__, __all__ = attach(__name__, __file__)
