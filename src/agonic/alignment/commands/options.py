"""Options that the commands of this wing share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Out = Annotated[
    Path | None, typer.Option("-o", "--out", metavar="CAL", help="Calibration file to write.")
]
Report = Annotated[
    Path | None, typer.Option(metavar="FILE", help="Report to write, .html or .txt.")
]
Solve = Annotated[
    str, typer.Option(metavar="LIST", help="Besides the alignment: reference, pier, bias, matrix.")
]
Wanted = Annotated[
    float, typer.Option(metavar="ARCSEC", help="Standard error wanted about every axis.")
]
