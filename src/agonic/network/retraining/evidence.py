"""What a network that is kept up to date has to say of itself."""

from __future__ import annotations

from agonic.calibration.retraining import RetrainerState, Retraining
from agonic.health import Finding


def list_findings(state: RetrainerState) -> tuple[Finding, ...]:
    """What the user should know about a state.

    >>> from agonic.calibration.retraining import RetrainerParams
    >>> from agonic.network.retraining.schedule import start
    >>> [finding.name for finding in list_findings(start(None, RetrainerParams()))]
    ['not trained yet']
    """
    found = []
    if state.running is None:
        found.append(
            Finding(
                "not trained yet",
                "refuse",
                f"{state.n} readings were seen and no training was accepted yet",
                "pass on more readings, or give a calibration to start from",
            )
        )
    if state.onset is not None:
        found.append(
            Finding(
                "change not learned yet",
                "check",
                f"the residual changed {state.n - state.onset} readings ago, and {state.wait} are "
                "waited for",
                "pass on more readings",
            )
        )
    last = state.retrainings[-1] if state.retrainings else None
    if last is not None and last.poisoned:
        found.append(
            Finding(
                "retraining rejected",
                "check",
                f"the last retraining, at {last.time:.1f} s, was rejected: {last.reason}",
                "look at sensor and reference; what ran before goes on running",
            )
        )
    if state.changes:
        found.append(_describe_changes(state.changes))
    return tuple(found)


def _describe_changes(changes: tuple[Retraining, ...]) -> Finding:
    times = ", ".join(f"{one.onset:.1f} s" for one in changes[-3:])
    last = f" (the last {len(changes[-3:])} of {len(changes)})" if len(changes) > 3 else ""
    return Finding(
        "sensor changed",
        "note",
        f"the residual changed at {times}{last}, and the change was learned",
        "look for what was switched or deployed then",
    )
