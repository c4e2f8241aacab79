"""Recordings that end in the middle, or begin with marks of an encoding."""

import json
from pathlib import Path

import numpy as np
import pytest

import agonic as ag

READINGS = np.array([(20.25, -3.5, 43.25), (19.5, 4.25, 42.5), (17.5, 11.5, 41.75)] * 3)
TABLE = "t,mx,my,mz,note\n" + "".join(
    f"{k / 10},{x},{y},{z:.2f},7\n" for k, (x, y, z) in enumerate(READINGS)
)
OBJECTS = json.dumps([dict(zip(("mx", "my", "mz"), row, strict=True)) for row in READINGS.tolist()])


def read(folder: Path, data: bytes, name: str = "log.csv") -> ag.Samples:
    path = folder / name
    path.write_bytes(data)
    return ag.read(path)


@pytest.mark.parametrize("cut", ["41.75,7\n", "1.75,7\n", ".75,7\n", "5,7\n", ",7\n"])
def test_a_last_row_that_ends_in_the_middle_is_left_out(tmp_path: Path, cut: str) -> None:
    """A reading of 41.75 that was cut to 41, or to 4, looks like any other."""
    samples = read(tmp_path, TABLE.removesuffix(cut).encode())
    assert samples.field == pytest.approx(READINGS[:-1])
    assert samples.rejected == {"the last line ends in the middle": 1}


def test_a_whole_last_row_needs_no_end_of_line(tmp_path: Path) -> None:
    assert read(tmp_path, TABLE.rstrip("\n").encode()).field == pytest.approx(READINGS)


@pytest.mark.parametrize("encoding", ["utf-8-sig", "utf-16"])
@pytest.mark.parametrize("lines", [False, True])
def test_json_with_the_mark_of_an_encoding_is_read(
    tmp_path: Path, encoding: str, lines: bool
) -> None:
    text = OBJECTS[1:-1].replace("}, ", "}\n") if lines else OBJECTS
    assert read(tmp_path, text.encode(encoding), "log.json").field == pytest.approx(READINGS)


@pytest.mark.parametrize("nested", [False, True])
def test_json_that_ends_in_the_middle_is_read_as_far_as_it_goes(
    tmp_path: Path, nested: bool
) -> None:
    text = f'{{"session": {{"rows": {OBJECTS}}}}}' if nested else OBJECTS
    samples = read(tmp_path, text[: text.rindex('"my"')].encode(), "log.json")
    assert samples.field == pytest.approx(READINGS[:-1])


def test_a_torn_json_whose_bytes_are_no_text_is_refused_with_words(tmp_path: Path) -> None:
    path = tmp_path / "log.json"
    path.write_bytes(b'\xf8[{"mag_x": 1, "mag_y": 2,\n "mag_z": 3}, {"mag_x":\n 4, "mag')
    with pytest.raises(ag.LogError):
        ag.read(path)
