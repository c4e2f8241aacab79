"""What each term makes of the error of level headings, by itself and through the parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array
from agonic.health.finding import figure
from agonic.maths.equation.affine import split
from agonic.maths.equation.coverage import level_directions
from agonic.model.average import EVIDENCE, Sized
from agonic.model.rows import Rows
from agonic.model.term import Errors, Seen, Term


class Level(NamedTuple):
    """Level headings (h,): derivatives by the parameters (h, m) and by errors of the readings over
    the radius (h, 3), degrees, and what terms see there; the mean products (m, m) of the former,
    and the variance of a heading by errors of unit size on every axis, degrees²."""

    by_params: Array
    by_errors: Array
    seen: Seen
    square: Array
    per_error: float

    def spread(self, covariance: Array) -> float:
        """Variance of a heading, mean over all, by parameters of a covariance (m, m)."""
        return float(np.sum(covariance * self.square))


def stand_level(
    rows: Rows, params: Array, origin: Array, inclination_deg: float, down: Array
) -> Level:
    """The level headings of a calibration, by its parameters in the problem's units."""
    basis = rows.problem.basis
    m = basis.shape[1]
    bias, matrix = split(basis @ params[:m])
    directions, across = level_directions(inclination_deg, down=down)
    level = np.cos(np.radians(inclination_deg))
    d = directions @ np.linalg.inv(matrix).T
    by_matrix = (across[:, :, None] * d[:, None, :]).reshape(len(d), 9)
    by_params = np.zeros((len(d), len(params)))
    local = np.concatenate([-across @ matrix, by_matrix], axis=1) @ basis
    by_params[:, :m] = np.degrees(local / level)
    seen = rows.seen._replace(
        x=(d + bias + origin) / rows.radius,
        unit=directions,
        time=np.zeros(len(d)),
        rows=np.zeros(len(d), dtype=np.intp),
        blur=0.0,
    )
    by_errors = np.degrees(across @ matrix * rows.radius / level)
    square = by_params.T @ by_params / len(d)
    return Level(by_params, by_errors, seen, square, float(np.sum(by_errors**2) / len(d)))


SHAPE, DILUTION = 1.0, 1.5
"""Of what a term that is there moves the heading by, so much is in doubt: of a bend, whose law is
not known, and of a term of noisy rates, which comes out too small (regression dilution)."""


class Share(NamedTuple):
    """A term's part in a fit: log-odds that it is there, its rms error in the readings over the
    field, the standard error of a level heading that it makes, of that at rest what the parameters
    do not have, and the rms by which it moves a heading over the log, degrees; the row from which
    on the bias is another, then by `size`; of a term with one unknown that `measured`, with its
    standard error, over the field."""

    term: Term
    odds: float
    size: float
    heading_deg: float
    at_rest_deg: float
    moves_deg: float
    row: int | None = None
    measured: tuple[float, float] | None = None

    def reduce(self, part: float) -> Share:
        """The share with this part of its variances."""
        root = float(np.sqrt(part))
        return self._replace(
            heading_deg=root * self.heading_deg, at_rest_deg=root * self.at_rest_deg
        )

    @property
    def said(self) -> str:
        """What was measured of a term with one unknown, in words; "" of others, or by chance."""
        if self.measured is None or not self.term.unit or self.odds < EVIDENCE:
            return ""
        value, sd = (each * self.term.quantum for each in self.measured)
        decimals = max(1 - int(np.floor(np.log10(max(sd, 1e-9)))), 0)
        return f"{self.term.what} {value:.{decimals}f} ± {figure(sd)} {self.term.unit}"


def weigh(term: Term, sized: Sized, level: Level, errors: Errors | None) -> Share:
    """The share of a term, with its errors in the log where it is there."""
    m = len(level.square)
    moved, rest = level.spread(sized.spread[:m, :m]), 0.0
    if term.at_rest:
        own = term.errors(level.seen)
        assert own is not None
        if term.sideways:
            rest = term.sideways * own.mean_square(sized.square) * level.per_error
        else:
            direct = own.along(level.by_errors.T).T
            whole = direct + level.by_params @ sized.alias[:m]
            both = float(np.sum((whole @ sized.covariance) * whole)) / len(whole)
            rest = max(both - moved, 0.0) + float(np.mean((direct @ sized.mean) ** 2))
    if errors is not None and (term.at_rest or term.diluted):
        move = level.by_params @ (sized.alias[:m] @ sized.mean)
        rest += (DILUTION if term.diluted else SHAPE) ** 2 * float(np.mean(move**2))
    size = 0.0 if errors is None else float(np.sqrt(errors.mean_square(sized.square)))
    alone = len(sized.mean) == 1
    return Share(
        term=term,
        odds=sized.odds,
        size=size,
        heading_deg=float(np.sqrt(moved + rest)),
        at_rest_deg=float(np.sqrt(rest)),
        moves_deg=size * float(np.sqrt(level.per_error / 3)) if term.moves else 0.0,
        measured=(float(sized.mean[0]), float(np.sqrt(sized.covariance[0, 0]))) if alone else None,
    )
