"""Sensors with a good, a compared and a refused calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from agonic.health import Finding
from agonic.recording.calibrated import Calibrated
from agonic.samples import Logged
from tests.recording.handmade import BIAS, calibrated, samples_of, tumble


@pytest.fixture(scope="session")
def good() -> Calibrated:
    """A full tumble: nothing to object."""
    return calibrated(samples_of(tumble(6000)))


@pytest.fixture(scope="session")
def logged() -> Calibrated:
    """The same, in a log that holds an earlier correction, with some outliers."""
    earlier = Logged(
        bias=BIAS + np.array([250.0, -90.0, 40.0]), matrix=np.eye(3), source="COMPASS_OFS2"
    )
    samples = samples_of(tumble(6000, 3), logged=earlier)
    field = samples.field.copy()
    field[::211] += [9_000.0, 4_000.0, -6_000.0]
    finding = Finding("outliers", "note", "0.5 % of the readings are strays")
    return calibrated(
        replace(samples, field=field, name="MAG1", notes=("the clock jumped once",)),
        findings=(finding,),
    )


@pytest.fixture(scope="session")
def refused() -> Calibrated:
    """A cap of directions: the bias along z is not determined."""
    directions = tumble(20_000, 5)
    samples = samples_of(directions[directions[:, 2] > 0.75]).with_columns(name="MAG2")
    result = calibrated(samples)
    fit = replace(
        result.fit,
        calibration=replace(result.fit.calibration, covariance=1e6 * result.fit.covariance),
        findings=(
            Finding(
                "coverage",
                "refuse",
                "only one side of the sphere was seen",
                "turn it upside down and once about every axis",
            ),
        ),
        coverage=replace(
            result.fit.coverage,
            heading_sd_deg=np.inf,
            field_sd_max=np.inf,
            turns="nose down, then roll right 90°",
        ),
    )
    return replace(result, fit=fit)
