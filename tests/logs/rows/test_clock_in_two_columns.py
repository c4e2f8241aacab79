"""Clocks in whole seconds beside their fraction, and the compass columns of an animal tag."""

import numpy as np
import pytest

import agonic as ag


@pytest.mark.parametrize(("header", "per_second"), [("Millis", 1000), ("micros", 1_000_000)])
def test_a_fraction_that_begins_anew_is_added_to_the_seconds(header, per_second, tmp_path) -> None:
    time = np.arange(200) * 0.02
    rng = np.random.default_rng(0)
    rows = [f"2025-06-01,RTC,{header},mx,my,mz".replace("2025-06-01,RTC", "RTC Date,RTC Time")]
    for t, (x, y, z) in zip(time, rng.normal(size=(200, 3)) * 300, strict=True):
        part = round((t % 1) * per_second)
        rows.append(f"2025-06-01,10:00:{int(t):02d},{part},{x:.0f},{y:.0f},{z:.0f}")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows))
    samples = ag.read(path)
    assert len(samples) == 200
    assert np.allclose(np.diff(samples.time), 0.02, atol=1e-6)


@pytest.mark.parametrize(
    ("header", "row"),
    [
        ("Date,Time,Milliseconds", "13/06/2025,10:00:{s:02d},{ms}"),
        ("sec,nsec", "17000000{s:02d},{ms}000000"),
        ("secs,nsecs", "17000000{s:02d},{ms}000000"),
        ("sec,usec", "17000000{s:02d},{ms}000"),
        ("stamp.sec,stamp.nanosec", "17000000{s:02d},{ms}000000"),
        ("millis,unix_s", "{s}{ms:03d},17000000{s:02d}.{ms:03d}"),
        ("time_boot_ms,time_utc_usec", "{s}{ms:03d},17000000{s:02d}{ms:03d}000"),
    ],
)
def test_two_columns_of_time_are_one_clock(header: str, row: str, tmp_path) -> None:
    rows = [f"{header},mx,my,mz"]
    for k in range(200):
        rows.append(row.format(s=k // 25, ms=40 * (k % 25)) + f",{k},{k % 7},{k % 11}")
    path = tmp_path / "log.csv"
    path.write_text("\n".join(rows))
    samples = ag.read(path)
    assert len(samples) == 200
    assert np.allclose(np.diff(samples.time), 0.04, atol=1e-6)


def test_the_compass_of_an_animal_tag_goes_before_its_accelerometer(tmp_path) -> None:
    rows = ["TagID,Timestamp,X,Y,Z,compX,compY,compZ"]
    rows += [f"A1,2025-06-01 10:00:{k:06.3f},0.1,0.2,0.97,{k},{2 * k},300" for k in range(30)]
    path = tmp_path / "tag.csv"
    path.write_text("\n".join(rows))
    assert ag.read(path).field[7].tolist() == [7.0, 14.0, 300.0]
