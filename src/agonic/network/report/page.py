"""`network_page` and `network_file_page`: a network, how it was trained, and what it does."""

from __future__ import annotations

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.base import Calibration, select_columns
from agonic.calibration.chain import Chain
from agonic.calibration.network import Network
from agonic.network.fit import NetworkChoice, NetworkFit
from agonic.network.report import figures, tables
from agonic.report import tables as common
from agonic.report.blocks import header, key_figures, part, verdict
from agonic.report.digits import counted, grouped, minused, percent, quantity
from agonic.report.documents import document, static
from agonic.report.markup import Markup, element, markup
from agonic.report.strips import captioned
from agonic.report.verdict import moves
from agonic.samples import Samples
from agonic.verification import Verification

KICKER = "Calibration by a network"
_BOTH = {"by-base": "base alone", "by-network": "with the network"}


def network_page(
    fit: NetworkFit,
    samples: Samples,
    *,
    choice: NetworkChoice | None = None,
    title: str = "",
) -> str:
    """A trained network as one self-contained HTML page.

    Parameters
    ----------
    fit : from `fit_network`. samples : the readings it was trained on. choice : the table that it
        was chosen from, if one was made. title : default: the sensor.

    >>> from agonic.network.fit import fit_network
    >>> from agonic.network.simulate import simulate_nonaffine
    >>> made = simulate_nonaffine(n=1000, hysteresis=0.0)
    >>> page = network_page(fit_network(made.samples, made.reference), made.samples, title="<a>")
    >>> page.count("&lt;a&gt;"), "unseen" in page
    (2, True)
    """
    network, comparison = fit.calibration, fit.comparison
    parts = [_verdict(fit), _key_figures(fit)]
    if comparison is not None:
        name = "Base against network" if comparison.base else "Unseen readings"
        drawn = figures.unseen(comparison, samples.time)
        keys = _BOTH if comparison.base else {"by-network": "the network"}
        note = "Each block of time by what was trained on the other three of four."
        parts.append(
            part(
                name,
                *tables.compared(comparison, network.target),
                captioned("Error over time", drawn, keys, note),
            )
        )
    if choice is not None:
        parts.append(part("Hidden nodes", tables.nodes(choice), _chosen(choice)))
    keys = {"training": "trained on"} | ({} if fit.base else {"limit": "0.001, as published"})
    if any(np.isfinite(epoch.held_out) for epoch in fit.epochs):
        keys["held"] = "held out"
    note = "It begins where the trials of several random starts have ended."
    curve = captioned("Error after each epoch", figures.training(fit), keys, note)
    parts += [
        part("Training", curve),
        *_caveat(network),
        part("Where it holds", *_guard(network, network, samples)),
        part("Findings", common.findings(fit.findings)),
        *_numbers(network),
        part("Provenance", common.provenance(fit.chosen, samples)),
    ]
    return _document(title or samples.name, parts)


def network_file_page(
    calibration: Calibration,
    network: Network,
    *,
    title: str = "",
    samples: Samples | None = None,
    verification: Verification | None = None,
) -> str:
    """A calibration file with a network in it as a page, and what it does to readings.

    Parameters
    ----------
    calibration : what is applied. network : it, or its step that is one.
    samples, verification : readings that it was tried on, and what that showed.

    >>> from agonic.network.fit import fit_network
    >>> from agonic.network.simulate import simulate_paper
    >>> made = simulate_paper(15.0)
    >>> net = fit_network(made.samples, made.reference, compared=False).calibration
    >>> network_file_page(net, net).count("node 3")
    2
    """
    parts: list[Markup] = []
    if samples is not None and verification is not None:
        said = _guard(calibration, network, samples)
        parts += [
            part("On the log", common.checks(verification)),
            part("Where it holds", *said),
        ]
    parts += [
        *_caveat(network),
        *_numbers(network),
        part("Provenance", common.provenance(calibration, samples)),
    ]
    return _document(title or calibration.sensor, parts)


def _document(name: str, parts: list[Markup]) -> str:
    body = markup(header(KICKER, name), element("main", *parts))
    return document(f"{KICKER}: {name}", body, style=static("report.css") + static("network.css"))


def _verdict(fit: NetworkFit) -> Markup:
    used = "the network" if fit.chosen is fit.calibration else f"the base ({fit.chosen.kind})"
    first = next(iter(moves(fit.findings)), "")
    return verdict(fit.verdict, f"Chosen: {used}. ", minused(fit.status), move=first)


def _key_figures(fit: NetworkFit) -> Markup:
    comparison, size = fit.comparison, fit.calibration.shape.size
    of = "rms on an axis" if fit.calibration.target == "vector" else "rms of the magnitude"
    if comparison is None:
        errors = [("Residual", fit.rms, f"{of}, trained on")]
    else:
        errors = [("Unseen, network", comparison.network.rms, of)]
        if comparison.base is not None:
            errors.append(("Unseen, base", comparison.base.rms, of))
    return key_figures(
        [
            *((name, quantity(value, "nT"), note) for name, value, note in errors),
            ("Trained in", counted(fit.iterations, "epoch"), counted(fit.n, "reading")),
            ("Weights determined", grouped(fit.effective, 1), f"of {size}, by the evidence"),
        ]
    )


def _chosen(choice: NetworkChoice) -> Markup:
    said = f"{choice.sentence[:1].upper()}{choice.sentence[1:]}."
    return element(
        "p", said, " Unseen: by what was trained on the other three of four blocks.", class_="aside"
    )


def _caveat(network: Network) -> list[Markup]:
    if network.target == "vector":
        return []
    said = element("p", tables.MAGNITUDE_ONLY)
    return [part("What the magnitude cannot teach", said)]


def _guard(calibration: Calibration, network: Network, samples: Samples) -> list[Markup]:
    """How many readings are like those it was trained on, and what the others get."""
    raw = samples.field
    if isinstance(calibration, Chain):
        for step in calibration.steps[: calibration.steps.index(network)]:
            raw = step.correct(raw, **select_columns(step, samples))
    share = network.inside(raw, **select_columns(network, samples))
    outside = percent(float((share < 0.5).mean()))
    of = f"{outside} of {counted(len(share), 'reading')} lie so far from what the network was "
    keys = {"range": "least to largest", "mean": "mean"}
    if (share < 0.5).any():
        keys["guarded"] = "mostly outside"
    drawn = captioned(
        "Where it was trained: 1, far away: 0", figures.guarded(share, samples.time), keys
    )
    if network.base is None:
        said = "trained on that its field is a guess: there is no base to fall back to."
    else:
        said = (
            "trained on that half of its correction or more is taken back; far away the base alone "
            f"corrects. {percent(float((share > 0.999).mean()))} get all of it."
        )
    return [element("p", of + said), drawn]


def _numbers(network: Network) -> list[Markup]:
    base = network.base
    shown = [common.definitions({k: v for k, v in tables.described(network).items() if v})]
    if isinstance(base, Affine):
        shown.append(tables.base_numbers(base))
    said = "± is one standard error. Inputs and outputs are scaled to −1 … 1."
    aside = element("p", said, class_="aside")
    return [
        part("The network", *shown),
        part("Weights", tables.weights(network), aside),
    ]
