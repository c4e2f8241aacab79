"""Numbers as people read them: digits as the standard error warrants, thin spaces, true minus."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
from itertools import repeat

NO_BREAK = "\N{NO-BREAK SPACE}"
THIN = "\N{NARROW NO-BREAK SPACE}"
MINUS = "\N{MINUS SIGN}"
UNDETERMINED = "undetermined"

_THOUSANDS = re.compile(
    r"(?<![\w.,\-/])\d{4,15}(?=(?:\.\d+)?[ \N{NO-BREAK SPACE}\N{NARROW NO-BREAK SPACE}]?"
    r"(?:nT|µT|mG|raw|readings?|rows?|samples|s|m|°)(?!\w))"
)  # of a quantity or a count, not of a year or an option
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_HYPHEN = re.compile(r"(?<![\w.\-])-(?=\.?\d)")  # of a number, not of a date or a name


def group_digits(value: float, decimals: int = 0) -> str:
    """A number with its thousands set apart by thin spaces."""
    nearest = round(value, decimals) + 0.0  # the sum turns −0 into 0
    return f"{nearest:,.{max(decimals, 0)}f}".replace(",", THIN).replace("-", MINUS)


def significant(value: float, digits: int = 3) -> str:
    """A number to some significant digits; whole digits are never dropped."""
    if not math.isfinite(value):
        return UNDETERMINED
    return group_digits(value, max(_decimals(value, digits), 0))


def round_to_sd(value: float, sd: float | None) -> str:
    """A number to the second digit of a standard error, or to four digits where there is none.
    Never more than twelve digits, however small the standard error."""
    if not sd:
        return significant(value, 4)
    return group_digits(value, min(_decimals(sd, 2), _decimals(value, 12) if value else 12))


def with_sd(value: float, sd: float | None) -> str:
    """A number with its standard error, both to the second digit of the latter."""
    if not sd:
        return round_to_sd(value, sd)
    return f"{round_to_sd(value, sd)} ±{NO_BREAK}{group_digits(sd, min(_decimals(sd, 2), 12))}"


def each_with_sd(
    values: Iterable[float],
    sds: Iterable[float] | None,
    write: Callable[[float, float | None], str] = with_sd,
) -> list[str]:
    """Numbers with their standard errors, where these are known."""
    pairs = zip(values, repeat(None) if sds is None else map(float, sds), strict=False)
    return [write(float(value), sd) for value, sd in pairs]


def name_each(
    names: Iterable[str], numbers: Iterable[str], unit: str = "", *, blank: str = " "
) -> str:
    """Written numbers in a line, each after its name with a `blank`, and their unit."""
    pairs = zip(names, numbers, strict=True)
    each = (f"{name} {number}".replace(" ", blank) for name, number in pairs)
    return f"{'   '.join(each)}{'' if unit == '°' else ' '}{unit}".rstrip()


def with_sd_in_powers(value: float, sd: float | None) -> str:
    """The same, in a power of ten where the number is small."""
    size = max(abs(value), sd or 0.0)
    if size == 0.0 or size >= 1e-3:
        return with_sd(value, sd)
    power = math.floor(math.log10(size))
    scaled = with_sd(value * 10.0**-power, sd and sd * 10.0**-power)
    return f"({scaled})·10{str(power).translate(_RAISED)}"


def show_sign(text: str) -> str:
    """A written number with its sign shown."""
    return f"+{text}" if text[0].isdigit() and text.strip("0.") else text


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number and its unit."""
    if not math.isfinite(value):
        return UNDETERMINED
    space = "" if unit in ("", "°") else THIN
    return f"{significant(value, digits)}{space}{unit}"


def count(n: int, noun: str, plural: str = "") -> str:
    """A number of things, with the noun as that number wants it."""
    return f"{group_digits(n)} {noun if n == 1 else plural or noun + 's'}"


def write_minus(text: str) -> str:
    """Text in which a hyphen before a number is the minus that it stands for."""
    return _HYPHEN.sub(MINUS, text)


def typeset(text: str) -> str:
    """A sentence with its numbers written as in tables: minus signs, and thousands set apart."""
    return write_minus(_THOUSANDS.sub(lambda found: f"{int(found[0]):,}".replace(",", THIN), text))


def percent(fraction: float) -> str:
    """A fraction in per cent, to two significant digits."""
    return quantity(100 * fraction, "%", 2)


def degrees(angle_deg: float) -> str:
    """An angle to two significant digits."""
    return quantity(angle_deg, "°", 2)


def _decimals(value: float, digits: int) -> int:
    """Decimal places that show so many significant digits of a value; negative: tens, hundreds."""
    return (
        0
        if value == 0.0 or not math.isfinite(value)
        else digits - 1 - math.floor(math.log10(abs(value)))
    )
