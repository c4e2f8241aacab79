"""The world model beside its peers: points a second and largest difference, in one run.

    python benchmarks/field.py

Every point has its own place and epoch. Peers that are installed are compared with the model that
they compute: ppigrf and chaosmagpy with the IGRF, pygeomag and wmm-calculator with the WMM.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable, Iterator
from datetime import datetime, timedelta
from importlib.resources import files

import numpy as np
from numpy.typing import NDArray

from agonic.field import world_model as model_module
from agonic.field.published import igrf, wmm, wmmhr
from agonic.field.world_model import Model

Array = NDArray[np.float64]
Points = tuple[Array, Array, Array, Array]
Evaluate = Callable[[Array, Array, Array, Array], Array]

POLES = (np.array([90.0, -90.0]), np.array([30.0, 30.0]), np.zeros(2), np.full(2, 2026.0))


def points(n: int) -> Points:
    """Places all over the world up to 600 km high, and epochs between 2025 and 2030."""
    rng = np.random.default_rng(5)
    latitude = np.degrees(np.arcsin(rng.uniform(-1.0, 1.0, n)))
    return latitude, rng.uniform(-180, 180, n), rng.uniform(0, 6e5, n), rng.uniform(2025, 2029.9, n)


def agonic(model: Model, compiled: bool) -> Evaluate:
    """Our own, with and without the compiled kernel."""

    def evaluate(latitude: Array, longitude: Array, altitude: Array, year: Array) -> Array:
        model_module.COMPILE_FROM = 0 if compiled else 2**62
        return model.at(latitude, longitude, altitude, year).field_n

    return evaluate


def ppigrf() -> Evaluate:
    """One call for each point: the package takes many dates, but each for all places."""
    import ppigrf

    def evaluate(latitude: Array, longitude: Array, altitude: Array, year: Array) -> Array:
        rows = []
        for place in zip(longitude, latitude, altitude / 1e3, year, strict=True):
            start = datetime(int(place[3]), 1, 1)
            length = datetime(int(place[3]) + 1, 1, 1) - start
            moment = start + timedelta(seconds=(place[3] % 1.0) * length.total_seconds())
            east, north, up = (float(part.item()) for part in ppigrf.igrf(*place[:3], moment))
            rows.append((north, east, -up))
        return np.array(rows)

    return evaluate


def chaosmagpy() -> Evaluate:
    """All points at once; coordinates and components turned to geodetic with its own functions."""
    import chaosmagpy

    path = str(files("agonic.field") / "data" / "IGRF14.shc")
    model = chaosmagpy.chaos.BaseModel.from_shc(path, leap_year=True)

    def evaluate(latitude: Array, longitude: Array, altitude: Array, year: Array) -> Array:
        moment = chaosmagpy.data_utils.dyear_to_mjd(year, leap_year=True)
        radius, theta = chaosmagpy.coordinate_utils.gg_to_geo(altitude / 1e3, 90.0 - latitude)
        outward, south, east = model.synth_values(moment, radius, theta, longitude)
        *_, north, down = chaosmagpy.coordinate_utils.geo_to_gg(radius, theta, outward, south)
        return np.stack([north, east, down], axis=1)

    return evaluate


def pygeomag() -> Evaluate:
    """One call for each point."""
    from pygeomag import GeoMag

    model = GeoMag(coefficients_file="wmm/WMM_2025.COF")

    def evaluate(latitude: Array, longitude: Array, altitude: Array, year: Array) -> Array:
        places = zip(latitude, longitude, altitude / 1e3, year, strict=True)
        results = (model.calculate(glat=a, glon=b, alt=c, time=t) for a, b, c, t in places)
        return np.array([(result.x, result.y, result.z) for result in results])

    return evaluate


def wmm_calculator() -> Evaluate:
    """All points at once."""
    from wmm import wmm_calc

    def evaluate(latitude: Array, longitude: Array, altitude: Array, year: Array) -> Array:
        model = wmm_calc()
        model.setup_time(dyear=year)
        model.setup_env(latitude, longitude, altitude / 1e3, unit="km")
        return np.stack(model.forward_base(), axis=1)

    return evaluate


def seconds(evaluate: Evaluate, where: Points, times: int) -> float:
    """The fastest of some runs, after one that loads and compiles."""
    evaluate(*(values[:1000] for values in where))
    runs = []
    for _ in range(times):
        start = time.process_time()
        evaluate(*where)
        runs.append(time.process_time() - start)
    return min(runs)


def rows() -> Iterator[tuple[str, ...]]:
    """A row of the table for each implementation."""
    ours = {model.name: agonic(model, compiled=False) for model in (igrf(), wmm(), wmmhr())}
    runs: list[tuple[str, Model, Callable[[], Evaluate], int]] = [
        ("agonic", igrf(), lambda: agonic(igrf(), compiled=False), 500_000),
        ("agonic[fast]", igrf(), lambda: agonic(igrf(), compiled=True), 500_000),
        ("chaosmagpy", igrf(), chaosmagpy, 100_000),
        ("ppigrf", igrf(), ppigrf, 50),
        ("agonic", wmm(), lambda: agonic(wmm(), compiled=False), 500_000),
        ("agonic[fast]", wmm(), lambda: agonic(wmm(), compiled=True), 500_000),
        ("wmm-calculator", wmm(), wmm_calculator, 100_000),
        ("pygeomag", wmm(), pygeomag, 2000),
        ("agonic", wmmhr(), lambda: agonic(wmmhr(), compiled=False), 2000),
        ("agonic[fast]", wmmhr(), lambda: agonic(wmmhr(), compiled=True), 50_000),
    ]
    for name, model, load, n in runs:
        try:
            evaluate = load()
        except ImportError:
            yield name, model.name, "not installed", "", ""
            continue
        where = points(n)
        speed = n / seconds(evaluate, where, times=3)
        reference = ours[model.name]
        apart = [np.abs(evaluate(*w) - reference(*w)).max() for w in (where, POLES)]
        yield name, model.name, f"{speed:.2g}", *(f"{difference:.1g}" for difference in apart)


def main() -> None:
    """Print the table."""
    warnings.simplefilter("ignore")
    print("| package | model | points/s | largest difference, nT | at the poles, nT |")
    print("|---|---|---:|---:|---:|")
    for row in rows():
        print("|", " | ".join(row), "|", flush=True)


if __name__ == "__main__":
    main()
