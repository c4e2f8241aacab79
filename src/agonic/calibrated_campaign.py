"""`calibrate_campaign`: every sensor of a campaign in a climatic chamber, and what it is worth."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from scipy.spatial.transform import Rotation

from agonic.campaign import Campaign, check_campaign
from agonic.errors import AgonicError, check_choice
from agonic.fitting.thermal import ThermalFit, fit_thermal
from agonic.fitting.thermal.settings import Settings
from agonic.health import Finding
from agonic.reference import Reference
from agonic.samples import Samples

Turns = Literal["auto", "known", "unknown"]
CONTRADICTED = ("swapped stations", "turns")
"""Findings after which the described turns are not believed."""


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedSensor:
    """One sensor: its fit, or in `refused` why there is none."""

    name: str
    fit: ThermalFit | None = None
    refused: str = ""

    @property
    def verdict(self) -> str:
        """`good`, `check` or `refused`."""
        return "refused" if self.fit is None else self.fit.verdict

    @property
    def status(self) -> str:
        """The result in words."""
        return self.refused if self.fit is None else self.fit.status


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedCampaign:
    """All sensors of a campaign.

    `campaign` is what could be used of it, `findings` what was not as planned; `turns` "known"
    where the turns between the stations taught the fits, `reason` why.
    """

    campaign: Campaign
    findings: tuple[Finding, ...]
    turns: str
    reason: str
    sensors: tuple[CalibratedSensor, ...] = field(default_factory=tuple)

    @property
    def verdict(self) -> str:
        """The worst of the sensors and of the findings on the campaign."""
        verdicts = {sensor.verdict for sensor in self.sensors}
        severities = {finding.severity for finding in self.findings}
        if "refused" in verdicts or not self.sensors:
            return "refused"
        return "check" if "check" in verdicts or severities & {"check", "refuse"} else "good"


def calibrate_campaign(
    campaign: Campaign,
    *,
    turns: Turns = "auto",
    magnitude: float | None = None,
    only: Iterable[str] = (),
    progress: Any = None,
    **settings: Any,
) -> CalibratedCampaign:
    """Check a campaign, and fit every sensor of it.

    Parameters
    ----------
    campaign : as `read_campaign` gives it.
    turns : "known" lets the described turns of the stations teach the fits, "unknown" the magnitude
        alone; "auto" the turns where they are described and the readings do not contradict them.
    magnitude : of the chamber's field, nT; default: that of the description.
    only : names of sensors; default: all. settings : further ones of `fit_thermal`.
    progress : takes the names of the sensors and gives them back one by one.

    Returns a `CalibratedCampaign`; a sensor that cannot be fitted says why. Raises `AgonicError`
    for settings that do not exist, and for turns that are asked for and not described.
    """
    check_choice("turns", turns, ("auto", "known", "unknown"))
    settings = {"fixture_sd_deg": campaign.description.fixture_sd_deg, **settings}
    Settings(**settings)  # a setting that cannot be is no reason to refuse every sensor
    usable, findings = check_campaign(campaign)
    stations, reason = _turns(turns, usable, findings)
    given = magnitude or campaign.description.magnitude
    reference = None if given is None else Reference.constant(given, source="the chamber")
    names = _names(campaign, only)
    sensors = tuple(
        _fitted(usable, name, reference, stations, settings) for name in _told(names, progress)
    )
    return CalibratedCampaign(
        campaign=usable,
        findings=findings,
        turns="unknown" if stations == "unknown" else "known",
        reason=reason,
        sensors=sensors,
    )


def _names(campaign: Campaign, only: Iterable[str]) -> list[str]:
    """The sensors that were asked for."""
    wanted = list(only) or list(campaign.sensors)
    absent = [name for name in wanted if name not in campaign.sensors]
    if absent:
        raise AgonicError(f"no sensor {', '.join(absent)}; there are {', '.join(campaign.sensors)}")
    return wanted


def _told(names: list[str], progress: Any) -> Iterator[str]:
    yield from names if progress is None else progress(names)


def _turns(
    turns: str, campaign: Campaign, findings: tuple[Finding, ...]
) -> tuple[Mapping[int, Rotation] | Literal["unknown"], str]:
    """How the stations are turned, for `fit_thermal`, and why."""
    rotations = campaign.description.rotations
    if turns == "unknown":
        return "unknown", "the magnitude alone was asked for"
    if rotations is None:
        if turns == "known":
            raise AgonicError(
                "the turns of the stations are not described: give roll_deg, pitch_deg and "
                "heading_deg of every [[station]] in campaign.toml"
            )
        return "unknown", "the turns of the stations are not described"
    against = [finding.name for finding in findings if finding.name in CONTRADICTED]
    if against and turns == "auto":
        return "unknown", "the readings contradict the described turns of the stations"
    return rotations, "the turns of the stations are described"


def _fitted(
    campaign: Campaign,
    name: str,
    reference: Reference | None,
    stations: Mapping[int, Rotation] | Literal["unknown"],
    settings: Mapping[str, Any],
) -> CalibratedSensor:
    """The fit of a sensor, or why there is none."""
    if name not in campaign.sensors:
        return CalibratedSensor(
            name=name, refused="None of its recordings can be used (see what was found)."
        )
    samples: Samples = campaign.samples(name)
    try:
        fit = fit_thermal(samples, reference, stations=stations, **settings)
    except AgonicError as error:
        return CalibratedSensor(name=name, refused=f"{error}.")
    return CalibratedSensor(name=name, fit=fit)
