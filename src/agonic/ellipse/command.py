"""What `agonic calibrate` does with a log whose magnetometers have x and y alone."""

from __future__ import annotations

import shlex
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from agonic.atomic import make_folder, write_atomically
from agonic.calibration.setup import Compass, Setup
from agonic.console.finish import finish
from agonic.console.options import Place, SensorChoice, write_options
from agonic.console.place import find_reference
from agonic.console.sensors import open_sensors
from agonic.ellipse.document import describe_two_axes
from agonic.ellipse.fit import fit_ellipse
from agonic.ellipse.result import EllipseFit
from agonic.errors import AgonicError, CoverageError
from agonic.files.calibration import save
from agonic.files.names import file_stem, find_stale
from agonic.files.setup import save_setup
from agonic.logs.log import allow_two_axes
from agonic.samples import Samples


def calibrate_two_axes(
    log: Path,
    folder: Path,
    *,
    which: SensorChoice,
    between: str | None,
    place: Place,
    asked: Mapping[str, object],
    brief: bool,
    as_json: bool,
    open_page: bool,
) -> int:
    """Calibrate the two-axis compasses of a log, write their files, and say the result.

    `asked` are options that say nothing of two axes, by name: one that was given is an error.
    """
    for option, value in asked.items():
        if value:
            raise AgonicError(
                f"{log.name} holds a two-axis compass, x and y alone, for which {option} does not "
                "work; leave it out, or say with --columns which column is z"
            )
    with allow_two_axes():
        recording, sensors = open_sensors(log, *which, between)
    fits: list[EllipseFit] = []
    failures: list[tuple[str, str]] = []
    for samples in sensors:
        reference, _ = find_reference(samples, *place)
        try:
            fits.append(fit_ellipse(samples, reference))
        except CoverageError as error:
            failures.append((samples.name, str(error)))
    page = folder / "report.html"
    make_folder(folder)
    files = _write_files(fits, folder)
    document = describe_two_axes(
        fits,
        title=recording.source.name,
        files=[*files, str(page)],
        failures=failures,
        stale=find_stale(folder, files),
    )
    write_atomically(page, document.to_html())
    if files and document.good:
        document = replace(document, next_step=_choose_command(files[-1], log, place, sensors[0]))
    return finish(document, page=page, as_json=as_json, brief=brief, open_page=open_page)


def _choose_command(setup: str, log: Path, place: Place, one: Samples) -> str:
    """Headings by the setup that was written, where the place is known."""
    if place.at is None and one.latitude_deg is None:
        return ""
    given = (("--at", place.at), ("--date", place.date))
    named = {name: value for name, value in given if value}
    files = f"{shlex.quote(setup)} {shlex.quote(str(log))}"
    return f"agonic heading {files}{write_options(named)} -o headings.csv"


def _write_files(fits: Sequence[EllipseFit], folder: Path) -> list[str]:
    """The calibration of each sensor that was not refused, and the setup of a level vehicle."""
    usable = [fit for fit in fits if fit.verdict != "refused"]
    files = {
        fit.samples.name: save(fit.calibration, folder / f"{file_stem(fit.samples.name)}.json")
        for fit in usable
    }
    if not files:
        return []
    setup = Setup(
        compasses=tuple(Compass(calibration=fit.calibration) for fit in usable), tilt="level"
    )
    saved = {name: Path(path).name for name, path in files.items()}
    return [*map(str, files.values()), str(save_setup(setup, folder / "setup.toml", saved=saved))]
