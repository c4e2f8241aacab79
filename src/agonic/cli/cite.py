"""`agonic cite CAL`: the publications behind a calibration."""

from __future__ import annotations

from agonic.console.options import CalibrationPath, Json


def cite(cal: CalibrationPath, as_json: Json = False) -> int:
    """List the software, the methods' sources and the inputs of a calibration."""
    from agonic.calibration.steps import list_origins
    from agonic.citations import find_citation, list_cited
    from agonic.console.output import print_json, say
    from agonic.files.calibration import load
    from agonic.report.digits import count

    made = list_origins(load(cal))
    provenance = made[0]
    keys = [key for one in made for key in list_cited(one.method, one.settings)]
    sources = {key: find_citation(key) for key in keys}
    inputs = dict.fromkeys(given for one in made for given in one.inputs)
    if as_json:
        print_json(
            "agonic/cite@1",
            {
                "software": provenance.software,
                "created": provenance.created,
                "sources": sources,
                "inputs": [{"name": i.name, "sha256": i.sha256, "count": i.count} for i in inputs],
            },
        )
        return 0
    say(f"{provenance.software}, {provenance.created}")
    for text in sources.values():
        say(f"\n{text}")
    for given in inputs:
        say(f"\n{given.name} ({count(given.count, 'reading')}), SHA-256 {given.sha256}")
    return 0
