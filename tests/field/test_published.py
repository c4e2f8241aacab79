"""IGRF, WMM and WMMHR against the authorities, and the shipped files against their checksums."""

import re
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest

from agonic.field.published import igrf, wmm, wmmhr
from agonic.field.world_model import Model
from agonic.provenance import hash_file

DATA = Path(str(files("agonic.field"))) / "data"
NT = 1e-3
PRINTED_DEG = 0.005 + 1e-9
"""Angles are printed to two decimals."""


@pytest.mark.recordings
@pytest.mark.parametrize(("model", "name"), [(wmm(), "WMM2025"), (wmmhr(), "WMMHR2025")])
def test_official_values(recordings: Path, model: Model, name: str) -> None:
    """NOAA's and BGS's own test values: 100 rows of seven elements and their yearly change."""
    table = np.loadtxt(recordings / "authorities" / f"{name}_FINAL_TEST_VALUES_HIGHPREC.txt")
    year, altitude_km, latitude, longitude = table[:, :4].T
    field = model.at(latitude, longitude, altitude_km * 1e3, year)
    assert len(table) == 100
    columns = zip(field.elements().items(), table[:, 4:11].T, strict=True)
    for (element, value), official in columns:
        limit = PRINTED_DEG if element.endswith("_deg") else 1 * NT
        assert np.abs(value - official).max() < limit, element
    columns = zip(field.elements_per_year().items(), table[:, 11:].T, strict=True)
    for (element, value), official in columns:
        assert np.abs(value - official).max() < 2e-6, element


@pytest.mark.recordings
def test_official_grid(recordings: Path) -> None:
    """NOAA's grid of IGRF 2010 at 5 km, 57 960 points, printed to 0.1 nT."""
    folder = recordings / "authorities" / "dgrf-2010-01-01-5km"
    for axis, name in enumerate(("b_n", "b_e", "b_z")):
        table = np.loadtxt(folder / f"{name}.csv", delimiter=",")
        year, latitude, longitude, altitude_km, value, change = table.T
        field = igrf().at(latitude, longitude, altitude_km * 1e3, year)
        assert len(table) == 57_960
        assert np.abs(field.field_n[:, axis] - value).max() < 0.05 + 1e-6
        assert np.abs(field.secular_variation[:, axis] - change).max() < 0.05 + 1e-6


def test_files_are_those_named_in_the_source_list() -> None:
    listed = dict(
        re.findall(r"^\| (\S+) \| ([0-9a-f]{64}) \|$", (DATA / "SOURCE.md").read_text(), re.M)
    )
    shipped = {path.name: hash_file(path) for path in DATA.iterdir() if path.name != "SOURCE.md"}
    assert shipped == listed
    assert len(shipped) == 3


def test_models_agree_where_they_describe_the_same_field() -> None:
    """Core fields of the same year from two task forces: some nT, in a field of 50 000."""
    latitude, longitude = np.mgrid[-90:91:15, -180:180:30].reshape(2, -1)
    fields = [m.at(latitude, longitude, 0.0, 2025.0).field_n for m in (igrf(), wmm(), wmmhr())]
    assert np.sqrt(np.mean((fields[0] - fields[1]) ** 2)) < 15.0
    crust = np.sqrt(np.mean((fields[2] - fields[1]) ** 2))
    assert 20.0 < crust < 150.0, "WMMHR adds the crust, some tens of nT at the ground"


def test_degrees_and_years() -> None:
    assert [model.degree for model in (igrf(), wmm(), wmmhr())] == [13, 12, 133]
    spans = [(m.coefficients.starts[0], m.coefficients.until) for m in (igrf(), wmm(), wmmhr())]
    assert spans == [(1900.0, 2030.0), (2025.0, 2030.0), (2025.0, 2030.0)]


def test_published_uncertainty_of_the_declination() -> None:
    """WMM: √(0.26² + (5417/H)²) degrees; near the magnetic pole it says nothing any more."""
    field = wmm().at([0.0, 60.0, 85.9], [20.0, -100.0, 138.0], 0.0, 2026.0)
    stated = np.sqrt(0.26**2 + (5417.0 / field.horizontal) ** 2)
    assert np.allclose(field.declination_sd_deg, np.minimum(stated, 180.0), rtol=1e-12)
    assert field.declination_sd_deg[0] < 0.35 < 0.5 < field.declination_sd_deg[1]
    assert "WMM2025" in field.uncertainty.source
