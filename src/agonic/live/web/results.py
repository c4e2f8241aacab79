"""`write_results`: the calibrations of a live session, written as `agonic calibrate` does."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from agonic.atomic import make_folder
from agonic.errors import AgonicError
from agonic.exports.csv import write_csv
from agonic.files.names import file_stem
from agonic.health import Finding
from agonic.live.streams import Source
from agonic.live.web.messages import Outcome
from agonic.live.web.plan import Plan
from agonic.provenance import Input, hash_file
from agonic.recording.calibrated import Calibrated, calibrate_as_named
from agonic.recording.document import Written
from agonic.recording.files import write_folder
from agonic.samples import Samples


def write_results(
    plan: Plan, source: Source, seen: Mapping[str, tuple[Samples, Sequence[Finding]]]
) -> tuple[list[Calibrated], dict[str, Written], list[Outcome]]:
    """Calibrate each sensor from its readings, and write the folder of the plan; `seen` are the
    readings that count, and what is to be said of those that do not."""
    if not seen:
        raise AgonicError("there are no readings yet; turn the sensor first")
    make_folder(plan.folder)
    results, failures = [], []
    for name, (readings, doubts) in seen.items():
        path = write_csv(readings, plan.folder / f"{file_stem(name)}-readings.csv")
        told = Input(name=path.name, sha256=hash_file(path), count=len(readings))
        try:
            readings = replace(readings, source=told)
            made = calibrate_as_named(readings, plan.reference, **plan.settings)
            results.append(replace(made, fit=made.fit.with_findings(*doubts)))
        except AgonicError as error:
            failures.append(Outcome(name, "refused", str(error), []))
    written = write_folder(results, plan.folder, title=f"Live: {source.name}", stack=source.stack)
    outcomes = [
        Outcome(r.samples.name, r.verdict, r.status, *written[r.samples.name][:2]) for r in results
    ]
    return results, written, outcomes + failures
