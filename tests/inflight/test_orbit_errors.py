"""What goes round with the orbit is not taken for the bias: clocks, tracks, sunlight."""

import numpy as np
import pytest

from agonic.inflight.fit import fit_inflight
from tests.inflight.test_fit import GROUND, orbit


def late(samples, rows: int):
    """The log with positions of so many rows later."""
    shifted = {
        name: np.roll(getattr(samples, name), -rows)
        for name in ("latitude_deg", "longitude_deg", "altitude_m")
    }
    return samples.with_columns(**shifted).select(np.arange(len(samples) - rows))


@pytest.mark.parametrize("seconds", [30, 140])
def test_a_clock_that_is_off_is_named_with_its_seconds(seconds: int) -> None:
    fit = fit_inflight(late(orbit(1), seconds // 10), ground=GROUND)
    assert fit.verdict == "refused"
    told = next(finding for finding in fit.findings if finding.name == "reference")
    found = float(told.what.split("positions ")[1].split(" s")[0].replace("−", "-"))
    assert found == pytest.approx(-seconds, abs=3.0)


def test_heights_off_by_20_km_are_no_bias() -> None:
    """The spline of the bias takes them up, with some 100 nT stated for 300 of error."""
    samples = orbit(2, n=4000)
    high = samples.with_columns(altitude_m=samples.altitude_m + 20e3)
    fit = fit_inflight(high, ground=GROUND)
    assert "bias follows the orbit" in {finding.name for finding in fit.findings}


def test_a_bias_that_changes_slowly_is_no_error_of_the_orbit() -> None:
    moved = np.outer(np.linspace(-1, 1, 3000), [300.0, -200.0, 100.0])
    fit = fit_inflight(orbit(3, step_s=20.0, moved=moved), ground=GROUND)
    assert fit.drift.changes
    assert fit.verdict == "good"
