"""How the stations stood: as described, exchanged, askew, or in a laboratory's own positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.thermal.all_sensors import calibrate_campaign
from agonic.thermal.campaign.description import Station
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.files.write import write_campaign
from agonic.thermal.plan.plan import plan_thermal
from agonic.thermal.simulation.campaign import Faults, SimulatedCampaign, simulate_campaign
from tests.command_line import answer

SENSORS = "MMC5883MA,MPU-9255"
FIELD_SD_DEG = np.degrees(50.0 / 48_000.0)
"""What the field turns by itself in the simulated chamber."""


def calibrated(campaign: Campaign, **settings):
    return calibrate_campaign(campaign, held_out=False, **settings)


def simulated(**given) -> SimulatedCampaign:
    return simulate_campaign(SENSORS, rate_Hz=0.05, **given)


def redescribed(made: SimulatedCampaign, **given) -> Campaign:
    """The campaign with another description of its stations."""
    return replace(made.campaign, description=replace(made.description, **given))


def turn_freely(made: SimulatedCampaign, seed: int = 1) -> SimulatedCampaign:
    """The same box in twelve positions of its own: the field along the corners of an icosahedron,
    each with any spin about it."""
    rng = np.random.default_rng(seed)
    golden = (1.0 + 5.0**0.5) / 2.0
    corners = np.array([[0.0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    corners = np.concatenate([np.roll(corners, k, axis=1) for k in range(3)])
    field = made.field_n(np.zeros(1))[0]
    turned = {}
    for number, seen in zip(made.description.numbers, rng.permutation(corners), strict=True):
        aligned, _ = Rotation.align_vectors(field[None], seen[None])
        spin = Rotation.from_rotvec(field / np.linalg.norm(field) * rng.uniform(-np.pi, np.pi))
        turned[number] = spin * aligned
    return replace(made, rotations=turned)


def rms(values) -> float:
    return float(np.sqrt(np.mean(np.square(values))))


def measure_angle(one: np.ndarray, other: np.ndarray) -> float:
    cosine = one @ other / np.linalg.norm(one) / np.linalg.norm(other)
    return float(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))


def names(findings, severity: str = "check") -> set[str]:
    return {finding.name for finding in findings if finding.severity == severity}


@pytest.mark.slow
@pytest.mark.parametrize("pair", [(4, 9), (1, 2), (11, 12)])
def test_swapped_stations(pair) -> None:
    result = calibrated(simulated(seed=4, faults=Faults(swapped=pair)).campaign)
    said = {finding.name: finding for finding in result.findings}
    assert f"stations {pair[0]}, {pair[1]} look exchanged" in said["swapped stations"].what
    assert (result.turns, result.verdict) == ("unknown", "check")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(4))
def test_a_chamber_that_drifted(seed: int) -> None:
    made = simulated(seed=seed, faults=Faults(drift=5000.0))
    for sensor in calibrated(made.campaign).sensors:
        assert "field drifted" in names(sensor.findings)


@pytest.mark.slow
def test_described_turns_that_are_others_are_contradicted() -> None:
    """Stations turned in an own way: no exchange of two of them explains the readings."""
    result = calibrated(turn_freely(simulated(seed=9)).campaign)
    assert names(result.findings) == {"turns"}


@pytest.mark.slow
def test_a_box_that_stood_askew() -> None:
    made = simulated(seed=9)
    askew = made.rotations[7] * Rotation.from_rotvec([0.0, 0.25, 0.0])
    made = replace(made, rotations={**made.rotations, 7: askew})
    result = calibrated(made.campaign)
    assert (result.turns, result.verdict) == ("unknown", "check")
    (said,) = result.findings
    assert (said.name, said.what.partition(" did")[0]) == ("fixture", "station 7")


@pytest.mark.slow
def test_a_sensor_mounted_otherwise_on_the_board_is_understood() -> None:
    axes = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])  # as in an MPU-9255
    campaign = simulated(seed=9).campaign
    turned = {
        name: {n: s.with_columns(field=s.field @ axes.T) for n, s in by.items()}
        for name, by in campaign.recordings.items()
    }
    result = calibrated(replace(campaign, recordings=turned))
    assert (result.turns, result.verdict) == ("known", "good")


@pytest.mark.slow
def test_a_laboratory_s_own_positions_are_a_note(capsys, tmp_path: Path) -> None:
    """Nobody described how the box stood: nothing is wrong with that."""
    made = turn_freely(simulated(seed=9))
    write_campaign(replace(made.description, stations=()), made.stations(), tmp_path / "own")
    status, said = answer(capsys, "fit", "thermal", str(tmp_path / "own"), "-o", str(tmp_path))
    assert (status, said["verdict"]) == (0, "good")
    assert [sensor["verdict"] for sensor in said["sensors"]] == ["good", "good"]
    note = next(finding for finding in said["findings"] if finding["name"] == "turns")
    assert note["severity"] == "note"
    assert said["turns"] == "found"
    directions = [made.rotations[n].inv().apply(made.field_n(np.zeros(1))[0]) for n in range(1, 13)]
    for number, position in said["positions"].items():
        turn = measure_angle(directions[0], directions[int(number) - 1])
        assert position["turn_deg"] == pytest.approx(turn, abs=0.1 + 3.0 * FIELD_SD_DEG)


@pytest.mark.slow
def test_a_hold_of_three_minutes_is_reported_as_three(capsys, tmp_path: Path) -> None:
    plan = plan_thermal(SENSORS, profile=Profile(hold_min=3.0), rate_Hz=0.1)
    made = simulate_campaign(plan, lag_s=0.0, seed=3)
    wanted = replace(made.description, profile=Profile())
    write_campaign(wanted, made.stations(), tmp_path / "brief")
    status, said = answer(capsys, "fit", "thermal", str(tmp_path / "brief"), "--no-held-out")
    assert status == 1
    holds = [finding["what"] for finding in said["findings"] if finding["name"] == "holds"]
    assert len(holds) == 2
    assert all("for 3 min" in what for what in holds)


def run_found(seed: int) -> list[list[float]]:
    """Of a campaign in positions of its own: bias and turns in standard errors, the largest error
    of a turn, and the bias' standard error over that with turns described as well as boxes stand,
    to 1°."""
    made = turn_freely(simulated(seed=seed, field_sd=0.0), seed)
    undescribed = redescribed(made, stations=tuple(Station(number=n) for n in range(1, 13)))
    off = np.radians(np.random.default_rng(seed).standard_normal((12, 3)))
    told = tuple(
        replace(one, rot_nb=made.rotations[one.number] * Rotation.from_rotvec(error))
        for one, error in zip(made.description.stations, off, strict=True)
    )
    result, known = (
        calibrated(campaign, drift=False, bin_width_C=2.0)
        for campaign in (undescribed, redescribed(made, stations=told))
    )
    assert (result.turns, result.verdict, known.turns) == ("found", "good", "known")
    levels, rows = np.linspace(-10.0, 50.0, 13), []
    seen = [made.rotations[n].inv().apply(made.field_n(np.zeros(1))[0]) for n in range(1, 13)]
    turns = np.array([measure_angle(seen[0], each) for each in seen])
    positions = result.positions
    error = np.array(list(positions.turn_deg.values())) - turns
    sd = np.array(list(positions.turn_sd_deg.values()))
    for sensor, other in zip(result.sensors, known.sensors, strict=True):
        found, truth = sensor.fit.calibration, made.truth[sensor.name]
        own = found.sd_at(levels)[:, :3]
        away = (found.bias_at(levels) - truth.bias_at(levels)) / own
        share = own.max() / other.fit.calibration.sd_at(levels)[:, :3].max()
        rows.append([rms(away), rms(error[1:] / sd[1:]), float(np.abs(error).max()), share])
    return rows


@pytest.mark.slow
def test_positions_of_any_kind_are_found_and_the_bias_is_as_sure_as_with_known_turns() -> None:
    seen = np.array([run_found(seed) for seed in range(8)])
    bias, turn, largest, share = np.moveaxis(seen, 2, 0)
    assert 0.9 < rms(bias) < 1.1
    assert 0.9 < rms(turn) < 1.1
    assert largest.max() < 0.1
    assert np.median(share) < 1.1


@pytest.mark.slow
def test_a_sensor_that_moved_in_the_fixture_is_named() -> None:
    made = turn_freely(simulated(seed=2))
    moved = Rotation.from_rotvec([0.0, 0.05, 0.02]).as_matrix()
    by = dict(made.campaign.recordings)
    by["MPU-9255"] = {
        n: s.with_columns(field=s.field @ moved) if n > 6 else s for n, s in by["MPU-9255"].items()
    }
    result = calibrated(replace(redescribed(made, assumed=True), recordings=by))
    assert "fixture" in names(result.findings)
