"""The plan of a calibration: its errors are those of fits on what it tells to record."""

import numpy as np
import pytest

import agonic as ag
from agonic.ellipsoid.plan import plan_calibration
from agonic.errors import AgonicError
from agonic.maths.rotations.attitude import rot_nb
from tests.command_line import answer, complaint

FIELD, DIP = 48_000.0, 65.0


def readings(attitudes: np.ndarray, noise: float, seed: int, times: int = 1) -> ag.Samples:
    """What a sensor without errors of its own reads at the positions."""
    dip = np.radians(DIP)
    north = FIELD * np.array([np.cos(dip), 0.0, np.sin(dip)])
    attitudes = np.repeat(attitudes, times, axis=0)
    field = np.swapaxes(rot_nb(*attitudes.T), 1, 2) @ north
    rng = np.random.default_rng(seed)
    return ag.Samples(field=field + noise * rng.standard_normal(field.shape), unit="nT")


@pytest.mark.slow
@pytest.mark.parametrize("tilt_deg", [180.0, 60.0])
def test_fits_on_planned_sets_scatter_as_planned(tilt_deg: float) -> None:
    (sets,) = plan_calibration(noise=100.0, tilt_deg=tilt_deg, steps_deg=(10.0,))
    found = []
    for seed in range(40):
        samples = readings(sets.attitudes_deg, 100.0, seed, times=2)
        fit = ag.fit_ellipsoid(samples, ag.Reference.constant(FIELD), model="full", robust=False)
        found.append(fit.calibration.bias)
    scatter = np.sqrt(np.mean(np.square(found), axis=0))
    assert scatter == pytest.approx(sets.bias_sd / np.sqrt(2), rel=0.35)  # forty draws


def test_the_wanted_accuracy_sets_the_readings() -> None:
    plain = plan_calibration(steps_deg=(30.0,))[0]
    more = plan_calibration(steps_deg=(30.0,), wanted_deg=plain.heading_sd_deg / 3)[0]
    assert more.readings == pytest.approx(9, abs=1)
    assert more.heading_sd_deg <= plain.heading_sd_deg / 3


def test_without_tilt_only_attitude_helps() -> None:
    """A level turn tells nothing of what lies along down, and magnitudes alone not the dip."""
    alone = plan_calibration(tilt_deg=0.0, steps_deg=(10.0,))[0]
    aided = plan_calibration(tilt_deg=0.0, steps_deg=(10.0,), attitude_sd_deg=0.5)[0]
    assert not alone.determined
    assert aided.determined
    assert aided.heading_sd_deg < 0.5


def test_bad_numbers_are_named() -> None:
    with pytest.raises(AgonicError, match="an inclination within"):
        plan_calibration(inclination_deg=90.0)
    with pytest.raises(AgonicError, match="not 0°"):
        plan_calibration(steps_deg=(0.0,))


@pytest.mark.usefixtures("empty_folder")
def test_from_the_command_line(capsys, tmp_path) -> None:
    status, said = answer(capsys, "plan", "calibration", "--wanted", "0.3", "-o", "turns.csv")
    assert (status, said["schema"]) == (0, "agonic/plan-calibration@1")
    rows = (tmp_path / "turns.csv").read_text().splitlines()
    assert len(rows) == len(said["attitudes_deg"]) + 1
    assert answer(capsys, "plan", "calibration", "--tilt", "0")[0] == 1
    assert "inclination within" in complaint(capsys, "plan", "calibration", "--dip", "90")


def test_readings_are_not_counted_where_positions_do_not_determine_the_heading() -> None:
    sets = plan_calibration(tilt_deg=0.0, wanted_deg=0.1)
    assert [one.readings for one in sets] == [1] * len(sets)
