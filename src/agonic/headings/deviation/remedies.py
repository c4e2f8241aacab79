"""What can be done to a compass after a swing, and what deviation each step would leave."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from agonic.calibration.deviation import Deviation

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
