"""What a fleet amounts to, in words and tables: verdicts, reasons, what stands out, duplicates."""

from __future__ import annotations

import base64
import json
import re
import zlib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from urllib.parse import quote

import numpy as np
from numpy.typing import NDArray

from agonic.arrays import Array
from agonic.population import Duplicate, Outlier, Population
from agonic.population.peers import MIN_PEERS, Peers
from agonic.report.digits import count, group_digits, percent, write_minus
from agonic.report.markup import Markup, element, markup, table
from agonic.report.section import aside
from agonic.report.tables import mark
from agonic.report.verdict import MEANINGS, sentence

VERDICTS = ("good", "check", "refused")
_MAX_CHARACTERS = 240
_DROPPED_BITS = np.uint32(7)  # of the 23 bits after the point: five digits are left
_NO_TIME = -(2**31)
_LARGEST = 1e38  # that float32 holds, rounded up


def embed_rows(
    population: Population,
    groups: NDArray[np.int8],
    notes: Mapping[int, str],
    noted: NDArray[np.uint8],
) -> Markup:
    """The rows as a script element. `groups` (n,) is the group of each row or −1; `notes` what is
    said of rows that stand out, `noted` (n,) 1 for these, 2 where their bias or axes do."""
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
    said = []
    columns = (population[name].tolist() for name in ("verdict", "findings", "status"))
    for k, (verdict, findings, status) in enumerate(zip(*columns, strict=True)):
        note = notes.get(k, "")
        # names of findings before the sentences, so that a reason finds its rows
        named = f"{', '.join(dict.fromkeys(findings))}: " if findings else ""
        said.append(note if verdict == "good" else f"{note} {named}{status}".strip())
    return {
        "sensor": population["sensor"].tolist(),
        "source": population["source"].tolist(),
        "channel": population["channel"].tolist(),
        "said": said,
        "report": _make_links(population["report"].tolist()),
        "calibration": _make_links(population["calibration"].tolist()),
    }


def _make_links(paths: Sequence[str | None]) -> list[str]:
    return ["" if path is None else make_link(path) for path in paths]


def make_link(path: str) -> str:
    """A file beside the page as an address, whatever its name."""
    return quote(path.replace("\\", "/"), safe="/", errors="backslashreplace")


def _join_lines(texts: Iterable[str]) -> bytes:
    cut = (t if len(t) <= _MAX_CHARACTERS else f"{t[: _MAX_CHARACTERS - 1]}…" for t in texts)
    one_line = "\n".join(" ".join(t.split()) if "\n" in t or "\r" in t else t for t in cut)
    return one_line.encode("utf-8", "replace")


def _round(values: Array) -> bytes:
    """float32, rounded to what is shown, so that it deflates."""
    bounded = np.clip(values, -_LARGEST, _LARGEST)  # a refused fit may be without bounds
    bits = bounded.astype("<f4").view("<u4")
    near = (
        (bits + (np.uint32(1) << (_DROPPED_BITS - np.uint32(1)))) >> _DROPPED_BITS
    ) << _DROPPED_BITS
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


_FIRST = re.compile(r"(?<=\.)\s+(?=[A-Z])")  # where a second sentence begins
_BEGIN = re.compile(r"[;:('\"\d]")  # before what differs from log to log


def count_verdicts(population: Population) -> dict[str, int]:
    """How many rows have each verdict."""
    return {name: int((population["verdict"] == name).sum()) for name in VERDICTS}


def list_key_figures(
    population: Population, found: Sequence[Outlier], same: Sequence[Duplicate]
) -> list[tuple[str, str, str]]:
    """Sensors, logs, verdicts and what stands out, the numbers to look at first."""
    number, n = count_verdicts(population), max(len(population), 1)
    sensors, logs = (len(set(population[name].tolist())) for name in ("sensor", "source"))
    standing = len({one.sensor for one in found})
    return [
        ("Sensors", group_digits(sensors), "by their names"),
        ("Logs", group_digits(logs), count(len(population), "calibration")),
        *(
            (
                MEANINGS[name][0],
                group_digits(number[name]),
                f"{percent(number[name] / n)}, {MEANINGS[name][1]}",
            )
            for name in VERDICTS
        ),
        ("Stand out", group_digits(standing), "sensors unlike the others"),
        ("Duplicates", group_digits(len(same)), "logs that are there more than once"),
    ]


# ---- sensors that stand out ----------------------------------------------------------------------


def collect_notes(found: Sequence[Outlier]) -> dict[int, str]:
    """What is said of a row, all its sentences together."""
    said: dict[int, list[str]] = {}
    for one in found:
        said.setdefault(one.row, []).append(sentence(one.sentence))
    return {row: " ".join(sentences) for row, sentences in said.items()}


def list_outliers(
    population: Population, found: Sequence[Outlier], groups: Sequence[Peers]
) -> Markup:
    """The sensors that stand out, each with its sentences, the most striking first."""
    said = collect_notes(found)
    rank: dict[int, float] = {}
    for one in found:
        rank[one.row] = min(rank.get(one.row, 0.0), -one.distance)
    rows = sorted(said, key=lambda row: (rank[row], row))
    few = [group for group in groups if not group.enough]
    lines = [
        aside(
            f"{count(len(group), 'sensor')} ({group.name}) are too few to find what is usual: at "
            f"least {MIN_PEERS} are needed."
        )
        for group in few
    ]
    if not rows:
        told = any(group.enough for group in groups)
        none = element("p", "No sensor stands out from the others.") if told else ""
        return markup(none, *lines)
    body = [
        (
            link_sensor(population, row),
            element("span", population["source"][row], class_="source"),
            write_minus(said[row]),
        )
        for row in rows[:200]
    ]
    more = len(rows) - len(body)
    if more > 0:
        words = f"{count(more, 'more sensor')} of this kind: in the table, choose “stands out”."
        lines.append(element("p", words))
    return markup(
        table(("Sensor", "Log", "What is unlike the others"), body, class_="standing"), *lines
    )


def link_sensor(population: Population, row: int) -> Markup:
    """A sensor by its name, with a link to its report where there is one."""
    name, report = population["sensor"][row], population["report"][row]
    return markup(name) if report is None else element("a", name, href=make_link(report))


# ---- reasons -------------------------------------------------------------------------------------


@dataclass
class _Reason:
    number: dict[str, int] = field(default_factory=lambda: dict.fromkeys(VERDICTS, 0))
    examples: list[int] = field(default_factory=list)


def list_reasons(population: Population) -> Markup:
    """The first reason why each was refused or is to be checked, the most frequent first."""
    odd = np.flatnonzero(population["verdict"] != "good")
    if not len(odd):
        return element("p", "Every calibration is good.")
    found: dict[str, _Reason] = {}
    for row in odd.tolist():
        entry = found.setdefault(_get_reason(population, row), _Reason())
        entry.number[population["verdict"][row]] += 1
        if len(entry.examples) < 3:
            entry.examples.append(row)
    order = sorted(found, key=lambda r: (-found[r].number["refused"], -found[r].number["check"], r))
    body = [_make_reason_row(population, name, found[name]) for name in order[:30]]
    head = ("Reason", "Refused", "To check", "For example")
    shown = table(head, body, class_="reasons")
    left = len(order) - len(body)
    return markup(shown, element("p", f"{count(left, 'other reason')}.") if left > 0 else "")


def _get_reason(population: Population, row: int) -> str:
    """The first finding of a row; where there is none, how its status begins."""
    findings: tuple[str, ...] = population["findings"][row]
    return findings[0] if findings else _BEGIN.split(population["status"][row])[0][:60].strip()


def _make_reason_row(population: Population, name: str, reason: _Reason) -> Sequence[str]:
    first = reason.examples[0]
    logs = ", ".join(dict.fromkeys(str(population["source"][row]) for row in reason.examples))
    status = write_minus(sentence(_FIRST.split(str(population["status"][first]))[0]))
    example = markup(status, " ", element("span", logs, class_="source"))
    return (name, *(group_digits(reason.number[v]) for v in ("refused", "check")), example)


# ---- the rest ------------------------------------------------------------------------------------


def describe_verdicts(number: Mapping[str, int]) -> Markup:
    """The words of the bar of verdicts."""
    parts = (
        mark(name, f"{group_digits(n)} {MEANINGS[name][0].lower()}") for name, n in number.items()
    )
    return element("p", *parts, class_="legend verdicts")


def list_duplicates(same: Sequence[Duplicate]) -> Markup:
    """The logs that are there more than once."""
    shown = [element("li", f"{one.sentence}.") for one in same[:100]]
    left = len(same) - len(shown)
    more = element("p", f"{count(left, 'more log')} of this kind.") if left > 0 else ""
    said = aside("Each counts once for what is usual.")
    return markup(said, element("ul", *shown, class_="duplicates"), more)
