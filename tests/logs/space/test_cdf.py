"""CDF files of magnetic satellites: positions, frames, epochs, flags, and damage."""

from __future__ import annotations

import sys
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.errors import LogError, MissingExtraError
from agonic.field.published import igrf
from agonic.logs.log import Log
from agonic.logs.read import open_log, read
from agonic.logs.space.cdf import decode_moments
from agonic.maths.rotations.attitude import rot_nb
from tests.logs.damage import damaged, read_or_refused
from tests.logs.orbit_writer import ROT_CM, N, swarm, write_cdf

pytest.importorskip("cdflib")

nT = 1.0
Reader = Callable[..., Log]


@pytest.fixture
def written(tmp_path: Path) -> Reader:
    """Variables as they come out again."""

    def reader(variables: dict[str, Any], **settings: Any) -> Log:
        return open_log(write_cdf(tmp_path / "pass.cdf", variables, **settings))

    return reader


def test_vectors_are_sensors_each_in_its_own_axes(written: Reader) -> None:
    variables = swarm()
    log = written(variables)
    assert [(s.name, s.frame) for s in log.sensors] == [("B_VFM", "m"), ("B_NEC", "n")]
    np.testing.assert_array_equal(log.sensors[0].field, variables["B_VFM"])
    assert (log.format, log.sensors[0].epoch) == ("CDF", datetime(2016, 1, 1, tzinfo=UTC))
    np.testing.assert_array_equal(log.sensors[0].time, np.arange(float(N)))
    assert log.sensors[0].scalar is not None
    np.testing.assert_array_equal(log.sensors[0].scalar, variables["F"])


def test_geocentric_positions_and_vectors_become_geodetic(written: Reader) -> None:
    """The world model at the place that was read is the field that was read."""
    vector = written(swarm()).sensors[1]
    expected = igrf().at(vector.latitude_deg, vector.longitude_deg, vector.altitude_m, "2016-01-01")
    np.testing.assert_allclose(vector.field, expected.field_n, atol=0.01 * nT)
    assert np.abs(vector.latitude_deg - swarm()["Latitude"]).max() > 0.17  # degrees


def test_attitude_is_that_of_the_star_camera(written: Reader) -> None:
    """Its rotation takes sensor components, by way of the camera, to north, east, down."""
    sensor, vector = written(swarm()).sensors
    camera_n = Rotation.from_matrix(rot_nb(sensor.roll_deg, sensor.pitch_deg, sensor.heading_deg))
    turned = (camera_n * ROT_CM).apply(np.array(sensor.field))
    np.testing.assert_allclose(turned, vector.field, atol=1e-6 * nT)


def test_one_quarter_turn_of_the_camera(written: Reader) -> None:
    """(x, y, z, w) = (0, 0, √½, √½) takes the camera's x axis to the east."""
    variables = {k: v for k, v in swarm().items() if k not in ("B_NEC", "Radius")}
    variables["q_NEC_CRF"] = np.tile([0.0, 0.0, np.sqrt(0.5), np.sqrt(0.5)], (N, 1))
    sensor = written(variables).sensors[0]
    np.testing.assert_allclose(sensor.heading_deg, 90.0, atol=1e-9)
    np.testing.assert_allclose(sensor.pitch_deg, 0.0, atol=1e-9)


def test_an_attitude_that_does_not_fit_the_vectors_is_left_out(written: Reader) -> None:
    variables = swarm()
    variables["q_NEC_CRF"] = variables["q_NEC_CRF"][:, [3, 0, 1, 2]]
    sensor = written(variables).sensors[0]
    assert sensor.heading_deg is None
    assert any("does not take B_VFM to B_NEC" in note for note in sensor.notes)


def test_no_data_is_left_out_and_other_oddities_are_flagged(written: Reader) -> None:
    variables = swarm()
    variables["Flags_B"][:7] = 255
    variables["B_VFM"][7] = 0.0
    variables["Flags_B"][20:25] = 4
    variables["Flags_B"][30:40] = 1
    variables["Flags_F"][50:60] = 255
    variables["F"][60] = 0.0
    sensor = written(variables).sensors[0]
    assert len(sensor) == N - 7 - 1 - 10 - 1
    assert sensor.time is not None
    assert sensor.flagged is not None
    assert sensor.time[sensor.flagged != 0].tolist() == [20, 21, 22, 23, 24]
    assert "no data in 8 rows: left out" in sensor.notes
    assert "no scalar reading in 11 of 112 rows: left out" in sensor.notes
    assert "Flags_B is above 1 in 5 rows: flagged" in sensor.notes


def test_a_scalar_instrument_that_is_off_costs_no_vectors(written: Reader) -> None:
    variables = swarm()
    variables["F"][:100] = 0.0
    sensor = written(variables).sensors[0]
    assert (len(sensor), sensor.scalar) == (N, None)


def test_a_magnitude_of_the_vector_is_no_scalar_instrument(written: Reader) -> None:
    variables = swarm()
    variables["F"] = np.linalg.norm(variables["B_VFM"], axis=1)
    sensor = written(variables).sensors[0]
    assert sensor.scalar is None
    assert any("not the reading of a scalar instrument" in note for note in sensor.notes)


def test_several_spacecraft_are_several_sensors(written: Reader) -> None:
    variables = swarm() | {"Spacecraft": np.array(["A", "C"] * (N // 2))}
    log = written(variables)
    assert [s.name for s in log.sensors] == ["A B_VFM", "C B_VFM", "A B_NEC", "C B_NEC"]
    np.testing.assert_array_equal(log.sensor("C B_VFM").field, variables["B_VFM"][1::2])


def test_units_of_the_file_count(written: Reader) -> None:
    variables = swarm()
    variables["Radius"] = variables["Radius"] / 1e3
    variables["B_NEC"] = variables["B_NEC"] / 1e3
    read_back = written(variables, units={"Radius": "km", "B_NEC": "uT"}).sensor("B_NEC")
    np.testing.assert_allclose(read_back.field, written(swarm()).sensor("B_NEC").field)
    np.testing.assert_allclose(read_back.altitude_m, written(swarm()).sensors[0].altitude_m)


@pytest.mark.parametrize("compressed", [False, True])
@pytest.mark.parametrize("kind", ["epoch", "i8"])
def test_every_kind_of_time(written: Reader, kind: str, compressed: bool) -> None:
    """Half a second into 2017, behind a leap second that only TT2000 counts."""
    seconds = 0.5 + np.arange(float(N))
    stamps = {
        "epoch": 63_650_448_000_000.0 + 1e3 * seconds,
        "i8": 536_500_869_184_000_000 + (1e9 * seconds).astype(np.int64),
    }
    variables = swarm() | {"Timestamp": stamps[kind]}
    sensor = written(variables, kinds={"Timestamp": kind}, compressed=compressed).sensors[0]
    assert sensor.epoch == datetime(2017, 1, 1, tzinfo=UTC)
    np.testing.assert_allclose(sensor.time, seconds, atol=1e-6)


def test_seconds_and_picoseconds() -> None:
    """CDF_EPOCH16, which cdflib gives as complex numbers and cannot write."""
    assert decode_moments(np.array([63_650_448_000.0 + 5e11j]), 32).tolist() == [
        datetime(2017, 1, 1, 0, 0, 0, 500_000)
    ]


def test_times_that_are_fill_values_cost_their_rows(written: Reader) -> None:
    variables = swarm()
    variables["Timestamp"][3] = -1e31
    sensor = written(variables).sensors[0]
    assert len(sensor) == N - 1


def test_plain_columns_in_a_cdf(written: Reader) -> None:
    field = np.random.default_rng(1).normal(0, 30, (50, 3))
    variables = {
        "Epoch": 63_618_912_000_000.0 + 100.0 * np.arange(50),
        "mag": field,
        "temperature": np.full(50, 290.0),
    }
    log = written(variables, units={"mag": "uT", "temperature": "kelvin"}, kinds={"Epoch": "epoch"})
    (sensor,) = log.sensors
    np.testing.assert_allclose(sensor.field, field * 1e3)
    np.testing.assert_allclose(sensor.temperature, 290.0 - 273.15)
    np.testing.assert_allclose(sensor.time, 0.1 * np.arange(50), atol=1e-6)


def test_a_cdf_without_a_magnetometer_says_so(written: Reader) -> None:
    with pytest.raises(LogError, match="no magnetometer columns found among 'density'"):
        written({"density": np.ones(9)})


# --- damage ------------------------------------------------------------------------------------


@pytest.mark.slow
def test_damage_of_any_kind_gives_a_log_or_one_clear_sentence(tmp_path: Path) -> None:
    data = np.fromfile(write_cdf(tmp_path / "whole.cdf", swarm(2000)), dtype=np.uint8)
    path, rng, read_well = tmp_path / "fuzz.cdf", np.random.default_rng(5), 0
    for _ in range(150):
        path.write_bytes(damaged(data, rng).tobytes())
        if (log := read_or_refused(open_log, path)) is not None:
            read_well += 1
            assert all(np.isfinite(s.field).all() for s in log.sensors)
    assert read_well > 10  # what moves by a byte cannot be found again


@pytest.mark.parametrize("claim", [2**31 - 1, -1])
@pytest.mark.parametrize("at", [364, 368, 376, 380])
def test_absurd_counts_are_refused_at_once(tmp_path: Path, at: int, claim: int) -> None:
    """Of variables, attributes or dimensions; cdflib alone would count to two thousand million."""
    path = write_cdf(tmp_path / "pass.cdf", swarm())
    data = bytearray(path.read_bytes())
    data[at : at + 4] = claim.to_bytes(4, "big", signed=True)
    path.write_bytes(data)
    with pytest.raises(LogError, match=r"it claims .*; fetch it again"):
        open_log(path)


def test_a_missing_reader_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_cdf(tmp_path / "pass.cdf", swarm())
    monkeypatch.setitem(sys.modules, "cdflib", None)
    with pytest.raises(MissingExtraError, match=r"agonic\[space\]"):
        open_log(path)


# --- recordings --------------------------------------------------------------------------------


@pytest.mark.recordings
def test_swarm_agrees_with_its_scalar_instrument(recordings: Path) -> None:
    """|B| − F as it was measured once with other code: mean 0.257 nT, standard deviation 0.254."""
    samples = read(recordings / "orbit/swarmA_MAGA_LR_1B_20160101_10s.cdf")
    assert (len(samples), samples.name, samples.frame) == (192, "B_NEC", "n")
    assert samples.epoch == datetime(2016, 1, 1, 0, 28, tzinfo=UTC)
    np.testing.assert_array_equal(np.diff(samples.time), 10.0)
    difference = np.linalg.norm(samples.field, axis=1) - samples.scalar
    assert difference.mean() == pytest.approx(0.257, abs=5e-4)
    assert difference.std() == pytest.approx(0.254, abs=5e-4)


@pytest.mark.recordings
def test_swarm_is_where_the_world_model_says_it_is(recordings: Path) -> None:
    """On a storm day: most rows lie within a percent of the main field."""
    samples = read(recordings / "orbit/swarmA_MAGA_LR_1B_20160101_10s.cdf")
    assert samples.altitude_m.min() > 440e3
    assert samples.altitude_m.max() < 470e3
    rest = samples.field - igrf().along(samples).values
    assert np.median(np.linalg.norm(rest, axis=1)) < 300 * nT
