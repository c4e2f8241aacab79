"""`agonic info LOG`: what a recording holds."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from agonic.console.options import Json, LogPath, Mounting, Unit

if TYPE_CHECKING:
    from agonic.logs.log import Log
    from agonic.samples import Samples


def info(log: LogPath, unit: Unit = None, mounting: Mounting = None, as_json: Json = False) -> int:
    """List the magnetometers of a log, their rates, units and oddities, and what else is there."""
    from dataclasses import replace

    from agonic.console.output import print_json, say
    from agonic.console.parse import parse_mounting
    from agonic.logs.read import open_log
    from agonic.report.digits import typeset

    recording = open_log(log, unit=unit)
    if mounting is not None:  # into body axes
        from agonic.recording.mounting import turn_readings

        turn = parse_mounting(mounting)
        turned = tuple(turn_readings(one, turn) for one in recording.sensors)
        recording = replace(recording, sensors=turned)
    found = _describe_log(recording)
    if as_json:
        print_json("agonic/info@1", found)
    else:
        say(typeset(_text(recording, found)))
    return 0


def _describe_log(log: Log) -> dict[str, Any]:
    return {
        "file": log.path.name,
        "format": log.format,
        "sha256": log.source.sha256,
        "notes": log.notes,
        "sensors": [_sensor(samples) for samples in log.sensors],
        "streams": [
            {"name": stream.name, "rows": stream.rows, "rate_Hz": stream.rate_Hz}
            for stream in log.streams
        ],
    }


def _sensor(samples: Samples) -> dict[str, Any]:
    import numpy as np

    from agonic.calibration.sources import list_disturbers
    from agonic.health import describe, find_quantisation

    columns = samples.columns()

    time = samples.time
    rate = None if time is None or len(time) < 2 else 1 / float(np.median(np.diff(time)))
    return {
        "sensor": samples.name,
        "rows": len(samples),
        "rate_Hz": rate,
        "duration_s": samples.duration_s,
        "epoch": None if samples.epoch is None else samples.epoch.isoformat(),
        "unit": samples.unit,
        "frame": samples.frame,
        "device_id": samples.device_id,
        "step": find_quantisation(samples.field),
        "range": [samples.field.min(axis=0), samples.field.max(axis=0)],
        "columns": list(samples.columns()),
        "disturbers": {
            name: [columns[name].min(), columns[name].max()]
            for name in list_disturbers(samples)
            if name != "second" and np.ptp(columns[name]) > 0
        },
        "corrected": None if samples.logged is None else samples.logged.source,
        "notes": samples.notes,
        "findings": [
            {"name": f.name, "severity": f.severity, "what": f.what, "move": f.move}
            for f in describe(samples)
        ],
    }


def _write_number(value: float) -> str:
    """A number to six digits, its thousands set apart as everywhere."""
    from agonic.report.digits import MINUS, THIN

    return f"{value:,.6g}".replace(",", THIN).replace("-", MINUS)


def _text(log: Log, found: dict[str, Any]) -> str:
    lines = [f"{log.path.name}: {log.format}", *(f"  {note}" for note in log.notes)]
    for s in found["sensors"]:
        rate = "no times" if s["rate_Hz"] is None else f"{s['rate_Hz']:.4g} Hz"
        span = "" if s["duration_s"] is None else f" over {s['duration_s']:.5g} s"
        low, high = s["range"]
        unit = s["unit"]
        ranges = ", ".join(
            f"{axis} {_write_number(a)} … {_write_number(b)}"
            for axis, a, b in zip("xyz", low, high, strict=True)
        )
        lines += [
            f"\n{s['sensor']}: {s['rows']} readings at {rate}{span}, axes of frame {s['frame']}",
            f"  range     {ranges} {unit}",
            f"  columns   {', '.join(s['columns'])}",
        ]
        if s["disturbers"]:
            ends = (f"{n} {a:.4g} … {b:.4g}" for n, (a, b) in s["disturbers"].items())
            lines.append(f"  disturbs? {', '.join(ends)} (agonic calibrate tries them)")
        if s["device_id"] is not None:
            lines.append(f"  device    {s['device_id']}")
        told = [f"{f['what']}{'; ' * bool(f['move'])}{f['move']}" for f in s["findings"]]
        notes = (note for note in s["notes"] if not any(note in what for what in told))
        lines += [f"  note      {note}" for note in notes]
        marks = (f["severity"] for f in s["findings"])
        lines += [f"  {mark:<9} {what}" for mark, what in zip(marks, told, strict=True)]
    if log.streams:
        names = ", ".join(f"{stream.name} ({stream.rows})" for stream in log.streams)
        lines.append(f"\nalso      {names}")
    return "\n".join(lines)
