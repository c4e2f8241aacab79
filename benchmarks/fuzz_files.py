"""Recordings of every kind of container, damaged or made to harm: a part of `make fuzz`.

Each file is whole before it is changed. Some changes know the kind: a part of an archive is damaged
and packed anew with a right checksum, sizes are declared that are absurd, a database holds views
and triggers. A reader has to read it or to refuse it in one line, at once, in little memory.
"""

from __future__ import annotations

import io
import json
import sqlite3
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import numpy as np

from benchmarks.fuzz_bytes import change_bytes

Rng = np.random.Generator
ROWS = 150


def _readings(rng: Rng) -> np.ndarray:
    """Time and the field in microtesla, (n, 4)."""
    return np.column_stack([np.arange(ROWS) / 50, rng.normal(0, 30, (ROWS, 3))])


def write_csv(path: Path, rng: Rng) -> None:
    lines = (",".join(map(repr, row)) for row in _readings(rng).tolist())
    path.write_text("time_s,mag_x_uT,mag_y_uT,mag_z_uT\n" + "\n".join(lines) + "\n")


def write_xlsx(path: Path, rng: Rng) -> None:
    from tests.logs.workbook_writer import write_xlsx as write

    header = ["time_s", "mag_x_uT", "mag_y_uT", "mag_z_uT"]
    write(path, {"mag": [header, *_readings(rng).tolist()], "notes": [["nothing"]]})


def write_ods(path: Path, rng: Rng) -> None:
    from tests.logs.workbook_writer import write_ods as write

    header = ["time_s", "mag_x_uT", "mag_y_uT", "mag_z_uT"]
    write(path, {"mag": [header, *_readings(rng).tolist()], "notes": [["nothing"]]})


def write_sqlite(path: Path, rng: Rng) -> None:
    path.unlink(missing_ok=True)
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE mag (time_s REAL, mag_x_uT REAL, mag_y_uT REAL, mag_z_uT REAL)")
        base.executemany("INSERT INTO mag VALUES (?,?,?,?)", _readings(rng).tolist())
        base.execute("CREATE TABLE notes (text TEXT, image BLOB)")
        for statement in HOSTILE_SQL[: int(rng.integers(len(HOSTILE_SQL) + 1))]:
            base.execute(statement)
    base.close()


HOSTILE_SQL = (
    "INSERT INTO notes VALUES ('x', zeroblob(3000000))",
    "CREATE VIEW mag_view AS SELECT a.* FROM mag a, mag b, mag c, mag d, mag e",
    "CREATE TRIGGER t AFTER INSERT ON mag BEGIN INSERT INTO notes VALUES (new.time_s, ''); END",
    "CREATE TABLE odd (mag_x_uT, mag_y_uT, mag_z_uT, temperature_C)",
    "INSERT INTO odd VALUES (zeroblob(1000000), x'00ff', 'x', 1e400)",
    "INSERT INTO odd VALUES (9223372036854775807, NULL, '', -9e999)",
    "CREATE TABLE 'na\"me; DROP' (time_s, mag_x_uT)",
    "CREATE TABLE made (t, mag_x_uT, mag_y_uT AS (mag_x_uT * 2), mag_z_uT AS (zeroblob(t)))",
    "INSERT INTO made (t, mag_x_uT) VALUES (900000000, 1), (800000000, 2)",
    "UPDATE mag SET mag_x_uT = zeroblob(200000)",
)


def write_arrow(path: Path, rng: Rng) -> None:
    import pyarrow as pa

    values = _readings(rng)
    time, mag = pa.array(values[:, 0]), values[:, 1:]
    if rng.random() < 0.5:
        flat = pa.FixedSizeListArray.from_arrays(pa.array(mag.reshape(-1)), 3)
        columns = {"time_s": time, "mag_uT": flat, "sensor": pa.array(["a", "b"] * (ROWS // 2))}
    else:
        columns = {"time_s": time} | {
            f"mag_{a}_uT": pa.array(mag[:, k]) for k, a in enumerate("xyz")
        }
        columns["kind"] = pa.array(["on"] * ROWS).dictionary_encode()
    table = pa.table(columns)
    packing = rng.choice(["none", "lz4", "zstd"])
    options = pa.ipc.IpcWriteOptions(compression=None if packing == "none" else str(packing))
    make = pa.ipc.new_file if rng.random() < 0.6 else pa.ipc.new_stream
    with pa.OSFile(str(path), "wb") as sink, make(sink, table.schema, options=options) as writer:
        writer.write_table(table, max_chunksize=int(rng.choice([20, ROWS])))


def write_matlab(path: Path, rng: Rng) -> None:
    from scipy.io import savemat

    values = _readings(rng)
    kinds = [("t", "f8"), ("mag_uT", "O")]
    rows = np.array([(row[0], row[1:]) for row in values[:40]], dtype=kinds)
    whole = {"imu": {"mag_uT": values[:, 1:], "t": values[:, 0], "names": ["a", "b"]}}
    savemat(path, {"log": rows} if rng.random() < 0.5 else whole, do_compression=rng.random() < 0.5)


def write_numpy(path: Path, rng: Rng) -> None:
    values = _readings(rng)
    kinds = [("time_s", "f8"), ("mag_uT", "f4", 3)]
    with path.open("wb") as stream:
        if rng.random() < 0.5:
            np.savez_compressed(stream, t=values[:, 0], mag_uT=values[:, 1:])
        else:
            np.save(stream, np.array([(row[0], row[1:]) for row in values], dtype=kinds))


def write_zip(path: Path, rng: Rng) -> None:
    inner = path.with_suffix(".inner")
    (write_csv, write_xlsx, write_sqlite, write_matlab)[int(rng.integers(4))](inner, rng)
    with ZipFile(path, "w", ZIP_DEFLATED) as archive:
        archive.write(inner, "log/inner.dat")
        if rng.random() < 0.4:
            archive.writestr("Gyroscope.csv", "time_s,x,y,z\n0,1,2,3\n1,1,2,3\n")
    inner.unlink()


def write_echo(path: Path, rng: Rng) -> None:
    message = (
        "header:\n  stamp:\n    secs: {}\n    nsecs: 0\n  frame_id: 'imu'\nmagnetic_field:\n"
        "  x: {}\n  y: {}\n  z: {}\nmagnetic_field_covariance: [0.0, 0.0, 0.0]\n---\n"
    )
    rows = _readings(rng)
    rows[:, 1:] *= 1e-6
    path.write_text("".join(message.format(int(50 * t), x, y, z) for t, x, y, z in rows.tolist()))


def write_witmotion(path: Path, rng: Rng) -> None:
    header = "Time(s)\tChipTime\tax(g)\tay(g)\taz(g)\thx\thy\thz\n"
    rows = (
        f" 10:35:{k // 10:02}.{k % 10}00\t2024-3-18 10:35:{k // 10:02}.{k % 10}00\t"
        f"0.01\t0.02\t0.99\t{int(x)}\t{int(y)}\t{int(z)}\n"
        for k, (_, x, y, z) in enumerate((_readings(rng) * 10).tolist())
    )
    path.write_text("StartTime: 2024-03-18 10:35:00.000\n" + header + "".join(rows))


def write_json(path: Path, rng: Rng) -> None:
    rows = [{"t": t, "mag": {"x": x, "y": y, "z": z}, "name": "m"} for t, x, y, z in _readings(rng)]
    text = json.dumps(rows) if rng.random() < 0.5 else "\n".join(map(json.dumps, rows))
    path.write_text(text)


WRITERS: dict[str, Callable[[Path, Rng], None]] = {
    "csv": write_csv,
    "xlsx": write_xlsx,
    "ods": write_ods,
    "sqlite": write_sqlite,
    "arrow": write_arrow,
    "matlab": write_matlab,
    "numpy": write_numpy,
    "zip": write_zip,
    "rostopic echo": write_echo,
    "witmotion": write_witmotion,
    "json": write_json,
}


def make_damaged(path: Path, rng: Rng) -> str:
    """Write a recording with damage to `path`; what was done to what."""
    kind = str(rng.choice(list(WRITERS)))
    WRITERS[kind](path, rng)
    data = path.read_bytes()
    ways: list[Callable[[bytes, Rng], bytes]] = [change_bytes, change_sizes, change_swapped]
    if data.startswith(b"PK"):
        ways += [change_part] * 3 + [change_directory, add_bomb, add_entities, nest]
    elif data.startswith(b"MATLAB"):
        ways += [change_inflated] * 3
    elif kind in ("csv", "rostopic echo", "witmotion", "json"):
        ways += [change_numbers] * 2
    way = ways[int(rng.integers(len(ways)))]
    path.write_bytes(way(data, rng))
    return f"{kind}, {way.__name__}"


def change_sizes(data: bytes, rng: Rng) -> bytes:
    """Some numbers of four or eight bytes absurd: lengths, offsets, counts."""
    changed = bytearray(data)
    for _ in range(int(rng.integers(1, 6))):
        number = int(rng.choice([0, 1, -1, -8, 2**31 - 1, -(2**31), 2**40, 2**62, -(2**62)]))
        wide = rng.random() < 0.5 or abs(number) > 2**31
        packed = struct.pack("<q", number) if wide else struct.pack("<i", number)
        at = int(rng.integers(max(1, len(data) - len(packed)))) & ~3
        changed[at : at + len(packed)] = packed
    return bytes(changed)


def change_swapped(data: bytes, rng: Rng) -> bytes:
    """Two parts in each other's place."""
    a, b, c = np.sort(rng.integers(0, len(data) + 1, 3)).tolist()
    return data[:a] + data[b:c] + data[a:b] + data[c:]


def change_numbers(data: bytes, rng: Rng) -> bytes:
    """Some words of a text extreme."""
    words = data.decode("latin-1").split(" " if data.count(b" ") > 50 else ",")
    extremes = [
        "nan",
        "-inf",
        "1e308",
        "1e400",
        "-1e-320",
        "9" * 400,
        "",
        "[",
        "{" * 200,
        "\0",
        "---",
    ]
    for at in rng.integers(0, len(words), int(rng.integers(1, 9))):
        words[at] = str(rng.choice(extremes))
    return (" " if data.count(b" ") > 50 else ",").join(words).encode("latin-1")


def change_inflated(data: bytes, rng: Rng) -> bytes:
    """The content of a MATLAB file changed before it was packed."""
    head, at, parts = data[:128], 128, []
    while at + 8 <= len(data):
        kind, size = struct.unpack("<II", data[at : at + 8])
        content = data[at + 8 : at + 8 + size]
        if kind == 15:
            inner = zlib.decompress(content)
            inner = (change_sizes if rng.random() < 0.6 else change_bytes)(inner, rng)
            content = zlib.compress(inner)
        else:
            content = change_sizes(content, rng) if content else content
        parts.append(struct.pack("<II", kind, len(content)) + content)
        at += 8 + size
    return head + b"".join(parts)


def _members(data: bytes) -> dict[str, bytes]:
    with ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def _pack(members: dict[str, bytes]) -> bytes:
    made = io.BytesIO()
    with ZipFile(made, "w", ZIP_DEFLATED) as archive:
        for name, content in members.items():
            packing = ZIP_STORED if name == "mimetype" else ZIP_DEFLATED  # as OpenDocument has it
            archive.writestr(name, content, packing, compresslevel=1)
    return made.getvalue()


def change_part(data: bytes, rng: Rng) -> bytes:
    """One member of an archive changed, lost, or in another's place, packed as if it were whole."""
    members = _members(data)
    names = [name for name, content in members.items() if content]
    name, other = (str(n) for n in rng.choice(names, 2))
    match int(rng.integers(5)):
        case 0:
            del members[name]
        case 1:
            members[name], members[other] = members[other], members[name]
        case 2:
            members[name] = _change_markup(members[name], rng)
        case 3:
            members[name] = _change_markup(_change_markup(members[name], rng), rng)
        case _:
            members[name] = change_bytes(members[name], rng)
    return _pack(members or {"empty": b""})


def _change_markup(data: bytes, rng: Rng) -> bytes:
    """XML with one value of an attribute or one text extreme, or an element without end."""
    text = data.decode("latin-1")
    cells = text.split('"' if rng.random() < 0.5 else ">")
    mark = '"' if text.count('"') + 1 == len(cells) else ">"
    cells[int(rng.integers(len(cells)))] = str(rng.choice(MARKUP))
    return mark.join(cells).encode("utf-8", "replace")


MARKUP = (
    *(
        "",
        "-1",
        "9" * 30,
        "1e999",
        "nan",
        "ZZZZZZZZ1",
        "XFD1048576",
        "A0",
        "²",
        "٣",
        "&#0;",
        "&lt;",
    ),
    *("<" * 9, "<a>" * 3000, "100000000", "rId1", "d/m/y", "s", "../../x"),
)
"""What stands in the place of a value in XML."""


def change_directory(data: bytes, rng: Rng) -> bytes:
    """The list at the end of an archive with other sizes, places, methods and names."""
    changed, at = bytearray(data), data.rfind(b"PK\1\2")
    for _ in range(int(rng.integers(1, 4))):
        field = int(rng.choice([8, 10, 16, 20, 24, 28, 30, 42]))
        changed[at + field : at + field + 2] = rng.integers(0, 256, 2).astype(np.uint8).tobytes()
    return bytes(changed)


def add_bomb(data: bytes, rng: Rng) -> bytes:
    """A member in it becomes 60 MB of one letter, or its text is followed by that."""
    members = _members(data)
    name = str(rng.choice(list(members)))
    kind = bytes([int(rng.choice([0, 32, 60, 65, 10]))])
    members[name] = (members[name] if rng.random() < 0.5 else b"") + kind * 60_000_000
    return _pack(members)


def add_entities(data: bytes, rng: Rng) -> bytes:
    """Every XML in it declares entities that grow without end, or lead to a file."""
    grows = "".join(f'<!ENTITY a{k + 1} "{f"&a{k};" * 10}">' for k in range(12))
    leads = '<!ENTITY a12 SYSTEM "file:///etc/passwd">'
    declared = f"<!DOCTYPE x [<!ENTITY a0 'x'>{grows if rng.random() < 0.5 else leads}]>".encode()
    members = _members(data)
    for name, content in members.items():
        head, end, rest = content.partition(b"?>")
        if name.endswith((".xml", ".rels")) and end:
            members[name] = head + end + declared + rest.replace(b"<v>", b"<v>&a12;", 3)
    return _pack(members)


def nest(data: bytes, rng: Rng) -> bytes:
    """An archive within an archive, several times."""
    for _ in range(int(rng.integers(1, 5))):
        data = _pack({str(rng.choice(["log.zip", "log.csv", "../../log", "/log"])): data})
    return data
