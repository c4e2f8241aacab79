"""The parts on which the fits of directions rest, each by an example worked by hand."""

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.alignment.direction.compute import interpolate_attitudes
from agonic.alignment.document import format_angle, write_by_axis
from agonic.alignment.figures import (
    draw_axes,
    draw_dome,
    draw_residuals,
    draw_settings,
    place_apart,
)
from agonic.alignment.maths.columns import (
    average_stretches,
    find_rows,
    fit_columns,
    fit_harmonics,
    split,
)
from agonic.alignment.maths.north import (
    average_faces,
    compute_schuler_means,
    evaluate_swing_deg,
    fit_reversals,
)
from agonic.alignment.north.fit import Drift
from agonic.alignment.north.platform import find_settling_chance
from agonic.alignment.session.earth import load_earth_rotation
from agonic.alignment.star_sensor.evidence import write_additions

TWELVE = [np.array([k]) for k in range(12)]


def test_errors_are_written_with_two_digits() -> None:
    assert write_by_axis([1.0, 2.0, 3.25], "°", ", ") == "x 1.0°, y 2.0°, z 3.2°"
    assert format_angle(12.5, 3.0) == "12.50000° ± 3.0″"
    assert format_angle(12.5, np.nan) == "12.50000°"
    more = "add orientations: azimuth 90°, elevation 65°, roll 45°; the zenith, roll 0°"
    assert write_additions([(90.0, 65.0, 45.0), (0.0, 90.0, 0.0)]) == more


def test_stretches_are_split_and_found() -> None:
    assert [rows.tolist() for rows in split(np.array([False, True]))] == [[0, 1], [2]]
    rows = find_rows(np.array([2, 1, 2]), np.array([1, 2, 3]))
    assert [own.tolist() for own in rows] == [[1], [0, 2], []]


def test_columns_that_cancel_are_free_of_the_rest() -> None:
    current = np.tile([1.0, -1.0], 6)
    field = np.outer(current, [3.0, 0.0, 4.0]) + np.array([50.0, 0.0, 20.0])
    seen = average_stretches(TWELVE, np.arange(12.0), field)
    found = fit_columns(seen, current[:, None], 1).coefficients
    np.testing.assert_allclose(found, [[3.0, 0.0, 4.0]], atol=1e-9)
    angle = np.radians(np.arange(0.0, 360.0, 30.0))
    field = 3.0 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=1)
    seen = average_stretches(TWELVE, np.arange(12.0), field)
    once = fit_harmonics(seen, angle, 0, np.zeros(3), twice=False)
    np.testing.assert_allclose(once.parts, [[[3.0, 0.0, 0.0], [0.0, 3.0, 0.0]]], atol=1e-6)


def test_north_by_hand() -> None:
    assert compute_schuler_means(np.array([10.0, 2.0, 8.0, 3.0])).tolist() == [5.5, 5.25]
    assert fit_reversals(np.array([10.0, 2.0, 8.0, 3.0])).reading_deg == 5.375
    params = np.array([5.0, 2.0, 0.0, 0.0, np.pi])
    assert evaluate_swing_deg(params, np.array([0.0, 1.0])).tolist() == [7.0, 3.0]
    both = average_faces(np.array([10.002, 189.998, 10.004, 190.0]))
    np.testing.assert_allclose([both.reading_deg, both.collimation_deg], [10.001, 0.002], atol=1e-9)


def test_a_drift_is_allowed_for_by_its_probability() -> None:
    assert round(Drift(5.0, 1.0).allowed_deg, 1) == 4.9
    assert Drift(0.5, 1.0).allowed_deg == Drift().allowed_deg == 0.0


def test_a_platform_that_settles_moves_along_a_line() -> None:
    rng = np.random.default_rng(0)
    still = [rng.normal(size=(60, 3)) for _ in range(8)]
    assert find_settling_chance(still) > 1e-4
    assert find_settling_chance([one - np.linspace(0, 3, 60)[:, None] for one in still]) < 1e-4


def test_attitudes_between_two_are_on_the_way() -> None:
    quarter = Rotation.from_rotvec([[0, 0, 0], [0, 0, np.pi / 2]]).as_matrix()
    two, none = np.array([0.0, 1.0]), np.zeros((2, 3, 3))
    found = interpolate_attitudes(np.array([0.5, 2.0]), two, quarter, none, np.array([1, 1]), 9)
    assert found[0].tolist() == [0]
    np.testing.assert_allclose(found[1][0, 0], [0.707107, -0.707107, 0.0], atol=1e-6)


def test_the_earths_rotation_is_that_of_the_table() -> None:
    ut1_tai, *_ = load_earth_rotation().at(1_175_774_400.0)  # 2007-04-05 12:00
    assert round(float(ut1_tai[0]), 3) == -33.072


def test_figures_have_what_they_show() -> None:
    drawn = draw_residuals(np.array([[1.0, -2.0, 0.5]]), np.ones((1, 3)), np.array([7])).to_html()
    assert drawn.count('class="bar-') == 3
    assert "residual, nT" in drawn
    assert draw_settings(np.array([1.0, -2.0]), "nT").to_html().count('class="bar-x"') == 1
    dome = draw_dome(np.array([[0.0, 0.0, -1.0]]), np.array([7]), np.array([1.0]))
    assert dome.count("<circle") == 4
    assert 'cx="160.0"' in dome
    apart = np.array([[0.0, 0.0], [60.0, 0.0]])
    assert place_apart(apart, np.ones(2), ["1", "2"]).tolist() == apart.tolist()
    axes = draw_axes(37.0, 64.0, -112.0)
    assert axes.count('class="turn"') == 3
    assert "α = 37.000°" in axes
    assert "z₃" in axes
