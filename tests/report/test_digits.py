"""Numbers as people read them."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.report.digits import MINUS, THIN, UNDETERMINED, group_digits, percent, quantity, with_sd


def read_back(text: str) -> float:
    return float(text.replace(THIN, "").replace(MINUS, "-"))


@given(st.floats(-1e7, 1e7), st.floats(1e-6, 1e5))
def test_the_value_is_rounded_far_inside_its_standard_error(value, sd):
    shown, error = with_sd(value, sd).split(" ±\N{NO-BREAK SPACE}")
    assert abs(read_back(shown) - value) <= 0.051 * sd + 1e-9 * abs(value)
    assert read_back(error) == pytest.approx(sd, rel=0.051)


@pytest.mark.parametrize(
    ("value", "sd", "text"),
    [
        (30512.34, 14.2, f"30{THIN}512 ± 14"),
        (-30512.34, 4.26, f"{MINUS}30{THIN}512.3 ± 4.3"),
        (1234567.0, 12345.0, f"1{THIN}235{THIN}000 ± 12{THIN}000"),
        (1.0, 0.0, "1.000"),
    ],
)
def test_with_sd(value, sd, text):
    assert with_sd(value, sd).replace("\N{NO-BREAK SPACE}", " ") == text


def test_zero_has_no_sign():
    assert group_digits(-0.0001, 2) == "0.00"


def test_what_is_not_finite_is_said_in_words():
    assert percent(math.inf) == quantity(math.nan, "nT") == UNDETERMINED
