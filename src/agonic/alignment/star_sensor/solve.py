"""The solution of a session: which unknowns are free, and what is known of them beforehand."""

from __future__ import annotations

from collections.abc import Collection

from agonic.alignment.maths import solution
from agonic.alignment.maths.solution import Solution
from agonic.alignment.maths.two_frames import make_prior
from agonic.alignment.session import Observed, Session


def solve_session(session: Session, observed: Observed, groups: Collection[str]) -> Solution:
    """The most probable unknowns, those of `groups` free.

    What the session knows with a standard deviation (pier, axes of the reference) joins by itself.
    """
    prior = make_prior({"alignment", *groups}, session.pier.sd, session.reference_sd_arcsec)
    return solution.solve(observed.measured, prior, session.pier.difference)
