"""What more a fit in flight knows: direction where it was aided by attitude, and currents."""

from __future__ import annotations

import numpy as np

from agonic.calibration.alignment import Alignment
from agonic.inflight.fit import InflightFit
from agonic.report.axes import Axis, Columns, along_time
from agonic.report.digits import degrees, quantity, with_sd
from agonic.report.labels import per_label, unit_label
from agonic.report.section import Block, Section, Table
from agonic.report.strips import arrows, caption, line, plot, spread

ARCSEC = 3600.0
_FINE_DEG = 0.05  # standard errors below this are shown in arcseconds


def describe_direction(fit: InflightFit) -> list[Section]:
    """How far corrected field and model are apart in direction, and how the sensor is mounted."""
    if fit.direction_error_deg is None:
        return []
    error, used = fit.direction_error_deg, fit.weights > 0
    middle = float(np.median(error[used]))
    rms = float(np.sqrt(np.mean(error[used] ** 2)))
    apart = ", ".join(
        f"{quantity(channel.noise, 'nT', 2)} in {kind}" for kind, channel in fit.channels.items()
    )
    said = (
        f"The corrected field points {degrees(middle)} (median; rms {degrees(rms)}) from the "
        f"field of the model. Standard deviations: {apart}."
    )
    x, along = along_time(fit.time, float(fit.time[0]), float(fit.time[-1]))
    top = max(1.1 * float(np.percentile(error[used], 99.5)), 1e-9)
    y, columns = Axis("angle, °", 0.0, top), Columns(x, along)
    layers = [
        spread(columns, y, error, "range"),
        line(columns, y, columns.percentiles(error, (50.0,))[0], "mean"),
    ]
    drawn = plot(x, y, layers, "Angle to the model over time", arrows(columns, y, error))
    keys = {"range": "least to largest", "mean": "median"}
    parts: list[Block] = [said, caption("Angle to the field of the model", drawn, keys)]
    if fit.alignment is not None:
        parts.append(_mounting(fit.alignment))
    return [Section("Direction", parts)]


def _mounting(alignment: Alignment) -> Table:
    """The parts of the rotation vector with their standard errors."""
    parts = np.degrees(alignment.rotation.as_rotvec())
    sd = np.zeros(3)
    if alignment.covariance is not None:
        sd = np.degrees(np.sqrt(np.maximum(np.diag(alignment.covariance), 0.0)))
    rows = [
        [f"about {axis}", with_sd(float(turn), float(error)), _error(float(error))]
        for axis, turn, error in zip("xyz", parts, sd, strict=True)
    ]
    frames = f"Turn from the axes {alignment.frame_in} to {alignment.frame_out}"
    return Table([frames, "°", "standard error"], rows)


def _error(sd_deg: float) -> str:
    """A standard error in a unit that fits."""
    if sd_deg == 0.0:
        return ""
    return quantity(sd_deg * ARCSEC, "″", 2) if sd_deg < _FINE_DEG else degrees(sd_deg)


def describe_sources(fit: InflightFit) -> list[Section]:
    """What a unit of each source on board adds to a reading."""
    if not fit.source_names:
        return []
    rows = [
        [name, *(with_sd(float(v), float(s)) for v, s in zip(added, errors, strict=True))]
        for name, added, errors in zip(
            fit.source_names, fit.sources.T, fit.sources_sd.T, strict=True
        )
    ]
    unit = unit_label(fit.change.unit_in)
    units = sorted({per_label(name) for name in fit.source_names})
    note = f"What each adds to a reading, {unit} {' or '.join(units)}."
    return [Section("Currents on board", [note, Table(["Source", "x", "y", "z"], rows)])]
