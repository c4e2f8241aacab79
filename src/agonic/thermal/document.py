"""What is said and shown of a calibrated campaign."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from agonic.health import sort_findings
from agonic.report.digits import count, each_with_sd, name_each, quantity, significant, write_minus
from agonic.report.document import Document
from agonic.report.labels import unit_label
from agonic.report.markup import element
from agonic.report.section import Block, Section, aside, tabulate
from agonic.report.verdict import WHEN_GOOD, moves, sentence
from agonic.thermal import figures, tables
from agonic.thermal.calibration_document import (
    STYLES,
    describe_validity,
    list_key_figures,
    show_coefficients,
)
from agonic.thermal.campaign.description import join_numbers
from agonic.thermal.campaign.recording import Campaign
from agonic.thermal.checks.boards import find_courses, list_boards
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.fit.result import ThermalFit
from agonic.thermal.result import CalibratedCampaign, CalibratedSensor


def campaign_page(
    result: CalibratedCampaign,
    *,
    title: str = "",
    files: Mapping[str, Sequence[str]] | None = None,
    beside: Mapping[str, Sequence[float]] | None = None,
    beside_words: str = "published",
) -> str:
    """All sensors of a campaign in a climatic chamber as one self-contained HTML page.

    Parameters
    ----------
    result : from `calibrate_campaign`. title : default: the name of the campaign.
    files : what was written for each sensor, by its name.
    beside : four ratios (x, y, z, |B|) to show under those of a sensor, by its name, and
        `beside_words` what they are.

    Returns the page: no network, dark and light, made for screens from 360 px and for A4.

    Source: Nikolaev et al. 2023, figures 5 and 6 and the table.

    >>> from agonic.thermal.all_sensors import calibrate_campaign
    >>> from agonic.thermal.simulation.campaign import simulate_campaign
    >>> made = simulate_campaign("MMC5883MA", rate_Hz=0.02)
    >>> result = calibrate_campaign(made.campaign, held_out=False)
    >>> page = campaign_page(result, title="<box>")
    >>> page.count("&lt;box&gt;"), page.count("<article")
    (2, 1)
    """
    return describe_campaign(
        result, title=title, files=files, beside=beside, beside_words=beside_words
    ).to_html()


def describe_campaign(
    result: CalibratedCampaign,
    *,
    title: str = "",
    files: Mapping[str, Sequence[str]] | None = None,
    beside: Mapping[str, Sequence[float]] | None = None,
    beside_words: str = "published",
) -> Document:
    """What is said and shown of a campaign; the parameters are those of `campaign_page`."""
    campaign, written = result.campaign, files or {}
    about = (
        f"{count(len(result.sensors), 'sensor')}, stations "
        f"{join_numbers(campaign.stations) or 'none'}, {count(campaign.rows, 'reading')}"
    )
    return Document(
        schema="agonic/fit-thermal@1",
        kind="Climatic chamber: calibration over temperature",
        name=title or campaign.description.name or "Campaign",
        method=about,
        about=about,
        verdict=result.verdict,
        status=_summarise(result),
        findings=result.findings,
        move=_choose_move(result),
        sections=[
            Section("", [lambda: tables.list_sensors(result)]),
            Section("Before and after", _compare(result, beside or {}, beside_words)),
            Section("The chamber’s field", _show_chamber(result.chamber_field)),
            Section("The recordings", _show_recordings(result.campaign)),
        ],
        contents=True,
        values=tables.list_campaign_values(result),
        sensors=[_describe_sensor(one, written.get(one.name, ())) for one in result.sensors],
        styles=STYLES,
    )


def describe_known_field(
    fit: ThermalFit, name: str, *, title: str = "", files: Sequence[str] = ()
) -> Document:
    """What is said and shown of a fit to a field that is known at every reading."""
    made = _describe_sensor(CalibratedSensor(name=name, fit=fit), files)
    return replace(
        made,
        schema="agonic/fit-thermal@1",
        kind="Known field: calibration over temperature",
        name=title or name,
        method=f"known field, {count(fit.n, 'reading')}",
        styles=STYLES,
    )


def _summarise(result: CalibratedCampaign) -> str:
    """The result in words: all sensors, what the fits rest on, and what was found."""
    doubted = [sensor.name for sensor in result.sensors if sensor.verdict != "good"]
    return " ".join(
        [
            f"To be checked: {', '.join(doubted)}." if doubted else "All sensors are calibrated.",
            sentence(f"turns {result.turns}: {result.reason}"),
            *(sentence(finding.sentence) for finding in sort_findings(result.findings)),
        ]
    )


def _choose_move(result: CalibratedCampaign) -> str:
    """The move of the gravest finding, on the campaign first."""
    found = [*result.findings, *(f for sensor in result.sensors for f in sensor.findings)]
    refused = [sensor.refused for sensor in result.sensors if sensor.refused]
    return next(iter([*moves(found), *refused]), WHEN_GOOD)


def _compare(
    result: CalibratedCampaign, beside: Mapping[str, Sequence[float]], words: str
) -> list[Block]:
    said = (
        "The largest standard deviation of the readings at a station before the correction over "
        "the largest after it, for the components in the axes of the sensor and for the magnitude."
    )
    if any(sensor.held_out for sensor in result.sensors):
        said += (
            " The last column is the same for the magnitude where each station was corrected by a "
            "fit that had not seen it (cross-validation)."
        )
    return [
        lambda: tables.list_ratios(result.sensors, beside, words),
        aside(said),
    ]


def _show_chamber(found: ChamberField | None) -> list[Block]:
    """The common mode of the sensors, and what each has beside it."""
    if found is None:
        said = "It takes two sensors with times to separate the chamber’s field from their errors."
        return [aside(said)]
    turned = "in the axes of the chamber" if len(found.axes) > 1 else "along itself"
    said = (
        f"All sensors saw the field change {turned} by {quantity(found.common_sd, 'nT', 2)} (one "
        "standard deviation of an axis within a station). This is the chamber, not the sensors. "
        "From one station to the next field, fixture and sensors cannot be separated."
    )
    note = (
        "Standard deviations of the means of windows, on one axis. “Its own” is residuals of the "
        "polynomials, lag and rounding."
    )
    return [
        lambda: figures.draw_chamber(found),
        said,
        tables.list_shares(found),
        aside(note),
    ]


def _show_recordings(campaign: Campaign) -> list[Block]:
    """Whether boards kept working, and the temperature at every station."""
    courses, _ = find_courses(campaign)
    shown: list[Block] = [tabulate(list_boards(campaign), tables.BOARDS, "parts", scrolls=True)]
    if courses:
        profile = campaign.description.profile
        shown.append(lambda: figures.draw_courses(dict(sorted(courses.items())), profile))
    note = (
        "A restart is a clock that started again within a recording; missing are the readings "
        "that each sensor lost in gaps."
    )
    return [*shown, aside(note)]


def _describe_sensor(result: CalibratedSensor, files: Sequence[str]) -> Document:
    """Everything about one sensor of a campaign."""
    fit = result.fit
    return Document(
        name=result.name,
        verdict=result.verdict,
        status=sentence(result.status),
        findings=None if fit is None else result.findings,
        key_figures=() if fit is None else list_key_figures(fit.calibration, fit),
        entries=None if fit is None else _list_entries(fit, files),
        entries_title="",
        sections=() if fit is None else _show_evidence(result, fit, files),
        contents=fit is not None,
        values=tables.list_sensor_values(result, files),
        calibration=None if fit is None else fit.calibration,
    )


def _show_evidence(
    result: CalibratedSensor, fit: ThermalFit, files: Sequence[str]
) -> list[Section]:
    """The figures and tables of a sensor that was fitted."""
    written = [element("p", element("code", ", ".join(files)))] if files else []
    return [
        *show_coefficients(fit.calibration, fit.bins),
        Section("Unseen readings", _compare_unseen(fit) if fit.alternatives else []),
        Section("Before and after at every station", _show_stations(result, fit)),
        Section("Order of the polynomials", [lambda: figures.draw_orders(fit)]),
        Section("Cooling and heating", _compare_passes(fit)),
        Section("Anomalies", tables.list_anomalies(fit.anomalies)),
        Section("Validity", [describe_validity(fit.calibration)]),
        Section("Files", written),
    ]


def _compare_unseen(fit: ThermalFit) -> list[Block]:
    """Whether hysteresis or a network would foretell readings better that no fit has seen."""
    note = (
        "Ten blocks of readings, in their order, each left out once. Hysteresis depends on the "
        "readings before; the network has 64 hidden units of random weights. What helps here is "
        "not part of the calibration."
    )
    return [tables.list_alternatives(fit), aside(note)]


def _show_stations(result: CalibratedSensor, fit: ThermalFit) -> list[Block]:
    """Bars for x, y, z and |B|, and the numbers of the last."""
    spread, unseen = fit.spread, result.held_out
    if spread is None:
        return [aside("The readings belong to no stations.")]
    unit = unit_label(fit.calibration.unit_out)
    note = "Off the chamber’s magnitude: rms of the means of bins, their noise included."
    return [
        lambda: figures.draw_stations(spread, unseen, unit),
        lambda: element(
            "details",
            element("summary", "The numbers for the magnitude"),
            tables.list_stations(spread, unseen, unit).to_html(),
            aside(note) if unseen is not None else "",
        ),
    ]


def _compare_passes(fit: ThermalFit) -> list[Block]:
    """Hysteresis, and the term in dT/dt in words."""
    lag = tables.describe_lag(fit.calibration)
    said: list[Block] = [lag] if lag else []
    if fit.hysteresis is None:
        return [*said, aside("Only one direction was recorded.")]
    return [tables.list_hysteresis(fit.hysteresis, fit.calibration), *said]


def _list_entries(fit: ThermalFit, files: Sequence[str]) -> dict[str, str]:
    """The bias at both ends and in the middle of the range, and the improvement."""
    calibration = fit.calibration
    entries = {}
    for level in np.linspace(*calibration.range_C, 3):
        numbers = each_with_sd(calibration.bias_at(level), calibration.sd_at(level))
        said = name_each("xyz", numbers, calibration.unit_in)
        entries[write_minus(f"Bias at {level:.1f} °C")] = said
    middle = float(np.mean(calibration.range_C))
    curves = figures.evaluate_decomposition(calibration, np.array([middle]))
    for group in (curves[:3], curves[3:]) if curves else ():
        names = [curve.name.rpartition(" ")[::2] for curve in group]
        numbers = [each_with_sd(curve.value, curve.sd)[0] for curve in group]
        said = name_each([axes for _, axes in names], numbers, group[0].unit)
        entries[write_minus(f"{names[0][0].capitalize()} at {middle:.1f} °C")] = said
    if fit.spread is not None:
        ratios = (significant(float(ratio), 2) for ratio in fit.spread.improvement)
        entries["Spread smaller by"] = name_each(figures.COMPONENTS, ratios, "times")
    entries["File"] = ", ".join(files)
    return entries
