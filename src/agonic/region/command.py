"""`agonic map READINGS -o DIR`: the field of a region."""

from __future__ import annotations

from pathlib import Path

from agonic.console.options import Json, Unit
from agonic.errors import AgonicError


def map_region(
    readings: Path,
    out: Path | None = None,
    noise: float | None = None,
    position_sd: float = 0.0,
    measure_next: int = 5,
    unit: Unit = None,
    as_json: Json = False,
) -> int:
    """The field of a room or a coil between readings at known places, and where to measure next.

    Direction, strength and gradient with standard errors, without curl and divergence: for a region
    in which nothing magnetic stands, whatever stands around it.

    Options
    -------
    readings <READINGS> : A table: x_m, y_m, z_m and the calibrated field, with attitudes or in the
        axes of the region.
    out -o DIR : Folder for the page and map.csv.
    noise NT ≥0.001 : Of a reading on an axis, where it is known.
    position_sd M ≥0.0 : Standard deviation of each coordinate.
    measure_next --next N ≥1 : Places to name.
    """
    from agonic.console.finish import finish
    from agonic.region.document import describe_map
    from agonic.region.files import read_region, turn_level, write_map
    from agonic.region.fit import fit_map

    if out is not None and out.suffix:
        raise AgonicError(f"-o {out} is the folder for report.html and map.csv; name one")
    position, samples = read_region(readings, unit)
    turned = turn_level(samples)
    found = fit_map(
        position,
        samples.field if turned is None else turned,
        noise=noise,
        position_sd_m=position_sd,
        measure_next=measure_next,
        name=readings.stem,
    )
    made = describe_map(found, turned is not None, samples.origin)
    if out is None:
        return finish(made, as_json=as_json)
    out.mkdir(parents=True, exist_ok=True)
    files = [write_map(out / "map.csv", found)]
    return finish(made, files=files, report=out / "report.html", as_json=as_json)
