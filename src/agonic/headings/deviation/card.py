"""The deviation card: what a compass reads wrong on each heading, as a table in plain text."""

from __future__ import annotations

import textwrap
from collections.abc import Mapping
from typing import NamedTuple

import numpy as np

from agonic.calibration.deviation import Deviation, format_east_west, name_heading
from agonic.errors import AgonicError
from agonic.headings.deviation.fit import DeviationFit
from agonic.report.digits import NO_BREAK, group_digits, with_sd
from agonic.report.text import SIGNS
from agonic.report.verdict import MEANINGS, sentence

LIMITS = ((3.0, "new"), (5.0, "in service"))
"""What a compass may be off on any heading, degrees: as an adjuster leaves it, and before it has to
be adjusted again (flag states: 5°, for instance Marshall Islands marine notice 2-011-32)."""
MEANT = {"new": "of a compass just adjusted", "in service": "of a compass in service"}

STEPS = (5.0, 10.0, 15.0, 30.0, 45.0)
WITHOUT_STATE = "the state of the swing, which was not noted"
_WIDTH = 76


class Row(NamedTuple):
    """One heading of a card, degrees: as a compass reading, and as a heading to make good."""

    heading: float
    deviation: float
    band: float | None
    magnetic: float
    steer: float

    def write(self) -> tuple[str, str, str, str, str]:
        """Heading, deviation, band, magnetic heading and the one to steer, in words."""
        turned, steer = (f"{round(h, 1) % 360.0:05.1f}°" for h in (self.magnetic, self.steer))
        band = "" if self.band is None else f"{self.band:.1f}"
        return name_heading(self.heading), format_east_west(self.deviation), band, turned, steer


def make_rows(card: Deviation, step_deg: float = 15.0) -> list[Row]:
    """The rows of a card, north first."""
    if step_deg not in STEPS:
        known = ", ".join(f"{step:g}" for step in STEPS)
        raise AgonicError(f"a card in steps of {step_deg:g}° is not made; use {known}")
    heading = np.arange(0.0, 360.0, step_deg)
    bands = [None] * len(heading) if card.covariance is None else card.band_at(heading).tolist()
    deviation, magnetic, steer = card.at(heading), card.magnetic(heading), card.steer(heading)
    columns = (heading.tolist(), deviation.tolist(), bands, magnetic.tolist(), steer.tolist())
    return [Row(*row) for row in zip(*columns, strict=True)]


def describe_power(card: Deviation) -> str:
    """What the card is valid with."""
    drawn = [] if card.current_A is None else [f"{card.current_A:g} A"]
    return ", ".join([*([card.power_state] if card.power_state else []), *drawn]) or WITHOUT_STATE


def judge_size(card: Deviation) -> str:
    """The largest deviation against the limits, and what the card leaves of it, in words."""
    heading = np.arange(0.0, 360.0)
    curve = card.at(heading)
    worst = int(np.abs(curve).argmax())
    size = float(abs(curve[worst]))
    passed = [(limit, name) for limit, name in LIMITS if size <= limit]
    limit, name = passed[0] if passed else LIMITS[-1]
    against = f"{'within' if passed else 'beyond'} {limit:g}°, the limit {MEANT[name]}"
    said = (
        f"Before: at most {format_east_west(float(curve[worst]))}, at compass "
        f"{name_heading(float(heading[worst]))}; {against}."
    )
    if card.covariance is None:
        return said
    left = float(card.band_at(heading).max())
    return f"{said} After: the card is right to ±{left:.1f}° (95 %)."


def make_coefficient_rows(
    card: Deviation, classical: Mapping[str, float] | None = None
) -> list[tuple[str, str, str]]:
    """A to E and the heel terms that were fitted: name, least squares, eight headings."""
    eight = classical or {}
    names = ("A", "B", "C", "D", "E", "roll · cos", "roll · sin", "pitch · cos", "pitch · sin")
    values = [*card.coefficients, *([] if card.heel is None else card.heel)]
    sd = [None] * len(names) if card.sd is None else card.sd.tolist()
    return [
        (name, with_sd(float(value), error), group_digits(eight[name], 2) if name in eight else "")
        for name, value, error in zip(names, values, sd, strict=False)
        if name in card.terms or (len(name) > 1 and error != 0.0)
    ]


def say_verdict(fit: DeviationFit) -> tuple[str, str]:
    """The verdict in a word, and what it means and stands in the way.

    The figures that the card shows anyway are left out.
    """
    word, meaning = MEANINGS[fit.verdict]
    return word, " ".join([f"{meaning}.", *(sentence(f.sentence) for f in fit.findings)])


def card_text(
    result: Deviation | DeviationFit,
    *,
    step_deg: float = 30.0,
    title: str = "",
    details: Mapping[str, str] | None = None,
) -> str:
    """The card as plain text, at most 76 columns wide.

    Parameters: `result`, a card or the fit it came from (a refused fit has no table); `step_deg`
    degrees from row to row; `title`; `details`, lines to add at the head, such as date and place.

    >>> print(card_text(Deviation(coefficients=[2.0, 0, 0, 0, 0]), step_deg=45).splitlines()[6])
    045° NE         2.0° E             047.0°  |  045° NE             043.0°
    """
    card = result.calibration if isinstance(result, DeviationFit) else result
    lines = [f"DEVIATION CARD   {title or card.sensor}", f"Valid only with  {describe_power(card)}"]
    lines += [f"{name.capitalize():<16} {text}" for name, text in (details or {}).items()]
    if isinstance(result, DeviationFit):
        word, said = say_verdict(result)
        lines += textwrap.wrap(f"{SIGNS[result.verdict]} {word}: {said}", _WIDTH)
        if result.verdict == "refused":
            return "\n".join(lines)
    head = f"{'Compass':<10}{'Deviation':>12}{'± 95 %':>8}{'Magnetic':>11}  |  "
    head += f"{'To make good':<16}{'Steer':>10}"
    lines += ["", head, "-" * len(head)]
    for row in make_rows(card, step_deg):
        name, off, band, magnetic, steer = row.write()
        lines.append(f"{name:<10}{off:>12}{band:>8}{magnetic:>11}  |  {name:<16}{steer:>10}")
    lines.append("")
    lines += textwrap.wrap(judge_size(card), _WIDTH)
    made = make_coefficient_rows(card)
    classical = result.classical if isinstance(result, DeviationFit) else None
    fitted = "  ".join(f"{name} {value}".replace(" ", NO_BREAK) for name, value, _ in made)
    lines += textwrap.wrap(f"Least squares    {fitted}", _WIDTH, subsequent_indent=" " * 17)
    if classical:
        eight = "  ".join(f"{name} {group_digits(value, 2)}" for name, value in classical.items())
        lines.append(f"Eight headings   {eight}")
    return "\n".join(lines)
