"""ROS: a YAML file of parameters for `magnetometer_pipeline`.

    field = scaling_matrix (field − bias),   tesla, axes of the message

Source: ctu-vras/compass, magnetometer_pipeline/src/bias_remover.cpp. How the sensor sits belongs to
tf: a static transform from the body's frame, its parent, to the sensor's, whose quaternion turns
vectors of the sensor's axes into the body's (tf2, REP 105).
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from agonic.calibration.base import Calibration
from agonic.errors import AgonicError
from agonic.exports.banner import write_banner
from agonic.exports.convert import (
    NEGLIGIBLE_DEG,
    Export,
    find_rotation_inside,
    hold_sources,
    turn_into_frame,
    write_rows,
)
from agonic.exports.temperature import hold_temperature
from agonic.units import NANOTESLA_PER

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

MATRIX = "initial_mag_scaling_matrix"
BIAS = tuple(f"initial_mag_bias_{axis}" for axis in "xyz")


def write_ros(
    calibration: Calibration,
    path: Path | str,
    *,
    ros: int = 2,
    temperature_C: float | None = None,
) -> Export:
    """Write the parameters of ROS's magnetometer bias remover.

    Parameters: `calibration`; `path` of the file; `ros` is 2 for a parameter file of ROS 2, 1 for
    keys that `rosparam` loads into the node's private namespace; `temperature_C` is where a
    calibration is held that changes with temperature. The mounting inside a calibration stands in
    the comments, as the command that tells it to tf. Raises `UnitError` for one in raw units.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> mag = Affine(bias=[3000, 0, 0], matrix=np.eye(3))
    >>> with TemporaryDirectory() as folder:
    ...     export = write_ros(mag, folder + "/mag.yaml")
    ...     [row.strip() for row in export.path.read_text().split("\\n") if "mag_bias_x" in row]
    ['initial_mag_bias_x: 3.0e-06']
    """
    if ros not in (1, 2):
        raise AgonicError(f"ros is 1 or 2, not {ros}")
    one, lost = hold_temperature(calibration, temperature_C)
    one, held = hold_sources(one)
    turned = {one.frame_in, one.frame_out} == {"m", "b"}
    turn_bm = find_rotation_inside(one)[0] if turned else None
    bias, matrix, warnings = turn_into_frame(one, one.frame_in, unit="tesla", rotation_bm=turn_bm)
    command, mounted = ((), ()) if turn_bm is None else _describe_transform(turn_bm, ros)
    warnings = (*lost, *mounted, *warnings, *held)
    values = (bias / NANOTESLA_PER["T"]).tolist()
    rows = [f"{name}: {_number(value)}" for name, value in zip(BIAS, values, strict=True)]
    rows.append(f"{MATRIX}: [{', '.join(map(_number, matrix.ravel().tolist()))}]")
    heading = ["/**:", "  ros__parameters:"] if ros == 2 else []
    indent = "    " if ros == 2 else ""
    formula = f"field = {MATRIX} (field - bias), tesla, axes of the message, row by row"
    notes = (*write_banner(calibration, formula, warnings), *command)
    return write_rows("ros", path, notes, [*heading, *(indent + row for row in rows)], warnings)


def _describe_transform(turn_bm: Rotation, ros: int) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """The command that tells tf how the sensor sits, and the warning that it is needed."""
    angle = np.degrees(turn_bm.magnitude())
    if angle < NEGLIGIBLE_DEG:
        return (), ()
    x, y, z, w = (f"{value + 0.0:.9f}" for value in turn_bm.as_quat())
    command = (
        f"rosrun tf2_ros static_transform_publisher 0 0 0 {x} {y} {z} {w} imu_link mag_link"
        if ros == 1
        else f"ros2 run tf2_ros static_transform_publisher --qx {x} --qy {y} --qz {z} --qw {w} "
        "--frame-id imu_link --child-frame-id mag_link"
    )
    said = (
        f"the mounting of {angle:.2f} deg belongs to tf: the file's comments have the static "
        "transform; its parent (imu_link) has the axes in which the log has accelerometer, or roll "
        "and pitch (forward, right, down)"
    )
    return (command,), (said,)


def _number(value: float) -> str:
    """A number that every YAML reader takes for a float: with a point, also before an exponent."""
    text = repr(value + 0.0)
    return text if "." in text else text.replace("e", ".0e")
