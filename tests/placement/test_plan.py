"""Where two magnetometers should sit: against brute force, a swing, and vehicles as built."""

from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace

from agonic.headings.deviation import fit_deviation
from agonic.maths.magnetostatics import NT_M_A, dipole_tensor
from agonic.maths.rotations.attitude import rot_nb
from agonic.maths.rotations.tilt import heading_deg, tilt_from_angles
from agonic.placement.disturbance import disturb, draw_service, draw_vehicles
from agonic.placement.layout import EXAMPLE, read_layout
from agonic.placement.plan import expect_compass, mix_places, plan_placement, swing
from agonic.placement.search import (
    Ensemble,
    lay_grid,
    locate,
    measure_clearance,
    score,
    search,
)
from tests.command_line import answer, complaint
from tests.placement.layouts import make_layout


def make_ensemble(seed: int, n: int = 200) -> Ensemble:
    layout, rng = make_layout(seed), np.random.default_rng(seed)
    return Ensemble(layout, draw_vehicles(layout, n, rng), draw_service(layout, n, rng))


def test_the_mix_of_a_pair_is_that_of_least_squares() -> None:
    """Against a direct solution, noise as rows of its own."""
    ensemble = make_ensemble(1)
    layout, service = ensemble.layout, ensemble.service
    at = np.array([[0.15, 0.05, -0.1], [-0.15, -0.05, -0.1], [0.1, 0.0, -0.2]])
    error_deg, mixes = score(ensemble, at)
    added, east = ensemble.disturb(at), service.rot_nb[:, 1]
    for one, two in ((0, 1), (0, 2), (2, 1)):
        apart = added[:, two] - added[:, one]
        rows = np.einsum("ki,kj->kij", east, apart).reshape(len(east), 9)
        root = np.kron(np.linalg.cholesky(east.T @ east / len(east)).T, np.eye(3))
        noise = layout.sensor.noise_nT * np.sqrt(len(east)) * root
        whole = np.eye(3).ravel()
        a = np.concatenate([rows, -noise, -noise])
        b = np.concatenate([np.einsum("ki,ki->k", east, added[:, one]), noise @ whole, np.zeros(9)])
        g, *_ = np.linalg.lstsq(a, b, rcond=None)
        error = np.degrees(np.linalg.norm(a @ g - b) / np.sqrt(len(east)) / layout.horizontal)
        assert error_deg[one, two] == pytest.approx(error, rel=1e-5)
        assert mixes[one, two].ravel() == pytest.approx(g, abs=1e-4 * np.abs(g).max())


def test_opposite_and_equal_disturbances_are_halved_together() -> None:
    """Document 001: the mean of two sensors between which a dipole sits oppositely."""
    layout = make_layout(2)
    ends = [(0.0, -5.0, 0.0), (0.0, 5.0, 0.0)]
    wire = replace(layout.wires[0], points_m=ends, position_sd_m=0.0)
    sensor = replace(layout.sensor, position_sd_m=0.0, noise_nT=5.0)
    alone = replace(layout, parts=[], wires=[wire], sensor=sensor)
    rng = np.random.default_rng(0)
    ensemble = Ensemble(alone, draw_vehicles(alone, 100, rng), draw_service(alone, 100, rng))
    error_deg, mixes = score(ensemble, np.array([[0.0, 0.0, 0.1], [0.0, 0.0, -0.1]]))
    assert mixes[0, 1] == pytest.approx(-np.eye(3) / 2, abs=0.01)
    assert error_deg[0, 1] < 0.05 * error_deg[0, 0]


def search_exhaustively(ensemble: Ensemble, most: int) -> float:
    """The least error of all pairs of a grid that the search does not have."""
    layout = ensemble.layout
    made, _ = score(ensemble, locate(layout, lay_grid(layout, most)[0]))
    return float(made[~np.eye(len(made), dtype=bool)].min())


def excess(seed: int) -> float:
    """How far the found pair is above the best of an exhaustive search, as a ratio."""
    ensemble = make_ensemble(seed)
    _, pair, _ = search(ensemble)
    found = score(ensemble, pair)[0][0, 1]
    assert measure_clearance(ensemble.layout, pair).min() >= ensemble.layout.sensor.clearance_m
    assert np.linalg.norm(pair[0] - pair[1]) >= ensemble.layout.sensor.separation_m
    return float(found / search_exhaustively(ensemble, 420))


@pytest.mark.parametrize("seed", range(3))
def test_the_search_finds_what_an_exhaustive_one_does(seed: int) -> None:
    assert excess(seed) < 1.1


@pytest.mark.slow
def test_the_search_is_within_a_tenth_for_a_hundred_vehicles() -> None:
    ratios = np.array([excess(seed) for seed in range(100, 200)])
    assert (ratios < 1.1).all(), ratios.max()


def count_held(seed: int, built: int = 1) -> tuple[int, int]:
    """How many expectations hold within three standard deviations in vehicles as built."""
    layout = make_layout(seed)
    plan = plan_placement(layout, vehicles=200, seed=seed)
    rng = np.random.default_rng(10_000 + seed)
    held = []
    pair = np.stack([plan.first, plan.second])
    for expected, mix in zip(
        plan.compasses[1:4], (np.zeros((3, 3)), -np.eye(3), plan.mix), strict=True
    ):
        true = draw_vehicles(layout, built, rng)
        made = mix_places(disturb(layout, true, pair + true.mounting), mix)
        middle = np.array(list(layout.currents.values())).mean(axis=1)
        service = draw_service(layout, 720, np.random.default_rng(seed))
        one = expect_compass("built", layout, made, service, mix, middle)
        for name in ("coefficients", "interference"):
            off = np.abs(getattr(one, name) - getattr(expected, name))
            held.append(off <= 3 * getattr(expected, f"{name}_sd"))
        held.append([abs(one.heading_deg - expected.heading_deg) <= 3 * expected.heading_sd_deg])
    flat = np.concatenate(held)
    return int(flat.sum()), len(flat)


def test_three_standard_deviations_hold_in_vehicles_as_built() -> None:
    held, of = np.sum([count_held(seed) for seed in range(10)], axis=0)
    assert held >= 0.98 * of


@pytest.mark.slow
def test_three_standard_deviations_hold_in_99_of_100() -> None:
    held, of = np.sum([count_held(seed) for seed in range(200, 300)], axis=0)
    assert held >= 0.99 * of


def test_the_coefficients_are_those_of_a_swing() -> None:
    """Readings made apart from `disturb`, through tilt compensation and the fit of a swing."""
    layout = replace(make_layout(5), wires=[])
    at = np.array([0.1, 0.02, -0.2])
    own = draw_vehicles(layout, 0, np.random.default_rng(0))
    made = mix_places(disturb(layout, own, np.stack([at, at])), np.zeros((3, 3)))
    found = swing(layout, made, np.zeros(0))[0]
    tilts = np.array([(r, p) for r in (0.0, 10.0, -10.0) for p in (0.0, 10.0, -10.0)])
    magnetic = np.tile(np.arange(0.0, 360.0, 15.0), len(tilts))
    roll, pitch = np.repeat(tilts, 24, axis=0).T
    field = np.einsum("kij,i->kj", rot_nb(roll, pitch, magnetic), layout.field_n)
    reading = field.copy()
    for part in layout.parts:
        tensor = dipole_tensor(at - np.array(part.position_m))
        mu0 = 4 * np.pi * NT_M_A
        reading += NT_M_A * (part.moment_A_m2 + np.array(part.induced_m3) * field / mu0) @ tensor
    compass = heading_deg(reading, tilt_from_angles(roll, pitch))
    fit = fit_deviation(compass, magnetic, heel=np.stack([roll, pitch], axis=1), robust=False)
    card = fit.calibration
    assert np.abs(card.coefficients).max() > 0.5
    assert found[:5] == pytest.approx(card.coefficients, abs=1e-3)
    assert found[5:] == pytest.approx(card.heel, abs=1e-4)


def test_calibrated_magnetometers_are_left_with_the_currents() -> None:
    layout = make_layout(7)
    still = replace(layout, wires=[])
    assert plan_placement(still, calibrated=True, vehicles=60).compasses[0].heading_deg < 0.1
    plan = plan_placement(layout, calibrated=True, vehicles=60)
    assert plan.compasses[0].coefficients == pytest.approx(np.zeros(9), abs=1e-12)
    assert plan.compasses[3].heading_deg < plan.compasses[0].heading_deg


def test_the_command_says_and_draws_it(tmp_path: Path, capsys) -> None:
    out = tmp_path / "places"
    status, said = answer(capsys, "plan", "placement", str(EXAMPLE), "-o", str(out))
    assert status == 0
    mixed = next(one for one in said["compasses"] if one["name"] == "both mixed")
    alone = next(one for one in said["compasses"] if one["name"] == "one alone")
    assert mixed["heading_deg"] < 0.3 * alone["heading_deg"]
    assert len(mixed["coefficients_deg"]) == len(said["terms"]) == 9
    page = (out / "report.html").read_text()
    assert page.count('class="dots chosen"') == 2
    assert page.count('class="contour') >= 4
    assert "servo" in page


def test_without_a_list_the_command_shows_one(tmp_path: Path, capsys) -> None:
    status, said = answer(capsys, "plan", "placement", "-o", str(tmp_path / "new"))
    assert status == 0
    assert read_layout(Path(said["file"])).name == "Quadrotor"


def test_a_vehicle_without_room_is_said(tmp_path: Path, capsys) -> None:
    file = tmp_path / "parts.toml"
    text = EXAMPLE.read_text()
    file.write_text(text.replace("clearance_m = 0.05", "clearance_m = 3"))
    assert "lower clearance_m" in complaint(capsys, "plan", "placement", str(file))
    file.write_text(text.replace("separation_m = 0.05", "separation_m = 3"))
    assert "lower separation_m" in complaint(capsys, "plan", "placement", str(file))


def test_options_that_do_not_go_together_are_said(tmp_path: Path, capsys) -> None:
    said = complaint(capsys, "plan", "placement", str(EXAMPLE), "--noise", "10")
    assert "only --calibrated and --seed" in said
    table = tmp_path / "places.csv"
    table.write_text("place,add_x_nT,add_y_nT,add_z_nT\nbow,1,2,3\nmast,-1,-2,-3\n")
    assert "is none" in complaint(capsys, "plan", "placement", str(table), "--calibrated")
