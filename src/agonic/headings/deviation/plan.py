"""`plan_swing`: the headings to steer, and what they will tell, before the vehicle moves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from agonic.arrays import Array
from agonic.calibration.deviation import PARAMETERS
from agonic.errors import AgonicError
from agonic.headings.deviation.fit import parse_terms
from agonic.maths.estimation import leastsq
from agonic.maths.rotations import deviation as kernel
from agonic.readable import Shown


@dataclass(frozen=True, kw_only=True, eq=False)
class SwingPlan:
    """Readings to take, in order, and the standard errors to expect.

    `compass_deg` and `roll_deg` (n,) are what to steer; `sd` (9,), beside a reference that does not
    drift, the expected standard errors of
    A to E (degrees) and the heel terms (degrees per degree), 0 where a term is not fitted;
    `heading_sd_deg` that of a level heading corrected with the card, at the worst heading.
    """

    compass_deg: Annotated[Array, Shown()]
    roll_deg: Array
    terms: Annotated[str, Shown()]
    noise_deg: Annotated[float, Shown()]
    sd: Array
    heading_sd_deg: Annotated[float, Shown()]

    @property
    def closed(self) -> tuple[Array, Array]:
        """Headings and rolls with the first heading once more at the end, where a drift shows."""
        first = self.compass_deg == self.compass_deg[0]
        if first[-1]:
            return self.compass_deg, self.roll_deg
        again = np.append(np.arange(len(first)), np.flatnonzero(first))
        return self.compass_deg[again], self.roll_deg[again]


def plan_swing(
    headings: int = 8,
    *,
    heel_deg: float | None = None,
    noise_deg: float = 1.0,
    terms: str = "ABCDE",
    rounds: int = 1,
) -> SwingPlan:
    """The headings of a swing, evenly spread, and how well they determine the deviation.

    The covariance of the coefficients is σ² (XᵀX)⁻¹, X the rows of the curve at these headings.

    Parameters
    ----------
    headings : how many, the first north. heel_deg : on each heading also tilt the vehicle by this
        much to either side. noise_deg : standard deviation σ of one reading of compass against
        reference. terms : the level terms that will be fitted. rounds : how often to go round,
        each time the other way, so that a card that lags is found out.

    Returns a `SwingPlan`. Raises `AgonicError` where these headings would not determine the terms.

    Source: Handbook of Magnetic Compass Adjustment (NGA 2004), chapter V.

    >>> plan = plan_swing(8, noise_deg=0.5)
    >>> plan.sd[:5].round(3).tolist(), round(plan.heading_sd_deg, 3)
    ([0.177, 0.25, 0.25, 0.25, 0.25], 0.395)
    """
    level = parse_terms(terms)
    least = len(terms) + 1
    if headings < least or rounds < 1 or not noise_deg > 0.0:
        raise AgonicError(
            f"headings {headings}, rounds {rounds}, noise {noise_deg}° give no plan; {len(terms)} "
            f"terms need {least} headings or more, a round or more, and a noise above 0"
        )
    if heel_deg is not None and not 1.0 <= abs(heel_deg) <= 60.0:
        raise AgonicError(f"a heel of {heel_deg}° cannot be used; plan 5° to 20°")
    round_ = 360.0 / headings * np.arange(headings)
    tilts = [0.0] if heel_deg is None else [-abs(heel_deg), abs(heel_deg)]
    compass = np.concatenate([round_ if k % 2 == 0 else round_[::-1] for k in range(rounds)])
    compass, roll = np.repeat(compass, len(tilts)), np.tile(tilts, len(compass))
    chosen = np.concatenate([level, np.repeat([heel_deg is not None, False], 2)])
    rows = kernel.basis(compass, roll)[:, chosen]
    covariance = np.zeros((len(PARAMETERS),) * 2)
    covariance[np.ix_(chosen, chosen)] = noise_deg**2 * leastsq.inverse(rows.T @ rows)
    at = kernel.basis(np.arange(0.0, 360.0))
    return SwingPlan(
        compass_deg=compass,
        roll_deg=roll,
        terms=terms,
        noise_deg=noise_deg,
        sd=np.sqrt(np.diag(covariance)),
        heading_sd_deg=float(kernel.compute_band(at, covariance).max()),
    )
