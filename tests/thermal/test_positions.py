"""How the stations stood: as described, exchanged, askew, or in a laboratory's own positions."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.thermal.all_sensors import calibrate_campaign
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.files.write import write_campaign
from agonic.thermal.plan.plan import plan_thermal
from agonic.thermal.simulation.campaign import SimulatedCampaign, simulate_campaign
from agonic.thermal.simulation.faults import Faults
from tests.command_line import answer

SENSORS = "MMC5883MA,MPU-9255"


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
