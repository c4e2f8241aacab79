"""What is left where a fit was refused for what was recorded beside the magnetometer."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from agonic.errors import CoverageError
from agonic.health.finding import Severity
from agonic.recording.choice.fits import Choice, fit_alone, fit_beside_attitude
from agonic.reference import Reference
from agonic.samples import Samples

OF_THE_RECORDING = {"attitude", "heading", "mounting", "inertial unit"}
"""Reasons to refuse a fit which another recording of the same motion would not have."""
NOT_OF_THE_MAGNETOMETER = {"attitude", "heading", "mounting", "noise with memory"}
"""Reasons to refuse a fit that do not concern one that knows the magnitude only, or need not."""


def fall_back(
    aided: Choice, samples: Samples, reference: Reference | None, settings: Mapping[str, Any]
) -> Choice:
    """A fit without what was recorded wrongly: without the heading, then without roll and pitch.

    Where anything else refuses a fit, one that knows less would be refused too, or should be.
    """
    recorded = samples.roll_deg is not None and samples.pitch_deg is not None
    if (
        reference is not None
        and recorded
        and aided.method == "vector"
        and {"heading", "mounting"} & find_causes(aided)
        and find_causes(aided) <= NOT_OF_THE_MAGNETOMETER
    ):
        levelled = fit_beside_attitude(samples, reference, "levelled", "", settings)
        aided = carry_refusal(levelled, aided)
    causes = find_causes(aided)
    if not causes or not causes <= NOT_OF_THE_MAGNETOMETER:
        return aided
    try:
        alone = fit_alone(samples, reference, settings)
    except CoverageError:
        return aided
    return aided if alone.fit.verdict == "refused" else carry_refusal(alone, aided)


def find_causes(choice: Choice) -> set[str]:
    """The names of what refuses a fit."""
    return {finding.name for finding in choice.fit.findings if finding.severity == "refuse"}


def carry_refusal(choice: Choice, refused: Choice) -> Choice:
    """A choice with what refused the fit before it: the log's attitude has to be looked at.

    What the choice says itself is not told again, nor, where it names axes, a mounting by right
    angles or an attitude, nor what a gyro of another unit or axes made of the fit beside it.
    """
    grave = [finding for finding in refused.fit.findings if finding.severity == "refuse"]
    said = {finding.name for finding in choice.fit.findings}
    said |= {"mounting", "attitude"} if "axes" in said else set()
    if "inertial unit" in said:
        said |= {finding.name for finding in refused.fit.findings}
    known: dict[str, Severity] = {"heading": "note"}  # of which the calibration has no use
    told = [
        replace(one, severity=known.get(one.name, "check")) for one in grave if one.name not in said
    ]
    beside = {"heading", "attitude"} - said
    carried = [one for one in refused.fit.findings if one.name in beside and one not in grave]
    why = f"a {refused.method} fit was refused ({grave[0].what})"
    return replace(choice, fit=choice.fit.with_findings(*told, *carried), reason=why)
