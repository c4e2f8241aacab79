"""What is said of where a second magnetometer should sit."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from agonic.attitude.disturbers.placement import Mix
from agonic.report.digits import quantity, significant
from agonic.report.document import Document
from agonic.report.section import Section, Table

ALIKE = 0.3
"""Share of a disturbance that is the same at both places from which a mix costs much noise."""
HEAD = ("Magnetometers", "Disturbance left", "Noise", "Heading, one reading")


def describe_placement(mix: Mix, horizontal: float) -> Document:
    """Of a recording of two: what their mix leaves, what it costs, and where would be better."""
    return Document(
        schema="agonic/plan-placement@1",
        kind="Two magnetometers strapped down",
        name=f"{mix.first} and {mix.second}",
        status=f"{_judge(mix)} {_advise(mix)}",
        entries={
            "Alone": f"{quantity(mix.before, 'nT', 2)} of disturbance on an axis, noise "
            f"{quantity(mix.noise_before, 'nT', 2)}",
            "Mixed": f"{quantity(mix.left, 'nT', 2)} of disturbance on an axis, noise "
            f"{quantity(mix.noise, 'nT', 2)}, {significant(mix.noise_factor, 2)} times",
            "Heading": f"{significant(mix.heading_deg(horizontal), 2)}° of one reading in "
            f"{quantity(horizontal, 'nT', 3)} of level field",
            "Mix": "raw₁ − G (raw₂ − raw₁), G = "
            + "; ".join(" ".join(f"{v:.2f}" for v in row) for row in mix.matrix),
        },
        values={**_values(mix, horizontal), "matrix": mix.matrix},
    )


def describe_places(ranked: Sequence[Mix], horizontal: float) -> Document:
    """Of a table of places: pairs and single places, the best first."""
    best = ranked[0]
    alone = next(mix for mix in ranked if not mix.second)
    rows = [
        [
            _name(mix),
            quantity(mix.left, "nT", 2),
            f"{significant(mix.noise_factor, 2)} ×",
            f"{significant(mix.heading_deg(horizontal), 2)}°",
        ]
        for mix in ranked
    ]
    said = (
        f"Best is {_name(best)}, which leaves {quantity(best.left, 'nT', 2)} of disturbance at "
        f"{significant(best.noise_factor, 2)} times the noise"
    )
    if best is not alone:
        said += f"; {alone.first} alone has {quantity(alone.left, 'nT', 2)}"
    return Document(
        schema="agonic/plan-placement@1",
        kind="Places for magnetometers",
        name="places",
        status=f"{said}.",
        sections=[Section("Places", [Table(HEAD, rows, style="numbers")], printed=True)],
        values={"places": [_values(mix, horizontal) for mix in ranked]},
    )


def _name(mix: Mix) -> str:
    return f"{mix.first} with {mix.second}" if mix.second else f"{mix.first} alone"


def _judge(mix: Mix) -> str:
    """What the two see, and what their mix leaves."""
    way = (
        "the same way"
        if mix.share > ALIKE
        else "the opposite way"
        if mix.share < -ALIKE
        else "another way"
    )
    return (
        f"{mix.second} sees {significant(abs(mix.share), 2)} of what disturbs {mix.first}, {way}. "
        f"Their mix leaves {quantity(mix.left, 'nT', 2)} of {quantity(mix.before, 'nT', 2)} at "
        f"{significant(mix.noise_factor, 2)} times the noise."
    )


def _advise(mix: Mix) -> str:
    """Which placement would do better."""
    if mix.left > 0.5 * mix.before and mix.share > ALIKE:
        return (
            "They see too much alike: move one to the other side of what disturbs, or far from it."
        )
    if mix.share > ALIKE:
        return (
            "Where it saw the same with the other sign, the mix would have 0.71 times the noise: "
            "move it to the other side of what disturbs."
        )
    if abs(mix.share + 1.0) < ALIKE and mix.noise_factor < 0.85:
        return "No other place would do much better: opposite and equal is best."
    if mix.share < -ALIKE:
        nearer = "nearer to" if mix.share > -1 else "farther from"
        return (
            f"Best would be opposite and equal, at 0.71 times the noise: move it {nearer} what "
            "disturbs."
        )
    return (
        "Best would be opposite and equal, at 0.71 times the noise: move it to the other side of "
        "what disturbs, as far off as the first."
    )


def _values(mix: Mix, horizontal: float) -> dict[str, Any]:
    return {
        "first": mix.first,
        "second": mix.second or None,
        "disturbance_nT": mix.before,
        "left_nT": mix.left,
        "noise_nT": mix.noise,
        "noise_factor": mix.noise_factor,
        "share": mix.share,
        "heading_deg": mix.heading_deg(horizontal),
    }
