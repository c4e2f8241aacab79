"""`Row`: one calibration of a population, flat: what a table of many holds of each."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime

from agonic.health import Verdict


@dataclass(frozen=True, kw_only=True, slots=True)
class Row:
    """The calibration of one sensor from one log, or the reason why there is none.

    Figures of a row that could not be fitted are None. The fields are the columns of the table, in
    its order.

    Parameters
    ----------
    sensor : who it is in the population; the same for all logs of one sensor.
    channel : its name inside the log.
    device_id : the number by which an autopilot knows it, if it does.
    source : the log, as named by the user; `sha256` of its content.
    key : what the result depends on (content, settings, version), as one digest.
    start : when the readings begin (UTC), where the log knows; `duration_s` how long they last.
    temperature_C : mean, where it was recorded.
    rows : how many readings took part.
    method, model, gauge : as for `Calibrated` and `Affine`; "adjusted" is a fit from moments alone.
    verdict, status : the word and the sentence; `findings` the names of what was found.
    unusual : what is unlike the other sensors, in sentences; empty where nothing is, and until the
        row is in a table.
    unit_in, unit_out : of readings and field.
    bias_x … : in `unit_in`; matrix_xx … in `unit_out` per `unit_in`; standard errors with _sd.
    magnitude : of the field, in `unit_out`; `noise` of one reading on one axis, in `unit_in`.
    spread_before, spread_after : relative spread of the magnitude.
    residual_rms : in `unit_out`, on rows that the fit had not seen where there are any.
    heading_sd_deg : of a level heading.
    calibration, report : files of this row, from the folder of the table; None where not written.
    settings : what was asked for, as JSON; `version` of the software.
    """

    sensor: str
    channel: str = "mag"
    device_id: int | None = None
    source: str
    sha256: str = ""
    key: str = ""
    start: datetime | None = None
    duration_s: float | None = None
    temperature_C: float | None = None
    rows: int = 0
    method: str = ""
    model: str = ""
    gauge: str = ""
    verdict: Verdict
    status: str
    findings: tuple[str, ...] = ()
    unusual: str = ""
    unit_in: str = ""
    unit_out: str = ""
    bias_x: float | None = None
    bias_y: float | None = None
    bias_z: float | None = None
    bias_x_sd: float | None = None
    bias_y_sd: float | None = None
    bias_z_sd: float | None = None
    matrix_xx: float | None = None
    matrix_xy: float | None = None
    matrix_xz: float | None = None
    matrix_yx: float | None = None
    matrix_yy: float | None = None
    matrix_yz: float | None = None
    matrix_zx: float | None = None
    matrix_zy: float | None = None
    matrix_zz: float | None = None
    matrix_xx_sd: float | None = None
    matrix_xy_sd: float | None = None
    matrix_xz_sd: float | None = None
    matrix_yx_sd: float | None = None
    matrix_yy_sd: float | None = None
    matrix_yz_sd: float | None = None
    matrix_zx_sd: float | None = None
    matrix_zy_sd: float | None = None
    matrix_zz_sd: float | None = None
    magnitude: float | None = None
    noise: float | None = None
    spread_before: float | None = None
    spread_after: float | None = None
    residual_rms: float | None = None
    heading_sd_deg: float | None = None
    calibration: str | None = None
    report: str | None = None
    settings: str = ""
    version: str = ""
