"""What an ellipsoid fit cannot do, and says so; fits from moments; calibrations made earlier."""

import contextlib

import numpy as np
import pytest

import agonic as ag
from agonic.ellipsoid import evaluate
from agonic.simulation import magnet_attached, simulate
from tests.ellipsoid.sensors import KNOWN, MODELS, assert_close, made


def readings(*rows: list[float]) -> ag.Samples:
    return ag.Samples(field=np.array(rows))


@pytest.mark.parametrize(
    ("samples", "settings", "said"),
    [
        (readings([1, 2, 3], [3, 4, 5], [1, 0, 1]), {}, "3 readings .* the 4 unknowns of a sphere"),
        (made(n=8).samples, {"model": "full"}, "8 readings .* the 9 unknowns of a full model"),
        (readings(*[[1.0, 2.0, 3.0]] * 50), {}, "the readings never change"),
    ],
)
def test_nothing_to_fit_is_told_with_the_turns_to_add(samples, settings, said: str) -> None:
    with pytest.raises(ag.CoverageError, match=said) as caught:
        ag.fit_ellipsoid(samples, KNOWN, **settings)
    assert "turn" in caught.value.turns


@pytest.mark.parametrize("method", ["adjusted", "li-griffiths", "linear"])
@pytest.mark.parametrize("kind", ["plane", "line", "static"])
def test_algebraic_methods_never_crash_on_what_they_cannot_fit(method: str, kind: str) -> None:
    rng = np.random.default_rng(0)
    field = 30_000.0 * rng.normal(size=(500, 3))
    field *= {"plane": [1, 1, 0], "line": [1, 0, 0], "static": [1e-3] * 3}[kind]
    samples = ag.Samples(field=field + 1000.0)
    with contextlib.suppress(ag.CoverageError):  # the other way to say so
        assert ag.fit_ellipsoid(samples, KNOWN, model="full", method=method).verdict == "refused"


def test_methods_say_what_they_need() -> None:
    samples = made(n=100).samples
    with pytest.raises(ag.AgonicError, match="fit a full ellipsoid, not a sphere"):
        ag.fit_ellipsoid(samples, KNOWN, model="sphere", method="li-griffiths")
    each = ag.Reference.magnitude(np.linspace(4e4, 5e4, 100))
    with pytest.raises(ag.AgonicError, match="needs a constant magnitude; use method='likelihood'"):
        ag.fit_ellipsoid(samples, each, method="adjusted")
    with pytest.raises(ag.AgonicError, match="need one constant reference magnitude"):
        ag.fit_moments(ag.Moments.of(samples.field), each)


@pytest.mark.parametrize("model", MODELS)
def test_moments_alone_give_the_adjusted_fit(model: str) -> None:
    sensor = made(model)
    rows = ag.fit_ellipsoid(sensor.samples, KNOWN, model=model, method="adjusted")
    sums = ag.fit_moments(ag.Moments.of(sensor.samples.field), KNOWN, model=model)
    assert_close(sums.calibration, rows.calibration, bias=1e-3, matrix=1e-8)
    assert sums.sd == pytest.approx(rows.sd, rel=1e-3, abs=1e-12)
    assert sums.noise == pytest.approx(100.0, rel=0.1)
    assert sums.residuals is None
    assert sums.n == 2000
    assert sums.ok


def test_moments_of_a_plane_are_refused_or_told() -> None:
    flat = simulate("circle", tilt_deg=1e-6, n=1000).samples
    with pytest.raises(ag.CoverageError):
        ag.fit_moments(ag.Moments.of(np.ones((10, 3))))
    with contextlib.suppress(ag.CoverageError):  # the other way to say so
        assert ag.fit_moments(ag.Moments.of(flat.field), KNOWN).verdict == "refused"


def test_evidence_for_a_given_calibration_is_that_of_its_fit() -> None:
    sensor = made()
    fit = ag.fit_ellipsoid(sensor.samples, KNOWN)
    again = evaluate(fit.calibration, sensor.samples, KNOWN)
    assert again.residuals == pytest.approx(fit.residuals)
    assert again.noise == pytest.approx(fit.noise, rel=0.01)
    assert again.verdict == "good"
    magnet = magnet_attached(0.0, [5000.0, 0.0, 0.0])(sensor.samples)
    assert evaluate(fit.calibration, magnet, KNOWN).noise > 10 * fit.noise


def test_a_fit_that_runs_away_on_three_levels_is_refused_for_their_size() -> None:
    levels = [[-1, -1, 0], [-1, 0, 0], [0, -1, 0], [0, -1, 1], [0, 0, 0], [0, 0, 1], [0, 1, 0]]
    times = [7, 20, 148, 1, 32, 122, 102, 4, 14]
    field = 74_000.0 * np.repeat([*levels, [1, -1, 0], [1, 0, 0]], times, axis=0)
    with pytest.raises(ag.CoverageError, match="steps of 74000 nT"):
        ag.fit_ellipsoid(ag.Samples(field=field))
