"""The equation of vectors in two frames: its Jacobian, and one solution for all instruments."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from agonic.alignment.maths import two_frames as kernel
from agonic.alignment.maths.two_frames import SIZE, Measured, make_prior, solve
from agonic.maths.rotations.attitude import make_rotation


def measure(rng: np.random.Generator, count: int, noise: float = 1.0) -> Measured:
    """Orientations at random with a field of about 50 000 nT, its truth R_mc = 1."""
    reference = np.array([18_870.0, 1_390.0, 45_750.0]) + rng.normal(0, 30, (count, 3))
    rot_cn = Rotation.random(count, rng=rng).as_matrix()
    field = np.einsum("kij,kj->ki", rot_cn, reference) + noise * rng.standard_normal((count, 3))
    spread = np.broadcast_to(1e-14 * np.eye(3), (count, 3, 3))
    return Measured(field, reference, rot_cn, spread, np.full(count, noise), np.zeros(count))


def test_the_jacobian() -> None:
    rng = np.random.default_rng(0)
    measured = measure(rng, 5)
    at = kernel.Unknowns(offset=np.array([4.0, -3.0, 2.0])).add_step(
        0.1 * rng.standard_normal(SIZE)
    )
    _, jacobian = kernel.compute_residual(at, measured)
    for k in range(SIZE):
        step = np.zeros(SIZE)
        step[k] = 1e-6 if kernel.find_unit_sizes(1e4)[k] > 1 else 1e-2
        ahead, behind = (
            kernel.compute_residual(at.add_step(s), measured)[0] for s in (step, -step)
        )
        slope = (ahead - behind) / (2 * step[k])
        np.testing.assert_allclose(jacobian[:, :, k], slope, rtol=1e-5, atol=1e-3)


@pytest.mark.parametrize("groups", [(), ("bias",), ("bias", "matrix"), ("reference", "pier")])
def test_errors_are_as_large_as_stated(groups: tuple[str, ...]) -> None:
    z = []
    for seed in range(60):
        found = solve(
            measure(np.random.default_rng(seed), 16),
            make_prior({"alignment", *groups}, 5.0, (20.0, 20.0, 20.0) if groups else None),
        )
        off = Rotation.from_matrix(found.unknowns.rot_mc).as_rotvec()
        z.append(off @ np.linalg.solve(found.covariance[:3, :3], off) / 3)
    assert np.mean(z) == pytest.approx(1.0, abs=0.3)


def test_a_prior_is_one_more_measurement() -> None:
    """The pier known to 2 nT and seen to 2 nT by its own readings is known to 1.4 nT."""
    measured = measure(np.random.default_rng(3), 12, noise=2.0)
    free = solve(measured, make_prior({"alignment", "pier"}))
    sd = float(np.sqrt(free.covariance[6, 6]))
    both = solve(measured, make_prior({"alignment"}, sd))
    assert both.groups == ("alignment", "pier")
    assert np.sqrt(both.covariance[6, 6]) == pytest.approx(sd / np.sqrt(2), rel=0.1)
    assert both.freedom == free.freedom + 3


def test_one_direction_of_each_vector_tells_the_turn() -> None:
    """As an accelerometer does, that reads down and nothing else."""
    rng = np.random.default_rng(5)
    measured = measure(rng, 20)
    turned = measured._replace(field=measured.field @ make_rotation([0.02, -0.01, 0.03]).T)
    along = turned._replace(
        along=turned.rot_cn[:, :, 2],
        reference=np.zeros((20, 3)),
        noise=np.full(20, 50.0),
    )
    prior = make_prior({"alignment"})
    prior[8] = 0.0
    found = solve(along, prior, (0.0, 0.0, 45_000.0), np.eye(3))
    off = found.unknowns.rot_mc @ make_rotation([0.02, -0.01, 0.03]).T
    assert Rotation.from_matrix(off).magnitude() < 3e-3
    assert found.unknowns.offset[2] == pytest.approx(45_750.0, abs=60.0)
    assert found.freedom == 16
