"""The materials that the benchmarks share."""

import numpy as np

from matcal.laws.conductivity import Conductivity
from matcal.laws.hyperfoam import Hyperfoam

# The paper's foam, and a skin of plausible conductivity: the paper prints none.
TABLE_1 = Hyperfoam(np.array([14420.0, 16780.0, -21670.0]), np.array([0.288, 4.249, 0.741]), np.zeros(3))
SKIN_LAW = Conductivity(30.0, np.array([-2.0, 2.0, -1.0]), (0.0, 0.4))
