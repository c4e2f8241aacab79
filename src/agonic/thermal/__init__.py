"""The climatic chamber: bias and matrix over temperature, from turned stations or a known field.

`campaign/` is what is recorded, `plan/` what to record and what it will tell, `checks/` whether it
was recorded as planned, `fit/` the calibration of one sensor (its formulas in `maths/`). All
sensors of a campaign are fitted in `all_sensors`, tested by `cross_validation`, and compared in
`common_mode`; `document` says and shows the result.
"""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
