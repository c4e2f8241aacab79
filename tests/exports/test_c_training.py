"""Training on the controller: the network that Python would train, taken where it is better."""

import ctypes
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import least_squares

import agonic as ag
from agonic.calibration.network import Network
from agonic.cli import run
from agonic.errors import AgonicError
from agonic.exports.firmware.c_text import write_array
from agonic.exports.firmware.training import write_training
from agonic.maths.equation.network import forward, jacobian, split
from agonic.network.simulate import SimulatedField, simulate_nonaffine, simulate_paper
from tests.exports.controller import library, try_extremes
from tests.exports.processors import PROCESSORS

IDLE, BUSY, ACCEPTED, REJECTED, TOO_FAR, FEW = range(6)
NOISE = 2.0
SECOND = 100e6  # instructions of a controller at 100 MHz, one a cycle
MAIN = """
#include "board.h"
#include "paper_training.h"

static const float known[ROWS][6] = TABLE;
static paper_training training;

int main(void)
{
    unsigned long from;
    unsigned long longest = 0;
    unsigned long total = 0;
    int status = PAPER_TRAINING_BUSY;
    int k;
    paper_training_begin(&training);
    for (k = 0; k < ROWS; k++) {
        paper_training_add(&training, known[k], known[k] + 3);
    }
    paper_training_start(&training);
    while (status == PAPER_TRAINING_BUSY) {
        from = board_ticks();
        status = paper_training_run(&training);
        from = board_ticks() - from;
        total += from;
        longest = from > longest ? from : longest;
    }
    board_tell("status", status);
    board_tell("total", (long)(total * board_tick_size));
    board_tell("longest", (long)(longest * board_tick_size));
    board_tell("epochs", (long)training.epochs);
    board_tell("bytes", (long)sizeof training);
    return 0;
}
"""


@pytest.fixture(scope="module")
def paper() -> tuple[Network, SimulatedField, SimulatedField]:
    """A network trained on the ground, readings there, and after the change in orbit."""
    made = simulate_paper(directions="space", noise=NOISE, seed=2)
    ground, orbit = made.select(slice(0, 1500)), made.select(slice(1500, 3000))
    fit = ag.fit_network(
        ground.samples, ground.reference, base=None, hidden=3, compared=False, restarts=1
    )
    return fit.calibration, ground, orbit


class Board:
    """The exported network, compiled."""

    def __init__(self, network: Network, folder: Path, window: int) -> None:
        write_training(network, folder, window=window, name="net")
        self.run = library(folder, "net_training.c")
        self.state = ctypes.create_string_buffer(400_000)
        self.run.net_training_begin(self.state)

    def call(self, name: str, *rows: np.ndarray) -> tuple[int, list[np.ndarray]]:
        given = [np.array(row, dtype=np.float32) for row in rows]
        places = [ctypes.c_void_p(row.ctypes.data) for row in given]
        return getattr(self.run, f"net_training_{name}")(self.state, *places), given

    def add(self, raw: np.ndarray, wanted: np.ndarray) -> int:
        return sum(self.call("add", *row)[0] for row in zip(raw, wanted, strict=True))

    def train(self) -> int:
        status, _ = self.call("start")
        while status == BUSY:
            status, _ = self.call("run")
        return status

    def correct(self, raw: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = [self.call("correct", row, row) for row in raw]
        return np.array([field[1] for _, field in found]), np.array([one for one, _ in found])


def errors(field: np.ndarray, made: SimulatedField) -> float:
    return float(np.sqrt(((field - made.field) ** 2).mean()))


def by_python(network: Network, raw: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """The field by the same posterior in double precision, from whole matrices: the prior wider by
    the step of the bias with the largest evidence, and the weights that are likeliest then."""
    base = np.zeros_like(raw) if network.base is None else network.base.correct(raw)
    rows = np.arange(len(raw)) < len(raw) - len(raw) // 3
    x = (raw - network.input_middle) / network.input_half
    target = (wanted - base - network.output_middle) / network.output_half
    noise, shape = network.noise / network.output_half, network.shape
    step = np.zeros((shape.size, 3))
    if network.base is None:
        step[3 : network.hidden.size : 4] = network.hidden[:, :3]
    else:
        step[network.hidden.size + len(network.hidden) :: len(network.hidden) + 1] = np.eye(3)

    def residuals(weights: np.ndarray) -> np.ndarray:
        return ((forward(split(weights, shape), x[rows]) - target[rows]) / noise).ravel()

    def slopes(weights: np.ndarray) -> np.ndarray:
        return jacobian(split(weights, shape), x[rows]).reshape(-1, shape.size) / noise

    def loosened(share: float) -> np.ndarray:
        sd = share * 0.05 * np.linalg.norm(wanted[-1]) / network.output_half
        return network.covariance + sd**2 * step @ step.T

    def evidence(share: float) -> float:
        onto = slopes(network.weights)
        whole = np.eye(len(onto)) + onto @ loosened(share) @ onto.T
        left = residuals(network.weights)
        return -left @ np.linalg.solve(whole, left) - np.linalg.slogdet(whole)[1]

    shares = [0.0, *10.0 ** np.arange(-3.0, 0.25, 0.5)]
    root = np.linalg.inv(np.linalg.cholesky(loosened(max(shares, key=evidence))))
    found = least_squares(
        lambda w: np.r_[residuals(w), root @ (w - network.weights)],
        network.weights,
        jac=lambda w: np.vstack([slopes(w), root]),
        x_scale="jac",
        xtol=1e-12,
    )
    added = forward(split(found.x, shape), x)
    return base + network.output_middle + network.output_half * added


def test_it_trains_as_python_does(paper, tmp_path):
    network, _, orbit = paper
    raw = orbit.samples.field
    board = Board(network, tmp_path, 1500)
    assert board.add(raw, orbit.field) == 1500
    before, _ = board.correct(raw)
    assert errors(before, orbit) > 20.0
    assert board.train() == ACCEPTED
    field, inside = board.correct(raw)
    assert inside.all()
    assert errors(field, orbit) < 1.1 * NOISE
    assert np.abs(field - by_python(network, raw, orbit.field)).max() < 0.01 * NOISE


def test_a_network_on_a_base_learns_too(tmp_path):
    made = simulate_nonaffine(n=3000, seed=4)
    first, later = made.select(slice(0, 1500)), made.select(slice(1500, 3000))
    fit = ag.fit_network(first.samples, first.reference, hidden=4, compared=False, restarts=1)
    board = Board(fit.calibration, tmp_path, 1500)
    raw = later.samples.field + np.array([300.0, -200.0, 100.0])  # the hard iron has changed
    board.add(raw, later.field)
    before = errors(board.correct(raw)[0], later)
    assert board.train() == ACCEPTED
    after = errors(board.correct(raw)[0], later)
    python = errors(by_python(fit.calibration, raw, later.field), later)
    assert after < 0.7 * before  # hysteresis stays
    assert after == pytest.approx(python, rel=0.002)
    far = np.array([[400_000.0, 0.0, 0.0]])
    field, inside = board.correct(far)
    np.testing.assert_allclose(field, fit.calibration.base.correct(far), rtol=1e-5)
    assert not inside.any()


def test_what_is_not_better_is_rejected(paper, tmp_path):
    network, ground, orbit = paper
    board = Board(network, tmp_path, 1500)
    board.add(ground.samples.field, ground.field)
    state = board.correct(orbit.samples.field)[0]
    assert board.train() == REJECTED
    assert np.array_equal(board.correct(orbit.samples.field)[0], state)
    rng = np.random.default_rng(0)
    poison = ground.field + 500.0 * rng.standard_normal(ground.field.shape)
    board.add(ground.samples.field, poison)
    assert board.train() == REJECTED
    board.add(ground.samples.field, 2.0 * ground.field)
    assert board.train() == TOO_FAR
    assert np.array_equal(board.correct(orbit.samples.field)[0], state)


def test_few_readings_none_and_those_during_a_training(paper, tmp_path):
    network, _, orbit = paper
    board = Board(network, tmp_path, 1500)
    raw, wanted = orbit.samples.field, orbit.field
    assert board.add(raw[:200], wanted[:200]) == 200
    assert board.train() == FEW
    assert board.call("run")[0] == IDLE
    for bad in ([np.nan, 0, 0], [0, np.inf, 0], [3e38, 3e38, 0]):
        assert board.call("add", bad, wanted[0])[0] == 0
        assert board.call("add", raw[0], bad)[0] == 0
        assert board.call("correct", bad, bad)[0] == 0
    board.add(raw[:900], wanted[:900])
    assert board.call("start")[0] == BUSY
    assert board.call("add", raw[0], wanted[0])[0] == 0


@pytest.mark.slow
def test_no_input_is_undefined(paper, tmp_path):
    write_training(paper[0], tmp_path, window=100, name="net")
    try_extremes(
        tmp_path,
        "net_training.c",
        "static net_training t;\n    net_training_begin(&t);",
        "net_training_add(&t, x, x + 3);\n        if (n % 100 == 0) {\n"
        "            net_training_start(&t);\n        }\n        net_training_run(&t);\n"
        "        net_training_correct(&t, x, x + 3);",
    )


def test_other_networks_say_what_they_lack(paper, tmp_path):
    network, _, _ = paper
    with pytest.raises(AgonicError, match="has no weights to train"):
        write_training(ag.Affine(bias=np.zeros(3), matrix=np.eye(3)), tmp_path)
    with pytest.raises(AgonicError, match="a window of 50 readings"):
        write_training(network, tmp_path, window=50)
    wide = replace(network, hidden=np.zeros((9, 4)), output=np.zeros((3, 10)), covariance=None)
    with pytest.raises(AgonicError, match="more than 60 weights"):
        write_training(wide, tmp_path)
    deep = replace(network, second=np.zeros((2, 4)), output=np.zeros((3, 3)), covariance=None)
    with pytest.raises(AgonicError, match="it has two hidden layers"):
        write_training(deep, tmp_path)


def test_the_command_writes_it(paper, tmp_path, capsys):
    file = ag.save(paper[0], tmp_path / "net.json")
    assert run(["export", str(file), "--to", "c", "--window", "300", "--name", "aft"]) == 0
    assert "net/aft_training.c" in capsys.readouterr().out
    assert run(["export", str(file), "--to", "table", "--window", "300"]) == 2
    assert "--window is for c" in capsys.readouterr().err


@pytest.mark.slow
def test_a_retraining_takes_less_than_a_second(paper, tmp_path):
    """The paper's network over its 15 s at 100 Hz, on a Cortex-M4F of 100 MHz, by slices."""
    processor = PROCESSORS["Cortex-M4F"]
    if processor.missing:
        pytest.skip(processor.missing)
    network, _, orbit = paper
    write_training(network, tmp_path, window=1500)
    table = write_array(np.hstack([orbit.samples.field, orbit.field]))
    (tmp_path / "main.c").write_text(MAIN.replace("ROWS", "1500").replace("TABLE", table))
    told = processor.run(processor.build(tmp_path, "paper_training.c", "main.c"))
    assert told["status"] == ACCEPTED
    assert told["total"] < SECOND
    assert told["longest"] < 25_000
    assert told["bytes"] < 44_000  # 36 000 of readings


@pytest.mark.slow
@pytest.mark.parametrize("jump", [0.0, 150.0])
def test_windows_of_half_of_the_directions_forget_nothing(tmp_path, jump):
    """Half an orbit after the other: no worse than never trained, or trained on everything."""
    made = simulate_nonaffine(n=20_000, hysteresis=0.0, noise=50.0, seed=5)
    ground, later = made.select(slice(0, 5000)), made.select(slice(5000, 20_000))
    fit = ag.fit_network(ground.samples, ground.reference, hidden=6, compared=False, restarts=2)
    network = fit.calibration
    clean = simulate_nonaffine(n=20_000, hysteresis=0.0, noise=0.0, seed=5)
    moved = np.array([jump, -jump, 0.5 * jump])
    raw, truth = later.samples.field + moved, later.field
    exact = clean.samples.field[5000:] + moved
    some = np.arange(0, len(truth), 10)
    samples = later.samples.with_columns(field=raw).select(some)
    known = ag.Reference.vector(truth[some], frame="m")
    everything = ag.fit_network(samples, known, start=network, compared=False).calibration
    board = Board(network, tmp_path, 600)
    side, statuses = truth[:, 0] > 0, []
    for visit in range(10):
        rows = np.flatnonzero(side == (visit % 2 == 0))[visit // 2 * 600 :][:600]
        board.add(raw[rows], truth[rows])
        statuses.append(board.train())
    every = exact[::25]
    never, at_once = (
        np.sqrt(np.mean((one.evaluated(every, {})[0] - truth[::25]) ** 2))
        for one in (network, everything)
    )
    now = np.sqrt(np.mean((board.correct(every)[0] - truth[::25]) ** 2))
    assert now < 1.05 * min(never, at_once), (never, at_once, now, statuses)
    if jump:
        assert ACCEPTED in statuses
