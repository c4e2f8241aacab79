"""Cross-validation: what a fit to other stations makes of a station it has not seen."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError
from agonic.health import Finding, figure
from agonic.reference import Reference
from agonic.thermal.fit.evidence import compute_spread
from agonic.thermal.fit.fit import fit_binned
from agonic.thermal.fit.problem import Stations
from agonic.thermal.fit.readings import Facts
from agonic.thermal.fit.result import Spread, ThermalFit
from agonic.thermal.maths.binned_sums import Binned, Cells
from agonic.thermal.maths.ellipsoids import FEWEST

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
        "faults": False,  # they move no coefficient
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
