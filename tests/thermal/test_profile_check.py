"""What was not as planned is named, on simulated campaigns with each fault, and nothing else is."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.thermal.campaign.description import Sensor
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.programme import check_campaign
from agonic.thermal.plan.plan import plan_thermal
from agonic.thermal.simulation.campaign import Faults, simulate_campaign

SENSORS = "2xMMC5883MA,MPU-9255"


def checked(**given):
    made = simulate_campaign(SENSORS, rate_Hz=0.1, seed=4, **given)
    usable, findings = check_campaign(made.campaign)
    return usable, {finding.name: finding for finding in findings}


def with_samples(campaign: Campaign, change) -> Campaign:
    """The campaign with other samples at every station of every sensor."""
    recordings = {
        name: {number: change(number, samples) for number, samples in by.items()}
        for name, by in campaign.recordings.items()
    }
    return replace(campaign, recordings=recordings)


@pytest.fixture(scope="module")
def clean() -> Campaign:
    return simulate_campaign(SENSORS, rate_Hz=0.1, seed=9).campaign


@pytest.mark.parametrize("seed", range(6))
def test_nothing_is_said_against_a_good_campaign(seed) -> None:
    campaign = simulate_campaign(SENSORS, rate_Hz=0.05, seed=seed).campaign
    usable, findings = check_campaign(campaign)
    assert [f.name for f in findings if f.severity != "note"] == []
    assert usable.rows == campaign.rows


def test_missing_stations() -> None:
    usable, found = checked(faults=Faults(missing=(3, 7, 11)))
    assert "stations 3, 7, 11 of 12 are missing" in found["missing stations"].sentence
    assert found["missing stations"].severity == "check"
    assert usable.stations == (1, 2, 4, 5, 6, 8, 9, 10, 12)
    _, found = checked(faults=Faults(missing=(1, 2, 3, 4)))
    assert found["missing stations"].severity == "refuse"


def test_a_stuck_thermometer_is_left_out() -> None:
    usable, found = checked(faults=Faults(stuck="MPU-9255"))
    assert "MPU-9255" in found["stuck temperature"].what
    assert usable.sensors == ("MMC5883MA-1", "MMC5883MA-2")


def test_stuck_for_a_while_at_one_station(clean) -> None:
    def change(number, samples):
        if number != 5 or samples.name != "MMC5883MA-2":
            return samples
        level = samples.temperature.copy()
        level[300:700] = level[300]
        return samples.with_columns(temperature=level)

    usable, findings = check_campaign(with_samples(clean, change))
    said = next(f for f in findings if f.name == "stuck temperature")
    assert said.severity == "check"
    assert "at station 5" in said.what
    assert 5 not in usable.recordings["MMC5883MA-2"]
    assert 5 in usable.recordings["MMC5883MA-1"]


def test_a_recording_that_ends_early() -> None:
    usable, found = checked(faults=Faults(truncated=(6,)))
    assert "station 6 ends after 1 h 36 min of 4 h 00 min" in found["ends early"].what
    assert 6 in usable.stations


def test_a_station_that_cooled_too_fast_was_not_cut(clean) -> None:
    """It ends as warm as the others, only sooner: its cooling is what is wrong."""

    def change(number, samples):
        if number != 5:
            return samples
        coldest = int(np.argmin(samples.temperature))
        rows = np.r_[np.arange(0, coldest, 3), np.arange(coldest, len(samples))]
        step = samples.time[1] - samples.time[0]
        return samples.select(rows).with_columns(time=samples.time[0] + step * np.arange(len(rows)))

    found = {f.name: f for f in check_campaign(with_samples(clean, change))[1]}
    assert "ends early" not in found
    assert "station 5 cooled at up to 1." in found["cooling"].what


@pytest.mark.parametrize(("where", "minutes"), [("in the cold", 5), ("at the end", 3)])
def test_a_station_that_was_held_too_briefly_was_not_cut(clean, where: str, minutes: int) -> None:
    """Six readings a minute: of a quarter of an hour's hold the rest is taken out."""

    def change(number, samples):
        if number != 7:
            return samples
        level, step = samples.temperature, samples.time[1] - samples.time[0]
        end = level.min() if where == "in the cold" else level[-1]
        held = np.flatnonzero(np.abs(level - end) < 0.5)
        held = held[held > len(level) // 4]  # the recording begins as warm as it ends
        rows = np.delete(np.arange(len(level)), held[6 * minutes :])
        return samples.select(rows).with_columns(time=samples.time[0] + step * np.arange(len(rows)))

    found = {f.name: f for f in check_campaign(with_samples(clean, change))[1]}
    assert "ends early" not in found
    assert f"held {where} for" in found["holds"].what
    assert "at station 7 instead of 15 min" in found["holds"].what
    held = int(found["holds"].what.partition(" for ")[2].split()[0])
    assert abs(held - minutes) <= 2  # the hold was cut out of the middle: steps of the course


def test_a_range_that_was_not_reached() -> None:
    plan = plan_thermal(SENSORS, range_C=(0, 40), rate_Hz=0.1)
    campaign = simulate_campaign(plan).campaign
    wanted = replace(campaign.description, profile=Profile())
    _, findings = check_campaign(replace(campaign, description=wanted))
    said = [f.what for f in findings if f.name == "range"]
    assert len(said) == 1
    assert "stations 1–12 reached only 0.0 of -10 °C" in said[0].replace("-0.0", "0.0")
    assert "stations 1–12 reached only 40.0 of +50 °C" in said[0]


def test_holds_that_were_cut_short_and_cooling_that_was_abrupt() -> None:
    profile = Profile(hold_min=3.0, cooling_C_per_min=2.0, cooling_limit_C_per_min=3.0)
    plan = plan_thermal(SENSORS, profile=profile, rate_Hz=0.1)
    campaign = simulate_campaign(plan, lag_s=0.0).campaign
    wanted = replace(campaign.description, profile=Profile())
    _, findings = check_campaign(replace(campaign, description=wanted))
    said = {f.name: f.what for f in findings}
    assert "2.0 °C/min, faster than 1" in said["cooling"]
    assert "instead of 15 min" in said["holds"]


@pytest.mark.parametrize("minutes", [3.0, 8.0])
@pytest.mark.parametrize("cooling", [0.5, 2.0])
def test_the_ramps_are_no_part_of_a_hold(minutes: float, cooling: float) -> None:
    profile = Profile(hold_min=minutes, cooling_C_per_min=cooling, cooling_limit_C_per_min=3.0)
    plan = plan_thermal("MPU-9255", profile=profile, rate_Hz=0.1)
    campaign = simulate_campaign(plan, lag_s=0.0, seed=3).campaign
    _, findings = check_campaign(
        replace(campaign, description=replace(campaign.description, profile=Profile()))
    )
    told = [f.what for f in findings if f.name == "holds"]
    held = {where: what for what in told for where in ("cold", "end") if where in what}
    for where in ("cold", "end"):
        found = float(held[where].partition(" for ")[2].split()[0])
        assert found == pytest.approx(minutes, abs=1.0)


def test_a_smooth_heating_is_noted_where_steps_were_planned() -> None:
    plan = plan_thermal(SENSORS, profile=Profile(step_hold_min=0.0), rate_Hz=0.1)
    campaign = simulate_campaign(plan).campaign
    wanted = replace(campaign.description, profile=Profile())
    _, findings = check_campaign(replace(campaign, description=wanted))
    said = next(f for f in findings if f.name == "steps")
    assert said.severity == "note"
    assert "stopped 0 times" in said.what


def test_gaps(clean) -> None:
    def change(number, samples):
        if number != 8:
            return samples
        return samples.select(
            ~((samples.time - samples.time[0] > 3000) & (samples.time - samples.time[0] < 4200))
        )

    _, findings = check_campaign(with_samples(clean, change))
    said = next(f for f in findings if f.name == "recording gaps")
    assert said.severity == "check"
    assert "station 8" in said.what


def test_sensors_without_a_temperature_are_left_out(clean) -> None:
    def change(number, samples):
        cold = samples.name == "MPU-9255"
        return samples.with_columns(temperature=None) if cold else samples

    usable, findings = check_campaign(with_samples(clean, change))
    assert "no temperature" in {f.name for f in findings}
    assert "MPU-9255" not in usable.sensors


def test_joined_samples_keep_stations_in_order_and_sensors_in_step(clean) -> None:
    one, other = (clean.samples(name) for name in clean.sensors[:2])
    assert len(one) == 12 * 1440
    assert (np.diff(one.time) > 0).all()
    assert (one.time == other.time).all()
    assert np.unique(one.station).tolist() == list(range(1, 13))


def test_clocks_that_start_anew_are_put_in_line(clean) -> None:
    def change(number, samples):
        return samples.with_columns(time=samples.time - samples.time[0])

    joined = with_samples(clean, change).samples("MPU-9255")
    assert len(joined) == 12 * 1440
    assert (np.diff(joined.time) > 0).all()


def test_two_sensors_of_one_name_are_no_description() -> None:
    from agonic.errors import AgonicError
    from agonic.thermal.campaign.description import Description

    with pytest.raises(AgonicError, match="described twice"):
        Description(sensors=(Sensor(name="a"), Sensor(name="a")))
