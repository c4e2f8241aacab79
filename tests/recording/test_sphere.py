"""What the sphere is drawn from."""

import base64
from dataclasses import replace

import numpy as np
import pytest

from agonic.recording.figures import pack_sphere
from agonic.recording.quantities import compute_residuals
from tests.recording.handmade import BIAS, NOISE


def decoded(data) -> np.ndarray:
    raw = np.frombuffer(base64.b64decode(data["points"]), dtype="<i2").reshape(-1, 3)
    return raw * data["step"] + data["bias"]


def test_points_come_back_to_a_fraction_of_the_noise(good):
    data = pack_sphere(good, compute_residuals(good), 50_000)
    assert np.abs(decoded(data) - good.samples.field).max() < 0.02 * NOISE


def test_a_stray_does_not_cost_the_others_their_resolution(good):
    field = good.samples.field.copy()
    field[7] = 1e9
    result = replace(good, samples=good.samples.with_columns(field=field))
    back = decoded(pack_sphere(result, compute_residuals(good), 50_000))
    keep = np.arange(len(back)) != 7
    assert np.abs(back - field)[keep].max() < 0.1 * NOISE
    direction = (back[7] - BIAS) / np.linalg.norm(back[7] - BIAS)
    assert direction == pytest.approx(np.ones(3) / np.sqrt(3), abs=1e-3)


def test_many_points_are_thinned_over_the_whole_log(good):
    back = decoded(pack_sphere(good, compute_residuals(good), 1000))
    assert len(back) == 1000
    np.testing.assert_allclose(back, good.samples.field[::6], atol=0.02 * NOISE)
