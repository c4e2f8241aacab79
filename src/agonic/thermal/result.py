"""`CalibratedCampaign`: every sensor of a campaign with what it is worth."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field, replace

from agonic.health import Finding, sentences
from agonic.readable import Readable
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.cross_validation import HeldOut
from agonic.thermal.fit.result import Positions, ThermalFit


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedSensor(Readable):
    """One sensor: its fit, or in `refused` why there is none.

    `held_out` is what fits to other stations make of each station; `None` where that was not asked
    for, or too few stations are left for a fit.
    """

    name: str
    fit: ThermalFit | None = None
    refused: str = ""
    held_out: HeldOut | None = None

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What was seen of the sensor: by the fit, then by the test on stations left out."""
        own = () if self.fit is None else self.fit.findings
        return own if self.held_out is None else (*own, *self.held_out.findings)

    def without(self, names: Collection[str]) -> CalibratedSensor:
        """The sensor without the findings of its fit that have these names."""
        if self.fit is None:
            return self
        kept = tuple(finding for finding in self.fit.findings if finding.name not in names)
        return replace(self, fit=replace(self.fit, findings=kept))

    @property
    def verdict(self) -> str:
        """`good`, `check` or `refused`."""
        if self.fit is None or self.fit.verdict == "refused":
            return "refused"
        return "check" if any(f.severity == "check" for f in self.findings) else "good"

    @property
    def status(self) -> str:
        """The result in words."""
        if self.fit is None:
            return self.refused
        unseen = () if self.held_out is None else self.held_out.findings
        return " ".join([*(sentences(f.sentence) for f in unseen), self.fit.status])


@dataclass(frozen=True, kw_only=True, eq=False)
class CalibratedCampaign(Readable):
    """All sensors of a campaign.

    `campaign` is what could be used of it, `findings` what was not as planned; `turns` "known"
    where the fits used the orientations of the stations, `reason` why. `chamber_field` is what
    several sensors saw alike while the stations were recorded; `None` without clocks or with fewer
    than two sensors. `positions` are the turns of the stations where they were found from the
    readings, of all sensors together.
    """

    campaign: Campaign
    findings: tuple[Finding, ...]
    turns: str
    reason: str
    sensors: tuple[CalibratedSensor, ...] = field(default_factory=tuple)
    chamber_field: ChamberField | None = None
    positions: Positions | None = None

    def _say(self) -> list[str]:
        """The verdict of each sensor."""
        said = [f"{one.name}: {one.verdict}" for one in self.sensors]
        return [f"CalibratedCampaign: {self.verdict}", *said]

    @property
    def verdict(self) -> str:
        """The worst of the sensors and of the findings on the campaign."""
        verdicts = {sensor.verdict for sensor in self.sensors}
        severities = {finding.severity for finding in self.findings}
        if "refused" in verdicts or not self.sensors:
            return "refused"
        return "check" if "check" in verdicts or severities & {"check", "refuse"} else "good"
