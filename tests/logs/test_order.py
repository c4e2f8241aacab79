"""Rows that are not in the order of their times, and clocks that wrap or begin anew."""

from datetime import UTC, datetime

import numpy as np
import pytest

import agonic as ag

N = 400
TIME = np.round(np.arange(N) * 0.02, 3)
FIELD = np.random.default_rng(4).normal(0.0, 30_000.0, (N, 3)).round(1)


def read(tmp_path, time, field=FIELD, header="time_s"):
    path = tmp_path / "log.csv"
    np.savetxt(
        path,
        np.column_stack([time, field]),
        delimiter=",",
        header=f"{header},mag_x_nT,mag_y_nT,mag_z_nT",
        comments="",
        fmt="%.3f",
    )
    return ag.read(path)


def test_a_table_newest_first_is_turned_round(tmp_path) -> None:
    samples = read(tmp_path, TIME[::-1], FIELD[::-1])
    np.testing.assert_allclose(samples.time, TIME)
    np.testing.assert_allclose(samples.field, FIELD)
    assert "newest first" in " ".join(samples.notes)


@pytest.mark.parametrize("form", ["unix", "text"])
def test_moments_newest_first_count_from_the_first(tmp_path, form) -> None:
    unix = 1_777_796_130 + TIME[::-1]
    path = tmp_path / "log.csv"
    moments = [datetime.fromtimestamp(t, UTC).isoformat() if form == "text" else t for t in unix]
    rows = zip(moments, FIELD[::-1].tolist(), strict=True)
    lines = ["time,mag_x_nT,mag_y_nT,mag_z_nT"]
    lines += [f"{moment},{x},{y},{z}" for moment, (x, y, z) in rows]
    path.write_text("\n".join(lines) + "\n")
    samples = ag.read(path)
    assert samples.epoch.timestamp() == 1_777_796_130
    np.testing.assert_allclose(samples.time, TIME, atol=1e-6)


def test_rows_a_few_places_out_of_order_are_sorted_with_what_stands_beside_them(tmp_path) -> None:
    order = np.arange(N)
    for at in range(0, N - 4, 7):
        order[at : at + 3] = order[at : at + 3][::-1]
    samples = read(tmp_path, TIME[order], FIELD[order])
    np.testing.assert_allclose(samples.field, FIELD)
    assert "sorted" in " ".join(samples.notes)


def test_a_clock_that_begins_anew_loses_no_reading(tmp_path) -> None:
    samples = read(tmp_path, np.r_[TIME[:150], TIME[:100], TIME[:150]])
    np.testing.assert_allclose(samples.time, TIME, atol=1e-9)
    assert "starts again 2 times" in " ".join(samples.notes)


def test_rows_that_were_written_twice_count_once(tmp_path) -> None:
    twice = np.r_[0:N, 100:N]
    samples = read(tmp_path, TIME[twice], FIELD[twice])
    assert len(samples) == N
    assert samples.rejected == {"time does not increase": N - 100}


@pytest.mark.parametrize(
    ("header", "per_second", "size"),
    [("time_ms", 1e3, 2**16), ("time_us", 1e6, 2**32), ("time_ms", 1e3, 2**32)],
)
def test_a_counter_that_wraps_is_counted_on(tmp_path, header, per_second, size) -> None:
    counts = (TIME * per_second + size - 3.0 * per_second) % size
    counts[200:] = (counts[200:] + per_second) % size  # a second without readings
    samples = read(tmp_path, counts, header=header)
    wanted = TIME + (np.arange(N) >= 200)
    np.testing.assert_allclose(samples.time - samples.time[0], wanted, atol=1e-6)
    assert "wraps" in " ".join(samples.notes)


def test_a_clock_that_leaps_to_and_fro_is_not_put_in_line(tmp_path) -> None:
    samples = read(tmp_path, np.random.default_rng(1).permutation(TIME))
    assert "starts again" not in " ".join(samples.notes)
    assert sum(samples.rejected.values()) > N / 2 or samples.time is None


@pytest.mark.parametrize(
    ("rows", "wrong"),
    [
        (slice(0, 1), 1e308),
        (slice(0, 3), 1e6),
        (slice(0, 3), 1e6 + TIME[:3]),
        (slice(200, 205), 1e6 + TIME[:5]),
        (slice(200, 205), 0.0),
        (slice(N - 1, N), 1e12),
    ],
)
def test_damaged_times_cost_their_rows_alone(tmp_path, rows, wrong) -> None:
    time = TIME.copy()
    time[rows] = wrong
    np.testing.assert_allclose(read(tmp_path, time).time, np.delete(TIME, rows), atol=1e-9)
