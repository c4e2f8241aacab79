"""Lines as devices send them: what is a reading, what is not, and why."""

import numpy as np
import pytest

from agonic.live.streams import Chunk, Notice
from agonic.live.streams.connection import LINE_BYTES, Lines
from agonic.live.streams.rows import LineParser, Reading, Unreadable


def test_motioncal_counts_are_a_tenth_of_a_microtesla():
    rows = LineParser()
    assert rows.read("Raw:0,0,0,0,0,0,200,-10,430") == [Reading("mag", (200.0, -10.0, 430.0), "mG")]
    motion = rows.read("Raw:0,0,-8192,0,0,16,200,-10,430")[0].motion
    assert motion == pytest.approx((0, 0, -9.80665, 0, 0, np.radians(1.0)))
    assert rows.motioncal
    assert rows.read("Uni:0.1,0.2,0.3") == []
    assert rows.read("Cal1:0,0,0,0,0,0,1.5,2,3,50") == []
    assert rows.told["Cal1"][6] == 1.5
    with pytest.raises(Unreadable, match="9 numbers"):
        rows.read("Raw:1,2,3")


def test_a_header_names_sensors_units_and_clock():
    rows = LineParser()
    assert rows.read("t_ms;mag1_x_uT;mag1_y_uT;mag1_z_uT;mag2_x_mG;mag2_y_mG;mag2_z_mG;note") == []
    assert rows.read("1500;1;2;3;10;20;30;7") == [
        Reading("mag1", (1.0, 2.0, 3.0), "uT", 1.5),
        Reading("mag2", (10.0, 20.0, 30.0), "mG", 1.5),
    ]
    with pytest.raises(Unreadable, match="7 cells under a header of 8"):
        rows.read("1500;1;2;3;10;20;30")


def test_a_header_names_accelerometer_and_gyro():
    rows, axes = LineParser(), "xyz"
    field = ",".join(f"mag_{a}_uT" for a in axes)
    force = ",".join(f"acc_{a}_g" for a in axes)
    rows.read(",".join([field, force, *(f"gyro_{a}_deg_s" for a in axes)]))
    motion = rows.read("1,2,3,0,0,-1,0,0,90")[0].motion
    assert motion == pytest.approx((0, 0, -9.80665, 0, 0, np.pi / 2))
    rows.read(",".join([field.replace("mag", "mag1"), field.replace("mag", "mag2"), force]))
    both = rows.read("1,2,3,4,5,6,0,0,-1")
    np.testing.assert_allclose([one.motion for one in both], [[0, 0, -9.80665, *[np.nan] * 3]] * 2)
    rows.read(",".join([field, "acc_x,acc_y,acc_z"]))  # in no unit that is known
    assert rows.read("1,2,3,0,0,-1")[0].motion is None


def test_three_numbers_need_no_header():
    assert LineParser(unit="uT").read("1.5, -2, 43") == [Reading("mag", (1.5, -2.0, 43.0), "uT")]
    assert LineParser().read("1 2 3")[0].unit == "raw"
    with pytest.raises(Unreadable, match="4 numbers without a header"):
        LineParser().read("1,2,3,4")


def test_sentences_are_checked():
    body = "VNIMU,-01.05,+00.20,+00.43,0,0,9.8"
    check = 0
    for byte in body.encode():
        check ^= byte
    row = LineParser().read(f"${body}*{check:02X}")[0]
    assert row == Reading("mag", (-1.05, 0.2, 0.43), "G")
    with pytest.raises(Unreadable, match="checksum"):
        LineParser().read(f"${body}*{check ^ 1:02X}")
    with pytest.raises(Unreadable, match="already corrected"):
        LineParser().read("$VNMAG,1,2,3")
    with pytest.raises(Unreadable, match="no field that is known"):
        LineParser().read("$GPGGA,1,2,3")


def readings(events):
    return np.concatenate([e.field for e in events if isinstance(e, Chunk)] or [np.empty((0, 3))])


def test_lines_are_the_same_however_they_are_cut_and_ended():
    text = b"Raw:0,0,0,0,0,0,1,2,3\r\nRaw:0,0,0,0,0,0,4,5,6\rRaw:0,0,0,0,0,0,7,8,9\n"
    wanted = np.arange(1.0, 10).reshape(3, 3)
    for size in (1, 2, 7, len(text)):
        lines = Lines("raw")
        pieces = [text[i : i + size] for i in range(0, len(text), size)]
        events = [event for piece in pieces for event in lines.feed(piece, 5.0)]
        np.testing.assert_array_equal(readings(events), wanted)


def test_times_increase_whatever_the_device_says():
    lines = Lines("raw")
    rows = b"time_s,mag_x,mag_y,mag_z\n10,1,2,3\n10.02,1,2,3\n0.5,1,2,3\n0.52,1,2,3\n"
    time = np.concatenate([e.time for e in lines.feed(rows, 100.0) if isinstance(e, Chunk)])
    assert (np.diff(time) > 0).all()
    np.testing.assert_allclose(time[:2], [100.0, 100.02])
    assert time[3] - time[2] == pytest.approx(0.02)


def test_a_line_without_end_is_passed_over_in_bounded_room():
    lines = Lines("raw")
    said = []
    for _ in range(2000):  # 32 MB
        said += lines.feed(b"7" * 16_384, 5.0)
        assert len(lines._rest) <= LINE_BYTES
    after = lines.feed(b"77\n1,2,3\n", 9.0)
    np.testing.assert_array_equal(readings(after), [[1, 2, 3]])
    assert sum(isinstance(event, Notice) for event in said) <= 1


def test_noise_is_told_and_survived():
    rng = np.random.default_rng(0)
    lines, said = Lines("raw"), []
    for k in range(200):
        said += lines.feed(rng.bytes(1000), 0.1 * k)
    told = [event for event in said if isinstance(event, Notice)]
    assert 10 <= len(told) <= 21  # once a second
    assert "could not be read" in told[-1].text
    assert told[-1].text.isprintable()
    clean = [e for e in lines.feed(b"\n1,2,3\n", 30.0) if isinstance(e, Chunk)]
    assert len(clean) == 1


def test_a_stray_line_is_not_worth_a_word():
    lines = Lines("raw")
    good = b"1,2,3\n" * 50
    assert all(isinstance(event, Chunk) for event in lines.feed(good + b"###\nboot ok\n", 1.0))
