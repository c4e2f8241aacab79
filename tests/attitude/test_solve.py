"""Estimates that start from those with fewer sources."""

import numpy as np

from agonic.attitude.fit import fit_channels_alone
from agonic.attitude.problem import normalise
from agonic.attitude.settings import Settings
from agonic.attitude.solve import estimate_beside, estimate_usable
from agonic.maths.equation.affine import FREE
from agonic.reference import Reference
from agonic.simulation import simulate

LEVELLED = ("magnitude", "dip")


def test_a_fit_with_a_source_is_the_same_from_the_fit_without():
    flown = simulate("flight", n=3000, noise=100.0, seed=2)
    samples = flown.samples
    reference = Reference.vector(flown.field_n, frame="n")
    usable, plain = np.ones(len(samples), dtype=bool), Settings()
    joined = Settings(sources=("current_A",))
    before = estimate_usable(normalise(samples, reference, LEVELLED, FREE, plain)[0], usable, plain)
    problem, _ = normalise(samples, reference, LEVELLED, FREE, joined)
    known = {(): before}
    anew = estimate_usable(problem, usable, joined).solution
    found = estimate_beside(known, problem, usable, joined).solution
    moved = np.abs(found.params - anew.params) / np.sqrt(np.diag(anew.covariance))
    assert moved.max() < 0.05
    assert estimate_beside(known, problem, usable, plain) is before
    one, other = (
        fit_channels_alone(samples, reference, LEVELLED, joined, known=given)
        for given in (None, known)
    )
    assert np.allclose(one.coefficients, other.coefficients, rtol=0.01)
