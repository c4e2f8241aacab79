"""`CalibratedCampaign`: every sensor of a campaign with what it is worth."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.health import Finding, figure, sentences
from agonic.readable import Readable
from agonic.reference import Reference
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.fit.each_temperature import FEWEST
from agonic.thermal.fit.evidence import compute_spread
from agonic.thermal.fit.fit import fit_binned
from agonic.thermal.fit.problem import Stations
from agonic.thermal.fit.readings import Facts
from agonic.thermal.fit.result import Positions, Spread, ThermalFit
from agonic.thermal.fit.station_faults import TOLD
from agonic.thermal.maths.binned_sums import Binned, Cells

FOLDS = 4
"""Of twelve stations each fit leaves three out; the nine that are left still see all faces."""
FEWEST_BINS = 15
"""Temperatures that the fits which are only tested need: their bins are wider, to save time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class HeldOut:
    """Every station judged by a fit that has not seen it.

    `spread` are the standard deviations of the readings at the stations, before and after a
    correction by the fit to the others; `magnitude_rms` (k,) by how much the magnitude of the
    corrected field is off that of the chamber there, nT, and `seen_rms` (k,) by how much with the
    fit to all stations. `folds` is the number of fits.
    """

    spread: Spread
    magnitude_rms: Array
    seen_rms: Array
    folds: int

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Whether the correction helps at stations that were held out."""
        before, after = (
            float(values[:, 3].max()) for values in (self.spread.before, self.spread.after)
        )
        if after <= before:
            return ()
        return (
            Finding(
                "held-out stations",
                "check",
                f"at stations that a fit has not seen the magnitude varies by {figure(after)} "
                f"after the correction and by {figure(before)} before it",
                "record more stations, or describe how they stood",
            ),
        )


def cross_validate(
    sums: Binned,
    facts: Facts,
    reference: Reference | None,
    fit: ThermalFit,
    stations: Stations,
    settings: Mapping[str, Any],
) -> HeldOut | None:
    """Fit again without each fold of stations, and try the result on those.

    The order and the terms are those of the fit to all stations. Stations whose fold cannot be
    fitted, or is refused, are not judged; `None` where that is so of all.
    """
    numbers = sorted(set(fit.station.tolist()))
    chosen = {
        **settings,
        "degree": fit.calibration.degree,
        "drift": fit.drift is not None,
        "rate": fit.calibration.rate is not None,
        "faults": bool({one.name for one in fit.findings} & {one.name for one in TOLD.values()}),
    }
    cells = sums.cells()
    coarser = max(1, (int(np.ptp(cells.bin)) + 1) // FEWEST_BINS)
    judged: list[tuple[Cells, Thermal]] = []
    for fold in range(FOLDS):
        without = numbers[fold::FOLDS]
        kept = [number for number in numbers if number not in without]
        if isinstance(stations, str) and len(kept) < FEWEST:
            continue
        calibration = _fit_part(sums.part(kept, coarser), facts, reference, stations, chosen)
        if calibration is not None:
            judged.append((cells.select(np.isin(cells.number, without)), calibration))
    if not judged:
        return None
    spreads = [compute_spread(part, calibration) for part, calibration in judged]
    order = np.argsort(np.concatenate([spread.stations for spread in spreads]))
    made = {
        name: np.concatenate(parts)[order]
        for name, parts in {
            "before": [spread.before for spread in spreads],
            "after": [spread.after for spread in spreads],
            "unseen": [_compute_magnitude_rms(part, calibration) for part, calibration in judged],
            "seen": [_compute_magnitude_rms(part, fit.calibration) for part, _ in judged],
        }.items()
    }
    seen = np.concatenate([spread.stations for spread in spreads])[order]
    return HeldOut(
        spread=Spread(stations=tuple(seen.tolist()), before=made["before"], after=made["after"]),
        magnitude_rms=made["unseen"],
        seen_rms=made["seen"],
        folds=len(judged),
    )


def _fit_part(
    sums: Binned,
    facts: Facts,
    reference: Reference | None,
    stations: Stations,
    settings: Mapping[str, Any],
) -> Thermal | None:
    """A calibration from some stations; `None` where they are too few."""
    if not isinstance(stations, str):
        stations = {number: stations[number] for number in sums.stations if number in stations}
    try:
        fit = fit_binned(sums, facts, reference, stations=stations, **settings)
    except AgonicError:
        return None
    return None if fit.verdict == "refused" else fit.calibration


def _compute_magnitude_rms(cells: Cells, calibration: Thermal) -> Array:
    """Rms of the magnitude of the corrected means less the chamber's, by station (k,)."""
    assert calibration.magnitude is not None
    cells = cells.select(~calibration.outside(cells.temperature))
    field = calibration.correct(
        cells.mean, temperature=cells.temperature, temperature_rate=cells.rate
    )
    away = np.linalg.norm(field, axis=1) - calibration.magnitude
    return np.array(
        [
            np.sqrt(np.average(away[rows] ** 2, weights=cells.n[rows]))
            for rows in (cells.number == number for number in np.unique(cells.number))
        ]
    )


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
