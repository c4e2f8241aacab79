"""Fits to parts of a log from the fit to all of it are those that the parts give by themselves."""

from pathlib import Path

import numpy as np
import pytest

import agonic as ag
from agonic.attitude.fit import fit_channels_alone, open_channels_parts
from agonic.attitude.problem import Settings
from agonic.ellipsoid import fit_ellipsoid_alone, open_ellipsoid_parts
from agonic.errors import CoverageError
from agonic.recording.parts import cut_blocks
from agonic.simulation import simulate

LEVELLED = {"channels": ("magnitude", "dip"), "settings": Settings()}
WAYS = {
    "by magnitude": (fit_ellipsoid_alone, open_ellipsoid_parts, {"model": "full"}),
    "levelled": (fit_channels_alone, open_channels_parts, LEVELLED),
    "with a current": (
        fit_channels_alone,
        open_channels_parts,
        {"channels": ("magnitude", "dip"), "settings": Settings(sources=("current_A",))},
    ),
}


def _record(way, seed=0, **changed):
    kind = "flight" if way == "with a current" else "hand"
    made = simulate(kind, n=2000, noise=200.0, seed=seed, **changed)
    return made.samples, ag.Reference.vector(made.field_n, frame="n")


def _compare(way, samples, reference, rows):
    """The move of the bias over its standard error, and the ratio of the standard errors."""
    fit, open_parts, settings = WAYS[way]
    apart = fit(samples.select(rows), reference.select(rows), **settings)
    part = open_parts(samples, reference, **settings)(rows)
    assert (part.sensor, part.frame_in, part.unit_out) == (apart.sensor, apart.frame_in, "nT")
    sds = [np.sqrt(np.diag(one.covariance)) for one in (apart, part)]
    return np.abs(part.bias - apart.bias) / sds[0][:3], sds[1] / sds[0]


@pytest.mark.parametrize("way", WAYS)
def test_parts_are_fitted_as_by_themselves(way):
    """What half of a log says of the noise of each channel moves it, by half a standard error for a
    vehicle that hardly tilts: all rows tell the noise better."""
    samples, reference = _record(way)
    block, _ = cut_blocks(samples)
    for rows in (block % 2 == 0, block != 3):
        moved, wider = _compare(way, samples, reference, rows)
        assert moved.max() < (0.6 if way == "with a current" else 0.1)
        assert 0.8 < wider.min() <= wider.max() < 1.25


def test_outliers_count_no_more_in_a_part():
    samples, reference = _record("by magnitude", seed=1)
    field = samples.field.copy()
    field[::50] += np.random.default_rng(0).normal(size=(40, 3)) * 20_000.0
    block, _ = cut_blocks(samples)
    moved, _ = _compare(
        "by magnitude", samples.with_columns(field=field), reference, block % 2 == 1
    )
    assert moved.max() < 0.02


@pytest.mark.parametrize("way", ["by magnitude", "levelled"])
def test_a_part_with_another_field_has_its_own_minimum(way):
    """A magnet came: what all rows agree on is not where a part of them has its minimum."""
    samples, reference = _record(way)
    later = np.arange(len(samples)) >= 1500
    samples = samples.with_columns(field=samples.field + 30_000.0 * later[:, None])
    moved, _ = _compare(way, samples, reference, later)
    assert moved.max() < 0.02


def test_a_part_in_which_a_source_never_changes_tells_nothing_of_it():
    samples, reference = _record("with a current")
    current = np.where(np.arange(len(samples)) < 1000, 5.0, samples.current_A)
    _, open_parts, settings = WAYS["with a current"]
    fit_part = open_parts(samples.with_columns(current_A=current), reference, **settings)
    with pytest.raises(CoverageError, match="never changes"):
        fit_part(np.arange(len(samples)) < 1000)


@pytest.mark.recordings
def test_a_window_of_a_log_errs_by_no_more_than_three_stated_errors(recordings: Path) -> None:
    """The last 30 % of a hand-held log: off by 3.4° against the whole log, 0.4° by rows alone."""
    path = recordings / "vehicle/broad/05_undisturbed_slow_rotation_with_breaks_B.mat"
    whole = ag.read(path)
    step = -(-len(whole) // 4000)
    some = whole.select(np.arange(0, len(whole), step))
    plain = ag.Samples(time=some.time, field=some.field, unit="nT")
    result = ag.calibrate(plain.select(np.arange(int(0.7 * len(plain)), len(plain))))
    assert result.fit.coverage.heading_sd_deg > 3.4 / 3
