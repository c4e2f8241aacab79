"""World models of the geomagnetic field, offline."""

from agonic.field.published import igrf, wmm, wmmhr

__all__ = ["igrf", "wmm", "wmmhr"]
