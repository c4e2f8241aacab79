"""The ellipsoid of raw readings: half axes and tilt against truth, and what is concluded."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.decomposition import find_raw_ellipsoid
from agonic.cli import run
from agonic.exports.csv import write_csv
from agonic.simulation.sensor import simulate

FIELD = 50_000.0


def truth_of(made):
    """The ellipsoid of the true calibration."""
    certain = replace(made.truth, covariance=1e-12 * np.eye(9), magnitude=FIELD)
    return find_raw_ellipsoid(certain)


@pytest.mark.slow
def test_errors_are_as_large_as_stated():
    """Over seeds, of sensors with gains, soft iron and axes that are not square.

    Near 45° which axis is nearest x is a matter of noise, and the tilt is no longer linear.
    """
    tilts, sizes = [], []
    for seed in range(30):
        made = simulate("tumble", n=500, noise=150.0, seed=seed)
        found = find_raw_ellipsoid(ag.fit_ellipsoid(made.samples, FIELD).calibration)
        true = truth_of(made)
        assert found.shape == true.shape == "tilted"
        order = np.argsort(found.half_axes)
        off = found.half_axes[order] - np.sort(true.half_axes)
        sizes.append(off / found.half_axes_sd[order])
        if true.tilt_deg.max() < 35.0:
            tilts.append((found.tilt_deg - true.tilt_deg) / found.tilt_sd_deg)
    assert len(tilts) > 12
    assert abs(np.mean(tilts)) < 0.5  # the three of a sensor go together
    assert abs(np.mean(sizes)) < 0.3
    assert 0.7 < np.std(tilts) < 1.3
    assert 0.7 < np.std(sizes) < 1.3


def test_a_known_ellipsoid_is_found():
    """Half axes 40, 50 and 60 µT, turned by 20° about z."""
    turn = Rotation.from_euler("z", 20, degrees=True).as_matrix()
    matrix = turn @ np.diag(FIELD / np.array([40e3, 50e3, 60e3])) @ turn.T
    known = ag.Affine(bias=np.zeros(3), matrix=matrix, covariance=1e-8 * np.eye(9), magnitude=FIELD)
    found = find_raw_ellipsoid(known)
    assert found.shape == "tilted"
    np.testing.assert_allclose(found.half_axes, [40e3, 50e3, 60e3])
    np.testing.assert_allclose(found.tilt_deg, [20.0, 20.0, 0.0], atol=1e-6)
    np.testing.assert_allclose(found.axes, turn.T, atol=1e-12)
    round_about = Rotation.from_euler("xyz", [10, 50, 70], degrees=True).as_matrix()
    free = replace(known, matrix=round_about @ matrix, gauge="free", covariance=1e-8 * np.eye(12))
    np.testing.assert_allclose(find_raw_ellipsoid(free).axes, found.axes, atol=1e-9)


@pytest.mark.parametrize(
    ("gains", "shape", "words"),
    [
        ([1.0, 1.0, 1.0], "sphere", "neither soft iron nor unequal gains"),
        ([1.0, 1.05, 0.95], "upright", "no soft iron across the axes"),
    ],
)
def test_unequal_gains_leave_it_upright(gains, shape, words, tmp_path, capsys):
    shapes = []
    for seed in range(5):
        made = simulate("tumble", n=600, seed=seed)
        raw = (made.samples.field - made.truth.bias) @ made.truth.matrix.T / np.array(gains)
        samples = made.samples.with_columns(field=raw + 1000.0)
        fit = ag.fit_ellipsoid(samples, FIELD)
        shapes.append(find_raw_ellipsoid(fit.calibration).shape)
    assert shapes.count(shape) == 5  # the tests are wrong once in a hundred
    if shapes[-1] == shape:
        log = write_csv(samples, tmp_path / "log.csv")
        assert run(["fit", "ellipsoid", str(log), "--field", "50000"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert all(word in said for word in (words, "Ellipsoid", "Scale", "Angles"))


@pytest.mark.slow
def test_json_has_ellipsoid_scale_factors_angles_and_turn(tmp_path, capsys):
    log = tmp_path / "flight.csv"
    assert run(["simulate", "vehicle", "-o", str(log), "-n", "1500", "--seed", "3"]) == 0
    capsys.readouterr()
    run(["fit", "vector", str(log), "--sensor", "mag1", "--json"])
    said = json.loads(capsys.readouterr().out)
    assert said["ellipsoid"]["shape"] in ("tilted", "upright", "sphere")
    for name in ("scale_factors", "nonorthogonality_deg", "turn_deg"):
        assert len(said[name]) == 3
    assert all(sd > 0 for sd in said["turn_sd_deg"])
