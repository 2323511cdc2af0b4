"""Dead channels in words."""

import numpy as np
import pytest

from surrogate.data.dead_readings import Costs, cost_said, errors_said


@pytest.mark.parametrize(("costs", "said"), [
    ({"place": (2.31, 2.1, "mm"), "F_N": (0.1201, 0.12, "N")},
     "mean error by the presses: place about 2.31 mm without, 2.1 with; unchanged: F_N"),
    ({"place": (2.31, 2.1, "mm"), "F_N": (0.13, 0.12, "N")},
     "mean error by the presses: place about 2.31 mm without, 2.1 with, F_N about 0.13 N without, 0.12 with"),
    ({"place": (2.1001, 2.1, "mm"), "F_N": (0.12, 0.12, "N")},
     "mean errors by the presses are the same without and with")])
def test_costs_are_stated_of_outputs_that_change(costs: Costs, said: str) -> None:
    assert errors_said("presses", costs) == said
    assert cost_said(np.arange(4) == 2, "presses", costs, ()).endswith(f"v_002 is dead and left out, and intervals are "
                                                                       f"wider for it; {said}")
