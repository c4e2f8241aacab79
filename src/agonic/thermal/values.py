"""The numbers of a calibrated campaign for programs: what its JSON says."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from agonic.calibration.decomposition import decompose_at, expand_in_temperature
from agonic.calibration.thermal import Thermal
from agonic.readable import make_record
from agonic.thermal import tables
from agonic.thermal.checks.boards import list_boards
from agonic.thermal.fit.result import Positions, ThermalFit
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor


def list_campaign_values(result: CalibratedCampaign) -> dict[str, Any]:
    """What holds for all sensors."""
    chamber = result.chamber_field
    return {
        "turns": result.turns,
        "reason": result.reason,
        "stations": result.campaign.stations,
        "rows": result.campaign.rows,
        "positions": result.positions and _list_positions(result.positions),
        "boards": [board._asdict() for board in list_boards(result.campaign)],
        "chamber_field": chamber
        and {
            "sd_nT": chamber.common_sd,
            "axes": chamber.axes,
            "sensors": {
                share.name: {"noise_nT": share.noise_sd, "own_nT": share.own_sd}
                for share in chamber.shares
            },
        },
    }


def _list_positions(positions: Positions) -> dict[str, Any]:
    return {
        str(number): {
            "turn_deg": turn,
            "sd_deg": positions.turn_sd_deg[number],
            "field_direction": positions.direction[number],
        }
        for number, turn in positions.turn_deg.items()
    }


def list_sensor_values(sensor: CalibratedSensor, files: Sequence[str]) -> dict[str, Any]:
    """One sensor; a refused one has no numbers."""
    said = {"sensor": sensor.name, "files": files}
    if sensor.fit is None:
        return said
    unseen = sensor.held_out
    tested = unseen and {
        "stations": unseen.spread.stations,
        "improvement": unseen.spread.improvement,
        "magnitude_rms_nT": unseen.magnitude_rms,
        "seen_rms_nT": unseen.seen_rms,
    }
    return {**said, **_list_fit_values(sensor.fit), "held_out": tested}


def _list_powers(calibration: Thermal) -> list[dict[str, Any]]:
    """k0, k1, … of each number, and their standard errors."""
    values, sd = expand_in_temperature(calibration)
    return [{"k": row, "sd": sd if sd is None else sd[at]} for at, row in enumerate(values)]


def _list_fit_values(fit: ThermalFit) -> dict[str, Any]:
    calibration, hysteresis = fit.calibration, fit.hysteresis
    levels = np.linspace(*calibration.range_C, 7)
    sd = calibration.sd_at(levels)
    return {
        "method": "thermal",
        **make_record(fit),
        "degree": calibration.degree,
        "range_C": list(calibration.range_C),
        "at": {
            "temperature_C": levels,
            "bias_nT": calibration.bias_at(levels),
            "bias_sd_nT": sd[:, :3],
            "matrix": calibration.matrix_at(levels),
            "matrix_sd": sd[:, 3:],
            **decompose_at(calibration, levels)._asdict(),
        },
        "powers_of_temperature_C": dict(
            zip(tables.name_nine(calibration), _list_powers(calibration), strict=True)
        ),
        "rate_nT_per_C_s": calibration.rate,
        "improvement": fit.spread and fit.spread.improvement,
        "hysteresis": hysteresis and {"difference": hysteresis.difference, "sd": hysteresis.sd},
        "fixture_deg": fit.fixture and fit.fixture.turned_deg,
        "anomalies": {str(a.station): a.count for a in fit.anomalies},
        "equation": calibration.equation,
    }
