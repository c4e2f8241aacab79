"""What to do to a compass after a swing: named where it helps, with what it leaves."""

import numpy as np

from agonic.calibration.deviation import Deviation
from agonic.headings.deviation import fit_deviation
from agonic.headings.deviation.document import describe_deviation, find_remedies

ROSE = np.arange(0.0, 360.0, 15.0)


def swung(coefficients: list[float], noise: float = 0.3):
    card = Deviation(coefficients=coefficients)
    scatter = noise * np.random.default_rng(5).standard_normal(len(ROSE))
    return fit_deviation(ROSE, ROSE + card.at(ROSE) + scatter, noise_deg=noise)


def test_a_turned_compass_is_turned_back() -> None:
    """The reading of a compass turned clockwise by A grows by A, so that much deviation goes."""
    fit = swung([4.0, 0.0, 0.0, 0.0, 0.0])
    (remedy,) = find_remedies(fit.calibration)
    assert "4.0° clockwise" in remedy.what or "3.9° clockwise" in remedy.what
    after = Deviation(coefficients=fit.calibration.coefficients * [0, 1, 1, 1, 1])
    assert remedy.after_deg == np.abs(after.at(np.arange(360.0))).max()
    assert remedy.after_deg < 0.5
    (back,) = find_remedies(swung([-4.0, 0.0, 0.0, 0.0, 0.0]).calibration)
    assert "counterclockwise" in back.what


def test_magnets_leave_what_is_soft_iron() -> None:
    remedies = find_remedies(swung([1.0, 12.0, 8.0, 5.0, 1.5]).calibration)
    assert [remedy.what.split()[0] for remedy in remedies] == ["turn", "null", "both"]
    assert abs(remedies[2].after_deg - np.hypot(5.0, 1.5)) < 0.4  # D and E stay


def test_a_good_compass_is_left_alone() -> None:
    made = describe_deviation(swung([0.05, 0.1, -0.1, 0.05, 0.0]))
    assert made.to_record()["remedies"] == []
    assert "to do" not in made.to_text().lower()
