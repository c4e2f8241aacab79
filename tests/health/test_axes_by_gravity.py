"""Axes of the magnetometer that are not those of the accelerometer: named, and no false alarm."""

from itertools import permutations, product

import numpy as np
import pytest

import agonic as ag
from agonic.ellipsoid import check_by_gravity, fit_ellipsoid
from agonic.health import check_axes, check_mounting, find_mounting
from agonic.maths.rotations.right_angles import right_angles, vertical_misfit
from agonic.simulation import simulate, simulate_vehicle

NAMINGS = [
    np.eye(3)[list(order)] * np.array(signs)[:, None]
    for order, signs in product(permutations(range(3)), product((1.0, -1.0), repeat=3))
]
"""All 48 matrices from the axes of a sensor to those of its log; the first is the identity."""


def recorded(kind: str, seed: int, **settings) -> ag.Samples:
    """A log with an accelerometer of a phone: 2° of bias, some noise; no roll and pitch."""
    rng = np.random.default_rng(seed)
    made = simulate(kind, n=400, rate_Hz=10.0, seed=seed, **settings).samples
    assert made.acceleration is not None
    force = made.acceleration + 0.2 * rng.normal(size=3) + 0.05 * rng.normal(size=(400, 3))
    return made.with_columns(acceleration=force, roll_deg=None, pitch_deg=None, heading_deg=None)


def renamed_log(samples: ag.Samples, naming: np.ndarray) -> ag.Samples:
    return samples.with_columns(field=samples.field @ naming.T)


def told(samples: ag.Samples, reference: ag.Reference | None = None) -> list[str]:
    result = ag.calibrate(samples, reference, kind="ellipsoid")
    return [finding.what for finding in result.fit.findings if finding.name == "axes"]


@pytest.fixture(scope="module")
def tumbled() -> tuple[ag.Samples, np.ndarray]:
    """A log and its calibrated field."""
    samples = recorded("tumble", 3)
    return samples, fit_ellipsoid(samples).calibration.correct(samples.field)


@pytest.mark.parametrize("number", range(1, 48))
def test_every_wrong_naming_is_told_and_undone(tumbled, number: int) -> None:
    samples, field = tumbled
    naming = NAMINGS[number]
    found = check_axes(field @ naming.T, samples.acceleration, 50_000.0, upwards=False)
    if np.array_equal(naming, -np.eye(3)):  # only the sign of the vertical field differs
        assert found is None
        return
    assert found is not None
    assert found.severity == "check"
    # naming.T takes the named axes back to those of the accelerometer
    along = np.argmax(np.abs(naming.T), axis=0)
    signs = naming.T.sum(axis=0)
    if not np.array_equal(along, [0, 1, 2]) and (signs < 0).any():
        said = ", ".join(
            ("−" if s < 0 else "") + "xyz"[k] for k, s in zip(along, signs, strict=True)
        )
        assert f"what is called x, y, z lies along {said} " in found.what


@pytest.mark.parametrize(
    ("naming", "said"),
    [
        (np.eye(3)[[1, 0, 2]], "x and y are exchanged"),
        (np.eye(3)[[2, 1, 0]], "x and z are exchanged"),
        (np.diag([1.0, 1.0, -1.0]), "z is reversed"),
        (np.eye(3)[[1, 2, 0]], "what is called x, y, z lies along y, z, x"),
        (np.eye(3)[[2, 0, 1]], "what is called x, y, z lies along z, x, y"),
    ],
)
def test_calibrate_says_how_the_axes_are(naming: np.ndarray, said: str) -> None:
    result = ag.calibrate(renamed_log(recorded("hand", 1), naming))
    assert result.verdict == "check"
    assert f"The axes are not those of the accelerometer beside it: {said} (" in result.status
    assert result.fit.calibration.magnitude is not None  # the calibration itself holds


def test_the_sign_of_the_vertical_field_tells_a_turn_from_a_reversal() -> None:
    turned = renamed_log(recorded("tumble", 5), np.diag([-1.0, -1.0, 1.0]))
    assert "z is reversed" in told(turned)[0]  # the fewer reversals, where the sign is unknown
    down = ag.Reference.horizontal_vertical(25_000.0, 43_301.0)
    assert "x and y are reversed" in told(turned, down)[0]


@pytest.mark.parametrize("kind", ["tumble", "hand", "sphere"])
@pytest.mark.parametrize("inclination_deg", [-60.0, 0.0, 30.0, 85.0])
def test_at_every_dip(kind: str, inclination_deg: float) -> None:
    rng = np.random.default_rng(abs(int(inclination_deg)))
    samples = recorded(kind, int(inclination_deg < 10), inclination_deg=inclination_deg)
    assert told(samples) == []
    naming = NAMINGS[rng.choice([k for k in range(1, 48) if k != 7])]
    assert len(told(renamed_log(samples, naming))) == 1


@pytest.mark.slow
def test_no_alarm_where_the_vehicle_manoeuvres() -> None:
    checked = 0
    for seed in range(3):
        logs = [
            simulate(kind, n=1000, rate_Hz=20.0, seed=seed).samples
            for kind in ("flight", "boat", "car")
        ]
        flown = simulate_vehicle(n=1500, seed=seed, bank_deg=(20.0, 45.0)[seed % 2])
        for samples in (*logs, *flown.samples):
            try:
                fit = fit_ellipsoid(samples)
            except ag.errors.AgonicError:
                continue
            checked += fit.verdict != "refused"
            told_now = check_by_gravity(fit, samples, None)
            assert "axes" not in [finding.name for finding in told_now.findings]
    assert checked >= 5


def test_no_alarm_where_the_turning_does_not_determine_it() -> None:
    for naming in NAMINGS[::5]:
        level = renamed_log(recorded("circle", 2, tilt_deg=1.0), naming)
        assert check_axes(level.field, level.acceleration, 50_000.0) is None
    still = recorded("static", 0)
    assert check_axes(still.field, still.acceleration, 50_000.0) is None


def test_no_alarm_where_acceleration_is_not_gravity(tumbled) -> None:
    samples, field = tumbled
    rng = np.random.default_rng(0)
    other = rng.normal(size=field.shape)
    other *= 9.8 / np.linalg.norm(other, axis=1, keepdims=True)
    exchanged = field[:, [1, 0, 2]]
    assert check_axes(exchanged, other, 50_000.0) is None  # of another body
    assert check_axes(exchanged, 0.1 * samples.acceleration, 50_000.0) is None  # gravity taken out
    assert check_axes(exchanged, samples.acceleration, 50_000.0) is not None


def test_strays_and_pushes_do_not_hide_it() -> None:
    samples = renamed_log(recorded("tumble", 4), np.eye(3)[[0, 2, 1]])
    field, force = samples.field.copy(), samples.acceleration.copy()
    field[::25] += 40_000.0
    force[5::10] *= 1.5
    assert "y and z are exchanged" in told(samples.with_columns(field=field, acceleration=force))[0]


def test_the_misfit_is_that_of_least_squares_mounting_by_mounting() -> None:
    rng = np.random.default_rng(2)
    readings = 5e4 * rng.normal(size=(200, 3)) + [9e4, 0.0, -4e4]
    down = rng.normal(size=(200, 3))
    down /= np.linalg.norm(down, axis=1, keepdims=True)
    weights = rng.uniform(0.5, 2.0, 200)
    found = vertical_misfit(readings, down, right_angles(), weights)
    for turn, misfit in zip(right_angles(), found, strict=True):
        wanted = np.einsum("ni,ij,nj->n", down, turn, readings - readings.mean(axis=0))
        design, root = np.column_stack([down, np.ones(200)]), np.sqrt(weights)
        solved = np.linalg.lstsq(design * root[:, None], wanted * root)[0]
        left = (wanted - design @ solved) ** 2
        assert misfit == pytest.approx(np.sqrt(np.average(left, weights=weights)), rel=1e-9)


def test_talk_between_axes_of_a_level_vehicle_is_no_other_mounting() -> None:
    """A lean and the talk between axes cancel for one turn about the vertical, by chance."""
    angle = np.linspace(0.0, 4 * np.pi, 400)
    level = np.stack([0.4 * np.cos(angle), -0.4 * np.sin(angle), np.full(400, 0.9)], axis=1)
    level[:, 2] += 0.02 * level[:, 0]
    down = np.tile([0.0, 0.02, 1.0], (400, 1))
    misfit = vertical_misfit(level, down, right_angles())
    assert misfit.min() < 0.1 * misfit[0]
    assert check_mounting(level, down) is find_mounting(level, down) is None
    naming = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert check_mounting(level @ naming, down) is not None


def test_a_vertical_that_changes_along_an_orbit_is_no_other_mounting() -> None:
    """One side to the Earth from pole to pole: taken for constant, the vertical would be across."""
    rng = np.random.default_rng(4)
    latitude = np.linspace(-1.4, 1.4, 2000)
    vertical, north = 2.0 * np.sin(latitude), np.cos(latitude)
    tilts = 0.002 * rng.normal(size=(2000, 2))
    down = np.column_stack([tilts, np.ones(2000)])
    readings = np.column_stack([north, 0.05 * np.cos(5 * latitude), vertical])
    readings += 0.003 * rng.normal(size=readings.shape) + 0.2
    assert check_mounting(readings, down, np.ones(1)) is not None
    assert check_mounting(readings, down, vertical) is None
    assert find_mounting(readings, down, vertical) is None
    naming = np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    assert check_mounting(readings @ naming, down, vertical) is not None


def test_what_moves_the_readings_of_a_vehicle_that_hardly_turns_is_no_mounting() -> None:
    """A current along y and z: x is the most constant by little, and nobody turned."""
    rng = np.random.default_rng(3)
    readings = np.array([0.2, 0.1, 0.9]) + rng.normal(size=(500, 3)) * [0.05, 0.06, 0.15]
    tilts = 0.01 * rng.normal(size=(500, 2))
    down = np.column_stack([tilts, np.ones(500)])
    misfit = vertical_misfit(readings, down, right_angles())
    assert misfit.min() < 0.4 * misfit[0]
    assert check_mounting(readings, down) is None


@pytest.mark.parametrize(
    ("mirror", "told"),
    [
        (np.diag([-1.0, 1.0, 1.0]), "pitch seems to have the opposite sign"),
        (np.diag([1.0, -1.0, 1.0]), "roll seems to have the opposite sign"),
        (np.array([[0.0, -1, 0], [-1, 0, 0], [0, 0, 1]]), "roll and pitch seem exchanged in"),
    ],
)
def test_roll_or_pitch_of_a_boat_counted_the_wrong_way_round(mirror, told) -> None:
    """Tilts of some degrees beside soft iron of 5 %; a sensor upside down looks the same but for
    the sign of the vertical."""
    rng = np.random.default_rng(5)
    heading, pitch, roll = np.cumsum(rng.normal(size=1000)), *rng.normal(size=(2, 1000)) * 0.08
    down = np.stack([-np.sin(pitch), np.sin(roll) * np.cos(pitch), np.cos(roll) * np.cos(pitch)], 1)
    north = np.stack([np.cos(heading), -np.sin(heading), np.zeros(1000)], axis=1)
    north -= down * np.sum(north * down, axis=1)[:, None]
    north /= np.linalg.norm(north, axis=1)[:, None]
    iron = np.array([[1.03, 0.02, -0.03], [0.02, 0.98, 0.02], [-0.03, 0.02, 1.0]])
    readings = (0.44 * north + 0.9 * down + 0.003 * rng.normal(size=down.shape)) @ iron + 0.1
    assert check_mounting(readings, down, np.array([0.9])) is None
    found = check_mounting(readings, down @ mirror, np.array([0.9]))
    assert found is not None
    assert found.name == "attitude"
    assert told in found.what
    upside_down = check_mounting(-readings, down @ mirror, np.array([0.9]))
    assert upside_down is None or upside_down.name == "mounting"
