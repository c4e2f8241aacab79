"""What a bias that was another for a while adds to the standard errors of a fit to all readings."""

from dataclasses import replace

import numpy as np
import pytest

from agonic import Reference, fit_ellipsoid
from agonic.ellipsoid.evidence import widen_by_change
from agonic.fit import Fit
from agonic.health import Finding
from agonic.health.adequacy import ModelError
from agonic.simulation import simulate

APART = 300.0  # nT


@pytest.fixture(scope="module")
def changed() -> Fit:
    fit = fit_ellipsoid(simulate("tumble", n=600, seed=1).samples, Reference.constant(50_000))
    return fit.with_findings(Finding("field changed", "check", "the bias moved", bias_sd=APART))


def test_the_error_of_bias_and_heading_holds_how_far_biases_are_apart(changed: Fit) -> None:
    wider = widen_by_change(changed)
    np.testing.assert_allclose(wider.sd[:3], np.hypot(changed.sd[:3], APART))
    np.testing.assert_allclose(wider.sd[3:], changed.sd[3:])
    added = np.degrees(APART / 25_000)  # level, at a dip of 60°
    assert wider.coverage.heading_sd_deg == pytest.approx(
        np.hypot(changed.coverage.heading_sd_deg, added), rel=0.1
    )
    assert wider.accuracy.own_deg == wider.coverage.heading_sd_deg


def test_what_errors_of_the_model_hold_already_counts_once(changed: Fit) -> None:
    growth = np.zeros((9, 9))
    growth[:3, :3] = np.diag([2.0, 0.5, 0.0]) * APART**2
    drift = ModelError(
        cause="bias drift", p_value=0.0, size=APART, heading_deg=1.0, stated_deg=0.1, growth=growth
    )
    grown = replace(
        changed,
        calibration=replace(
            changed.calibration, covariance=changed.calibration.covariance + growth
        ),
    )
    added = widen_by_change(grown, [drift]).sd[:3] ** 2 - grown.sd[:3] ** 2
    np.testing.assert_allclose(added, np.array([0.0, 0.5, 1.0]) * APART**2, atol=1e-6)


def test_a_note_of_a_change_adds_nothing(changed: Fit) -> None:
    (found,) = [one for one in changed.findings if one.bias_sd]
    noted = replace(changed, findings=(replace(found, severity="note"),))
    assert widen_by_change(noted) is noted
