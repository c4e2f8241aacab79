"""What calibrations share: validated numbers, and applying one to samples."""

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.base import read_only
from agonic.samples import Logged
from agonic.simulation import random_calibration, simulate


def test_numbers_are_copied_checked_and_locked() -> None:
    given = np.ones(3)
    kept = read_only("bias", given, (3,))
    given[0] = 7.0
    assert kept[0] == 1.0
    with pytest.raises(ValueError, match="read-only"):
        kept[0] = 2.0
    for wrong in ([1.0, 2.0], [1.0, np.nan, 3.0], [[1.0, 2.0, 3.0]]):
        with pytest.raises(ag.AgonicError, match=r"bias must be finite numbers of shape \(3,\)"):
            read_only("bias", wrong, (3,))


def test_apply_undoes_what_the_sensor_did() -> None:
    made = simulate("tumble", n=100, noise=0.0)
    field = ag.apply(made.truth, made.samples).field
    assert np.abs(field - made.field_b).max() < 1e-6


def test_apply_keeps_the_other_columns_and_forgets_the_logged_correction() -> None:
    logged = Logged(bias=np.zeros(3), matrix=np.eye(3), source="test")
    samples = simulate("tumble", n=50).samples.with_columns(logged=logged, name="MAG2")
    corrected = ag.apply(random_calibration(np.random.default_rng(0)), samples)
    assert corrected.logged is None
    assert corrected.name == "MAG2"
    assert np.array_equal(corrected.heading_deg, samples.heading_deg)


def test_apply_gives_unit_and_frame_of_the_calibration() -> None:
    counts = ag.Samples(field=[[10.0, 0.0, 0.0]], unit="counts")
    affine = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3) * 100, unit_in="raw", frame_out="b")
    corrected = ag.apply(affine, counts)
    assert (corrected.unit, corrected.frame) == ("nT", "b")
    assert corrected.field.tolist() == [[1000.0, 0.0, 0.0]]


def test_apply_refuses_what_does_not_meet() -> None:
    affine = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3))
    with pytest.raises(ag.UnitError, match=r"readings in nT and these are in raw; read the log"):
        ag.apply(affine, ag.Samples(field=[[1.0, 2, 3]], unit="raw"))
    with pytest.raises(ag.FrameError, match=r"b does not meet m") as caught:
        ag.apply(affine, ag.Samples(field=[[1.0, 2, 3]], frame="b"))
    assert (caught.value.left, caught.value.right) == ("b", "m")
