"""Figures of Matplotlib: what the pages show, for papers and notebooks."""

from __future__ import annotations

from collections.abc import Sequence
from datetime import UTC, datetime
from functools import singledispatch
from typing import Any

import numpy as np

from agonic.arrays import Array
from agonic.calibration.thermal import Thermal
from agonic.errors import AgonicError, MissingExtraError
from agonic.fit import Fit
from agonic.headings.result import Heading
from agonic.history.fit import drift
from agonic.history.result import Drift
from agonic.inflight.tracking import Tracker
from agonic.maths.equation.coverage import icosphere
from agonic.population import History
from agonic.recording.calibrated import Calibrated
from agonic.recording.figures import thin
from agonic.recording.quantities import find_level
from agonic.report.labels import unit_label
from agonic.report.tables import list_shares
from agonic.report.verdict import MEANINGS
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.result import CalibratedCampaign

TEMPERATURES = 200
AXES = ("x", "y", "z")


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
    figure = pyplot.figure(layout="constrained")
    pyplot.close(figure)  # so that a notebook shows it once, as the value of its cell
    draw(shown, figure)
    return figure


@singledispatch
def draw(shown: object, figure: Any) -> None:
    """Draw an object into a figure."""
    raise NotImplementedError


@draw.register
def _(shown: Calibrated, figure: Any) -> None:
    figure.set_size_inches(9, 8)
    above, below = figure.subfigures(2, 1, height_ratios=(3, 2))
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
    figure.suptitle(f"{shown.samples.name}: {shown.verdict}, {MEANINGS[shown.verdict][1]}")
    left, right = below.subplots(1, 2)
    _draw_shares(left, shown.fit)
    recorded = next((rung for rung in shown.ladder if rung.errors_deg), None)
    if recorded is None:
        _draw_coverage(right, shown.fit)
    else:
        _draw_heading_error(right, recorded.errors_deg, shown.fit.coverage.heading_sd_deg)


@draw.register
def _(shown: Fit, figure: Any) -> None:
    figure.set_size_inches(9, 3.4)
    left, right = figure.subplots(1, 2)
    figure.suptitle(f"{shown.verdict}, {MEANINGS[shown.verdict][1]}")
    _draw_shares(left, shown)
    _draw_coverage(right, shown)


def _draw_shares(axes: Any, fit: Fit) -> None:
    """What the heading's error is made of, the largest first."""
    axes.barh(list_shares(fit.shares), [sd**2 for sd in fit.shares.values()])
    axes.invert_yaxis()
    axes.set(xlabel="variance of the heading, °²", title="what the heading's error is made of")


def _draw_heading_error(axes: Any, errors_deg: Sequence[float], sd_deg: float) -> None:
    """The error of the heading as recorded, and a band of ± the standard error calibrated."""
    true = np.linspace(0, 360, len(errors_deg), endpoint=False)
    axes.plot(true, errors_deg, label="as recorded")
    axes.axhspan(-sd_deg, sd_deg, color="C1", label=f"calibrated: ± {sd_deg:.2g}°")
    axes.legend()
    axes.set(title="heading error, level", xlabel="true heading, °", ylabel="error, °")


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


@draw.register
def _(shown: Heading, figure: Any) -> None:
    figure.set_size_inches(9, 5)
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(3, 1))
    along = np.arange(len(shown)) if shown.time is None else shown.time
    trusted = shown.trusted
    reach = 2 * shown.sd_deg
    low, high = shown.true_deg - reach, shown.true_deg + reach
    above.fill_between(along, low, high, alpha=0.3, label="± 2 sd")
    above.plot(along[trusted], shown.true_deg[trusted], ".", markersize=2, label="true heading")
    above.plot(
        along[~trusted], shown.true_deg[~trusted], "x", color="red", markersize=3, label="flagged"
    )
    above.set(ylabel="heading, °", ylim=(0, 360))
    above.legend(loc="upper right")
    below.plot(along, shown.sd_deg)
    below.set(ylabel="sd, °", xlabel="row" if shown.time is None else "time, s")


@draw.register
def _(shown: Thermal | ThermalFit, figure: Any) -> None:
    one = shown if isinstance(shown, Thermal) else shown.calibration
    _draw_temperature(figure, {one.sensor: one})


@draw.register
def _(shown: CalibratedCampaign, figure: Any) -> None:
    found = {one.name: one.fit.calibration for one in shown.sensors if one.fit is not None}
    if not found:
        raise AgonicError("no sensor of the campaign could be fitted: there is nothing to draw")
    _draw_temperature(figure, found)


def _draw_temperature(figure: Any, calibrations: dict[str, Thermal]) -> None:
    """Bias and gains of each sensor over its temperature, with ± 2 standard errors."""
    figure.set_size_inches(9, 3 * len(calibrations))
    rows = figure.subplots(len(calibrations), 2, squeeze=False)
    for (name, one), (left, right) in zip(calibrations.items(), rows, strict=True):
        warm = np.linspace(*one.range_C, TEMPERATURES)
        bias, gain = one.bias_at(warm), np.diagonal(one.matrix_at(warm), axis1=1, axis2=2)
        sd = None if one.covariance is None else one.sd_at(warm)
        for axes, values, first in ((left, bias, 0), (right, gain, 3)):
            for k, letter in enumerate(AXES):
                (line,) = axes.plot(warm, values[:, k], label=letter)
                if sd is not None:
                    reach = 2 * sd[:, first + k]
                    low, high = values[:, k] - reach, values[:, k] + reach
                    axes.fill_between(warm, low, high, alpha=0.3, color=line.get_color())
            axes.set(xlabel="temperature, °C")
        left.set(ylabel=f"bias, {unit_label(one.unit_in)}", title=name)
        right.set(ylabel="gain", title="± 2 standard errors")
        left.legend()


@draw.register
def _(shown: Drift, figure: Any) -> None:
    trends = [one for one in shown.trends if one.kind == "bias"]
    if not trends:
        raise AgonicError(f"{shown.sensor} was calibrated too few times to draw a trend")
    figure.set_size_inches(9, 2.2 * len(trends))
    for one, axes in zip(
        trends, np.atleast_1d(figure.subplots(len(trends), sharex=True)), strict=True
    ):
        time = np.linspace(one.time[0], max(shown.at.timestamp(), one.time[-1]), TEMPERATURES)
        band, dates = one.at(time), _dates(time)
        reach = 2 * band.calibration_sd
        axes.fill_between(dates, band.mean - reach, band.mean + reach, alpha=0.3)
        axes.plot(dates, band.mean)
        axes.errorbar(_dates(one.time), one.value, one.sd, fmt=".", color="black")
        axes.set(ylabel=f"{one.name}, {one.unit}")


def _dates(time: Array) -> list[datetime]:
    return [datetime.fromtimestamp(float(one), UTC) for one in time]


@draw.register
def _(shown: History, figure: Any) -> None:
    names = [one.sensor for one in shown.sensors()]
    if len(names) != 1:
        raise AgonicError(
            f"the history holds {len(names)} sensors; draw one: "
            "ag.history.drift(history.of(NAME)).plot()"
        )
    draw(drift(shown.of(names[0])), figure)


@draw.register
def _(shown: Tracker, figure: Any) -> None:
    if not len(shown.history):
        raise AgonicError(
            f"the tracker has no step of its history yet, of {shown.params.history_s:g} s each; "
            "update it with a longer log"
        )
    figure.set_size_inches(9, 5)
    time, bias, sd = shown.history[:, 0], shown.history[:, 1:4], shown.history[:, 4:7]
    unit = unit_label(shown.state.base.unit_in)
    for k, axes in enumerate(figure.subplots(3, sharex=True)):
        reach = 2 * sd[:, k]
        axes.fill_between(time, bias[:, k] - reach, bias[:, k] + reach, alpha=0.3)
        axes.plot(time, bias[:, k])
        axes.set(ylabel=f"bias {AXES[k]}, {unit}")
    axes.set(xlabel="time, s")
