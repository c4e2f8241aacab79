"""`Network`: what it adds to its base, where, and how it is kept."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.base import apply
from agonic.calibration.network import Network
from agonic.calibration.sources import signals, stack_inputs
from agonic.errors import AgonicError, AgonicWarning, FrameError, UnitError
from agonic.maths.equation import network as kernel

BASE = ag.Affine(bias=[100.0, -50.0, 20.0], matrix=np.diag([1.0, 1.1, 0.9]), covariance=np.eye(9))
RNG = np.random.default_rng(4)
POINTS = RNG.uniform(-1, 1, (200, 4))


def bent(**changed) -> Network:
    """Three nodes of field and temperature on an affine base."""
    shape = kernel.Shape(4, 3, 3)
    u, v = kernel.split(np.random.default_rng(1).normal(size=shape.size), shape)
    facts = {
        "base": BASE,
        "inputs": ("field", "temperature"),
        "input_middle": [0.0, 0.0, 0.0, 20.0],
        "input_half": [5e4, 5e4, 5e4, 30.0],
        "output_middle": [1.0, 2.0, 3.0],
        "output_half": 100.0,
        "hidden": u,
        "output": v,
        "centres": POINTS,
        "reach": 1.0,
        "bound": 1e6,
        "misfit": 150.0,
        "covariance": 1e-6 * np.eye(shape.size),
    }
    return Network(**facts | changed)


RAW = RNG.uniform(-3e4, 3e4, (50, 3))
WARM = RNG.uniform(0, 40, 50)


def test_the_field_is_that_of_the_base_and_the_equation_of_the_network():
    network = bent()
    x = np.column_stack([RAW / 5e4, (WARM - 20.0) / 30.0])
    nodes = np.tanh(x @ network.hidden[:, :-1].T + network.hidden[:, -1])
    added = [1, 2, 3] + 100.0 * (nodes @ network.output[:, :-1].T + network.output[:, -1])
    wanted = BASE.correct(RAW) + added
    np.testing.assert_allclose(network.correct(RAW, temperature=WARM), wanted, rtol=1e-12)


def deep() -> Network:
    """Three nodes and then two."""
    shape = kernel.Shape(4, (3, 2), 3)
    u, w, v = kernel.split(np.random.default_rng(2).normal(size=shape.size), shape)
    return bent(hidden=u, second=w, output=v, covariance=1e-6 * np.eye(shape.size))


def test_a_second_layer_comes_between():
    network = deep()
    x = np.column_stack([RAW / 5e4, (WARM - 20.0) / 30.0, np.ones(50)])
    first = np.column_stack([np.tanh(x @ network.hidden.T), np.ones(50)])
    nodes = np.column_stack([np.tanh(first @ network.second.T), np.ones(50)])
    wanted = BASE.correct(RAW) + [1, 2, 3] + 100.0 * nodes @ network.output.T
    np.testing.assert_allclose(network.correct(RAW, temperature=WARM), wanted, rtol=1e-12)
    assert "3 and 2 nodes" in network.equation


def test_one_reading_is_corrected_as_many_are():
    network = bent()
    many = network.correct(RAW, temperature=WARM)
    np.testing.assert_allclose(network.correct(RAW[3], temperature=WARM[3]), many[3], rtol=1e-12)
    cube = network.correct(RAW.reshape(5, 10, 3), temperature=WARM.reshape(5, 10))
    np.testing.assert_allclose(cube.reshape(-1, 3), many, rtol=1e-12)


def test_the_correction_is_never_longer_than_its_bound():
    network = bent(bound=40.0)
    added = network.correct(RAW, temperature=WARM) - BASE.correct(RAW)
    assert np.linalg.norm(added, axis=1).max() == pytest.approx(40.0)


def test_far_away_the_base_is_left():
    network = bent()
    far = 50.0 * RAW + 1e5
    with pytest.warns(AgonicWarning, match="50 of 50 readings lie outside"):
        field = network.correct(far, temperature=WARM)
    np.testing.assert_array_equal(field, BASE.correct(far))
    assert network.outside(far, temperature=WARM).all()
    cold = np.full(50, -200.0)
    assert network.outside(RAW, temperature=cold).all()


def test_along_the_field_no_direction_changes():
    one = bent(output=np.ones((1, 4)), output_middle=[5.0], covariance=None)
    before = BASE.correct(RAW)
    after = one.correct(RAW, temperature=WARM)
    assert one.target == "magnitude"
    np.testing.assert_allclose(np.cross(before, after), 0.0, atol=1e-3)
    assert np.abs(np.linalg.norm(after - before, axis=1)).max() > 10.0


def test_without_a_base_the_network_gives_the_field():
    alone = bent(base=None, bound=None)
    x = alone.scaled(RAW, {"temperature": WARM})
    wanted = [1, 2, 3] + 100.0 * kernel.forward(alone.layers, x)
    np.testing.assert_allclose(alone.correct(RAW, temperature=WARM), wanted, rtol=1e-12)
    assert "without a base" in alone.equation


@pytest.mark.slow
def test_the_uncertainty_is_that_of_many_draws_of_the_weights():
    """Of base and weights drawn from their covariances, to first order."""
    tiny = 1e-8
    base = replace(BASE, covariance=np.diag([4.0] * 3 + [1e-8] * 6))
    network = bent(base=base, covariance=tiny * np.eye(27), misfit=0.0)
    rng = np.random.default_rng(0)
    fields = []
    for _ in range(4000):
        u, v = kernel.split(network.weights + np.sqrt(tiny) * rng.normal(size=27), network.shape)
        numbers = rng.normal(size=9) * np.sqrt(np.diag(base.covariance))
        xx, yy, zz, xy, xz, yz = numbers[3:]
        step = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        other = replace(base, bias=base.bias + numbers[:3], matrix=base.matrix + step)
        drawn = replace(network, hidden=u, output=v, base=other)
        fields.append(drawn.correct(RAW[:2], temperature=WARM[:2]))
    stated = network.uncertainty(RAW[:2], temperature=WARM[:2])
    for k in range(2):
        np.testing.assert_allclose(np.cov(np.array(fields)[:, k].T), stated[k], atol=0.6)
        assert np.diag(stated[k]).min() > 3.0


def test_outside_the_misfit_of_the_base_is_added():
    network = bent()
    far = 50.0 * RAW[:1] + 1e5
    extra = network.uncertainty(far, temperature=WARM[:1]) - BASE.uncertainty(far)
    np.testing.assert_allclose(extra[0], 150.0**2 * np.eye(3))


def test_held_at_a_temperature_it_needs_none():
    network = bent()
    held = network.at(30.0)
    assert network.needs == ("temperature",)
    assert held.needs == ()
    wanted = network.correct(RAW, temperature=np.full(50, 30.0))
    np.testing.assert_allclose(held.correct(RAW), wanted, rtol=1e-12)


def test_a_thermal_base_is_held_with_it():
    thermal = ag.thermal.Thermal(
        bias=[[1.0, 2.0, 3.0], [50.0, 0.0, 0.0]],
        matrix=[np.eye(3), np.zeros((3, 3))],
        centre_C=20.0,
        half_range_C=30.0,
    )
    network = bent(base=thermal)
    held = network.at(35.0)
    assert held.base.kind == "affine"
    wanted = network.correct(RAW, temperature=np.full(50, 35.0))
    np.testing.assert_allclose(held.correct(RAW), wanted, rtol=1e-12)


@pytest.mark.parametrize(
    "network",
    [
        bent(),
        bent(base=None, bound=None),
        bent().at(12.5),
        deep(),
        bent(output=np.ones((1, 4)), output_middle=[5.0], covariance=None),
    ],
)
def test_a_file_gives_it_back_float_for_float(network, tmp_path):
    path = ag.save(network, tmp_path / "bent.json")
    loaded = ag.load(path)
    columns = {} if network.held else {"temperature": WARM}
    np.testing.assert_array_equal(loaded.correct(RAW, **columns), network.correct(RAW, **columns))
    np.testing.assert_array_equal(loaded.weights, network.weights)
    assert ag.save(loaded, tmp_path / "again.json").read_bytes() == path.read_bytes()
    assert loaded.equation == network.equation


def test_it_is_a_step_of_a_chain():
    turn = ag.alignment.Alignment(
        rotation=Rotation.from_euler("z", 90, degrees=True), frame_in="m", frame_out="b"
    )
    chain = ag.Chain(steps=(bent(), turn))
    wanted = turn.correct(bent().correct(RAW, temperature=WARM))
    np.testing.assert_allclose(chain.correct(RAW, temperature=WARM), wanted)
    assert chain.needs == ("temperature",)
    np.testing.assert_allclose(
        chain.at(20.0).correct(RAW), bent().at(20.0).correct(RAW) @ turn.rotation.as_matrix().T
    )
    with pytest.raises(AgonicError, match="a step of this chain is a network"):
        _ = chain.composed


def test_a_chain_with_it_is_saved(tmp_path):
    chain = ag.Chain(steps=(bent(),))
    loaded = ag.load(ag.save(chain, tmp_path / "chain.json"))
    np.testing.assert_array_equal(
        loaded.correct(RAW, temperature=WARM), chain.correct(RAW, temperature=WARM)
    )


def test_samples_bring_their_columns():
    samples = ag.Samples(field=RAW, temperature=WARM)
    field = apply(bent(), samples).field
    np.testing.assert_array_equal(field, bent().correct(RAW, temperature=WARM))
    with pytest.raises(ag.LogError, match="needs temperature"):
        apply(bent(), ag.Samples(field=RAW))


def test_inputs_are_stacked_in_their_order():
    rows = stack_inputs(("temperature", "field"), [[1.0, 2.0, 3.0]], {"temperature": [9.0]})
    assert rows.tolist() == [[9.0, 1.0, 2.0, 3.0]]
    assert signals(("temperature", "field"))[0] == "temperature"
    with pytest.raises(AgonicError, match="needs temperature"):
        bent().correct(RAW)


@pytest.mark.parametrize(
    ("changed", "kind", "words"),
    [
        ({"inputs": ("field", "field")}, AgonicError, "each once"),
        ({"inputs": ()}, AgonicError, "given: none"),
        ({"input_half": [1.0, 1.0, 1.0, 0.0]}, AgonicError, "above zero"),
        ({"reach": 0.0}, AgonicError, "above zero"),
        ({"bound": None}, AgonicError, "needs a bound"),
        ({"frame_out": "b"}, FrameError, "share their axes"),
        ({"unit_in": "raw"}, UnitError, "share their units"),
        ({"second": np.ones((3, 3))}, AgonicError, "second must be"),
        ({"output": np.ones((2, 4))}, AgonicError, "2 outputs"),
        ({"hidden": np.full((3, 5), np.nan)}, AgonicError, "finite numbers"),
    ],
)
def test_what_is_no_network_is_told(changed, kind, words):
    with pytest.raises(kind, match=words):
        bent(**changed)
