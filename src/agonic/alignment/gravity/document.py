"""What is said of the rotation between magnetometer and accelerometer."""

from __future__ import annotations

from typing import Any

from agonic.alignment.gravity.fit import GravityFit
from agonic.report.digits import group_digits, quantity, significant
from agonic.report.document import Document


def describe_gravity(fit: GravityFit, sensor: str) -> Document:
    """The rotation from the magnetometer of a name to the accelerometer; a refused one has none.

    >>> from agonic.alignment.gravity import fit_gravity
    >>> from agonic.alignment.simulation.gravity import simulate_gravity
    >>> made = describe_gravity(fit_gravity(simulate_gravity().samples), "mag")
    >>> print(made.to_text().splitlines()[0])
    ✓ mag: good (against the accelerometer, 24 orientations at rest)
    """
    refused = fit.verdict == "refused"
    return Document(
        schema="agonic/fit-gravity@1",
        kind="Alignment with an accelerometer",
        name=sensor,
        method=f"against the accelerometer, {fit.n} orientations at rest",
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        entries=_entries(fit),
        values={"sensor": sensor, "n": fit.n, **({} if refused else _numbers(fit))},
        calibration=None if refused else fit.calibration,
    )


def _entries(fit: GravityFit) -> dict[str, str]:
    sd = "   ".join(
        f"{a} {significant(float(s), 2)}°" for a, s in zip("xyz", fit.sd_deg, strict=True)
    )
    return {
        "Turn": quantity(fit.angle_deg, "°", 4),
        "Error": f"about the accelerometer's {sd}",
        "Matrix": "; ".join(" ".join(group_digits(float(v), 6) for v in row) for row in fit.rot_bm),
        "Dip": f"{group_digits(fit.inclination_deg, 2)}°",
    }


def _numbers(fit: GravityFit) -> dict[str, Any]:
    return {
        "matrix_bm": fit.rot_bm,
        "turn_deg": fit.angle_deg,
        "sd_deg": fit.sd_deg,
        "worst_sd_deg": fit.worst_sd_deg,
        "inclination_deg": fit.inclination_deg,
        "bias": fit.estimate.bias,
        "residuals": fit.estimate.residuals,
    }
