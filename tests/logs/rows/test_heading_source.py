"""Headings of other origin than the magnetometer, brought to its rows."""

import numpy as np

import agonic as ag
from agonic.logs.ardupilot.compass import list_headings as list_ardupilot
from agonic.logs.px4.topics import list_headings as list_px4
from agonic.logs.rows.tracks import Candidate, Table, choose_heading
from tests.logs.dataflash_writer import dataflash
from tests.logs.ulog_writer import ulog

TIME = np.arange(0.0, 60.0, 0.1)


def candidate(name: str, sd_deg: float, since: float = 0.0, until: float = 60.0) -> Candidate:
    at = np.arange(0.0, 60.0, 0.2)
    known = (at >= since) & (at <= until)
    heading = np.where(known, (350.0 + at) % 360.0, np.nan)
    return Candidate(name, at, heading, np.where(known, sd_deg, 60.0))


def test_the_surest_source_is_taken_and_named() -> None:
    columns, notes = choose_heading(
        [candidate("GPS yaw", 0.5), candidate("EKF-GSF yaw", 3.0)], TIME, None
    )
    assert columns["heading_source"] == "GPS yaw"
    np.testing.assert_allclose(columns["heading_deg"][:590], (350.0 + TIME[:590]) % 360, atol=1e-9)
    assert (columns["heading_sd_deg"] == 0.5).all()
    assert notes[0].startswith("the heading is by GPS yaw")


def test_before_it_has_settled_the_heading_is_not_known() -> None:
    own = np.full(len(TIME), 77.0)
    columns, notes = choose_heading([candidate("EKF-GSF yaw", 3.0, since=20.0)], TIME, own)
    early = TIME < 18.0
    assert (columns["heading_sd_deg"][early] == 180.0).all()
    assert (columns["heading_deg"][early] == 77.0).all()
    assert (columns["heading_sd_deg"][TIME > 20.0] == 3.0).all()
    assert "settled after 20 s" in notes[0]


def test_a_source_that_is_seldom_known_is_only_told() -> None:
    columns, notes = choose_heading([candidate("GPS yaw", 1.0, until=15.0)], TIME, None)
    assert columns == {}
    assert "in 2" in notes[0]


def messages(**columns: np.ndarray) -> Table:
    n = len(next(iter(columns.values())))
    return Table(np.arange(n), {"TimeUS": 1e6 * np.arange(n), **columns})


def test_ardupilot_s_messages() -> None:
    n = 30
    tables = {
        "GPS": messages(I=np.zeros(n), Yaw=np.where(np.arange(n) < 5, 0.0, 123.0)),
        "GPA": messages(I=np.zeros(n), YAcc=np.full(n, 0.7)),
        "XKY0": messages(C=np.repeat([0, 1], n // 2), YC=np.full(n, -10.0), YCS=np.full(n, 4.0)),
    }
    gps, gsf = list_ardupilot(tables)
    assert gps.name == "GPS yaw"
    assert np.isnan(gps.heading_deg[:5]).all()
    assert (gps.heading_deg[5:] == 123.0).all()
    np.testing.assert_allclose(gps.sd_deg, 0.7)
    assert (gsf.name, len(gsf.time), gsf.heading_deg[0], gsf.sd_deg[0]) == (
        "EKF-GSF yaw",
        n // 2,
        -10.0,
        4.0,
    )
    assert not list(list_ardupilot({"GPS": messages(I=np.zeros(n), Yaw=np.zeros(n))}))


def test_px4_s_topics() -> None:
    stamp = (1e6 * np.arange(10)).astype(np.uint64)
    topics = {
        "vehicle_gps_position[0]": {
            "timestamp": stamp,
            "heading": np.where(np.arange(10) < 3, np.nan, np.pi / 2),
            "heading_accuracy": np.full(10, np.radians(0.4)),
        },
        "yaw_estimator_status[0]": {
            "timestamp": stamp,
            "yaw_composite": np.full(10, -np.pi / 2),
            "yaw_variance": np.full(10, np.radians(5.0) ** 2),
            "yaw_composite_valid": np.arange(10) > 4,
        },
    }
    gps, gsf = list_px4({name: Table(np.arange(10), topic) for name, topic in topics.items()})
    assert np.isnan(gps.heading_deg[:3]).all()
    np.testing.assert_allclose(gps.heading_deg[3:], 90.0)
    np.testing.assert_allclose(gps.sd_deg, 0.4)
    assert np.isnan(gsf.heading_deg[:5]).all()
    np.testing.assert_allclose(gsf.heading_deg[5:], -90.0)
    np.testing.assert_allclose(gsf.sd_deg, 5.0)


def test_a_dataflash_log_gives_the_yaw_by_velocities(tmp_path) -> None:
    n, time_us = 200, 1e6 + 1e5 * np.arange(200)
    turned = np.linspace(0.0, 300.0, n)
    zero = np.zeros(n)
    path = tmp_path / "flight.bin"
    path.write_bytes(
        dataflash(
            ("MAG", {"TimeUS": time_us, "MagX": zero + 200, "MagY": zero, "MagZ": zero + 400}),
            ("ATT", {"TimeUS": time_us, "Roll": zero, "Pitch": zero, "Yaw": zero + 5.0}),
            ("XKY0", {"TimeUS": time_us, "C": zero, "YC": turned, "YCS": zero + 3.0}),
            formats={"XKY0": (200, "QBff", "TimeUS,C,YC,YCS")},
        )
    )
    samples = ag.read(path)
    assert (samples.heading_source, samples.heading_estimated) == ("EKF-GSF yaw", False)
    np.testing.assert_allclose(samples.heading_deg, turned, atol=0.01)
    np.testing.assert_allclose(samples.heading_sd_deg, 3.0, atol=1e-6)


def test_a_px4_log_gives_the_heading_of_two_antennas(tmp_path) -> None:
    n = 200
    stamp = (5_000_000 + 50_000 * np.arange(n)).astype("u8")
    turned = np.linspace(0.0, 3.0, n).astype("f4")
    level = np.tile(np.array([1.0, 0.0, 0.0, 0.0], dtype="f4"), (n, 1))
    number = {a: np.full(n, v, dtype="f4") for a, v in zip("xyz", (0.2, 0.0, 0.4), strict=True)}
    topics = {
        "sensor_mag[0]": {"timestamp": stamp, **number},
        "vehicle_attitude[0]": {"timestamp": stamp, "q": level},
        "vehicle_gps_position[0]": {
            "timestamp": stamp,
            "heading": np.where(np.arange(n) < 20, np.nan, turned).astype("f4"),
            "heading_accuracy": np.full(n, np.radians(0.5), dtype="f4"),
        },
    }
    path = tmp_path / "flight.ulg"
    path.write_bytes(ulog(topics))
    samples = ag.read(path)
    assert (samples.heading_source, samples.heading_estimated) == ("GPS yaw", False)
    known = samples.heading_known
    assert 180 <= known.sum() <= 180 + 1.5 / 0.05 + 1
    np.testing.assert_allclose(samples.heading_deg[20:], np.degrees(turned[20:]), atol=0.01)
    assert (samples.heading_deg[~known] == 0.0).all()


def test_a_table_tells_how_well_its_heading_is_known(tmp_path) -> None:
    path = tmp_path / "drive.csv"
    rows = "\n".join(f"{0.1 * k:.1f},20,0,43,{k},{0.5 + k}" for k in range(40))
    head = "time_s,mag_x_uT,mag_y_uT,mag_z_uT,gps_heading_deg,heading_accuracy_deg\n"
    path.write_text(head + rows)
    samples = ag.read(path)
    assert samples.heading_deg[7] == 7.0
    assert samples.heading_sd_deg[7] == 7.5
    assert samples.heading_known.sum() == 20
