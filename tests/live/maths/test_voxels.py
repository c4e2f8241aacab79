"""Boxes of readings: bounded, the same however the readings are cut, and nothing lost."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from agonic.live.maths import voxels
from agonic.maths.equation import moments

RNG = np.random.default_rng(5)
SPHERE = RNG.normal(size=(6000, 3))
SPHERE *= 50_000 / np.linalg.norm(SPHERE, axis=1, keepdims=True)


def put(rows, cuts=()):
    boxes = voxels.begin(rows[0], 16.0)
    places = []
    for piece in np.split(rows, sorted(cuts)):
        boxes, place = voxels.add_readings(boxes, piece)
        places.append(place)
    return boxes, np.concatenate(places)


def test_the_boxes_hold_the_moments_of_every_reading():
    boxes, _ = put(SPHERE)
    direct = moments.accumulate(SPHERE, boxes.centre, boxes.scale)
    np.testing.assert_allclose(boxes.sums.sum(axis=0), direct, rtol=1e-12, atol=1e-9)
    assert len(boxes.keys) <= voxels.MAX_BOXES
    assert len(np.unique(boxes.keys, axis=0)) == len(boxes.keys)


WHOLE = put(SPHERE)


@pytest.mark.slow
@given(st.lists(st.integers(0, len(SPHERE)), max_size=6))
def test_chunks_do_not_matter(cuts):
    whole, place = WHOLE
    pieces, place_of_pieces = put(SPHERE, cuts)
    assert whole.edge == pieces.edge
    np.testing.assert_array_equal(whole.keys, pieces.keys)
    np.testing.assert_allclose(whole.sums, pieces.sums, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(place, place_of_pieces)


def test_middles_lie_in_their_boxes():
    boxes, _ = put(SPHERE)
    np.testing.assert_array_equal(voxels.compute_keys(boxes, boxes.middles), boxes.keys)


def test_a_sensor_at_rest_fills_one_box():
    still = SPHERE[:1] + RNG.normal(size=(5000, 3))
    boxes, place = put(np.concatenate([SPHERE, still]))
    assert boxes.counts.max() >= 5000
    assert place.max() >= 5000


@pytest.mark.parametrize("far", [1e9, 1e15, -1e18])
def test_a_reading_out_of_this_world_takes_one_box(far):
    rows = np.concatenate([SPHERE[:100], [[far, 0.0, 0.0]], SPHERE[100:200]])
    boxes, _ = put(rows)
    assert boxes.counts.sum() == len(rows)
