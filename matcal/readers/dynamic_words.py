"""The words for the columns of a dynamic test (DMA, rheometer) and of a creep."""

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
_OTHER = r"complian|viscos|stiff|rate|nachgieb|visk|energy|energie|work"
# quantity -> pattern of a whole plain name; the first that matches counts
_WORDS = (
    ("loss_tangent", rf"{_TANGENT}|{_PHASE}"),
    ("complex_modulus", r"\|?[eg]\*\|?|(abs(olute)? )?(complex|dynamic) (\w+ )?modulus( [eg]\*)?|komplexer modul"),
    ("storage", rf"[eg]'(?!')( .*)?|.*({_STORAGE}).*"),
    ("loss", rf"[eg]''( .*)?|.*({_LOSS}).*"),
    ("frequency", r"f|(test |angular |oscillation |reduced |shifted |prüf)?(frequency|freq)( f)?|(kreis)?frequenz|omega"
                  r"|ω|pulsation|(frequence|frecuencia|frequencia|frequenza)( (angulaire|angular|angolare))?"
                  r"|.*(频率|頻率|周波数|주파수|частота).*"),
    ("temperature", r"t|ts|(sample |specimen |probe |set |prüf)?(temperatures?|temp|temperatur[ae]?n?)( t)?"
                    r"|.*(温度|溫度|온도|температура).*"),
)
_ANGULAR = re.compile(r"omega|ω|angular|kreis|pulsation|角")
_COMPLIANCE = re.compile(r"(creep |shear |tensile )?compliance( [jd])?( ?\(t\))?|[jd][ _]?\(t\)|(kriech)?nachgiebigkeit"
                         r"|complaisance( de fluage)?|柔量|クリープコンプライアンス")
KELVIN, FAHRENHEIT, CELSIUS = ("k", "kelvin"), ("f", "°f", "degf", "fahrenheit"), ("c", "°c", "degc", "celsius", "℃")


def dynamic_of(name: str) -> str | None:
    """The quantity of a dynamic test that a lower-case column name without its unit stands for, or None."""
    text = name.strip().replace("’", "'").replace("′", "'").replace('"', "''").replace("_", " ")
    if re.search(_OTHER, text):
        return None
    return next((quantity for quantity, pattern in _WORDS if re.fullmatch(pattern, text)), None)


def is_compliance(name: str) -> bool:
    """Whether a lower-case column name is that of a creep compliance."""
    return _COMPLIANCE.fullmatch(name.strip().replace("_", " ")) is not None


def is_phase(name: str) -> bool:
    """Whether a column name is that of the angle of which the loss tangent is the tangent."""
    return re.fullmatch(_PHASE, name.strip().lower().replace("_", " ")) is not None


def is_angular(name: str) -> bool:
    """Whether a frequency's name says that it counts radians."""
    return bool(_ANGULAR.search(name.lower()))


def absolute_temperature(values: Array, unit: str) -> Array:
    """Temperatures (n,) in `unit` (of `KELVIN`, `FAHRENHEIT` or `CELSIUS`) in K."""
    text = unit.strip().lower()
    if text in KELVIN:
        return values
    return (values + 459.67) / 1.8 if text in FAHRENHEIT else np.asarray(values + 273.15)
