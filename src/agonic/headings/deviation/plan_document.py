"""What is said of the plan of a swing: headings in their order, and standard errors to expect."""

from __future__ import annotations

from agonic.calibration.deviation import PARAMETERS, name_heading
from agonic.headings.deviation.plan import SwingPlan
from agonic.readable import make_record
from agonic.report.document import Document
from agonic.report.section import Section, Table


def describe_plan(plan: SwingPlan) -> Document:
    """The headings to steer, and to which side, and what they will tell.

    >>> from agonic.headings.deviation import plan_swing
    >>> print("\\n".join(describe_plan(plan_swing(8)).to_text().splitlines()[-3:]))
      D        0.500°
      E        0.500°
      heading  0.791° corrected with the card, level
    """
    sd = {name: s for name, s in zip(PARAMETERS, plan.sd.tolist(), strict=True) if s > 0.0}
    steered, heeled = plan.closed, bool(plan.roll_deg.any())
    steps = [
        [str(k), name_heading(float(compass)), *([f"{roll:+g}°"] if heeled else []), ""]
        for k, (compass, roll) in enumerate(zip(*steered, strict=True), start=1)
    ]
    head = ["", "Compass", *(["Roll"] if heeled else []), "Magnetic, by the better source"]
    expected = {
        name.replace("_", " "): f"{error:.3f}{'° per °' if '_' in name else '°'}"
        for name, error in sd.items()
    }
    expected["heading"] = f"{plan.heading_sd_deg:.3f}° corrected with the card, level"
    return Document(
        schema="agonic/plan-swing@1",
        kind="Plan of a swing",
        name="Deviation of a compass",
        status="Steer in this order, hold each until the compass is at rest "
        f"({plan.noise_deg:g}° a reading); the first comes again at the end, where a reference "
        "that drifts shows. Fill in the form, then: agonic fit deviation FORM.",
        sections=[
            Section("", [Table(head, steps, "form")], printed=True),
            Section("Standard errors to expect", [expected], printed=True),
        ],
        values={
            **make_record(plan),
            "roll_deg": plan.roll_deg if heeled else None,
            "sd": sd,
        },
    )
