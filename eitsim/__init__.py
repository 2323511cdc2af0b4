"""Touch simulation: large-strain contact of a foam disc, its conductive skin and the electrode voltages."""

# ruff: noqa: F401
from typing import TYPE_CHECKING

from touchcal.lazy import attach

if TYPE_CHECKING:
    from eitsim.electrics.curved.solve_curved import solve_curved_skin
    from eitsim.electrics.imaging.images import reconstruct
    from eitsim.electrics.interop.solve_file import solve_sheet_model
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
    from eitsim.sweeps.run.measure import measure
    from eitsim.sweeps.run.sweep import sweep

__getattr__, __dir__, __all__ = attach(__name__, {
    "Accuracy": "eitsim.scene.scene",
    "Body": "eitsim.scene.scene",
    "CalibratedSensor": "eitsim.sensors.calibration.calibration_file",
    "Calibration": "eitsim.sensors.calibration.calibrate",
    "CurvedSkin": "eitsim.scene.curved_skin",
    "Dataset": "eitsim.sweeps.dataset.parquet",
    "Design": "eitsim.sweeps.design.design",
    "Disc": "eitsim.scene.edges.disc",
    "Drive": "eitsim.scene.drive",
    "Electrodes": "eitsim.scene.electrodes",
    "Hold": "eitsim.scene.scene",
    "Inspection": "eitsim.sensors.inspection",
    "Outline": "eitsim.scene.edges.outline",
    "Punch": "eitsim.scene.scene",
    "Recording": "eitsim.sensors.recording",
    "Result": "eitsim.scene.results",
    "Scene": "eitsim.scene.scene",
    "Sensor": "eitsim.sensors.sensor_file",
    "SensorDesign": "eitsim.sensors.layout.sensor_design",
    "Skin": "eitsim.scene.scene",
    "calibrate": "eitsim.sensors.calibration.calibrate",
    "calibration_document": "eitsim.sensors.calibration.calibration_file",
    "design_sensor": "eitsim.sensors.layout.sensor_design",
    "inspect": "eitsim.sensors.inspection",
    "measure": "eitsim.sweeps.run.measure",
    "open_dataset": "eitsim.sweeps.dataset.parquet",
    "open_recording": "eitsim.sensors.formats.open_file",
    "plan": "eitsim.simulation.simulate",
    "press_of": "eitsim.simulation.press_series",
    "read_calibration": "eitsim.sensors.calibration.calibration_file",
    "read_curved_skin": "eitsim.scene.curved_skin",
    "read_design": "eitsim.sweeps.design.design",
    "read_recording": "eitsim.sensors.recording",
    "read_scene": "eitsim.scene.scene",
    "read_sensor": "eitsim.sensors.sensor_file",
    "reconstruct": "eitsim.electrics.imaging.images",
    "result_document": "eitsim.simulation.result_json",
    "simulate": "eitsim.simulation.simulate",
    "solve_curved_skin": "eitsim.electrics.curved.solve_curved",
    "solve_sheet_model": "eitsim.electrics.interop.solve_file",
    "sweep": "eitsim.sweeps.run.sweep",
    "write_press": "eitsim.simulation.press_series",
    "write_skin_card": "eitsim.sensors.calibration.skin_card",
})
