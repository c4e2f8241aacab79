"""What is left after the correction, over the readings and over the sphere."""

from dataclasses import replace

import numpy as np
import pytest

from agonic.maths.equation.coverage import icosphere
from agonic.recording.quantities import compute_residuals
from tests.recording.handmade import FIELD, NOISE, calibrated, samples_of, tumble


def test_a_dent_shows_in_its_cell_and_in_words():
    directions = tumble(8000)
    samples = samples_of(directions)
    cell = int(np.argmin(np.abs(np.linalg.norm(icosphere()[0] - [1, 0, 0], axis=1))))
    near = directions @ icosphere()[0][cell] > 0.97
    dented = samples.with_columns(field=samples.field + 900 * directions * near[:, None])
    residuals = compute_residuals(calibrated(dented))
    assert np.nanargmax(np.abs(residuals.means)) == cell
    assert 300 < residuals.means[cell] < 1000
    assert residuals.mean_limit == pytest.approx(residuals.means[cell])
    assert f"towards (+{icosphere()[0][cell, 0]:.2f}" in residuals.worst


def test_colour_is_full_no_sooner_than_at_the_noise(good):
    residuals = compute_residuals(good)
    assert np.nanmax(np.abs(residuals.means)) < NOISE == residuals.mean_limit


def test_the_edge_lies_beyond_the_noise(good):
    assert compute_residuals(good).limit == pytest.approx(5 * NOISE)


def test_a_fit_that_kept_no_readings_is_drawn_all_the_same(good):
    bare = replace(good, fit=replace(good.fit, residuals=None, weights=None))
    assert compute_residuals(bare).values == pytest.approx(good.fit.residuals)


def test_a_cell_with_few_readings_has_no_mean():
    direction = np.tile([0.0, 0.0, 1.0], (9, 1))
    full = calibrated(samples_of(tumble(3000)))
    samples = samples_of(direction)
    few = replace(full.fit, residuals=np.full(9, FIELD), weights=np.ones(9))
    residuals = compute_residuals(replace(full, samples=samples, fit=few))
    assert np.isnan(residuals.means).all()
    assert residuals.worst == "No direction holds 10 readings."
