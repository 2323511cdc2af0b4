"""Numbers, names and comment lines in the form that input files take."""

import re
import textwrap
from collections.abc import Callable, Iterable, Sequence


def number(value: float, width: int | None = None) -> str:
    """The shortest text that reads back as `value`; the nearest of at most `width` characters where that is longer.
    ValueError where nothing of that width comes within 1e-12 of the value."""
    text = repr(float(value))
    if width is None or len(text) <= width:
        return text
    candidates = [_short_exponent(f"{value:.{n}e}") for n in range(17)] + [f"{value:.{n}f}" for n in range(18)]
    fitting = [t for t in candidates if len(t) <= width]
    best = min(fitting, key=lambda t: abs(float(t) - value), default="")
    if not best or abs(float(best) - value) > 1e-12 * abs(value):
        raise ValueError(f"{value!r} cannot be written in {width} characters to twelve digits. Choose other `units`.")
    return best


def _short_exponent(text: str) -> str:
    mantissa, _, exponent = text.partition("e")
    return f"{mantissa}e{int(exponent)}"


def rows(values: Sequence[str], per_line: int, separator: str = ", ") -> list[str]:
    """The values in lines of at most `per_line`."""
    return [separator.join(values[i:i + per_line]) for i in range(0, len(values), per_line)]


def comment(sentences: Iterable[str], mark: str) -> list[str]:
    """Sentences as comment lines that begin with `mark`; each starts a line, continued lines are indented."""
    plain = [sentence.encode("ascii", "replace").decode() for sentence in sentences]
    return [f"{mark} {line}" for sentence in plain
            for line in textwrap.wrap(sentence, 100, subsequent_indent="  ", break_on_hyphens=False)]


def identifier(name: str) -> str:
    """A name that begins with a letter and holds letters, digits and underscores only, 80 at most."""
    plain = re.sub(r"[^A-Za-z0-9]+", "_", name).strip("_") or "MATERIAL"
    return (plain if plain[0].isalpha() else f"M_{plain}")[:80]


def commented_file(mark: str) -> Callable[[Sequence[str], Sequence[str]], str]:
    """An `assemble` for targets whose file is comment lines beginning with `mark`, then the input."""
    def assemble(sentences: Sequence[str], lines: Sequence[str]) -> str:
        return "\n".join([*comment(sentences, mark), *lines]) + "\n"
    return assemble
