"""Decimal years of everything that names a moment."""

from datetime import UTC, date, datetime, timedelta, timezone

import numpy as np
import pytest

from agonic.errors import AgonicError
from agonic.field.decimal_year import decimal_year

NOON = 2026 + (59 + 0.5) / 365  # 1 March 2026, 12:00 UTC
BERLIN = timezone(timedelta(hours=1))


@pytest.mark.parametrize(
    "moment",
    [
        NOON,
        str(NOON),
        datetime(2026, 3, 1, 12),
        datetime(2026, 3, 1, 12, tzinfo=UTC),
        datetime(2026, 3, 1, 13, tzinfo=BERLIN),
        "2026-03-01T12:00:00",
        "2026-03-01T12:00:00Z",
        " 2026-03-01 13:00+01:00",
        np.datetime64("2026-03-01T12"),
        np.datetime64("2026-03-01T12:00:00.000000000"),
    ],
)
def test_one_moment_however_it_is_written(moment: object) -> None:
    year = decimal_year(moment)
    assert year.shape == ()
    assert abs(year - NOON) < 1e-12 * NOON


@pytest.mark.parametrize(
    "moments",
    [
        [2024.0, 2025.0],
        [2024, 2025],
        ["2024-01-01", "2025-01-01"],
        [date(2024, 1, 1), "2025-01-01"],
        [datetime(2024, 1, 1), date(2025, 1, 1)],
        np.array(["2024-01-01", "2025-01-01"], dtype="datetime64[D]"),
    ],
)
def test_arrays_of_moments(moments: object) -> None:
    assert decimal_year(moments).tolist() == [2024.0, 2025.0]


def test_a_leap_year_is_longer() -> None:
    half_way = decimal_year(["2024-07-02", "2025-07-02T12:00", "1900-07-02T12:00"])
    assert half_way.tolist() == [2024.5, 2025.5, 1900.5]


@pytest.mark.parametrize(
    "moment",
    ["tomorrow", "", None, True, [2025.0, None], ["2025-13-01"], np.datetime64("NaT", "us")],
)
def test_what_is_no_moment_is_said(moment: object) -> None:
    with pytest.raises(AgonicError, match=r"is not a time; give a decimal year|is missing \(NaT\)"):
        decimal_year(moment)
