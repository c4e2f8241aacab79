"""What is said of the headings of a log as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from agonic.arrays import Array, Mask
from agonic.headings.result import FLAGS, Heading
from agonic.maths.rotations.angles import wrap_deg
from agonic.maths.rotations.tilt import compute_down, tilt_from_angles
from agonic.provenance import Input
from agonic.report.axes import Axis, Columns, over_rows
from agonic.report.digits import group_digits, write_minus
from agonic.report.document import Document
from agonic.report.figure import Figure, figure, robust_limit
from agonic.report.marks import Mark, band, foot, line, mean, spread
from agonic.report.section import Block, Section, Table, list_inputs
from agonic.samples import Samples

WIDE = 2.0
"""Standard errors that the band of a heading reaches to either side."""


def draw_heading(found: Heading) -> Figure:
    """The true heading over time with its band."""
    columns, turned = over_rows(found.time, len(found)), _fill(found.true_deg, found.trusted)
    reach = WIDE * columns.mean(_fill(found.sd_deg, found.trusted))
    least, largest, middle = columns.least(turned), columns.largest(turned), columns.mean(turned)
    through_north = (largest - least > 180.0) | (np.abs(np.diff(middle, append=middle[-1])) > 180.0)
    gap = np.where(through_north, np.nan, 0.0)  # 359° is beside 1°, and far on the paper
    return figure(
        "Heading",
        columns.x,
        Axis("true heading, °", 0.0, 360.0),
        band(columns, least - reach + gap, largest + reach + gap, "range", "± 2 standard errors"),
        line(columns, middle + gap, words="heading"),
        _mark_doubted(found, columns),
    )


def draw_sd(found: Heading) -> Figure:
    """The standard error of the heading over time, and the part that noise makes."""
    columns = over_rows(found.time, len(found))
    sd, random = (_fill(v, found.trusted) for v in (found.sd_deg, found.random_sd_deg))
    noise = np.where(random > 0.0, random, np.nan)  # smoothed headings have none to tell
    top = robust_limit(sd, 0.1, found.trusted.astype(np.float64))
    return figure(
        "Standard error",
        columns.x,
        Axis("standard error, °", 0.0, 1.1 * top),
        spread(columns, sd, words="standard error"),
        mean(columns, noise, "noise", "of which noise, new in every reading"),
        _mark_doubted(found, columns),
    )


def draw_field(found: Heading, field: Array) -> list[Figure]:
    """Strength and dip of the calibrated field (n, 3) over time, steady where all is well."""
    down = compute_down(tilt_from_angles(found.roll_deg, found.pitch_deg))
    size = np.linalg.norm(field, axis=1)
    dip = np.degrees(np.arcsin(np.clip(np.einsum("ni,ni->n", field, down) / size, -1, 1)))
    columns, made = over_rows(found.time, len(found)), []
    for name, values, unit in (("Strength", size, "nT"), ("Dip", dip, "°")):
        known = _fill(values, np.isfinite(values))
        low, high = np.percentile(known, (0.5, 99.5)).tolist()
        margin = max(0.15 * (high - low), 1e-3 * abs(high), 1e-9)
        y = Axis(f"{name.lower()}, {unit}", low - margin, high + margin)
        marks = spread(columns, known), mean(columns, known), _mark_doubted(found, columns)
        made.append(figure(f"{name} of the field", columns.x, y, *marks))
    return made


def _mark_doubted(found: Heading, columns: Columns) -> Mark:
    return foot(columns, ~found.trusted, "held-out", "rows that a flag marks")


def list_flags(found: Heading) -> list[list[str]]:
    """What not to trust: each flag that marks a row, how many, and what it means."""
    n = max(len(found), 1)
    return [
        [name, f"{100 * int(rows.sum()) / n:.1f} %", FLAGS[name]]
        for name, rows in found.flags.items()
        if rows.any()
    ]


def _fill(values: Array, known: Mask) -> Array:
    """Values with the median of those that are known where there is none."""
    usable = known & np.isfinite(values)
    middle = float(np.median(values[usable])) if usable.any() else 0.0
    return np.where(np.isfinite(values), values, middle)


EQUATION = "magnetic = compass + deviation(compass); true = magnetic + declination"


def describe_headings(
    found: Heading,
    samples: Samples | None = None,
    *,
    field: Array | None = None,
    notes: Sequence[str] = (),
    inputs: Sequence[Input | None] = (),
) -> Document:
    """How many headings can be trusted, how far, and why the others cannot.

    Those that were logged with the `samples` of the first sensor are compared with; the page draws
    strength and dip of its `field` (n, 3). `notes` say what was assumed, `inputs` the files.
    """
    values = _list_values(found, samples)
    said, flags = (*found.notes, *notes), list_flags(found)
    drawn: list[Block] = [lambda: draw_heading(found), lambda: draw_sd(found)]
    if field is not None and len(field) == len(found):
        drawn.append(lambda: draw_field(found, field))
    doubts: Block = "No flag marks any row."
    if flags:
        doubts = Table(("Flag", "Rows", "Meaning"), flags, style="findings")
    return Document(
        schema="agonic/heading@1",
        kind="True headings",
        name=found.sensors[0] if samples is None else samples.name,
        entries=_list_entries(found, values),
        entries_title="Headings",
        sections=[
            Section("Over time", drawn),
            Section("What not to trust", [doubts]),
            list_inputs(*inputs, equation=EQUATION),
        ],
        remarks=said,
        values=values | {"notes": said},
    )


def _list_values(found: Heading, samples: Samples | None) -> dict[str, Any]:
    """The numbers of the headings, by name."""
    trusted = found.trusted
    return {
        "sensors": found.sensors,
        "n": len(found),
        "trusted": int(trusted.sum()),
        "tilt": found.tilt,
        "method": found.method,
        "tilt_sd_deg": _median(found.tilt_sd_deg, trusted),
        "declination_deg": float(np.median(found.declination_deg)),
        "sd_deg": _median(found.sd_deg, trusted),
        "random_sd_deg": _median(found.random_sd_deg, trusted),
        "flagged": {name: int(rows.sum()) for name, rows in found.flags.items() if rows.any()},
        "used": {name: int((found.used == k).sum()) for k, name in enumerate(found.sensors)},
        "disagreement_deg": _rms(found.disagreement_deg, trusted),
        "against_log": _compare_with_log(found, samples, trusted),
        "faults": [fault.values() for fault in found.faults],
    }


def _list_entries(found: Heading, values: Mapping[str, Any]) -> dict[str, str]:
    """The same in words; what is not known is left out."""
    n, sd, tilt_sd = len(found), values["sd_deg"], values["tilt_sd_deg"]
    random_sd = values["random_sd_deg"]  # smoothed headings have none to tell
    noise = f", noise {random_sd:.2f}°" if random_sd else ""
    tilt = "roll and pitch of the log" if found.tilt == "log" else found.tilt
    declination = write_minus(f"{values['declination_deg']:.2f}")
    entries = {
        "Headings": f"{group_digits(n)} of {', '.join(found.sensors)}, "
        f"{group_digits(values['trusted'])} to trust",
        "Error": "" if sd is None else f"{sd:.2f}° (median standard error){noise}",
        "Tilt": tilt if sd is None else f"{tilt}, good to {tilt_sd:.2f}° (median)",
        "Declination": f"{declination}°",
        "Method": found.method,
    }
    if flagged := values["flagged"]:
        shares = (f"{100 * rows / n:.1f} % {name}" for name, rows in flagged.items())
        entries["Flagged"] = ", ".join(shares)
    if (apart := values["disagreement_deg"]) is not None:
        shares = (f"{name} {100 * rows / n:.0f} %" for name, rows in values["used"].items())
        entries["Sensors"] = f"differ by {apart:.2f}° rms; used: {', '.join(shares)}"
    if found.faults:
        entries["Faults"] = "; ".join(fault.sentence for fault in found.faults)
    if (against := values["against_log"]) is not None:
        entries["Against"] = (
            f"the logged heading: true − logged, mean {against['mean_deg']:+.2f}°, "
            f"rms {against['rms_deg']:.2f}°"
        )
    return entries


def _median(values: Array, rows: Mask) -> float | None:
    return float(np.median(values[rows])) if rows.any() else None


def _rms(values: Array | None, rows: Mask) -> float | None:
    if values is None:
        return None
    known = values[rows & np.isfinite(values)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else None


def _compare_with_log(
    found: Heading, samples: Samples | None, rows: Mask
) -> dict[str, float] | None:
    """Mean and rms of true − logged heading over trusted rows, where the log has a heading."""
    if samples is None or samples.heading_deg is None or not rows.any():
        return None
    difference = wrap_deg(found.true_deg - samples.heading_deg)[rows]
    return {
        "mean_deg": float(np.mean(difference)),
        "rms_deg": float(np.sqrt(np.mean(difference**2))),
    }
