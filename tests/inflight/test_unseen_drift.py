"""A drift too small for unseen readings to ask for is in the standard error."""

import numpy as np
import pytest

from agonic.inflight.fit import fit_inflight
from tests.inflight.test_fit import GROUND, orbit


@pytest.mark.slow
@pytest.mark.parametrize("size", [0.0, 15.0, 30.0])
def test_it_is_honest_at_the_end_of_the_record(size: float) -> None:
    """Of three to six standard errors; error over σ 2.3 and 3.5 where the bias was constant."""
    n, z, sd = 3000, [], []
    for seed in range(3):
        way = np.random.default_rng(seed + 40).normal(size=3)
        drift = np.outer(np.linspace(-1, 1, n), size * way / np.linalg.norm(way))
        fit = fit_inflight(orbit(seed, n=n, step_s=20.0, moved=drift), ground=GROUND)
        z.append((fit.change.bias - drift[-1]) / fit.sd[:3])
        sd.append(fit.sd[:3].mean())
    assert 0.4 < np.sqrt(np.mean(np.square(z))) < 1.8
    if size == 0.0:  # a bias that stays is known nearly as well as if that were certain
        plain = fit_inflight(orbit(0, n=n, step_s=20.0), ground=GROUND, drift_knots=0)
        assert np.median(sd) < 1.3 * plain.sd[:3].mean()
