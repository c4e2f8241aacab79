"""One file of parameters for all compasses of a vehicle."""

from __future__ import annotations

import numpy as np
import pytest

from agonic.calibration.affine import Affine
from agonic.calibration.setup import Compass, Setup
from agonic.cli import run
from agonic.exports.targets import write_vehicle
from agonic.files.calibration import save
from agonic.files.setup import save_setup
from tests.exports.read_back import apply_ardupilot, apply_px4, parse_ardupilot, parse_px4

COMPASSES = {
    name: Affine(
        bias=[3000.0 * k, -100.0, 50.0], matrix=np.eye(3) * (1 + 0.05 * k), sensor=name,
        frame_in="b", frame_out="b", device_id=100 + k,
    )
    for k, name in enumerate(("MAG", "MAG2"), start=1)
}  # fmt: skip
RAW = np.array([[20_000.0, -5000.0, 30_000.0]])


def test_each_compass_keeps_its_own_numbers_and_is_used_or_not(tmp_path) -> None:
    path = write_vehicle("ardupilot", COMPASSES, tmp_path / "all.param", unused=("MAG3",)).path
    found = parse_ardupilot(path)
    for k, calibration in enumerate(COMPASSES.values(), start=1):
        seen = 100.0 * apply_ardupilot(found, RAW / 100.0, compass=k)
        assert seen == pytest.approx(calibration.correct(RAW), abs=0.5)
    assert [found[f"COMPASS_USE{n}"] for n in ("", "2", "3")] == [1, 1, 0]
    assert "COMPASS_OFS3_X" not in found


def test_px4_slots_follow_the_numbers_of_the_sensors(tmp_path) -> None:
    own = {
        f"sensor_mag[{k}]": Affine(bias=[900.0 * k, 0, 0], matrix=np.eye(3), device_id=7 + k)
        for k in range(2)
    }
    found = parse_px4(write_vehicle("px4", own, tmp_path / "all.params").path)
    for k, calibration in enumerate(own.values()):
        seen = 1e5 * apply_px4(found, RAW / 1e5, slot=k)
        assert seen == pytest.approx(calibration.correct(RAW), abs=0.5)
        assert (found[f"CAL_MAG{k}_PRIO"], found[f"CAL_MAG{k}_ID"]) == (50, 7 + k)


def test_a_setup_is_exported_as_a_whole(tmp_path, capsys) -> None:
    saved = {n: save(c, tmp_path / f"{n}.json").name for n, c in COMPASSES.items()}
    setup = Setup(compasses=tuple(Compass(calibration=c) for c in COMPASSES.values()))
    named = str(save_setup(setup, tmp_path / "setup.toml", saved=saved))
    assert run(["export", named, "--to", "ardupilot", "-o", str(tmp_path / "all.param")]) == 0
    found = parse_ardupilot(tmp_path / "all.param")
    assert found["COMPASS_OFS2_X"] == pytest.approx(-60.0)
