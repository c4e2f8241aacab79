"""Many adjusted fits at once are those of `fit_moments`, one by one."""

import numpy as np
import pytest

from agonic.ellipsoid import fit_moments, many_sensors
from agonic.ellipsoid.many_sensors import Fits, fit_many
from agonic.errors import AgonicError, CoverageError
from agonic.moments import Moments
from agonic.reference import Reference

FIELD = 48_000.0


def readings(k: int) -> np.ndarray:
    """The readings of sensor k: sound ones of three models, then each way to be broken."""
    rng = np.random.default_rng(k)
    n = int(rng.integers(60, 400))
    u = rng.normal(size=(n, 3))
    u /= np.linalg.norm(u, axis=1, keepdims=True)
    kind = k % 12
    u[:, 2] = {8: 0.0, 9: 0.97}.get(kind, u[:, 2])  # a plane; a cap that is almost one
    gains = np.ones(3) if kind < 2 else rng.uniform(0.9, 1.1, 3)
    shape = np.diag(gains)
    if kind > 3:
        skew = rng.normal(0, 0.03, (3, 3))
        shape = shape + skew + skew.T
    bias = rng.normal(0, 20_000, 3) * (100 if kind == 7 else 1)
    noise = rng.normal(size=(n, 3)) * rng.uniform(20, 400)
    raw = FIELD * u @ shape + bias + noise
    return {
        10: np.tile(bias, (n, 1)),  # never changes
        11: raw[: k % 14],  # too few, or hardly enough
    }.get(kind, raw)


def sums(rows: np.ndarray) -> Moments:
    if not len(rows):
        return Moments(centre=np.zeros(3), scale=1.0, sums=np.zeros(35))
    return Moments.of(rows)


@pytest.fixture(scope="module")
def fleet() -> list[Moments]:
    """Some about their own middle, some about another centre that is as good."""
    made = [sums(readings(k)) for k in range(360)]
    return [m if k % 3 else m.rebase([500.0, -100.0, 9000.0], 3e4) for k, m in enumerate(made)]


def together(fleet: list[Moments], *more: object, **settings: object) -> Fits:
    parts = zip(*((m.sums, m.centre, m.scale) for m in fleet), strict=True)
    return fit_many(*parts, *more, **settings)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("reference", "settings"),
    [
        (None, {}),
        (Reference.constant(FIELD, sd=150.0), {"gauge": "triangular", "inclination_deg": -30.0}),
        (Reference.constant(FIELD), {"model": "diagonal", "threads": 2}),
    ],
)
def test_each_is_what_fit_moments_finds(fleet, reference, settings, monkeypatch):
    monkeypatch.setattr(many_sensors, "_SLAB", 70)
    many = together(fleet, reference, **settings)
    alone = {name: value for name, value in settings.items() if name != "threads"}
    refused = 0
    for k, moments in enumerate(fleet):
        if many.refusal[k]:
            with pytest.raises(CoverageError) as refusal:
                fit_moments(moments, reference, **alone)
            assert many.refusal[k] == str(refusal.value)
            assert np.isnan(many.bias[k]).all()
            refused += 1
            continue
        one = fit_moments(moments, reference, **alone)
        affine = one.calibration
        assert many.model[k] == affine.model
        if one.condition > 1e9:  # nothing determined: rounding decides the figures
            assert many.heading_sd_deg[k] > 10 < one.coverage.heading_sd_deg
            continue
        sd = np.maximum(one.sd, 1e-9)
        assert np.abs(many.bias[k] - affine.bias).max() < 1e-5 * sd[:3].max()
        assert np.abs(many.matrix[k] - affine.matrix).max() < 1e-5 * sd[3:].max()
        assert many.sd[k] == pytest.approx(one.sd, rel=1e-5, abs=1e-10)
        assert many.noise[k] == pytest.approx(one.noise, rel=1e-6)
        assert many.magnitude[k] == pytest.approx(affine.magnitude, rel=1e-6)
        assert many.heading_sd_deg[k] == pytest.approx(one.coverage.heading_sd_deg, rel=1e-4)
        if one.tests:
            assert many.p_values[k] == pytest.approx([t.p_value for t in one.tests], abs=1e-6)
    assert 30 < refused < 120


def test_the_spread_is_that_of_the_calibrated_readings():
    rows = [readings(k) for k in (1, 3, 5, 6)]
    many = together([Moments.of(r) for r in rows], Reference.constant(FIELD))
    for k, raw in enumerate(rows):
        size = np.linalg.norm((raw - many.bias[k]) @ many.matrix[k].T, axis=1)
        assert many.spread[k] == pytest.approx(size.std() / size.mean(), rel=0.01)


def test_a_reference_that_varies_is_refused(fleet):
    with pytest.raises(AgonicError, match="one constant reference"):
        together(fleet[:2], Reference.magnitude([FIELD, FIELD]))
