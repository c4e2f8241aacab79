"""Water in air: the temperature at which it condenses, and how dry air must be not to.

Magnus' formula with the constants of the WMO (No. 8, annex 4.B): the pressure of saturation over
water is 6.112 hPa · exp(17.62 T/(243.12 + T)), good to 0.1 °C of dew point from −45 to 60 °C.
"""

from __future__ import annotations

from math import exp, log

_A, _B_C = 17.62, 243.12


def find_dew_point(temperature_C: float, humidity_percent: float) -> float:
    """The temperature, °C, at which air of a relative humidity gives off its water.

    >>> round(find_dew_point(22.0, 50.0), 1), round(find_dew_point(22.0, 100.0), 1)
    (11.1, 22.0)
    """
    exponent = log(humidity_percent / 100.0) + _A * temperature_C / (_B_C + temperature_C)
    return _B_C * exponent / (_A - exponent)


def find_humidity(temperature_C: float, dew_point_C: float) -> float:
    """The relative humidity, %, of air with a dew point.

    >>> round(find_humidity(22.0, find_dew_point(22.0, 35.0)), 6)
    35.0
    """
    wet, saturated = (_A * t / (_B_C + t) for t in (dew_point_C, temperature_C))
    return 100.0 * exp(wet - saturated)
