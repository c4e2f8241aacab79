"""CDF files as magnetic satellites' data come in, and the truth they are made from."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from agonic.field.published import igrf
from agonic.maths.earth.geodesy import directions, earth_fixed, from_geocentric, north_east_down

N = 120
START_MS = 63_618_825_600_000.0  # 2016-01-01 00:00
TYPES = {"f8": 45, "i8": 33, "epoch": 31, "epoch16": 32, "u1": 11, "text": 51}
"""Numbers of CDF's data types."""

ROT_CM = Rotation.from_euler("zyx", [12.0, -5.0, 3.0], degrees=True)
"""From the magnetometer to the star camera."""


def swarm(n: int = N) -> dict[str, Any]:
    """The variables of a quiet pass: the model's field, the camera's attitude, both consistent."""
    latitude, longitude = np.linspace(-80.0, 80.0, n), np.linspace(20.0, 10.0, n)
    radius = np.full(n, 6_828_000.0)
    place = from_geocentric(latitude, longitude, radius)
    field_n = igrf().at(*place, "2016-01-01").field_n
    field_e = earth_fixed(field_n.T, directions(*place[:2]))
    field_nec = north_east_down(field_e, directions(latitude, longitude)).T
    rot_nc = Rotation.from_euler("zyx", np.linspace([5, 0, 0], [80, 20, -10], n), degrees=True)
    field_m = (rot_nc * ROT_CM).apply(field_nec, inverse=True)
    return {
        "Timestamp": START_MS + 1000.0 * np.arange(n),
        "Latitude": latitude,
        "Longitude": longitude,
        "Radius": radius,
        "F": np.linalg.norm(field_nec, axis=1) + 0.3,
        "B_VFM": field_m,
        "B_NEC": field_nec,
        "q_NEC_CRF": rot_nc.as_quat(),
        "Flags_F": np.zeros(n, "u1"),
        "Flags_B": np.zeros(n, "u1"),
        "Flags_q": np.zeros(n, "u1"),
    }


def write_cdf(
    path: Path,
    variables: dict[str, Any],
    *,
    units: dict[str, str] | None = None,
    kinds: dict[str, str] | None = None,
    compressed: bool = False,
) -> Path:
    """Write variables; `Timestamp` is a CDF_EPOCH, or what `kinds` says."""
    from cdflib.cdfwrite import CDF

    path.unlink(missing_ok=True)
    with CDF(path, cdf_spec={"Compressed": 6 if compressed else 0}) as file:
        for name, given in variables.items():
            values = np.asarray(given)
            kind = (kinds or {}).get(name, "epoch" if name == "Timestamp" else values.dtype.str[1:])
            text = values.dtype.kind in "US"
            spec = {
                "Variable": name,
                "Data_Type": TYPES["text" if text else kind],
                "Num_Elements": values.dtype.itemsize // 4 if text else 1,
                "Rec_Vary": True,
                "Compress": 0,
                "Dim_Sizes": list(values.shape[1:]),
            }
            attributes = {"UNITS": units[name]} if units and name in units else {}
            file.write_var(spec, var_attrs=attributes, var_data=values)
    return path
