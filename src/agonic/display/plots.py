"""Figures of Matplotlib: what the pages show, for papers and notebooks."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import singledispatch
from typing import Any

import numpy as np

from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, MissingExtraError
from agonic.fit import Fit
from agonic.headings.document import draw_heading, draw_sd
from agonic.headings.result import Heading
from agonic.history.document import draw_trends
from agonic.history.fit import drift
from agonic.history.result import Drift
from agonic.inflight.report.figures import draw_course
from agonic.inflight.report.flight import find_course
from agonic.inflight.tracking import Tracker
from agonic.maths.equation.coverage import icosphere
from agonic.population import History
from agonic.recording.calibrated import Calibrated
from agonic.recording.figures import draw_headings, thin
from agonic.recording.quantities import find_level
from agonic.report.figure import Figure, Panel
from agonic.report.labels import unit_label
from agonic.report.marks import Mark
from agonic.report.tables import list_shares
from agonic.report.verdict import MEANINGS
from agonic.thermal.figures import draw_coefficients
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.result import CalibratedCampaign

BESIDE = 3
"""Small panels in a row."""


def plot(shown: object) -> Any:
    """What the page of an object shows, as a figure of Matplotlib.

    Save it with `plot().savefig("figure.png")`; a notebook shows it.
    """
    if draw.dispatch(type(shown)) is draw.dispatch(object):
        raise AgonicError(
            f"a {type(shown).__name__} has no figure; these have one: a result of ag.calibrate, a "
            "Fit, Heading, thermal calibration or fit, History, Drift and Tracker"
        )
    try:
        from matplotlib import pyplot  # type: ignore[import-not-found,unused-ignore]
    except ImportError:
        raise MissingExtraError("a figure", "plot") from None
    made = pyplot.figure(layout="constrained")
    pyplot.close(made)  # so that a notebook shows it once, as the value of its cell
    draw(shown, made)
    return made


@singledispatch
def draw(shown: object, onto: Any) -> None:
    """Draw an object into a figure."""
    raise NotImplementedError


@draw.register
def _(shown: Calibrated, onto: Any) -> None:
    onto.set_size_inches(9, 8)
    above, below = onto.subfigures(2, 1, height_ratios=(3, 2))
    calibration = shown.fit.calibration
    rows = thin(len(shown.samples), 3000)
    before, after = shown.verification.spread_before, shown.verification.spread_after
    spheres = (
        ("readings", shown.samples.field[rows], calibration.unit_in, before),
        ("calibrated", shown.corrected[rows], calibration.unit_out, after),
    )
    for k, (name, points, of, spread) in enumerate(spheres, start=1):
        axes = above.add_subplot(1, 2, k, projection="3d")
        size = np.linalg.norm(points, axis=1)
        level = find_level(shown) if k == 2 else float(size.mean())
        axes.scatter(*points.T, c=size - level, s=2, cmap="coolwarm")
        axes.scatter(0, 0, 0, marker="+", color="black", s=60)
        axes.set(title=f"{name}, spread {100 * spread:.2g} %", aspect="equal")
        axes.set(xlabel=f"x, {unit_label(of)}", ylabel="y", zlabel="z")
        axes.locator_params(nbins=4)
    onto.suptitle(f"{shown.samples.name}: {shown.verdict}, {MEANINGS[shown.verdict][1]}")
    left, right = below.subplots(1, 2)
    _draw_shares(left, shown.fit)
    if any(rung.errors_deg for rung in shown.ladder):
        first = next(one for one in draw_headings(shown) if isinstance(one, Figure))
        _draw_panel(right, first.panels[0], first.title, _choose_colours(first.panels[:1]), set())
    else:
        _draw_coverage(right, shown.fit)


@draw.register
def _(shown: Fit, onto: Any) -> None:
    onto.set_size_inches(9, 3.4)
    left, right = onto.subplots(1, 2)
    onto.suptitle(f"{shown.verdict}, {MEANINGS[shown.verdict][1]}")
    _draw_shares(left, shown)
    _draw_coverage(right, shown)


def _draw_shares(axes: Any, fit: Fit) -> None:
    """What the heading's error is made of, the largest first."""
    axes.barh(list_shares(fit.shares), [sd**2 for sd in fit.shares.values()])
    axes.invert_yaxis()
    axes.set(xlabel="variance of the heading, °²", title="what the heading's error is made of")


def _draw_coverage(axes: Any, fit: Fit) -> None:
    """The 80 directions by azimuth and height; those never seen are open."""
    centres, cells = icosphere()[0], fit.coverage.cells
    azimuth = np.degrees(np.arctan2(centres[:, 1], centres[:, 0]))
    height = np.degrees(np.arcsin(np.clip(centres[:, 2], -1, 1)))
    seen = cells > 0
    marks = axes.scatter(azimuth[seen], height[seen], c=np.log10(cells[seen]), s=60)
    axes.scatter(azimuth[~seen], height[~seen], facecolors="none", edgecolors="red", s=60)
    axes.figure.colorbar(marks, ax=axes, label="log₁₀ of readings")
    axes.set(xlim=(-180, 180), ylim=(-90, 90), title=f"{seen.sum()} of 80 directions")
    axes.set(xlabel="azimuth in the sensor, °", ylabel="height towards z, °")


# ---- the figures of pages ------------------------------------------------------------------------


def _list_trends(shown: Drift) -> list[Figure]:
    trends = [one for one in shown.trends if one.kind == "bias"]
    if not trends:
        raise AgonicError(f"{shown.sensor} was calibrated too few times to draw a trend")
    return [draw_trends(trends, shown)]


def _choose_sensor(shown: History) -> list[Figure]:
    names = [one.sensor for one in shown.sensors()]
    if len(names) != 1:
        raise AgonicError(
            f"the history holds {len(names)} sensors; draw one: "
            "ag.history.drift(history.of(NAME)).plot()"
        )
    return _list_trends(drift(shown.of(names[0])))


def _draw_tracked(shown: Tracker) -> list[Figure]:
    if not len(shown.history):
        raise AgonicError(
            f"the tracker has no step of its history yet, of {shown.params.history_s:g} s each; "
            "update it with a longer log"
        )
    return [draw_course(find_course(shown), "the bias")]


def _list_sensors(shown: CalibratedCampaign) -> list[Figure]:
    drawn = [
        replace(one, title=f"{sensor.name}: {one.title}")
        for sensor in shown.sensors
        if sensor.fit is not None
        for one in draw_coefficients(sensor.fit.calibration)
        if isinstance(one, Figure)
    ]
    if not drawn:
        raise AgonicError("no sensor of the campaign could be fitted: there is nothing to draw")
    return drawn


_FIGURES: dict[type, Callable[[Any], Sequence[object]]] = {
    CalibratedCampaign: _list_sensors,
    Drift: _list_trends,
    Heading: lambda one: [draw_heading(one), draw_sd(one)],
    History: _choose_sensor,
    Thermal: draw_coefficients,
    ThermalFit: lambda one: draw_coefficients(one.calibration, one.bins),
    Tracker: _draw_tracked,
}
"""What pages show of these."""


def _draw_figures(shown: object, onto: Any) -> None:
    """Every panel of the figures of a page: small ones beside each other, others below."""
    figures = [one for one in _FIGURES[type(shown)](shown) if isinstance(one, Figure)]
    panels = [panel for one in figures for panel in one.panels]
    wide = BESIDE if all(panel.kind == "small" for panel in panels) else 1
    tall = -(-len(panels) // wide)
    onto.set_size_inches(9, 2.4 * tall)
    places = iter(range(1, len(panels) + 1))
    for one in figures:
        colours, words = _choose_colours(one.panels), set[str]()
        for k, panel in enumerate(one.panels):
            axes = onto.add_subplot(tall, wide, next(places))
            _draw_panel(axes, panel, one.title * (k == 0), colours, words)


def _choose_colours(panels: Iterable[Panel]) -> dict[str, str]:
    """A colour of the cycle for each name of marks, the same in all panels of a figure."""
    marks = (one for panel in panels for one in panel.marks if isinstance(one, Mark) and one.seen)
    return {name: f"C{k}" for k, name in enumerate(dict.fromkeys(one.name for one in marks))}


for _kind in _FIGURES:
    draw.register(_kind, _draw_figures)


def _draw_panel(
    axes: Any, panel: Panel, title: str, colours: Mapping[str, str], words: set[str]
) -> None:
    """A panel of a page: its marks, its axes, and a legend of what `words` do not name yet."""
    x, y = panel.x, panel.y
    axes.set(xlim=(x.low, x.high), ylim=(y.low, y.high), xlabel=x.label, ylabel=y.label)
    axes.set(title=title, **{f"{of}scale": "log" for of in "xy" if getattr(panel, of).logarithmic})
    marks = [one for one in panel.marks if isinstance(one, Mark) and one.seen]
    named = len(words)
    for one in marks:
        label = None if one.words in words else one.words or None
        _DRAWN[one.kind](axes, *one.at, color=colours[one.name], label=label)
        words |= {one.words} - {""}
    if len(words) > named:
        axes.legend(fontsize="x-small")


def _dot(axes: Any, *at: Any, **look: Any) -> None:
    axes.plot(*at, ".", markersize=3, **look)


def _fill(axes: Any, across: Any, low: Any, high: Any, **look: Any) -> None:
    axes.fill_between(across, low, high, alpha=0.3, linewidth=1, **look)


def _shade(axes: Any, begin: Any, end: Any, **look: Any) -> None:
    bottom, top = axes.get_ylim()
    axes.bar(begin, top - bottom, end - begin, bottom, align="edge", alpha=0.2, **look)


def _underline(axes: Any, begin: Any, end: Any, **look: Any) -> None:
    axes.hlines(np.full(len(begin), axes.get_ylim()[0]), begin, end, linewidth=6, **look)


_DRAWN: dict[str, Callable[..., object]] = {
    "curve": lambda axes, *at, **look: axes.plot(*at, **look),
    "area": _fill,
    "spread": _fill,
    "dots": _dot,
    "whiskers": lambda axes, *at, **look: axes.vlines(*at, **look),
    "level": lambda axes, at, **look: axes.hlines(at, *axes.get_xlim(), linestyles="--", **look),
    "upright": lambda axes, at, **look: axes.vlines(at, *axes.get_ylim(), **look),
    "span": _shade,
    "bars": lambda axes, a, b, c, d, **look: axes.bar(a, d - c, b - a, c, align="edge", **look),
    "histogram": lambda axes, *at, **look: axes.stairs(*at, fill=True, **look),
    "foot": _underline,
}
"""How Matplotlib draws each kind of mark."""
