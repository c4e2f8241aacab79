"""What is to be fitted: the readings after the ground calibration, and what is known of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, get_args

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.base import Calibration, apply
from agonic.calibration.network import Network
from agonic.calibration.steps import find_step
from agonic.errors import AgonicError, CoverageError, check_choice
from agonic.health import MIN_READINGS, find_usable_rows
from agonic.inflight.fit.ground_errors import bring_to_nT, find_order, has_free_scale
from agonic.inflight.fit.terms import Terms, build_terms
from agonic.inflight.fit.torquers import Torquers, leave_out_unmodelled
from agonic.inflight.maths.residuals import Rows
from agonic.samples import Samples

Solve = Literal["bias", "gains", "full"]
Attitude = Literal["none", "logged", "nadir"]


@dataclass(frozen=True, kw_only=True)
class Settings:
    """What was asked for; see `fit_inflight`."""

    solve: Solve
    drift_knots: int | Literal["auto"]
    latitude_deg: tuple[float, float] | None
    temperature_degree: int
    matrix_rate: bool
    sources: tuple[str, ...]
    gain_sd: float
    soft_iron_sd: float | None
    robust: bool
    seed: int
    residual_limit: float | None = None
    attitude: Attitude = "none"


@dataclass(frozen=True, kw_only=True, eq=False)
class ExpectedDirection:
    """Directions in the axes of the attitude (n, 3): of the field, and level across it."""

    aim: Array
    side: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Problem:
    """`samples` after the ground calibration; `wanted` (n,) over `magnitude`; rows `used`; where
    the fit is aided by attitude, the `direction` expected, and the `rotation` from sensor axes to
    those of the attitude; `direction_e` (n, 3) of the field in Earth-fixed axes, where known;
    `source` says what told the field; `torquers` what was left out for them; `scale_free` whether
    only a convention sets the scale of the ground calibration."""

    samples: Samples
    wanted: Array
    magnitude: float
    used: Mask
    ground: Calibration | None
    settings: Settings
    direction: ExpectedDirection | None
    source: str
    rotation: Array
    direction_e: Array | None
    torquers: Torquers = field(default_factory=Torquers)
    scale_free: bool = False

    @property
    def time(self) -> Array:
        """Seconds, (n,)."""
        assert self.samples.time is not None, "checked when the fit began"
        return self.samples.time

    def spread_rows(self, count: int) -> Index:
        """At most so many of the rows used, evenly over the record."""
        rows = np.flatnonzero(self.used)
        return rows[np.linspace(0, len(rows) - 1, min(count, len(rows))).astype(np.intp)]

    def with_sources(self, columns: Mapping[str, Array], others: tuple[str, ...]) -> Problem:
        """The problem with columns as sources, beside others of those that it has."""
        samples, settings = self.samples, self.settings
        return replace(
            self,
            samples=samples.with_columns(disturbers={**samples.disturbers, **columns}),
            settings=replace(settings, sources=(*others, *columns)),
        )

    def terms(self, intervals: int) -> Terms:
        """The terms with so many intervals of the bias in time."""
        asked = self.settings
        order = find_order(self.ground)
        return build_terms(
            self.samples,
            intervals,
            degree=max(asked.temperature_degree, order),
            of_matrix=order > 0 or asked.solve != "bias",
            rate=asked.matrix_rate,
            sources=asked.sources,
        )

    def rows(self, terms: Terms) -> Rows:
        """All readings as the kernel takes them."""
        return Rows(
            points=self.samples.field / self.magnitude,
            wanted=self.wanted,
            aim=None if self.direction is None else self.direction.aim @ self.rotation,
            side=None if self.direction is None else self.direction.side @ self.rotation,
            bias_terms=terms.of_bias(self.samples),
            matrix_terms=terms.of_matrix(self.samples),
            time=self.time,
            direction_e=self.direction_e,
        )


def make_settings(given: Mapping[str, Any]) -> Settings:
    """What was asked for, checked, among all that a fit was given by name; `solve` is by default
    "bias" with a ground calibration and "full" without."""
    ground, sources = given["ground"], given["sources"]
    solve = given["solve"] or ("full" if ground is None else "bias")
    if isinstance(sources, str):
        raise AgonicError(f'sources is "{sources}"; give a list of columns, as ["current_A"]')
    if ground is not None and find_step(ground, Network) is not None:
        raise AgonicError(
            "the ground calibration is a network, which gives the field without a bias and a "
            "matrix that could move in flight; give its base, or train it again with `retrain`"
        )
    check_choice("solve", solve, get_args(Solve))
    if ground is None and solve != "full":
        raise AgonicError(f'solve="{solve}" moves a ground calibration; give one, or solve "full"')
    named = {one.name: given[one.name] for one in fields(Settings) if one.name in given}
    asked = Settings(**named | {"solve": solve, "sources": tuple(sources)})
    check_choice("attitude", asked.attitude, get_args(Attitude))
    if asked.temperature_degree < 0:
        raise AgonicError(
            f"temperature_degree is {asked.temperature_degree}; 0 is none, 1 a straight line"
        )
    if asked.residual_limit is not None and not asked.residual_limit > 0:
        raise AgonicError(f"residual_limit is {asked.residual_limit}; it is in nT, above 0")
    return asked


def pose_problem(
    samples: Samples,
    magnitudes: Array,
    used: Mask,
    ground: Calibration | None,
    settings: Settings,
    *,
    source: str,
    direction: ExpectedDirection | None = None,
    direction_e: Array | None = None,
) -> Problem:
    """The problem of samples in fields of `magnitudes` (n,), nT, by the rows `used` in which no
    torquer is on that the sources do not name. Raises `CoverageError` where few are left."""
    used, torquers = leave_out_unmodelled(samples, settings.sources, used)
    require_enough(used)
    magnitude = float(magnitudes[used].mean())
    scale_free = ground is not None and has_free_scale(ground)
    if ground is not None:
        ground = bring_to_nT(ground, samples, magnitudes, used)
    return Problem(
        samples=samples if ground is None else apply(ground, samples),
        wanted=np.where(np.isfinite(magnitudes), magnitudes / magnitude, 1.0),
        magnitude=magnitude,
        used=used,
        ground=ground,
        settings=settings,
        source=source,
        direction=direction,
        rotation=np.eye(3),
        direction_e=direction_e,
        torquers=torquers,
        scale_free=scale_free,
    )


def select_rows(
    samples: Samples, exclude: Mask | None, latitude_deg: tuple[float, float] | None
) -> Mask:
    """The rows that take part: usable, not flagged, not excluded, within the latitudes."""
    rows = find_usable_rows(samples.field)
    if samples.flagged is not None:
        rows &= samples.flagged == 0
    if exclude is not None:
        if exclude.shape != rows.shape:
            raise AgonicError(f"exclude has {exclude.shape} values for {len(rows)} readings")
        rows &= ~exclude
    if latitude_deg is not None:
        if samples.latitude_deg is None:
            raise AgonicError("latitudes were asked for and the log has no positions")
        low, high = latitude_deg
        rows &= (samples.latitude_deg >= low) & (samples.latitude_deg <= high)
    return rows


def require_enough(rows: Mask) -> None:
    """Raise `CoverageError` where too few rows are left."""
    if rows.sum() < MIN_READINGS:
        raise CoverageError(f"{int(rows.sum())} readings are left, too few for a fit")
