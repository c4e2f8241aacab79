"""Readings and a stated magnitude that are both in another unit than nT."""

import agonic as ag
from agonic.simulation import simulate


def test_readings_without_a_unit_that_have_the_size_of_a_tiny_stated_field_are_looked_at() -> None:
    """48 beside readings of 48 is microtesla twice: directions are right, the unit is not."""
    readings = simulate("tumble").samples.field / 1000.0
    bare = ag.fit_ellipsoid(readings, 50.0)
    named = ag.fit_ellipsoid(readings, 50.0, unit="uT")
    counts = ag.fit_ellipsoid(readings * 70.0, 50_000.0)
    assert [one.name for one in bare.findings if one.severity == "check"] == ["scale"]
    assert "unit='uT'" in bare.findings[0].move
    assert named.verdict == counts.verdict == "good"
