"""The blocks that pages are made of: header, parts, verdict, and the figures to look at first."""

from __future__ import annotations

from collections.abc import Iterable
from urllib.parse import quote

from agonic.report.digits import typeset
from agonic.report.markup import Markup, element
from agonic.report.tables import mark
from agonic.report.verdict import MEANINGS, sentence


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
