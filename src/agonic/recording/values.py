"""What the JSON of a calibrated recording says of one sensor."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

from agonic.arrays import Array
from agonic.calibration.affine import FREE_PARAMETERS, PARAMETERS, Affine
from agonic.calibration.decomposition import decompose, find_raw_ellipsoid
from agonic.fit import Fit
from agonic.readable import make_record
from agonic.recording.calibrated import Calibrated
from agonic.recording.quantities import mixes_sensors, propagate_sd, turn_deg
from agonic.recording.sections import list_trials

_VALUES: Mapping[str, Callable[[Calibrated], Any]] = {
    "sensor": lambda r: r.samples.name,
    "method": lambda r: r.method,
    "reason": lambda r: r.reason,
    "model": lambda r: r.fit.calibration.model,
    "verdict": lambda r: r.verdict,
    "status": lambda r: r.status,
    "n": lambda r: r.fit.n,
    "unit": lambda r: r.fit.calibration.unit_in,
    "bias_nT": lambda r: _if_nT(r, r.fit.calibration.bias),
    "bias_sd_nT": lambda r: _if_nT(r, r.fit.sd[:3]),
    "bias": lambda r: r.fit.calibration.bias,
    "bias_sd": lambda r: r.fit.sd[:3],
    "matrix": lambda r: r.fit.calibration.matrix,
    "matrix_sd": lambda r: r.fit.sd[3 : _count_affine(r.fit.calibration)],
    "scale_factors": lambda r: decompose(r.fit.calibration).scale_factors,
    "scale_factors_sd": lambda r: decompose(r.fit.calibration).scale_factors_sd,
    "nonorthogonality_deg": lambda r: decompose(r.fit.calibration).nonorthogonality_deg,
    "nonorthogonality_sd_deg": lambda r: decompose(r.fit.calibration).nonorthogonality_sd_deg,
    "turn_deg": lambda r: _find_turn(r)[0],
    "turn_sd_deg": lambda r: _find_turn(r)[1],
    "ellipsoid": lambda r: _describe_ellipsoid(r.fit.calibration),
    "gauge": lambda r: r.fit.calibration.gauge,
    "sources": lambda r: getattr(r.fit.calibration, "sources", None),
    "coefficients": lambda r: getattr(r.fit.calibration, "coefficients", None),
    "coefficients_sd": lambda r: (
        r.fit.sd[_count_affine(r.fit.calibration) :].reshape(3, -1)
        if hasattr(r.fit.calibration, "coefficients")
        else None
    ),
    "second_sensor": lambda r: getattr(r.fit.calibration, "second_sensor", None),
    "latency_s": lambda r: r.latency.latency_s if r.latency else None,
    "latency_sd_s": lambda r: r.latency.sd_s if r.latency else None,
    "magnitude": lambda r: r.fit.calibration.magnitude,
    "noise_nT": lambda r: _if_nT(r, r.fit.noise),
    "noise": lambda r: r.fit.noise,
    "correlation": lambda r: r.fit.correlation,
    "spread_before": lambda r: r.verification.spread_before,
    "spread_after": lambda r: r.verification.spread_after,
    "residual_rms_nT": lambda r: (
        r.verification.residual_rms if r.fit.calibration.unit_out == "nT" else None
    ),
    "heading_sd_deg": lambda r: (
        r.fit.coverage.heading_sd_deg if r.fit.coverage.heading_known else None
    ),
    "vehicle_heading_sd_deg": lambda r: _state_vehicle(r.fit),
    "own_heading_sd_deg": lambda r: r.fit.accuracy.heading_deg if r.fit.accuracy else None,
    "shares": lambda r: r.fit.shares,
    "inclination_deg": lambda r: r.fit.coverage.inclination_deg,
    "coverage": lambda r: r.fit.coverage.filled,
    "findings": lambda r: [asdict(finding) for finding in r.fit.findings],
    "ladder": lambda r: [make_record(rung) for rung in r.ladder],
    "disturbers": lambda r: list_trials(r),
    "checks": lambda r: [asdict(check) for check in r.verification.checks],
}
"""What is said of a sensor, by its key.

`bias_nT` and the like are null where the readings are in raw units; `bias`, `bias_sd`, `noise` and
`unit` are always there. `matrix_sd` are the standard errors of xx, yy, zz, xy, xz, yz, in the gauge
free of yx, zx, zy as well. `scale_factors` are raw units per nT, `nonorthogonality_deg` of xy, xz,
yz. `turn_deg` is the turn from the sensor's axes to those of the field about x, y and z, null where
the attitude did not tell it. `ellipsoid` is that of the raw readings: a "sphere", "upright" or
"tilted", with half axes, their directions, and how far they lie off x, y and z.
`coefficients` (3, k) are what a unit of each signal of the `sources`
adds to the readings; null without any. `latency_s` is null where none was found.
`heading_sd_deg` is what the verdict is on, null where the heading is open; `own_heading_sd_deg`
that of the sensor's own axes, which the status states too, null where the fit was refused, and
`vehicle_heading_sd_deg` that of the vehicle, null where nothing shows how the sensor sits in it.
`shares` is what makes the heading's standard error, degrees by name, the largest first.
`disturbers` holds each `Trial` of a set of sources, in order; empty where nothing was tried.
`ladder` holds each `Rung`, from the simplest to the chosen fit; empty where a fit was refused.
"""

FIELDS = (*_VALUES, "files", "warnings")
"""The keys of a sensor, kept stable."""


def list_values(
    result: Calibrated, files: Sequence[str] = (), warnings: Sequence[str] = ()
) -> dict[str, Any]:
    """What `agonic calibrate --json` says of one sensor; all of `FIELDS`."""
    values = {name: find(result) for name, find in _VALUES.items()}
    return values | {"files": list(files), "warnings": list(warnings)}


def _if_nT(result: Calibrated, value: Any) -> Any:
    """A value in the unit of the readings, where that is nanotesla."""
    return value if result.fit.calibration.unit_in == "nT" else None


def _describe_ellipsoid(calibration: Affine) -> dict[str, Any] | None:
    """The ellipsoid of the raw readings, which a mix of sensors has none of."""
    found = None if mixes_sensors(calibration) else find_raw_ellipsoid(calibration)
    return None if found is None else found._asdict()


def _find_turn(result: Calibrated) -> tuple[Array | None, Array | None]:
    """The turn of the sensor, degrees, and its standard errors."""
    calibration = result.fit.calibration
    if calibration.gauge != "free" or mixes_sensors(calibration):
        return None, None
    return turn_deg(calibration), propagate_sd(calibration, turn_deg)


def _count_affine(calibration: Affine) -> int:
    """How many parameters stand before the coefficients of sources."""
    return len(FREE_PARAMETERS if calibration.gauge == "free" else PARAMETERS)


def _state_vehicle(fit: Fit) -> float | None:
    """The standard error of the vehicle's heading, which the magnitude alone does not tell."""
    known = fit.accuracy
    if known is None or not fit.coverage.heading_known:
        return None
    if known.vehicle_deg is not None:
        return known.vehicle_deg
    return None if known.alone else fit.coverage.heading_sd_deg
