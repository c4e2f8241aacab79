"""The direction of the field as readings and attitudes come in: late, out of order, or never."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from agonic.alignment.direction.compute import (
    SAME_MOMENT_S,
    choose_gap,
    compute_direction,
    find_neighbours,
    require_covariance,
    require_into_stars,
)
from agonic.alignment.direction.result import FieldDirection
from agonic.alignment.session.session import Site, StarReadings, compute_unix_s
from agonic.arrays import Array, Mask
from agonic.calibration.steps import AnyCalibration
from agonic.samples import Samples

_USUAL = 1.5
"""Of their usual interval: farther apart, an attitude between two may be still to come."""
_BESIDE = 3
"""Attitudes on either side of readings that interpolation looks at."""


class Follower:
    """Readings that wait for their attitudes, and the direction of those that have them.

    A reading between two attitudes at their usual interval is ready. Where they are farther apart
    it waits for one that is late, until an attitude `wait_s` after it has come; then it takes those
    that there are, no more than `gap_s` apart, or is counted in `left_out`. Nothing is lost: every
    reading that was added comes out once, or is counted.

    Parameters
    ----------
    alignment, site, noise : as for `field_direction`.
    gap_s : attitudes further apart are not joined; `None`: five times their usual interval.
    wait_s : `None`: as long as `gap_s`.

    >>> import agonic as ag
    >>> night = ag.alignment.simulate_session(seed=1).session
    >>> follower = Follower(ag.fit_alignment(night).calibration, night.site, gap_s=30.0)
    >>> follower.add(night.magnetometer)
    >>> follower.take() is None
    True
    >>> follower.add(night.star)
    >>> len(follower.take()), follower.finish(), follower.left_out
    (456, None, 24)
    """

    def __init__(
        self,
        alignment: AnyCalibration,
        site: Site | None = None,
        *,
        noise: float | None = None,
        gap_s: float | None = None,
        wait_s: float | None = None,
    ) -> None:
        self._known, self._site, self._noise = require_into_stars(alignment), site, noise
        self._gap_s, self._wait_s = gap_s, wait_s
        self._waiting: Samples | None = None
        self._stars: StarReadings | None = None
        self.left_out = 0

    @property
    def waiting(self) -> int:
        """How many readings wait for an attitude."""
        return 0 if self._waiting is None else len(self._waiting)

    def add(self, *came: Samples | StarReadings) -> None:
        """Take readings or attitudes, in any order of time."""
        for one in came:
            if not len(one):
                continue
            if isinstance(one, Samples):
                self._waiting = one if self._waiting is None else _join(self._waiting, one)
            else:
                require_covariance(one)
                found = one if self._stars is None else one.join(self._stars)
                order = np.argsort(found.time, kind="stable")  # one that came twice counts once
                new = np.diff(found.time[order], prepend=-np.inf) > SAME_MOMENT_S
                self._stars = found.select(order[new])

    def take(self) -> FieldDirection | None:
        """The direction at the readings that are ready now; `None` where none is."""
        waiting, stars = self._waiting, self._stars
        if waiting is None or stars is None:
            return None
        ready, over = self._sort(compute_unix_s(waiting), stars)
        self.left_out += int((over & ~ready).sum())
        rest = np.flatnonzero(~(ready | over))
        self._waiting = waiting.select(rest) if len(rest) else None
        if not ready.any():
            return None
        now, gap = waiting.select(np.flatnonzero(ready)), self._find_gap(stars)
        first, last = np.searchsorted(stars.time, compute_unix_s(now)[[0, -1]])
        near = stars.select(slice(max(int(first) - _BESIDE, 0), int(last) + _BESIDE))
        # for readings that come late; beyond a minute no link delays and still delivers
        self._stars = stars.select(np.flatnonzero(stars.time >= stars.time[-1] - 60.0 - gap))
        return compute_direction(self._known, now, near, self._site, self._noise, gap)

    def finish(self) -> FieldDirection | None:
        """That of all that still wait: no attitude is to come any more."""
        self._wait_s = -np.inf
        found = self.take()
        self.left_out, self._waiting = self.left_out + self.waiting, None
        return found

    def _find_gap(self, stars: StarReadings) -> float:
        return choose_gap(stars) if self._gap_s is None else self._gap_s

    def _sort(self, moments: Array, stars: StarReadings) -> tuple[Mask, Mask]:
        """Which readings at moments (n,) are ready, and which have waited long enough."""
        time, gap = stars.time, self._find_gap(stars)
        over = time[-1] - moments > (gap if self._wait_s is None else self._wait_s)
        after, read, between = find_neighbours(moments, time, stars.orientation, gap)
        step = np.diff(time, prepend=-np.inf)
        usual = step[after] <= _USUAL * float(np.median(step[1:])) if len(time) > 1 else read
        return read | (between & (usual | over)), over


def follow_direction(
    alignment: AnyCalibration,
    batches: Iterable[tuple[Samples, StarReadings]],
    site: Site | None = None,
    *,
    noise: float | None = None,
    gap_s: float | None = None,
    wait_s: float | None = None,
) -> Iterator[FieldDirection]:
    """`field_direction` as readings and attitudes come in, batch by batch.

    The vectors are those of `field_direction` on all batches together. So are the standard errors,
    unless the platform's rate changes just where a batch ends.

    Parameters
    ----------
    alignment, site, noise, gap_s, wait_s : as for `Follower`.
    batches : pairs of new readings (n,) and new attitudes (m,), in any order of time.

    Yields a `FieldDirection` for readings that have become complete. Raises as `field_direction`.

    >>> import agonic as ag
    >>> night = ag.alignment.simulate_session(seed=1).session
    >>> turn, batches = ag.fit_alignment(night).calibration, [(night.magnetometer, night.star)]
    >>> sum(len(part) for part in follow_direction(turn, batches, night.site, gap_s=30.0))
    456
    """
    follower = Follower(alignment, site, noise=noise, gap_s=gap_s, wait_s=wait_s)
    for batch in batches:
        follower.add(*batch)
        if (found := follower.take()) is not None:
            yield found
    if (found := follower.finish()) is not None:
        yield found


def _join(before: Samples, after: Samples) -> Samples:
    """Readings with others in the order of time; of two at one moment the later is put after it by
    the least step that a sum of seconds holds."""
    time = np.concatenate([before.seconds_since(before.epoch), after.seconds_since(before.epoch)])
    order = np.argsort(time, kind="stable")
    time = time[order]
    least = 4 * float(np.spacing(np.abs(time).max()))
    while (ties := time[1:] <= time[:-1]).any():
        time[1:][ties] = time[:-1][ties] + least
    old, new = before.columns(), after.columns()
    columns = {name: np.concatenate([old[name], new[name]])[order] for name in old if name in new}
    return before.with_columns(**{**columns, "time": time})
