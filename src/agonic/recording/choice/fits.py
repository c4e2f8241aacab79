"""`Choice`: the fit by one method, its delay undone and what disturbs on board joined."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from agonic.arrays import Index, Mask
from agonic.attitude.disturbers.choice import (
    SourceChoice,
    choose_sources,
    describe_gain,
    list_moving,
)
from agonic.attitude.disturbers.shape import find_timing_sd
from agonic.attitude.fit import CHANNELS, fit_levelled, fit_vector, open_channels_parts
from agonic.attitude.interference import find_channels, fit_interference
from agonic.attitude.latency import LatencyFit, find_latency
from agonic.attitude.problem import Settings
from agonic.attitude.undo_latency import find_and_undo
from agonic.calibration.interference import Interference
from agonic.calibration.sources import describe_sources
from agonic.ellipsoid import (
    check_by_gravity,
    fit_ellipsoid,
    open_ellipsoid_parts,
)
from agonic.fit import Fit
from agonic.health import Finding
from agonic.health.inertial_unit import leave_out_faulty, repair
from agonic.inertial.fit import InertialFit, fit_inertial, open_inertial_parts
from agonic.model.terms import HIDDEN
from agonic.model.terms.time import STEP
from agonic.new_rows import find_fresh
from agonic.recording.parts import FitPart, OpenParts
from agonic.reference import Reference
from agonic.samples import Samples

_FITS: Mapping[str, Callable[..., Fit]] = {
    "levelled": fit_levelled,
    "vector": fit_vector,
    "inertial": partial(fit_inertial, latency=False),
    "interference": fit_interference,
}

BESIDE_EACH_ROW = ("levelled", "vector")
"""Fits that compare a reading with the attitude of its row: one that is only held is late there."""

MAY_BE_DISTURBED = {"coverage", "prior", "correlated noise", STEP.name, *(t.name for t in HIDDEN)}
"""Reasons to refuse a fit that may go where what disturbs is known."""
MOST_ROWS_OF_PARTS = 10_000
"""Rows that parts of a log are fitted to, together."""


class Case(NamedTuple):
    """What is to be fitted: samples, their reference, and the settings of a fit."""

    samples: Samples
    reference: Reference | None
    settings: Mapping[str, Any]

    def select(self, rows: Index | Mask) -> Case:
        """The same of some rows."""
        reference = None if self.reference is None else self.reference.select(rows)
        return self._replace(samples=self.samples.select(rows), reference=reference)

    def given(self, **settings: Any) -> Case:
        """The same with these settings where none are asked for."""
        return self._replace(settings={**settings, **self.settings})


@dataclass(frozen=True, eq=False)
class Choice:
    """A fit with the word for its method and the reason for choosing it. `samples` are those that
    were fitted, with a `latency` that is significant undone beside an attitude, and `reference` is
    that of their rows; `open_parts` gives what calibrates parts of a log with the same choices;
    `ask_latency` finds the latency, which a refused fit has no use for; `disturbers` is what was
    tried of them, where any were."""

    samples: Samples
    reference: Reference | None
    fit: Fit
    method: str
    reason: str
    open_parts: OpenParts
    ask_latency: Callable[[], LatencyFit | None] = lambda: None
    disturbers: SourceChoice | None = None

    @property
    def latency(self) -> LatencyFit | None:
        """How late the readings are, where anything tells it."""
        return self.ask_latency()


def describe_latency(latency: LatencyFit) -> str:
    """What is done about a latency, in a sentence."""
    late = f"{1e3 * abs(latency.latency_s):.1f} ± {1e3 * latency.sd_s:.1f} ms late"
    what = f"readings came {late} relative to the attitude"
    if latency.latency_s < 0:
        what = f"attitude came {late} relative to the readings"
    return f"The {what}; the calibration keeps it."


def fit_magnitude(case: Case, reason: str) -> Choice:
    """The fit to the magnitude, and what it does not see but matters to a heading: its axes, its
    latency, what is wrong with accelerometer and gyro."""
    (recorded, reference, settings), (samples, wrong) = case, leave_out_faulty(case.samples)
    plain = fit_ellipsoid(samples, reference, **settings)
    fit = check_by_gravity(plain, samples, reference)
    if fit.verdict == "refused":  # then what was recorded wrongly is the first thing to know
        wrong = repair(recorded)[1]
    fit = fit.with_findings(*wrong)
    same = {**settings, "model": fit.calibration.model}
    parts = partial(open_some, partial(open_ellipsoid_parts, **same, near=fit.calibration))
    ask_latency = partial(find_latency, samples)
    return Choice(samples, reference, fit, "ellipsoid", reason, parts, ask_latency)


def fit_alone(case: Case) -> Choice:
    """The fit to the magnitude, by those settings of a fit beside the attitude that it has too."""
    own = {k: v for k, v in case.settings.items() if k not in ("sources", "turn_sd_deg")}
    return fit_magnitude(case._replace(settings=own), "")


def join_disturbers(alone: Choice, case: Case, reason: str) -> Choice:
    """The fit to the magnitude with what disturbs on board, where anything recorded does. Without a
    reference the magnitude is that which the fit found for a mean gain of 1."""
    calibration = alone.fit.calibration
    refused = {one.name for one in alone.fit.findings if one.severity == "refuse"}
    if not list_moving(case.samples) or not refused <= MAY_BE_DISTURBED:
        return alone
    assert calibration.magnitude is not None
    known = case.reference or Reference.constant(calibration.magnitude, source="a mean gain of 1")
    common = keep_common(case.settings)
    found = choose_sources(case.samples, known, common)
    if not found.sources:
        return replace(alone, disturbers=found)
    plain = case.samples.with_columns(roll_deg=None, pitch_deg=None)
    given = Case(plain, known, {**asdict(common), "sources": found.sources})
    why = f"{reason}, and {describe_sources(found.sources)} the readings"
    joined = fit_beside_attitude(given, "interference", why)
    fit = add_choice(joined.fit, found)
    if fit.verdict == "refused":
        return replace(alone, disturbers=found)
    in_unit = replace(fit.calibration, unit_out=calibration.unit_out)
    return replace(joined, fit=replace(fit, calibration=in_unit), disturbers=found)


def fit_beside_attitude(case: Case, method: str, reason: str) -> Choice:
    """The fit to magnitude, dip and perhaps azimuth, delay undone, a current joined."""
    if method == "vector" and not case.samples.heading_known.all():
        case = case.select(np.flatnonzero(case.samples.heading_known))
    samples, reference, settings = case
    wrong: tuple[Finding, ...] = ()
    if method != "inertial":  # which needs them, and says itself what is wrong
        samples, wrong = leave_out_faulty(samples)
    samples, reference, latency = find_and_undo(samples, reference)
    if method in BESIDE_EACH_ROW:
        case = Case(samples, reference, settings).select(np.flatnonzero(find_fresh(samples.field)))
        samples, reference, _ = case
    tried, sources = None, {}
    if "sources" not in settings:
        assert reference is not None
        tried = choose_sources(samples, reference, keep_common(settings))
        sources = {"sources": tried.sources} if tried.sources else {}
    fit = _FITS[method](samples, reference, **settings, **sources)
    if tried is not None and sources:
        fit = add_choice(fit, tried)
        reason += f", and {describe_sources(list_sources(fit))} the readings"
    if isinstance(fit, InertialFit):
        if fit.heading_source is not None:
            reason += f", and {fit.heading_source} was used beside the gyro"
        parts: OpenParts = partial(open_inertial_parts, fit)
        return Choice(fit.samples, fit.reference, fit, method, reason, parts, lambda: latency)
    assert reference is not None  # any other fit has asked for it
    same = {**settings, "gauge": fit.calibration.gauge, "sources": list_sources(fit)}
    parts = partial(
        open_channels_parts,
        channels=CHANNELS.get(method) or find_channels(samples, reference),
        settings=Settings(**same),
        near=fit.calibration,
    )
    if not list_sources(fit):  # what follows a source slowly has to be seen row by row
        parts = partial(open_some, parts)
    return Choice(
        samples, reference, fit.with_findings(*wrong), method, reason, parts, lambda: latency, tried
    )


def open_some(open_parts: OpenParts, samples: Samples, reference: Reference | None) -> FitPart:
    """The calibrations by evenly spaced rows, of no more than suffice to judge rows that they have
    not seen: their own error is then far below the noise of these."""
    some = np.arange(0, len(samples), max(-(-len(samples) // MOST_ROWS_OF_PARTS), 1))
    known = None if reference is None else reference.select(some)
    fit_part = open_parts(samples.select(some), known)
    return lambda rows: fit_part(rows[some])


def add_choice(fit: Fit, found: SourceChoice) -> Fit:
    """The fit with what its sources are good for, and how well their timing is known."""
    calibration = fit.calibration
    assert isinstance(calibration, Interference)
    timed = replace(calibration, timing_sd_s=find_timing_sd(found.shapes))
    return replace(fit, calibration=timed).with_findings(describe_gain(found))


def list_sources(fit: Fit) -> tuple[str, ...]:
    return getattr(fit.calibration, "sources", ())


def keep_common(settings: Mapping[str, Any]) -> Settings:
    """The settings of a fit that one with sources has too; the whole model."""
    common = ("robust", "soft_iron_sd", "seed", "turn_sd_deg")
    return Settings(**{name: settings[name] for name in common if name in settings})
