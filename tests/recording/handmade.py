"""Calibrated sensors as the estimator would return them, made by hand from a simulated tumble."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from agonic.calibration.affine import Affine
from agonic.coverage import compute_coverage
from agonic.fit import Fit, ModelTest
from agonic.maths.equation import affine
from agonic.maths.equation.coverage import count_visits
from agonic.provenance import Input, Provenance
from agonic.recording.calibrated import Calibrated
from agonic.samples import Samples
from agonic.verification import Check, Verification

FIELD = 50_000.0
NOISE = 150.0
INCLINATION = 65.0
BIAS = np.array([18_000.0, -21_000.0, 12_000.0])
MATRIX = np.array([[1.08, 0.03, -0.02], [0.03, 0.93, 0.04], [-0.02, 0.04, 1.02]])


def tumble(n: int, seed: int = 1) -> NDArray[np.float64]:
    """Unit directions (n, 3) of the field in a body that is turned about two slow axes."""
    rng = np.random.default_rng(seed)
    phase = np.linspace(0, 1, n)[:, None] * [[13 * 2 * np.pi, 5.3 * 2 * np.pi, 2 * np.pi]]
    turns = Rotation.from_euler("zyx", phase + rng.uniform(0, 6, 3))
    dip = np.radians(INCLINATION)
    return turns.inv().apply([np.cos(dip), 0.0, np.sin(dip)])


def samples_of(directions: NDArray[np.float64], seed: int = 2, **facts: Any) -> Samples:
    """Readings of field that points along `directions`, distorted, with noise, 50 a second."""
    rng = np.random.default_rng(seed)
    raw = FIELD * directions @ np.linalg.inv(MATRIX).T + BIAS
    return Samples(
        field=raw + rng.normal(0, NOISE, raw.shape),
        time=100.0 + 0.02 * np.arange(len(raw)),
        name="MAG0",
        source=Input(name="flight.ulg", sha256="ab" * 32, count=len(raw)),
        **facts,
    )


def fit_of(samples: Samples, **changed: Any) -> Fit:
    """The fit that found the truth, with the covariance that the readings allow."""
    residuals, jacobian = affine.magnitude_residual(samples.field, BIAS, MATRIX, FIELD)
    reduced = jacobian @ affine.model_basis("full")
    covariance = NOISE**2 * np.linalg.inv(reduced.T @ reduced)
    calibration = Affine(
        bias=BIAS,
        matrix=MATRIX,
        covariance=covariance,
        magnitude=FIELD,
        noise=NOISE,
        sensor=samples.name,
        provenance=Provenance(
            settings={"prior_sd": 0.1, "loss": "huber"},
            method=("li-griffiths-2004", "huber-1981"),
            created="2026-01-02T03:04:05+00:00",
        ),
    )
    seen = count_visits(calibration.correct(samples.field))
    facts: dict[str, Any] = {
        "calibration": calibration,
        "n": len(samples),
        "residuals": residuals,
        "weights": np.minimum(1.0, 2 * NOISE / np.maximum(np.abs(residuals), 1e-9)),
        "noise": NOISE,
        "correlation": 1.0,
        "condition": 12.0,
        "iterations": 5,
        "converged": True,
        "coverage": compute_coverage(calibration, seen, INCLINATION),
        "tests": (
            ModelTest(
                smaller="diagonal",
                larger="full",
                statistic=913.2,
                p_value=1e-9,
                sentence="soft iron is present (p < 1e-6)",
            ),
        ),
        "remarks": ("all directions were seen and the residual is as small as the noise",),
    }
    return Fit(**(facts | changed))


def verification_of(samples: Samples, fit: Fit) -> Verification:
    """Checks on every fifth stretch of the readings."""
    before = np.linalg.norm(samples.field, axis=1)
    after = np.linalg.norm(fit.calibration.correct(samples.field), axis=1)
    held_out = np.arange(len(samples)) * 20 // len(samples) % 5 == 2
    spread = float(after[held_out].std() / after[held_out].mean())
    return Verification(
        checks=(
            Check(
                name="spread",
                value=100 * spread,
                limit=2.0,
                unit="%",
                passed=spread < 0.02,
                meaning="the magnitude is as constant as the noise lets it be",
            ),
            Check(
                name="heading",
                value=fit.coverage.heading_sd_deg,
                limit=2.0,
                unit="°",
                passed=fit.coverage.heading_sd_deg < 2.0,
                meaning="standard error of a level heading",
            ),
            Check(
                name="magnitude against the world model",
                value=-120.0,
                limit=None,
                unit="nT",
                passed=None,
                meaning="iron near the site changes it; nothing to do",
            ),
        ),
        spread_before=float(before[held_out].std() / before[held_out].mean()),
        spread_after=spread,
        residual_rms=float(np.std(fit.residuals[held_out])),
        held_out=held_out,
        magnitude_before=before,
        magnitude_after=after,
    )


def calibrated(samples: Samples, **changed: Any) -> Calibrated:
    """The whole result for one sensor; `changed` are facts of the fit."""
    fit = fit_of(samples, **changed)
    return Calibrated(
        samples=samples,
        fit=fit,
        verification=verification_of(samples, fit),
        method="ellipsoid",
        reason="the log holds no attitude",
    )
