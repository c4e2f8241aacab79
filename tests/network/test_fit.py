"""`fit_network`: the published figures, honest comparison, the guard, magnitudes, uncertainty."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import agonic as ag
from agonic.calibration.network import Network
from agonic.errors import AgonicError, CoverageError, FrameError, LogError
from agonic.network.fit import choose_network, fit_network
from agonic.network.simulate import CHANGE_S, simulate_nonaffine, simulate_paper

WARM = ("field", "temperature", "temperature_rate")


def error(calibration, made):
    """Components of the field's error, nT, whether or not the guard would warn."""
    return calibration.evaluated(made.samples.field, made.samples.columns())[0] - made.field


@cache
def bent(seed: int = 0, n: int = 3000, hysteresis: float = 0.0, noise: float = 20.0):
    return simulate_nonaffine(n=n, hysteresis=hysteresis, noise=noise, seed=seed)


@cache
def trained(seed: int = 0):
    made = bent(seed)
    return fit_network(made.samples, made.reference, hidden=6, seed=seed, compared=False)


# The paper


@pytest.mark.parametrize("seed", range(5))
def test_the_published_figures_hold(seed):
    """Error below 0.001 within 26 epochs; 10 nT, 30 nT after the change, 10 nT retrained."""
    made = simulate_paper(30.0, seed=seed)
    assert made.samples.time is not None
    late = made.samples.time >= CHANGE_S
    ground, changed = made.select(~late), made.select(late)
    alone = {"base": None, "stopping": "plain", "compared": False}
    fit = fit_network(ground.samples, ground.reference, restarts=1, seed=seed, **alone)
    assert min(epoch.mean_square for epoch in fit.epochs[:26]) < 1e-3
    assert fit.calibration.shape == (3, 3, 3)
    assert np.abs(error(fit.calibration, ground)).max() < 10.0
    assert 28.0 < np.abs(error(fit.calibration, changed)).max() < 36.0
    again = fit_network(
        changed.samples, changed.reference, stopping="plain", start=fit.calibration, compared=False
    )
    assert np.abs(error(again.calibration, changed)).max() < 10.0


@pytest.mark.slow
def test_the_table_of_hidden_nodes_comes_from_directions_that_fill_space():
    """0.9999 for 3 to 7 nodes and 0.82 for 2: √(2/3), for two nodes span a plane of the three."""
    made = simulate_paper(15.0, directions="space", seed=1)
    choice = choose_network(made.samples, made.reference, base=None, stopping="plain")
    *many, two = choice.table
    assert [row.hidden for row in choice.table] == [7, 6, 5, 4, 3, 2]
    assert all(row.regression > 0.999 and row.unseen_regression > 0.999 for row in many)
    assert all(row.unseen_maximum < 10.0 for row in many)
    weakest, *others = np.linalg.eigvalsh(np.cov(made.field.T))
    plane = np.sqrt(sum(others) / (weakest + sum(others)))  # the best that two nodes can span
    assert two.regression == pytest.approx(plane, abs=0.003)
    assert 0.815 < two.regression < 0.83
    assert choice.fit.calibration.shape.hidden >= 3


def test_in_the_printed_plane_two_nodes_are_enough():
    made = simulate_paper(15.0, seed=1)
    fit = fit_network(
        made.samples, made.reference, hidden=2, base=None, stopping="plain", compared=False
    )
    assert fit.regression > 0.999


# The comparison


@pytest.mark.parametrize("seed", range(2))
def test_an_affine_sensor_needs_no_network(seed):
    made = simulate_nonaffine(n=2000, saturation=0.0, cross=0.0, hysteresis=0.0, seed=seed)
    fit = fit_network(made.samples, made.reference, seed=seed)
    assert fit.comparison.winner == "base"
    assert fit.chosen is fit.calibration.base
    assert fit.comparison.ratio == pytest.approx(1.0, abs=0.01)
    assert any(finding.name == "network not needed" for finding in fit.findings)


def test_the_affine_wins_in_the_printed_plane():
    """There is nothing to gain but the noise across the plane, and that is not the sensor's."""
    made = simulate_paper(15.0, seed=2)
    fit = fit_network(made.samples, made.reference, seed=2)
    assert fit.comparison.winner == "base"
    assert np.abs(fit.residuals).max() < 10.0


@pytest.mark.slow
def test_no_table_of_nodes_makes_an_affine_sensor_need_one():
    made = simulate_paper(10.0, directions="space", seed=3)
    choice = choose_network(made.samples, made.reference, hidden=(4, 3))
    assert choice.chosen is choice.fit.calibration.base
    assert choice.sentence == "no network is needed"


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(2))
def test_what_no_affine_fits_is_halved_at_least_in_every_direction(seed):
    """Saturation of 2 %, axes that mix, and a part that lags behind the temperature."""
    made = bent(seed, 2000, hysteresis=200.0)
    fit = fit_network(made.samples, made.reference, hidden=8, inputs=WARM, seed=seed)
    comparison = fit.comparison
    assert comparison.winner == "network"
    assert comparison.ratio < 0.5
    base, network, count = comparison.directions.T
    assert (network[count >= 10] - base[count >= 10]).max() < 20.0
    assert fit.verdict == "good"


@pytest.mark.slow
def test_without_temperature_the_lag_stays():
    """The inputs do it: with the field alone the error of hysteresis is left."""
    made = bent(0, 4000, hysteresis=400.0)
    alone = fit_network(made.samples, made.reference, hidden=8, compared=False)
    warm = fit_network(made.samples, made.reference, hidden=8, inputs=WARM, compared=False)
    assert alone.rms > 1.4 * warm.rms


# The guard


@cache
def half_seen():
    """A network of readings with a positive x, and all readings."""
    made = bent(4)
    seen = made.field[:, 0] > 0
    fit = fit_network(
        made.samples.select(seen),
        ag.Reference.vector(made.field[seen], frame="m"),
        hidden=8,
        compared=False,
    )
    return made, seen, fit.calibration


@pytest.mark.filterwarnings("ignore:.*lie outside")
def test_outside_the_error_is_that_of_the_base_and_a_stated_bound_at_most():
    made, seen, network = half_seen()
    raw = made.samples.field
    for factor in (1.0, 1.5, 3.0, 100.0):
        before = network.base.correct(factor * raw)
        after = network.correct(factor * raw)
        assert np.linalg.norm(after - before, axis=1).max() <= network.bound * (1 + 1e-9)
    far = made.field[:, 0] < -30_000.0
    np.testing.assert_array_equal(network.correct(raw)[far], network.base.correct(raw)[far])
    assert (network.inside(raw)[seen] == 1.0).all()


def test_the_guard_says_where_it_extrapolates():
    made, _, network = half_seen()
    with pytest.warns(ag.AgonicWarning, match="only its base corrects"):
        network.correct(made.samples.field)
    outside = network.outside(made.samples.field)
    assert (made.field[outside, 0] < 0).all()
    assert outside[made.field[:, 0] < -30_000.0].all()


@pytest.mark.filterwarnings("ignore:.*lie outside")
def test_on_the_way_out_the_field_does_not_jump():
    _, _, network = half_seen()
    angle = np.linspace(0, np.pi, 2001)
    ring = np.stack([np.cos(angle), np.sin(angle), np.zeros_like(angle)], axis=1) * 50_000.0
    raw = np.linalg.solve(network.base.matrix, ring.T).T + network.base.bias
    added = network.correct(raw) - network.base.correct(raw)
    assert np.linalg.norm(np.diff(added, axis=0), axis=1).max() < 0.02 * network.bound
    assert network.inside(raw).min() == 0.0
    assert network.inside(raw).max() == 1.0


def test_the_uncertainty_grows_on_the_way_out():
    made, seen, network = half_seen()
    sd = np.sqrt(np.einsum("nii->n", network.uncertainty(made.samples.field)) / 3)
    outside = network.outside(made.samples.field)
    left = np.linalg.norm(network.base.correct(made.samples.field) - made.field, axis=1)
    assert np.median(sd[outside]) > 5 * np.median(sd[seen])
    assert np.sqrt(np.mean(left[outside] ** 2) / 3) < 3 * np.median(sd[outside])


# Magnitudes


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_a_magnitude_teaches_the_length_as_well_as_a_vector_does(seed):
    """On unseen blocks the length is as good; turns it cannot see, but nothing gets worse."""
    made = bent(seed)
    unseen = np.arange(3000) // 150 % 2 == 1
    seen, rest = made.select(~unseen), made.select(unseen)
    fits = {
        target: fit_network(
            seen.samples, seen.reference, hidden=8, target=target, seed=seed, compared=False
        )
        for target in ("vector", "magnitude")
    }
    length, vector = {}, {}
    for target, fit in fits.items():
        off = error(fit.calibration, rest)
        length[target] = rms(np.linalg.norm(off + rest.field, axis=1) - 50_000.0)
        vector[target] = rms(off)
    assert length["magnitude"] < 1.2 * length["vector"]
    affine = fits["magnitude"].base.correct(rest.samples.field) - rest.field
    assert vector["vector"] < vector["magnitude"] <= rms(affine)


def rms(values):
    return float(np.sqrt(np.mean(values**2)))


def test_a_magnitude_changes_no_direction():
    made = bent(0)
    fit = fit_network(made.samples, made.reference, target="magnitude", compared=False)
    raw = made.samples.field
    before, after = fit.base.correct(raw), fit.calibration.correct(raw)
    turn = np.cross(before, after) / np.linalg.norm(before, axis=1, keepdims=True) ** 2
    assert np.abs(turn).max() < 1e-9


@pytest.mark.slow
def test_on_a_constant_magnitude_noise_is_not_learned():
    """All readings lie on a sphere, and a network could pull every reading onto it."""
    made = simulate_nonaffine(
        n=3000, noise=300.0, saturation=0.0, cross=0.0, hysteresis=0.0, seed=1
    )
    fit = fit_network(made.samples, ag.Reference.constant(50_000.0), hidden=8, target="magnitude")
    assert fit.comparison.winner == "base"
    base = np.linalg.norm(fit.base.correct(made.samples.field), axis=1) - 50_000.0
    assert fit.rms > 0.99 * np.sqrt(np.mean(base**2))


# Two hidden layers


@pytest.mark.slow
def test_two_layers_learn_what_one_does():
    """As good where nothing was trained on, and errors as large as stated."""
    ratios = []
    for seed in range(3):
        made, true = bent(seed, 1500, 0.0, 150.0), bent(seed, 1500, 0.0, 1e-6)
        raw, field, errors = true.samples.field[::20], true.field[::20], {}
        for hidden in (8, (6, 5)):
            found = fit_network(
                made.samples, made.reference, hidden=hidden, restarts=2, compared=False
            ).calibration
            off = found.correct(raw) - field
            errors[hidden] = np.sqrt(np.mean(off**2))
        assert errors[6, 5] < 1.5 * errors[8] < 60.0
        ratios.append(off / np.sqrt(np.einsum("nii->ni", found.uncertainty(raw))))
    assert abs(np.mean(ratios)) < 0.25
    assert 0.75 < np.std(ratios) < 1.35


# Uncertainty


@pytest.mark.slow
@pytest.mark.parametrize(("target", "noise"), [("vector", 150.0), ("magnitude", 150.0)])
def test_errors_are_as_large_as_stated(target, noise):
    """Error over stated standard deviation, over twelve seeds and directions: mean 0, sd 1."""
    ratios = []
    for seed in range(5):
        made, true = bent(seed, 1500, 0.0, noise), bent(seed, 1500, 0.0, 1e-6)
        fit = fit_network(
            made.samples, made.reference, hidden=8, target=target, seed=seed, compared=False
        )
        raw, field = true.samples.field[::50], true.field[::50]
        covariance = fit.calibration.uncertainty(raw)
        off = fit.calibration.correct(raw) - field
        if target == "vector":
            ratios.append((off / np.sqrt(np.einsum("nii->ni", covariance))).ravel())
        else:
            way = field / np.linalg.norm(field, axis=1, keepdims=True)
            sd = np.sqrt(np.einsum("ni,nij,nj->n", way, covariance, way))
            ratios.append((off * way).sum(axis=1) / sd)
    ratio = np.concatenate(ratios)
    assert abs(ratio.mean()) < 0.25
    assert 0.75 < ratio.std() < 1.35


# Readings that stand out, starts, columns, errors


@pytest.mark.slow
def test_gross_readings_do_no_harm():
    made = bent(2)
    rng = np.random.default_rng(0)
    raw, known = made.samples.field.copy(), made.field.copy()
    struck, wrong = rng.choice(3000, 60, replace=False).reshape(2, 30)
    raw[struck] += rng.normal(size=(30, 3)) * 20_000.0
    known[wrong] *= -1.0
    reference = ag.Reference.vector(known, frame="m")
    samples = made.samples.with_columns(field=raw)
    fit = fit_network(samples, reference, hidden=8, compared=False)
    assert (fit.weights[np.r_[struck, wrong]] == 0).all()
    assert np.sqrt(np.mean(error(fit.calibration, made) ** 2)) < 30.0
    assert any(finding.name == "left out in training" for finding in fit.findings)


def test_a_start_goes_on_where_the_other_ended():
    made = bent(1)
    first = trained(1)
    again = fit_network(made.samples, made.reference, start=first.calibration, compared=False)
    assert again.base is first.base
    assert again.iterations < first.iterations
    assert again.rms < 1.02 * first.rms
    np.testing.assert_array_equal(again.calibration.input_half, first.calibration.input_half)


def test_the_same_seed_gives_the_same_network():
    made = bent(1)
    both = [fit_network(made.samples, made.reference, compared=False, seed=3) for _ in range(2)]
    np.testing.assert_array_equal(both[0].calibration.weights, both[1].calibration.weights)


@pytest.mark.slow
def test_a_given_base_is_kept():
    made = bent(0)
    base = trained(0).base
    thermal = ag.thermal.Thermal(
        bias=[base.bias, [10.0, 0.0, 0.0]],
        matrix=[base.matrix, np.zeros((3, 3))],
        centre_C=15.0,
        half_range_C=30.0,
        covariance=None,
        gauge="free",
    )
    fit = fit_network(
        made.samples, made.reference, hidden=8, base=thermal, inputs=WARM[:2], compared=False
    )
    assert fit.base is thermal
    assert fit.rms < 0.5 * fit.calibration.misfit
    assert fit.calibration.needs == ("temperature",)


def test_a_field_north_east_down_is_turned_by_the_attitude():
    made = ag.simulate("tumble", n=1500, noise=50.0, seed=3)
    known = ag.Reference.vector(made.field_n, frame="n")
    fit = fit_network(made.samples, known, compared=False)
    assert fit.calibration.frame_out == "b"
    off = fit.calibration.base.correct(made.samples.field) - made.field_b
    assert np.abs(off.mean(axis=0)).max() < 20.0


@pytest.mark.slow
def test_early_stopping_and_no_restraint_fit_as_well():
    made = bent(0)
    for stopping in ("early", "plain"):
        fit = fit_network(made.samples, made.reference, hidden=8, stopping=stopping, compared=False)
        assert fit.rms < 0.5 * fit.calibration.misfit, stopping


@pytest.mark.parametrize(
    ("settings", "kind", "words"),
    [
        ({"hidden": 0}, AgonicError, "1 to 64 nodes"),
        ({"hidden": (3, 3, 3)}, AgonicError, "one or two hidden layers"),
        ({"inputs": ("field", "moon")}, AgonicError, "inputs must be some of field"),
        ({"inputs": ("field", "current_A")}, LogError, "no current_A"),
        ({"target": "direction"}, AgonicError, "target 'direction' is not known"),
        ({"base": None, "target": "magnitude"}, AgonicError, "needs a base"),
        ({"base": "sphere"}, AgonicError, "base 'sphere' is not known"),
        ({"restarts": 0}, AgonicError, "must be at least 1"),
    ],
)
def test_wrong_settings_are_told(settings, kind, words):
    made = bent(0)
    with pytest.raises(kind, match=words):
        fit_network(made.samples, made.reference, **settings)


def test_wrong_references_are_told():
    made = bent(0)
    with pytest.raises(AgonicError, match='train with target="magnitude"'):
        fit_network(made.samples, ag.Reference.constant(50_000.0))
    with pytest.raises(FrameError, match="north-east-down"):
        fit_network(made.samples, ag.Reference.vector(made.field, frame="e"))
    with pytest.raises(AgonicError, match="has 2999 rows"):
        fit_network(made.samples, ag.Reference.vector(made.field[1:], frame="m"))
    lost = made.samples.with_columns(heading_deg=None)
    with pytest.raises(LogError, match="roll, pitch and heading"):
        fit_network(lost, ag.Reference.vector([20e3, 0.0, 40e3], frame="n"))


def test_too_few_readings_are_refused():
    made = bent(0)
    few = made.select(slice(0, 50))
    with pytest.raises(CoverageError, match="cannot determine a network of 87 weights"):
        fit_network(few.samples, few.reference, hidden=12)
    still = made.samples.with_columns(temperature=np.full(3000, 20.0))
    with pytest.raises(CoverageError, match="temperature never changes"):
        fit_network(still, made.reference, inputs=("field", "temperature"))


def test_few_readings_for_the_weights_are_doubted():
    some = bent(0).select(slice(0, 120))
    fit = fit_network(some.samples, some.reference, hidden=12, compared=False)
    assert any(finding.name == "few for a network" for finding in fit.findings)
    assert fit.verdict == "check"


def test_a_held_network_is_not_trained_further():
    made = bent(0)
    fit = fit_network(made.samples, made.reference, inputs=WARM[:2], compared=False)
    held = fit.calibration.at(20.0)
    with pytest.raises(AgonicError, match="held at a temperature"):
        fit_network(made.samples, made.reference, start=held)


def test_a_network_is_frozen_and_replaceable():
    network = trained(0).calibration
    assert isinstance(replace(network, sensor="other"), Network)
    with pytest.raises(ValueError, match="read-only"):
        network.hidden[0, 0] = 1.0
