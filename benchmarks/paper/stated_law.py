"""The paper's own law, as its Table 1 prints it."""

import numpy as np

from benchmarks.paper.section import paper_value
from matcal.laws.hyperfoam import Hyperfoam
from matcal.laws.prony import Prony
from reports.calibration.stress_figures import StatedLaw

SUBSCRIPTS = "₁₂₃₄₅₆₇₈₉"
TERMS = 3


def table_1() -> StatedLaw:
    """Hyperfoam law with nu = 0, put into equations 2 and 3 as it stands, and its Prony series."""
    mu, alpha, g, tau = (np.array([paper_value("T1", f"{name}{SUBSCRIPTS[k]}") for k in range(TERMS)])
                         for name in ("μ", "α", "g", "τ"))
    return StatedLaw("the paper's Table 1", Hyperfoam(1e3 * mu, alpha, np.zeros(TERMS), "longterm"), Prony(g, tau))
