"""What is said and shown of a deviation fit: its card, as a page and as text, and its numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from agonic.calibration.deviation import PARAMETERS, Deviation
from agonic.headings.deviation.card import card_text
from agonic.headings.deviation.figures import draw_picture
from agonic.headings.deviation.fit import DeviationFit
from agonic.headings.deviation.printed_card import Paper, card_page
from agonic.report.document import Document

_SURE = 3.0
"""Standard errors from which a coefficient is worth a screwdriver."""
_WORTH_DEG = 0.1


@dataclass(frozen=True, kw_only=True)
class Remedy:
    """A step, in words, and the largest deviation before and after it, level, degrees."""

    what: str
    before_deg: float
    after_deg: float

    def __str__(self) -> str:
        return f"{self.what}: {self.before_deg:.1f}° → {self.after_deg:.1f}°"


def find_remedies(card: Deviation) -> tuple[Remedy, ...]:
    """The steps that would help: turning the compass by A, nulling B and C with magnets, and both.

    A positive A is a compass that reads too little: turned clockwise by A it reads right on the
    whole. B is the magnetism along the keel, nulled on east or west by magnets fore and aft; C that
    across it, nulled on north or south by magnets athwartships. D and E, of soft iron, stay. A
    step is named where its coefficients stand out of their errors and it helps.

    Parameters: card, with its covariance where it has one.

    Source: Handbook of Magnetic Compass Adjustment (National Geospatial-Intelligence
    Agency, 2004), chapters V and VI.

    >>> made = find_remedies(Deviation(coefficients=[1.0, 12.0, 8.0, 5.0, 1.5]))
    >>> for remedy in made:
    ...     print(remedy)
    turn the compass 1.0° clockwise: 20.1° → 19.1°
    null B by magnets fore and aft, C athwart: 20.1° → 6.2°
    both: 20.1° → 5.2°
    """
    before = _find_largest(card)
    a = float(card.coefficients[0])
    turned = "clockwise" if a > 0 else "counterclockwise"
    steps = [
        (f"turn the compass {abs(a):.1f}° {turned}", (0,)),
        ("null B by magnets fore and aft, C athwart", (1, 2)),
    ]
    able = [step for step in steps if _stands_out(card, step[1])]
    if len(able) == 2:
        able.append(("both", (0, 1, 2)))
    made = (
        Remedy(what=what, before_deg=before, after_deg=_find_largest(_without(card, places)))
        for what, places in able
    )
    return tuple(one for one in made if one.after_deg < before - _WORTH_DEG)


def _without(card: Deviation, places: tuple[int, ...]) -> Deviation:
    """The card with some of its coefficients nulled."""
    left = np.array(card.coefficients)
    left[list(places)] = 0.0
    return replace(card, coefficients=left)


def _find_largest(card: Deviation) -> float:
    return float(np.abs(card.at(np.arange(360.0))).max())


def _stands_out(card: Deviation, places: tuple[int, ...]) -> bool:
    sizes = np.abs(card.coefficients[list(places)])
    if card.covariance is None:
        return bool((sizes > _WORTH_DEG).any())
    sd = np.sqrt(np.diag(card.covariance))[list(places)]
    return bool((sizes > np.maximum(_SURE * sd, _WORTH_DEG)).any())


@dataclass(frozen=True, kw_only=True, eq=False)
class CardDocument(Document):
    """A document whose page and text are the card, which has a layout of its own.

    `step_deg` between the rows; `details` are lines to add; `paper` that it is printed on.
    """

    fit: DeviationFit
    step_deg: float
    details: Mapping[str, str]
    paper: Paper

    def to_html(self) -> str:
        """The card as a page."""
        return card_page(self.fit, step_deg=self.step_deg, details=self.details, paper=self.paper)

    def to_text(self, width: int = 0, *, brief: bool = False) -> str:
        """The card as plain text, which is as wide as a card."""
        return card_text(self.fit, step_deg=self.step_deg, details=self.details)

    def to_picture(self) -> str:
        """The chart alone, as SVG."""
        return draw_picture(self.fit)


def describe_deviation(
    fit: DeviationFit,
    *,
    step_deg: float = 15.0,
    details: Mapping[str, str] | None = None,
    paper: Paper = "A4",
    blank: int = 0,
) -> CardDocument:
    """The card, and the coefficients with their evidence; `blank` rows of the swing were empty.

    >>> import numpy as np
    >>> from agonic.headings.deviation import fit_deviation
    >>> rose = np.arange(0, 360, 45.0)
    >>> made = describe_deviation(fit_deviation(rose, rose + 2.0), blank=1)
    >>> round(made.to_record()["coefficients"]["A"], 6), made.to_text()[:14]
    (2.0, 'DEVIATION CARD')
    """
    remedies = () if fit.verdict == "refused" else find_remedies(fit.calibration)
    told = dict(zip(("to do", "or", "or better"), map(str, remedies), strict=False))
    return CardDocument(
        schema="agonic/fit-deviation@1",
        kind="Compass deviation card",
        name=fit.calibration.sensor,
        verdict=fit.verdict,
        status=fit.status,
        findings=fit.findings,
        values={**_values(fit), "blank": blank, "remedies": [asdict(each) for each in remedies]},
        fit=fit,
        step_deg=step_deg,
        details={**(details or {}), **told},
        paper=paper,
    )


def _values(fit: DeviationFit) -> dict[str, Any]:
    """The coefficients that were fitted, and what they rest on."""
    card = fit.calibration
    values = [*card.coefficients, *([0.0] * 4 if card.heel is None else card.heel)]
    fitted = {
        name: (float(value), float(sd))
        for name, value, sd in zip(PARAMETERS, values, fit.sd, strict=True)
        if name in card.terms or sd > 0.0
    }
    return {
        "sensor": card.sensor,
        "method": "deviation",
        "n": fit.n,
        "coefficients": {name: value for name, (value, _) in fitted.items()},
        "sd": {name: sd for name, (_, sd) in fitted.items()},
        "classical": fit.classical,
        "noise_deg": fit.noise_deg,
        "correlation": fit.correlation,
        "condition": fit.condition,
        "residual_rms_deg": float((fit.residuals_deg**2).mean() ** 0.5),
        "heading_sd_deg": float(card.sd_at(range(360)).max()),
        "power_state": card.power_state,
        "current_A": card.current_A,
        "largest_gap_deg": card.largest_gap_deg,
        "equation": card.equation,
    }
