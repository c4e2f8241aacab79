"""What pages are made of: header, parts, verdict, key figures; checks, findings, provenance."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from urllib.parse import quote

from agonic.calibration.base import Calibration
from agonic.citations import CITATIONS
from agonic.health import Finding
from agonic.report.digits import count, percent, quantity, typeset
from agonic.report.labels import FRAMES, unit_label
from agonic.report.markup import Markup, element, markup, table
from agonic.report.verdict import MEANINGS, sentence
from agonic.samples import Samples
from agonic.verification import Check, Verification

NOTHING = "–"

ICONS = {
    "good": "M3.5 8.5l3 3 6-7",
    "check": "M8 3.5v5.5M8 12v.5",
    "refused": "M4.5 4.5l7 7M11.5 4.5l-7 7",
    "note": "M8 7v5.5M8 3.5v.5",
}
"""Strokes of the signs, on a field of 16 by 16."""

SEVERITIES = {
    "note": ("note", "Note"),
    "check": ("check", "Check"),
    "refuse": ("refused", "Refused"),
}
"""The sign and the word of each severity."""


def mark(verdict: str, *words: str) -> Markup:
    """A sign and words in the colour of a verdict."""
    stroke = element("path", d=ICONS[verdict])
    sign = element("svg", stroke, class_="sign", viewBox="0 0 16 16", aria_hidden="true")
    return element("span", sign, *words, class_=f"mark {verdict}")


def header(kicker: str, name: str, *more: str) -> Markup:
    """What kind of page it is, and what it is about."""
    return element("header", element("p", kicker, class_="kicker"), element("h1", name), *more)


def part(title: str, *content: str, level: str = "h2", anchor: str = "") -> Markup:
    """A section under its heading, with an anchor to link to."""
    return element("section", element(level, title), *content, id=anchor or None)


def contents(entries: Iterable[tuple[str, str]]) -> Markup:
    """A table of contents: anchors and titles."""
    links = (element("li", element("a", title, href=f"#{anchor}")) for anchor, title in entries)
    return element("nav", element("ul", *links), class_="contents", aria_label="Contents")


def verdict(word: str, *said: str, move: str = "", found: Iterable[tuple[str, str]] = ()) -> Markup:
    """A verdict in its word and what that means, what was found, one a bullet with the sign of its
    severity, what else is said, and the move that helps."""
    shown, meaning = MEANINGS[word]
    return element(
        "div",
        element("p", mark(word, shown), f": {meaning}", class_="word"),
        element("ul", *(element("li", mark(sign, ""), " ", text) for sign, text in found))
        if (found := list(found))
        else "",
        element("p", *said) if any(said) else "",
        element("p", element("strong", "Do next: "), typeset(sentence(move))) if move else "",
        class_=f"verdict {word}",
    )


def key_figures(entries: Iterable[tuple[str, str, str]]) -> Markup:
    """The numbers to look at first: name, value, and what it is of."""
    return element(
        "dl",
        *(
            element(
                "div",
                element("dt", name),
                element("dd", value, class_="value"),
                element("dd", note, class_="aside"),
            )
            for name, value, note in entries
        ),
        class_="key-figures",
    )


def show_file(name: str, text: str | None) -> Markup:
    """A file beside the page as a link; a small one unfolds, and can be copied."""
    link = element("a", element("code", name), href=quote(name))
    if text is None:
        return element("p", link)
    copy = element("button", "Copy", type="button", data_copy="", hidden="")
    return element("details", element("summary", link), copy, element("pre", text), class_="file")


def checks(verification: Verification) -> Markup:
    """The named checks: value, limit, verdict and meaning."""
    rows = [
        [
            check.name,
            quantity(check.value, check.unit),
            _limit(check),
            _outcome(check),
            typeset(sentence(check.meaning)),
        ]
        for check in verification.checks
    ]
    return table(["Check", "Value", "Limit", "Verdict", "Meaning"], rows, class_="checks")


def state_check(check: Check) -> str:
    """A check in a line of text: its value and its limit, where it has one."""
    limit = "" if check.limit is None else f" (limit {quantity(check.limit, check.unit)})"
    return f"{check.name}: {quantity(check.value, check.unit)}{limit}"


def _limit(check: Check) -> str:
    return NOTHING if check.limit is None else quantity(check.limit, check.unit)


def _outcome(check: Check) -> Markup:
    if check.passed is None:
        return mark("note", "For information")
    return mark("good", "Passed") if check.passed else mark("refused", "Failed")


def findings(found: Sequence[Finding]) -> Markup:
    """What was seen, by name, with the move that helps."""
    if not found:
        return element("p", "None.")
    rows = [
        [
            mark(*SEVERITIES[f.severity]),
            markup(element("code", f.name), " ", typeset(sentence(f.what))),
            typeset(sentence(f.move)) if f.move else NOTHING,
        ]
        for f in found
    ]
    return table(["Severity", "What was seen", "What to do"], rows, class_="findings")


def definitions(entries: Mapping[str, str | Sequence[str]]) -> Markup:
    """Names and what they stand for; several values stand under each other."""
    pairs = []
    for name, values in entries.items():
        shown = [values] if isinstance(values, str) else values
        pairs += [element("dt", name), *(element("dd", value) for value in shown)]
    return element("dl", *pairs)


def provenance(calibration: Calibration, samples: Samples | None) -> Markup:
    """Where a calibration came from, and in which units and axes it holds."""
    origin = calibration.provenance
    source = None if samples is None else samples.source
    inputs = {i.sha256: i for i in (*(() if source is None else (source,)), *origin.inputs)}
    rejected = {} if samples is None else samples.rejected
    entries: dict[str, str | Sequence[str]] = {
        "Equation": element("code", calibration.equation),
        "Units": f"readings in {unit_label(calibration.unit_in)}, field in "
        f"{unit_label(calibration.unit_out)}",
        "Frames": f"{_frame(calibration.frame_in)} to {_frame(calibration.frame_out)}",
        "Inputs": [
            f"{i.name}, {count(i.count, 'row')}, SHA-256 {i.sha256}" for i in inputs.values()
        ],
        "Left out": [f"{count(n, 'row')}: {why}" for why, n in rejected.items()],
        "Reader’s notes": () if samples is None else samples.notes,
        "Settings": [
            f"{name} = {typeset(f'{value:g}' if isinstance(value, float) else str(value))}"
            for name, value in origin.settings.items()
        ],
        "Derived from": origin.parents,
        "Software": f"{origin.software}, {origin.created}",
        "Sources": [CITATIONS.get(key, key) for key in origin.method],
    }
    return definitions({name: value for name, value in entries.items() if value})


def _frame(letter: str) -> str:
    return f"{letter} ({FRAMES.get(letter, 'as named')})"


def spread(verification: Verification) -> str:
    """The spread of the magnitude before and after, in per cent of its mean."""
    return f"{percent(verification.spread_before)} → {percent(verification.spread_after)}"


def list_shares(sds: Mapping[str, float], most: int | None = None) -> list[str]:
    """The share of each cause in a variance, by the standard errors that causes make; beyond the
    first `most` those of all others together."""
    total = sum(sd**2 for sd in sds.values())
    each = [(name, sd**2 / total) for name, sd in sds.items()]
    if most is not None and len(each) > most + 1:
        each[most:] = [("others", sum(share for _, share in each[most:]))]
    return [f"{name} {percent(share)}" for name, share in each]


def draw_shares(sds: Mapping[str, float]) -> Markup:
    """The same as one bar."""
    said = (element("span", element("i", class_="key"), one) for one in list_shares(sds))
    bar = draw_bar([("", sd**2) for sd in sds.values()])
    return markup(bar, element("p", *said, class_="legend shares-legend"))


def draw_bar(sizes: Sequence[tuple[str, float]], said: str | None = None) -> Markup:
    """Parts as long as their sizes, each of a class of the style sheets, as one bar."""
    total, end, parts = sum(size for _, size in sizes) or 1.0, 0.0, []
    for name, size in sizes:
        begin, end = end, end + 1000.0 * size / total
        at = {"x": f"{begin:.1f}", "width": f"{end - begin:.1f}", "height": "10"}
        parts.append(element("rect", **at, class_=name or None))
    look = {"viewBox": "0 0 1000 10", "preserveAspectRatio": "none", "class_": "shares"}
    return element("svg", *parts, **look, role=said and "img", aria_label=said)
