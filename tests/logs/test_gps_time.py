"""Weeks and times of the week as clocks; the leap seconds by a published pair of moments."""

import numpy as np
import pytest

from agonic.logs.read import read

N = 30
TOW = 166_400.5 + 0.1 * np.arange(N)
UTC = "2023-11-13T22:13:02.500000+00:00"
"""Week 2288, second 166400.5: Monday 2023-11-13, 22:13:20.5 by GPS, which is 18 s ahead of UTC."""


def write(tmp_path, header, *columns):
    path = tmp_path / "log.csv"
    field = np.random.default_rng(2).normal(0.0, 0.3, (N, 3))
    rows = [",".join(f"{v:.6f}" for v in row) for row in np.column_stack([*columns, field])]
    path.write_text("\n".join([f"{header},mx,my,mz", *rows]) + "\n")
    return read(path)


WEEK = np.full(N, 2288.0)


@pytest.mark.parametrize(
    ("header", "columns"),
    [
        ("GPSWeek,GPSTime(s)", (WEEK, TOW)),
        ("Time (GPS Week),Time (GPS TOW)", (WEEK, TOW)),
        ("GWk,GMS", (WEEK, TOW * 1e3)),
        ("week,iTOW", (WEEK, TOW * 1e3)),
        ("gps_week,tow_ms", (WEEK, TOW * 1e3)),
        ("gps_week,tow", (WEEK, TOW * 1e3)),
        ("time_s,gps_week,gps_tow_s", (TOW - TOW[0] + 77.0, WEEK, TOW)),
    ],
)
def test_a_week_and_a_time_of_the_week(tmp_path, header, columns):
    samples = write(tmp_path, header, *columns)
    moment = samples.epoch.timestamp() + samples.time[0]
    assert abs(moment - np.datetime64(UTC[:-6]).astype("M8[us]").astype(float) / 1e6) < 1e-4
    np.testing.assert_allclose(np.diff(samples.time), 0.1, atol=1e-5)


def test_a_time_of_the_week_alone_has_no_date_and_runs_on_into_the_next(tmp_path):
    samples = write(tmp_path, "gps_tow_s", (TOW - TOW[0] + 604_799.0) % 604_800)
    assert samples.epoch is None
    np.testing.assert_allclose(np.diff(samples.time), 0.1, atol=1e-5)
    assert any("without a date" in note for note in samples.notes)


def test_a_week_of_ten_bits_gives_no_date(tmp_path):
    samples = write(tmp_path, "gps_week,gps_tow_s", WEEK - 2048, TOW)
    assert samples.epoch is None
    assert samples.time is not None
    assert any("rollover" in note for note in samples.notes)
