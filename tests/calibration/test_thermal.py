"""`Thermal`: the equation, its range, its uncertainty, in samples, chains and files."""

import json
import warnings
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.affine import Affine
from agonic.calibration.alignment import Alignment
from agonic.calibration.base import Validity
from agonic.calibration.chain import Chain
from agonic.calibration.encoding import schema
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, AgonicWarning, LogError
from agonic.files.calibration import load, save

BIAS = np.array([[100.0, -200.0, 50.0], [800.0, 0.0, -300.0], [10.0, 20.0, 30.0]])
MATRIX = np.array(
    [
        [[1.1, 0.02, -0.03], [0.02, 0.9, 0.04], [-0.03, 0.04, 1.0]],
        [[0.01, 0.0, 0.002], [0.0, -0.01, 0.0], [0.002, 0.0, 0.005]],
        np.zeros((3, 3)),
    ]
)


def made(**more) -> Thermal:
    facts = {"validity": Validity(temperature_C=(-10.0, 50.0)), "magnitude": 48_000.0} | more
    return Thermal(bias=BIAS, matrix=MATRIX, centre_C=20.0, half_range_C=30.0, **facts)


def covariance(size: int = 27) -> np.ndarray:
    rng = np.random.default_rng(0)
    scale = np.concatenate([np.full(9, 3.0), np.full(18, 1e-4), np.full(size - 27, 20.0)])
    root = rng.normal(size=(size, size)) * scale[:, None]
    return root @ root.T / size


def test_the_correction_is_the_equation() -> None:
    raw, t = np.array([[2e4, -1e4, 4e4], [1e3, 2e3, 3e3]]), np.array([-10.0, 35.0])
    for row, level, found in zip(raw, t, made().correct(raw, temperature=t), strict=True):
        x = (level - 20.0) / 30.0
        bias = BIAS[0] + x * BIAS[1] + x**2 * BIAS[2]
        assert found == pytest.approx((MATRIX[0] + x * MATRIX[1]) @ (row - bias))
        assert made().at(level).correct(row) == pytest.approx(found)
    assert made().correct(raw, temperature=20.0) == pytest.approx((raw - BIAS[0]) @ MATRIX[0].T)


def test_the_rate_adds_to_the_bias() -> None:
    lagging = made(rate=[6000.0, 0.0, -3000.0])
    raw = np.array([[2e4, 1e4, 4e4]])
    plain = made().correct(raw - [60.0, 0.0, -30.0], temperature=[5.0])
    assert lagging.correct(raw, temperature=[5.0], temperature_rate=[0.01]) == pytest.approx(plain)
    assert lagging.correct(raw, temperature=[5.0]) == pytest.approx(
        made().correct(raw, temperature=[5.0])
    )
    assert lagging.needs == ("temperature", "temperature_rate")
    t = 20.0 + 0.01 * np.arange(600.0)
    samples = ag.Samples(field=np.tile(raw, (600, 1)), temperature=t, time=np.arange(600.0))
    assert ag.apply(lagging, samples).field == pytest.approx(
        made().correct(samples.field - [60.0, 0.0, -30.0], temperature=t), abs=1e-3
    )
    with pytest.raises(LogError, match="temperature_rate"):
        ag.apply(lagging, samples.with_columns(time=None))


@pytest.mark.slow
@pytest.mark.parametrize("gauge", ["symmetric", "free"])
@pytest.mark.parametrize("rate", [None, [500.0, -300.0, 100.0]])
def test_uncertainty_is_that_of_many_draws(gauge: str, rate) -> None:
    count = (27 if gauge == "symmetric" else 36) + (0 if rate is None else 3)
    base = made(gauge=gauge, rate=rate, covariance=covariance(count))
    raw, columns = np.array([[2e4, -1.5e4, 4e4]]), {"temperature": [41.0]}
    if rate is not None:
        columns["temperature_rate"] = [0.02]
    order = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (1, 0), (2, 0), (2, 1)]
    fields = []
    for step in np.random.default_rng(1).multivariate_normal(
        np.zeros(count), base.covariance, 4000
    ):
        bias, matrix = BIAS + step[:9].reshape(3, 3).T, MATRIX.copy()
        for k, (i, j) in enumerate(order[: 6 if gauge == "symmetric" else 9]):
            matrix[:, i, j] += step[9 + 3 * k : 12 + 3 * k]
            if gauge == "symmetric" and i != j:
                matrix[:, j, i] += step[9 + 3 * k : 12 + 3 * k]
        moved = None if rate is None else np.asarray(rate) + step[-3:]
        fields.append(
            Thermal(bias=bias, matrix=matrix, centre_C=20.0, half_range_C=30.0, rate=moved).correct(
                raw, **columns
            )[0]
        )
    expected = np.cov(np.array(fields).T)
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    assert np.abs(base.uncertainty(raw, **columns)[0] - expected).max() < 0.1 * scale.max()
    if rate is None:
        held = base.at(41.0)
        assert held.uncertainty(raw) == pytest.approx(base.uncertainty(raw, **columns), rel=1e-9)
        assert base.sd_at(41.0) == pytest.approx(held.sd)
        assert base.sd_at([0.0, 41.0])[1] == pytest.approx(held.sd)


def test_beyond_the_range_it_warns() -> None:
    raw, t = np.tile([2e4, 0.0, 4e4], (4, 1)), np.array([-30.0, 0.0, 50.3, 61.0])
    assert made().outside(t).tolist() == [True, False, False, True]
    with pytest.warns(AgonicWarning, match="2 temperatures from -30.0 to 61.0 °C.*extrapolated"):
        made().correct(raw, temperature=t)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        made().correct(raw, temperature=[-10.2, 0.0, 20.0, 50.0])
        made(validity=Validity()).correct(raw, temperature=t)


def test_what_is_missing_is_told() -> None:
    with pytest.raises(AgonicError, match="needs the temperature"):
        made().correct([[1.0, 2.0, 3.0]])
    with pytest.raises(LogError, match="temperature"):
        ag.apply(made(), ag.Samples(field=[[1.0, 2.0, 3.0]]))
    with pytest.raises(AgonicError, match="no covariance"):
        made().uncertainty([[1.0, 2.0, 3.0]], temperature=[0.0])
    with pytest.raises(AgonicError, match="above 0"):
        Thermal(bias=BIAS, matrix=MATRIX, centre_C=20.0, half_range_C=0.0)
    with pytest.raises(AgonicError, match="matrix"):
        Thermal(bias=BIAS, matrix=MATRIX[:2], centre_C=20.0, half_range_C=1.0)
    with pytest.raises(AgonicError, match="covariance"):
        made(covariance=np.eye(9))


def test_it_is_a_step_of_a_chain() -> None:
    turn = Alignment(rotation=Rotation.from_euler("z", 90, degrees=True))
    chain = Chain(steps=(made(), turn))
    raw, t = np.array([[2e4, 1e4, 4e4]]), [35.0]
    expected = made().correct(raw, temperature=t) @ turn.rotation.as_matrix().T
    assert chain.needs == ("temperature",)
    assert chain.correct(raw, temperature=t) == pytest.approx(expected)
    assert chain.at(35.0).correct(raw) == pytest.approx(expected)
    assert chain.at(35.0).composed.correct(raw) == pytest.approx(expected)
    with pytest.raises(AgonicError, match=r"chain\.at"):
        _ = chain.composed


@pytest.mark.parametrize("rate", [None, (1.5, -2.5, 0.1)])
def test_every_number_comes_back_exactly_from_a_file(tmp_path: Path, rate) -> None:
    before = made(rate=rate, covariance=covariance(27 if rate is None else 30), noise=99.7)
    path = save(before, tmp_path / "warm.json")
    back = load(path)
    assert isinstance(back, Thermal)
    for name in ("bias", "matrix", "covariance", "rate"):
        ours, theirs = getattr(before, name), getattr(back, name)
        assert (ours is None and theirs is None) or (np.asarray(ours) == theirs).all()
    for name in (
        "centre_C",
        "half_range_C",
        "validity",
        "magnitude",
        "noise",
        "gauge",
        "unit_in",
        "sensor",
        "provenance",
        "equation",
    ):
        assert getattr(back, name) == getattr(before, name)
    jsonschema.validate(json.loads(path.read_text()), schema())
    chain = Chain(steps=(back, Affine(bias=np.zeros(3), matrix=np.eye(3))))
    assert isinstance(load(save(chain, tmp_path / "chain.json")).steps[0], Thermal)


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    path = save(made(), tmp_path / "warm.json")
    path.write_text(path.read_text().replace('"half_range_C": 30.0', '"half_range_C": -1.0'))
    with pytest.raises(LogError, match="not a usable calibration file"):
        load(path)


def test_the_equation_says_what_it_is() -> None:
    assert made(rate=[1.0, 0.0, 0.0]).equation == (
        "field [nT] = matrix(T) @ (raw [nT] - bias(T) - rate * dT/dt), polynomials of order 2 in "
        "x = (T [°C] - 20) / 30"
    )
    assert len(made().parameters) == 27
    assert made(gauge="free").parameters[9:12] == ("matrix_xx_0", "matrix_xx_1", "matrix_xx_2")
