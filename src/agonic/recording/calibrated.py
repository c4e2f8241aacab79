"""The main job: the best calibration of each magnetometer that a log allows, verified."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array
from agonic.attitude.disturbers.choice import SourceChoice, list_moving
from agonic.attitude.latency import LatencyFit, share_latency
from agonic.attitude.undo_latency import keep_latency
from agonic.calibration.affine import Affine
from agonic.calibration.base import correct_field, select_columns
from agonic.calibration.sources import list_columns
from agonic.ellipsoid import Recording, fit_recording_and_rows, open_ellipsoid_parts
from agonic.errors import AgonicError
from agonic.fit import Fit
from agonic.health import Finding, Verdict, sentences, undo_decoding, verdict_of
from agonic.logs.any_form import Given, as_samples
from agonic.maths.one_pass import find_length
from agonic.new_rows import interpolate_repeated
from agonic.readable import Readable
from agonic.recording.advice import adapt_fit
from agonic.recording.choice.choose import Kind, choose, fall_back
from agonic.recording.choice.fits import Case, Choice, describe_latency, list_sources
from agonic.recording.ladder import Rung, build_ladder
from agonic.recording.parts import (
    CHANGED,
    MAX_OVER_STATED,
    Folds,
    Stretch,
    compare_folds,
    describe_failed,
    describe_part,
    find_change,
    find_refusals,
    find_rows,
    fit_folds,
    list_parts,
)
from agonic.reference import Reference
from agonic.samples import Samples
from agonic.verification import Verification, verify

_MOST_TRIED = 3  # stretches of a log whose bias changed


@dataclass(frozen=True, kw_only=True, eq=False)
class Calibrated(Readable):
    """One magnetometer of a log: its readings, the fit, and its verification.

    `method` is the word of the fit ("ellipsoid", "levelled", "inertial" or "vector"); `reason` says
    in a sentence why it was chosen; `latency` how late the readings were, where that was found and
    undone; `reference` is that of the samples; `folds` the fits to parts of the log, where any
    were made; `disturbers` what was tried of what disturbs on board; `stretches` those of the log
    that it is of, where it is not of all of it.
    """

    samples: Samples
    fit: Fit
    verification: Verification
    method: str
    reason: str
    latency: LatencyFit | None = None
    reference: Reference | None = None
    folds: Folds | None = None
    disturbers: SourceChoice | None = None
    stretches: tuple[Stretch, ...] = ()

    @property
    def calibration(self) -> Affine:
        """The calibration of the fit."""
        return self.fit.calibration

    @cached_property
    def failed(self) -> tuple[Finding, ...]:
        """The checks that failed on held-out parts, as findings, but those that refused the fit."""
        failed = (describe_failed(one) for one in self.verification.checks if one.passed is False)
        return tuple(finding for finding in failed if finding not in self.fit.findings)

    @property
    def objections(self) -> tuple[Finding, ...]:
        """What speaks against the result: findings that are more than a note, and failed checks."""
        grave = (finding for finding in self.fit.findings if finding.severity != "note")
        return (*grave, *self.failed)

    @cached_property
    def verdict(self) -> Verdict:
        """`refused` by the fit, `check` for a finding or a check that failed, or `good`."""
        return verdict_of(self.fit.findings, failed=bool(self.failed))

    @cached_property
    def status(self) -> str:
        """The verdict in words: of the fit, of failed checks, of the latency."""
        said = [self.fit.status]
        if self.verdict != "refused":
            said += [sentences(finding.sentence) for finding in self.failed]
            if self.latency is not None:
                said.append(describe_latency(self.latency))
        return " ".join(said)

    def with_finding(self, *findings: Finding) -> Calibrated:
        """The result with findings more, before all others as grave, and the verdict of it."""
        if not findings:
            return self
        fit = replace(self.fit, findings=()).with_findings(*findings, *self.fit.findings)
        return replace(self, fit=fit)

    def _say(self) -> list[str]:
        """Verdict and numbers."""
        head = f"Calibrated {self.samples.name!r}: {self.verdict}, {self.method}"
        return [head, *textwrap.wrap(self.status, 94), *self.calibration._say()]

    @cached_property
    def ladder(self) -> tuple[Rung, ...]:
        """The fits from the simplest to the chosen one; none where it was made before, or refused.
        They are fitted when this is first asked for."""
        if self.folds is None or self.verdict == "refused":
            return ()
        return build_ladder(
            self.samples,
            self.reference,
            self.fit,
            self.verification,
            method=self.method,
            reason=self.reason,
            single=self.folds.single,
        )

    @property
    def cleaned(self) -> Array:
        """The readings (n, 3) without what known sources on board add to them."""
        calibration = self.fit.calibration
        return calibration.cleaned(self.samples.field, **select_columns(calibration, self.samples))

    @property
    def corrected(self) -> Array:
        """The field (n, 3) by the calibration."""
        return correct_field(self.fit.calibration, self.samples)


def calibrate_as_named(
    samples: Given,
    reference: Reference | ArrayLike | None = None,
    *,
    unit: str | None = None,
    kind: Kind = "auto",
    **settings: Any,
) -> Calibrated:
    """`calibrate` along the axes that the readings are named for, whatever their mounting. Where
    the bias changed on the way, a stretch is calibrated: the last, or one that tells enough."""
    meant, known, wrong = undo_damage(as_samples(samples, unit), Reference.of(reference, unit))
    case = Case(interpolate_repeated(meant), known, settings)
    choice, made = _choose_and_verify(case, kind)
    if made is None or made.verdict == "refused":
        made = _calibrate_stretch(case, choice, kind) or made or _verify(choice)
    return made.with_finding(*wrong)


def undo_damage(
    samples: Samples, reference: Reference | None
) -> tuple[Samples, Reference | None, tuple[Finding, ...]]:
    """Samples and reference as they were measured, and what had been done to the numbers."""
    measured = undo_decoding(samples)
    known = None if reference is None else reference.select(measured.kept)
    return measured.samples, known, measured.findings


def _calibrate_stretch(case: Case, whole: Choice, kind: Kind) -> Calibrated | None:
    """The first part without a change of the bias that is not refused, none where it did not."""
    changed, samples = find_change(whole.fit.findings), case.samples
    if changed is None:
        return None
    timed = samples.time is not None
    clock = samples.time if samples.time is not None else np.arange(float(len(samples)))
    for part in list_parts(changed, clock)[:_MOST_TRIED]:
        try:
            some = case.select(find_rows(clock, part))
            share_latency(samples, some.samples)
            _, made = _choose_and_verify(*_choose_as(whole, some, kind))
        except AgonicError:
            continue
        now = part[-1][1] >= clock[-1]  # which may be checked; what was for a while has to hold
        if made is None or made.verdict == "refused" or (made.failed and not now):
            continue
        names = {finding.name for finding in made.fit.findings if finding.severity != "note"}
        if not names & {CHANGED, "prior"}:  # what only a prior holds is no calibration of a stretch
            of_part = replace(made, stretches=part, reason=whole.reason)
            return of_part.with_finding(describe_part(changed, part, timed=timed))
    return None


def _choose_as(whole: Choice, some: Case, kind: Kind) -> tuple[Case, Kind]:
    """Method and settings of a part: those of the whole, but where that was the magnitude alone,
    the part has other sources on board, or they could not be seen beside the change."""
    sources, moving = list_sources(whole.fit), list_moving(some.samples)
    seen = bool(sources) and {*moving, "second"}.issuperset(list_columns(sources))
    if whole.method in ("ellipsoid", "interference") or ((moving or sources) and not seen):
        return some, kind
    return some.given(**({"sources": sources} if sources else {})), cast("Kind", whole.method)


def calibrate_whole(
    samples: Samples, reference: Reference | None, kind: Kind, settings: Mapping[str, Any]
) -> Calibrated:
    """The fit of all rows, or a weaker one where what was recorded beside them is wrong."""
    samples, reference, wrong = undo_damage(samples, reference)
    choice, made = _choose_and_verify(Case(samples, reference, settings), kind)
    return (_verify(choice) if made is None else made).with_finding(*wrong)


def _choose_and_verify(case: Case, kind: Kind) -> tuple[Choice, Calibrated | None]:
    """The choice for all rows, or a weaker one that is not refused, and its result. None where the
    fit itself is refused, whatever held-out parts would say of it."""
    choice = choose(case.samples, case.reference, kind, case.settings)
    fit, made = _verify_unless_refused(choice)
    if kind != "auto" or choice.method == "ellipsoid" or fit.verdict != "refused":
        return choice, made
    other = fall_back(replace(choice, fit=fit), case)
    if other.method == choice.method:
        return choice, made
    fit, by_less = _verify_unless_refused(other)
    return (choice, made) if fit.verdict == "refused" else (other, by_less)


def _verify_unless_refused(choice: Choice) -> tuple[Fit, Calibrated | None]:
    fit = adapt_fit(choice.fit, choice.samples, choice.reference)
    if fit.verdict == "refused":
        return fit, None
    made = _verify(choice)
    return made.fit, made


def calibrate_recording(
    recording: Recording, reference: Reference | None = None, **settings: Any
) -> Calibrated:
    """Calibrate a recording of any length by the magnitude, and verify it on the rows kept of it.
    The calibration uses all readings; held-out parts are judged, and pictures drawn, by some 100
    000 rows that are spread evenly, the `samples` of the result.
    """
    fit, samples = fit_recording_and_rows(recording, reference, **settings)
    kept = ("method", "robust", "soft_iron_sd", "gauge", "seed")
    open_parts = partial(
        open_ellipsoid_parts,
        **{name: settings[name] for name in kept if name in settings},
        model=fit.calibration.model,
    )
    why = "the recording is longer than memory: it was read piece by piece"
    return _verify(Choice(samples, reference, fit, "ellipsoid", why, open_parts))


def calibrate_level(samples: Samples, reference: Reference | None) -> Calibrated:
    """Calibrate a two-axis compass that turned level; what was held out is not judged."""
    from agonic.ellipse.fit import fit_ellipse  # few logs have two axes

    fit = fit_ellipse(samples, reference)
    verification = Verification(
        checks=(),
        spread_before=fit.spread_before,
        spread_after=fit.spread_after,
        residual_rms=fit.noise,
        held_out=None,
        magnitude_before=find_length(samples.field),
        magnitude_after=find_length(fit.calibration.correct(samples.field)[:, :2]),
    )
    return Calibrated(
        samples=samples,
        fit=fit,
        verification=verification,
        method="ellipse",
        reason="the sensor has two axes, and turned level",
        reference=reference,
    )


def _verify(choice: Choice) -> Calibrated:
    """A choice with its latency kept, for all that use the calibration later, and with its checks
    on held-out parts."""
    kept = keep_latency(choice.fit, choice.samples, choice.latency)
    choice = replace(choice, fit=kept)
    samples, reference, fit = choice.samples, choice.reference, choice.fit
    refused = fit.verdict == "refused"
    folds = fit_folds(samples, reference, fit.calibration, choice.open_parts, refused=refused)
    used = np.ones(len(samples), dtype=bool) if fit.weights is None else fit.weights > 0
    noise = fit.noise * float(np.trace(fit.calibration.matrix) / 3)
    verification = verify(
        fit.calibration,
        samples,
        reference,
        noise=float(np.hypot(noise, MAX_OVER_STATED * folds.magnitude_sd)) if folds else noise,
        corrected=folds.unseen if folds else None,
        held_out=used if used.any() else None,
    )
    checks = (*verification.checks, compare_folds(folds))
    if not refused:
        choice = replace(choice, fit=fit.with_findings(*find_refusals(checks)))
    return replace(conclude(choice, replace(verification, checks=checks)), folds=folds)


def conclude(choice: Choice, verification: Verification) -> Calibrated:
    """The result of a choice, its advice adapted to where the samples were recorded."""
    fit = adapt_fit(choice.fit, choice.samples, choice.reference)
    late = choice.latency is not None and choice.latency.significant
    return Calibrated(
        samples=choice.samples,
        fit=fit,
        verification=verification,
        method=choice.method,
        reason=choice.reason,
        latency=choice.latency if late else None,
        reference=choice.reference,
        disturbers=choice.disturbers,
    )
