"""Units at the doors."""

import pytest

import agonic as ag
from agonic.units import NANOTESLA_PER, find_unit, nanotesla_per


@pytest.mark.parametrize(
    ("spelling", "unit", "factor"),
    [
        ("nT", "nT", 1.0),
        ("nanotesla", "nT", 1.0),
        ("gamma", "nT", 1.0),
        ("µT", "uT", 1e3),
        ("μT", "uT", 1e3),
        (" uT ", "uT", 1e3),
        ("microtesla", "uT", 1e3),
        ("mT", "mT", 1e6),
        ("T", "T", 1e9),
        ("Tesla", "T", 1e9),
        ("G", "G", 1e5),
        ("Gauss", "G", 1e5),
        ("Ga", "G", 1e5),
        ("mG", "mG", 1e2),
        ("mGauss", "mG", 1e2),
        ("milligauss", "mG", 1e2),
        ("counts", "raw", 1.0),
        ("LSB", "raw", 1.0),
        ("raw", "raw", 1.0),
    ],
)
def test_spellings(spelling: str, unit: str, factor: float) -> None:
    assert find_unit(spelling) == unit
    assert nanotesla_per(spelling) == factor


def test_one_field_in_every_unit() -> None:
    in_units = {"nT": 5e4, "uT": 50.0, "mT": 0.05, "T": 5e-5, "G": 0.5, "mG": 500.0}
    assert set(in_units) == set(NANOTESLA_PER)
    for unit, value in in_units.items():
        assert value * nanotesla_per(unit) == pytest.approx(5e4)


@pytest.mark.parametrize("unit", ["", "V", "Am", "furlong", "MT"])
def test_other_words_are_refused_with_those_that_are_known(unit: str) -> None:
    with pytest.raises(ag.UnitError, match=r"is not known; use one of nT, uT, mT, T, G, mG or raw"):
        find_unit(unit)
