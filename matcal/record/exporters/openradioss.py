"""OpenRadioss: /MAT/LAW42 (OGDEN), elastic.

Energy: W = sum mu_p/alpha_p (sum_k lambda_bar_k^alpha_p - 3) + K/2 (J - 1)^2, at most five pairs, K from the initial
shear modulus sum mu_p alpha_p/2 and NU: the card's Ogden with mu_p = 2 mu_i/alpha_i, and its Mooney-Rivlin with alpha 2
and -2. Fields of 20 columns, two blank cards for further pairs.

Source: Altair Radioss Reference Guide, /MAT/LAW42 (OGDEN); `hm_read_mat42.F` of OpenRadioss.
"""

from matcal.record.exporters.base import Material, Target, Written, elastic_warning, moduli_note
from matcal.record.exporters.formatting import commented_file, identifier, number
from matcal.record.exporters.rubber_constants import powers, stiff

WIDTH, MOST_TERMS = 20, 5


def write(material: Material) -> Written:
    """The material as /MAT/LAW42; ValueError without a density, and for more than five terms."""
    if material.density is None:
        raise ValueError("OpenRadioss needs a density. Give `density`, in kg/m3.")
    pairs = powers(material) or []
    if len(pairs) > MOST_TERMS:
        raise ValueError(f"OpenRadioss takes at most {MOST_TERMS} Ogden terms, the card has {len(pairs)}.")
    _, nu, said = stiff(material)
    pairs = [*pairs, *[(0.0, 0.0)] * (MOST_TERMS - len(pairs))]
    lines = ("/MAT/LAW42/1", identifier(material.name), _fields(material.density),
             _fields(nu, 0.0) + "0".rjust(20) + _fields(1.0) + "0".rjust(10) + "1".rjust(10),
             _fields(*(mu for mu, _ in pairs)), "", _fields(*(alpha for _, alpha in pairs)), "")
    notes = (moduli_note(material), "Cards: density; nu, cut-off, bulk function, its scale, viscous terms, form 1 (K/2 "
             "(J - 1)^2); mu_1 to mu_5 (2 mu_i/alpha_i of the card); alpha_1 to alpha_5.")
    return Written(lines, notes, (*said, *elastic_warning(material, "LAW42 takes moduli of its Maxwell terms and not "
                                                                     "the card's shares")))


def _fields(*values: float) -> str:
    return "".join(number(v, WIDTH - 1).rjust(WIDTH) for v in values)


TARGET = Target("OpenRadioss", write, commented_file("#"), ("ogden", "mooney_rivlin"))
