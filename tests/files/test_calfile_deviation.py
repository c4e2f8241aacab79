"""A deviation card in the calibration file."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest

from agonic.calibration.encoding import schema
from agonic.calibration.steps import require_calibration
from agonic.errors import AgonicError, LogError
from agonic.files.calibration import load, save
from agonic.headings.deviation import fit_deviation


@pytest.fixture
def card():
    rng = np.random.default_rng(0)
    compass, roll = rng.uniform(0, 360, 60), rng.normal(0, 10, 60)
    return fit_deviation(
        compass, compass + rng.normal(size=60), heel=roll, power_state="hover", current_A=21.5
    ).calibration


def test_every_number_comes_back_exactly(tmp_path: Path, card) -> None:
    path = save(card, tmp_path / "card.json")
    back = load(path)
    for name in ("coefficients", "heel", "covariance"):
        assert (getattr(back, name) == getattr(card, name)).all()
    for name in (
        "terms",
        "noise_deg",
        "freedom",
        "power_state",
        "current_A",
        "largest_gap_deg",
        "largest_heel_deg",
        "sensor",
        "provenance",
    ):
        assert getattr(back, name) == getattr(card, name)
    jsonschema.validate(json.loads(path.read_text()), schema())


def test_a_damaged_card_is_refused(tmp_path: Path, card) -> None:
    path = save(card, tmp_path / "card.json")
    path.write_text(path.read_text().replace('"terms": "ABCDE"', '"terms": "ABCDF"'))
    with pytest.raises(LogError, match="not a usable calibration file"):
        load(path)


def test_it_is_no_calibration_of_readings(card) -> None:
    with pytest.raises(AgonicError, match="corrects headings"):
        require_calibration(card)
