"""Options that the commands of this wing share."""

from __future__ import annotations

from typing import Annotated

import typer

Solve = Annotated[
    str, typer.Option(metavar="LIST", help="Besides the alignment: reference, pier, bias, matrix.")
]
Wanted = Annotated[
    float, typer.Option(metavar="ARCSEC", help="Standard error wanted about every axis.")
]
