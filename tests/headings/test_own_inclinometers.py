"""Two whole compasses: each magnetometer with an inclinometer of its own."""

import csv
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup

FIELD_N = (20_000.0, 0.0, 43_000.0)
LEANS = {"mag1": (0.0, 0.0), "mag2": (6.0, -4.0)}
"""How each housing leans in the vehicle, roll and pitch, degrees."""


def write_log(path: Path, roll: str, pitch: str) -> np.ndarray:
    """A log whose sensors have columns of roll and pitch so named; the headings they have."""
    rng = np.random.default_rng(4)
    heading = rng.uniform(0, 360, 200)
    rows: dict[str, np.ndarray] = {"time_s": np.arange(200.0)}
    for sensor, lean in LEANS.items():
        tilt = rng.uniform(-20, 20, (200, 2)) + lean
        turned = Rotation.from_euler("ZYX", np.column_stack([heading, tilt[:, ::-1]]), degrees=True)
        field = turned.inv().apply(FIELD_N)
        number = sensor[-1]
        rows |= {f"{sensor}_{axis}_nT": field[:, k] for k, axis in enumerate("xyz")}
        rows |= {roll.format(number): tilt[:, 0], pitch.format(number): tilt[:, 1]}
    with path.open("w", newline="") as file:
        table = csv.writer(file)
        table.writerow(rows)
        table.writerows(zip(*rows.values(), strict=True))
    return heading


def make_setup() -> Setup:
    compasses = tuple(
        Compass(calibration=Affine(bias=np.zeros(3), matrix=np.eye(3), noise=10.0, sensor=name))
        for name in LEANS
    )
    return Setup(compasses=compasses, declination_deg=0.0)


@pytest.mark.parametrize(
    "names", [("roll{}_deg", "pitch{}_deg"), ("mag{}_roll_deg", "mag{}_pitch_deg")]
)
def test_each_compass_is_levelled_by_its_own_inclinometer(
    names: tuple[str, str], tmp_path: Path
) -> None:
    truth = write_log(tmp_path / "pair.csv", *names)
    pair = [ag.read(tmp_path / "pair.csv", sensor=name) for name in LEANS]
    found = ag.heading(pair, make_setup(), smooth=False)
    assert np.abs((found.true_deg - truth + 180) % 360 - 180).max() < 1e-6
    assert found.disagreement_deg.max() < 1e-6


def test_a_level_reading_of_one_inclinometer_shows_as_disagreement(tmp_path: Path) -> None:
    """Nothing is shared behind its back: what the second inclinometer reads turns the second."""
    write_log(tmp_path / "pair.csv", "roll{}_deg", "pitch{}_deg")
    first, second = (ag.read(tmp_path / "pair.csv", sensor=name) for name in LEANS)
    wrong = second.with_columns(roll_deg=second.roll_deg + 2.0)
    found = ag.heading([first, wrong], make_setup(), smooth=False)
    assert 2.0 < found.disagreement_deg.max() < 10.0
