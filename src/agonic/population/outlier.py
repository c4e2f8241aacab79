"""`Outlier`: a sensor that stands out from its population, and why."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np

from agonic.arrays import Array, Index, Mask
from agonic.calibration.decomposition import PAIRS
from agonic.health.finding import figure
from agonic.maths.estimation.inference import find_discoveries
from agonic.maths.estimation.robust.tails import Tail, fit_tail
from agonic.maths.rotations.right_angles import right_angles
from agonic.population.peers import MIN_PEERS, Peers, Quantity, find_peers
from agonic.population.population import AXES, Population
from agonic.readable import Shown
from agonic.units import RAW

_DOF = 4.0  # of the Student t by which members are judged


class Likelihoods(NamedTuple):
    """Log-likelihood of each sensor for each swap, (n, 48), up to a constant of the sensor."""

    turns: Array
    log: Array

    def evidence(self) -> Array:
        """The e-value against unswapped axes: the mean likelihood ratio over the other swaps, (n,).
        A regular member reaches e ≥ 1/p with a probability of at most p."""
        others = self.log[:, 1:] - self.log[:, :1]
        largest = others.max(axis=1)
        mean = np.exp(others - largest[:, None]).mean(axis=1)
        return np.asarray(np.exp(np.minimum(largest, 600.0)) * mean)


def list_swaps() -> Array:
    """The 48 matrices that take axes to axes, mirrored ones too, (48, 3, 3); first the identity."""
    return np.concatenate([right_angles(), -right_angles()])


def swap_axes(parameters: Array, turn: Array) -> Array:
    """Bias, gains and cross-axis terms xy xz yz (…, 9) of the sensor with its axes swapped. b' = P
    b, W' = P W Pᵀ."""
    own = np.argmax(np.abs(turn), axis=1)
    sign = turn[range(3), own]
    pairs = [PAIRS.index((min(own[a], own[b]), max(own[a], own[b]))) for a, b in PAIRS]
    order = [*own, *(3 + own), *(6 + np.array(pairs))]
    signs = [*sign, 1.0, 1.0, 1.0, *(sign[a] * sign[b] for a, b in PAIRS)]
    return np.asarray(parameters[..., order] * signs)


def compute_likelihoods(parameters: Array, sd: Array, centre: Array, spread: Array) -> Likelihoods:
    """How well each sensor fits its population after each swap of its axes.

    Every parameter of a member is taken as a Student t with 4 degrees of freedom about the centre,
    with the scale √(spread² + sd²). Parameters: parameters and sd (n, 9) as for `swap_axes`, NaN
    where there are none; centre and spread (9,).
    """
    turns = list_swaps()
    log = np.empty((len(parameters), len(turns)))
    for k, turn in enumerate(turns):
        error = np.nan_to_num(np.abs(swap_axes(sd, turn)), posinf=np.inf)
        scale = np.sqrt(spread**2 + error**2)
        z = (swap_axes(parameters, turn) - centre) / scale
        each = -0.5 * (_DOF + 1) * np.log1p(z**2 / _DOF) - np.log(scale)
        log[:, k] = np.where(np.isfinite(each), each, 0.0).sum(axis=1)
    return Likelihoods(turns, log)


MIN_DISCOVERY_RATE = 0.03
"""Of all sensors named, the share that chance may have named at most, where they are many."""

GEOMETRY = ("bias", "gain", "cross")
_PAIRS = ("x and y", "x and z", "y and z")


@dataclass(frozen=True)
class Outlier:
    """A sensor that stands out, by one quantity, and the sentence that says so.

    `row` of the population is the calibration it was seen in. `quantity` is "bias", "gain",
    "cross", "magnitude", "noise", "spread" or "axes"; `distance` how many times as far from the
    centre it is as sensors commonly are (of axes: the logarithm of the evidence); `p_value` how
    often chance puts a regular one there.
    """

    sensor: Annotated[str, Shown()]
    source: Annotated[str, Shown()]
    row: int
    quantity: Annotated[str, Shown()]
    sentence: Annotated[str, Shown()]
    distance: float
    p_value: float


@dataclass(frozen=True)
class Tested:
    """One quantity of sensors, above or below or in all directions: how far out each is. `members`
    are those that have a distance, on this side; `times` is theirs in what is common."""

    name: str
    quantity: Quantity
    members: Index
    tail: Tail
    times: Array
    p_values: Array


def find_outliers(population: Population, *, rate: float | None = None) -> tuple[Outlier, ...]:
    """Sensors that stand out from their population, each with a sentence that says why.

    Every quantity of a sensor (bias, gains, cross-axis terms, the magnitude where it has the gain,
    noise, what is left of the spread of the magnitude) is set against centre and spread of its
    peers, robustly estimated and without the errors of the fits, with its own error added. How
    often chance puts a regular sensor as far out is read from the tail of the population itself,
    and from Student's t with four degrees of freedom where the sensors are too few to show theirs.
    Of the sensors named, chance has named a share of at most `rate` (Benjamini and Hochberg, all
    sensors and quantities together).

    Where the population shares a pattern of bias or soft iron, a sensor that belongs to it only
    after a swap of its axes (one of 48: b' = P b, W' = P W Pᵀ) is named for that instead.

    Source: Benjamini, Hochberg, J. R. Stat. Soc. B 57 (1995) 289; Wang, Ramdas, J. R. Stat. Soc. B
    84 (2022) 822 for the swaps.
    """
    groups = [group for group in find_peers(population) if group.enough]
    if rate is None:
        rate = choose_rate(sum(map(len, groups)))
    tested = [
        (group, test)
        for group in groups
        for name, quantity in group.quantities.items()
        for test in list_tests(name, quantity)
    ]
    found: list[Outlier] = []
    holding = discover([test for _, test in tested], rate)
    for (group, test), holds in zip(tested, holding, strict=True):
        for k in np.flatnonzero(holds & test.quantity.matters[test.members]).tolist():
            member, times = int(test.members[k]), float(test.times[k])
            said = _describe(group, test.name, test.quantity, member, times)
            p_value = float(test.p_values[k])
            found.append(_make_outlier(group, member, test.name, said, times, p_value))
    turned = [
        one
        for group in groups
        for one in _find_swapped_axes(group, [t for its, t in tested if its is group], rate)
    ]
    return _order(found, turned)


def choose_rate(sensors: int) -> float:
    """The false discovery rate for so many sensors: 3 %, and up to 10 % from 20 to 30 of them.

    Few sensors show little of their tail, so that little can stand out, and a second look costs
    less than a board that is missed. Still of n regular ones at most 0.5 % are named by chance,
    and where a tenth is bad, chance adds no more than 0.3 sensors to the list.
    """
    return max(MIN_DISCOVERY_RATE, min(0.1, 0.005 * sensors, 3.0 / max(sensors, 1)))


def list_tests(name: str, quantity: Quantity) -> Iterator[Tested]:
    """The tests of a quantity, where enough sensors have it."""
    distance = quantity.distance
    known = np.isfinite(distance)
    above = quantity.values[:, 0] > quantity.centre[0]
    both = (above, ~above)
    sides = {"magnitude": both, "noise": both, "spread": (above,)}.get(name, (known,))
    for side in sides:
        members = np.flatnonzero(known & side)
        if known.sum() >= MIN_PEERS and 2 * len(members) >= MIN_PEERS // len(sides):
            far, dimensions = distance[members], quantity.values.shape[1]
            tail = fit_tail(far, dimensions)
            times = far / (tail.scale * float(np.sqrt(dimensions)))
            yield Tested(name, quantity, members, tail, times, tail.beyond(far))


def discover(tests: Sequence[Tested], rate: float) -> list[Mask]:
    """Which members of each test stand out, all judged together."""
    p_values = np.concatenate([*(test.p_values for test in tests), np.zeros(0)])
    ends = np.cumsum([len(test.members) for test in tests], dtype=np.intp)
    return np.split(find_discoveries(p_values, rate), ends)[: len(tests)]


def _make_outlier(
    group: Peers, member: int, quantity: str, said: str, times: float, p_value: float
) -> Outlier:
    row = int(group.rows[member])
    sensor, source = group.population["sensor"][row], group.population["source"][row]
    return Outlier(sensor, source, row, quantity, said, times, p_value)


def _order(found: Iterable[Outlier], turned: Iterable[Outlier]) -> tuple[Outlier, ...]:
    """Sensors in the order of their rows; swapped axes explain what else their geometry shows. So
    does one gain the magnitude."""
    swaps, others = list(turned), list(found)
    explained = {(one.row, name) for one in swaps for name in GEOMETRY}
    explained |= {(one.row, "magnitude") for one in others if one.quantity == "gain"}
    left = [one for one in others if (one.row, one.quantity) not in explained]
    return tuple(sorted([*swaps, *left], key=lambda o: (o.row, o.quantity != "axes", -o.distance)))


# ---- swapped axes --------------------------------------------------------------------------------


def _find_swapped_axes(group: Peers, tested: Sequence[Tested], rate: float) -> Iterator[Outlier]:
    three = [group.quantities[name] for name in GEOMETRY]
    values, sd = (np.hstack([getattr(q, name) for q in three]) for name in ("values", "sd"))
    centre = np.concatenate([q.centre for q in three])
    spread = np.concatenate([np.hypot(q.spread, 0.1 * q.least) for q in three])
    if not np.isfinite(centre[:6]).all() or not (spread[:6] > 0).all():
        return
    tails = {test.name: test.tail for test in tested}
    odd = [test.members[test.p_values < 0.05] for test in tested if test.name in GEOMETRY]
    members = np.unique(np.concatenate([*odd, np.zeros(0, dtype=np.intp)]))
    likelihoods = compute_likelihoods(values[members], sd[members], centre, spread)
    evidence = likelihoods.evidence()
    for k in np.flatnonzero(find_discoveries(1.0 / evidence, rate, len(group))).tolist():
        log, member = likelihoods.log[k], int(members[k])
        best = int(np.argmax(log))
        turn = likelihoods.turns[best]
        own, error = swap_axes(values[member], turn), np.abs(swap_axes(sd[member], turn))
        if _changes_pattern(turn, centre, spread) and _is_regular(
            own, error, group.quantities, tails
        ):
            ways = int(np.count_nonzero(log > log[best] - np.log(20.0)))  # 20 to 1
            said, times = _describe_swap(turn, ways), float(np.log(evidence[k]))
            yield _make_outlier(group, member, "axes", said, times, float(1.0 / evidence[k]))


def _changes_pattern(turn: Array, centre: Array, spread: Array) -> bool:
    """Whether the swap changes what the population has in common by more than it spreads."""
    scale = np.hypot(spread, np.abs(swap_axes(spread, turn)))
    z = (swap_axes(centre, turn) - centre) / scale
    return bool(np.linalg.norm(z[np.isfinite(z)]) > 5.0)  # spreads


def _is_regular(
    own: Array, error: Array, quantities: Mapping[str, Quantity], tails: Mapping[str, Tail]
) -> bool:
    """Whether a sensor with these parameters is one of its population."""
    for k, name in enumerate(GEOMETRY):
        part, usual = slice(3 * k, 3 * k + 3), quantities[name]
        one = replace(usual, values=own[None, part], sd=error[None, part])
        far = one.distance
        if name in tails and np.isfinite(far[0]) and tails[name].beyond(far)[0] < 1e-3:  # by chance
            return False
    return True


# ---- words ---------------------------------------------------------------------------------------


def _describe(group: Peers, name: str, quantity: Quantity, member: int, times: float) -> str:
    value, centre, spread = quantity.values[member], quantity.centre, quantity.spread
    if name in ("magnitude", "noise", "spread"):
        return _describe_size(group, name, float(value[0]), float(centre[0]))
    away = value - centre
    worst = int(np.argmax(np.abs(away) / np.hypot(spread, 1e-12 + 0.1 * quantity.least)))
    usual = f"{figure(times)} times as far as is usual among {len(group)} sensors"
    if name == "bias":
        unit = _name_unit(group.unit_in)
        size, parts = (
            figure(float(np.linalg.norm(away)), 3),
            ", ".join(
                f"{axis} {away[k]:+.{_count_decimals(away)}f}" for k, axis in enumerate(AXES)
            ),
        )
        return f"its bias is {size} {unit} from that of the others ({parts}), {usual}"
    decimals = _count_decimals(np.append(spread[spread > 0], 0.01 * abs(away[worst])))
    both = f"{value[worst]:.{decimals}f}", f"{centre[worst]:.{decimals}f}"
    around = f"{both[1]} ± {spread[worst]:.{decimals}f}"
    if name == "gain":
        return f"its gain on {AXES[worst]} is {both[0]}, that of the others {around}, {usual}"
    gain = float(group.quantities["gain"].centre.mean())
    angle = figure(abs(float(np.degrees(2 * away[worst] / gain))))
    return (
        f"its axes {_PAIRS[worst]} are {angle}° further from their angle than those of the others "
        f"(cross-axis term {both[0]}, others {around}), {usual}"
    )


def _describe_size(group: Peers, name: str, log: float, usual: float) -> str:
    if name == "magnitude":
        field, others = figure(float(np.exp(log)), 3), figure(float(np.exp(usual)), 3)
        return (
            f"it saw a field of {field} {_name_unit(group.unit_out)}, the others {others}: all its "
            f"gains are {figure(100 * abs(float(np.expm1(log - usual))))} % "
            f"too {'large' if log > usual else 'small'}, or it was elsewhere"
        )
    more = figure(float(np.exp(abs(log - usual))))
    times = f"{more} times that of the others" if log > usual else f"1/{more} of the others'"
    value, centre = float(np.exp(log)), float(np.exp(usual))
    if name == "noise":
        unit = _name_unit(group.unit_in)
        return f"its noise is {times}: {figure(value)} {unit} instead of {figure(centre)}"
    shares = f"{figure(100 * value)} % instead of {figure(100 * centre)} %"
    return f"its calibrated magnitude spreads {more} times as much as that of the others: {shares}"


def _name_unit(unit: str) -> str:
    return "raw units" if unit == RAW else unit or "units"


def _count_decimals(values: Array) -> int:
    """Decimal places that show two digits of the smallest value, from 0 to 8."""
    least = float(np.min(np.abs(values))) if len(values) else 0.0
    return int(np.clip(1 - np.floor(np.log10(least)), 0, 8)) if least > 0 else 0


def _describe_swap(turn: Array, ways: int) -> str:
    axes = []
    for own, column in enumerate(turn.T):
        theirs = int(np.argmax(np.abs(column)))
        if own != theirs or column[theirs] < 0:
            sign = "−" if column[theirs] < 0 else ""
            axes.append(f"its {AXES[own]} is the others' {sign}{AXES[theirs]}")
    said = f"axes swapped: {', '.join(axes)}; then it is like the others"
    return said + (f" ({ways} ways fit about equally well)" if ways > 1 else "")
