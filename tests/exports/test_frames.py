"""Data frames of pandas: samples in and out, and corrected in place of their columns."""

import numpy as np
import pytest

import agonic as ag
from agonic.simulation import simulate

pandas = pytest.importorskip("pandas")
SAMPLES = simulate("hand", n=300, seed=1).samples
CALIBRATION = ag.Affine(bias=[1000.0, -500.0, 30.0], matrix=np.diag([1.1, 0.9, 1.0]))


def test_samples_come_back_from_a_frame():
    frame = ag.to_pandas(SAMPLES)
    back = ag.from_pandas(frame)
    for name, column in SAMPLES.columns().items():
        assert getattr(back, name) == pytest.approx(column), name
    dated = SAMPLES.with_columns(epoch=pandas.Timestamp("2026-05-01T10:00Z").to_pydatetime())
    frame = ag.to_pandas(dated)
    assert frame.index[0] == pandas.Timestamp("2026-05-01T10:00Z")
    back = ag.from_pandas(frame)
    assert back.epoch == dated.epoch
    assert back.time == pytest.approx(dated.time)


@pytest.mark.parametrize(("unit", "scale"), [("nT", 1.0), ("uT", 1e-3), ("mG", 1e-2)])
def test_a_frame_keeps_its_index_columns_and_unit(unit, scale):
    index = pandas.date_range("2026-05-01", periods=300, freq="20ms")
    table = {"note": ["a"] * 300}
    table |= {f"mag_{axis}_{unit}": SAMPLES.field[:, k] * scale for k, axis in enumerate("xyz")}
    frame = pandas.DataFrame(table, index=index)
    frame.iloc[7, 1] = np.nan
    found = ag.apply(CALIBRATION, frame)
    assert found.index.equals(index)
    assert list(found.columns) == list(frame.columns)
    expected = CALIBRATION.correct(SAMPLES.field) * scale
    readings = found.iloc[:, 1:].to_numpy(dtype=float)
    assert np.isnan(readings[7]).all()
    assert np.delete(readings, 7, 0) == pytest.approx(np.delete(expected, 7, 0))
    assert frame.iloc[0, 1] == SAMPLES.field[0, 0] * scale


def test_a_frame_without_one_magnetometer_is_told():
    with pytest.raises(ag.AgonicError, match="0 magnetometers"):
        ag.apply(CALIBRATION, pandas.DataFrame({"speed": [1.0]}))
    with pytest.raises(ag.AgonicError, match="data frame"):
        ag.from_pandas(SAMPLES)
