"""What a fit says of itself: shares of the heading's error by name."""

from __future__ import annotations

from collections.abc import Mapping

from agonic.model.posterior import Posterior

LEAST = 0.01
"""Of the variance of the heading: smaller shares are not told."""


def list_shares(posterior: Posterior | None) -> Mapping[str, float]:
    """The standard error of a level heading by what makes it, degrees, the largest first."""
    if posterior is None:
        return {}
    shares = {"noise and coverage": posterior.noise_deg, "memory of noise": posterior.memory_deg}
    shares |= posterior.considered_deg
    for one in posterior.shares:
        shares[one.term.name] = (shares.get(one.term.name, 0.0) ** 2 + one.heading_deg**2) ** 0.5
    total = sum(value**2 for value in shares.values())
    told = {name: value for name, value in shares.items() if value**2 > LEAST * total}
    return dict(sorted(told.items(), key=lambda one: -one[1]))
