"""A calibrated campaign as plain text: what was not as planned, and every sensor in a few lines."""

from __future__ import annotations

import textwrap

import numpy as np

from agonic.calibration.thermal import Thermal
from agonic.report.digits import grouped, with_sd
from agonic.report.text import SIGNS, WIDTH
from agonic.report.verdict import MEANINGS, sentence
from agonic.thermal.campaign.description import join_numbers
from agonic.thermal.checks.programme import list_findings
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor

_MOST_LINES = 4


def summary(result: CalibratedCampaign) -> str:
    """What was found, and the verdict and the numbers of every sensor."""
    campaign = result.campaign
    head = (
        f"{len(result.sensors)} sensors, stations {join_numbers(campaign.stations)}, "
        f"{grouped(campaign.rows)} readings; turns {result.turns}: {result.reason}"
    )
    found = [
        part
        for line in list_findings(result.findings).splitlines()
        for part in textwrap.wrap(line, WIDTH, subsequent_indent="  ")
    ]
    return "\n".join([*textwrap.wrap(head, WIDTH), *found, "", *map(_sensor, result.sensors)])


def _sensor(sensor: CalibratedSensor) -> str:
    word = MEANINGS[sensor.verdict][0].lower()
    lines = [f"{SIGNS[sensor.verdict]} {sensor.name}: {word}"]
    lines += textwrap.wrap(
        sentence(sensor.status),
        WIDTH,
        initial_indent="  ",
        subsequent_indent="  ",
        max_lines=_MOST_LINES,
        placeholder=" …",
    )
    if sensor.fit is not None:
        lines += _numbers(sensor.fit.calibration)
        lines += _improvement(sensor.fit)
    return "\n".join(lines)


def _numbers(calibration: Thermal) -> list[str]:
    """The bias at both ends and in the middle of the range."""
    if calibration.validity.temperature_C is None:
        return []
    low, high = calibration.validity.temperature_C
    rows = []
    for level in np.linspace(low, high, 3):
        bias, sd = calibration.bias_at(level), calibration.sd_at(level)
        values = "   ".join(
            f"{axis} {with_sd(float(b), float(s))}"
            for axis, b, s in zip("xyz", bias, sd[:3], strict=True)
        )
        rows.append(f"  Bias at {level:5.1f} °C   {values} {calibration.unit_in}")
    return rows


def _improvement(fit: ThermalFit) -> list[str]:
    """The largest standard deviation of the stations before over that after."""
    if fit.spread is None:
        return []
    shown = zip(("x", "y", "z", "|B|"), fit.spread.improvement, strict=True)
    ratios = "   ".join(f"{name} {ratio:.2f}" for name, ratio in shown)
    return [f"  Spread over temperature, before / after   {ratios}"]
