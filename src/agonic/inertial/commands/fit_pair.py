"""`agonic fit pair SHOTS -o SETUP`: accelerometer and magnetometer, from attitudes at rest."""

from __future__ import annotations

from pathlib import Path
from shlex import quote
from typing import TYPE_CHECKING, Any

import typer

from agonic.console.options import Between, Json, Place, Report, SensorChoice
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.reference import Reference
    from agonic.samples import Samples


def pair(
    context: typer.Context,
    log: Path,
    out: Path | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    between: Between = None,
    check: Path | None = None,
    report: Report = None,
    as_json: Json = False,
) -> int:
    """An accelerometer and a magnetometer together, from shots: attitudes at rest.

    Options
    -------
    log <SHOTS> : Attitudes at rest, one a row; column target: of the sight.
    out -o SETUP : Setup to write, .toml.
    check SETUP : Check this setup by a few shots.
    """
    from agonic.console.finish import finish
    from agonic.console.options import list_typed_options, write_options
    from agonic.console.place import find_reference
    from agonic.console.sensors import open_sensor
    from agonic.files.setup import load_setup, save_setup
    from agonic.inertial.pair import check_pair, fit_pair
    from agonic.inertial.pair.document import describe_check, describe_pair

    samples = open_sensor(log, *which, between)
    reference, _ = find_reference(samples, *place)
    if check is not None:
        if out is not None:
            raise AgonicError("--check only looks at a setup and writes none; leave -o out")
        checked = check_pair(samples, load_setup(check))
        return finish(describe_check(checked, samples.name), report=report, as_json=as_json)
    if out is not None and out.suffix.lower() != ".toml":
        raise AgonicError(f"-o {out} is not a setup, which holds both calibrations; name it .toml")
    fit = fit_pair(samples, reference)
    files, placed = [], _of_place(samples, reference)
    if out is not None and fit.verdict != "refused":
        files.append(save_setup(fit.make_setup(**placed), out))
    heading = f"agonic heading {quote(str(out))} {quote(str(log))} -o headings.csv"
    following = heading if placed else ""  # a true heading needs the declination
    if out is None:  # nothing is there to go on from
        typed = write_options(list_typed_options(context))
        following = f"agonic fit pair {quote(str(log))}{typed} -o setup.toml"
    document = describe_pair(fit, samples.name, following)
    return finish(document, files=files, report=report, as_json=as_json)


def _of_place(samples: Samples, reference: Reference | None) -> dict[str, Any]:
    """The declination and the field to expect, where the place is known."""
    import numpy as np

    if reference is None or reference.kind != "vector" or reference.frame != "n":
        return {}
    north, east, down = reference.values.mean(axis=0)
    return {
        "declination_deg": float(np.degrees(np.arctan2(east, north))),
        "horizontal": float(np.hypot(north, east)),
        "vertical": float(down),
    }
