"""`calibrate_campaign`: every sensor of a campaign in a climatic chamber, and what it is worth."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import AbstractContextManager, nullcontext
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import Any, Literal, NamedTuple, get_args

from scipy.spatial.transform import Rotation

from agonic.errors import AgonicError, check_choice
from agonic.health import Finding
from agonic.reference import Reference
from agonic.thermal.campaign.description import name_stations
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.programme import check_campaign
from agonic.thermal.common_mode import FittedSensor, combine_positions, find_chamber_field
from agonic.thermal.fit.fit import fit_binned
from agonic.thermal.fit.problem import Settings
from agonic.thermal.fit.readings import Facts, collect_facts, sum_readings
from agonic.thermal.maths.binned_sums import Binned
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor
from agonic.thermal.result import cross_validate as tested

OrientationChoice = Literal["auto", "known", "found", "unknown"]
Rotations = Mapping[int, Rotation] | Literal["unknown", "found"]
CONTRADICTED = ("swapped stations", "turns", "fixture")
"""Findings of a fit that the readings kept from the described orientations."""
NOT_STANDARD = Finding(
    "turns",
    "note",
    "nobody described how the stations stood, and they are not the standard ones: their turns were "
    "found from the readings",
)


class _Task(NamedTuple):
    """What is to be done with every sensor; `assumed` where nobody described the stations."""

    reference: Reference | None
    stations: Rotations
    assumed: bool
    settings: Mapping[str, Any]
    held_out: bool


class _SummedReadings(NamedTuple):
    """What the fit of a sensor needs of its readings, or why there is none."""

    name: str
    cells: tuple[Binned, Facts, tuple[Finding, ...]] | None = None
    refused: str = ""


def calibrate_campaign(
    campaign: Campaign,
    *,
    turns: OrientationChoice = "auto",
    magnitude: float | None = None,
    only: Iterable[str] = (),
    held_out: bool = True,
    workers: int = 1,
    progress: Any = None,
    **settings: Any,
) -> CalibratedCampaign:
    """Check a campaign, and fit every sensor of it.

    Parameters
    ----------
    campaign : as `read_campaign` gives it.
    turns : "known" uses the described orientations of the stations, "found" those that the readings
        show, "unknown" the magnitude alone; "auto" the described ones where the readings do not
        contradict them, and where nobody described any those that are found.
    magnitude : of the chamber's field, nT; default: that of the description.
    only : names of sensors; default: all. settings : further ones of `fit_thermal`.
    held_out : also fit every sensor without some of the stations, and try the result on those.
    workers : processes that fit sensors at the same time; a script that asks for more than one
        does so under `if __name__ == "__main__"`.
    progress : takes the names of the sensors and gives them back one by one.

    Returns a `CalibratedCampaign`; a sensor that cannot be fitted says why. Raises `AgonicError`
    for settings that do not exist, and for turns that are asked for and not described.

    Source: Nikolaev et al. 2023, sections 3 to 5; Grubbs 1948 for what the sensors saw alike.

    >>> from agonic.thermal.simulation.campaign import simulate_campaign
    >>> made = simulate_campaign("MMC5883MA", rate_Hz=0.02, seed=2)
    >>> result = calibrate_campaign(made.campaign)
    >>> [(sensor.name, sensor.verdict) for sensor in result.sensors]
    [('MMC5883MA', 'good')]
    """
    check_choice("turns", turns, get_args(OrientationChoice))
    settings = {"fixture_sd_deg": campaign.description.fixture_sd_deg, **settings}
    Settings(**settings)  # a setting that cannot be is no reason to refuse every sensor
    usable, findings = check_campaign(campaign)
    stations, reason = _choose_orientations(turns, usable)
    given = magnitude or campaign.description.magnitude
    reference = None if given is None else Reference.constant(given, source="the chamber")
    names = _choose_sensors(campaign, only)
    task = _Task(reference, stations, usable.description.assumed, settings, held_out)
    with _open_pool(min(workers, len(names))) as pool:
        each = map if pool is None else pool.map
        fits = each(partial(_fit_sensor, task), (_sum_sensor(task, usable, name) for name in names))
        made = [one for _, one in zip(progress(names) if progress else names, fits, strict=True)]
    seen = {sensor.name: one for sensor, one in made if one is not None}
    sensors, against = [sensor for sensor, _ in made], list[Finding]()
    kinds = {sensor.fit.reference_kind for sensor in sensors if sensor.fit}
    used = "found" if "positions" in kinds else "known" if "turns" in kinds else "unknown"
    if not isinstance(stations, str) and kinds - {"turns"}:
        sensors, against = _find_contradictions(sensors)
        whose = "standard" if task.assumed else "described"
        reason = f"the readings contradict the {whose} turns of the stations"
        used = "found" if task.assumed else "unknown"
    positions, moved = combine_positions([one.fit for one in seen.values()])
    return CalibratedCampaign(
        campaign=usable,
        findings=(*findings, *([NOT_STANDARD] if task.assumed and against else against), *moved),
        turns=used,
        reason=reason,
        sensors=tuple(sensors),
        chamber_field=find_chamber_field(seen, None if isinstance(stations, str) else stations),
        positions=positions,
    )


def _choose_sensors(campaign: Campaign, only: Iterable[str]) -> list[str]:
    """The sensors that were asked for."""
    wanted = list(only) or list(campaign.sensors)
    absent = [name for name in wanted if name not in campaign.sensors]
    if absent:
        raise AgonicError(f"no sensor {', '.join(absent)}; there are {', '.join(campaign.sensors)}")
    return wanted


def _choose_orientations(turns: str, campaign: Campaign) -> tuple[Rotations, str]:
    """How the stations are turned, for `fit_thermal`, and why."""
    rotations = campaign.description.rotations
    if turns == "unknown":
        return "unknown", "the magnitude alone was asked for"
    if turns == "known" and rotations is None:
        raise AgonicError(
            f"{_name_undescribed(campaign)} not described: give roll_deg, pitch_deg and "
            "heading_deg of every [[station]] in campaign.toml"
        )
    if turns == "found":
        return "found", "turns that the readings show were asked for"
    if rotations is None:
        return "found", f"{_name_undescribed(campaign)} not described"
    return rotations, "the turns of the stations are described"


def _find_contradictions(
    sensors: Sequence[CalibratedSensor],
) -> tuple[list[CalibratedSensor], list[Finding]]:
    """What sensors say against the description, each thing once, and the sensors without it."""
    against: dict[str, Finding] = {}
    left = []
    for sensor in sensors:
        for finding in sensor.fit.findings if sensor.fit else ():
            if finding.name in CONTRADICTED:
                against.setdefault(finding.name, finding)
        left.append(sensor.without(CONTRADICTED))
    return left, list(against.values())


def _name_undescribed(campaign: Campaign) -> str:
    """Whose turns are unknown: all, or some of the stations."""
    stations = campaign.description.stations
    unknown = [station.number for station in stations if station.rot_nb is None]
    if len(unknown) in (0, len(stations)):
        return "the turns of the stations are"
    return f"how {name_stations(unknown)} stood is"


def _open_pool(workers: int) -> AbstractContextManager[ProcessPoolExecutor | None]:
    """Processes that fit, or None where this one does."""
    if workers < 2:
        return nullcontext()
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def _sum_sensor(task: _Task, campaign: Campaign, name: str) -> _SummedReadings:
    """The readings of a sensor in cells of temperature: little to hand to another process."""
    if name not in campaign.sensors:
        return _SummedReadings(
            name, refused="None of its recordings can be used (see the findings)."
        )
    samples = campaign.samples(name)
    try:
        sums, found = sum_readings(samples, Settings(**task.settings).bin_width_C)
    except AgonicError as error:
        return _SummedReadings(name, refused=f"{error}.")
    facts = collect_facts(samples)._replace(files=campaign.files(name))
    return _SummedReadings(name, (sums, facts, found))


def _fit_sensor(
    task: _Task, summed: _SummedReadings
) -> tuple[CalibratedSensor, FittedSensor | None]:
    """The fit of a sensor with its cells, or why there is none."""
    if summed.cells is None:
        return CalibratedSensor(name=summed.name, refused=summed.refused), None
    sums, facts, found = summed.cells
    turns, settings = task.stations, task.settings
    try:
        fit = fit_binned(sums, facts, task.reference, found=found, stations=turns, **settings)
        if task.assumed and fit.reference_kind == "magnitude":
            turns = "found"
            again = fit_binned(sums, facts, task.reference, found=found, stations=turns, **settings)
            against = tuple(each for each in fit.findings if each.name in CONTRADICTED)
            fit = replace(again, findings=(*again.findings, *against))
    except AgonicError as error:
        return CalibratedSensor(name=summed.name, refused=f"{error}."), None
    if fit.verdict == "refused":
        return CalibratedSensor(name=summed.name, fit=fit), None
    unseen = None
    if task.held_out:
        turns = "unknown" if fit.reference_kind == "magnitude" else turns
        unseen = tested(sums, facts, task.reference, fit, turns, settings)
    return CalibratedSensor(name=summed.name, fit=fit, held_out=unseen), FittedSensor(
        fit, sums.cells()
    )
