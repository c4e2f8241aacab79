"""What is said of the headings of a log as a whole."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from agonic.arrays import Array, Mask
from agonic.headings import figures
from agonic.headings.result import Heading
from agonic.maths.rotations.angles import wrap_deg
from agonic.provenance import Input
from agonic.report.digits import group_digits, write_minus
from agonic.report.document import Document
from agonic.report.origin import list_inputs
from agonic.report.section import Block, Section, Table
from agonic.samples import Samples

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

    Parameters
    ----------
    found : the headings. samples : the readings of the first sensor, for the heading that was
        logged. field : (n, 3) that it gives, whose strength and dip the page draws.
    notes : on what was assumed, beside those of the headings. inputs : files that it rests on.
    """
    values = _list_values(found, samples)
    said = (*found.notes, *notes)
    return Document(
        schema="agonic/heading@1",
        kind="True headings",
        name=found.sensors[0] if samples is None else samples.name,
        entries=_list_entries(found, values),
        entries_title="Headings",
        sections=[*_list_sections(found, field), list_inputs(*inputs, equation=EQUATION)],
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
    if (against := values["against_log"]) is not None:
        entries["Against"] = (
            f"the logged heading: true − logged, mean {against['mean_deg']:+.2f}°, "
            f"rms {against['rms_deg']:.2f}°"
        )
    return entries


def _list_sections(found: Heading, field: Array | None) -> list[Section]:
    """What the page draws, and what not to trust."""
    drawn: list[Block] = [lambda: figures.draw_heading(found), lambda: figures.draw_sd(found)]
    if field is not None and len(field) == len(found):
        drawn.append(lambda: figures.draw_field(found, field))
    flags = figures.list_flags(found)
    table = Table(("Flag", "Rows", "Meaning"), flags, style="findings")
    said: list[Block] = [table] if flags else ["No flag marks any row."]
    return [Section("Over time", drawn), Section("What not to trust", said)]


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
