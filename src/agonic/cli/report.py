"""`agonic report CAL [LOG]`: the page for a calibration file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from agonic.console.options import CalibrationPath, Json, Place, SensorChoice
from agonic.errors import AgonicError

if TYPE_CHECKING:
    from agonic.calibration.base import Calibration
    from agonic.calibration.network import Network
    from agonic.calibration.thermal import Thermal
    from agonic.reference import Reference
    from agonic.report.document import Document
    from agonic.samples import Samples


def report(
    cal: CalibrationPath,
    log: Path | None = None,
    out: Path | None = None,
    which: SensorChoice = SensorChoice(),
    place: Place = Place(),
    as_json: Json = False,
) -> int:
    """Show what a calibration does to a log: spheres, residuals, checks, provenance.

    One over temperature, or a network, is shown without a log too: its numbers and range.

    Options
    -------
    log <[LOG]> : Readings; default: the log it was made from.
    out -o HTML : Page; default beside CAL.
    """
    from agonic.atomic import write_atomically
    from agonic.calibration.network import Network
    from agonic.calibration.steps import find_step, require_calibration
    from agonic.calibration.thermal import Thermal
    from agonic.cli.calibration_and_log import open_calibration_and_log
    from agonic.console.output import print_json, say
    from agonic.console.place import find_reference
    from agonic.files.calibration import load
    from agonic.recording.comparison import judge
    from agonic.recording.document import describe_recording

    given = require_calibration(load(cal))
    step = find_step(given, Network) or find_step(given, Thermal)
    if step is not None:
        samples, reference = None, None
        if log is not None:
            _, samples = open_calibration_and_log(cal, log, *which)
            reference, _ = find_reference(samples, *place)
        document, values = _describe_file(given, step, cal, samples, reference)
    else:
        calibration, samples = open_calibration_and_log(cal, log or find_own_log(cal), *which)
        reference, settings = find_reference(samples, *place)
        result = judge(calibration, samples, reference, **settings)
        document = describe_recording([result], title=f"{cal.name} on {samples.name}")
        values = document.sensors[0].to_record()
    page = write_atomically(out or cal.with_suffix(".html"), document.to_html())
    if as_json:
        print_json("agonic/report@1", values | {"files": [str(page)]})
    else:
        say(f"Report    {page}")
    return 0 if values["verdict"] == "good" else 1


def _describe_file(
    calibration: Calibration,
    step: Network | Thermal,
    cal: Path,
    samples: Samples | None,
    reference: Reference | None,
) -> tuple[Document, dict[str, Any]]:
    """A calibration over temperature, or a network, as a page and in JSON; with what it does to a
    log."""
    from dataclasses import asdict

    from agonic.calibration.network import Network
    from agonic.network.report.document import describe_network_file
    from agonic.thermal.calibration_document import describe_calibration
    from agonic.verification import verify

    verification = None
    if samples is not None:
        known = reference if isinstance(step, Network) or calibration.unit_out == "nT" else None
        verification = verify(calibration, samples, known)
    title = cal.name if samples is None else f"{cal.name} on {samples.name}"
    shown: dict[str, Any] = {"title": title, "samples": samples, "verification": verification}
    about: dict[str, Any]
    if isinstance(step, Network):
        document = describe_network_file(calibration, step, **shown)
        about = {"hidden": step.shape.hidden, "target": step.target}
    else:
        document = describe_calibration(calibration, step, **shown)
        about = {"range_C": step.validity.temperature_C, "degree": step.degree}
    good = verification is None or verification.passed
    return document, {
        "sensor": calibration.sensor,
        "method": step.kind,
        "verdict": "good" if good else "check",
        "checks": [asdict(c) for c in verification.checks] if verification else [],
        **about,
    }


def find_own_log(cal: Path) -> Path:
    """The log that a calibration was made from, where it still lies nearby unchanged."""
    from agonic.calibration.steps import list_origins, require_calibration
    from agonic.files.calibration import load
    from agonic.provenance import hash_file

    made = list_origins(require_calibration(load(cal)))
    inputs = tuple(dict.fromkeys(given for one in made for given in one.inputs))
    for given in inputs:
        for folder in (cal.parent, cal.parent.parent, Path()):
            path = folder / given.name
            if path.is_file() and hash_file(path) == given.sha256:
                return path
    names = ", ".join(given.name for given in inputs) or "its log"
    raise AgonicError(f"{names} is not beside {cal}; name the log: agonic report {cal} LOG")
