"""Whether the programme was followed: range, holds, cooling, steps, stations, gaps, in words."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np

from agonic.arrays import Array
from agonic.health import Finding
from agonic.thermal.campaign.description import list_standard_stations, name_stations
from agonic.thermal.campaign.profile import Profile
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.boards import Course, find_courses, judge_boards

END_C = 1.5
"""How far from its set point a chamber may hold, °C; also how far a sensor lags its rise."""
HELD_SHARE = 0.8
"""Share of a planned hold that the chamber must have kept."""
_RATE_MIN = 5
"""Minutes over which a rate is measured: a chamber's control swings faster."""
_CUT_SHARE = 0.97


def check_campaign(campaign: Campaign) -> tuple[Campaign, tuple[Finding, ...]]:
    """The campaign without what cannot be used, and everything that was not as planned, in words.

    Left out are recordings whose thermometer stood still or that have no temperature; findings of
    the reader come first. The limits are those of the described profile, or of the standard one.

    >>> from agonic.samples import Samples
    >>> n = 241
    >>> minutes = np.arange(n) * 60.0
    >>> warm = Samples(field=np.ones((n, 3)), time=minutes, temperature=Profile().at(minutes) / 2)
    >>> campaign = Campaign(recordings={"mag": {1: warm}})
    >>> [f.sentence for f in check_campaign(campaign)[1] if f.name == "range"]
    ['station 1 reached only -5.0 of -10 °C, and station 1 reached only 25.0 of +50 °C; a \
calibration holds only where it was measured: record again, or use a smaller range']
    """
    profile = campaign.description.profile or Profile()
    made, still = find_courses(campaign)
    findings = [
        *campaign.findings,
        *find_missing_stations(campaign),
        *find_missing_columns(campaign),
        *judge_stuck(still, campaign),
    ]
    cut = _find_cut(made)
    findings += _judge_cut(cut, made)
    whole = {number: course for number, course in made.items() if number not in cut}
    programme = campaign.description.profile is not None
    findings += _judge_range(whole, profile)
    findings += _judge_holds(whole, profile)
    findings += _judge_cooling(whole, profile)
    findings += _judge_steps(whole, profile) if programme else []
    findings += judge_boards(campaign)
    usable = campaign.without({name: set(by) for name, by in still.items()})
    usable = usable.without(find_without_temperature(usable))
    return usable, tuple(findings)


def _find_cut(made: Mapping[int, Course]) -> set[int]:
    """Stations recorded for a shorter time than the others that do not end as warm as they do.

    One that ends as the others do has gone through its course, only faster: its cooling and its
    holds are judged as those of any other.
    """
    lengths = {number: course.length_s for number, course in made.items()}
    if len(lengths) < 2:
        return set()
    usual = float(np.median(list(lengths.values())))
    ends = {number: _find_last_level(course) for number, course in made.items()}
    end = float(np.nanmedian(list(ends.values())))
    return {
        number
        for number, length in lengths.items()
        if length < _CUT_SHARE * usual and not abs(ends[number] - end) <= END_C
    }


def _find_last_level(course: Course) -> float:
    known = course.level_C[np.isfinite(course.level_C)]
    return float(known[-1]) if len(known) else float("nan")


def _judge_cut(cut: set[int], made: Mapping[int, Course]) -> list[Finding]:
    usual = max((course.length_s for course in made.values()), default=0.0)
    return [
        Finding(
            "ends early",
            "check",
            f"station {number} ends after {_format_hours(made[number].length_s)} of "
            f"{_format_hours(usual)}, at {made[number].level_C[-1]:.1f} °C: the recording was cut",
            "what is there is used; record the station again for the whole range",
        )
        for number in sorted(cut)
    ]


def _format_hours(seconds: float) -> str:
    minutes = round(seconds / 60)
    return f"{minutes // 60} h {minutes % 60:02d} min"


def _measure_stations(
    made: Mapping[int, Course],
    measure: Callable[[Course], float],
    fails: Callable[[float], bool],
) -> dict[int, float]:
    """What fails at each station where something does."""
    values = {number: measure(course) for number, course in made.items()}
    return {number: value for number, value in values.items() if fails(value)}


def _judge_range(made: Mapping[int, Course], profile: Profile) -> list[Finding]:
    """The ends that were not reached; of several stations the shortest range is told."""
    ends = {n: (float(np.nanmin(c.level_C)), float(np.nanmax(c.level_C))) for n, c in made.items()}
    warm = {n: low for n, (low, _) in ends.items() if low > profile.lowest_C + END_C}
    cool = {n: high for n, (_, high) in ends.items() if high < profile.highest_C - END_C}
    parts = [
        f"{name_stations(numbers)} reached only {worst(numbers.values()):.1f} of {wanted:+g} °C"
        for numbers, worst, wanted in (
            (warm, max, profile.lowest_C),
            (cool, min, profile.highest_C),
        )
        if numbers
    ]
    if not parts:
        return []
    move = "a calibration holds only where it was measured: record again, or use a smaller range"
    return [Finding("range", "check", ", and ".join(parts), move)]


def _judge_holds(made: Mapping[int, Course], profile: Profile) -> list[Finding]:
    """The hold in the cold, and the one at the end."""
    need = HELD_SHARE * profile.hold_min
    findings = []
    for measure, where in ((_measure_cold_hold, "in the cold"), (_measure_last_hold, "at the end")):
        found = _measure_stations(made, measure, lambda minutes: minutes < need)
        if found:
            findings.append(
                Finding(
                    "holds",
                    "check",
                    f"the temperature was held {where} for {min(found.values()):.0f} min at "
                    f"{name_stations(found)} instead of {profile.hold_min:g} min",
                    "hold longer: inside the box the temperature is delayed",
                )
            )
    return findings


def _measure_cold_hold(course: Course) -> float:
    """Minutes at the lowest temperature."""
    low = course.level_C <= np.nanmin(course.level_C) + END_C / 2
    away = np.abs(course.level_C - np.median(course.level_C[low]))
    return _measure_reach(away[course.turn :: -1]) + _measure_reach(away[course.turn :])


def _measure_last_hold(course: Course) -> float:
    """Minutes at the last temperature, from the middle of the last minute and half of it."""
    known = course.level_C[np.isfinite(course.level_C)]
    return _measure_reach(np.abs(known - known[-1])[::-1]) + 0.5


def _measure_reach(away: Array) -> float:
    """Minutes from the first of these differences from a level to where a ramp leaves it.

    The line of the ramp, through where it passes two distances, is followed back to the level: its
    minutes are none of a hold, however the box lags.
    """
    near, far = (_find_first_beyond(away, limit) for limit in (END_C, 2 * END_C))
    if near is None:
        return float(len(away))
    return near if far is None else max(2 * near - far, 0.0)


def _find_first_beyond(away: Array, limit: float) -> float | None:
    """Where differences first pass a limit, between two minutes; None where they never do."""
    known = np.flatnonzero(np.isfinite(away))
    beyond = np.flatnonzero(away[known] > limit)
    if not len(beyond) or beyond[0] == 0:
        return None
    before, after = known[beyond[0] - 1], known[beyond[0]]
    share = (limit - away[before]) / (away[after] - away[before])
    return float(before + share * (after - before))


def _judge_cooling(made: Mapping[int, Course], profile: Profile) -> list[Finding]:
    limit = profile.cooling_limit_C_per_min
    found = _measure_stations(made, _find_fastest_fall, lambda rate: rate > 1.1 * limit)
    if not found:
        return []
    return [
        Finding(
            "cooling",
            "check",
            f"{name_stations(found)} cooled at up to {max(found.values()):.1f} °C/min, faster than "
            f"{limit:g}",
            "cool more slowly: the sensor is no longer as warm as its thermometer, and damp air "
            "condenses",
        )
    ]


def _find_fastest_fall(course: Course) -> float:
    """The fastest fall over five minutes, °C/min."""
    level = course.level_C
    if len(level) <= _RATE_MIN:
        return 0.0
    rates = (level[:-_RATE_MIN] - level[_RATE_MIN:]) / _RATE_MIN
    return float(np.nanmax(rates)) if np.isfinite(rates).any() else 0.0


def _judge_steps(made: Mapping[int, Course], profile: Profile) -> list[Finding]:
    """Whether the heating stopped at its steps."""
    wanted = profile.steps - 1 if profile.step_hold_min else 0
    found = _measure_stations(
        made, lambda course: _count_plateaus(course, profile), lambda count: count < wanted / 2
    )
    if wanted < 1 or not found:
        return []
    return [
        Finding(
            "steps",
            "note",
            f"the heating stopped {min(found.values()):.0f} times at {name_stations(found)} "
            f"instead of {wanted}",
            "",
        )
    ]


def _count_plateaus(course: Course, profile: Profile) -> int:
    """Levels between the ends near which the heating rests for half of a step's hold."""
    heating = course.level_C[course.turn :]
    if len(heating) < 3:
        return 0
    rate = np.abs(np.gradient(heating))
    inside = (heating > profile.lowest_C + 2 * END_C) & (heating < profile.highest_C - 2 * END_C)
    slow = inside & (rate < 0.5 * profile.heating_C_per_min)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], slow.astype(int), [0]])))
    spans = edges[1::2] - edges[::2]
    return int(np.sum(spans >= max(1.0, 0.4 * profile.step_hold_min)))


def find_missing_stations(campaign: Campaign) -> list[Finding]:
    """Stations of the description that were not recorded."""
    standard = tuple(station.number for station in list_standard_stations())
    expected = campaign.description.numbers or standard
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
            f"{name} has no times at {name_stations(at)}: its programme cannot be checked there, "
            "nor cooling be distinguished from heating",
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
                f"the thermometer of {name} stands still for {last - first} min at {where} while "
                "the chamber's temperature moves: left out there",
                "take another sensor's with temperature_of in campaign.toml if one is near",
            )
        )
    return found
