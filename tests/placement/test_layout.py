"""A list of parts is read whole, and every mistake in it is named."""

from pathlib import Path

import numpy as np
import pytest

from agonic.errors import LogError
from agonic.placement.layout import EXAMPLE, read_layout

REGION = '[[region]]\nname = "top"\ncorner_m = [0, 0, 0]\nedges_m = [[1, 0, 0], [0, 1, 0]]\n'
PART = '[[part]]\nname = "motor"\nposition_m = [0, 0, 1]\n'

WIRE = '[[wire]]\nname = "lead"\npoints_m = [[0, 0, 1], [1, 0, 1]]\ncurrent_A = [0, 5]\n'
LOOP = (
    '[[loop]]\nname = "coil"\nposition_m = [0, 0, 0]\nradius_m = 1\n'
    "axis = [0, 0, 1]\ncurrent_A = [0, 5]\n"
)


def write(folder: Path, text: str) -> Path:
    file = folder / "parts.toml"
    file.write_text(text)
    return file


def test_the_example_is_read_as_it_says() -> None:
    made = read_layout(EXAMPLE)
    assert [len(one.edges_m) for one in made.regions] == [2, 1]
    assert made.parts[0].induced_m3 == 4e-6
    assert made.loops == []
    assert made.wires[1].turns == 5
    assert np.allclose(made.wires[1].points_m[0], made.wires[1].points_m[-1])  # a loop is closed
    assert np.linalg.norm(made.field_n) == pytest.approx(48_000)


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (PART, "missing required field `region`"),
        (REGION, "what disturbs"),
        (REGION + PART + "colour = 3\n", "unknown field `colour` - at `$.part[0]`"),
        (REGION + '[[part]]\nname = "motor"\n', "missing required field `position_m`"),
        (REGION + PART + PART, "two [[part]] are called motor"),
        (REGION + PART + "moment_sd_A_m2 = -1\n", "`float` >= 0.0 - at `$.part[0].moment_sd_A_m2`"),
        (REGION + WIRE.replace(", [1, 0, 1]", ""), "length >= 2 - at `$.wire[0].points_m`"),
        (REGION + WIRE.replace("[0, 5]", "[5, 0]"), "current_A is [least, most]"),
        (REGION + PART.replace("part", "magnet"), "unknown field `magnet`"),
        (PART + REGION.replace("[[1, 0, 0], [0, 1, 0]]", "[]"), "at `$.region[0].edges_m`"),
        (REGION + LOOP.replace("[0, 0, 1]", "[0, 0, 0]"), "axis has no direction"),
    ],
)
def test_mistakes_are_named(tmp_path: Path, text: str, said: str) -> None:
    with pytest.raises(LogError) as caught:
        read_layout(write(tmp_path, text))
    assert said in str(caught.value)


def test_wires_of_one_name_carry_one_current(tmp_path: Path) -> None:
    both = REGION + WIRE + WIRE
    assert read_layout(write(tmp_path, both)).currents == {"lead": (0.0, 5.0)}
    with pytest.raises(LogError, match="one current"):
        read_layout(write(tmp_path, REGION + WIRE + WIRE.replace("[0, 5]", "[0, 6]")))
