"""The units of test files as one table: symbols with prefixes, words of several languages, products and powers."""

import re
import unicodedata
from functools import cache

# exponents of metre, kilogram, second, ampere, kelvin, radian; and factor to SI with them
Dimensions = tuple[int, int, int, int, int, int]
Unit = tuple[float, Dimensions]

ONE: Dimensions = (0, 0, 0, 0, 0, 0)
LENGTH: Dimensions = (1, 0, 0, 0, 0, 0)
MASS: Dimensions = (0, 1, 0, 0, 0, 0)
TIME: Dimensions = (0, 0, 1, 0, 0, 0)
FREQUENCY: Dimensions = (0, 0, -1, 0, 0, 0)
ANGULAR: Dimensions = (0, 0, -1, 0, 0, 1)
COMPLIANCE: Dimensions = (1, -1, 2, 0, 0, 0)
STIFFNESS: Dimensions = (0, 1, -2, 0, 0, 0)
FORCE: Dimensions = (1, 1, -2, 0, 0, 0)
PRESSURE: Dimensions = (-1, 1, -2, 0, 0, 0)
CURRENT: Dimensions = (0, 0, 0, 1, 0, 0)
CHARGE: Dimensions = (0, 0, 1, 1, 0, 0)
VOLTAGE: Dimensions = (2, 1, -3, -1, 0, 0)
RESISTANCE: Dimensions = (2, 1, -3, -2, 0, 0)
CONDUCTANCE: Dimensions = (-2, -1, 3, 2, 0, 0)
CAPACITANCE: Dimensions = (-2, -1, 4, 2, 0, 0)
POWER: Dimensions = (2, 1, -3, 0, 0, 0)
ENERGY: Dimensions = (2, 1, -2, 0, 0, 0)
TEMPERATURE: Dimensions = (0, 0, 0, 0, 1, 0)
ANGLE: Dimensions = (0, 0, 0, 0, 0, 1)
# SI units of quantities and sizes
SI = {"": ONE, "s": TIME, "m": LENGTH, "m^2": (2, 0, 0, 0, 0, 0), "N": FORCE, "Pa": PRESSURE, "A": CURRENT,
      "V": VOLTAGE, "ohm": RESISTANCE, "S/m": (-3, -1, 3, 2, 0, 0), "Hz": FREQUENCY, "K": TEMPERATURE,
      "1/Pa": COMPLIANCE}
# what no quantity of a test has -> the words for it
OTHERS = {TEMPERATURE: "a temperature", FREQUENCY: "a frequency", ANGULAR: "a frequency",
          ANGLE: "an angle", CAPACITANCE: "a capacitance", POWER: "a power", ENERGY: "an energy", CHARGE: "a charge",
          CONDUCTANCE: "a conductance", (1, 0, -1, 0, 0, 0): "a speed", (3, 1, -3, -2, 0, 0): "a resistivity",
          (3, 0, 0, 0, 0, 0): "a volume", (-1, 1, -1, 0, 0, 0): "a viscosity", STIFFNESS: "a stiffness",
          MASS: "a mass"}
# newton a kilogram: scales and texture analysers give a force as the mass that weighs as much
G = 9.80665

_POUND, _INCH = 0.45359237, 0.0254
_PSI = _POUND * G / _INCH**2
# symbols that take a prefix, in their own capitals
_PREFIXED: dict[str, Unit] = {
    "m": (1.0, LENGTH), "g": (1e-3, MASS), "s": (1.0, TIME), "A": (1.0, CURRENT), "K": (1.0, TEMPERATURE),
    "N": (1.0, FORCE), "Pa": (1.0, PRESSURE), "V": (1.0, VOLTAGE), "S": (1.0, CONDUCTANCE), "F": (1.0, CAPACITANCE),
    "Hz": (1.0, FREQUENCY), "W": (1.0, POWER), "J": (1.0, ENERGY), "C": (1.0, CHARGE), "rad": (1.0, ANGLE),
    "bar": (1e5, PRESSURE), "gf": (1e-3 * G, FORCE), "dyn": (1e-5, FORCE), "L": (1e-3, (3, 0, 0, 0, 0, 0)),
    "ε": (1.0, ONE), "strain": (1.0, ONE), "ohm": (1.0, RESISTANCE), "ohms": (1.0, RESISTANCE),
    "Ohm": (1.0, RESISTANCE), "Ohms": (1.0, RESISTANCE), "Ω": (1.0, RESISTANCE)}
_PREFIXES = {"": 1.0, "f": 1e-15, "p": 1e-12, "n": 1e-9, "u": 1e-6, "m": 1e-3, "c": 1e-2, "d": 1e-1, "h": 1e2,
             "k": 1e3, "K": 1e3, "M": 1e6, "G": 1e9, "T": 1e12}
_SMALL = {"m", "g", "s", "A", "V"}  # capitals in front of these are a way to write, no prefix: MM, MA, MS
# words, and symbols in any capitals
_WORDS: dict[str, Unit] = {word: unit for words, unit in (
    ("s sec secs second seconds sek sekunde sekunden seconde secondes segundo", (1.0, TIME)),
    ("segundos secondi secondo sekund с сек секунда секунды 秒 초", (1.0, TIME)),
    ("ms msec millisecond milliseconds мс 毫秒", (1e-3, TIME)),
    ("us usec мкс 微秒", (1e-6, TIME)), ("min mins minute minutes minuten мин 分 分钟 분", (60.0, TIME)),
    ("h hr hrs hour hours std stunden ч час 小时 小時", (3600.0, TIME)), ("d day days tage", (86400.0, TIME)),
    ("m meter meters metre metres м 米", (1.0, LENGTH)),
    ("cm centimeter centimeters centimetre см 厘米 公分", (1e-2, LENGTH)),
    ("mm millimeter millimeters millimetre millimetres milimetro milimetros millimetri мм 毫米 公厘", (1e-3, LENGTH)),
    ("um micron microns micrometer micrometers micrometre мкм 微米", (1e-6, LENGTH)), ("nm нм", (1e-9, LENGTH)),
    ('in inch inches zoll "', (_INCH, LENGTH)), ("ft foot feet", (12 * _INCH, LENGTH)),
    ("mil mils thou", (1e-3 * _INCH, LENGTH)), ("furlong", (7920 * _INCH, LENGTH)),
    ("n newton newtons ニュートン н 牛 牛顿 牛頓 뉴턴", (1.0, FORCE)),
    ("kn kilonewton kilonewtons кн 千牛", (1e3, FORCE)),
    ("mn millinewton millinewtons мн 毫牛", (1e-3, FORCE)), ("un", (1e-6, FORCE)),
    ("kgf kp kg-f kilopond кгс 公斤力", (G, FORCE)), ("gf g-f pond гс 克力", (1e-3 * G, FORCE)),
    ("lbf lb-f lbsf", (_POUND * G, FORCE)), ("ozf", (_POUND * G / 16, FORCE)), ("kip kips", (1e3 * _POUND * G, FORCE)),
    ("dyne dynes", (1e-5, FORCE)), ("kg kilogram kilograms кг 公斤", (1.0, MASS)), ("g gram grams г 克", (1e-3, MASS)),
    ("lb lbs pound pounds", (_POUND, MASS)), ("oz ounce ounces", (_POUND / 16, MASS)),
    ("pa pascal pascals па 帕 帕斯卡", (1.0, PRESSURE)), ("kpa kilopascal кпа 千帕", (1e3, PRESSURE)),
    ("mpa megapascal мпа 兆帕", (1e6, PRESSURE)), ("gpa gigapascal гпа 吉帕", (1e9, PRESSURE)),
    ("psi psig psia", (_PSI, PRESSURE)), ("ksi", (1e3 * _PSI, PRESSURE)),
    ("psf", (_PSI / 144, PRESSURE)), ("atm", (101325.0, PRESSURE)),
    ("torr mmhg", (101325.0 / 760, PRESSURE)), ("bar", (1e5, PRESSURE)), ("mbar", (1e2, PRESSURE)),
    ("a amp amps ampere amperes amper а 安", (1.0, CURRENT)), ("ma milliamp milliamps ма 毫安", (1e-3, CURRENT)),
    ("ua microamp microamps мка 微安", (1e-6, CURRENT)), ("na", (1e-9, CURRENT)),
    ("v volt volts в 伏 伏特", (1.0, VOLTAGE)), ("mv millivolt millivolts мв 毫伏", (1e-3, VOLTAGE)),
    ("uv", (1e-6, VOLTAGE)),
    ("ohm ohms ω ом 欧姆 欧 オーム 옴", (1.0, RESISTANCE)),
    ("kohm kohms k-ohm kiloohm kiloohms ком 千欧", (1e3, RESISTANCE)),
    ("megaohm megaohms megohm megohms мом 兆欧", (1e6, RESISTANCE)), ("siemens mho mhos", (1.0, CONDUCTANCE)),
    ("hz hertz гц rpm", (1.0, FREQUENCY)), ("degc °c celsius degf °f fahrenheit kelvin", (1.0, TEMPERATURE)),
    ("rad radian radians", (1.0, ANGLE)), ("gon", (0.015707963267948967, ANGLE)),
    ("deg degs degree degrees grad grado grados gradi degré degrés grader stopnie град 度 °",
     (0.017453292519943295, ANGLE)),
    ("% percent pct prozent процент", (1e-2, ONE)), ("‰ permille", (1e-3, ONE)), ("ppm ue", (1e-6, ONE)),
    ("strain", (1.0, ONE)), ("microstrain ustrain", (1e-6, ONE))) for word in words.split()}
_MEGOHM = {"MOHM", "MOHMS"}  # in capitals a megaohm; mohm is a milliohm
_FACTOR = re.compile(r"([^\W\d_]+(?:-f)?|%|‰|°[CFcf]?|\"|1(?=/))(?:\^|\*\*)?\(?([-+]?\d)?\)?")
_LONGEST = 40


def plain_unit(unit: str) -> str:
    """One spelling of a unit: powers as digits, micro as u, * for every product; a reference, as in `V vs. Ref.`, and
    brackets left out."""
    text = unicodedata.normalize("NFKC", unit[:_LONGEST]).strip().strip("[]").strip()
    text = text.replace("μ", "u").replace("−", "-")
    text = re.sub(r"\s*(?:vs\.?|versus)\s.*$", "", text, flags=re.IGNORECASE)
    return re.sub(r"\s*([*/·⋅×])\s*", lambda found: "/" if found[1] == "/" else "*", text).rstrip(". ")


@cache
def readings(unit: str) -> tuple[Unit, ...]:
    """What a unit may mean, first as its capitals say: mPa is a millipascal, MPA a megapascal; S is a siemens, or else
    a second. None where it is no unit."""
    text = plain_unit(unit)
    if text in _MEGOHM:
        return ((1e6, RESISTANCE),)
    found = [_parsed(text, capitals) for capitals in (True, False)]
    return tuple(dict.fromkeys(one for one in found if one is not None))


def _parsed(text: str, capitals: bool) -> Unit | None:
    """The product of the factors of a unit such as `N/mm2`, `mS cm-1`, `1/s`; None where one of them is unknown."""
    whole = _symbol(text.replace(" ", ""), capitals)
    if whole is not None or not text:
        return whole
    factor, powers, at, sign = 1.0, [0] * 6, 0, 1
    while found := _FACTOR.match(text, at):
        power, unit = sign * int(found[2] or 1), (1.0, ONE) if found[1] == "1" else _symbol(found[1], capitals)
        if unit is None or abs(power) > 4:
            return None
        factor *= unit[0] ** power
        powers = [have + power * one for have, one in zip(powers, unit[1], strict=True)]
        if (at := found.end()) == len(text):
            return factor, (powers[0], powers[1], powers[2], powers[3], powers[4], powers[5])
        if text[at] not in "*/. ":
            return None
        sign, at = -1 if text[at] == "/" else 1, at + 1
    return None


def _symbol(text: str, capitals: bool) -> Unit | None:
    """One factor of a unit, its capitals kept or not."""
    if not capitals:
        return _WORDS.get(text.lower())
    for prefix, scale in _PREFIXES.items():
        base = text[len(prefix):]
        if base == "rad" and scale > 1:  # Grad and grad are degrees
            continue
        if text.startswith(prefix) and base in _PREFIXED and not (prefix in "MGT" and prefix and base in _SMALL):
            return scale * _PREFIXED[base][0], _PREFIXED[base][1]
    return _WORDS.get(text)
