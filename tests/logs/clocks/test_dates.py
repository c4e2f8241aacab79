"""Moments as people write them, and numbers that are dates by their digits."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.logs.clocks.clock import read_clock

START = datetime(2026, 5, 14, 20, 59, 59, tzinfo=UTC)
OFFSETS = np.array([0.25, 0.5, 0.75, 1.25, 1.75])
MOMENTS = [datetime.fromtimestamp(START.timestamp() + s, UTC) for s in OFFSETS]


@pytest.mark.parametrize(
    "form",
    [
        "%d.%m.%Y %H:%M:%S.%f",
        "%d.%m.%Y %H:%M:%S,%f",
        "%d-%b-%Y %H:%M:%S.%f",
        "%m/%d/%Y %I:%M:%S.%f %p",
        "%d/%m/%Y %H:%M:%S.%f",
        "%Y-%m-%d %H:%M:%S.%f UTC",
        "%Y-%m-%d %H:%M:%S.%f +0000",
    ],
)
def test_moments_as_people_write_them(form) -> None:
    time, epoch, _ = read_clock(np.array([m.strftime(form) for m in MOMENTS], dtype=object), None)
    assert epoch == START
    np.testing.assert_allclose(time, OFFSETS, atol=1e-6)


def test_a_date_whose_order_nothing_shows_is_left_out_and_its_time_of_day_kept() -> None:
    texts = np.array(["03/05/2026 08:15:30", "03/05/2026 08:15:31"], dtype=object)
    time, epoch, notes = read_clock(texts, None)
    assert epoch is None
    assert np.diff(time).tolist() == [1.0]
    assert "day/month" in notes[0]


@pytest.mark.parametrize(("unit", "size"), [("sec", 1.0), ("ms", 1e3)])
def test_durations_with_their_unit(unit, size) -> None:
    time, _, _ = read_clock(np.array([f"{s * size:g} {unit}" for s in OFFSETS]), None)
    np.testing.assert_allclose(time, OFFSETS)


def test_a_time_of_day_by_its_digits() -> None:
    digits = np.array([float(m.strftime("%H%M%S.%f")) for m in MOMENTS])
    time, epoch, notes = read_clock(digits, None)
    assert epoch is None
    np.testing.assert_allclose(time - time[0], OFFSETS - OFFSETS[0], atol=1e-4)
    assert "hhmmss" in notes[0]


def test_seconds_that_happen_to_be_below_sixty_stay_seconds() -> None:
    for seconds in (np.arange(0.0, 59.0), np.arange(0.0, 300.0), np.r_[0.0:58.0, 300.0:358.0]):
        time, _, _ = read_clock(seconds, None)
        np.testing.assert_array_equal(time, seconds)


@pytest.mark.parametrize("per_second", [1, 1000])
def test_a_date_by_its_digits(per_second) -> None:
    text = ["%Y%m%d%H%M%S", "%Y%m%d%H%M%S%f"][per_second > 1]
    digits = np.array([float(m.strftime(text)[: 14 + 3 * (per_second > 1)]) for m in MOMENTS])
    time, epoch, _ = read_clock(digits, None)
    assert epoch == START
    np.testing.assert_allclose(time, OFFSETS if per_second > 1 else OFFSETS // 1, atol=5e-3)


@pytest.mark.parametrize("zero", [25569.0, 719529.0])
def test_days_of_excel_and_matlab(zero) -> None:
    days = zero + (START.timestamp() + np.arange(50) * 0.02) / 86400.0
    time, epoch, notes = read_clock(days, None)
    assert abs(epoch.timestamp() + time[0] - START.timestamp()) < 1e-3
    np.testing.assert_allclose(time - time[0], np.arange(50) * 0.02, atol=2e-4)
    assert "days" in notes[0]
