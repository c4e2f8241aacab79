"""`Deviation`: what a compass reads wrong on each heading, in one state of the vehicle."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtrit

from agonic.arrays import Array
from agonic.calibration import schema_fields as form
from agonic.calibration.base import Valued, lock_arrays
from agonic.errors import AgonicError
from agonic.maths.estimation.noise.student import compute_widening
from agonic.maths.rotations import deviation as kernel
from agonic.maths.rotations.angles import wrap_deg
from agonic.provenance import Provenance

PARAMETERS = (*kernel.LEVEL, *kernel.HEEL)
"""The order of `covariance`: A to E in degrees, then the heel terms in degrees per degree."""


POINTS = (
    "N",
    "NNE",
    "NE",
    "ENE",
    "E",
    "ESE",
    "SE",
    "SSE",
    "S",
    "SSW",
    "SW",
    "WSW",
    "W",
    "WNW",
    "NW",
    "NNW",
)


def name_heading(heading_deg: float) -> str:
    """A heading as it is spoken of, with its point where it is one of the sixteen."""
    point, off = divmod(heading_deg % 360.0, 22.5)
    if off == 0.0:
        name = POINTS[int(point)]
        return f"{heading_deg % 360.0:0{5 if point % 2 else 3}.{int(point % 2)}f}° {name}"
    whole = round(heading_deg) % 360
    return f"{whole:03d}°" if whole else "000° N"


def format_east_west(deviation_deg: float) -> str:
    """A deviation as cards write it: east is positive."""
    size = f"{abs(deviation_deg):.1f}"
    side = "" if float(size) == 0.0 else " E" if deviation_deg > 0 else " W"
    return f"{size}°{side}"


@dataclass(frozen=True, kw_only=True, eq=False)
class Deviation(Valued):
    """The correction magnetic = compass + deviation(compass), east positive.

    Parameters
    ----------
    coefficients : (5,) A, B, C, D, E, degrees; a term that was not fitted is 0.
    heel : (4,) degrees per degree of roll × cos ψ, roll × sin ψ, pitch × cos ψ, pitch × sin ψ, or
        `None` where the compass was swung level.
    covariance : (9, 9) of `PARAMETERS`, zero for terms that were not fitted, or `None`.
    terms : the level terms that were fitted.
    noise_deg : standard deviation of one reading about the curve.
    freedom : degrees of freedom of `noise_deg`, `None` where the noise was given; sets the band.
    power_state : what was switched on during the swing. current_A : the current drawn then.
    largest_gap_deg : the widest arc between headings that were steered.
    largest_heel_deg : largest roll and pitch during the swing.
    sensor : whose headings.

    Examples
    --------
    >>> card = Deviation(coefficients=[1.0, 12.0, 8.0, 5.0, 1.5], power_state="engine on")
    >>> card.at([0.0, 90.0]).round(6).tolist(), card.steer(101.5).round(2).tolist()
    ([10.5, 11.5], 90.0)
    """

    kind: ClassVar[str] = "deviation"

    coefficients: Annotated[Array, form.stored(form.Five, "A, B, C, D, E, degrees; east positive.")]
    heel: Annotated[
        Array | None,
        form.stored(
            form.Four | None, "Degrees per degree of roll·cos, roll·sin, pitch·cos, pitch·sin."
        ),
    ] = None
    covariance: Annotated[
        Array | None, form.stored(form.Rows | None, f"Of {', '.join(PARAMETERS)}, degrees.")
    ] = None
    terms: Annotated[
        str, form.described("The level terms that were fitted.", pattern="^[A-E]+$")
    ] = "ABCDE"
    noise_deg: Annotated[
        form.NotNegative | None, form.described("Standard deviation of one reading.")
    ] = None
    freedom: Annotated[
        form.NotNegative | None,
        form.described("Degrees of freedom of noise_deg; null: it was given."),
    ] = None
    power_state: Annotated[str, form.described("What was switched on during the swing.")] = ""
    current_A: Annotated[float | None, form.described("The current drawn then.")] = None
    largest_gap_deg: Annotated[
        float | None, form.described("Widest arc between headings that were steered.")
    ] = None
    largest_heel_deg: Annotated[
        tuple[float, float] | None, form.described("Largest roll and pitch during the swing.")
    ] = None
    sensor: form.Sensor = "mag"
    provenance: Provenance = field(default_factory=Provenance)

    def __post_init__(self) -> None:
        lock_arrays(self, coefficients=(5,), heel=(4,), covariance=(9, 9))

    def at(
        self,
        compass_deg: ArrayLike,
        roll_deg: ArrayLike | None = None,
        pitch_deg: ArrayLike | None = None,
    ) -> Array:
        """The deviation, −180…180°, where the compass reads `compass_deg`; level without heel.

        Parameters: compass_deg (…), roll_deg (…), pitch_deg (…), degrees.
        """
        return wrap_deg(self._rows(compass_deg, roll_deg, pitch_deg) @ self._all)

    def sd_at(
        self,
        compass_deg: ArrayLike,
        roll_deg: ArrayLike | None = None,
        pitch_deg: ArrayLike | None = None,
    ) -> Array:
        """The standard error of the deviation there, degrees.

        It is half of a confidence interval of 95 % over 1.96: where few readings have told the
        noise, Student's t is wider than a normal distribution of the covariance alone.

        Parameters: compass_deg (…), roll_deg (…), pitch_deg (…), degrees. Raises `AgonicError`
        where the covariance is not known.
        """
        return self._widening * self._band(compass_deg, roll_deg, pitch_deg)

    def _band(
        self, compass_deg: ArrayLike, roll_deg: ArrayLike | None, pitch_deg: ArrayLike | None
    ) -> Array:
        if self.covariance is None:
            raise AgonicError("this card carries no covariance; fit it again with agonic")
        return kernel.compute_band(self._rows(compass_deg, roll_deg, pitch_deg), self.covariance)

    def band_at(self, compass_deg: ArrayLike, confidence: float = 0.95) -> Array:
        """Half the width of the level curve's confidence band, degrees, by Student's t.

        Parameters: compass_deg (…), degrees; confidence, a share.
        """
        return np.asarray(self._quantile(confidence) * self._band(compass_deg, None, None))

    def magnetic(
        self,
        compass_deg: ArrayLike,
        roll_deg: ArrayLike | None = None,
        pitch_deg: ArrayLike | None = None,
    ) -> Array:
        """The magnetic heading, 0…360, when the compass reads `compass_deg`.

        Parameters: compass_deg (…), roll_deg (…), pitch_deg (…), degrees.
        """
        deviation = self.at(compass_deg, roll_deg, pitch_deg)
        return kernel.wrap_360_deg(np.asarray(compass_deg, dtype=np.float64) + deviation)

    def steer(
        self,
        magnetic_deg: ArrayLike,
        roll_deg: ArrayLike | None = None,
        pitch_deg: ArrayLike | None = None,
    ) -> Array:
        """The compass heading, 0…360, that makes good `magnetic_deg`.

        Parameters: magnetic_deg (…), roll_deg (…), pitch_deg (…), degrees.
        """
        roll, pitch = (0.0 if a is None else a for a in (roll_deg, pitch_deg))
        return kernel.steer(self._all, magnetic_deg, roll, pitch)

    @property
    def sd(self) -> Array | None:
        """Standard errors of `PARAMETERS`, (9,), widened as those of `sd_at`."""
        if self.covariance is None:
            return None
        return np.asarray(self._widening * np.sqrt(np.diag(self.covariance)))

    def _quantile(self, confidence: float) -> float:
        """Student's t that encloses a share of all errors, with the freedom of the noise."""
        freedom = np.inf if self.freedom is None else max(self.freedom, 1.0)
        return float(stdtrit(min(freedom, 1e6), (1 + confidence) / 2))

    @property
    def _widening(self) -> float:
        """How much wider the interval of 95 % is than with a noise that is known."""
        return 1.0 if self.freedom is None else compute_widening(max(self.freedom, 1.0))

    @property
    def least_turn(self) -> float:
        """The least that the vehicle turns while the compass turns by one, 1 + dδ/dψ.

        At or below 0 one reading stands for several headings.
        """
        psi = np.arange(0.0, 360.0)
        return float(1 + kernel.slope(self._all, psi, 0.0, 0.0).min())

    @property
    def equation(self) -> str:
        """The correction in words and numbers."""
        factors = ("", " sin(compass)", " cos(compass)", " sin(2 compass)", " cos(2 compass)")
        said = " ".join(
            f"{value:+.3f}{factor}"
            for value, factor, term in zip(self.coefficients, factors, kernel.LEVEL, strict=True)
            if term in self.terms
        )
        heeled = "" if self.heel is None else " + heel terms in roll and pitch"
        return f"magnetic [deg] = compass + ({said.lstrip('+')}{heeled})"

    @property
    def _all(self) -> Array:
        return np.append(self.coefficients, np.zeros(4) if self.heel is None else self.heel)

    def _rows(
        self, compass_deg: ArrayLike, roll_deg: ArrayLike | None, pitch_deg: ArrayLike | None
    ) -> Array:
        roll, pitch = (0.0 if a is None else a for a in (roll_deg, pitch_deg))
        return kernel.basis(compass_deg, roll, pitch)
