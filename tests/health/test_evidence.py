"""Defects by name, with the move that helps, and no alarm on good readings: by simulation.

Each case is a minute of readings at two rates, of several seeds, with and without a reference.
"""

import re
from collections.abc import Callable

import numpy as np
import pytest

import agonic as ag
from agonic.health import Finding
from agonic.simulation import (
    clipped,
    frozen,
    magnet_attached,
    mixed,
    quantised,
    simulate,
    with_correlated_noise,
    with_nan,
    with_outliers,
)

FIELD = 50_000.0
SEEDS = range(3)
Make = Callable[[int, int], ag.Samples]  # of the number of readings and the seed


def minute(kind: str, n: int, seed: int, **settings) -> ag.Samples:
    return simulate(kind, n=n, rate_Hz=n / 60, seed=seed, **settings).samples


def grave(fit: ag.Fit) -> list[Finding]:
    return [finding for finding in fit.findings if finding.severity != "note"]


def fitted(samples: ag.Samples, *, known: bool = True) -> ag.Fit:
    return ag.fit_ellipsoid(samples, ag.Reference.constant(FIELD) if known else None)


def several(make: Make, n: int) -> list[ag.Fit]:
    """Fits of several seeds, with and without a reference in turn; one, without, of a long log."""
    seeds = SEEDS if n < 1000 else SEEDS[1:2]
    return [fitted(make(n, seed), known=seed % 2 == 0) for seed in seeds]


def circle(tilt_deg: float, **settings) -> Make:
    return lambda n, seed: minute("circle", n, seed, tilt_deg=tilt_deg, **settings)


def shaken(kind: str, shift: float, start: float, stop: float, **settings) -> Make:
    """A magnet of a strength (nT) and any direction, there for a share of the minute."""

    def make(n: int, seed: int) -> ag.Samples:
        direction = np.random.default_rng(seed).normal(size=3)
        offset = shift * direction / np.linalg.norm(direction)
        magnet = magnet_attached(60 * start, offset, until=60 * stop)
        return minute(kind, n, seed, defects=[magnet], **settings)

    return make


def both(kind: str, **settings) -> Make:
    """Two sensors, each with its own bias and turning in its own way, in turn in one log."""

    def make(n: int, seed: int) -> ag.Samples:
        other = minute(kind, n, seed + 100, **settings)
        return minute(kind, n, seed, defects=[mixed(other)], **settings)

    return make


GOOD: dict[str, Make] = {
    "tumble": lambda n, seed: minute("tumble", n, seed),
    "all directions": lambda n, seed: minute("sphere", n, seed),
    "belt 30": lambda n, seed: minute("belt", n, seed, tilt_deg=30),
    "hand": lambda n, seed: minute("hand", n, seed),
    "tilt 60": circle(60),
    "tilt 20": circle(20),
    "tumble, 50 nT": lambda n, seed: minute("tumble", n, seed, noise=50),
    "hand, 500 nT": lambda n, seed: minute("hand", n, seed, noise=500),
    "tilt 60, 500 nT": circle(60, noise=500),
    "tilt 20, 50 nT": circle(20, noise=50),
    "coarse steps": lambda n, seed: minute("hand", n, seed, defects=[quantised(150)]),
    "5 % outliers": lambda n, seed: minute("hand", n, seed, defects=[with_outliers(seed=seed)]),
    "a few NaN": lambda n, seed: minute("tumble", n, seed, defects=[with_nan(0.005)]),
    "correlated noise": lambda n, seed: minute(
        "tumble", n, seed, noise=50, defects=[with_correlated_noise(200.0, 1.0, seed=seed)]
    ),
}


@pytest.mark.parametrize("n", [300, 1500])
@pytest.mark.parametrize("make", GOOD.values(), ids=GOOD)
def test_good_readings_raise_no_alarm(make: Make, n: int) -> None:
    for fit in several(make, n):
        assert fit.ok, fit.status
        assert fit.remarks


STATIC: dict[str, Make] = {
    "static": lambda n, seed: minute("static", n, seed, heading_deg=50.0 * seed),
    "quiet": lambda n, seed: minute("static", n, seed, noise=20.0),
    "coarse": lambda n, seed: minute("static", n, seed, noise=50.0, defects=[quantised(150)]),
    "drifting": lambda n, seed: minute(
        "static", n, seed, noise=50.0, defects=[with_correlated_noise(100.0, 2.0)]
    ),
}
FLAT: dict[str, Make] = {
    "plane": circle(1e-6),
    "quiet plane": circle(1e-6, noise=50.0),
    "tilt 3": circle(3),
    "tilt 5": circle(5),
    "tilt 5, 50 nT": circle(5, noise=50),
    "tilt 5, 500 nT": circle(5, noise=500),
    "tilt 5, independent": circle(5, smooth=False),
}
CHANGED: dict[str, Make] = {
    "6 % half-way": shaken("tumble", 3000, 0.5, 9),
    "6 % half-way, in hand": shaken("hand", 3000, 0.5, 9),
    "20 % early": shaken("hand", 10_000, 0.3, 9),
    "20 % late": shaken("tumble", 10_000, 0.8, 9),
    "20 % half-way, tilt 60": shaken("circle", 10_000, 0.5, 9, tilt_deg=60),
    "80 % half-way": shaken("tumble", 40_000, 0.5, 9),
    "80 % half-way, tilt 60": shaken("circle", 40_000, 0.5, 9, tilt_deg=60),
    "80 % late": shaken("hand", 40_000, 0.8, 9),
    "20 % on and off": shaken("hand", 10_000, 0.35, 0.65),
    "80 % on and off": shaken("tumble", 40_000, 0.35, 0.65),
    "independent": shaken("sphere", 10_000, 0.5, 9),
}
MIXED: dict[str, Make] = {
    "tumble": both("tumble"),
    "hand": both("hand"),
    "all directions": both("sphere"),
    "tilt 60": both("circle", tilt_deg=60),
}
REFUSED = [
    *(({"static"}, "turn it slowly about all three axes", c, m) for c, m in STATIC.items()),
    *(({"plane", "small tilt"}, "tilt the nose up and down", c, m) for c, m in FLAT.items()),
    *(({"field changed"}, "stretches before and after", c, m) for c, m in CHANGED.items()),
    *(({"two sensors mixed"}, "separate them", c, m) for c, m in MIXED.items()),
]


@pytest.mark.parametrize("n", [300, 1500])
@pytest.mark.parametrize(
    ("names", "move", "make"),
    [(names, move, make) for names, move, _, make in REFUSED],
    ids=[f"{min(names)}: {case}" for names, _, case, _ in REFUSED],
)
def test_each_defect_is_refused_by_its_name(names: set[str], move: str, make: Make, n: int) -> None:
    for fit in several(make, n):
        (finding,) = grave(fit)
        assert finding.name in names, fit.status
        assert finding.severity == "refuse"
        assert move in finding.sentence
        assert fit.verdict == "refused"
        assert not fit.remarks  # a refused fit boasts of no accuracy


def test_a_plane_names_the_axis_that_is_open() -> None:
    samples = minute("belt", 2000, 0, tilt_deg=1e-3, axis=(0.0, 1.0, 0.0))
    (finding,) = grave(fitted(samples))
    assert finding.name == "plane"
    assert "bias and gain along y are not determined" in finding.what


@pytest.mark.parametrize("n", [600, 3000])
def test_a_change_is_placed_in_time(n: int) -> None:
    (finding,) = grave(fitted(shaken("tumble", 5000, 0.5, 9)(n, 0)))
    assert "near t = 30." in finding.sentence or "near t = 29." in finding.sentence
    said = re.search(r"\((\d+) % of the field\)", finding.sentence)
    assert said
    assert 9 <= int(said[1]) <= 11  # true: 10
    (there,) = grave(fitted(shaken("tumble", 5000, 0.25, 0.75)(n, 0)))
    assert "near t = 15." in there.sentence or "near t = 14." in there.sentence
    assert "and t = 45." in there.sentence or "and t = 44." in there.sentence


def test_without_times_a_change_is_placed_by_its_row() -> None:
    samples = shaken("tumble", 5000, 0.5, 9)(3000, 0).with_columns(time=None)
    (finding,) = grave(fitted(samples))
    assert "near row 15" in finding.sentence or "near row 14" in finding.sentence


def test_a_slight_change_is_noted_and_a_larger_one_is_to_be_looked_at() -> None:
    for seed in SEEDS:
        fit = fitted(shaken("tumble", 1200, 0.5, 9)(3000, seed))
        assert fit.verdict == "good"
        (note,) = [f for f in fit.findings if f.name == "field changed"]
        assert "the heading varies by" in note.what
        (finding,) = grave(fitted(shaken("tumble", 1800, 0.5, 9)(3000, seed)))
        assert (finding.name, finding.severity) == ("field changed", "check")


def test_a_level_turn_with_some_tilt_says_which_directions_are_missing() -> None:
    samples = simulate("circle", tilt_deg=12, n=300, rate_Hz=5, noise=500.0).samples
    (finding,) = grave(fitted(samples))
    assert finding.name == "coverage"
    assert "turn the sensor until the field points along" in finding.sentence


@pytest.mark.slow
def test_readings_that_scatter_are_called_disturbed() -> None:
    for kind in ("tumble", "hand", "sphere"):
        for seed in SEEDS:
            (finding,) = grave(fitted(minute(kind, 3000, seed, noise=2500.0)))
            assert (finding.name, finding.severity) == ("disturbed", "check")
            assert "scatter by 5" in finding.sentence or "scatter by 4" in finding.sentence


@pytest.mark.parametrize("share", [0.02, 0.05])
def test_outliers_are_left_out_and_noted(share: float) -> None:
    made = minute("tumble", 3000, 0, defects=[with_outliers(share)])
    fit = fitted(made)
    (note,) = fit.findings
    assert (note.name, note.severity) == ("outliers", "note")
    assert int(note.what.split()[0]) == pytest.approx(3000 * share, rel=0.1)


def test_very_many_outliers_are_to_be_looked_at() -> None:
    (finding,) = grave(fitted(minute("tumble", 3000, 0, defects=[with_outliers(0.3)])))
    assert (finding.name, finding.severity) == ("outliers", "check")


@pytest.mark.parametrize("defect", [clipped(60_000), frozen(1, start=40.0), with_nan(0.05)])
def test_what_is_left_out_before_the_fit_does_not_spoil_it(defect) -> None:
    made = simulate("tumble", n=3000, seed=4, defects=[defect])
    fit = ag.fit_ellipsoid(made.samples, ag.Reference.constant(FIELD))
    (finding,) = grave(fit)
    assert finding.severity == "check"
    error = (fit.calibration.bias - made.truth.bias) / fit.sd[:3]
    assert np.abs(error).max() < 4


@pytest.mark.parametrize(("factor", "said"), [(1e3, "4.84e+07 nT"), (1.0, None)])
def test_a_field_that_no_compass_was_ever_in_is_doubted(factor, said):
    made = ag.simulate("tumble", n=600, seed=2)
    readings = made.samples.field * factor
    fit = ag.fit_ellipsoid(ag.Samples(field=readings, unit="nT"))
    told = [f.what for f in fit.findings if f.name == "scale"]
    if said is None:
        assert not told
    else:
        assert fit.verdict == "check"
        assert said in told[0]


def test_a_plane_across_all_axes_is_not_named_by_one():
    rng = np.random.default_rng(1)
    normal = np.ones(3) / np.sqrt(3)
    u = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    angle = rng.uniform(0, 2 * np.pi, 2000)
    flat = np.cos(angle)[:, None] * u + np.sin(angle)[:, None] * np.cross(normal, u)
    fit = ag.fit_ellipsoid(ag.Samples(field=48e3 * flat + rng.normal(0, 100, (2000, 3)), unit="nT"))
    assert fit.verdict == "refused"
    assert "normal is near (0.58, 0.58, 0.58)" in fit.status
