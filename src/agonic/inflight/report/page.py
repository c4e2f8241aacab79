"""`inflight_page` and `track_page`: a calibration in flight as one page that needs nothing else."""

from __future__ import annotations

import numpy as np

from agonic.inflight.fit import InflightFit
from agonic.inflight.report import figures, tables
from agonic.inflight.report.attitude import currents, direction
from agonic.inflight.report.causes import explained
from agonic.inflight.report.record import Flight, of_inflight, of_tracked
from agonic.inflight.tracking import Coefficients, Tracker
from agonic.report.blocks import key_figures
from agonic.report.digits import counted, grouped, minused, quantity
from agonic.report.documents import document, static
from agonic.report.labels import unit_label
from agonic.report.markup import Markup, element, markup
from agonic.report.strips import beyond_words, captioned
from agonic.report.tables import findings, mark, provenance
from agonic.report.verdict import MEANINGS, sentence
from agonic.samples import Samples


def inflight_page(fit: InflightFit, samples: Samples | None = None, *, title: str = "") -> str:
    """A fit in flight as one self-contained HTML page.

    Parameters
    ----------
    fit : from `fit_inflight`. samples : the readings it was made from, which know where each was
        taken; without them there is no map. title : default: the sensor.

    >>> from agonic.inflight.fit import fit_inflight
    >>> from agonic.reference import Reference
    >>> from agonic.simulation import simulate
    >>> made = simulate("tumble", n=2000, noise=50.0)
    >>> fit = fit_inflight(made.samples, Reference.constant(50_000.0))
    >>> inflight_page(fit, made.samples, title="<log>").count("&lt;log&gt;")
    2
    """
    return _page(of_inflight(fit, samples), "Calibration in flight", title)


def track_page(tracker: Tracker, found: Coefficients, samples: Samples, *, title: str = "") -> str:
    """What a tracker made of a log, as one self-contained HTML page.

    Parameters
    ----------
    tracker : after the log. found : what `tracker.update(samples, …)` gave. samples : its readings.
    """
    return _page(of_tracked(tracker, found, samples), "Calibration followed in flight", title)


def _page(flight: Flight, kicker: str, title: str) -> str:
    name = title or flight.sensor
    limit = figures.residual_limit(flight)
    parts = [
        _verdict(flight),
        _key_figures(flight),
        _part("Bias over time", *_bias(flight)),
        _ground(flight),
        _part("Residuals", *_residuals(flight, limit)),
        *_more(flight),
        _part("Error of the model", tables.model_error(flight)),
        _part("Likely causes", tables.causes(explained(flight))),
        _part("Findings", findings(flight.findings)),
        _part("Left out", tables.left_out(flight)),
        _part("What was chosen, and the held-out error", tables.held_out(flight)),
        _part("Provenance", provenance(flight.calibration, flight.samples)),
    ]
    body = markup(
        element(
            "header",
            element("p", kicker, class_="kicker"),
            element("h1", name),
            element("p", f"{flight.sensor}, {flight.begun}", class_="kicker"),
        ),
        element("main", *parts),
    )
    style = static("report.css") + static("inflight.css")
    return document(f"{kicker}: {name}", body, style=style)


def _part(title: str, *content: str) -> Markup:
    return element("section", element("h2", title), *content)


def _more(flight: Flight) -> list[Markup]:
    """The direction and the currents, where the fit was asked for them."""
    if flight.fit is None:
        return []
    named = {"Direction": direction(flight.fit), "Currents on board": currents(flight.fit)}
    return [_part(title, *content) for title, content in named.items() if content]


def _verdict(flight: Flight) -> Markup:
    word, meaning = MEANINGS[flight.verdict]
    moves = [f.move for f in flight.findings if f.severity != "note" and f.move]
    return element(
        "div",
        element("p", mark(flight.verdict, word), f": {meaning}", class_="word"),
        element("p", minused(flight.status)),
        element("p", element("strong", "Do next: "), minused(sentence(moves[0]))) if moves else "",
        class_=f"verdict {flight.verdict}",
    )


def _key_figures(flight: Flight) -> Markup:
    """The four numbers to look at first."""
    course, used = flight.course, flight.used
    unit = unit_label(course.unit)
    rms = float(np.sqrt(np.mean(flight.residuals[used] ** 2))) if used.any() else np.nan
    entries = {
        "Residual": (
            quantity(rms, "nT"),
            "rms, before each was used" if flight.predicted else "rms",
        ),
        "Bias known to": (
            quantity(float(course.sd[-1].max()), unit, 2),
            "standard error of the worst axis",
        ),
        "Readings count as one": (
            quantity(flight.correlation, "", 2),
            f"{quantity(flight.correlation * flight.step_s, 's', 2)} of them",
        ),
        "Readings": (grouped(int(np.count_nonzero(used))), f"of {counted(len(used), 'reading')}"),
    }
    return key_figures((name, value, note) for name, (value, note) in entries.items())


def _bias(flight: Flight) -> list[Markup]:
    course = flight.course
    what = "the bias" if flight.predicted else "what is found in flight"
    keys = {"bias": what, "band": "± 2 standard errors"}
    if course.jumps:
        keys["jump"] = "a jump"
    drawn = [figures.bias_strip(course, axis) for axis in range(3)]
    legend = captioned(
        f"Bias along x, y and z, {unit_label(course.unit)}", Markup("".join(drawn)), keys
    )
    return [legend]


def _ground(flight: Flight) -> Markup:
    """The numbers, beside those of the ground where there are any."""
    rows = [q for group in flight.numbers for q in group.rows]
    title = "Ground against flight"
    if all(q.ground is None for q in rows):
        title = "Numbers"
        said = "There was no ground calibration to compare with. ± is one standard error."
    elif all(q.ground_sd is None for q in rows):
        said = (
            "The ground calibration came without standard errors, so a change is measured by that "
            "of the flight alone. Lines at ±1 and ±2 standard errors."
        )
    else:
        said = (
            "σ is that of the change, from both standard errors. Lines at ±1 and ±2 σ; beyond ±3 "
            "the two do not agree."
        )
    shown = tuple(group for group in flight.numbers if not all(q.held for q in group.rows))
    for group in flight.numbers:
        if group not in shown:
            said += f" The {group.name.lower()} was held as it was."
    return _part(title, tables.numbers(shown), element("p", said, class_="aside"))


def _residuals(flight: Flight, limit: float) -> list[Markup]:
    """Over time, along latitude and temperature, in sunlight and shadow, and where they lie."""
    keys = {
        "range": "least to largest",
        "middle": "the middle two thirds",
        "mean": "median",
    }
    timed = dict(keys)
    if not figures.enough(len(flight.residuals)):
        del timed["middle"]
    if figures.drawn_shadows(flight):
        timed["shadow"] = "in the Earth’s shadow"
    if figures.drawn_left_out(flight):
        timed["left-out"] = "mostly left out"
    beyond = beyond_words(flight.residuals, limit, "nT")
    parts = [captioned("Over time", figures.over_time(flight, limit), timed, beyond)]
    missing = []
    for name, values, label in (
        ("latitude", flight.latitude_deg, "latitude, °"),
        ("temperature", flight.temperature, "temperature, °C"),
    ):
        if values is None:
            missing.append(name)
        else:
            drawn = figures.along(flight, values, label, limit)
            parts.append(captioned(f"Along {name}", drawn, keys))
    parts += _sunlight(flight, missing) + _map(flight, limit, missing)
    if missing:
        said = f"The log does not tell of {', '.join(missing)}: not drawn."
        parts.append(element("p", said, class_="aside"))
    return parts


def _sunlight(flight: Flight, missing: list[str]) -> list[Markup]:
    if flight.eclipse is None:
        missing.append("sunlight and shadow (position and date)")
        return []
    return [element("h3", "Sunlight and shadow"), tables.of_sunlight(flight)]


def _map(flight: Flight, limit: float, missing: list[str]) -> list[Markup]:
    if flight.latitude_deg is None or flight.longitude_deg is None:
        missing.append("place")
        return []
    made = figures.place_map(flight, limit)
    full = quantity(made.full, "nT", 2)
    scale = element(
        "p",
        element("span", f"−{full}"),
        element("i", class_="ramp through"),
        element("span", f"+{full}"),
        class_="legend",
    )
    note = (
        "The mean residual of the readings in a cell, which a typical cell knows to "
        f"±{quantity(made.cell_sd, 'nT', 2)}."
    )
    return [captioned("Where the residuals lie", Markup(scale + made.drawn), note=note)]
