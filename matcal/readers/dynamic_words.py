"""The words for the columns of a dynamic test (DMA, rheometer), of a creep, and for a modulus that relaxes."""

import re

import numpy as np

from touchcal.arrays import Array

_STORAGE = r"stor|speicher|conservation|almacen|armazen|conservativ|accumulo|储能|儲能|貯蔵|저장|накоплен"
_LOSS = r"loss|verlust|perte|perdida|perda|perdita|dissip|损耗|損失|손실|потерь"
_TANGENT = (r"tan( ?\(?(delta|δ|d)\)?)?|tand|(mechanical )?(loss|dissipation|damping) (factor|tangent)"
            r"( (tan )?(δ|delta|η|eta))?|verlustfaktor"
            r"|facteur de perte|损耗因子|損失正接|損失係数")
_PHASE = (r"(loss |phase )angle|phase( angle| shift| lag)?|delta|δ|phasen(winkel|verschiebung)|verlustwinkel|dephasage"
          r"|(angulo de|angolo di) (fase|perdita)|相位角|位相角")
_OTHER = r"complian|viscos|rate|nachgieb|visk|energy|energie|work"
_STIFF = re.compile(r"(?:dynamic |dynamische )?(?:stiffness|steifigkeit|rigidite|刚度|剛性)")
_PERIOD = re.compile(r"(oscillation |test |cycle )?period( time)?|(schwingungs)?periode(ndauer)?|periodo|周期|周期时间")
# quantity -> pattern of a whole plain name; the first that matches counts
_WORDS = (
    ("loss_tangent", rf"{_TANGENT}|{_PHASE}"),
    ("complex_modulus", r"\|?[egk]\*\|?|(abs(olute)? )?(complex|dynamic) (\w+ )?modulus( [eg]\*)?|komplexer modul"),
    ("storage", rf"[egk]'(?!')( .*)?|.*({_STORAGE}).*"),
    ("loss", rf"[egk]''( .*)?|.*({_LOSS}).*"),
    ("frequency", r"f|(test |angular |oscillation |reduced |shifted |prüf)?(frequency|freq)( f)?|(kreis)?frequenz|omega"
                  r"|ω|pulsation|(frequence|frecuencia|frequencia|frequenza)( (angulaire|angular|angolare))?"
                  r"|.*(频率|頻率|周波数|주파수|частота).*"),
    ("temperature", r"t|ts|(sample |specimen |probe |set |prüf)?(temperatures?|temp|temperatur[ae]?n?)( t)?"
                    r"|.*(温度|溫度|온도|температура).*"),
)
_ANGULAR = re.compile(r"omega|ω|angular|kreis|pulsation|角")
_COMPLIANCE = re.compile(r"(creep |shear |tensile )?compliance( [jd])?( ?\(t\))?|[jd][ _]?\(t\)|(kriech)?nachgiebigkeit"
                         r"|complaisance( de fluage)?|柔量|クリープコンプライアンス")
# a modulus that relaxes, in Pa or over its value at the start
_KIND = r"(relaxation|relaxing|shear|young'?s|tensile|elastic|compression|compressive)"
_START = r"(0|o|_0|_o|\(0\)|max|peak)"
_RELAXING = (
    ("normalised", rf"(normali[sz]ed|relative|dimensionless|reduced) ({_KIND} )?(modulus|stress|force|relaxation)"
                   r"|(normali[sz]ed )?relaxation (function|ratio)|[eg][ _]?r( ?\(t\))?"
                   rf"|([eg]|sigma|σ|stress|p|f|force)(\(t\))? ?/ ?([eg]|sigma|σ|stress|p|f|force) ?{_START}"
                   r"|normierter? (modul|relaxationsmodul|spannung)|module (relatif|normalise)"),
    ("modulus", rf"(stress )?{_KIND}( {_KIND})? modulus( [eg]( ?r)?)?( ?\(t\))?|modulus"
                r"|[eg][ _](relax|rel|mod|modulus)|[eg] ?\(t\)|g"
                r"|relaxationsmodul|schubmodul|e ?modul|module (de relaxation|de cisaillement|d.young)"
                r"|modulo (de relajacion|di rilassamento)|松弛模量|模量|緩和弾性率"),
)
KELVIN, FAHRENHEIT, CELSIUS = ("k", "kelvin"), ("f", "°f", "degf", "fahrenheit"), ("c", "°c", "degc", "celsius", "℃")


def dynamic_of(name: str) -> str | None:
    """The quantity of a dynamic test that a lower-case column name without its unit stands for, or None; a stiffness
    stands for its modulus."""
    text = name.strip().replace("’", "'").replace("′", "'").replace('"', "''").replace("_", " ")
    if re.search(_OTHER, text):
        return None
    text = _STIFF.sub("dynamic modulus" if _STIFF.fullmatch(text) else "modulus", text)
    return next((quantity for quantity, pattern in _WORDS if re.fullmatch(pattern, text)), None)


def is_compliance(name: str) -> bool:
    """Whether a lower-case column name is that of a creep compliance."""
    return _COMPLIANCE.fullmatch(name.strip().replace("_", " ")) is not None


def modulus_of(name: str) -> str | None:
    """`modulus` or `normalised` for a lower-case column name without its unit, or None."""
    return next((quantity for quantity, pattern in _RELAXING if re.fullmatch(pattern, name.strip())), None)


def is_phase(name: str) -> bool:
    """Whether a column name is that of the angle of which the loss tangent is the tangent."""
    return re.fullmatch(_PHASE, name.strip().lower().replace("_", " ")) is not None


def is_stiffness(name: str) -> bool:
    """Whether a column name is that of a stiffness, force over travel, in place of a modulus."""
    text = name.strip().lower().replace("_", " ")
    return bool(_STIFF.search(text) or re.match(r"\|?k(\*|'|’|′|\")", text))


def is_period(name: str) -> bool:
    """Whether a column name is that of the time that one oscillation takes."""
    return _PERIOD.fullmatch(name.strip().lower().replace("_", " ")) is not None


def is_angular(name: str) -> bool:
    """Whether a frequency's name says that it counts radians."""
    return bool(_ANGULAR.search(name.lower()))


def absolute_temperature(values: Array, unit: str) -> Array:
    """Temperatures (n,) in `unit` (of `KELVIN`, `FAHRENHEIT` or `CELSIUS`) in K."""
    text = unit.strip().lower()
    if text in KELVIN:
        return values
    return (values + 459.67) / 1.8 if text in FAHRENHEIT else np.asarray(values + 273.15)
