"""Lines `Raw:ax,ay,az,gx,gy,gz,mx,my,mz`, as sketches print them for MotionCal."""

from __future__ import annotations

from typing import Any

from numpy.typing import NDArray

from agonic.logs.text.layout import Layout
from agonic.logs.text.numbers import read_numbers

_COLUMNS = {
    **{f"acc_{axis}_g": 1 / 8192 for axis in "xyz"},
    **{f"gyro_{axis}_deg_s": 1 / 16 for axis in "xyz"},
    **{f"mag_{axis}_mG": 1.0 for axis in "xyz"},
}
"""One count of each column of a MotionCal line (PaulStoffregen/MotionCal: imuread.h, where a
magnetic count is 0.1 µT)."""


def read_motioncal(data: bytes, mark: str) -> dict[str, NDArray[Any]]:
    """The columns of the lines that begin with the mark, in the units of one count."""
    lines = [line for line in data.decode().split("\n") if line.startswith(mark)]
    body = "\n".join(line.removeprefix(mark) for line in lines).encode()
    names = list(_COLUMNS)
    layout = Layout(separator=",", header=names, start=0, width=len(names))
    counts = read_numbers(body, 0, layout, range(len(names)))
    return {name: counts[k] * size for k, (name, size) in enumerate(_COLUMNS.items())}
