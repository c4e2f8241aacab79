"""The difference of two calibrations is that of their truths, and its standard error is honest."""

import numpy as np
import pytest

import agonic as ag
from agonic.simulation import simulate

FIELD = 50_000.0


@pytest.mark.slow
def test_standard_errors_of_differences_are_honest():
    """Difference/sd of two fits to the same sensor has mean 0 and sd 1 over seeds."""
    scores, fields, chances = [], [], []
    for seed in range(12):
        made = simulate("tumble", n=400, noise=300.0, seed=seed)
        again = simulate("tumble", n=400, noise=300.0, seed=100 + seed, calibration=made.truth)
        fits = [ag.fit_ellipsoid(one.samples, FIELD, model="full") for one in (made, again)]
        found = ag.compare(*fits)
        scores.append(found.heading_deg[::9] / found.heading_sd_deg[::9])
        fields.append(found.field_rms / np.sqrt(np.mean(found.field_sd**2)))
        chances.append(found.p_value)
    assert min(chances) > 0.001
    assert 0.2 < np.mean(chances) < 0.8
    assert abs(np.mean(scores)) < 3 / np.sqrt(len(scores))
    assert 0.6 < np.sqrt(np.mean(np.square(scores))) < 1.5
    assert 0.5 < np.mean(fields) < 2.0


def test_a_bias_turns_headings_by_what_geometry_says():
    one = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), magnitude=FIELD)
    other = ag.Affine(bias=[0, 800.0, 0], matrix=np.eye(3), magnitude=FIELD)
    found = ag.compare(one, other, inclination_deg=60.0)
    psi = np.radians(found.headings_deg)
    expected = np.degrees(np.arctan2(800 * np.cos(psi), 25_000 - 800 * -np.sin(psi)))
    assert found.heading_deg == pytest.approx(expected, abs=1e-9)
    assert found.field_rms == pytest.approx(800.0)
    assert found.matters
    assert "matters" in found.status
    assert found.heading_sd_deg is None


def test_a_small_sure_difference_is_of_no_matter():
    one = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), covariance=1e-12 * np.eye(9))
    other = ag.Affine(bias=[20.0, 0, 0], matrix=np.eye(3), covariance=1e-12 * np.eye(9))
    found = ag.compare(one, other)
    assert found.sure
    assert not found.matters
    assert "does not matter for headings" in found.status


def test_what_cannot_be_compared_is_told():
    one = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3))
    raw = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), unit_in="raw")
    with pytest.raises(ag.UnitError):
        ag.compare(one, raw)
    with pytest.raises(ag.FrameError):
        ag.compare(one, ag.Affine(bias=[0, 0, 0], matrix=np.eye(3), frame_out="b"))
    with pytest.raises(ag.AgonicError, match="two Affine or Thermal"):
        ag.compare(one, 3.0)
    with pytest.raises(ag.AgonicError, match="there is no such file"):
        ag.compare(one, "mag.json")
