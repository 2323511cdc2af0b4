"""The words for a modulus that relaxes, in Pa or over its value at the start."""

import re

_KIND = r"(relaxation|relaxing|shear|young'?s|tensile|elastic|compression|compressive)"
_START = r"(0|o|_0|_o|\(0\)|max|peak)"
_WORDS = (
    ("normalised", rf"(normali[sz]ed|relative|dimensionless|reduced) ({_KIND} )?(modulus|stress|force|relaxation)"
                   r"|(normali[sz]ed )?relaxation (function|ratio)|[eg][ _]?r( ?\(t\))?"
                   rf"|([eg]|sigma|σ|stress|p|f|force)(\(t\))? ?/ ?([eg]|sigma|σ|stress|p|f|force) ?{_START}"
                   r"|normierter? (modul|relaxationsmodul|spannung)|module (relatif|normalise)"),
    ("modulus", rf"(stress )?{_KIND}( {_KIND})? modulus( [eg]( ?r)?)?( ?\(t\))?|modulus"
                r"|[eg][ _](relax|rel|mod|modulus)|[eg] ?\(t\)|g"
                r"|relaxationsmodul|schubmodul|e ?modul|module (de relaxation|de cisaillement|d.young)"
                r"|modulo (de relajacion|di rilassamento)|松弛模量|模量|緩和弾性率"),
)


def modulus_of(name: str) -> str | None:
    """`modulus` or `normalised` for a lower-case column name without its unit, or None."""
    return next((quantity for quantity, pattern in _WORDS if re.fullmatch(pattern, name.strip())), None)
