"""The likelihood of readings under several noise models against the filter, one after the other."""

import numpy as np
import pytest

from agonic.inflight.tracking.map_estimate import compute_likelihoods
from agonic.maths.equation.affine import SYMMETRIC, magnitude_residual, model_basis
from agonic.maths.estimation.filters import kalman, states


@pytest.mark.parametrize("m", [4, 10])
def test_all_models_at_once_are_as_probable_as_each_by_the_filter(m: int) -> None:
    rng = np.random.default_rng(m)
    unit = rng.normal(size=(150, 3))
    raw = 5e4 * unit / np.linalg.norm(unit, axis=1)[:, None] + rng.normal(0, 80, (150, 3))
    times = np.cumsum(rng.uniform(0.5, 2.0, 150))
    rows = np.column_stack([times, raw, np.full(150, 5e4), np.ones(150)])
    about = np.array([0.0, 30.0, -40.0, 50.0, 1.0, 1.0, 1.0, 0.0, 0.0, 0.0])
    spread = np.array([0.0, *[5e4**2] * 3, *[0.01] * 6])[:m]
    prior = states.start_filter(about, np.diag(spread), times[0])
    base = states.Model(noise=80.0, walk=0.7, matrix_walk=1e-6, gate=np.inf, jump_level=0.0)
    models = [base] + [
        base._replace(external_sd=sd, external_time_s=time)
        for sd, time in ((20.0, 3.0), (90.0, 40.0), (200.0, 900.0))
    ]
    each = []
    for model in models:
        wide = prior._replace(scales=[model.external_sd**2, *prior.scales[1:]])
        _, seen, _ = kalman.advance(wide, model, rows, linearised=about)
        each.append(-(np.log(seen.sd) + 0.5 * (seen.residual / seen.sd) ** 2).sum())

    residual, jacobian = magnitude_residual(raw, about[1:4], np.eye(3), 5e4, 80.0)
    h = np.column_stack([-np.ones(150), jacobian @ model_basis("full", SYMMETRIC)])[:, :m]
    ones = np.ones((150, len(models)))
    found = compute_likelihoods(prior, models, times, residual[:, None] * ones, h, 80.0 * ones)
    np.testing.assert_allclose(found, each, rtol=1e-9)
