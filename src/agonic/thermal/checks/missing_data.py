"""What a campaign lacks: stations, temperatures, clocks, thermometers that work."""

from __future__ import annotations

from collections.abc import Mapping

from agonic.health import Finding
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.names import name_stations

_STANDARD = 12


def find_missing_stations(campaign: Campaign) -> list[Finding]:
    """Stations of the description that were not recorded."""
    expected = campaign.description.numbers or tuple(range(1, _STANDARD + 1))
    left_out = sorted(set(expected) - set(campaign.stations))
    if not left_out:
        return []
    left = len(campaign.stations)
    verb = "are" if len(left_out) > 1 else "is"
    what = f"{name_stations(left_out)} of {len(expected)} {verb} missing"
    if left < 9:
        return [
            Finding(
                "missing stations",
                "refuse",
                f"{what}: {left} left do not determine nine numbers",
                "record them",
            )
        ]
    move = (
        "record them, or give the turns of the fixture: the magnitude alone is then hardly checked"
        if left < 11
        else "record it for the full accuracy"
    )
    return [Finding("missing stations", "check", what, move)]


def find_without_temperature(campaign: Campaign) -> dict[str, set[int]]:
    """The stations at which each sensor has no temperature."""
    return {
        name: {number for number, samples in by.items() if samples.temperature is None}
        for name, by in campaign.recordings.items()
    }


def find_missing_columns(campaign: Campaign) -> list[Finding]:
    """Sensors without a temperature, or without a clock."""
    cold = {name: at for name, at in find_without_temperature(campaign).items() if at}
    timeless = {
        name: {number for number, samples in by.items() if samples.time is None}
        for name, by in campaign.recordings.items()
    }
    found = [
        Finding(
            "no temperature",
            "check",
            f"{name} has no temperature at {name_stations(at)}: left out there",
            "add a column temperature_C, or temperature_of = another sensor in campaign.toml",
        )
        for name, at in cold.items()
    ]
    found += [
        Finding(
            "no clock",
            "check",
            f"{name} has no times at {name_stations(at)}: its programme cannot be "
            "checked there, nor cooling be told from heating",
            "record a column time_s",
        )
        for name, at in timeless.items()
        if at
    ]
    return found


def judge_stuck(
    still: Mapping[str, Mapping[int, tuple[int, int]]], campaign: Campaign
) -> list[Finding]:
    found = []
    for name, by in still.items():
        rest = set(campaign.recordings[name]) - set(by)
        where = name_stations(by) if rest else "all stations"
        first, last = max(by.values(), key=lambda span: span[1] - span[0])
        found.append(
            Finding(
                "stuck temperature",
                "check" if rest else "refuse",
                f"the thermometer of {name} stands still for {last - first} min at {where} "
                f"while the "
                "chamber's temperature moves: left out there",
                "take another sensor's with temperature_of in campaign.toml if one is near",
            )
        )
    return found
