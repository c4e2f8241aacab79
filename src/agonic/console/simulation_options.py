"""Options that several kinds of `agonic simulate` share."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Table = Annotated[Path, typer.Option("-o", "--out", metavar="FILE", help="CSV file to write.")]
Folder = Annotated[Path, typer.Option("-o", "--out", metavar="DIR", help="Folder to write to.")]
Readings = Annotated[int, typer.Option("-n", help="Readings.", min=1)]
Noise = Annotated[float, typer.Option(help="Noise per axis, nT.", min=0)]
Step = Annotated[float, typer.Option(help="Quantisation, nT; 0 for none.", min=0)]
Format = Annotated[str, typer.Option(help="csv or parquet.")]
Seed = Annotated[int, typer.Option(help="Seed of everything random.", min=0)]
