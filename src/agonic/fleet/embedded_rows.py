"""The rows of a fleet as the page's script reads them: columns of bytes, deflated, in base64."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Iterable, Mapping, Sequence
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.population import Population
from agonic.report.markup import Markup, element

VERDICTS = ("good", "check", "refused")
_LONGEST = 240
_DROPPED = np.uint32(7)  # of the 23 bits after the point: five digits are left
_NO_TIME = -(2**31)
_LARGEST = 1e38  # that float32 holds, rounded up


def embed_rows(
    population: Population,
    groups: NDArray[np.int8],
    notes: Mapping[int, str],
    noted: NDArray[np.uint8],
) -> Markup:
    """The rows as a script element.

    `groups` (n,) is the group of each row or −1; `notes` what is said of rows that stand out,
    `noted` (n,) 1 for these, 2 where their bias or axes do.
    """
    verdicts = [VERDICTS.index(name) for name in population["verdict"].tolist()]
    columns = {name: get_numbers(population, name) for name in NUMBERS}
    parts: list[tuple[str, str, bytes]] = [
        ("verdict", "u8", np.array(verdicts, dtype=np.uint8).tobytes()),
        ("group", "i8", groups.astype(np.int8).tobytes()),
        ("noted", "u8", noted.tobytes()),
        *((name, "f32", _round(values)) for name, values in columns.items() if has_values(values)),
        ("start", "minutes", _count_minutes(population["start"])),
        *(
            (name, "text", _join_lines(texts))
            for name, texts in _make_texts(population, notes).items()
        ),
    ]
    head = [{"name": name, "kind": kind, "bytes": len(data)} for name, kind, data in parts]
    index = json.dumps({"rows": len(population), "columns": head}).encode()
    body = b"".join([len(index).to_bytes(4, "little"), index, *(data for *_, data in parts)])
    text = base64.b64encode(zlib.compress(body, 6)).decode("ascii")
    return element("script", Markup(text), type="application/octet-stream", id="fleet-rows")


def has_values(values: Array) -> bool:
    """Whether there is anything to show."""
    return bool(np.isfinite(values).any())


def get_numbers(population: Population, name: str) -> Array:
    """A column of the page as numbers (n,)."""
    column = f"matrix_{2 * name[-1]}" if name.startswith("gain_") else name
    return np.asarray(population[column], dtype=np.float64)


NUMBERS = (
    "bias_x",
    "bias_y",
    "bias_z",
    "gain_x",
    "gain_y",
    "gain_z",
    "noise",
    "spread_after",
    "heading_sd_deg",
    "temperature_C",
    "rows",
)


def _make_texts(population: Population, notes: Mapping[int, str]) -> dict[str, Iterable[str]]:
    said = [
        notes.get(k, "") if verdict == "good" else _add_findings(findings, status, notes.get(k, ""))
        for k, (verdict, findings, status) in enumerate(_list_verdicts(population))
    ]
    return {
        "sensor": population["sensor"].tolist(),
        "source": population["source"].tolist(),
        "channel": population["channel"].tolist(),
        "said": said,
        "report": _make_links(population["report"].tolist()),
        "calibration": _make_links(population["calibration"].tolist()),
    }


def _list_verdicts(population: Population) -> Iterable[tuple[str, tuple[str, ...], str]]:
    columns = (population[name].tolist() for name in ("verdict", "findings", "status"))
    return zip(*columns, strict=True)


def _add_findings(findings: tuple[str, ...], status: str, note: str) -> str:
    """Names of findings before the sentences, so that a reason finds its rows."""
    named = f"{', '.join(dict.fromkeys(findings))}: " if findings else ""
    return f"{note} {named}{status}".strip()


def _make_links(paths: Sequence[str | None]) -> list[str]:
    return ["" if path is None else make_link(path) for path in paths]


def make_link(path: str) -> str:
    """A file beside the page as an address, whatever its name.

    >>> make_link("reports/a b#1.html"), make_link("javascript:alert(1)")
    ('reports/a%20b%231.html', 'javascript%3Aalert%281%29')
    """
    return quote(path.replace("\\", "/"), safe="/", errors="backslashreplace")


def _join_lines(texts: Iterable[str]) -> bytes:
    cut = (t if len(t) <= _LONGEST else f"{t[: _LONGEST - 1]}…" for t in texts)
    one_line = "\n".join(" ".join(t.split()) if "\n" in t or "\r" in t else t for t in cut)
    return one_line.encode("utf-8", "replace")


def _round(values: Array) -> bytes:
    """float32, rounded to what is shown, so that it deflates."""
    bounded = np.clip(values, -_LARGEST, _LARGEST)  # a refused fit may be without bounds
    bits = bounded.astype("<f4").view("<u4")
    near = ((bits + (np.uint32(1) << (_DROPPED - np.uint32(1)))) >> _DROPPED) << _DROPPED
    return _split_bytes(np.where(np.isfinite(values), near, bits).astype("<u4"))


def _count_minutes(starts: NDArray[np.object_]) -> bytes:
    """Minutes since 1970 as int32; later than it can count is not known."""
    minutes = [_NO_TIME if t is None else int(t.timestamp() // 60) for t in starts.tolist()]
    bounded = [m if abs(m) < 2**31 else _NO_TIME for m in minutes]  # up to the year 6053
    return _split_bytes(np.array(bounded, dtype="<i4"))


def _split_bytes(values: NDArray[np.generic]) -> bytes:
    """All first bytes, then all second ones: like lies beside like."""
    return np.ascontiguousarray(values.view(np.uint8).reshape(-1, 4).T).tobytes()


def count_days(starts: NDArray[np.object_]) -> Array:
    """Days since 1970, NaN where the log did not know."""
    return np.array(
        [np.nan if start is None else start.timestamp() / 86_400.0 for start in starts.tolist()],
        dtype=np.float64,
    )
