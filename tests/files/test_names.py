"""Distinct sensors get distinct files, and names that are plain stay as they are."""

from __future__ import annotations

import string

from hypothesis import given
from hypothesis import strategies as st

from agonic.files.names import file_stem


def test_plain_names_stay():
    for name in ("MAG", "MAG2", "mag1", "left_mag", "port-2", "SCALED_IMU3"):
        assert file_stem(name) == name
    assert file_stem("sensor_mag[0]") == "sensor_mag_0"


def test_names_that_look_alike_are_told_apart():
    alike = ["left.mag", "left/mag", "left mag", "left_mag", "_left_mag", "left_mag_", "left\0mag"]
    alike += ["sensor_mag[0]", "sensor_mag_0", "", "_", "sensor", "a" * 300, "a" * 301]
    alike += [file_stem(name) for name in alike if file_stem(name) != name]
    stems = {name: file_stem(name) for name in alike}
    assert len(set(stems.values())) == len(stems)


ALPHABET = string.ascii_letters + string.digits + "-_. /[]äµ\0\udce9"


@given(st.lists(st.text(ALPHABET, max_size=120), unique=True, max_size=20))
def test_stems_are_injective_and_safe(names):
    stems = [file_stem(name) for name in names]
    assert len(set(stems)) == len(names)
    for stem in stems:
        assert 0 < len(stem.encode()) <= 100
        assert set(stem) <= set(string.ascii_letters + string.digits + "-_")
