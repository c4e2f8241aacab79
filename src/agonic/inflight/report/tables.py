"""The tables and sentences of a page about a flight."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from agonic.arrays import Array, Index
from agonic.inflight.fit import InflightFit
from agonic.inflight.report import figures
from agonic.inflight.report.flight import Comparison, Flight, Numbers
from agonic.maths.estimation.noise.residuals import robust_scale
from agonic.report.digits import (
    count,
    degrees,
    each_with_sd,
    group_digits,
    percent,
    quantity,
    round_to_sd,
    show_sign,
    with_sd,
)
from agonic.report.labels import per_label, unit_label
from agonic.report.markup import Markup, grouped_table
from agonic.report.section import Block, Section, Shown, Table, aside
from agonic.report.tables import NOTHING
from agonic.report.verdict import sentence

NAMED = 0.1
"""Share of the variance from which a cause is named."""
_BINS = 12

CAUSES = {
    "time": "a bias that drifts: allow it more knots, or a larger walk",
    "latitude": "what the field model leaves out (the auroral zones, the ring current), or gains "
    "and cross terms that are fixed: solve for more, or leave out high latitudes",
    "temperature": "a bias or gains that change with temperature: start from a calibration over "
    "temperature, or let the bias depend on it",
    "shadow": "currents that flow in sunlight only, as of solar panels, or the cold of the "
    "shadow: record the current as a column current_A",
}


class Share(NamedTuple):
    """How much of the residuals' variance goes with something, 0…1, and what that points to."""

    what: str
    share: float

    @property
    def cause(self) -> str:
        """What it points to."""
        return CAUSES[self.what]

    @property
    def named(self) -> bool:
        """Whether it stands out."""
        return self.share >= NAMED


def explain(flight: Flight) -> list[Share]:
    """The shares, largest first, each corrected for what chance alone would explain.

        1 − (1 − R²)(m − 1)/(m − k),   m = readings over those that count as one

    with R² from the means of k classes (adjusted R²: Theil, Economic Forecasts and Policy, 1961).
    """
    used, eclipse = flight.used, flight.eclipse
    values = flight.residuals[used]
    if len(values) < 2 * _BINS:
        return []
    # standard deviations at which an outlier counts no more
    scale = 4.0 * max(robust_scale(values - np.median(values)), 1e-12)
    values = np.clip(values - np.median(values), -scale, scale)
    alone = max(len(values) / flight.correlation, 1.0)
    along = {"time": flight.time, "latitude": flight.latitude_deg}
    if flight.temperature is not None and np.ptp(flight.temperature) > 0:
        along["temperature"] = flight.temperature
    classes = {what: _find_classes(of) for what, of in along.items() if of is not None}
    if eclipse is not None and 0 < eclipse.mean() < 1:
        classes["shadow"] = eclipse.astype(np.intp)
    shares = [Share(what, _find_share(values, of[used], alone)) for what, of in classes.items()]
    return sorted(shares, key=lambda one: -one.share)


def _find_classes(values: Array) -> Index:
    """Twelve classes of equal width between the 0.1st and the 99.9th percentile."""
    low, high = np.percentile(values, (0.1, 99.9))
    share = (values - low) / max(high - low, np.finfo(float).tiny)
    return np.asarray(np.clip((share * _BINS).astype(np.intp), 0, _BINS - 1))


def _find_share(values: Array, of_class: Index, alone: float) -> float:
    """Adjusted R² of the means of the classes; 0 where chance would do as well."""
    counts = np.bincount(of_class)
    k, means = int(np.count_nonzero(counts)), np.bincount(of_class, values) / np.maximum(counts, 1)
    total = float(((values - values.mean()) ** 2).sum())
    if total == 0.0 or alone <= k:
        return 0.0
    left = float(((values - means[of_class]) ** 2).sum()) / total
    return max(0.0, 1.0 - left * (alone - 1) / (alone - k))


def list_causes(shares: list[Share]) -> list[Shown]:
    """What the residuals go with, and the likely causes by name."""
    if not shares:
        return ["Too few readings to find what the residuals follow."]
    said = (
        "What the residuals follow is their likely cause."
        if shares[0].named
        else f"Nothing explains {percent(NAMED)} or more of the residuals’ variance: no cause "
        "stands out."
    )
    rows = [
        [
            sentence(one.what)[:-1],
            percent(one.share) if one.share >= 0.01 else f"below {percent(0.01)}",
            sentence(one.cause) if one.named else NOTHING,
        ]
        for one in shares
    ]
    head = ["Goes with", "Share of the variance", "Points to"]
    return [said, Table(head, rows, "causes")]


def compare_numbers(numbers: tuple[Numbers, ...]) -> Section:
    """Ground against flight: values with standard errors, and the change in units of its own."""
    every = [q for group in numbers for q in group.rows]
    title, known = "Ground against flight", every[0].ground is not None
    if not known:
        title = "Numbers"
        said = "There was no ground calibration to compare with. ± is one standard error."
    elif all(q.ground_sd is None for q in every):
        said = (
            "The ground calibration came without standard errors, so a change is measured by that "
            "of the flight alone. Lines at ±1 and ±2 standard errors."
        )
    else:
        said = (
            "σ is that of the change, from both standard errors. Lines at ±1 and ±2 σ; beyond ±3 "
            "the two do not agree."
        )
    shown = [group for group in numbers if not all(q.fixed for q in group.rows)]
    for group in numbers:
        if group not in shown:
            said += f" The {group.name.lower()} was fixed at its earlier value."
    return Section(title, [lambda: [_tabulate(shown, known), aside(said)]])


def _tabulate(groups: list[Numbers], known: bool) -> Markup:
    sigmas = [abs(q.sigmas) for g in groups for q in g.rows if q.sigmas is not None]
    reach = float(np.clip(1.2 * max(sigmas, default=3.0), 4.0, 12.0))
    head = ["Number", "Flight"]
    if known:
        head = ["Number", "Ground", "Flight", "Change", "in σ", "change over its standard error"]
    named = (
        (
            f"{group.name}{f', {unit_label(group.unit)}' if group.unit else ''}"
            f"{f' ({group.note})' if group.note else ''}",
            [_list_cells(q, reach) for q in group.rows],
        )
        for group in groups
    )
    return grouped_table(head, named, class_="numbers compared")


def _list_cells(q: Comparison, reach: float) -> list[str]:
    if q.ground is None:
        fixed = f"{round_to_sd(q.flight, None)} (fixed)"
        return [q.name, fixed if q.fixed else with_sd(q.flight, q.flight_sd)]
    digits = None if q.fixed else q.change_sd
    ground = with_sd(q.ground, q.ground_sd) if q.ground_sd else round_to_sd(q.ground, digits)
    if q.sigmas is None:
        return [q.name, ground, "fixed", NOTHING, NOTHING, Markup("")]
    change = show_sign(round_to_sd(q.flight - q.ground, q.change_sd))
    far = f"{show_sign(group_digits(q.sigmas, 1 if abs(q.sigmas) < 100 else 0))} σ"
    flight = with_sd(q.flight, q.flight_sd)
    return [q.name, ground, flight, change, far, figures.draw_sigmas(q.sigmas, reach)]


def list_left_out(flight: Flight) -> list[Shown]:
    """How many readings had no part in the result, by reason."""
    whole = len(flight.residuals)
    rows = [
        [sentence(why)[:-1], group_digits(n), percent(n / max(whole, 1))]
        for why, n in flight.left_out.items()
        if n
    ]
    part = "were used for the result" if flight.fit else "are counted on this page"
    used = count(int(np.count_nonzero(flight.used)), "reading")
    said = f"{used} of {group_digits(whole)} {part}."
    if flight.fit is not None and flight.fit.thinned > 1:
        said += f" Drawn and counted here is every {flight.fit.thinned}th row of the record."
    if not rows:
        return [f"{said} None was left out."]
    return [said, Table(["Left out", "Readings", "Share"], rows, "numbers reasons")]


def list_held_out(flight: Flight) -> list[Shown]:
    """The error on readings not seen, by the number of intervals tried."""
    if flight.fit is None:
        return [
            "Nothing was chosen by held-out error: each residual on this page is from before the "
            "reading was used, so all of them are held out."
        ]
    held_out, chosen = flight.fit.held_out, flight.fit.drift.intervals
    if not held_out:
        return ["The number of knots was given, so nothing was chosen by held-out error."]
    rows = []
    for n, error in held_out.items():
        above, small = error / min(held_out.values()) - 1, 0.001
        more = show_sign(percent(above)) if above >= small else f"below {percent(small)}"
        name, choice = count(n, "interval") if n else "constant", "chosen" if n == chosen else ""
        rows.append([name, quantity(error, "nT"), more if above else NOTHING, choice])
    said = (
        "Every second block of time was left out of the fit and then predicted. Intervals are "
        "doubled until unseen readings fit clearly better, then as long as they fit no worse."
    )
    head = ["Bias in time", "Residual of unseen readings, rms", "Above the least", ""]
    return [said, Table(head, rows, "numbers choices")]


def describe_model_error(flight: Flight) -> str:
    """How large the residuals are, and how much of them is correlated, in words."""
    begin = "Residuals scatter" if flight.fit else "Predictions miss"
    said = f"{begin} by {quantity(flight.noise, 'nT', 2)} (one standard deviation)."
    if not flight.lasting_s:
        return (
            f"{said} Successive residuals are uncorrelated: errors of the field model are small "
            "beside the noise of single readings."
        )
    alone = float(np.sqrt(max(flight.noise**2 - flight.lasting_nT**2, 0.0)))
    seconds, every = flight.lasting_s, " Every standard error on this page takes account of it."
    unit, size = next((u, s) for u, s, most in _DURATIONS if seconds < most)
    return (
        f"{said} Of this {quantity(alone, 'nT', 2)} is noise, new in every reading; the other "
        f"{quantity(flight.lasting_nT, 'nT', 2)} are correlated over about "
        f"{quantity(max(seconds, 0.01) / size, unit, 2)}, so that "
        f"{quantity(flight.correlation, '', 2)} readings count as much as an independent one."
        f"{every if flight.fit else ''} Correlated errors come from the field model (crust, ring "
        "current, ionosphere), currents on board, or a calibration that changes with temperature."
    )


_DURATIONS = (("s", 1.0, 120.0), ("min", 60.0, 7200.0), ("h", 3600.0, np.inf))
"""Units of a time, s, and up to when each is used."""


def describe_direction(fit: InflightFit | None) -> list[Block]:
    """How far corrected field and model are apart in direction, and how the sensor is mounted."""
    if fit is None or fit.direction_error_deg is None:
        return []
    used = fit.direction_error_deg[fit.weights > 0]
    apart = ", ".join(
        f"{quantity(of.noise, 'nT', 2)} in {kind}" for kind, of in fit.channels.items()
    )
    said = (
        f"The corrected field points {degrees(float(np.median(used)))} (median; rms "
        f"{degrees(float(np.sqrt(np.mean(used**2))))}) from the field of the model. Standard "
        f"deviations: {apart}."
    )
    parts: list[Block] = [said, figures.draw_direction(fit.time, fit.direction_error_deg, used)]
    if fit.alignment is not None:
        turn, sd = np.degrees(fit.alignment.rotation.as_rotvec()), np.zeros(3)
        if fit.alignment.covariance is not None:
            sd = np.degrees(np.sqrt(np.maximum(np.diag(fit.alignment.covariance), 0.0)))
        frames = f"Turn from the axes {fit.alignment.frame_in} to {fit.alignment.frame_out}"
        errors = (  # small ones in arcseconds
            quantity(3600.0 * one, "″", 2) if one < 0.05 else degrees(one) for one in sd.tolist()
        )
        names = (f"about {axis}" for axis in "xyz")
        rows = [*zip(names, each_with_sd(turn, sd), errors, strict=True)]
        parts.append(Table([frames, "°", "standard error"], rows))
    return parts


def describe_sources(fit: InflightFit | None) -> list[Block]:
    """What a unit of each source on board adds to a reading."""
    if fit is None or not fit.source_names:
        return []
    rows = [
        [name, *each_with_sd(added, errors)]
        for name, added, errors in zip(
            fit.source_names, fit.sources.T, fit.sources_sd.T, strict=True
        )
    ]
    units = " or ".join(sorted({per_label(name) for name in fit.source_names}))
    note = f"What each adds to a reading, {unit_label(fit.change.unit_in)} {units}."
    return [note, Table(["Source", "x", "y", "z"], rows)]


def compare_sunlight(flight: Flight) -> list[Shown]:
    """Residuals in sunlight and in the shadow, and how far their means are apart."""
    assert flight.eclipse is not None
    rows, means, errors = [], [], []
    for name, inside in {
        "Sunlit": ~flight.eclipse,
        "In the Earth’s shadow": flight.eclipse,
    }.items():
        values = flight.residuals[inside & flight.used]
        if len(values) == 0:
            rows.append([name, group_digits(0), NOTHING, NOTHING, NOTHING])
            continue
        middle = float(np.median(values))
        scatter = robust_scale(values - middle)
        means.append(float(values.mean()))
        errors.append(scatter * float(np.sqrt(flight.correlation / len(values))))
        mean, spread = with_sd(means[-1], errors[-1]), quantity(scatter, "nT", 2)
        rows.append([name, group_digits(len(values)), mean, quantity(middle, "nT", 2), spread])
    head = ["", "Readings", "Mean, nT", "Median", "Scatter"]
    said = "The whole record lies in sunlight, or the whole of it in the shadow."
    if len(means) == 2:
        step = show_sign(with_sd(means[1] - means[0], float(np.linalg.norm(errors))))
        said = f"In the shadow the mean is {step} nT from that in sunlight."
    return [Table(head, rows, "numbers light"), said]
