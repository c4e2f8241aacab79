"""Numbers as people read them: digits as the standard error warrants, thin spaces, true minus."""

from __future__ import annotations

import math
import re

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
    """A number with its thousands set apart by thin spaces.

    >>> group_digits(-30512.345, 1).replace(THIN, " ")
    '−30 512.3'
    """
    nearest = round(value, decimals) + 0.0  # the sum turns −0 into 0
    return f"{nearest:,.{max(decimals, 0)}f}".replace(",", THIN).replace("-", MINUS)


def significant(value: float, digits: int = 3) -> str:
    """A number to some significant digits; whole digits are never dropped.

    >>> significant(0.004127), significant(49871.3), significant(math.inf)
    ('0.00413', '49\\u202f871', 'undetermined')
    """
    if not math.isfinite(value):
        return UNDETERMINED
    return group_digits(value, max(_decimals(value, digits), 0))


def round_to_sd(value: float, sd: float | None) -> str:
    """A number to the second digit of a standard error, or to four digits where there is none.

    Never more than twelve digits, however small the standard error.

    >>> round_to_sd(1.2345678, 0.00123), round_to_sd(1.2345678, None), round_to_sd(1.2345678, 1e-17)
    ('1.2346', '1.235', '1.23456780000')
    """
    if not sd:
        return significant(value, 4)
    return group_digits(value, min(_decimals(sd, 2), _decimals(value, 12) if value else 12))


def with_sd(value: float, sd: float | None) -> str:
    """A number with its standard error, both to the second digit of the latter.

    >>> with_sd(1.2345678, 0.00123).replace(NO_BREAK, " "), with_sd(1.0, 0.0)
    ('1.2346 ± 0.0012', '1.000')
    """
    if not sd:
        return round_to_sd(value, sd)
    return f"{round_to_sd(value, sd)} ±{NO_BREAK}{group_digits(sd, min(_decimals(sd, 2), 12))}"


def with_sd_in_powers(value: float, sd: float | None) -> str:
    """The same, in a power of ten where the number is small.

    >>> with_sd_in_powers(-4.48e-8, 6.6e-9).replace(NO_BREAK, " ")
    '(−4.48 ± 0.66)·10⁻⁸'
    """
    size = max(abs(value), sd or 0.0)
    if size == 0.0 or size >= 1e-3:
        return with_sd(value, sd)
    power = math.floor(math.log10(size))
    scaled = with_sd(value * 10.0**-power, sd and sd * 10.0**-power)
    return f"({scaled})·10{str(power).translate(_RAISED)}"


def show_sign(text: str) -> str:
    """A written number with its sign shown.

    >>> show_sign("1.5"), show_sign("0.0")
    ('+1.5', '0.0')
    """
    return f"+{text}" if text[0].isdigit() and text.strip("0.") else text


def quantity(value: float, unit: str, digits: int = 3) -> str:
    """A number and its unit.

    >>> quantity(151.7, "nT"), quantity(0.3149, "°", 2)
    ('152\\u202fnT', '0.31°')
    """
    if not math.isfinite(value):
        return UNDETERMINED
    space = "" if unit in ("", "°") else THIN
    return f"{significant(value, digits)}{space}{unit}"


def count(n: int, noun: str, plural: str = "") -> str:
    """A number of things, with the noun as that number wants it.

    >>> count(1, "row"), count(0, "row"), count(2, "axis", "axes")
    ('1 row', '0 rows', '2 axes')
    """
    return f"{group_digits(n)} {noun if n == 1 else plural or noun + 's'}"


def write_minus(text: str) -> str:
    """Text in which a hyphen before a number is the minus that it stands for.

    >>> write_minus("at -66° (2015-11-21, levelled -0.5, COMPASS-2)")
    'at −66° (2015-11-21, levelled −0.5, COMPASS-2)'
    """
    return _HYPHEN.sub(MINUS, text)


def typeset(text: str) -> str:
    """A sentence with its numbers written as in tables: minus signs, and thousands set apart.

    >>> typeset("bias 44509.5 nT, at -66° in 1234 rows of 2026").replace(THIN, " ")
    'bias 44 509.5 nT, at −66° in 1 234 rows of 2026'
    """
    return write_minus(_THOUSANDS.sub(lambda found: f"{int(found[0]):,}".replace(",", THIN), text))


def percent(fraction: float) -> str:
    """A fraction in per cent, to two significant digits.

    >>> percent(0.0791), percent(0.00412)
    ('7.9\\u202f%', '0.41\\u202f%')
    """
    return quantity(100 * fraction, "%", 2)


def degrees(angle_deg: float) -> str:
    """An angle to two significant digits.

    >>> degrees(0.3149)
    '0.31°'
    """
    return quantity(angle_deg, "°", 2)


def _decimals(value: float, digits: int) -> int:
    """Decimal places that show so many significant digits of a value; negative: tens, hundreds."""
    return (
        0
        if value == 0.0 or not math.isfinite(value)
        else digits - 1 - math.floor(math.log10(abs(value)))
    )
