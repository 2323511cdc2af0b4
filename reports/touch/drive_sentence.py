"""What the drive of a scene does, in words."""

from collections.abc import Mapping
from typing import Any

_SINKS = {"adjacent": "at k + 1", "opposite": "at the opposite one"}
_READ = {"single-ended": "electrode k - 1 is the zero of voltage",
         "differential": "each reading is the voltage between two neighbours that carry no current"}


def drive_sentence(drive: Mapping[str, Any]) -> str:
    """Which currents the [drive] of a scene sends and what it reads, electrodes numbered modulo their count."""
    reads = "readings are the weighted sums of voltages that measurements in [drive] give"
    if drive.get("currents") is not None:
        return f"Drive patterns send the currents that currents in [drive] give; {reads}."
    pattern = drive["pattern"]
    sink = _SINKS.get(pattern) or f"at k + {int(pattern.removeprefix('skip-')) + 1}"
    reading = reads if drive.get("measurements") is not None else _READ[drive["reading"]]
    return f"Drive pattern k sends the current +I into electrode k and takes it out {sink}; {reading}."
