"""What readings give away before any fit, by simulated defects."""

import numpy as np
import pytest

import agonic as ag
from agonic.health import describe, find_quantisation, find_usable_rows, inspect
from agonic.samples import Logged
from agonic.simulation import clipped, duplicated, frozen, quantised, simulate, with_gap, with_nan

MOTIONS = {
    "tumble": {"kind": "tumble"},
    "hand": {"kind": "hand"},
    "tilt 60": {"kind": "circle", "tilt_deg": 60},
    "level turn": {"kind": "circle", "tilt_deg": 1e-6},
    "independent": {"kind": "sphere"},
}


def minute(motion: str, n: int = 3000, *, seed: int = 0, defects=()) -> ag.Samples:
    """A minute of a motion in n readings."""
    return simulate(**MOTIONS[motion], n=n, rate_Hz=n / 60, seed=seed, defects=defects).samples


def names(samples: ag.Samples) -> dict[str, str]:
    return {finding.name: finding.severity for finding in inspect(samples)}


@pytest.mark.parametrize("motion", MOTIONS)
@pytest.mark.parametrize("n", [300, 3000])
@pytest.mark.parametrize("steps", [None, 15.0, 150.0])
def test_good_readings_give_nothing_away(motion: str, n: int, steps: float | None) -> None:
    defects = [] if steps is None else [quantised(steps)]
    for seed in range(3):
        samples = minute(motion, n, seed=seed, defects=defects)
        assert inspect(samples) == ()
        assert find_usable_rows(samples.field).all()


@pytest.mark.parametrize("motion", ["tumble", "hand", "tilt 60"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("n", [300, 3000])
def test_an_axis_frozen_throughout_is_refused(motion: str, axis: int, n: int) -> None:
    samples = minute(motion, n, defects=[frozen(axis)])
    (finding,) = inspect(samples)
    assert (finding.name, finding.severity) == ("frozen axis", "refuse")
    assert f"axis {'xyz'[axis]} never changes" in finding.sentence
    assert find_usable_rows(samples.field).all()  # nothing would be left


@pytest.mark.parametrize("motion", ["tumble", "hand", "tilt 60"])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("n", [300, 3000])
def test_an_axis_frozen_for_a_time_is_left_out_there(motion: str, axis: int, n: int) -> None:
    for seed in range(3):
        samples = minute(motion, n, seed=seed, defects=[frozen(axis, start=45.0)])
        (finding,) = inspect(samples)
        assert (finding.name, finding.severity) == ("frozen axis", "check")
        assert f"axis {'xyz'[axis]} stands still" in finding.sentence
        assert f"{n // 4} readings" in finding.sentence
        assert np.array_equal(find_usable_rows(samples.field), samples.time < 45.0)


@pytest.mark.parametrize("moved", [1, 3, 11])
def test_an_axis_that_freezes_at_once_is_refused_as_frozen(moved: int) -> None:
    samples = minute("tumble", 300, defects=[frozen(1, start=moved / 5.0)])
    (finding,) = inspect(samples)
    assert (finding.name, finding.severity) == ("frozen axis", "refuse")
    assert "axis y hardly ever changes" in finding.sentence
    fit = ag.fit_ellipsoid(samples)
    assert fit.verdict == "refused"
    assert "frozen axis" in [found.name for found in fit.findings]


def test_a_sensor_at_rest_is_not_frozen() -> None:
    """All axes repeat together: a digital sensor that does not move."""
    samples = simulate("static", n=1000, noise=10.0, defects=[quantised(150.0)]).samples
    assert "frozen axis" not in names(samples)


@pytest.mark.parametrize("motion", ["tumble", "hand", "independent"])
@pytest.mark.parametrize("share", [0.6, 0.8, 0.9])
@pytest.mark.parametrize("steps", [None, 150.0])
def test_clipped_readings_are_named_and_left_out(
    motion: str, share: float, steps: float | None
) -> None:
    for seed in range(3):
        whole = minute(motion, seed=seed, defects=[] if steps is None else [quantised(steps)])
        limit = share * np.abs(whole.field).max()
        limit = limit if steps is None else steps * round(limit / steps)
        samples = clipped(limit)(whole)
        assert names(samples) == {"clipping": "check"}
        at_limit = (np.abs(samples.field) == limit).any(axis=1)
        assert not find_usable_rows(samples.field)[at_limit].any()
        assert find_usable_rows(samples.field)[~at_limit].all()


@pytest.mark.parametrize("motion", ["tumble", "level turn", "hand"])
@pytest.mark.parametrize("steps", [None, 100.0])
def test_a_dead_zone_is_named_and_left_out_and_a_level_turn_in_steps_is_none(
    motion: str, steps: float | None
) -> None:
    whole = minute(motion, defects=[] if steps is None else [quantised(steps)])
    assert "dead zone" not in names(whole)
    field = whole.field.copy()
    dead = np.abs(field[:, 1]) < 2000.0
    field[dead, 1] = 0.0
    samples = ag.Samples(field=field, time=whole.time)
    assert names(samples)["dead zone"] == "check"
    assert np.array_equal(find_usable_rows(samples.field), ~dead)


def test_lost_rows_are_counted_and_many_of_them_are_to_be_looked_at() -> None:
    few, many = (minute("tumble", defects=[with_nan(share)]) for share in (0.005, 0.05))
    assert names(few) == {"NaN": "note"}
    assert names(many) == {"NaN": "check"}
    assert "150 of 3000 rows were left out" in inspect(many)[0].sentence


def test_a_clock_that_jumps_back_is_named() -> None:
    time = np.arange(100.0)
    time[50:] -= 10.0
    samples = ag.Samples(field=minute("tumble", 100).field, time=time)
    assert names(samples) == {"clock": "check"}


@pytest.mark.parametrize(("n", "few"), [(6, True), (11, True), (12, False)])
def test_too_few_readings_are_refused(n: int, few: bool) -> None:
    found = names(simulate("sphere", n=n).samples)
    assert found == ({"too few readings": "refuse"} if few else {})


def test_a_log_faster_than_its_sensor_is_told() -> None:
    (finding,) = inspect(minute("tumble", defects=[duplicated(2)]))
    assert (finding.name, finding.severity) == ("repeated readings", "note")
    assert "50 % of the readings repeat" in finding.sentence


def test_gaps_in_time_are_told() -> None:
    (finding,) = inspect(minute("tumble", defects=[with_gap(20.0, 27.5)]))
    assert (finding.name, finding.severity) == ("gaps", "note")
    assert finding.sentence == "1 gap in time, the longest 7.5 s"


@pytest.mark.parametrize("size", [15.0, 150.0, 600.0])
def test_the_step_of_a_converter_is_found(size: float) -> None:
    samples = minute("tumble", 20_000, defects=[quantised(size)])
    assert find_quantisation(samples.field) == pytest.approx(size)
    assert find_quantisation(minute("tumble").field) is None


def test_describe_adds_what_is_worth_knowing() -> None:
    logged = Logged(bias=np.zeros(3), matrix=np.eye(3), source="COMPASS_OFS")
    samples = minute("tumble", defects=[quantised(150.0)]).with_columns(logged=logged)
    said = {finding.name: finding.sentence for finding in describe(samples)}
    assert said["coarse steps"] == "readings come in steps of 150 nT"
    assert "corrected by COMPASS_OFS" in said["already corrected"]
    assert all(finding.severity == "note" for finding in describe(samples))


def test_readings_divided_by_their_own_length_are_refused():
    """Unit vectors, as some drivers publish them, tell nothing of bias; noise of 10⁻⁵ is none."""
    rng = np.random.default_rng(6)
    field = rng.normal((0.3, 0.0, 0.0), 1.0, (300, 3))
    unit = field / np.linalg.norm(field, axis=1, keepdims=True)
    for kind in (np.float64, np.float32):
        found = {f.name: f.severity for f in inspect(ag.Samples(field=unit.astype(kind)))}
        assert found["normalised"] == "refuse"
    noisy = unit * 50_000 + rng.normal(0, 0.5, (300, 3))
    assert "normalised" not in {f.name for f in inspect(ag.Samples(field=noisy))}
