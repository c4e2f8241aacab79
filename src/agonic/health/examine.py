"""What a fit gives away about the readings: plane, cap, outliers, two sensors, a changed field."""

from __future__ import annotations

import numpy as np

from agonic.health.decoding import MOST_TRIED_ROWS
from agonic.health.evidence import (
    FITTING_NOISE,
    MOST_ROWS,
    NOISE_DOUBTFUL,
    OUTLIERS_TELLING,
    SPARE,
    Evidence,
)
from agonic.health.finding import Fact, Finding, Limit, Told, find_facts
from agonic.health.outliers import find_outliers
from agonic.health.states import check_states, spreads_by_direction
from agonic.maths.equation.coverage import describe_axis, measure_arc_deg
from agonic.maths.equation.crowding import (
    choose_evenly,
    choose_spread_rows,
    count_orientations,
    looks_like_noise,
)
from agonic.maths.one_pass import find_length, median


def examine(
    evidence: Evidence,
    changes: bool | None = None,
    left: float | None = None,
    *,
    attitude_aided: bool = False,
) -> tuple[Finding, ...]:
    """The findings of a fit, the gravest first; one cause is not reported twice. Readings in a
    plane are no fault of an attitude-aided fit. Without any sign of `changes` two biases are not
    sought, nor, where nobody looked (`None`), among many readings whose residuals are alike in all
    directions; `left` is what terms leave, over the radius."""
    few: list[Finding] = []
    if not attitude_aided:
        shape = next(find_facts((STATIC, PLANE, SMALL_TILT), evidence), None)
        few = [] if shape else [*find_facts([FEW_ORIENTATIONS], evidence)]
        if shape is not None or any(one.severity == "refuse" for one in few):
            return (shape,) if shape is not None else tuple(few)
    kept = evidence.weights > 0.0
    changes = len(kept) < MOST_TRIED_ROWS if changes is None else changes
    changes = changes or float(kept.mean()) < 1.0 - OUTLIERS_TELLING
    if not changes:
        some = np.flatnonzero(kept)
        some = some[choose_evenly(len(some), MOST_ROWS)]
        changes = spreads_by_direction(evidence.residuals[some], evidence.normals[some])
    changed = check_states(evidence, left) if changes else None
    if changed is not None:
        return (changed, *few)
    outliers = find_outliers(evidence)
    found = (*few, *find_facts([DISTURBED], evidence), outliers)
    return tuple(finding for finding in found if finding is not None)


def _measure_rest(e: Evidence) -> Told:
    """Readings that hardly move: far less than the field would move them, or a ball of noise."""
    some = e.readings[choose_spread_rows(e.crowding, most=MOST_ROWS)]
    low, high = np.percentile(some, (2, 98), axis=0)
    spread = float((high - low).max() / 2)
    # but not on a sphere of their own that is far smaller, as of a unit that is another: at rest
    # they would be about as long as the field
    turned = (
        float(np.ptp(e.readings, axis=0).max()) > e.radius and e.noise < FITTING_NOISE * e.radius
    )
    known = e.known_radius or 0.0
    too_small = turned and median(find_length(e.readings)) < 0.5 * known
    at_rest = spread < 0.1 * known and not too_small
    if not (at_rest or (e.noise > 0.15 * e.radius and looks_like_noise(some))):
        return None
    return {"spread": spread, "unit": e.unit}


def _count_few(e: Evidence) -> Told:
    """Held still in few orientations: however often each was read, it says one thing."""
    reach = min(max(8 * e.noise, 0.02 * e.radius), 0.1 * e.radius)
    enough = e.unknowns + SPARE
    count = count_orientations(e.readings[e.weights > 0], reach, enough)
    left = "and hardly any are left to check the result"
    if count < e.unknowns:
        left = "that do not determine it"
    told = {"count": count, "unknowns": e.unknowns, "enough": enough, "left": left}
    return {"value": enough - count, **told}


def _measure_tilt(e: Evidence) -> Told:
    """Readings nearly in a plane."""
    thick, normal, _ = e.flatness
    if thick > 0.1 or _is_plane(e):
        return None
    return {"tilt": float(np.degrees(np.arcsin(min(thick, 1.0)))), "axis": describe_axis(normal)}


def _is_plane(e: Evidence) -> bool:
    return e.flatness[0] < max(0.02, 1.5 * 2.4 * e.noise / e.radius)


def _measure_plane(e: Evidence) -> Told:
    """Readings in a plane: the centre along its normal is not determined."""
    thick, normal, used = e.flatness
    if thick > 0.1 or not _is_plane(e):
        return None
    arc, span, more, move = measure_arc_deg(used), "", "", TILT
    if arc < 180.0:  # less tells neither bias nor gain in the plane
        span, more = f"on an arc of some {round(arc, -1):.0f}° ", ", nor well in the plane"
        move = "turn all the way round at several headings, with the nose up, down and banked"
    return {"span": span, "axis": describe_axis(normal), "more": more, "move": move}


TILT = "tilt the nose up and down and bank by 30° or more at several headings"
STATIC = Fact(
    "static",
    _measure_rest,
    "refuse",
    "the sensor did not turn: its readings move by only ±{spread} {unit}",
    "turn it slowly about all three axes while recording",
)
PLANE = Fact(
    "plane",
    _measure_plane,
    "refuse",
    "all readings lie {span}in one plane (its normal is near {axis}): bias and gain along {axis} "
    "are not determined{more}",
    "{move}",
)
SMALL_TILT = Fact(
    "small tilt",
    _measure_tilt,
    "refuse",
    "all readings lie near one plane (normal near {axis}, tilt about {tilt:.0f}° only): bias and "
    "gain along {axis} are not determined",
    TILT,
)
FEW_ORIENTATIONS = Fact(
    "few orientations",
    _count_few,
    Limit(0, SPARE),
    "the sensor was held in {count} orientations only; the calibration has {unknowns} unknowns, "
    "{left}",
    "record {enough} orientations or more, well spread, or keep turning the sensor slowly",
)
DISTURBED = Fact(
    "disturbed",
    lambda e: {
        "value": np.nan_to_num(e.noise / e.radius, nan=np.inf),  # no noise is known of no fit
        "percent": 100 * e.noise / e.radius,
    },
    Limit(NOISE_DOUBTFUL),
    "readings scatter by {percent:.1f} % of the field about the best calibration: the field was "
    "not the same everywhere",
    "record away from steel, magnets and currents, keeping the sensor in one place",
)
