"""A session that fits badly for no usual mistake: the cause is named with its size."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import agonic as ag
from agonic.alignment.explanations import find_explanations
from agonic.alignment.session.session import Session
from agonic.alignment.simulation.session import simulate_session
from agonic.maths.rotations.attitude import make_rotation
from agonic.maths.rotations.frames import ARCSEC_RAD

AXIS = np.array([1.0, 2.0, -2.0]) / 3.0


def turned(session: Session, arcsec: np.ndarray) -> Session:
    """With attitudes turned by so much about one axis, (n,)."""
    turns = np.stack([make_rotation(a * ARCSEC_RAD * AXIS) for a in arcsec])
    return replace(session, star=replace(session.star, rot_ci=turns @ session.star.rot_ci))


def late(session: Session) -> Session:
    return replace(session, star=replace(session.star, time=session.star.time + 2.0))


def bent(session: Session) -> Session:
    time = session.star.time
    return turned(session, 30.0 * (time - time.mean()) / np.ptp(time))


def moved(session: Session) -> Session:
    numbers = session.star.orientation
    return turned(session, 20.0 * (numbers > np.unique(numbers)[9]))


def one_off(session: Session) -> Session:
    numbers = session.star.orientation
    return turned(session, 400.0 * (numbers == np.unique(numbers)[4]))


def biased(session: Session) -> Session:
    readings = session.magnetometer
    return replace(session, magnetometer=readings.with_columns(field=readings.field + 8.0 * AXIS))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("change", "words"),
    [
        (late, "a clock of the star sensor 2 s ahead"),
        (bent, "an alignment that turns by 28″"),
        (moved, "a platform that moved by 20″ after orientation 10"),
        (one_off, "orientation 5, off by"),
        (biased, "the bias of the magnetometer (off by 7.9 nT"),
    ],
)
def test_the_cause_of_a_misfit_is_named(change: Callable[[Session], Session], words: str) -> None:
    fit = ag.fit_alignment(change(simulate_session(seed=3).session))
    (finding,) = [one for one in fit.findings if one.name == "session misfit"]
    assert f"; {words}" in finding.sentence
    assert finding.severity == "check"


def test_noise_alone_needs_no_explanation() -> None:
    for seed in range(8):
        fit = ag.fit_alignment(simulate_session(seed=seed, orientations=8).session)
        assert not find_explanations(
            fit.solution, fit.observed.time, fit.observed.orientation, fit.session.site
        )
