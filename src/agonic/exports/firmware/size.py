"""`Size`: how much a controller must hold, measured on a compiled object."""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory

COMPILERS = {
    "arm-none-eabi-gcc": (
        "-mcpu=cortex-m4",
        "-mthumb",
        "-mfloat-abi=hard",
        "-mfpu=fpv4-sp-d16",
    ),
    "cc": (),
}
"""Compilers in the order they are looked for, and what makes them aim at a usual controller."""


@dataclass(frozen=True, kw_only=True)
class Size:
    """Bytes of code, of constants, and of variables that outlive a call; by which compiler."""

    code: int
    constants: int
    variables: int
    compiler: str


def measure_sizes(source: Path) -> Size | None:
    """The size of one C file compiled for size; `None` without compiler or where it fails."""
    for compiler, flags in COMPILERS.items():
        reader = "arm-none-eabi-size" if compiler.startswith("arm") else "size"
        if shutil.which(compiler) and shutil.which(reader):
            sections = _sections(source, compiler, flags, reader)
            if sections:
                return _size(sections, " ".join([compiler, *flags, "-Os"]))
    return None


def _sections(source: Path, compiler: str, flags: tuple[str, ...], reader: str) -> dict[str, int]:
    """The bytes of each section of the object."""
    with TemporaryDirectory() as folder:
        target = str(Path(folder, "object.o"))
        compile_it = [compiler, *flags, "-std=c99", "-Os", "-c", str(source), "-o", target]
        try:
            subprocess.run(compile_it, check=True, capture_output=True, timeout=60)
            done = subprocess.run(
                [reader, "-A", target], check=True, capture_output=True, text=True, timeout=60
            )
        except (OSError, subprocess.SubprocessError):
            return {}
    return {name: int(size) for name, size in re.findall(r"^(\.\S+)\s+(\d+)", done.stdout, re.M)}


def _size(sections: dict[str, int], compiler: str) -> Size:
    def total(*starts: str) -> int:
        return sum(size for name, size in sections.items() if name.startswith(starts))

    return Size(
        code=total(".text"),
        constants=total(".rodata"),
        variables=total(".data", ".bss"),
        compiler=compiler,
    )
