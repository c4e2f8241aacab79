"""`agonic demo`: the main job on a simulated log, truth beside estimate."""

from __future__ import annotations

from pathlib import Path

from agonic.console.options import Json


def demo(
    out: Path = Path("agonic-demo"),
    seed: int = 1,
    as_json: Json = False,
) -> int:
    """Simulate a hand-turned sensor with outliers, calibrate it, and compare with the truth.

    Options
    -------
    out -o DIR : Folder to write to.
    seed : Another seed, another sensor.
    """
    from dataclasses import replace

    from agonic import simulation
    from agonic.atomic import make_folder
    from agonic.calibration.affine import PARAMETERS
    from agonic.console.finish import finish
    from agonic.exports.csv import write_csv
    from agonic.logs.read import open_log
    from agonic.maths.equation.symmetric import pack_symmetric
    from agonic.recording.document import describe_recording
    from agonic.recording.files import write_folder
    from agonic.recording.mounting import calibrate
    from agonic.reference import Reference
    from agonic.report.digits import round_to_sd
    from agonic.report.section import Section, Table

    made = simulation.simulate(
        "hand", noise=200.0, seed=seed, defects=[simulation.with_outliers(0.02, seed=seed)]
    )
    make_folder(out)
    log = open_log(write_csv(made.samples, out / "demo.csv"))
    result = calibrate(log.sensors[0], Reference.constant(50_000, source="the simulation"))
    written = write_folder([result], out, title=log.path.name)
    fit, truth = result.fit, [*made.truth.bias, *pack_symmetric(made.truth.matrix)]
    found = [*fit.calibration.bias, *pack_symmetric(fit.calibration.matrix)]
    rows = []
    for name, true, value, sd in zip(PARAMETERS, truth, found, fit.sd, strict=True):
        digits = 1 if name.startswith("bias") else 6
        error = "" if sd == 0 else f"{(value - true) / sd:.2f}"
        rows.append([name, f"{true:.{digits}f}", f"{value:.{digits}f}", round_to_sd(sd, sd), error])
    table = Table(["", "truth", "found", "sd", "error/sd"], rows)
    document = describe_recording([result], written=written, schema="agonic/demo@1")
    (shown,) = document.sensors
    table_has = ("Bias", "Matrix")
    entries = {k: v for k, v in (shown.entries or {}).items() if k not in table_has}
    section = Section("", [table], printed=True)
    shown = replace(shown, entries=entries, details=None, sections=[section])
    values = {"truth": dict(zip(PARAMETERS, truth, strict=True))}
    return finish(
        replace(document, values=values, sensors=[shown]),
        page=out / "report.html",
        as_json=as_json,
    )
