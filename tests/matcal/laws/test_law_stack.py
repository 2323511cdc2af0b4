"""A stack of laws is its laws one by one."""

import numpy as np
import pytest

from matcal.laws.law import vector, with_vector
from matcal.laws.law_stack import LawStack
from matcal.laws.neo_hooke import NeoHooke


@pytest.mark.parametrize("nu", [0.0, 0.3, 0.49, 0.5])
def test_moduli_at_rest_are_those_of_the_laws(nu: float) -> None:
    law = NeoHooke(9e3, nu)
    draws = vector(law) * np.column_stack([np.linspace(0.5, 2, 5), np.ones(5)])
    shear, bulk = LawStack(law, draws).moduli_at_rest
    each = [with_vector(law, one) for one in draws]
    np.testing.assert_allclose(shear, [one.mu_0_Pa for one in each], rtol=1e-9)
    np.testing.assert_allclose(bulk, [one.kappa_0_Pa for one in each], rtol=1e-9)
