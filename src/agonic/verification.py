"""`verify`: named checks of a calibration on data that the fit has not seen."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Mask
from agonic.calibration.base import Calibration, correct_field
from agonic.maths.equation.coverage import find_cells
from agonic.maths.equation.crowding import weigh_crowded
from agonic.maths.estimation.noise.residuals import MAD_TO_SD, robust_scale
from agonic.maths.estimation.robust.robust_spread import weighted_median
from agonic.maths.one_pass import find_length, median
from agonic.maths.rotations.angles import angle_deg, wrap_deg
from agonic.maths.rotations.attitude import down_b
from agonic.maths.rotations.tilt import heading_by_vectors_deg
from agonic.readable import Readable
from agonic.reference import Reference
from agonic.samples import Samples

SPREAD_LIMIT = 0.03
"""Spread of the calibrated magnitude that still allows a heading of about a degree."""
NOISE_LIMIT = 1.5
MAGNITUDE_LIMIT = 0.03
DIP = "dip against the reference"
DIP_LIMIT_DEG = 5.0
DIP_REFUSED_DEG = 15.0
"""A dip of unseen readings that is so far off is not of this attitude, or not of this field."""


@dataclass(frozen=True, kw_only=True)
class Check:
    """One named question with its answer: `value` against `limit`, in `unit`.

    `passed` is None where the check informs but does not judge; `meaning` says in a sentence what
    the value tells and, when it failed, what to do.
    """

    name: str
    value: float
    limit: float | None
    unit: str
    passed: bool | None
    meaning: str


@dataclass(frozen=True, kw_only=True, eq=False)
class Verification(Readable):
    """The checks, and the magnitudes they were made of.

    `spread_before` and `spread_after` are the standard deviation of the field's magnitude over its
    mean (a fraction), gross outliers left out; `held_out` (n,) marks the rows that were judged, or
    is None when the calibration was checked on other samples altogether; `magnitude_before` and
    `magnitude_after` (n,) are the magnitudes of all rows.
    """

    checks: tuple[Check, ...]
    spread_before: float
    spread_after: float
    residual_rms: float
    held_out: Mask | None
    magnitude_before: Array
    magnitude_after: Array

    def _say(self) -> list[str]:
        """Each check with its value."""
        words = {True: "passed", False: "failed", None: "for information"}
        said = (
            " ".join(f"{check.name}: {check.value:.3g} {check.unit}".split())
            + f" ({words[check.passed]})"
            for check in self.checks
        )
        return [f"Verification: {'passed' if self.passed else 'failed'}", *said]

    @property
    def passed(self) -> bool:
        """No check failed."""
        return all(check.passed is not False for check in self.checks)


def verify(
    calibration: Calibration,
    samples: Samples,
    reference: Reference | None = None,
    *,
    noise: float | None = None,
    corrected: ArrayLike | None = None,
    held_out: Mask | None = None,
) -> Verification:
    """Check a calibration on samples, best on ones that it was not made from.

    Parameters
    ----------
    calibration, samples : must meet in unit and frame.
    reference : the magnitude that the corrected field should have; without one, its own mean.
    noise : standard deviation per axis that the fit claims, in the unit of the corrected field.
    corrected : (n, 3) the field as corrected without having seen each row; default: by
        `calibration`.
    held_out : (n,) the rows to judge; default: all.

    Returns a `Verification`. Raises `UnitError` or `FrameError` where they do not meet.

    >>> from agonic.calibration.affine import Affine
    >>> turned = Samples(field=[[11.0, 0, 0], [1, 10, 0], [1, 0, 10], [-9, 0, 0]])
    >>> verify(Affine(bias=[1, 0, 0], matrix=np.eye(3)), turned).spread_after
    0.0
    """
    field = correct_field(calibration, samples) if corrected is None else np.asarray(corrected)
    rows = np.ones(len(samples), dtype=bool) if held_out is None else held_out
    before, after = map(find_length, (samples.field, field))
    wanted: Array | float = (
        median(after[rows]) if reference is None else reference.magnitudes(len(samples))
    )
    ratio = after / wanted
    cells = find_cells(field)
    weights = weigh_crowded(cells)[rows]  # time spent in one direction is no evidence of others
    visits = max(int(np.count_nonzero(np.diff(cells[rows]))) + 1, 4)
    spread_before, spread_after = _spread(before[rows], weights), _spread(ratio[rows], weights)
    residual_rms = spread_after * float(np.mean(wanted))
    improvement = _AS_STEADY if spread_after > spread_before > 0 else _IMPROVEMENT
    checks = [
        _SPREAD.ask(100 * spread_after),
        improvement.compare(spread_before, spread_after, visits),
    ]
    if noise:
        checks.append(_NOISE.ask(residual_rms / noise))
    if reference is not None:
        off = 100 * (median(ratio[rows]) - 1)
        checks.append(_MAGNITUDE.ask(off, source=reference.source))
        if calibration.frame_out == "b":
            checks += _attitude_checks(field, rows, samples, reference)
    if samples.logged is not None:
        logged = samples.logged
        old = (samples.field - logged.bias) @ logged.matrix.T
        kept = np.linalg.norm(old, axis=1) / (1.0 if reference is None else wanted)
        spread_logged = _spread(kept[rows], weights)
        turn = float(np.sqrt(np.mean(angle_deg(field[rows], old[rows]) ** 2)))
        checks += [
            _REPLACEMENT.compare(spread_logged, spread_after, visits, source=logged.source),
            _CHANGE.ask(turn, source=logged.source),
        ]
    return Verification(
        checks=tuple(checks),
        spread_before=spread_before,
        spread_after=spread_after,
        residual_rms=residual_rms,
        held_out=held_out,
        magnitude_before=before,
        magnitude_after=after,
    )


def _spread(magnitude: Array, weights: Array) -> float:
    """Standard deviation over the mean, readings beyond six robust deviations left out; infinite
    where most readings are zero."""
    middle = weighted_median(magnitude, weights)
    away = np.abs(magnitude - middle)
    kept = away <= 6 * MAD_TO_SD * weighted_median(away, weights) + 1e-12 * middle
    mean = float(np.average(magnitude[kept], weights=weights[kept]))
    square = np.average((magnitude[kept] - mean) ** 2, weights=weights[kept])
    return float(np.sqrt(square)) / mean if mean > 0.0 else float("inf")


class _Question(NamedTuple):
    """A row of the table of checks: its name, its limit, and what the answer means."""

    name: str
    limit: float | None
    unit: str
    well: str
    badly: str

    def ask(self, value: float, **words: str) -> Check:
        """The check of a value, either way from zero; with no limit it informs."""
        good = None if self.limit is None else abs(value) <= self.limit
        meaning = self.badly if good is False else self.well
        return Check(
            name=self.name,
            value=value,
            limit=self.limit,
            unit=self.unit,
            passed=good,
            meaning=meaning.format(**words),
        )

    def compare(self, before: float, after: float, visits: int, **words: str) -> Check:
        """The check of a spread over one before. Those over so many visits of directions differ by
        chance by √(1/visits); half a percent of the field is good whatever was before."""
        ratio = after / before if before > 0 else 1.0
        limit = 1 + 3 / np.sqrt(visits)
        check = self._replace(limit=float(limit)).ask(ratio, **words)
        if check.passed or not after <= 0.005:
            return check
        return replace(check, passed=True, meaning=self.well.format(**words))


_SPREAD = _Question(
    "spread of the magnitude",
    100 * SPREAD_LIMIT,
    "%",
    "the calibrated field keeps its magnitude in every direction",
    "the magnitude still varies: record away from steel and currents, or the calibration does not "
    "belong to this sensor",
)
_IMPROVEMENT = _Question(
    "spread after over before",
    None,
    "",
    "the calibration makes the magnitude steadier",
    "the calibration makes these readings worse: do not use it for them",
)
_AS_STEADY = _IMPROVEMENT._replace(well="the magnitude was as steady before, within chance")
_REPLACEMENT = _Question(
    "spread after over the logged calibration's",
    None,
    "",
    "the magnitude is as steady as with the earlier calibration ({source}), or steadier",
    "the earlier calibration ({source}) keeps the magnitude steadier: keep that one, or record "
    "again with more turns",
)
_NOISE = _Question(
    "held-out residual over noise",
    NOISE_LIMIT,
    "",
    "unseen readings fit as well as those of the fit",
    "unseen readings fit worse than those of the fit: parts of the log disagree; record again in "
    "one undisturbed place",
)
_MAGNITUDE = _Question(
    "magnitude against the reference",
    100 * MAGNITUDE_LIMIT,
    "%",
    "the magnitude agrees with the reference ({source})",
    "the magnitude differs from the reference ({source}): iron nearby, a wrong place or a wrong "
    "unit",
)
_DIP = _Question(
    DIP,
    DIP_LIMIT_DEG,
    "°",
    "the field dips as it should, by the roll and pitch of the log",
    "the field does not dip as it should: roll and pitch are wrong or delayed, or the field is "
    "disturbed",
)
_HEADING = _Question(
    "heading against the log",
    None,
    "°",
    "rms difference between the true heading and {whose}; its mean is {mean}°",
    "",
)
_CHANGE = _Question(
    "turn against the logged calibration",
    None,
    "°",
    "rms angle between the field as corrected now and by {source}",
    "",
)


def _attitude_checks(
    field: Array, rows: Mask, samples: Samples, reference: Reference
) -> list[Check]:
    """Dip and heading of the corrected field against the attitude of the log and the reference."""
    if samples.roll_deg is None or samples.pitch_deg is None:
        return []
    if reference.kind not in ("vector", "horizontal-vertical"):
        return []
    down = down_b(samples.roll_deg, samples.pitch_deg)
    horizontal, vertical = reference.horizontal_and_vertical(len(samples)).T
    below = np.einsum("ni,ni->n", field, down)
    level = np.sqrt(np.maximum(np.einsum("ni,ni->n", field, field) - below**2, 0.0))
    dip = np.degrees(np.arctan2(below, level) - np.arctan2(vertical, horizontal))
    checks = [_DIP.ask(robust_scale(dip[rows]))]
    if samples.heading_deg is not None and reference.kind == "vector":
        east, north = reference.values[:, 1], reference.values[:, 0]
        true = heading_by_vectors_deg(field, down) + np.degrees(np.arctan2(east, north))
        difference = wrap_deg(true - samples.heading_deg)[rows & samples.heading_known]
        if len(difference):
            own = "the autopilot's own, which follows its compasses"
            whose, mean = own if samples.heading_estimated else "the log's", difference.mean()
            rms = float(np.sqrt(np.mean(difference**2)))
            checks.append(_HEADING.ask(rms, whose=whose, mean=f"{mean:.1f}"))
    return checks
