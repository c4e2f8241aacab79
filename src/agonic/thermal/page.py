"""`campaign_page` and `thermal_page`: calibrations over temperature as pages of their own."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from agonic.calibration.base import Calibration
from agonic.calibration.thermal import Thermal
from agonic.report import tables as common
from agonic.report.blocks import header, part, verdict
from agonic.report.digits import counted, quantity
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup
from agonic.report.strips import captioned
from agonic.report.verdict import WHEN_GOOD, moves, sentence
from agonic.samples import Samples
from agonic.thermal import figures, tables
from agonic.thermal.campaign.description import join_numbers
from agonic.thermal.common_mode import ChamberField
from agonic.thermal.result import CalibratedCampaign
from agonic.thermal.sensor import coefficients, key_figures, sensor, validity
from agonic.thermal.verification_on_log import used
from agonic.verification import Verification

KICKER = "Climatic chamber: calibration over temperature"


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
    >>> made = simulate_campaign("2xMMC5883MA", rate_Hz=0.02)
    >>> page = campaign_page(calibrate_campaign(made.campaign), title="<box>")
    >>> page.count("&lt;box&gt;"), page.count("<article")
    (2, 2)
    """
    name = title or result.campaign.description.name or "Campaign"
    written = files or {}
    body = markup(
        header(KICKER, name, element("p", _about(result), class_="kicker")),
        element(
            "main",
            _verdict(result),
            tables.summary(result),
            part("The programme", _programme(result)),
            part("Before and after", *_ratios(result, beside or {}, beside_words)),
            part("The chamber’s field", *_chamber(result.chamber_field)),
            *(
                sensor(k, one, written.get(one.name, ()))
                for k, one in enumerate(result.sensors, start=1)
            ),
        ),
    )
    return document(name, body, style=static("report.css") + static("thermal.css"))


def thermal_page(
    calibration: Calibration,
    thermal: Thermal,
    *,
    title: str = "",
    samples: Samples | None = None,
    verification: Verification | None = None,
) -> str:
    """A calibration over temperature as a page: coefficients with their band, validity, origin.

    Parameters
    ----------
    calibration : what is applied. thermal : it, or its step that depends on temperature.
    samples, verification : readings that it was tried on, and what that showed.

    >>> import numpy as np
    >>> warm = Thermal(bias=[[100, 0, 0], [50, 0, 0]], matrix=[np.eye(3), np.zeros((3, 3))],
    ...                centre_C=20.0, half_range_C=30.0)
    >>> thermal_page(warm, warm).count('class="plot small"')
    9
    """
    name = title or calibration.sensor
    parts = [
        part("Validity", validity(thermal)),
        part("Coefficients over temperature", *coefficients(thermal, None)),
        part("Numbers", tables.numbers(thermal)),
    ]
    if samples is not None and verification is not None:
        parts.insert(0, part("On the log", *used(calibration, thermal, samples, verification)))
    parts.append(part("Provenance", common.provenance(calibration, samples)))
    body = markup(
        header("Calibration over temperature", name),
        element("main", key_figures(thermal, None), *parts),
    )
    return document(name, body, style=static("report.css") + static("thermal.css"))


def _about(result: CalibratedCampaign) -> str:
    campaign = result.campaign
    return (
        f"{counted(len(result.sensors), 'sensor')}, stations {join_numbers(campaign.stations)}, "
        f"{counted(campaign.rows, 'reading')}"
    )


def _verdict(result: CalibratedCampaign) -> Markup:
    """The verdict on all, and what to do first."""
    doubted = [sensor.name for sensor in result.sensors if sensor.verdict != "good"]
    said = (
        "All sensors are calibrated." if not doubted else f"To be looked at: {', '.join(doubted)}."
    )
    turns = sentence(f"turns {result.turns}: {result.reason}")
    return verdict(result.verdict, said, " ", turns, move=_next_move(result))


def _next_move(result: CalibratedCampaign) -> str:
    """The move of the gravest finding, on the campaign first."""
    found = [*result.findings, *(f for sensor in result.sensors for f in sensor.findings)]
    refused = [sensor.refused for sensor in result.sensors if sensor.refused]
    return next(iter([*moves(found), *refused]), WHEN_GOOD)


def _programme(result: CalibratedCampaign) -> Markup:
    if not result.findings:
        return element("p", "The programme was followed: nothing to object.")
    return common.findings(result.findings)


def _ratios(
    result: CalibratedCampaign, beside: Mapping[str, Sequence[float]], words: str
) -> list[Markup]:
    said = (
        "The largest standard deviation of the readings at a station before the correction over "
        "the largest after it, for the components in the axes of the sensor and for the magnitude."
    )
    if any(sensor.held_out for sensor in result.sensors):
        said += (
            " The last column is the same for the magnitude where each station was corrected by a "
            "fit that had not seen it."
        )
    shown = tables.ratios(result.sensors, beside, words)
    return [shown, element("p", said, class_="aside")]


def _chamber(found: ChamberField | None) -> list[Markup]:
    if found is None:
        said = "It takes two sensors with clocks to tell the chamber’s field from their errors."
        return [element("p", said, class_="aside")]
    drawn = Markup("".join(figures.chamber(found, axis) for axis in range(len(found.axes))))
    turned = "in the axes of the chamber" if len(found.axes) > 1 else "along itself"
    said = (
        f"All sensors saw the field change {turned} by {quantity(found.common_sd, 'nT', 2)} (one "
        "standard deviation of an axis within a station). That is the chamber and not they. From "
        "one station to the next nothing is said: there field, fixture and sensors cannot be told "
        "apart."
    )
    return [
        captioned(
            "Changes of the field at each station, less their mean",
            drawn,
            {"common": "common to all sensors", "each": "each sensor, mean of a window"},
        ),
        element("p", said),
        tables.parts(found),
        element(
            "p",
            "Standard deviations of the means of windows, on one axis. “Its own” is what the "
            "polynomials leave, lag and rounding.",
            class_="aside",
        ),
    ]
