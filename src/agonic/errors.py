"""The error tree: every message says what was given, what is needed and the next move."""

from __future__ import annotations

from pathlib import Path
from typing import Any


class AgonicError(Exception):
    """Anything that went wrong for a reason the user can do something about."""

    def __reduce__(self) -> tuple[Any, ...]:  # as it is, whatever its class is made from
        return Exception.__new__, (type(self), *self.args), self.__dict__


class LogError(AgonicError):
    """A file could not be read: `path`, and where known the `row`."""

    def __init__(self, message: str, *, path: Path | str | None = None, row: int | None = None):
        where = "" if path is None else f"{path}: " if row is None else f"{path}, row {row}: "
        super().__init__(where + message)
        self.path = path
        self.row = row


class TwoAxisError(LogError):
    """A log holds magnetometers of x and y alone, where three axes are needed."""


class UnitError(AgonicError):
    """A unit is unknown, missing, or does not fit what it was given for."""


class FrameError(AgonicError):
    """Two frames that do not meet: `left` is where the value ends, `right` what was needed."""

    def __init__(self, message: str, *, left: str, right: str):
        super().__init__(f"{message} ({left} does not meet {right})")
        self.left = left
        self.right = right


class CoverageError(AgonicError):
    """The readings do not determine what was asked; `undetermined` and `turns` say what to add."""

    def __init__(self, message: str, *, undetermined: str = "", turns: str = ""):
        super().__init__("; ".join(part for part in (message, turns) if part))
        self.undetermined = undetermined
        self.turns = turns


class ConvergenceError(AgonicError):
    """An iteration did not settle; `fit` holds the unfinished result."""

    def __init__(self, message: str, *, fit: Any = None):
        super().__init__(message)
        self.fit = fit


class ValidityError(AgonicError):
    """A calibration was used outside the range it was made for; `mask` marks the rows."""

    def __init__(self, message: str, *, mask: Any = None):
        super().__init__(message)
        self.mask = mask


class MissingExtraError(AgonicError):
    """An optional package is needed for what was asked; `extra` names it."""

    def __init__(self, what: str, extra: str):
        super().__init__(f"{what} needs an optional part: pip install 'agonic[{extra}]'")
        self.extra = extra


class AgonicWarning(UserWarning):
    """Something the user should know although the work went on."""


def check_choice(name: str, given: str, choices: tuple[str, ...]) -> None:
    """Raise `AgonicError` where a setting is not one of its choices."""
    if given not in choices:
        raise AgonicError(f"{name} {given!r} is not known; use one of {', '.join(choices)}")
