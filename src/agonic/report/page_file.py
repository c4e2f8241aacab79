"""The file around a page: nothing but its own style and script may run or be fetched."""

from __future__ import annotations

import base64
import hashlib
from importlib.resources import files
from string import Template

from agonic.report.markup import Markup, markup


def assemble_page(title: str, body: Markup, *, style: str, script: str = "") -> str:
    """A page of its own that needs no network; `style` comes after what every page shares."""
    style = read_static("base.css") + style
    policy = f"default-src 'none'; img-src data:; style-src '{_digest(style)}'"
    if script:
        policy += f"; script-src '{_digest(script)}'"
    return Template(read_static("page.html")).substitute(
        policy=policy,
        title=markup(title),
        icon=base64.b64encode(read_static("icon.svg").encode()).decode(),
        style=style,
        body=body,
        script=f"\n<script>{script}</script>" if script else "",
    )


def read_static(name: str) -> str:
    """A file of the package that goes into pages."""
    return (files("agonic.report") / "static" / name).read_text(encoding="utf-8")


def _digest(text: str) -> str:
    return "sha256-" + base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
