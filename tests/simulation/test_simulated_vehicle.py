"""`simulate_vehicle`: its physics, and that what it says is the truth undoes the readings."""

import json
from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.latency import fit_latency
from agonic.attitude.undo_latency import undelayed
from agonic.cli import run
from agonic.errors import AgonicError
from agonic.exports.csv import write_sensors
from agonic.maths.rotations.angles import angle_deg
from agonic.maths.rotations.attitude import yaw_pitch_roll
from agonic.simulation import SimulatedVehicle, simulate_vehicle

nT = 1.0


@pytest.fixture(scope="module")
def flown() -> SimulatedVehicle:
    return simulate_vehicle(noise=0.0, seed=3)


def field_b(made: SimulatedVehicle, sensor: int) -> np.ndarray:
    """The field that the truth makes of the readings, body axes."""
    samples = made.samples[sensor]
    return made.truths[sensor].correct(samples.field, current_A=samples.current_A)


@pytest.mark.parametrize("sensor", [0, 1])
def test_the_truth_turns_readings_into_earths_field(flown, sensor: int) -> None:
    turned = flown.rot_nb.apply(field_b(flown, sensor))
    np.testing.assert_allclose(turned, flown.field_n, atol=1e-6 * nT)


def test_the_field_is_the_world_models_on_the_way(flown) -> None:
    expected = ag.wmm().along(flown.samples[0]).values
    np.testing.assert_allclose(flown.field_n, expected, atol=0.01 * nT)
    assert np.ptp(flown.field_n, axis=0).max() > 1 * nT  # some kilometres of it
    there = simulate_vehicle(n=50, epoch=datetime(2012, 1, 1, tzinfo=UTC), latitude_deg=-30.0)
    old = ag.igrf().at(-30.0, 8.0, 500.0, "2012-01-01").field_n
    np.testing.assert_allclose(there.field_n[0], old, atol=1 * nT)


@pytest.mark.parametrize("bank_deg", [15.0, 27.0, 45.0])
def test_turns_bank_to_both_sides_as_far_as_asked(bank_deg: float) -> None:
    made = simulate_vehicle(bank_deg=bank_deg, attitude_sd_deg=0.0, seed=1)
    roll = made.samples[0].roll_deg
    low, high = np.percentile(roll, (0.5, 99.5))
    assert high == pytest.approx(bank_deg, abs=4.0)  # gusts have 2°
    assert low == pytest.approx(-bank_deg, abs=4.0)
    assert np.std(made.samples[0].acceleration[:, 1]) < 0.5  # no side force but for gusts
    assert np.histogram(made.heading_deg, bins=12, range=(0, 360))[0].min() > 0


def test_currents_disturb_each_sensor_by_its_own_vector(flown) -> None:
    for truth, stray in zip(flown.truths, ((60.0, -35.0, 90.0), (-25.0, 50.0, 40.0)), strict=True):
        np.testing.assert_allclose(truth.matrix @ truth.coefficients[:, 0], stray)
    first, second = flown.truths
    assert not np.allclose(first.bias, second.bias)
    assert not np.allclose(first.matrix, second.matrix)
    assert np.ptp(flown.samples[0].current_A) > 5.0


def test_opposite_disturbances_cancel_in_the_mean_of_two() -> None:
    made = simulate_vehicle(n=2000, noise=0.0, placing="opposite", seed=2)
    still = [
        truth.at([0.0]).correct(samples.field)
        for truth, samples in zip(made.truths, made.samples, strict=True)
    ]
    earth_b = made.rot_nb.apply(made.field_n, inverse=True)
    assert np.linalg.norm(still[0] - earth_b, axis=1).min() > 100 * nT
    np.testing.assert_allclose((still[0] + still[1]) / 2, earth_b, atol=1e-6 * nT)


@pytest.mark.slow
def test_readings_are_late_by_the_latency_and_it_is_found() -> None:
    late = simulate_vehicle(noise=20.0, latency_s=0.037, attitude_sd_deg=0.05, seed=4)
    prompt = simulate_vehicle(noise=20.0, attitude_sd_deg=0.05, seed=4, calibrations=late.truths)
    found = fit_latency(late.samples[0], method="gyro")
    assert found.latency_s == pytest.approx(0.037, abs=4 * found.sd_s)
    assert found.sd_s < 0.002
    assert not fit_latency(prompt.samples[0], method="gyro").significant

    def off(samples: ag.Samples) -> float:
        turned = yaw_pitch_roll(samples.heading_deg, samples.pitch_deg, samples.roll_deg)
        seen = late.truths[0].correct(samples.field, current_A=samples.current_A)
        earth = late.field_n[0]  # the same within 0.02° on a flight of minutes
        return float(np.sqrt(np.mean(angle_deg(turned.apply(seen), earth[None]) ** 2)))

    level = simulate_vehicle(
        noise=0.0,
        latency_s=0.037,
        attitude_sd_deg=0.0,
        heading_sd_deg=0.0,
        seed=4,
        calibrations=late.truths,
    ).samples[0]
    assert off(undelayed(level, 0.037)) < 0.1 * off(level)


def test_attitude_errors_are_as_large_as_said_and_larger_in_turns() -> None:
    sd = {"level": [], "turning": []}
    for seed in range(4):
        made = simulate_vehicle(attitude_sd_deg=0.5, heading_sd_deg=1.0, seed=seed, sensors=1)
        (samples,) = made.samples
        roll = np.degrees(np.arctan2(*made.rot_nb.as_matrix()[:, 2, 1:].T))
        error = samples.roll_deg - roll
        turning = np.abs(roll) > 20
        sd["level"].append(np.mean(error[np.abs(roll) < 5] ** 2))
        sd["turning"].append(np.mean(error[turning] ** 2))
        heading = (samples.heading_deg - made.heading_deg + 180) % 360 - 180
        assert 0.6 < np.std(heading) < 1.3
        assert np.corrcoef(error[50:], error[:-50])[0, 1] > 0.7  # a second apart
    level, turning = (np.sqrt(np.mean(sd[name])) for name in ("level", "turning"))
    assert level == pytest.approx(0.5, rel=0.3)
    assert 1.15 < turning / level < 1.8


def test_another_flight_of_the_same_vehicle_and_the_same_flight_again(flown) -> None:
    again = simulate_vehicle(noise=0.0, seed=3)
    other = simulate_vehicle(noise=0.0, seed=8, calibrations=flown.truths)
    np.testing.assert_array_equal(again.samples[1].field, flown.samples[1].field)
    np.testing.assert_array_equal(other.truths[0].bias, flown.truths[0].bias)
    assert np.abs(other.heading_deg - flown.heading_deg).max() > 30
    assert simulate_vehicle(n=20, heading_sd_deg=None).samples[0].heading_deg is None
    assert len(simulate_vehicle(n=20, sensors=1).samples) == 1


def test_a_levelled_fit_finds_the_heading_of_another_flight() -> None:
    quiet = {"noise": 20.0, "sensors": 1, "heading_sd_deg": None, "stray_nT_A": (0.0, 0.0, 0.0)}
    taught = simulate_vehicle(seed=11, **quiet)
    flown = simulate_vehicle(seed=12, calibrations=taught.truths, **quiet)
    expected = ag.wmm().along(taught.samples[0])
    fit = ag.fit_levelled(taught.samples[0], expected)
    (samples,) = flown.samples
    north, east, _ = flown.rot_nb.apply(fit.calibration.correct(samples.field)).T
    declination = np.degrees(np.arctan2(flown.field_n[:, 1], flown.field_n[:, 0]))
    error = np.degrees(np.arctan2(-east, north)) + declination
    assert np.sqrt(np.mean(error**2)) < 0.3


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"vehicle": "boat"}, "choose from plane, copter"),
        ({"bank_deg": 90.0}, "bank_deg is 90.0"),
        ({"sensors": 3}, "has 1 or 2"),
        ({"placing": "inside"}, "placing 'inside' is not known"),
        ({"stray_nT_A": (1.0, 2.0)}, "three numbers a sensor"),
        ({"field_n": (1.0, 2.0)}, "north, east and down"),
        ({"calibrations": []}, "0 calibrations were given for 2 sensors"),
        ({"rate_Hz": 0.0}, "above zero"),
        ({"epoch": datetime(1800, 1, 1, tzinfo=UTC)}, "1900"),
    ],
)
def test_bad_settings_are_named(settings, said: str) -> None:
    with pytest.raises(AgonicError, match=said):
        simulate_vehicle(n=50, **settings)


def test_the_command_writes_two_sensors_and_their_truths(tmp_path: Path, capsys) -> None:
    out = tmp_path / "flight.csv"
    options = ["-n", "800", "--noise", "0", "--latency", "0", "--opposite"]
    assert run(["simulate", "vehicle", "-o", str(out), *options, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    np.testing.assert_allclose(said["stray_nT_A"][0], -np.array(said["stray_nT_A"][1]))
    first, second = ag.open_log(out).sensors
    assert (first.name, second.name) == ("mag1", "mag2")
    made = simulate_vehicle(n=800, noise=0.0, placing="opposite")
    np.testing.assert_allclose(second.field, made.samples[1].field, atol=6e-4)  # a log's digits
    np.testing.assert_allclose(second.current_A, made.samples[1].current_A, atol=1e-6)
    assert first.epoch == made.samples[0].epoch
    truth = ag.load(tmp_path / "flight.mag2.truth.json")
    np.testing.assert_allclose(truth.coefficients, made.truths[1].coefficients)


@pytest.mark.parametrize(
    ("kind", "option"),
    [
        ("vehicle", "--tilt=5"),
        ("vehicle", "--field=5e4"),
        ("hand", "--bank=5"),
        ("hand", "--latency=5"),
        ("hand", "--opposite"),
    ],
)
def test_options_of_other_kinds_are_refused(tmp_path: Path, kind, option, capsys) -> None:
    assert run(["simulate", kind, "-o", str(tmp_path / "x.csv"), option]) == 2
    name = option.split("=")[0]
    said = capsys.readouterr().err
    assert said.startswith(f"agonic: No such option: {name}")
    assert said.endswith(f"; see agonic simulate {kind} --help\n")
    assert not list(tmp_path.iterdir())


def test_sensors_of_different_times_are_not_one_table(tmp_path: Path) -> None:
    first = ag.Samples(time=[0.0, 1.0], field=np.ones((2, 3)), name="a")
    second = ag.Samples(time=[0.0, 1.5], field=np.ones((2, 3)), name="b")
    with pytest.raises(AgonicError, match="a and b have different times"):
        write_sensors([first, second], tmp_path / "x.csv")
    with pytest.raises(AgonicError, match="no sensors"):
        write_sensors([], tmp_path / "x.csv")
