"""`Model`: a world model of the geomagnetic field, evaluated at places and along tracks."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike

from agonic.arrays import Array, Index, Mask
from agonic.errors import AgonicError, AgonicWarning, LogError, ValidityError
from agonic.field.decimal_year import Moments, decimal_year
from agonic.field.worldfield import Uncertainty, WorldField
from agonic.maths.earth import geodesy, harmonics
from agonic.reference import Reference
from agonic.samples import Samples

SPACINGS_S = (10.0, 5.0, 2.5, 1.25)
"""Seconds between the nodes of the spline, tried in turn."""
TOLERANCE_NT = 1e-3
"""Largest difference from the model half-way between nodes, nT."""
MIN_SPLINED_ROWS = 10_000
"""Fewer are evaluated sooner than a spline is made."""


def evaluate_along_track(time: Array, exact: Callable[[Index], Array]) -> Array:
    """A smooth vector (3, n) along a track, evaluated exactly at few rows and splined between them.

    Nodes are recorded rows, so no position is interpolated. The spline is compared with the exact
    value at the row in the middle of every two nodes; where it differs by more than `TOLERANCE_NT`
    anywhere, nodes come closer, and at last every row is evaluated. A gap in time ends a spline.

    Parameters: time (n,) s, increasing; exact, the vector (3, k) at the rows (k,) that it is given,
    in axes that do not turn along the track (Earth-fixed).
    """
    if len(time) < MIN_SPLINED_ROWS:  # nor are they looked through for gaps
        return exact(np.arange(len(time)))
    gaps = np.flatnonzero(np.diff(time) > SPACINGS_S[0]) + 1
    vectors = np.empty((3, len(time)))
    left = []
    for rows in np.split(np.arange(len(time)), gaps):
        splined = _spline(time, rows, exact)
        if splined is None:
            left.append(rows)
        else:
            vectors[:, rows] = splined
    if left:
        rest = np.concatenate(left)
        vectors[:, rest] = exact(rest)
    return vectors


def _spline(time: Array, rows: Index, exact: Callable[[Index], Array]) -> Array | None:
    """The vector at rows without a gap, or `None` where a spline is not worth it or not good."""
    if len(rows) < MIN_SPLINED_ROWS:
        return None
    from scipy.interpolate import CubicSpline  # slow to load, and few tracks are long

    for spacing in SPACINGS_S:
        nodes = rows[_nodes(time[rows], spacing)]
        if len(nodes) < 5 or len(rows) < 16 * len(nodes):  # a spline would save nothing
            return None
        middle = (nodes[1:] + nodes[:-1]) // 2
        spline = CubicSpline(time[nodes], exact(nodes), axis=1)
        if np.abs(spline(time[middle]) - exact(middle)).max() < TOLERANCE_NT:
            return np.asarray(spline(time[rows]))
    return None


def _nodes(time: Array, spacing: float) -> Index:
    """The first row at or after each multiple of the spacing, and the last row."""
    ticks = np.arange(time[0], time[-1], spacing)
    return np.unique(np.append(np.searchsorted(time, ticks), len(time) - 1))


REFERENCE_RADIUS_M = 6_371_200.0
"""The radius a of the expansion, the same in all three models."""
PIECE_ROWS = 16_384
"""Points evaluated together: their intermediate arrays stay in the cache."""
COMPILE_FROM = 100_000
"""Points from which the compiled kernel is asked for; below, starting the compiler costs more."""


@dataclass(frozen=True, kw_only=True, eq=False)
class GaussCoefficients:
    """Coefficients that are linear in time between epochs.

    From `starts[i]` (i,), a decimal year, to the next epoch and at last to `until`, the
    coefficients are value[i] + (year − starts[i]) · rate[i]; `value`, `rate` (i, 2, N+1, N+1) hold
    g and h, Schmidt semi-normalised, by degree and order, in nT and nT/year.
    """

    starts: Array
    until: float
    value: Array
    rate: Array


@dataclass(frozen=True, kw_only=True, eq=False)
class Model:
    """A model of the geomagnetic field of the Earth; `igrf()`, `wmm()` and `wmmhr()` give one.

    `coefficients` are those published; `table` (i, k, 2, 6) the same as `earth.harmonics` wants
    them, for field and yearly change; `extrapolates_until` is the last decimal year that is
    answered, with a warning after `coefficients.until`.
    """

    name: str
    coefficients: GaussCoefficients = field(repr=False)
    table: Array = field(repr=False)
    uncertainty: Uncertainty
    extrapolates_until: float

    @classmethod
    def of(
        cls,
        name: str,
        coefficients: GaussCoefficients,
        uncertainty: Uncertainty,
        *,
        extrapolates_until: float | None = None,
    ) -> Model:
        """The model of Gauss coefficients; without `extrapolates_until` it does not extrapolate."""
        table = [
            np.dstack([harmonics.field_coefficients(*value), harmonics.field_coefficients(*rate)])
            for value, rate in zip(coefficients.value, coefficients.rate, strict=True)
        ]
        return cls(
            name=name,
            coefficients=coefficients,
            table=np.stack(table),
            uncertainty=uncertainty,
            extrapolates_until=extrapolates_until or coefficients.until,
        )

    @property
    def degree(self) -> int:
        """The highest degree and order."""
        return int(self.coefficients.value.shape[-1]) - 1

    def at(
        self,
        latitude_deg: ArrayLike,
        longitude_deg: ArrayLike,
        altitude_m: ArrayLike,
        time: Moments,
    ) -> WorldField:
        """The field at places and times, B = −∇V in north, east, down.

        Parameters
        ----------
        latitude_deg, longitude_deg : geodetic, degrees; east positive, −180…360.
        altitude_m : height above the WGS-84 ellipsoid, m.
        time : decimal years, datetimes (UTC), dates, ISO 8601 strings or `numpy.datetime64`.
            Scalars and arrays of all four are broadcast against each other.

        Returns
        -------
        `WorldField`, (3,) for one place and time, (…, 3) for arrays.

        Raises
        ------
        ValidityError outside the model's years, or where a position is none; `mask` marks which.

        Examples
        --------
        >>> from agonic.field.published import wmm
        >>> here = wmm().at(latitude_deg=52.0, longitude_deg=5.0, altitude_m=0.0, time="2026-03-01")
        >>> here.field_n.round(1), f"{here.declination_deg:.2f} ± {here.declination_sd_deg:.2f}°"
        (array([19137.2,   900. , 45603.1]), '2.69 ± 0.38°')
        """
        latitude, longitude, altitude, years = _broadcast(
            latitude_deg, longitude_deg, altitude_m, time
        )
        _check_positions(latitude, longitude, altitude)
        self._check_years(years)
        flat = (latitude.ravel(), longitude.ravel(), altitude.ravel(), years.ravel())
        vectors_n = self._evaluate(*flat).reshape(2, 3, *years.shape)
        field_n, secular_variation = np.moveaxis(vectors_n, 1, -1)
        return WorldField(
            field_n=field_n,
            secular_variation=secular_variation,
            model=self.name,
            uncertainty=self.uncertainty,
        )

    def along(self, samples: Samples) -> Reference:
        """The field at every sample, as the reference of a fit: vectors in north, east, down.

        A long track is evaluated exactly every 10 s and splined between, where that keeps to the
        model within 1 pT half-way between nodes; otherwise at every sample.

        Parameters
        ----------
        samples : with latitude_deg, longitude_deg, altitude_m, time and epoch.

        Returns
        -------
        `Reference` (n, 3) in frame "n"; its `sd` is the root mean square of the stated
        uncertainties of the three components.

        Raises
        ------
        LogError where a column is missing; ValidityError as `at`.

        Examples
        --------
        >>> from agonic.field.published import igrf
        >>> s = Samples(field=[[0.0, 0, 1]] * 2, time=[0.0, 1.0], epoch=datetime(2026, 1, 1),
        ...             latitude_deg=[10, 10], longitude_deg=[20, 20], altitude_m=[0, 1000])
        >>> igrf().along(s).values.round(0)
        array([[34622.,  1483.,  -683.],
               [34603.,  1481.,  -680.]])
        """
        latitude, longitude, altitude, time, epoch = _track_columns(samples)
        _check_positions(latitude, longitude, altitude)
        self._check_years(_years(epoch, time[[0, -1]]))

        def exact(rows: Index) -> Array:
            there, years = (latitude[rows], longitude[rows]), _years(epoch, time[rows])
            field_n, _ = self._evaluate(*there, altitude[rows], years)
            return geodesy.earth_fixed(field_n, geodesy.directions(*there))

        where = geodesy.directions(latitude, longitude)
        field_n = geodesy.north_east_down(evaluate_along_track(time, exact), where)
        return Reference.vector(
            field_n.T,
            frame="n",
            sd=self.uncertainty.component,
            source=f"{self.name} along the track",
        )

    def _evaluate(self, latitude: Array, longitude: Array, altitude: Array, years: Array) -> Array:
        """Field and its yearly change (2, 3, n), components north, east, down first."""
        compiled = len(years) >= COMPILE_FROM
        vectors_n = np.empty((6, len(years)))
        for i, rows in self._pieces(years):
            where = geodesy.directions(latitude[rows], longitude[rows])
            position = geodesy.earth_fixed_position(where, altitude[rows]) / REFERENCE_RADIUS_M
            sums = harmonics.synthesise(position, self.table[i], compiled=compiled)
            main, rate = geodesy.north_east_down(sums.reshape(2, 3, -1), where)
            main += rate * (years[rows] - self.coefficients.starts[i])
            for row, values in zip(vectors_n, (*main, *rate), strict=True):
                row[rows] = values
        return vectors_n.reshape(2, 3, -1)

    def _pieces(self, years: Array) -> Iterator[tuple[int, slice | Index]]:
        """The intervals between epochs that the years fall in, each with its rows, in pieces."""
        later = self.coefficients.starts[1:]
        interval = np.searchsorted(later, years, side="right").astype(np.uint8)
        order = np.argsort(interval, kind="stable")
        ends = np.cumsum(np.bincount(interval, minlength=len(later) + 1))
        for i, rows in enumerate(np.split(order, ends[:-1])):
            for piece in (rows[k : k + PIECE_ROWS] for k in range(0, len(rows), PIECE_ROWS)):
                first, last = int(piece[0]), int(piece[-1])
                # Index are in order here: without a hole they are a slice, which needs no copies.
                yield i, slice(first, last + 1) if last - first < len(piece) else piece

    def _check_years(self, years: Array) -> None:
        """An error outside the years of the model, a warning where it extrapolates."""
        first, until = self.coefficients.starts[0], self.coefficients.until
        outside = ~((years >= first) & (years <= self.extrapolates_until))
        if outside.any():
            raise ValidityError(
                f"{self.name} holds from {first} to {self.extrapolates_until}; "
                f"{_how_many(outside)} outside, the first of them {years[outside][0]:.4f}: give "
                "dates within, or take a model that holds then",
                mask=outside,
            )
        late = years > until
        if late.any():
            warnings.warn(
                f"{_how_many(late)} after {until}, where {self.name} ends: the last secular "
                "variation was extrapolated",
                AgonicWarning,
                stacklevel=3,
            )


def _broadcast(
    latitude_deg: ArrayLike, longitude_deg: ArrayLike, altitude_m: ArrayLike, time: Moments
) -> tuple[Array, ...]:
    """Latitude, longitude, altitude and decimal year, of one shape."""
    try:
        places = (
            np.asarray(a, dtype=np.float64) for a in (latitude_deg, longitude_deg, altitude_m)
        )
        return np.broadcast_arrays(*places, decimal_year(time))
    except (TypeError, ValueError) as error:
        raise AgonicError(
            f"places and times do not go together ({error}); give numbers, one or the same count "
            "of each"
        ) from None


def _check_positions(latitude: Array, longitude: Array, altitude: Array) -> None:
    checks = (
        ("latitude_deg", latitude, -90.0, 90.0),
        ("longitude_deg", longitude, -180.0, 360.0),
        # below the deepest ocean an altitude is a mistake, and the series does not hold
        ("altitude_m", altitude, -20_000.0, np.finfo(float).max),
    )
    for name, values, low, high in checks:
        outside = ~((values >= low) & (values <= high))
        if outside.any():
            raise ValidityError(
                f"{name} has {values[outside][0]}; give numbers from {low:g} to {high:g}",
                mask=outside,
            )


def _how_many(mask: Mask) -> str:
    count = int(mask.sum())
    return f"{count} of {mask.size} dates {'is' if count == 1 else 'are'}"


def _years(epoch: datetime, time: Array) -> Array:
    """Decimal years of seconds since an epoch."""
    start = epoch if epoch.tzinfo is None else epoch.astimezone(UTC).replace(tzinfo=None)
    microseconds = np.round(time * 1e6).astype("timedelta64[us]")
    return decimal_year(np.datetime64(start, "us") + microseconds)


def _track_columns(samples: Samples) -> tuple[Array, Array, Array, Array, datetime]:
    """What a track needs of its samples, or an error that says what is missing."""
    needed = ("latitude_deg", "longitude_deg", "altitude_m", "time", "epoch")
    missing = [name for name in needed if getattr(samples, name) is None]
    if missing:
        raise LogError(
            f"the world model needs {', '.join(needed)} and these samples have no "
            f"{' and no '.join(missing)}: add it with samples.with_columns(...)"
        )
    latitude, longitude, altitude, time, epoch = (getattr(samples, name) for name in needed)
    return latitude, longitude, altitude, time, epoch
