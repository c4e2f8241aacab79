"""The attitude of another file at the rows of a log."""

from datetime import UTC, datetime, timedelta

import numpy as np
import pytest

import agonic as ag
from agonic.errors import LogError
from agonic.logs.other_instrument import read_attitude_beside

START = datetime(2026, 5, 1, 12, tzinfo=UTC)


def make_samples(epoch=None):
    time = np.arange(0.0, 10.0, 0.5)
    return ag.Samples(field=np.tile([20e3, 0, 40e3], (20, 1)), time=time, epoch=epoch)


def test_a_table_is_interpolated_the_short_way_round(tmp_path):
    path = tmp_path / "truth.csv"
    path.write_text("time_s,heading_deg\n1,350\n2,10\n3,30\n")
    rows, beside = read_attitude_beside(path, make_samples())
    assert rows.time.tolist() == [1.0, 1.5, 2.0, 2.5, 3.0]
    assert beside.heading_deg.tolist() == [350.0, 0.0, 10.0, 20.0, 30.0]
    assert beside.source.name == "truth.csv"


def test_radians_and_roll_and_pitch_are_read(tmp_path):
    path = tmp_path / "truth.csv"
    rows = "".join(f"{t},{a},{a / 2},0.1\n" for t, a in enumerate(np.linspace(0, 3, 11)))
    path.write_text("time_s,heading_rad,roll_rad,pitch_rad\n" + rows)
    _, beside = read_attitude_beside(path, make_samples())
    assert beside.heading_deg[-1] == pytest.approx(np.degrees(0.3 * 9.5))
    assert beside.pitch_deg == pytest.approx(np.degrees(0.1))


def test_dates_put_two_clocks_together(tmp_path):
    path = tmp_path / "other.csv"
    moments = [START + timedelta(seconds=k) for k in range(2, 6)]
    rows = "".join(f"{m.isoformat()},{40 + k},20,0,40\n" for k, m in enumerate(moments))
    path.write_text("time,heading_deg,mag_x_uT,mag_y_uT,mag_z_uT\n" + rows)
    rows, beside = read_attitude_beside(path, make_samples(START))
    assert rows.time[0] == 2.0
    assert beside.heading_deg[0] == 40.0


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("time_s,heading_deg\n50,10\n60,20\n", "never meet"),
        ("time_s,roll_deg\n1,10\n2,20\n", "heading_deg"),
        ("heading_deg\n10\n20\n", "time_s"),
    ],
)
def test_what_cannot_be_used_is_said(tmp_path, text, said):
    path = tmp_path / "truth.csv"
    path.write_text(text)
    with pytest.raises(LogError, match=said):
        read_attitude_beside(path, make_samples())
