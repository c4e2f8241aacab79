"""The tables and sentences of a page about a flight."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.inflight.report.figures import draw_sigmas
from agonic.inflight.report.flight import Comparison, Flight, Numbers
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.report.digits import (
    count,
    group_digits,
    percent,
    quantity,
    round_to_sd,
    show_sign,
    with_sd,
)
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, row, table
from agonic.report.tables import NOTHING
from agonic.report.verdict import sentence

NAMED = 0.1
"""Share of the variance from which a cause is named."""
_BINS = 12
_CLIP = 4.0  # standard deviations at which an outlier counts no more


@dataclass(frozen=True, kw_only=True)
class Share:
    """How much of the residuals' variance goes with something, 0…1, and what that points to."""

    what: str
    share: float
    cause: str

    @property
    def named(self) -> bool:
        """Whether it stands out."""
        return self.share >= NAMED


CAUSES = {
    "time": "a bias that drifts: allow it more knots, or a larger walk",
    "latitude": "what the field model leaves out (the auroral zones, the ring current), or gains "
    "and cross terms that are fixed: solve for more, or leave out high latitudes",
    "temperature": "a bias or gains that change with temperature: start from a calibration over "
    "temperature, or let the bias depend on it",
    "shadow": "currents that flow in sunlight only, as of solar panels, or the cold of the "
    "shadow: record the current as a column current_A",
}


def explain(flight: Flight) -> list[Share]:
    """The shares, largest first, each corrected for what chance alone would explain.

        1 − (1 − R²)(m − 1)/(m − k),   m = readings over those that count as one

    with R² from the means of k classes (adjusted R²: Theil, Economic Forecasts and Policy, 1961).
    """
    rows = flight.used
    values = flight.residuals[rows]
    if len(values) < 2 * _BINS:
        return []
    scale = _CLIP * max(robust_scale(values - np.median(values)), 1e-12)
    values = np.clip(values - np.median(values), -scale, scale)
    alone = max(len(values) / flight.correlation, 1.0)
    found = [
        Share(what=what, share=_share(values, of_class[rows], alone), cause=CAUSES[what])
        for what, of_class in _classes(flight)
    ]
    return sorted(found, key=lambda e: -e.share)


def _classes(flight: Flight) -> Iterator[tuple[str, NDArray[np.int64]]]:
    """The class of every reading by each quantity that is known."""
    yield "time", _in_classes(flight.time)
    if flight.latitude_deg is not None:
        yield "latitude", _in_classes(flight.latitude_deg)
    if flight.temperature is not None and np.ptp(flight.temperature) > 0:
        yield "temperature", _in_classes(flight.temperature)
    if flight.eclipse is not None and 0 < flight.eclipse.mean() < 1:
        yield "shadow", flight.eclipse.astype(np.int64)


def _in_classes(values: Array) -> NDArray[np.int64]:
    """Twelve classes of equal width between the 0.1st and the 99.9th percentile."""
    low, high = np.percentile(values, (0.1, 99.9))
    share = (values - low) / max(high - low, np.finfo(float).tiny)
    return np.asarray(np.clip((share * _BINS).astype(np.int64), 0, _BINS - 1))


def _share(values: Array, of_class: NDArray[np.int64], alone: float) -> float:
    """Adjusted R² of the means of the classes; 0 where chance would do as well."""
    counts = np.bincount(of_class)
    sums = np.bincount(of_class, values)
    k = int(np.count_nonzero(counts))
    means = sums / np.maximum(counts, 1)
    total = float(((values - values.mean()) ** 2).sum())
    if total == 0.0 or alone <= k:
        return 0.0
    left = float(((values - means[of_class]) ** 2).sum()) / total
    return max(0.0, 1.0 - left * (alone - 1) / (alone - k))


FARTHEST = 12.0
"""Standard errors that a bar shows at most; the number beside it has no end."""


def compare_numbers(groups: tuple[Numbers, ...]) -> Markup:
    """Ground against flight: values with standard errors, and the change in units of its own."""
    known = any(q.ground is not None for group in groups for q in group.rows)
    all_sigmas = [abs(q.sigmas) for g in groups for q in g.rows if q.sigmas is not None]
    reach = float(np.clip(1.2 * max(all_sigmas, default=3.0), 4.0, FARTHEST))
    head = ["Number", "Flight"]
    if known:
        head = ["Number", "Ground", "Flight", "Change", "in σ", "change over its standard error"]
    bodies = []
    for group in groups:
        unit = f", {unit_label(group.unit)}" if group.unit else ""
        note = f" ({group.note})" if group.note else ""
        name = element("th", f"{group.name}{unit}{note}", scope="rowgroup", colspan=len(head))
        cells = (row(_cells(q, known, reach)) for q in group.rows)
        bodies.append(element("tbody", element("tr", name), *cells))
    columns = element("tr", *(element("th", text, scope="col") for text in head))
    return element("table", element("thead", columns), *bodies, class_="numbers compared")


def _cells(q: Comparison, known: bool, reach: float) -> list[str]:
    flight = "fixed" if q.fixed and known else with_sd(q.flight, q.flight_sd)
    if q.fixed and not known:
        flight = f"{round_to_sd(q.flight, None)} (fixed)"
    if not known:
        return [q.name, flight]
    assert q.ground is not None
    assert q.change is not None
    digits = None if q.fixed else q.change_sd
    ground = with_sd(q.ground, q.ground_sd) if q.ground_sd else round_to_sd(q.ground, digits)
    if q.sigmas is None:
        return [q.name, ground, flight, NOTHING, NOTHING, Markup("")]
    change = show_sign(round_to_sd(q.change, q.change_sd))
    far = f"{show_sign(group_digits(q.sigmas, 1 if abs(q.sigmas) < 100 else 0))} σ"
    return [q.name, ground, flight, change, far, draw_sigmas(q.sigmas, reach)]


def compare_sunlight(flight: Flight) -> Markup:
    """Residuals in sunlight and in the shadow, and how far their means are apart."""
    assert flight.eclipse is not None
    parts = {"Sunlit": ~flight.eclipse, "In the Earth’s shadow": flight.eclipse}
    rows, means, errors = [], [], []
    for name, inside in parts.items():
        values = flight.residuals[inside & flight.used]
        if len(values) == 0:
            rows.append([name, group_digits(0), NOTHING, NOTHING, NOTHING])
            continue
        scatter = robust_scale(values - np.median(values))
        error = scatter * float(np.sqrt(flight.correlation / len(values)))
        means.append(float(values.mean()))
        errors.append(error)
        middle = quantity(float(np.median(values)), "nT", 2)
        n, mean = group_digits(len(values)), with_sd(means[-1], error)
        rows.append([name, n, mean, middle, quantity(scatter, "nT", 2)])
    drawn = table(["", "Readings", "Mean, nT", "Median", "Scatter"], rows, class_="numbers light")
    if len(means) < 2:
        said = "The whole record lies in sunlight, or the whole of it in the shadow."
    else:
        apart = float(np.hypot(errors[0], errors[1]))
        said = (
            f"In the shadow the mean is {show_sign(with_sd(means[1] - means[0], apart))} nT "
            "from that in sunlight."
        )
    return Markup(drawn + element("p", said))


def list_left_out(flight: Flight) -> Markup:
    """How many readings had no part in the result, by reason."""
    whole = len(flight.residuals)
    rows = [
        [sentence(why)[:-1], group_digits(n), percent(n / max(whole, 1))]
        for why, n in flight.left_out.items()
        if n
    ]
    used = int(np.count_nonzero(flight.used))
    part = "are counted on this page" if flight.predicted else "were used for the result"
    said = f"{count(used, 'reading')} of {group_digits(whole)} {part}."
    if flight.fit is not None and flight.fit.thinned > 1:
        said += f" Drawn and counted here is every {flight.fit.thinned}th row of the record."
    if not rows:
        return element("p", f"{said} None was left out.")
    drawn = table(["Left out", "Readings", "Share"], rows, class_="numbers reasons")
    return Markup(element("p", said) + drawn)


def list_held_out(flight: Flight) -> Markup:
    """The error on readings not seen, by the number of intervals tried."""
    if flight.fit is None:
        return element(
            "p",
            "Nothing was chosen by held-out error: each residual on this page is from before the "
            "reading was used, so all of them are held out.",
        )
    held_out, chosen = flight.fit.held_out, flight.fit.drift.intervals
    if not held_out:
        said = "The number of knots was given, so nothing was chosen by held-out error."
        return element("p", said)
    least = min(held_out.values())
    rows = []
    for n, error in held_out.items():
        name, choice = count(n, "interval") if n else "constant", "chosen" if n == chosen else ""
        rows.append([name, quantity(error, "nT"), _above(error / least - 1), choice])
    said = (
        "Every second block of time was left out of the fit and then predicted. Intervals are "
        "doubled until unseen readings fit clearly better, then as long as they fit no worse."
    )
    head = ["Bias in time", "Residual of unseen readings, rms", "Above the least", ""]
    return Markup(element("p", said) + table(head, rows, class_="numbers choices"))


def describe_model_error(flight: Flight) -> Markup:
    """How large the residuals are, and how much of them is correlated, in words."""
    begin = "Predictions miss" if flight.predicted else "Residuals scatter"
    said = f"{begin} by {quantity(flight.noise, 'nT', 2)} (one standard deviation)."
    if not flight.lasting_s:
        said += (
            " Successive residuals are uncorrelated: errors of the field model are small "
            "beside the noise of single readings."
        )
        return element("p", said)
    alone = float(np.sqrt(max(flight.noise**2 - flight.lasting_nT**2, 0.0)))
    said += (
        f" Of this {quantity(alone, 'nT', 2)} is noise, new in every reading; the other "
        f"{quantity(flight.lasting_nT, 'nT', 2)} are correlated over about "
        f"{_duration(flight.lasting_s)}, so that {quantity(flight.correlation, '', 2)} readings "
        "count as much as an independent one."
    )
    if not flight.predicted:
        said += " Every standard error on this page takes account of it."
    said += (
        " Correlated errors come from the field model (crust, ring current, ionosphere), currents "
        "on board, or a calibration that changes with temperature."
    )
    return element("p", said)


def _duration(seconds: float) -> str:
    """A time in a unit that fits."""
    if seconds < 120:
        return quantity(max(seconds, 0.01), "s", 2)
    if seconds < 7200:
        return quantity(seconds / 60, "min", 2)
    return quantity(seconds / 3600, "h", 2)


def list_causes(shares: list[Share]) -> Markup:
    """What the residuals go with, and the likely causes by name."""
    if not shares:
        return element("p", "Too few readings to find what the residuals follow.")
    named = [share for share in shares if share.named]
    rows = []
    for one in shares:
        of = percent(one.share) if one.share >= 0.01 else f"below {percent(0.01)}"
        cause = sentence(one.cause) if one.named else NOTHING
        rows.append([sentence(one.what)[:-1], of, cause])
    said = (
        "What the residuals follow is their likely cause."
        if named
        else f"Nothing explains {percent(NAMED)} or more of the residuals’ variance: no cause "
        "stands out."
    )
    head = ["Goes with", "Share of the variance", "Points to"]
    return Markup(element("p", said) + table(head, rows, class_="causes"))


def _above(share: float) -> str:
    if share == 0.0:
        return NOTHING
    return show_sign(percent(share)) if share >= 0.001 else f"below {percent(0.001)}"
