"""Numbers of pages that a comment ties to a stored table stand in the text above it and are the table's values.

    <!-- figures of benchmarks/results/real_skins.csv | split=time, taken=last, output=place:
    1.11 = error | skin=skin_plain, labels=0
    90 = 100 * median x_in_90 | labels=20
    -->

follows a paragraph, list or table. After the table's name stand conditions for all lines; a line has a number as it is
written in the text, a column, its factor and how its rows are taken together if they are several, and conditions of its
own. A condition's value is that of the column, nothing where the column is empty.
"""

import csv
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from touchcal.arrays import Mask

ROOT = Path(__file__).parents[1]
PAGES = [ROOT / "README.md", *(page for page in sorted((ROOT / "docs").rglob("*.md")) if "made" not in page.parts)]
COMMENT = re.compile(r"<!--.*?-->", flags=re.DOTALL)
FIGURES = re.compile(r"<!-- figures of (?P<table>[^\s:|]+)(?: \|(?P<shared>[^:]*))?:(?P<lines>.*?)-->", flags=re.DOTALL)
LINE = re.compile(r"(?P<number>-?[\d.,]*\d(?:e-?\d+)?) = (?:(?P<factor>[\d.e-]+) \* )?"
                  r"(?:(?P<by>median|mean|max|min|sum|count) )?(?P<column>\w+)(?: \|(?P<own>.*))?")


def holds(table: pd.DataFrame, conditions: str) -> Mask:
    """Whether each row of a table of texts has the values of `column=value, "column=a value, with a comma"`."""
    kept = np.ones(len(table), dtype=bool)
    for one in filter(None, *csv.reader([conditions], skipinitialspace=True)):
        column, value = one.strip().split("=", 1)
        kept &= (table[column] == value).to_numpy()
    return kept


def is_rounded(number: str, value: float) -> bool:
    """Whether a number as it is written is a value rounded: whole numbers to their last digit that is not 0, and to two
    digits or more."""
    digits, _, power = number.replace(",", "").lstrip("-").partition("e")
    whole, _, decimals = digits.partition(".")
    zeros = 0 if decimals else min(len(whole) - len(whole.rstrip("0")), max(len(whole) - 2, 0))
    half = 0.5 * 10.0 ** (zeros - len(decimals) + int(power or 0))
    return abs(float(number.replace(",", "")) - value) <= half * (1 + 1e-9)


@cache
def table_of(path: Path) -> pd.DataFrame:
    """A table of texts, read once."""
    return pd.read_csv(path, dtype=str, keep_default_na=False)


def complaint(line: str, above: str, table: pd.DataFrame) -> str:
    """What is wrong with one line of a comment, of the rows that all its lines ask for; empty if nothing is."""
    found = LINE.fullmatch(line)
    if found is None or found["column"] not in table:
        return "must be `number = column | conditions` with a column of the table"
    if not re.search(rf"(?<![\d.,]){re.escape(found['number'])}(?![.,]?\d)", above):
        return "is not in the text above"
    try:
        values = pd.to_numeric(table[found["column"]][holds(table, found["own"] or "")])
    except (KeyError, ValueError) as error:
        return f"cannot be looked up: {error}"
    if len(values) != 1 and (values.empty or found["by"] is None):
        return f"has {len(values)} rows"
    value = float(found["factor"] or 1) * float(values.agg(found["by"] or "max"))
    return "" if is_rounded(found["number"], value) else f"is {value:.6g} in the table"


def complaints(text: str, root: Path) -> Iterator[str]:
    """Line of a page, the number, and what is wrong with it."""
    for comment in FIGURES.finditer(text):
        above = re.split(r"\n\s*\n", COMMENT.sub("", text[:comment.start()]).rstrip())[-1]
        first = text.count("\n", 0, comment.start("lines")) + 1
        try:
            every = table_of(root / comment["table"])
            table = every[holds(every, comment["shared"] or "")]
        except (KeyError, ValueError) as error:
            yield f"{first}: {comment['shared']!r} cannot be looked up: {error}"
            continue
        for number, line in enumerate(comment["lines"].splitlines(), start=first):
            if line.strip() and (wrong := complaint(line.strip(), above, table)):
                yield f"{number}: {line.strip()!r} {wrong}"


def test_figures_are_those_of_their_tables() -> None:
    texts = {page.name: page.read_text(encoding="utf-8") for page in PAGES}
    assert [name for name, text in texts.items() if len(FIGURES.findall(text)) != text.count("<!-- figures")] == []
    assert [f"{name}:{one}" for name, text in texts.items() for one in complaints(text, ROOT)] == []


def test_pages_with_results_of_real_skins_are_checked() -> None:
    checked = {page.name for page in PAGES if FIGURES.search(page.read_text(encoding="utf-8"))}
    assert {"README.md", "learn-from-presses.md", "live.md", "calibrate-a-sensor.md"} <= checked


@pytest.mark.parametrize(("line", "wrong"), [
    ("1.11 = error | skin=a", ""), ("46 = 100 * held | skin=a", ""), ("1.9 = mean error", ""),
    ("1.9 = median error | ", ""), ("2.6 = max error", ""), ("2 = count error", ""), ("330 = rows | skin=a", ""),
    ('1,600 = rows | "skin=b, worn"', ""), ("4.0 = error | skin=a", "is not in the text"),
    ("1.1 = error | skin=a", "is not in the text"), ("2.6 = error | skin=a", "is 1.106 in the table"),
    ("1.9 = error", "has 2 rows"), ("2.6 = error | skin=c", "has 0 rows"), ("2 = count error | skin=c", "has 0 rows"),
    ("2.6 = error | colour=c", "cannot be looked up"), ("2.6 = error | skin", "cannot be looked up"),
    ("2.6 = loss", "must be"), ("1.9 = mean skin", "cannot be looked up"), ("2.6: error", "must be")])
def test_the_check_sees_what_it_should(line: str, wrong: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text('skin,error,held,rows,split\na,1.106,0.456,332,\n"b, worn",2.64,0.9,1603,\n'
                                    "d,9,9,9,time\n")
    text = ("Of 4.0.\n\nRead to 1.11 mm, 1.9, 2.6; 46 % of 330 and 1,600 of 2\n\n"
            f"<!-- figures of a.csv | split=:\n{line}\n-->\n")
    found = [*complaints(text, tmp_path)]
    assert len(found) == (wrong != "")
    assert all(wrong in one and one.startswith("6: ") for one in found)
    (said,) = complaints(text.replace("split=:", "colour=:"), tmp_path)
    assert "colour=' cannot be looked up" in said


@pytest.mark.parametrize(("number", "value", "fits"), [
    ("2.6", 2.55, True), ("2.6", 2.66, False), ("2.60", 2.64, False), ("20", 24, False), ("33,000", 32680, True),
    ("33,000", 34000, False), ("2e-6", 2.45e-6, True), ("1.2e-5", 1.26e-5, False), ("100", 99.6, True),
    ("100", 94, False), ("-3", -2.9, True), ("0", 0.2, True)])
def test_numbers_are_compared_to_the_digits_written(number: str, value: float, fits: bool) -> None:
    assert is_rounded(number, value) is fits
