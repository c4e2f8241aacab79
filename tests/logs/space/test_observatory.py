"""IAGA-2002, IMFV1 and IAF: elements, axes, codes for what is missing, and damage."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.logs.read import open_log, read
from tests.logs.damage import damaged, read_or_refused

nT = 1.0
HEADER = (
    ("Format", "IAGA-2002"),
    ("Source of Data", "nobody"),
    ("Station Name", "Nowhere"),
    ("IAGA CODE", "NWH"),
    ("Geodetic Latitude", "40.137"),
    ("Geodetic Longitude", "254.763"),
    ("Elevation", "1682"),
    ("Data Type", "variation"),
)
ROWS = np.array([[20_000.0, 10.0, 47_000.0, 51_078.0], [20_001.0, 11.0, 47_002.0, 51_080.0]])


def iaga(elements: str, rows: np.ndarray, decbas: str = "", **header: str) -> str:
    """A file of those elements; keywords replace lines of the header."""
    labels = dict(HEADER) | {k.replace("_", " "): v for k, v in header.items()}
    lines = [f" {label:<23}{value:<45}|" for label, value in labels.items()]
    if decbas:
        lines.append(f" # DECBAS               {decbas:<45}|")
    code = labels["IAGA CODE"]
    lines.append(
        "DATE       TIME         DOY  " + "".join(f"{f'   {code}{e}':<10}" for e in elements) + " |"
    )
    for k, row in enumerate(rows):
        values = "".join(f"{value:10.2f}" for value in row)
        lines.append(f"2026-03-01 00:00:{k:02d}.000 060   {values}")
    return "\n".join(lines) + "\n"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "nwh.sec"


def test_components_of_the_variometer_are_readings_of_a_sensor(file: Path) -> None:
    file.write_text(iaga("HEZF", ROWS, "5527"))
    log = open_log(file)
    (samples,) = log.sensors
    assert (log.format, samples.name, samples.frame) == ("IAGA-2002", "NWH", "m")
    np.testing.assert_array_equal(samples.field, ROWS[:, :3])
    np.testing.assert_array_equal(samples.scalar, ROWS[:, 3])
    assert samples.epoch == datetime(2026, 3, 1, tzinfo=UTC)
    assert samples.time.tolist() == [0.0, 1.0]
    place = (samples.latitude_deg[1], samples.longitude_deg[1], samples.altitude_m[1])
    assert place == (40.137, 254.763, 1682.0)
    assert "its first axis is 9.212° east of north (DECBAS)" in samples.notes


@pytest.mark.parametrize(
    ("elements", "given", "decbas", "kind"),
    [
        ("XYZF", [19_750.0, 3_128.7, 47_000.0], "", "variation"),
        ("HDZF", [19_996.28, 540.0, 47_000.0], "", "definitive"),
        ("HDZF", [19_996.28, 540.0, 47_000.0], "5527", "Definitive"),
        ("DHZF", [-12.7, 19_996.28, 47_000.0], "5527", "variation"),
    ],
)
def test_geographic_components(
    file: Path, elements: str, given: list[float], decbas: str, kind: str
) -> None:
    """Declination 9° of a horizontal 19 996 nT; from a base of 552.7′ it is −12.7′."""
    rows = np.tile([*given, 51_078.0], (3, 1))
    file.write_text(iaga(elements, rows, decbas, Data_Type=kind))
    samples = read(file)
    assert samples.frame == "n"
    np.testing.assert_allclose(samples.field[0], [19_750.0, 3_128.1, 47_000.0], atol=1 * nT)


def test_codes_for_missing_values_are_not_readings(file: Path) -> None:
    rows = np.repeat(ROWS[:1], 6, axis=0)
    rows[1, 0], rows[2, 2] = 99999.0, 88888.0
    rows[3, 3] = 99999.0
    file.write_text(iaga("XYZF", rows))
    samples = read(file)
    assert samples.time.tolist() == [0.0, 4.0, 5.0]
    np.testing.assert_array_equal(samples.field, rows[[0, 4, 5], :3])
    assert sum(samples.rejected.values()) == 3


@pytest.mark.parametrize("code", [88888.0, 99999.0])
def test_a_scalar_that_was_never_there(file: Path, code: float) -> None:
    rows = np.column_stack([ROWS[:, :3], np.full(2, code)])
    file.write_text(iaga("XYZF", rows))
    log = open_log(file)
    assert log.sensors[0].scalar is None
    assert len(log.sensors[0]) == 2
    assert [stream.name for stream in log.streams] == ["F"]


def test_the_difference_to_the_scalar_restores_it(file: Path) -> None:
    rows = np.column_stack([ROWS[:, :3], [1.5, -0.5]])
    file.write_text(iaga("XYZG", rows))
    size = np.linalg.norm(ROWS[:, :3], axis=1)
    np.testing.assert_allclose(read(file).scalar, size - [1.5, -0.5])


def test_elements_that_are_no_field_are_named(file: Path) -> None:
    file.write_text(iaga("HDXF", ROWS))
    with pytest.raises(LogError, match=r"the elements are H, D, X, F; a field needs X Y Z"):
        read(file)


def test_a_header_alone(file: Path) -> None:
    file.write_text(iaga("XYZF", ROWS[:0]))
    with pytest.raises(LogError, match="a header but no row"):
        read(file)


def test_odd_cells_cost_their_row(file: Path) -> None:
    text = iaga("XYZF", np.repeat(ROWS, 3, axis=0))
    file.write_text(text.replace("00:00:02.000 060     20000.00", "00:00:02.000 060     2o000.00"))
    assert read(file).time.tolist() == [0.0, 1.0, 3.0, 4.0, 5.0]


def test_a_day_of_seconds_is_read_whole(file: Path) -> None:
    clock = [f"{k // 3600:02d}:{k // 60 % 60:02d}:{k % 60:02d}" for k in range(86_400)]
    head = iaga("XYZF", ROWS[:0])
    row = "  20000.00     10.00  47000.00  51078.00"
    file.write_text(head + "".join(f"2026-03-01 {t}.000 060   {row}\n" for t in clock))
    assert len(read(file)) == 86_400


def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(tmp_path: Path) -> None:
    text = iaga("HEZF", np.repeat(ROWS, 30, axis=0), "5527")
    data, rng, read_well = np.frombuffer(text.encode(), np.uint8), np.random.default_rng(5), 0
    path = tmp_path / "fuzz.sec"
    for _ in range(150):
        path.write_bytes(damaged(data, rng).tobytes())
        try:
            log = read_or_refused(open_log, path)
        except AssertionError:  # the mark itself is gone: another reader's refusal
            assert not path.read_bytes().startswith(b" Format                 IAGA-2002")
            continue
        if log is not None:
            read_well += 1
            assert all(np.isfinite(s.field).all() for s in log.sensors)
    assert read_well > 50


# --- recordings --------------------------------------------------------------------------------


@pytest.mark.recordings
@pytest.mark.parametrize(
    ("name", "rows", "frame", "first"),
    [
        ("BOU20200101vsec.sec", 901, "m", [20826.85, -86.75, 46874.62]),
        ("LLO20200106vmin.min", 241, "m", [8330.22, -18968.30, 39293.03]),
        ("LLO20200106vsec.sec", 14401, "m", [8330.27, -18968.24, 39293.09]),
        ("bou20141101vmin.min", 1440, "n", [20614.2, 3281.6, 47477.30]),
    ],
)
def test_observatories(
    recordings: Path, name: str, rows: int, frame: str, first: list[float]
) -> None:
    samples = read(recordings / "observatory" / name)
    assert (len(samples), samples.frame, samples.unit) == (rows, frame, "nT")
    np.testing.assert_allclose(samples.field[0], first, atol=1 * nT)
    np.testing.assert_allclose(np.diff(samples.time), 60.0 if name.endswith("min") else 1.0)
    assert np.abs(samples.field).max() < 50_000 * nT  # no code for a missing value came through


@pytest.mark.recordings
def test_the_scalar_follows_the_vector(recordings: Path) -> None:
    samples = read(recordings / "observatory/bou20141101vmin.min")
    assert (np.linalg.norm(samples.field, axis=1) - samples.scalar).std() < 0.1 * nT


def imf(elements: str, rows: np.ndarray, base: int = 0) -> str:
    """An hour of IMFV1: whole numbers as it codes them, in tenths and D in hundredths."""
    head = f"NWH MAR0126 060 08 {elements} R EDI 04992548 {base:06d} {'R' * 16}"
    lines = [head]
    for one, two in zip(rows[::2].astype(int), rows[1::2].astype(int), strict=True):
        cells = ("{:7d} {:7d} {:7d} {:6d}".format(*row) for row in (one, two))
        lines.append("  ".join(cells))
    return "\r\n".join(lines) + "\r\n"


def test_minutes_of_a_gin_of_intermagnet(file: Path) -> None:
    coded = np.tile([201_000, 1000, 470_000, 511_180], (60, 1)) + np.arange(60)[:, None]
    coded[3] = 999_999
    file.write_text(imf("XYZF", coded))
    log = open_log(file)
    (samples,) = log.sensors
    assert (log.format, samples.name, samples.frame) == ("INTERMAGNET IMFV1", "NWH", "n")
    assert samples.epoch == datetime(2026, 3, 1, 8, tzinfo=UTC)
    assert samples.time[:4].tolist() == [0, 60, 120, 240]
    assert samples.field[0].tolist() == [20_100.0, 100.0, 47_000.0]
    assert samples.scalar[0] == 51_118.0
    assert (samples.latitude_deg[0], samples.longitude_deg[0]) == (pytest.approx(40.1), 254.8)


def test_declination_of_imfv1_counts_from_its_base(file: Path) -> None:
    coded = np.tile([200_000, 60 * 100, 470_000, 999_999], (60, 1))
    file.write_text(imf("HDZF", coded, base=29 * 600))
    samples = read(file)
    assert samples.field[0] == pytest.approx([20e3 * np.cos(np.pi / 6), 10e3, 47e3])
    assert samples.scalar is None


@pytest.mark.parametrize("orientation", [b"XYZG", b" XYZ"])
def test_days_of_the_archive_of_intermagnet(file: Path, orientation: bytes) -> None:
    """With G, the magnitude of the vector less F; a day that is cut off is left out."""
    days = np.zeros((2, 5888), "<i4")
    days[:, 0], days[:, 5] = (np.frombuffer(text, "<i4")[0] for text in (b" NWH", orientation))
    days[:, 1] = 2026060, 2026061
    days[:, 2:5] = 49_863, 254_763, 1682
    values = np.array([201_000, 1000, 470_000, 20 if orientation[-1:] == b"G" else 888_888])
    days[:, 16:5776] = np.repeat(values, 1440)
    file.write_bytes(days.tobytes() + days[0, :300].tobytes())
    log = open_log(file)
    (samples,) = log.sensors
    assert (log.format, samples.name, len(samples)) == ("INTERMAGNET IAF", "NWH", 2880)
    assert samples.epoch == datetime(2026, 3, 1, tzinfo=UTC)
    assert samples.time[[1, -1]].tolist() == [60, 60 * 2879]
    assert samples.field[-1].tolist() == [20_100.0, 100.0, 47_000.0]
    place = (samples.latitude_deg[0], samples.longitude_deg[0], samples.altitude_m[0])
    assert place == pytest.approx((40.137, 254.763, 1682))
    strength = np.linalg.norm(samples.field[0])
    if orientation == b"XYZG":
        assert samples.scalar[0] == pytest.approx(strength - 2.0)
    else:
        assert samples.scalar is None
