"""The world models IGRF-14, WMM2025 and WMMHR2025, of the coefficient files in `data/`, offline."""

from __future__ import annotations

import functools
from importlib.resources import files

import numpy as np

from agonic.field.world_model import GaussCoefficients, Model
from agonic.field.worldfield import Uncertainty


@functools.cache
def igrf() -> Model:
    """The International Geomagnetic Reference Field, 14th generation, 1900 to 2030.

    Degree 13 (10 before 2000), linear between epochs five years apart; from 2030 to 2035 the last
    secular variation is extrapolated with a warning, as far as IAGA's own program goes.

    Source: IAGA Division V-MOD (2024), doi 10.5281/zenodo.14012302.

    >>> round(float(igrf().at(0.0, 0.0, 0.0, 2025.0).magnitude), 1)
    31835.4
    """
    return Model.of(
        "IGRF-14",
        read_shc(_text("IGRF14.shc")),
        Uncertainty(
            north=87.0,
            east=73.0,
            down=114.0,
            declination_deg=(0.0, float(np.degrees(np.sqrt((87.0**2 + 73.0**2) / 2.0)))),
            source="Beggan (2022), 68.3 % intervals of the components, "
            "doi 10.1186/s40623-022-01572-y; declination from the two horizontal ones",
        ),
        extrapolates_until=2035.0,
    )


@functools.cache
def wmm() -> Model:
    """The World Magnetic Model 2025, 2025.0 to 2030.0, degree 12; an error outside.

    Source: NOAA NCEI and British Geological Survey (2024), doi 10.25921/aqfd-sd83.

    >>> round(float(wmm().at(0.0, 0.0, 0.0, "2026-01-01").magnitude), 1)
    31813.1
    """
    return Model.of(
        "WMM2025",
        read_cof(_text("WMM2025.COF")),
        Uncertainty(
            north=137.0,
            east=89.0,
            down=141.0,
            declination_deg=(0.26, 5417.0),
            inclination_deg=0.20,
            horizontal=133.0,
            magnitude=138.0,
            source="WMM2025 technical report, error model (NOAA NCEI and BGS, 2024)",
        ),
    )


@functools.cache
def wmmhr() -> Model:
    """The World Magnetic Model High Resolution 2025, 2025.0 to 2030.0; an error outside.

    Core to degree 15, crust from 16 to 133 (wavelengths down to 300 km).

    Source: NOAA NCEI and British Geological Survey (2024), doi 10.25921/qb1c-vn52.

    >>> round(float(wmmhr().at(0.0, 0.0, 0.0, "2026-01-01").magnitude), 1)
    31806.2
    """
    return Model.of(
        "WMMHR2025",
        read_cof(_text("WMMHR2025.COF")),
        Uncertainty(
            north=135.0,
            east=85.0,
            down=134.0,
            declination_deg=(0.25, 5205.0),
            inclination_deg=0.19,
            horizontal=130.0,
            magnitude=134.0,
            source="WMMHR2025 error model (NOAA NCEI and CIRES, 2024)",
        ),
    )


def _text(name: str) -> str:
    return (files("agonic.field") / "data" / name).read_text(encoding="ascii")


def read_shc(text: str) -> GaussCoefficients:
    """The SHC format of the Swarm mission and the IGRF: one column for each epoch. After comments,
    a line of lowest and highest degree and number of epochs, then the epochs, then a line for each
    coefficient: degree, order (negative for h), and its value at each epoch."""
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    top = int(lines[0].split()[1])
    epochs = np.array(lines[1].split(), dtype=np.float64)
    table = np.array([line.split() for line in lines[2:]], dtype=np.float64)
    degree, order = table[:, 0].astype(int), table[:, 1].astype(int)
    nodes = np.zeros((len(epochs), 2, top + 1, top + 1))
    nodes[:, (order < 0).astype(int), degree, np.abs(order)] = table[:, 2:].T
    rate = np.diff(nodes, axis=0) / np.diff(epochs)[:, None, None, None]
    return GaussCoefficients(
        starts=epochs[:-1], until=float(epochs[-1]), value=nodes[:-1], rate=rate
    )


def read_cof(text: str) -> GaussCoefficients:
    """The COF format of the World Magnetic Model: one epoch, valid for five years. After a line
    with the epoch, a line for each degree and order: g, h, and their yearly change; a line of nines
    ends the file."""
    header, *lines = text.splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.startswith("9999")]
    table = np.array(rows, dtype=np.float64)
    degree, order = table[:, 0].astype(int), table[:, 1].astype(int)
    both = np.zeros((2, 2, degree.max() + 1, degree.max() + 1))
    both[:, :, degree, order] = table[:, 2:6].T.reshape(2, 2, -1)
    epoch = float(header.split()[0])
    return GaussCoefficients(
        starts=np.array([epoch]), until=epoch + 5.0, value=both[:1], rate=both[1:]
    )
