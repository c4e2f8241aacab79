"""The part of a page about one sensor over temperature."""

from __future__ import annotations

from collections.abc import Sequence

from agonic.calibration.thermal import MARGIN_C, Thermal
from agonic.report import blocks
from agonic.report import tables as common
from agonic.report.digits import minused, quantity
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element
from agonic.report.strips import captioned
from agonic.report.verdict import moves, sentence
from agonic.thermal import figures, tables
from agonic.thermal.fit.result import Bins, ThermalFit
from agonic.thermal.result import CalibratedSensor

_COEFFICIENTS = {
    "cooling": "one bin, cooling",
    "heating": "one bin, heating",
    "curve": "polynomial",
    "band": "± 2 standard errors",
}

_OFF = "Off the chamber’s magnitude: rms of the means of bins, their noise included."


def sensor(number: int, result: CalibratedSensor, files: Sequence[str]) -> Markup:
    """Everything about one sensor, the verdict first."""
    name = f"sensor-{number}"
    parts = [
        element("h2", result.name, id=f"{name}-name"),
        blocks.verdict(
            result.verdict,
            minused(sentence(result.status)),
            move=next(iter(moves(result.findings)), ""),
        ),
    ]
    if result.fit is not None:
        parts += _evidence(result, result.fit, files)
    return element("article", *parts, id=name, aria_labelledby=f"{name}-name")


def _evidence(result: CalibratedSensor, fit: ThermalFit, files: Sequence[str]) -> list[Markup]:
    """The figures and tables of a sensor that was fitted."""
    calibration = fit.calibration
    said = element("ul", *(element("li", element("code", name)) for name in files))
    return [
        key_figures(calibration, fit),
        _part("Coefficients over temperature", *coefficients(calibration, fit.bins)),
        _part("Numbers", tables.numbers(calibration)),
        _part("Before and after at every station", *_stations(result, fit)),
        _part("Order of the polynomials", *_orders(fit)),
        _part("Cooling and heating", *_hysteresis(fit)),
        _part("Anomalies", tables.anomalies(fit.anomalies)),
        _part("Findings", common.findings(result.findings)),
        _part("Files", said) if files else Markup(""),
        _part("Validity", validity(calibration)),
        _part("Provenance", common.provenance(calibration, None)),
    ]


def _part(title: str, *content: str) -> Markup:
    return blocks.part(title, *content, level="h3")


def key_figures(calibration: Thermal, fit: ThermalFit | None) -> Markup:
    """The four numbers to look at first."""
    unit = unit_label(calibration.unit_in)
    bias, matrix = tables.worst_sd(calibration)
    low, high = figures.seen_range(calibration)
    entries = [
        ("Range", minused(f"{low:.0f} … {high:.0f} °C"), "temperatures that were seen"),
        ("Bias known to", quantity(bias, unit, 2), "standard error at the worst temperature"),
        (
            "Matrix × field known to",
            quantity(matrix, unit_label(calibration.unit_out), 2),
            "the same",
        ),
    ]
    if fit is not None:
        entries.append(("Spread of |B|", tables.spread_words(fit), "largest of the stations"))
    elif calibration.noise is not None:
        entries.append(("Noise", quantity(calibration.noise, unit, 2), "one reading on one axis"))
    return blocks.key_figures(entries)


def coefficients(calibration: Thermal, bins: Bins | None) -> list[Markup]:
    """Every coefficient against temperature, and what the polynomials leave of the bins."""
    shown = figures.curves(calibration)
    drawn = [figures.coefficient(curve, figures.dots_of(bins, k)) for k, curve in enumerate(shown)]
    keys = dict(_COEFFICIENTS)
    if bins is None:
        del keys["cooling"], keys["heating"]
    if calibration.covariance is None:
        del keys["band"]
    parts = [captioned("Bias and matrix over temperature", _multiples(drawn), keys)]
    if bins is not None:
        left = [figures.remainder(curve, bins, k) for k, curve in enumerate(shown)]
        parts.append(
            element(
                "details",
                element("summary", "The same less the polynomial"),
                captioned("What the polynomials leave of the bins", _multiples(left), keys),
            )
        )
    return parts


def _multiples(drawn: Sequence[Markup], kind: str = "") -> Markup:
    return element("div", *drawn, class_=f"multiples {kind}".strip())


def _stations(result: CalibratedSensor, fit: ThermalFit) -> list[Markup]:
    """Bars for x, y, z and |B|, and the numbers of the last."""
    if fit.spread is None:
        return [element("p", "The readings belong to no stations.", class_="aside")]
    unit, unseen = unit_label(fit.calibration.unit_out), result.held_out
    drawn = [
        figures.station_bars(fit.spread, unseen, k, f"{name}, {unit}")
        for k, name in enumerate(tables.COMPONENTS)
    ]
    keys = {"before": "before", "after": "after"}
    note = ""
    if unseen is not None:
        keys["unseen"] = "after, by a fit that has not seen the station"
        note = f"{unseen.folds} fits, each without some of the stations, were tried on those."
    name = "Standard deviation of the readings over temperature"
    return [
        captioned(name, _multiples(drawn, "two"), keys, note),
        element(
            "details",
            element("summary", "The numbers for the magnitude"),
            tables.stations(fit.spread, unseen, unit),
            element("p", _OFF, class_="aside") if unseen is not None else "",
        ),
    ]


def _orders(fit: ThermalFit) -> list[Markup]:
    """The curve of residual variance, and who chose the order."""
    order = fit.calibration.degree
    auto = fit.calibration.provenance.settings.get("degree") == "auto"
    said = (
        f"Order {order}: the smallest after which no variance falls markedly."
        if auto
        else f"Order {order}, as it was asked for."
    )
    if fit.variances is None:
        return [element("p", said)]
    keys = {"of-bias": "bias", "of-matrix": "matrix", "chosen": "used"}
    name = "Variance of what the polynomials leave of the bins, over that of their noise"
    return [captioned(name, figures.orders(fit.variances, order), keys, said)]


def _hysteresis(fit: ThermalFit) -> list[Markup]:
    lag = tables.lag(fit.calibration)
    said = [element("p", lag)] if lag else []
    if fit.hysteresis is None:
        return [*said, element("p", "Only one direction was recorded.", class_="aside")]
    return [tables.hysteresis(fit.hysteresis, fit.calibration), *said]


def validity(calibration: Thermal) -> Markup:
    """Where the calibration may be used."""
    low, high = figures.seen_range(calibration)
    unit = unit_label(calibration.unit_in)
    entries = {
        "Temperature": minused(
            f"{low:.1f} to {high:.1f} °C; more than {MARGIN_C:g} °C beyond, corrections are "
            "extrapolated and warned of"
        ),
        "Needs": "the temperature of each reading"
        + ("" if calibration.rate is None else ", and its time for how fast that changes"),
    }
    if calibration.validity.largest_reading is not None:
        entries["Largest reading"] = quantity(calibration.validity.largest_reading, unit, 4)
    if calibration.magnitude is not None:
        entries["Field"] = quantity(calibration.magnitude, unit_label(calibration.unit_out), 5)
    return common.definitions(entries)
