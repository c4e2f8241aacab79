"""What explains a misfit that no usual mistake does: each likely cause as a few unknowns more.

A clock, a platform that moved, an orientation with wrong readings, a magnetometer that is not quite
calibrated: the residuals are linear in all of them, so that what each leaves needs no new solution.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import fdtrc

from agonic.alignment.maths.two_frames import (
    GROUPS,
    Solution,
    compute_residual,
    compute_whitener,
)
from agonic.alignment.session.earth import ARCSEC_PER_S
from agonic.alignment.session.session import Site
from agonic.arrays import Array
from agonic.health import Finding, figure
from agonic.health.finding import Fact, find_facts
from agonic.maths.estimation import leastsq
from agonic.maths.rotations.frames import ARCSEC_RAD

UNSOLVED = {
    ("reference",): ("axes of the reference", "the axes of the reference"),
    ("pier",): ("the field between the piers", "the pier"),
    ("bias",): ("the bias of the magnetometer", "the magnetometer's bias"),
    ("matrix",): ("gains and angles of the magnetometer", "the magnetometer's matrix"),
    ("bias", "matrix"): ("the magnetometer", "the magnetometer's bias and matrix"),
}
"""What may not have been solved for: its name, and what to solve for."""


class Explanation(NamedTuple):
    """A cause in words, what to do, the misfit χ² over freedom that it leaves, and its unknowns."""

    words: str
    move: str
    left: float
    unknowns: int


class _Cause(NamedTuple):
    """Columns (k, 3, j): what its j unknowns do to the residuals; words with their size in braces.
    Of those of one `kind` the best is named."""

    kind: str
    columns: Array
    words: str
    move: str


def find_explanations(
    solution: Solution, time: Array, orientation: NDArray[np.int64], site: Site | None = None
) -> list[Explanation]:
    """What would explain the misfit, the simplest first of those that explain it as well. The
    whitened residuals r and the Jacobian J of the unknowns are joined by columns D of a cause: it
    leaves χ² = |r − J a − D d|² of the best a and d, on j freedoms fewer. Of orientations (k,) at
    times (k,); with a `site` also what a star sensor's clock does, and what could be solved for."""
    residuals, jacobian = compute_residual(solution.unknowns, solution.measured)
    white = compute_whitener(solution.unknowns, solution.measured)
    left = (white @ residuals[:, :, None]).ravel()
    moved = (white @ jacobian[:, :, solution.free]).reshape(len(left), -1)
    moved = moved / np.maximum(np.linalg.norm(moved, axis=0), 1e-300)
    basis = np.linalg.svd(moved, full_matrices=False)[0]
    found: dict[str, Explanation] = {}
    causes = list(_list_motions(jacobian, time, orientation))
    if site is not None:
        causes += [_clock(solution, site), *_list_unsolved(solution, jacobian)]
    for cause in causes:
        columns = (white @ cause.columns).reshape(len(left), -1)
        columns = columns - basis @ (basis.T @ columns)
        size = leastsq.inverse(columns.T @ columns) @ (columns.T @ left)
        explained, more = float(size @ columns.T @ left), columns.shape[1]
        freedom = solution.freedom - more
        rest = (solution.chi2 - explained) / max(freedom, 1)
        chance = fdtrc(more, freedom, explained / more / rest) if freedom > 0 else 1.0
        likely = len(causes) * chance < 0.01  # of any of them (Bonferroni)
        best = found[cause.kind].left if cause.kind in found else np.inf
        if likely and rest < best:
            words = _write(cause, size, solution.magnitude)
            found[cause.kind] = Explanation(words, cause.move, rest, more)
    good = choose_explanations(found.values(), solution.chi2 / solution.freedom)
    return sorted(good, key=lambda one: (one.unknowns, one.left))[:3]


def choose_explanations(found: Iterable[Explanation], now: float) -> list[Explanation]:
    """The best first, where it leaves less than half of the misfit that there is now, and others
    that do so too and leave no more than half as much again."""
    order = sorted(found, key=lambda one: one.left)
    if not order or not order[0].left < now / 2:
        return []
    return [one for one in order if one.left <= min(1.5 * order[0].left, now / 2)]


def find_causes(
    table: Iterable[Fact], effects: Mapping[str, Collection[str]], *subject: object
) -> tuple[Finding, ...]:
    """The findings of a table, but for the `effects` that another one of them has, by its name."""
    found = tuple(find_facts(table, *subject))
    explained = {name for one in found for name in effects.get(one.name, ())}
    return tuple(one for one in found if one.name not in explained)


def describe_misfit(seen: str, found: Sequence[Explanation], otherwise: str = "") -> dict[str, str]:
    """A misfit that was `seen` in words: with what would explain it, or else what to do."""
    if not found:
        return {"what": seen, "action": otherwise}
    others = " or ".join(one.words for one in found[1:4])
    also = f"; so would {others}" if others else ""
    return {"what": f"{seen}; {found[0].words} would explain it{also}", "action": found[0].move}


def _list_motions(jacobian: Array, time: Array, orientation: NDArray[np.int64]) -> Iterator[_Cause]:
    """What moves between orientations, or in one of them."""
    turns, shifts = jacobian[:, :, GROUPS["alignment"]], jacobian[:, :, GROUPS["pier"]]
    steadily = ((time - time.mean()) / max(float(np.ptp(time)), 1e-9))[:, None, None]
    yield _Cause(
        "turns",
        turns * steadily,
        "an alignment that turns by {turn} from first to last",
        "keep the platform at one temperature, or take the readings in less time",
    )
    yield _Cause(
        "drifts",
        shifts * steadily,
        "a reference that drifts by {field} from first to last",
        "look at the base line of the reference",
    )
    rows, order = np.arange(len(time)), np.argsort(time, kind="stable")
    for k in range(2, len(order) - 1):
        yield _Cause(
            "moved",
            turns * np.isin(rows, order[k:])[:, None, None],
            f"a platform that moved by {{turn}} after orientation {int(orientation[order[k - 1]])}",
            "fit the orientations before and after by themselves",
        )
    for k, number in enumerate(orientation):
        yield _Cause(
            "one",
            np.eye(3) * (rows == k)[:, None, None],
            f"orientation {number}, off by {{field}} or {{share}},",
            f"check whether the platform stood still in orientation {number}, or leave it out",
        )


def _clock(solution: Solution, site: Site) -> _Cause:
    """The Earth turns on with the time: ∂v_c/∂t = R_cn (Ω × v_n), Ω towards the pole."""
    at, measured = solution.unknowns, solution.measured
    latitude = np.radians(site.latitude_deg)
    pole = ARCSEC_PER_S * ARCSEC_RAD * np.array([np.cos(latitude), 0.0, -np.sin(latitude)])
    beside = (measured.reference + at.offset) @ at.rot_nr.T
    moved = measured.rot_cn @ np.cross(pole, beside)[:, :, None]
    words = "a clock of the star sensor {seconds} s {side}"
    return _Cause("clock", moved, words, "correct the times of the star sensor")


def _list_unsolved(solution: Solution, jacobian: Array) -> Iterator[_Cause]:
    """Groups of unknowns that were not solved for."""
    for groups, (what, solved) in UNSOLVED.items():
        if not set(groups) & set(solution.groups):
            columns = np.concatenate([jacobian[:, :, GROUPS[one]] for one in groups], axis=2)
            words = f"{what} (off by {{moved}} nT of field)"
            move = f"solve for {solved} as well, or calibrate before"
            yield _Cause(" ".join(groups), columns, words, move)


def _write(cause: _Cause, size: Array, magnitude: float) -> str:
    """The words with the size of the unknowns (j,): as a turn, as a field and the turn that this
    amounts to, as what it moves the field by (rms), as seconds."""
    length = float(np.linalg.norm(size))
    moved = np.sqrt(np.mean(np.sum((cause.columns @ size) ** 2, axis=1)))
    return cause.words.format(
        turn=f"{figure(length / ARCSEC_RAD)}″",
        field=f"{figure(length)} nT",
        share=f"{figure(length / magnitude / ARCSEC_RAD)}″",
        moved=figure(float(moved)),
        seconds=figure(abs(float(size[0]))),
        side="behind" if size[0] > 0 else "ahead",
    )
