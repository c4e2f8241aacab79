"""Sentences of NMEA 0183 beside or around a field: transducers, headings, attitude, time, place."""

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from agonic.logs.text.sentences import compute_checksum

N = 240
TIME = np.arange(N) * 0.1
HEADING = (300.0 + 8.0 * TIME) % 360.0
MAG = np.stack([20 * np.cos(np.radians(HEADING)), -20 * np.sin(np.radians(HEADING)), 0 * TIME + 43])
MAG = MAG.T.round(3)


def sentence(body: str) -> str:
    return f"${body}*{compute_checksum(body):02X}"


def write(tmp_path, lines):
    path = tmp_path / "log.nmea"
    path.write_text("\r\n".join(map(sentence, lines)) + "\r\n")
    return path


def transducers(k):
    x, y, z = MAG[k]
    return f"YXXDR,G,{x},,MAGX,G,{y},,MAGY,G,{z},,MAGZ,C,21.5,C,TEMP"


def clock(k):
    second = 86399.0 + TIME[k]  # over midnight
    second %= 86400
    hms = f"{int(second // 3600):02}{int(second // 60 % 60):02}{second % 60:05.2f}"
    day = "010326" if k else "280226"
    return f"GPRMC,{hms},A,5230.0000,N,01324.0000,W,5.1,{HEADING[k]:.1f},{day},,,A"


def test_transducers_with_heading_time_and_place(tmp_path):
    lines = []
    for k in range(N):
        lines += [clock(k)] * (k % 10 == 0)
        lines.append(transducers(k))
        lines.append(f"HCHDG,{(HEADING[k] + 40) % 360:.2f},,,3.0,E")  # follows the compass
        lines += [f"GPHDT,{HEADING[k]:.2f},T"] * (k % 2 == 0)
    samples = read(write(tmp_path, lines), unit="uT")
    np.testing.assert_allclose(samples.field, MAG[: len(samples)] * 1e3)
    apart = (samples.heading_deg - HEADING[: len(samples)] + 180) % 360 - 180
    assert np.abs(apart).max() < 1.0
    np.testing.assert_allclose(samples.latitude_deg, 52.5, atol=1e-9)
    np.testing.assert_allclose(samples.longitude_deg, -13.4, atol=1e-9)
    np.testing.assert_allclose(samples.temperature, 21.5)
    assert np.abs(samples.time - samples.time[0] - TIME[: len(samples)]).max() < 0.1
    assert samples.epoch.isoformat() == "2026-02-28T23:59:59+00:00"
    assert np.ptp(samples.time) > 20.0


def test_attitude_of_pashr_beside_a_field(tmp_path):
    lines = []
    for k in range(N):
        roll = 10 * np.sin(TIME[k])
        lines.append(f"PASHR,120000.00,{HEADING[k]:.2f},T,{roll:+.2f},-1.50,0.00,0.1,0.1,0.25,1,0")
        lines.append(f"PMAG,{MAG[k, 0]},{MAG[k, 1]},{MAG[k, 2]}")
    samples = read(write(tmp_path, lines))
    assert samples.unit == "raw"
    assert np.abs(samples.roll_deg - 10 * np.sin(TIME)).max() < 1.1
    np.testing.assert_allclose(samples.pitch_deg, -1.5)


def test_a_heading_is_not_carried_over_a_hole(tmp_path):
    lines = []
    for k in range(N):
        lines.append(transducers(k))
        lines += [f"GPHDT,{HEADING[k]:.2f},T"] * (not 60 < k < 180)
    samples = read(write(tmp_path, lines))
    known = samples.heading_sd_deg < 90
    assert known[:60].all()
    assert not known[70:170].any()


@pytest.mark.parametrize(
    ("lines", "said"),
    [
        (["HCHDG,98.3,0.0,E,12.6,W", "GPHDT,74.8,T"], "headings of a compass alone"),
        (["GPGGA,120000,5230.0,N,01324.0,E,1,8,1,40,M,,M,,"], "hold no magnetometer; have"),
    ],
)
def test_sentences_without_a_field_say_what_to_do(tmp_path, lines, said):
    with pytest.raises(LogError, match=said):
        open_log(write(tmp_path, lines * 20))
