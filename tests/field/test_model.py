"""A model at places and times: poles, date line, shapes, dates, tracks."""

from datetime import UTC, datetime

import numpy as np
import pytest

from agonic.errors import AgonicError, AgonicWarning, LogError, ValidityError
from agonic.field import world_model as model_module
from agonic.field.published import igrf, wmm, wmmhr
from agonic.maths.earth import geodesy
from agonic.samples import Samples

PT = 1e-3


def earth_fixed(field_n: np.ndarray, latitude: np.ndarray, longitude: np.ndarray) -> np.ndarray:
    return geodesy.earth_fixed(field_n.T, geodesy.directions(latitude, longitude)).T


@pytest.mark.parametrize("pole", [90.0, -90.0])
def test_a_pole_is_one_place_whatever_its_longitude(pole: float) -> None:
    longitude = np.array([-180.0, -90.0, 0.0, 33.0, 180.0, 360.0])
    latitude = np.full(6, pole)
    field_e = earth_fixed(wmm().at(latitude, longitude, 0.0, 2027.0).field_n, latitude, longitude)
    assert np.abs(field_e - field_e[0]).max() < 1e-9
    beside = wmm().at(pole * (1 - 1e-9), 33.0, 0.0, 2027.0).field_n
    assert np.abs(beside - wmm().at(pole, 33.0, 0.0, 2027.0).field_n).max() < 1e-4


def test_date_line_and_greenwich_have_no_seam() -> None:
    latitude = np.linspace(-90.0, 90.0, 7)
    west = wmmhr().at(latitude, -180.0, 0.0, 2026.0).field_n
    assert np.abs(wmmhr().at(latitude, 180.0, 0.0, 2026.0).field_n - west).max() < 1e-9
    zero = wmmhr().at(latitude, 0.0, 0.0, 2026.0).field_n
    assert np.abs(wmmhr().at(latitude, 360.0, 0.0, 2026.0).field_n - zero).max() < 1e-9


def test_the_field_falls_off_like_a_dipole_far_out() -> None:
    """|B| r³ is constant within some percent along a radius, from 5 Earth radii."""
    radius = np.array([5.0, 10.0, 20.0]) * 6371.2e3
    strength = igrf().at(0.0, 0.0, radius - geodesy.SEMI_MAJOR_M, 2020.0).magnitude * radius**3
    assert np.ptp(strength) / strength.mean() < 0.05


def test_scalars_give_one_vector_and_arrays_a_row_each() -> None:
    one = wmm().at(latitude_deg=10, longitude_deg=20, altitude_m=30, time=2026)
    assert one.field_n.shape == one.secular_variation.shape == (3,)
    assert one.declination_deg.shape == ()
    many = wmm().at([10, 11], 20, [[30], [40], [50]], ["2026-01-01", "2027-01-01"])
    assert many.field_n.shape == (3, 2, 3)
    assert many.horizontal.shape == (3, 2)
    assert np.abs(many.field_n[0, 0] - one.field_n).max() < 1e-9
    assert wmm().at([], [], [], []).field_n.shape == (0, 3)


def test_each_point_has_its_own_epoch() -> None:
    """Years in any order, in all intervals of the IGRF, as one by one."""
    rng = np.random.default_rng(3)
    n = 200
    places = rng.uniform([[-90.0], [-180.0], [0.0]], [[90.0], [360.0], [6e5]], (3, n))
    years = rng.uniform(1900.0, 2030.0, n)
    together = igrf().at(*places, years)
    for i in range(n):
        alone = igrf().at(*places[:, i], years[i])
        assert np.abs(together.field_n[i] - alone.field_n).max() < 1e-8
        assert np.abs(together.secular_variation[i] - alone.secular_variation).max() < 1e-8


@pytest.mark.slow
def test_many_points_are_as_few(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pieces, and the compiled kernel where numba is installed, change nothing."""
    rng = np.random.default_rng(3)
    places = rng.uniform([[-90.0], [-180.0], [0.0]], [[90.0], [180.0], [6e5]], (3, 500))
    years = rng.uniform(2015.0, 2030.0, 500)
    expected = igrf().at(*places, years).field_n
    monkeypatch.setattr(model_module, "PIECE_ROWS", 64)
    monkeypatch.setattr(model_module, "COMPILE_FROM", 1)
    assert np.abs(igrf().at(*places, years).field_n - expected).max() < 1e-8


@pytest.mark.parametrize("model", [igrf(), wmm(), wmmhr()])
def test_secular_variation_is_the_change_in_a_year(model: model_module.Model) -> None:
    rng = np.random.default_rng(3)
    here = (rng.uniform(-90, 90, 20), rng.uniform(-180, 180, 20), 1000.0)
    before, after = (model.at(*here, year) for year in (2027.25, 2027.75))
    change = (after.field_n - before.field_n) / 0.5
    assert np.abs(change - before.secular_variation).max() < 1e-7
    middle = model.at(*here, 2027.5)
    for name, rate in middle.elements_per_year().items():
        slope = (after.elements()[name] - before.elements()[name]) / 0.5
        assert np.abs(slope - rate).max() < 1e-3, name


def test_igrf_is_continuous_at_its_epochs() -> None:
    for epoch in range(1905, 2030, 5):
        fields = [igrf().at(50.0, 10.0, 0.0, epoch + dt).field_n for dt in (-1e-9, 0.0)]
        assert np.abs(fields[1] - fields[0]).max() < 1e-6


def test_dates_outside_are_an_error_or_a_warning() -> None:
    for model, year in ((wmm(), 2024.999), (wmmhr(), 2030.001), (igrf(), 1899.9), (igrf(), 2036)):
        with pytest.raises(ValidityError, match=r"holds from .* 1 of 2 dates is outside") as caught:
            model.at(0.0, 0.0, 0.0, [2027.0 if model is not igrf() else 1950.0, year])
        assert caught.value.mask.tolist() == [False, True]
    assert np.isfinite(wmm().at(0.0, 0.0, 0.0, [2025.0, 2030.0]).field_n).all()
    last = igrf().at(0.0, 0.0, 0.0, 2030.0)
    with pytest.warns(AgonicWarning, match="1 of 1 dates is after 2030.0"):
        later = igrf().at(0.0, 0.0, 0.0, 2032.0)
    assert np.abs(later.field_n - last.field_n - 2 * last.secular_variation).max() < 1e-8


@pytest.mark.parametrize(
    ("place", "message"),
    [
        ((90.1, 0.0, 0.0), "latitude_deg has 90.1; give numbers from -90 to 90"),
        ((float("nan"), 0.0, 0.0), "latitude_deg has nan"),
        ((0.0, -180.1, 0.0), "longitude_deg has -180.1; give numbers from -180 to 360"),
        ((0.0, 0.0, -6e6), "altitude_m has -6000000.0"),
        ((0.0, 0.0, float("inf")), "altitude_m has inf"),
    ],
)
def test_impossible_places_are_said(place: tuple[float, float, float], message: str) -> None:
    with pytest.raises(ValidityError, match=message):
        wmm().at(*place, 2026.0)


@pytest.mark.parametrize(
    "arguments",
    [([0, 1], [0, 1, 2], 0, 2026.0), ("north", 0, 0, 2026.0), (0, None, 0, [2026, 2027])],
)
def test_places_and_times_that_do_not_match_are_said(arguments: tuple[object, ...]) -> None:
    with pytest.raises(AgonicError, match=r"do not go together|longitude_deg has nan"):
        wmm().at(*arguments)


def orbit(time: np.ndarray) -> dict[str, np.ndarray]:
    """A polar orbit at about 450 km: over both poles' surroundings and the date line."""
    along, inclination = 2 * np.pi * time / 5600.0, np.radians(87.4)
    ascending = np.radians(170.0) - 2 * np.pi * time / 86164.0
    east = np.degrees(ascending + np.arctan2(np.cos(inclination) * np.sin(along), np.cos(along)))
    return {
        "latitude_deg": np.degrees(np.arcsin(np.sin(inclination) * np.sin(along))),
        "longitude_deg": (east + 180.0) % 360.0 - 180.0,
        "altitude_m": 450e3 + 15e3 * np.sin(along),
    }


@pytest.mark.parametrize("model", [igrf(), wmm()])
def test_a_splined_orbit_is_the_model_within_a_picotesla(model: model_module.Model) -> None:
    time = np.arange(0.0, 5600.0, 0.1)
    epoch = datetime(2026, 3, 1, 6, tzinfo=UTC)
    samples = Samples(field=np.ones((len(time), 3)), time=time, epoch=epoch, **orbit(time))
    reference = model.along(samples)
    moments = np.datetime64("2026-03-01T06") + (time * 1e6).astype("timedelta64[us]")
    exact = model.at(*orbit(time).values(), moments).field_n
    assert np.abs(reference.values - exact).max() < 1 * PT
    assert (reference.kind, reference.frame) == ("vector", "n")
    assert 50.0 < reference.sd < 200.0
    assert model.name in reference.source


def test_along_needs_places_and_moments() -> None:
    samples = Samples(
        field=np.ones((2, 3)), time=[0.0, 1.0], latitude_deg=[1, 2], altitude_m=[0, 0]
    )
    with pytest.raises(LogError, match=r"have no longitude_deg and no epoch: add it with"):
        wmm().along(samples)


def test_along_keeps_to_the_years_of_the_model() -> None:
    samples = Samples(
        field=np.ones((2, 3)),
        time=[0.0, 60.0],
        epoch=datetime(2029, 12, 31, 23, 59, 30),
        latitude_deg=[1, 2],
        longitude_deg=[1, 2],
        altitude_m=[0, 0],
    )
    with pytest.raises(ValidityError, match="1 of 2 dates is outside"):
        wmm().along(samples)
