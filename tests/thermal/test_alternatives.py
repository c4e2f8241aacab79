"""What a model lacks in a coil: told by what foretells blocks that no fit has seen."""

import numpy as np
import pytest

import agonic as ag
from agonic.thermal.fit.fit import fit_thermal
from agonic.thermal.maths.known_field import FIELD, NETWORK, TEMPERATURE
from tests.thermal.coil import simulate_thermal_coil


def fit(spoil=None, n: int = 3000, cycles: int = 1):
    made = simulate_thermal_coil(8 * n, seed=1)  # of which every eighth: five to a field
    field = made.reference.values[::8]
    samples = made.samples.select(np.arange(0, 8 * n, 8))
    if cycles > 1:  # the same programme again and again, as the truth has it at each temperature
        order = np.arange(n) * cycles % n
        samples = samples.with_columns(
            field=samples.field[order], temperature=samples.temperature[order]
        )
        field = field[order]
    raw = samples.field if spoil is None else samples.field + spoil(samples.temperature, field)
    known = ag.Reference.vector(field, frame="b", source="a coil")
    return fit_thermal(samples.with_columns(field=raw), known, degree=2, rate=False)


def backlash(values: np.ndarray, width: float) -> np.ndarray:
    """Written down once more: the value that is dragged along at a distance."""
    at, made = values[0].copy(), np.empty_like(values)
    for k, value in enumerate(values):
        at = np.minimum(np.maximum(at, value - width), value + width)
        made[k] = at
    return made - values


def lag_in_temperature(level: np.ndarray, field: np.ndarray) -> np.ndarray:
    return backlash(level[:, None], 2.0) / 2.0 * np.array([200.0, -150.0, 90.0])


def remanence(level: np.ndarray, field: np.ndarray) -> np.ndarray:
    return 250.0 * backlash(field, 9000.0) / 9000.0


def compression(level: np.ndarray, field: np.ndarray) -> np.ndarray:
    return -2500.0 * (field / 5e4) ** 3


def test_a_model_that_lacks_nothing_is_left_alone() -> None:
    found = fit()
    assert found.ok
    assert "not in the model" not in {f.name for f in found.findings}
    assert all(left > 0.98 * found.unseen_rms for left in found.alternatives.values())
    assert "Neither hysteresis nor a network" in found.status


@pytest.mark.parametrize(
    ("name", "spoil", "cycles"),
    [
        (TEMPERATURE, lag_in_temperature, 7),
        (FIELD, remanence, 1),
        (NETWORK, compression, 1),
    ],
)
def test_what_is_missing_is_named_with_what_it_would_gain(name, spoil, cycles) -> None:
    found = fit(spoil, cycles=cycles)
    best = min(found.alternatives, key=lambda key: found.alternatives[key])
    assert best == name
    told = next(f for f in found.findings if f.name == "not in the model")
    assert name in told.what
    # all that noise of 70 nT leaves is the least that any model can reach
    assert 68.0 < found.alternatives[name] < 0.8 * found.unseen_rms
    if name is not NETWORK:
        assert found.alternatives[name] == pytest.approx(70.0, rel=0.12)


def test_few_readings_are_not_compared() -> None:
    made = simulate_thermal_coil(200, seed=1)
    found = fit_thermal(made.samples, made.reference, degree=1)
    assert found.alternatives == {}
    assert found.unseen_rms == pytest.approx(70.0, rel=0.3)
