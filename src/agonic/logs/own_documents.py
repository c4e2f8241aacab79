"""What agonic writes itself, where a log is needed: what it is, and the command that takes it."""

from __future__ import annotations

import re
from collections.abc import Iterable

_SECTION = re.compile(rb"^\[{1,2}([\w.]+)\]{1,2}\s*(?:#.*)?$", re.MULTILINE)
_SETTING = re.compile(rb"^[\w.-]+ *= *(?:[\"'\[{\d+-]|true|false)", re.MULTILINE)
_SCHEMA = re.compile(rb"\s*\{\s*\"schema\":\s*\"agonic/([\w-]{1,40})@")
_GENERATOR = b'<meta name="generator" content="agonic">'

_CALIBRATION = (
    "a calibration, no log: agonic report CAL shows it, agonic apply CAL LOG -o OUT corrects a log "
    "with it; name the log that it is for"
)
_SETTINGS = {
    b"compass": "a set-up of compasses, no log: agonic heading SETUP LOG -o OUT uses it",
    b"station": "the description of a chamber campaign, no log: agonic fit thermal FOLDER reads it",
    b"columns": "a list of columns, no log: name the log that it lies beside",
}
_TABLES = (
    (
        {"rows.work", "contents.sha256"},
        "the journal of a fleet, no log: agonic fleet goes on with it",
    ),
    (
        {"bias_x", "sha256", "residual_rms"},
        "the table of a fleet, no log: agonic history SENSOR shows a sensor of it, agonic fleet "
        "writes its report",
    ),
    (
        {"fault", "group", "original", "bias_x"},
        "the truth about a simulated fleet, no log: agonic fleet takes the logs beside it",
    ),
    ({"compass_deg", "magnetic_deg"}, "a compass swing, no log: agonic fit deviation FILE"),
    ({"compass_deg", "true_deg"}, "a compass swing, no log: agonic fit deviation FILE"),
    ({"compass_deg", "deviation_deg"}, "a compass swing, no log: agonic fit deviation FILE"),
)
FOLDERS = {
    "campaign.toml": "a chamber campaign: agonic fit thermal FOLDER -o OUT",
    "session.toml": "a session with a star sensor: agonic fit alignment FOLDER -o OUT",
    "coil.toml": "recordings in a coil: agonic fit coil FOLDER -o OUT",
    "north.toml": "a search for true north: agonic fit north FOLDER -o OUT",
    "fleet.parquet": "what agonic fleet has written; name the logs it was made from",
    "setup.toml": "what agonic calibrate has written; name the log it was made from",
}
"""What a folder with a file of this name is, and the command that takes it."""


def name_own(head: bytes) -> str:
    r"""What a file that starts with these bytes is, if agonic wrote it or reads it as settings.

    >>> name_own(b'{"schema": "agonic/calibration@1"}')[:14], name_own(b"time_s,mag_x_nT\n0,1\n")
    ('a calibration,', '')
    """
    if schema := _SCHEMA.match(head.removeprefix(b"\xef\xbb\xbf")):
        kind = schema[1].decode()
        result = f"a result of agonic (agonic/{kind}), no log; name the log it was made from"
        return _CALIBRATION if kind == "calibration" else result
    if head.lstrip().startswith(b"<") and _GENERATOR in head:
        return "a report of agonic, no log; name the log it was made from"
    if b"\0" in head:  # binary: first, for the search for sections would take longer than a reader
        return ""
    sections = _SECTION.findall(head)
    if not sections or not _SETTING.search(head):
        return ""
    known = next((_SETTINGS[name] for name in sections if name in _SETTINGS), "")
    return known or "a file of settings (TOML), no log; name the log"


def name_own_table(headers: Iterable[str]) -> str:
    """What a table without a magnetometer is, by its headers, if agonic wrote it.

    >>> name_own_table(["compass_deg", "magnetic_deg"])
    'a compass swing, no log: agonic fit deviation FILE'
    """
    there = set(headers)
    return next((what for marks, what in _TABLES if marks <= there), "")
