"""What training and retraining must doubt: references that do not belong, a sensor that drifts."""

import numpy as np
import pytest
from scipy.signal import lfilter

import agonic as ag
from agonic.network.fit import fit_network
from agonic.network.retraining import Retrainer
from agonic.network.simulate import SimulatedField, simulate_nonaffine, simulate_paper
from tests.network.test_retrainer import PARAMS, ground_of, streamed


@pytest.mark.parametrize("late", [0, 1])
def test_a_reference_that_does_not_belong_to_its_readings_is_doubted(late: int) -> None:
    made = simulate_nonaffine(n=1000, hysteresis=0.0, seed=1)
    reference = ag.Reference.vector(np.roll(made.field, late, axis=0), frame=made.samples.frame)
    fit = fit_network(made.samples, reference, hidden=3, compared=False, restarts=1)
    assert ("targets" in {finding.name for finding in fit.findings}) == bool(late)
    assert fit.verdict == ("check" if late else "good")


def stream(seed: int, drift: float, memory: float) -> SimulatedField:
    """The sensor of the paper before it changes, three times over, with a drift or slow noise."""
    made = simulate_paper(15.0, directions="space", noise=0.0)
    known = np.tile(made.field, (3, 1))
    white = 2.0 * np.random.default_rng(seed).standard_normal(known.shape)
    noise = lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], white, axis=0)
    noise += np.outer(np.linspace(0, 1, len(known)), [drift, drift, -drift])
    samples = ag.Samples(
        time=np.arange(len(known)) / 100.0,
        field=np.tile(made.samples.field, (3, 1)) + noise,
        unit="nT",
    )
    return SimulatedField(samples=samples, field=known, facts={})


def test_a_residual_that_drifts_through_the_window_is_told() -> None:
    """It was left at 19 nT, of 2 of noise, and nothing said."""
    told = 0
    for seed in range(3):
        made = stream(seed, 24.0, 0.0)
        retrainer = Retrainer(ground_of(made), PARAMS)
        streamed(retrainer, made.select(slice(1500, None)), 3000)
        told += "residual drifts" in {finding.name for finding in retrainer.findings}
    assert told >= 2


@pytest.mark.parametrize("memory", [0.0, 0.9, 0.98])
def test_slow_noise_is_no_drift(memory: float) -> None:
    for seed in range(3):
        made = stream(seed, 0.0, memory)
        retrainer = Retrainer(ground_of(made), PARAMS)
        streamed(retrainer, made.select(slice(1500, None)), 3000)
        assert "residual drifts" not in {finding.name for finding in retrainer.findings}
