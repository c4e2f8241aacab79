"""The moments of changes and disturbances: where they were, by the clock of the log."""

import re

import numpy as np
import pytest

import agonic as ag
from agonic.health import Finding
from agonic.health.outliers import find_stretches
from agonic.simulation import magnet_attached, simulate, with_outliers

FIELD = ag.Reference.constant(50_000.0)


def disturbed(kind: str, *stretches: tuple[float, float, tuple[float, float, float]], **settings):
    """A minute by a clock that began at 1000 s, with magnets (nT) there for a while."""
    magnets = [magnet_attached(start, offset, until=stop) for start, stop, offset in stretches]
    defects = [*magnets, *settings.pop("defects", [])]
    made = simulate(kind, n=3000, rate_Hz=50.0, defects=defects, **settings).samples
    return made.with_columns(time=made.time + 1000.0)


def told(finding: Finding) -> list[float]:
    return [float(number) for number in re.findall(r"([\d.]+) s\b", finding.what)]


def grave(samples: ag.Samples) -> list[Finding]:
    return [f for f in ag.fit_ellipsoid(samples, FIELD).findings if f.severity != "note"]


STRONG, OTHER = (9000.0, -5000.0, 15_000.0), (-12_000.0, 4000.0, 3000.0)


@pytest.mark.parametrize(("kind", "seed"), [("tumble", 0), ("hand", 1)])
@pytest.mark.parametrize(
    "stretches",
    [
        [(22.0, 31.0, STRONG)],
        [(10.0, 14.0, STRONG)],
        [(8.0, 19.0, STRONG), (33.0, 45.0, STRONG)],
        [(8.0, 19.0, STRONG), (33.0, 45.0, OTHER)],
    ],
    ids=["once", "short", "twice", "two magnets"],
)
def test_a_change_is_named_at_its_moments(kind: str, stretches, seed: int) -> None:
    (finding,) = grave(disturbed(kind, *stretches, seed=seed))
    truth = [1000 + moment for start, stop, _ in stretches for moment in (start, stop)]
    assert told(finding) == pytest.approx(truth, abs=1.0)


def test_what_passes_is_named_with_its_times_and_the_rest_is_calibrated() -> None:
    """A field that grows and goes within three seconds, so that no second bias explains it."""
    made = simulate("hand", n=3000, rate_Hz=50.0, seed=1)
    near = np.maximum(0.0, 1 - np.abs(made.samples.time - 40.0) / 1.5)[:, None]
    field = made.samples.field + 30_000.0 * near**2 * [0.3, -0.5, 0.8]
    fit = ag.fit_ellipsoid(made.samples.with_columns(field=field), FIELD)
    assert fit.verdict == "good"
    (finding,) = [f for f in fit.findings if f.name == "outliers"]
    assert "a heading at those times is wrong" in finding.what
    assert told(finding) == pytest.approx([38.5, 41.5], abs=0.6)
    assert np.abs((fit.calibration.bias - made.truth.bias) / fit.sd[:3]).max() < 4


def test_scattered_outliers_have_no_times() -> None:
    rng = np.random.default_rng(0)
    for share in (0.01, 0.05, 0.2):
        assert not len(find_stretches(rng.random(20_000) < share))
    samples = disturbed("tumble", defects=[with_outliers(0.05)])
    assert not grave(samples)


def test_a_stretch_among_scattered_outliers_is_found() -> None:
    rng = np.random.default_rng(1)
    outlier = rng.random(5000) < 0.05
    outlier[3000:3100] = rng.random(100) < 0.8
    ((first, last),) = find_stretches(outlier)
    assert (first, last) == (pytest.approx(3000, abs=8), pytest.approx(3099, abs=8))
