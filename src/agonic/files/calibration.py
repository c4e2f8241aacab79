"""The calibration file: JSON that holds a calibration exactly; see `calibration.encoding`."""

from __future__ import annotations

from pathlib import Path

from agonic.atomic import write_atomically
from agonic.calibration.base import Calibration
from agonic.calibration.deviation import Deviation
from agonic.calibration.encoding import decode, encode
from agonic.calibration.steps import AnyCalibration
from agonic.errors import AgonicError, LogError
from agonic.logs.contents import read_bytes
from agonic.logs.formats import name_content


def save(calibration: Calibration | Deviation, path: Path | str) -> Path:
    """Write a calibration to a JSON file that `load` gives back float for float.

    Parameters: `calibration`; `path`, replaced where there is a file.

    Raises `AgonicError` where it is no calibration, holds a NaN, or the file cannot be written.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> with TemporaryDirectory() as folder:
    ...     path = save(Affine(bias=[10, 0, 0.1], matrix=np.eye(3)), folder + "/mag.json")
    ...     load(path).bias.tolist()
    [10.0, 0.0, 0.1]
    """
    return write_atomically(path, encode(calibration))


def as_calibration(given: Path | str | AnyCalibration) -> AnyCalibration | Deviation:
    """The calibration itself, or that of a file."""
    return load(given) if isinstance(given, Path | str) else given


def load(path: Path | str) -> AnyCalibration | Deviation:
    """Read a calibration file.

    Parameters: `path` of the file.

    Raises `LogError` where it is missing, damaged, something else, or made by a newer agonic.

    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> from agonic.calibration.affine import Affine
    >>> with TemporaryDirectory() as folder:
    ...     load(save(Affine(bias=[1, 2, 3], matrix=np.eye(3)), folder + "/mag.json")).kind
    'affine'
    """
    data = read_bytes(path)
    if not data.lstrip().startswith(b"{"):
        raise LogError(
            f"this is {name_content(data)}, and a calibration file is needed: the JSON that agonic "
            "calibrate LOG writes into LOG-agonic, or agonic fit",
            path=path,
        )
    try:
        return decode(data)
    except (AgonicError, ValueError, RecursionError) as error:
        raise LogError(f"not a usable calibration file: {error}", path=path) from None
