"""Calibrations in the form of other programs: a module for each, all listed in `targets`.

Another target:
1. `exports/NAME.py` with `write_NAME(calibration, path, *, temperature_C=None) -> Export`, whose
   docstring gives the target's equation and source (`convert`, `fixed_temperature` do the rest);
2. a line in `targets.TARGETS`: `agonic export --to NAME`, its help and its tests follow;
3. a row in `docs/jobs/export.md` and the word in `README.md`; if it is a name of `ag.`, a line in
   `__init__.pyi` too. `tests/exports/test_targets.py` says which of these is missing.
"""

from agonic.public import offer

__getattr__, __dir__, __all__ = offer(__name__, f"{__file__}i")
