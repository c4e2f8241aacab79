"""A campaign from files to calibrations: against the truth, and with everything that goes wrong."""

import numpy as np
import pytest

from agonic.calibrated_campaign import calibrate_campaign
from agonic.campaign import Campaign, check_campaign
from agonic.errors import AgonicError
from agonic.simulation.campaign import Faults, SimulatedCampaign, simulate_campaign

RANGE = np.linspace(-10.0, 50.0, 61)


def made_with(faults: Faults | None = None) -> SimulatedCampaign:
    """A steady field, so that noise and fixture are what limits."""
    return simulate_campaign(
        "MMC5883MA,MPU-9255", rate_Hz=0.1, seed=11, field_sd=0.0, faults=faults
    )


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


def test_all_sensors_of_a_campaign_come_near_the_truth(made) -> None:
    result = calibrate_campaign(made.campaign, drift=False)
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
    result = calibrate_campaign(made.campaign, turns="unknown", only=["MPU-9255"], drift=False)
    (sensor,) = result.sensors
    assert (result.turns, sensor.fit.taught_by) == ("unknown", "magnitude")
    assert away(made, "MPU-9255", sensor.fit.calibration) < 2.0


def test_turns_that_the_readings_contradict_are_not_used() -> None:
    made = made_with(Faults(swapped=(4, 9)))
    result = calibrate_campaign(made.campaign, drift=False)
    assert result.turns == "unknown"
    assert "contradict" in result.reason
    assert result.verdict == "check"
    for sensor in result.sensors:
        assert away(made, sensor.name, sensor.fit.calibration) < 2.0


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
    result = calibrate_campaign(made.campaign, drift=False)
    assert named in {finding.name for finding in result.findings}
    fitted = [sensor for sensor in result.sensors if sensor.fit is not None]
    assert len(fitted) == sensors
    assert len(result.sensors) == 2
    assert result.verdict != "good"
    for sensor in fitted:
        assert away(made, sensor.name, sensor.fit.calibration) < 2.0


def test_a_sensor_without_usable_recordings_says_so() -> None:
    result = calibrate_campaign(made_with(Faults(stuck="MPU-9255")).campaign)
    refused = result.sensors[1]
    assert refused.verdict == "refused"
    assert refused.status.startswith("None of its recordings")
    assert result.verdict == "refused"


def test_turns_must_be_described_to_be_used(made) -> None:
    undescribed = Campaign(recordings=made.campaign.recordings)
    with pytest.raises(AgonicError, match="not described"):
        calibrate_campaign(undescribed, turns="known")
    assert check_campaign(undescribed)[0].rows == made.campaign.rows
    result = calibrate_campaign(undescribed, magnitude=48_000.0, only=["MPU-9255"])
    assert result.reason == "the turns of the stations are not described"


def test_sensors_and_settings_that_are_not_there(made) -> None:
    with pytest.raises(AgonicError, match="no sensor x"):
        calibrate_campaign(made.campaign, only=["x"])
    with pytest.raises(AgonicError, match="turns 'perhaps'"):
        calibrate_campaign(made.campaign, turns="perhaps")


def test_progress_is_told_by_sensor(made) -> None:
    told: list[str] = []

    def bar(names: list[str]):
        for name in names:
            told.append(name)
            yield name

    calibrate_campaign(made.campaign, progress=bar, turns="unknown")
    assert told == ["MMC5883MA", "MPU-9255"]
