"""`Reference`: what the field should have been."""

import numpy as np
import pytest

import agonic as ag


def test_a_constant_holds_for_any_number_of_samples() -> None:
    reference = ag.Reference.constant(0.495, unit="G", sd=100.0, source="IGRF-14")
    assert reference.magnitudes(7) == pytest.approx([49_500.0])
    assert (reference.kind, reference.sd, reference.source) == ("constant", 100.0, "IGRF-14")


def test_magnitudes_go_with_their_samples() -> None:
    reference = ag.Reference.magnitude([49.0, 50.0], unit="uT")
    assert reference.magnitudes(2) == pytest.approx([49_000.0, 50_000.0])
    with pytest.raises(ag.UnitError, match="reference has 2 rows and the samples have 3"):
        reference.magnitudes(3)


def test_vectors_have_magnitudes_and_a_frame() -> None:
    reference = ag.Reference.vector([[3.0, 4.0, 0.0], [0.0, 5.0, 12.0]], frame="n", unit="uT")
    assert reference.frame == "n"
    assert reference.magnitudes(2) == pytest.approx([5000.0, 13_000.0])


@pytest.mark.parametrize(
    ("make", "value"),
    [
        (ag.Reference.constant, 0.0),
        (ag.Reference.constant, -1.0),
        (ag.Reference.constant, np.nan),
        (ag.Reference.magnitude, [1.0, np.inf]),
        (lambda v: ag.Reference.vector(v, frame="n"), [[0.0, 0.0, 0.0]]),
    ],
)
def test_a_field_must_be_above_zero(make, value) -> None:
    with pytest.raises(ag.UnitError, match="must be finite and above zero"):
        make(value)


def test_values_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="read-only"):
        ag.Reference.magnitude([1.0, 2.0]).values[0] = 3.0
