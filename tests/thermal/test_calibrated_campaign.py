"""A campaign from files to calibrations: against the truth, and with everything that goes wrong."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.errors import AgonicError
from agonic.thermal.all_sensors import calibrate_campaign
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.programme import check_campaign
from agonic.thermal.common_mode import FittedSensor, find_chamber_field
from agonic.thermal.fit.readings import sum_readings
from agonic.thermal.result import CalibratedCampaign
from agonic.thermal.simulation.campaign import Faults, SimulatedCampaign, simulate_campaign

RANGE = np.linspace(-10.0, 50.0, 61)


def made_with(faults: Faults | None = None) -> SimulatedCampaign:
    """A steady field, so that noise and fixture are what limits."""
    return simulate_campaign(
        "MMC5883MA,MPU-9255", rate_Hz=0.1, seed=11, field_sd=0.0, faults=faults
    )


def calibrated(campaign: Campaign, **settings) -> CalibratedCampaign:
    """Without the fits that are only tested, which take as long as the others."""
    return calibrate_campaign(campaign, **{"held_out": False, **settings})


def away(made: SimulatedCampaign, name: str, calibration) -> float:
    """The rms error of bias and matrix over the range, in stated standard errors."""
    truth, sd = made.truth[name], calibration.sd_at(RANGE)
    rows, columns = np.array([0, 1, 2, 0, 0, 1]), np.array([0, 1, 2, 1, 2, 2])
    bias = calibration.bias_at(RANGE) - truth.bias_at(RANGE)
    matrix = (calibration.matrix_at(RANGE) - truth.matrix_at(RANGE))[:, rows, columns]
    return float(np.sqrt(np.mean(np.hstack([bias / sd[:, :3], matrix / sd[:, 3:9]]) ** 2)))


@pytest.fixture(scope="module")
def made() -> SimulatedCampaign:
    return made_with()


@pytest.mark.slow
def test_all_sensors_of_a_campaign_come_near_the_truth(made) -> None:
    told: list[str] = []

    def bar(names: list[str]):
        for name in names:
            told.append(name)
            yield name

    result = calibrated(made.campaign, drift=False, progress=bar)
    assert told == ["MMC5883MA", "MPU-9255"]
    assert result.turns == "known"
    assert [sensor.name for sensor in result.sensors] == ["MMC5883MA", "MPU-9255"]
    for sensor in result.sensors:
        assert 0.3 < away(made, sensor.name, sensor.fit.calibration) < 2.0
        limit = 10.0 if sensor.name == "MMC5883MA" else 25.0  # ten times fewer than planned
        assert sensor.fit.calibration.sd_at(RANGE)[:, :3].max() < limit
        assert sensor.verdict == "good"
        assert sensor.fit.spread.improvement[3] > 3.0
    assert result.verdict == "good"


def test_the_magnitude_alone_does_it_too(made) -> None:
    result = calibrated(made.campaign, turns="unknown", only=["MPU-9255"], drift=False)
    (sensor,) = result.sensors
    assert (result.turns, sensor.fit.reference_kind) == ("unknown", "magnitude")
    assert away(made, "MPU-9255", sensor.fit.calibration) < 2.0


@pytest.mark.slow
def test_turns_that_the_readings_contradict_are_not_used() -> None:
    made = made_with(Faults(swapped=(4, 9)))
    result = calibrated(made.campaign, drift=False)
    assert result.turns == "unknown"
    assert "contradict" in result.reason
    assert result.verdict == "check"
    for sensor in result.sensors:
        assert away(made, sensor.name, sensor.fit.calibration) < 2.0


@pytest.mark.slow
@pytest.mark.parametrize(
    ("faults", "named", "sensors"),
    [
        (Faults(missing=(3, 7, 11)), "missing stations", 2),
        (Faults(stuck="MPU-9255"), "stuck temperature", 1),
        (Faults(truncated=(6,)), "ends early", 2),
    ],
)
def test_what_went_wrong_is_named_and_the_rest_is_calibrated(faults, named, sensors) -> None:
    made = made_with(faults)
    result = calibrated(made.campaign, drift=False)
    assert named in {finding.name for finding in result.findings}
    fitted = [sensor for sensor in result.sensors if sensor.fit is not None]
    assert len(fitted) == sensors
    assert len(result.sensors) == 2
    assert result.verdict != "good"
    for sensor in fitted:
        assert away(made, sensor.name, sensor.fit.calibration) < 2.0
    for sensor in result.sensors[sensors:]:
        assert sensor.verdict == result.verdict == "refused"
        assert sensor.status.startswith("None of its recordings")


def test_turns_must_be_described_to_be_used(made) -> None:
    undescribed = Campaign(recordings=made.campaign.recordings)
    with pytest.raises(AgonicError, match="not described"):
        calibrated(undescribed, turns="known")
    assert check_campaign(undescribed)[0].rows == made.campaign.rows
    result = calibrated(undescribed, magnitude=48_000.0, only=["MPU-9255"])
    assert result.reason == "the turns of the stations are not described"


def test_sensors_and_settings_that_are_not_there(made) -> None:
    with pytest.raises(AgonicError, match="no sensor x"):
        calibrated(made.campaign, only=["x"])
    with pytest.raises(AgonicError, match="turns 'perhaps'"):
        calibrated(made.campaign, turns="perhaps")


def drifting(made: SimulatedCampaign, found) -> np.ndarray:
    """The true change of the chamber's field at the windows, less its mean at each station."""
    true = made.field_n(found.time)
    for number in np.unique(found.station):
        true[found.station == number] -= true[found.station == number].mean(axis=0)
    return true


@pytest.fixture(scope="module")
def restless() -> SimulatedCampaign:
    return simulate_campaign("2xMMC5883MA,MPU-9255", rate_Hz=0.05, seed=3, field_sd=80.0)


@pytest.fixture(scope="module")
def by_turns(restless) -> CalibratedCampaign:
    return calibrated(restless.campaign)


@pytest.mark.slow
def test_what_all_sensors_see_alike_is_the_field_of_the_chamber(restless, by_turns) -> None:
    found = by_turns.chamber_field
    assert found.axes == ("back", "right", "down")
    true = drifting(restless, found)
    error = np.sqrt(np.mean((found.change - true) ** 2))
    noise = min(share.noise_sd for share in found.shares)
    assert error < 1.5 * noise  # of the better sensors, of which there are two
    assert found.common_sd == pytest.approx(np.sqrt(np.mean(true**2)), rel=0.1)
    for share in found.shares:
        parts = found.common_sd**2 + share.noise_sd**2 + share.own_sd**2
        assert np.sqrt(parts) == pytest.approx(share.total_sd, rel=0.1)
        assert share.own_sd < 0.5 * found.common_sd


@pytest.mark.slow
def test_the_magnitude_alone_tells_the_change_along_the_field(restless) -> None:
    found = calibrated(restless.campaign, turns="unknown").chamber_field
    assert found.axes == ("along the field",)
    dip = np.radians(restless.facts["inclination_deg"])
    along = drifting(restless, found) @ [np.cos(dip), 0.0, np.sin(dip)]
    assert np.corrcoef(along, found.change[:, 0])[0, 1] > 0.9


@pytest.mark.slow
def test_what_a_polynomial_gets_wrong_is_the_sensors_own_and_not_the_chambers(by_turns) -> None:
    seen = {}
    for sensor in by_turns.sensors:
        sums, _ = sum_readings(by_turns.campaign.samples(sensor.name), 0.5)
        seen[sensor.name] = FittedSensor(sensor.fit, sums.cells())
    fit = seen["MMC5883MA-1"].fit
    bias = fit.calibration.bias.copy()
    bias[3, 0] += 300.0  # of x³
    wrong = replace(fit, calibration=replace(fit.calibration, bias=bias))
    seen["MMC5883MA-1"] = seen["MMC5883MA-1"]._replace(fit=wrong)
    found = find_chamber_field(seen, by_turns.campaign.description.rotations)
    level = by_turns.campaign.samples("MMC5883MA-1").temperature
    misfit = 300.0 * np.std(((level - 20.0) / 30.0) ** 3) / np.sqrt(3)  # on one axis of three
    assert found.shares[0].own_sd == pytest.approx(misfit, rel=0.1)
    assert max(share.own_sd for share in found.shares[1:]) < 0.15 * misfit
    assert found.common_sd == pytest.approx(by_turns.chamber_field.common_sd, rel=0.1)


@pytest.mark.slow
def test_one_sensor_cannot_tell_itself_from_the_chamber(restless) -> None:
    assert calibrated(restless.campaign, only=["MPU-9255"]).chamber_field is None


@pytest.mark.slow
def test_stations_left_out_are_corrected_nearly_as_well(made) -> None:
    (sensor,) = calibrate_campaign(made.campaign, only=["MMC5883MA"], drift=False).sensors
    unseen = sensor.held_out
    assert unseen.folds == 4
    assert unseen.spread.stations == tuple(range(1, 13))
    assert np.allclose(unseen.spread.before, sensor.fit.spread.before)
    assert unseen.spread.improvement[3] > 0.9 * sensor.fit.spread.improvement[3]
    assert np.all(unseen.magnitude_rms < 2.0 * unseen.seen_rms)
    assert unseen.magnitude_rms.mean() > unseen.seen_rms.mean()
    assert sensor.verdict == "good"


@pytest.mark.slow
def test_iron_beside_one_station_shows_where_it_is_left_out(made) -> None:
    by = dict(made.campaign.recordings["MMC5883MA"])
    by[5] = by[5].with_columns(field=by[5].field * 1.01)
    campaign = Campaign(recordings={"MMC5883MA": by}, description=made.campaign.description)
    (sensor,) = calibrate_campaign(campaign, drift=False, turns="unknown").sensors
    unseen = sensor.held_out
    worst = int(np.argmax(unseen.magnitude_rms))
    assert unseen.magnitude_rms[worst] > 3.0 * unseen.seen_rms[worst]
    assert unseen.magnitude_rms.max() > 400.0  # of 480


def test_too_few_stations_to_leave_any_out(made) -> None:
    by = made.campaign.recordings["MPU-9255"]
    few = {number: by[number] for number in by if number not in (3, 8)}
    campaign = Campaign(recordings={"MPU-9255": few}, description=made.campaign.description)
    (sensor,) = calibrate_campaign(campaign, drift=False, turns="unknown").sensors
    assert sensor.fit is not None
    assert sensor.held_out is None


@pytest.mark.parametrize("late_s", [-64_000.0, -6000.0])
def test_a_clock_that_restarts_or_overlaps_at_one_station(late_s: float) -> None:
    """The stations follow each other by number, and the bias is not drawn away by the order."""
    made = simulate_campaign("MMC5883MA", rate_Hz=0.05, seed=1)
    recordings = {
        name: {
            number: samples.with_columns(
                time=samples.time
                - samples.time[0]
                + (number - 1) * 16_000.0
                + (late_s if number == 5 else 0.0)
            )
            for number, samples in by.items()
        }
        for name, by in made.campaign.recordings.items()
    }
    samples = replace(made.campaign, recordings=recordings).samples("MMC5883MA")
    assert (np.diff(samples.time) > 0).all()
    assert list(dict.fromkeys(samples.station.tolist())) == list(range(1, 13))
