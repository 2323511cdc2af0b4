"""Clocks that are written as times of day, dates with them, or minutes and seconds, turned into seconds."""

import re
from collections.abc import Sequence
from datetime import datetime
from functools import cache

_DAY = 86400.0
_OF_DAY = r"(?:(\d{1,4}):)?(\d{1,2}):(\d{1,2}(?:[.,:]\d{1,9})?)"
_CLOCK = re.compile(_OF_DAY + r"\s*([ap]m)?", re.IGNORECASE)
_DATED = re.compile(r"(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})[T ,;]+" + _OF_DAY
                    + r"\s*([ap]m)?\s*(?:Z|[-+]\d{2}:?\d{2})?", re.IGNORECASE)


# 20240131T100000.5, and 31-Jan-2024 10:00:00 or Jan 31, 2024 10:00:00 PM
_BASIC = re.compile(r"(\d{4})(\d{2})(\d{2})[T_ -]?(\d{2})(\d{2})(\d{2}(?:[.,]\d{1,9})?)(?:Z|[-+]\d{2}:?\d{2})?")
_MONTH = r"([^\W\d_]{3,9})\.?"
_NAMED = re.compile(rf"(?:[^\W\d_]{{2,9}}[.,]* )?(?:(\d{{1,2}})\.?[- /]{_MONTH}|{_MONTH} (\d{{1,2}}),?)[- /](\d{{4}})"
                    + r"[T ,;]+" + _OF_DAY + r"\s*([ap]m)?", re.IGNORECASE)
_MONTHS = ("jan", "feb", "mar mär mrz", "apr", "may mai", "jun", "jul", "aug", "sep", "oct okt", "nov", "dec dez")


@cache
def seconds_of(cell: str) -> float | None:
    """Seconds of a cell such as 00:01:02.5, 01:02 (minutes and seconds), 2024-01-31T10:00:00, 20240131T100000,
    31.01.2024 10:00:00 or 31-Jan-2024 10:00:00; None where it is no clock."""
    if len(cell) > 40:
        return None
    if "T" in cell and (found := _BASIC.fullmatch(cell)):
        year, month, date, *clock = found.groups()
        day, clock_s = _day(year, month, date, "-"), _of_day(*clock)
        return None if day is None or clock_s is None else day + clock_s
    if ":" not in cell:
        return None
    if found := _NAMED.fullmatch(cell):
        first, named, name, second, year, *clock = found.groups()
        month = next((k for k, words in enumerate(_MONTHS, 1)
                      if any((named or name).lower().startswith(word) for word in words.split())), 0)
        day, clock_s = _day(year, str(month), first or second, "-"), _of_day(*clock)
        return None if day is None or clock_s is None else day + clock_s
    if found := _CLOCK.fullmatch(cell):
        return _of_day(*found.groups())
    if found := _DATED.fullmatch(cell):
        first, mark, second, third, *clock = found.groups()
        day, clock_s = _day(first, second, third, mark), _of_day(*clock)
        return None if day is None or clock_s is None else day + clock_s
    return None


def elapsed(cells: Sequence[str]) -> list[float | None]:
    """Seconds since the first clock of a column, midnight passed over; None for a cell that is no clock."""
    out: list[float | None] = []
    first, before, added = None, None, 0.0
    for cell in cells:
        value = seconds_of(cell)
        if value is None:
            out.append(None)
            continue
        if before is not None and value < _DAY and value < before - _DAY / 2:
            added += _DAY
        first, before = (value if first is None else first), value
        out.append(round(value + added - first, 9))
    return out


def _of_day(hours: str | None, minutes: str, seconds: str, half: str | None = None) -> float | None:
    whole, part = re.fullmatch(r"(\d+)(?:[.,:](\d+))?", seconds).groups()  # type: ignore[union-attr]
    value = float(hours or 0) * 3600 + float(minutes) * 60 + float(f"{whole}.{part or 0}")
    if half:
        value += {"a": -1, "p": 0}[half[0].lower()] * (12 * 3600) * (hours == "12") \
            + 12 * 3600 * (half[0].lower() == "p" and hours != "12")
    return value if float(minutes) < 60 or hours is None else None


def _day(first: str, second: str, third: str, mark: str) -> float | None:
    """Seconds of midnight of a date: year first, or day first, or month first where only that can be."""
    year, month, day = (first, second, third) if len(first) == 4 else (third, second, first)
    if len(first) != 4 and mark == "/" and int(second) > 12:
        month, day = first, second
    try:
        date = datetime(int(year) + 2000 * (len(year) <= 2), int(month), int(day))
        return (date - datetime(1970, 1, 1)).total_seconds()
    except ValueError:
        return None
