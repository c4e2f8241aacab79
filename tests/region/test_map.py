"""The map of a region: Maxwell's equations, honest errors, and readings that contradict."""

import gzip
from itertools import product
from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.errors import AgonicError, CoverageError, LogError, UnitError, ValidityError
from agonic.logs.text.csv_text import read_table
from agonic.maths.magnetostatics import list_circle, wire_field
from agonic.maths.rotations.attitude import rot_nb
from agonic.region import FieldMap, files
from agonic.region.files import read_region
from agonic.region.fit import MAX_READINGS, choose_next
from agonic.region.maths.equivalent_sources import Readings, fit_process, lay_sources, make_features
from tests.command_line import answer, complaint
from tests.region.rooms import simulate_room


def draw_places(made: FieldMap, n: int, seed: int) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return made.low + rng.uniform(size=(n, 3)) * (made.high - made.low)


def differentiate(field, at: np.ndarray, step: float) -> np.ndarray:
    columns = [(field(at + step * e) - field(at - step * e)) / (2 * step) for e in np.eye(3)]
    return np.stack(columns, axis=-1)


def in_a_coil(seed: int, n: int = 80, noise: float = 5.0) -> tuple[np.ndarray, np.ndarray]:
    """Readings within a pair of coils of 1 m, 10 A, in the Earth's field, and the truth."""
    rng = np.random.default_rng(seed)
    axis = np.array([0.0, 0.0, 1.0])
    rings = [list_circle(np.array([0, 0, z]), axis, 0.5) for z in (-0.25, 0.25)]
    at = rng.uniform(-0.2, 0.2, (n, 3))
    return at, [18e3, 0.0, 44e3] + 10 * sum(wire_field(ring, at) for ring in rings)


def test_the_map_has_no_curl_and_no_divergence() -> None:
    room = simulate_room(80, seed=1)
    made = ag.fit_map(room.position, room.field)
    at = draw_places(made, 30, 0)
    gradient = differentiate(lambda x: made.at(x).field, at, 1e-4)
    size = np.abs(gradient).max()
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-5 * size
    assert np.abs(gradient - gradient.swapaxes(1, 2)).max() < 1e-5 * size
    assert made.at(at).gradient == pytest.approx(gradient, abs=1e-5 * size)


def test_the_likelihood_and_what_is_left_out_are_those_of_the_whole_covariance() -> None:
    """Restricted likelihood and leaving out, by matrices of all readings."""
    room = simulate_room(12, seed=2)
    readings = Readings(room.position, room.field, np.linspace(0.5, 2.0, 12))
    box = (room.position.min(axis=0), room.position.max(axis=0))
    process, surprise = fit_process(readings, box, 1.5)
    phi = make_features(room.position, lay_sources(*box, 1.5), process.scale).reshape(36, -1)
    noise = np.repeat(process.noise / readings.weight, 3)
    whole = process.amplitude * phi @ phi.T + np.diag(noise)
    ones = np.tile(np.eye(3), (12, 1))
    inverse = np.linalg.inv(whole)
    p = inverse - inverse @ ones @ np.linalg.solve(ones.T @ inverse @ ones, ones.T @ inverse)
    y = room.field.ravel()
    found = []
    for k in range(12):
        rows = slice(3 * k, 3 * k + 3)
        one = (p @ y)[rows]
        found.append(one @ np.linalg.solve(p[rows, rows], one))
    assert surprise == pytest.approx(found, rel=1e-4)
    cost = np.linalg.slogdet(whole)[1] + np.linalg.slogdet(ones.T @ inverse @ ones)[1] + y @ p @ y
    constant = -3 * np.log(readings.weight).sum() + 3 * np.log(readings.weight.sum())
    assert process.cost == pytest.approx(cost - constant, rel=1e-5)


def test_the_posterior_is_that_of_kriging() -> None:
    """Field and covariance at a place, by the covariances of readings and place alone."""
    room = simulate_room(12, seed=3)
    made = ag.fit_map(room.position, room.field)
    process, at = made.processes[0], room.size[None] / 2
    everywhere = np.concatenate([room.position, at])
    phi = make_features(everywhere, process.sources, process.scale).reshape(39, -1)
    prior = process.amplitude * phi @ phi.T + 1e12 * np.tile(np.eye(3), (13, 13))
    seen = prior[:36, :36] + process.noise * np.eye(36)
    gain = np.linalg.solve(seen, prior[:36, 36:]).T
    one = FieldMap(**{**vars(made), "processes": (process,), "weights": np.ones(1)}).at(at)
    assert one.field[0] == pytest.approx(gain @ room.field.ravel(), abs=0.5)
    spread = prior[36:, 36:] - gain @ prior[:36, 36:]
    assert one.covariance[0] == pytest.approx(spread, abs=0.02 * np.trace(spread))


@pytest.mark.slow
def test_errors_are_as_large_as_stated_in_rooms() -> None:
    """Iron stands anywhere from half a metre on: where some stands near a place that no reading was
    near, the error is larger than a Gaussian process thinks, so 94 % are within two."""
    over, slopes = [], []
    for seed in range(30):
        room = simulate_room(120, seed=seed)
        made = ag.fit_map(room.position, room.field)
        at = draw_places(made, 100, seed)
        here = made.at(at)
        over.append((here.field - room.compute_truth(at)) / here.sd)
        truth = differentiate(room.compute_truth, at, 1e-4)
        slopes.append((here.gradient - truth) / here.gradient_sd)
    for values in (np.concatenate(over), np.concatenate(slopes)):
        assert abs(values.mean()) < 0.1
        assert 0.8 < np.sqrt(np.median([np.mean(one**2) for one in np.split(values, 30)])) < 1.3
        assert (np.abs(values) < 1).mean() == pytest.approx(0.70, abs=0.06)
        assert (np.abs(values) < 2).mean() > 0.92


def test_errors_are_as_large_as_stated_in_a_coil() -> None:
    over, verdicts = [], []
    for seed in range(12):
        at, field = in_a_coil(seed)
        noise = 5.0 * np.random.default_rng(100 + seed).standard_normal(field.shape)
        made = ag.fit_map(at, field + noise)
        places, truth = in_a_coil(1000 + seed)
        inside = ((places >= made.low) & (places <= made.high)).all(axis=1)
        here = made.at(places[inside])
        over.append((here.field - truth[inside]) / here.sd)
        verdicts.append(made.verdict)
        assert np.median(here.sd) < 5.0
    every = np.concatenate(over)
    assert abs(every.mean()) < 0.2
    assert 0.8 < every.std() < 1.2
    assert verdicts.count("good") >= 11


def test_a_noise_that_is_stated_right_is_good_and_a_wrong_one_is_said() -> None:
    for seed in range(4):
        room = simulate_room(100, noise=20.0, seed=seed)
        right = ag.fit_map(room.position, room.field, noise=20.0)
        assert right.verdict == "good", right.status
        assert abs(right.noise - 20.0) < 4 * right.noise_sd
        for stated in (5.0, 80.0):
            wrong = ag.fit_map(room.position, room.field, noise=stated)
            assert [one.name for one in wrong.findings] == ["noise"]
            assert wrong.noise == pytest.approx(ag.fit_map(room.position, room.field).noise)
            assert f"{stated:g} nT are stated" in wrong.status


@pytest.mark.parametrize("seed", range(5))
def test_a_reading_at_a_wrong_place_is_left_out_and_named(seed: int) -> None:
    room = simulate_room(120, seed=100 + seed)
    wrong = int(np.argmin(np.linalg.norm(room.position - room.size / 2, axis=1)))
    moved = room.position.copy()
    moved[wrong] += [1.0, -0.8, 0.4]
    made = ag.fit_map(moved, room.field)
    assert np.flatnonzero(made.left_out).tolist() == [wrong]
    assert made.verdict == "check"
    x, y, z = moved[wrong]
    assert f"({x:.2f}, {y:.2f}, {z:.2f}) m" in made.status
    without = ag.fit_map(np.delete(moved, wrong, axis=0), np.delete(room.field, wrong, axis=0))
    assert made.noise == pytest.approx(without.noise)


@pytest.mark.slow
def test_readings_that_are_right_are_hardly_ever_left_out() -> None:
    rooms = [simulate_room(120, seed=seed) for seed in range(100, 140)]
    left = [ag.fit_map(room.position, room.field).left_out.any() for room in rooms]
    assert sum(left) <= 1


def test_errors_of_places_are_counted_with_where_stated_and_said_where_not() -> None:
    """Places good to 3 cm; sensors to 5 nT."""
    over = []
    for seed in range(4):
        room = simulate_room(100, noise=5.0, clear_m=0.9, seed=seed)
        apart = 0.03 * np.random.default_rng(seed).standard_normal(room.position.shape)
        silent = ag.fit_map(room.position + apart, room.field, noise=5.0)
        assert "noise" in [one.name for one in silent.findings]
        stated = ag.fit_map(room.position + apart, room.field, noise=5.0, position_sd_m=0.03)
        assert stated.verdict == "good", stated.status
        assert 2.5 < stated.noise < 8.0
        at = draw_places(stated, 100, seed)
        here = stated.at(at)
        over.append((here.field - room.compute_truth(at)) / here.sd)
    assert np.sqrt(np.mean(np.square(over))) < 1.4


@pytest.mark.slow
def test_where_to_measure_next_lowers_the_error_more_than_chance() -> None:
    ratios = []
    for seed in range(4, 10):
        room = simulate_room(40, seed=seed)
        made = ag.fit_map(room.position, room.field, noise=20.0, measure_next=6)
        at = draw_places(made, 200, 1)

        def measure_also(more: np.ndarray, room=room, at=at) -> float:
            places = np.concatenate([room.position, more])
            rng = np.random.default_rng(5)
            field = room.compute_truth(places) + rng.normal(0, 20, places.shape)
            here = ag.fit_map(places, field, noise=20.0).at(at)
            return float(np.sqrt(np.square(here.field - room.compute_truth(at)).mean()))

        others = [measure_also(draw_places(made, 6, one)) for one in range(20, 24)]
        ratios.append(measure_also(made.next_places) / np.median(others))
    assert np.exp(np.mean(np.log(ratios))) < 0.9, ratios


def test_the_next_places_are_those_that_lower_the_mean_variance_most() -> None:
    """Against every candidate tried as a reading of its own."""
    room = simulate_room(25, seed=4)
    made = ag.fit_map(room.position, room.field, noise=20.0)
    process = made.processes[int(np.argmax(made.weights))]
    chosen = choose_next(process, (made.low, made.high), 1)[0]
    axes = [
        np.linspace(a, b, round((b - a) / ((made.high - made.low).max() / 8)) + 1)
        for a, b in zip(made.low, made.high, strict=True)
    ]
    grid = np.array(list(product(*axes)))
    phi = make_features(grid, process.sources, process.scale) - process.mean[1]
    flat = phi.reshape(3 * len(grid), -1)
    less = process.amplitude / (process.noise + process.amplitude * process.strength)
    weights = np.eye(flat.shape[1]) - (process.seen * (less * process.strength)) @ process.seen.T
    left = []
    for k in range(len(grid)):
        rows = flat[3 * k : 3 * k + 3]
        seen = process.amplitude * rows @ weights @ rows.T + process.noise * np.eye(3)
        across = process.amplitude * flat @ (weights @ rows.T)
        left.append(-np.trace(across @ np.linalg.solve(seen, across.T)))
    assert grid[int(np.argmin(left))] == pytest.approx(chosen)


def test_many_readings_are_averaged_where_they_lie_together() -> None:
    room = simulate_room(3 * MAX_READINGS, seed=5)
    made = ag.fit_map(room.position, room.field)
    assert len(made.readings.field) <= MAX_READINGS
    assert made.readings.weight.sum() == 3 * MAX_READINGS
    assert len(made.left_out) == 3 * MAX_READINGS
    at = draw_places(made, 100, 0)
    few = ag.fit_map(room.position[:100], room.field[:100])
    inside = ((at > few.low) & (at < few.high)).all(axis=1)
    assert np.median(made.at(at[inside]).sd) < np.median(few.at(at[inside]).sd)


def test_what_cannot_be_mapped_is_said() -> None:
    room = simulate_room(30, seed=6)
    with pytest.raises(CoverageError, match="different places are too few"):
        ag.fit_map(room.position[:5], room.field[:5])
    with pytest.raises(AgonicError, match=r"both need \(n, 3\)"):
        ag.fit_map(room.position, room.field[:, 0])
    with pytest.raises(AgonicError, match="not numbers"):
        ag.fit_map(room.position, np.where(room.field > 4.4e4, np.nan, room.field))
    made = ag.fit_map(room.position, room.field)
    with pytest.raises(ValidityError, match="measure there first") as caught:
        made.at([room.size / 2, [50.0, 0.0, 0.0]])
    assert caught.value.mask.tolist() == [False, True]


def write_table(file: Path, columns: dict[str, np.ndarray]) -> Path:
    rows = np.stack(list(columns.values()), axis=1).tolist()
    text = "\n".join([",".join(columns), *(",".join(f"{v:.6f}" for v in row) for row in rows)])
    file.write_text(text + "\n")
    return file


def test_the_command_maps_readings_in_either_axes(tmp_path: Path, capsys) -> None:
    room = simulate_room(60, seed=7)
    place = {f"{a}_m": room.position[:, k] for k, a in enumerate("xyz")}
    still = write_table(
        tmp_path / "room.csv",
        place | {f"mag_{a}_nT": room.field[:, k] for k, a in enumerate("xyz")},
    )
    out = tmp_path / "map"
    status, said = answer(capsys, "map", str(still), "-o", str(out), "--next", "3")
    assert (status, len(said["next_m"])) == (0, 3)
    off = (
        np.array(said["middle_nT"])
        - room.compute_truth(np.array([said["low_m"], said["high_m"]]).mean(axis=0)[None])[0]
    )
    assert (np.abs(off) < 5 * np.array(said["middle_sd_nT"])).all()
    page = (out / "report.html").read_text()
    assert page.count('class="dots wanted"') == 2
    assert len((out / "map.csv").read_text().splitlines()) == 1 + 9**3
    rng = np.random.default_rng(0)
    roll, pitch, heading = (
        rng.uniform(-60, 60, 60),
        rng.uniform(-60, 60, 60),
        rng.uniform(0, 360, 60),
    )
    seen = np.einsum("nij,ni->nj", rot_nb(roll, pitch, heading), room.field) / 1000
    angles = {"roll_deg": roll, "pitch_deg": pitch, "heading_deg": heading}
    turned = write_table(
        tmp_path / "turned.csv",
        place | {f"mag_{a}_uT": seen[:, k] for k, a in enumerate("xyz")} | angles,
    )
    again = answer(capsys, "map", str(turned))[1]
    assert again["middle_nT"] == pytest.approx(said["middle_nT"], abs=2.0)


def test_mistakes_in_a_table_are_named(tmp_path: Path, capsys) -> None:
    room = simulate_room(20, seed=8)
    field = {f"mag_{a}_nT": room.field[:, k] for k, a in enumerate("xyz")}
    file = write_table(tmp_path / "room.csv", field)
    assert "has no column x_m, y_m, z_m" in complaint(capsys, "map", str(file))
    assert "name one" in complaint(capsys, "map", str(file), "-o", "map.html")
    raw = write_table(
        tmp_path / "raw.csv", {f"mag_{a}": room.field[:, k] for k, a in enumerate("xyz")}
    )
    with pytest.raises(UnitError, match="--unit"):
        read_region(raw)
    with pytest.raises(LogError, match=r"none\.csv: cannot be read"):
        read_region(tmp_path / "none.csv")


def test_a_table_is_read_once(tmp_path: Path, monkeypatch) -> None:
    room = simulate_room(20, seed=8)
    columns = {f"{a}_m": room.position[:, k] for k, a in enumerate("xyz")}
    columns |= {f"mag_{a}_nT": room.field[:, k] for k, a in enumerate("xyz")}
    plain = write_table(tmp_path / "room.csv", columns)
    packed = tmp_path / "room.csv.gz"
    packed.write_bytes(gzip.compress(plain.read_bytes()))
    read = []
    monkeypatch.setattr(files, "read_table", lambda path: read.append(path) or read_table(path))
    for file in (plain, packed):
        position, samples = read_region(file)
        np.testing.assert_allclose(position, room.position, atol=1e-6)
        np.testing.assert_allclose(samples.field, room.field, atol=1e-3)
    assert len(read) == 2
