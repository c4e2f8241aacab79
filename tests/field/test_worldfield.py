"""The elements of a field vector and their changes, by hand."""

import numpy as np

from agonic.field.worldfield import ELEMENTS, Uncertainty, WorldField

STATED = Uncertainty(north=3.0, east=4.0, down=5.0, declination_deg=(0.0, 600.0), source="here")
FIELD = WorldField(
    field_n=np.array([[300.0, 400.0, 1200.0], [-1.0, 0.0, -1.0]]),
    secular_variation=np.array([[3.0, 4.0, 0.0], [0.0, 1.0, 0.0]]),
    model="by hand",
    uncertainty=STATED,
)


def test_elements() -> None:
    expected = {
        "declination_deg": [np.degrees(np.arctan2(4, 3)), 180.0],
        "inclination_deg": [np.degrees(np.arctan2(12, 5)), -45.0],
        "horizontal": [500.0, 1.0],
        "north": [300.0, -1.0],
        "east": [400.0, 0.0],
        "down": [1200.0, -1.0],
        "magnitude": [1300.0, np.sqrt(2.0)],
    }
    assert tuple(expected) == ELEMENTS
    for name, value in FIELD.elements().items():
        assert np.allclose(value, expected[name], rtol=1e-14), name


def test_changes_of_the_elements() -> None:
    """A field that grows along its own horizontal part keeps its declination and loses dip."""
    change = FIELD.elements_per_year()
    assert abs(change["declination_deg"][0]) < 1e-14
    assert np.isclose(change["horizontal"][0], 5.0)
    assert np.isclose(change["magnitude"][0], 5.0 * 500.0 / 1300.0)
    assert np.isclose(change["inclination_deg"][0], np.degrees(-5.0 * 1200.0 / 1300.0**2))
    assert np.isclose(change["declination_deg"][1], -np.degrees(1.0)), "eastward, seen from south"


def test_declination_is_unsure_where_the_field_is_steep() -> None:
    assert np.allclose(FIELD.declination_sd_deg, [600.0 / 500.0, 180.0])
    assert np.isclose(STATED.component, np.sqrt(50.0 / 3.0))
