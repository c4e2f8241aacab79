"""Headings of other origin than the magnetometer, brought to its rows."""

import numpy as np

from agonic.logs.ardupilot.beside import list_headings as list_ardupilot
from agonic.logs.ardupilot.dataflash_binary import Table
from agonic.logs.heading_source import Candidate, choose_heading
from agonic.logs.px4.topics import list_headings as list_px4

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
    gps, gsf = list_px4(topics)
    assert np.isnan(gps.heading_deg[:3]).all()
    np.testing.assert_allclose(gps.heading_deg[3:], 90.0)
    np.testing.assert_allclose(gps.sd_deg, 0.4)
    assert np.isnan(gsf.heading_deg[:5]).all()
    np.testing.assert_allclose(gsf.heading_deg[5:], -90.0)
    np.testing.assert_allclose(gsf.sd_deg, 5.0)
