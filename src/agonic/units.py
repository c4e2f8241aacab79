"""Units at the doors: the field is in nanotesla inside."""

from __future__ import annotations

from agonic.errors import UnitError

RAW = "raw"
"""The unit of readings whose scale is unknown: counts, volts, or a file that does not say."""

ACCELERATION = "m/s2"
"""The unit of an accelerometer's calibration; no unit of a field."""

STANDARD_GRAVITY_M_S2 = 9.80665
"""Standard gravity (CGPM 1901); a g of an accelerometer."""

DAY_S = 86_400.0
"""Seconds of a day without a leap second."""

WEAKEST_HORIZONTAL = 2000.0
"""nT: below it lies the blackout zone of the World Magnetic Model, where no compass works."""

NANOTESLA_PER: dict[str, float] = {
    "nT": 1.0,
    "uT": 1e3,
    "mT": 1e6,
    "T": 1e9,
    "G": 1e5,
    "mG": 1e2,
}
"""One of each unit, in nanotesla."""

_SPELLINGS = {
    "nt": "nT",
    "nanotesla": "nT",
    "gamma": "nT",
    "ut": "uT",
    "µt": "uT",
    "μt": "uT",
    "microtesla": "uT",
    "utesla": "uT",
    "microt": "uT",
    "millitesla": "mT",
    "t": "T",
    "tesla": "T",
    "g": "G",
    "gs": "G",
    "gauss": "G",
    "ga": "G",
    "mg": "mG",
    "mgauss": "mG",
    "milligauss": "mG",
    "mga": "mG",
    "mgs": "mG",
    "raw": RAW,
    "counts": RAW,
    "count": RAW,
    "lsb": RAW,
    "au": RAW,
}


def find_unit(unit: str) -> str:
    """The one spelling of a field unit; "mT" and "MT" are told apart by case, the rest is not.

    >>> find_unit("µT"), find_unit("Gauss"), find_unit("counts")
    ('uT', 'G', 'raw')
    """
    text = unit.strip()
    if text in NANOTESLA_PER:
        return text
    known = _SPELLINGS.get(text.lower()) or _SPELLINGS.get(text.lower().removesuffix("s"))
    if known is None:
        raise UnitError(
            f"unit {unit!r} is not known; use one of {', '.join(NANOTESLA_PER)} or {RAW}"
        )
    return known


def nanotesla_per(unit: str) -> float:
    """One `unit` in nanotesla; raw units stay as they are, so their factor is 1.

    >>> nanotesla_per("mG")
    100.0
    """
    name = find_unit(unit)
    return 1.0 if name == RAW else NANOTESLA_PER[name]
