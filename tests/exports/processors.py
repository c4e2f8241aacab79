"""Processors in emulators: what is exported, compiled for each and run there.

Debian: qemu-system-arm gcc-arm-none-eabi libnewlib-arm-none-eabi qemu-system-misc
gcc-riscv64-unknown-elf picolibc-riscv64-unknown-elf simavr gcc-avr avr-libc.
"""

from __future__ import annotations

import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

from tests.exports.objects import compile_once

BOARDS = Path(__file__).parent / "boards"
STRICT = (
    "-std=c99",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
)
SMALL = ("-Os", "-ffunction-sections", "-fdata-sections")
LONGEST_S = 60.0


@dataclass(frozen=True, kw_only=True)
class Processor:
    """A processor, its compiler, and the emulator that runs it; `size` is that of binutils.

    `memory` (flash, its bytes, ram, its bytes) for the linker; `tick` instructions of its counter.
    """

    compiler: str
    flags: tuple[str, ...]
    board: str
    emulator: tuple[str, ...]
    memory: tuple[str, ...] = ()
    libraries: tuple[str, ...] = ("-lm",)

    @property
    def missing(self) -> str | None:
        """What is not installed here."""
        absent = [tool for tool in (self.compiler, self.emulator[0]) if not shutil.which(tool)]
        return f"{' and '.join(absent)} not installed" if absent else None

    def build(self, folder: Path, *sources: str) -> Path:
        """The program of sources in a folder; every warning is an error but in the board's own."""
        objects = [self._compile(folder / source, STRICT) for source in sources]
        objects += [self._compile(BOARDS / file, ("-std=gnu99",), folder) for file in self._own]
        program = folder / f"program-{self.board}-{self.compiler.split('-')[0]}"
        command = [self.compiler, *self.flags, *SMALL, *objects, *self._link]
        subprocess.run([*command, *self.libraries, "-o", program], check=True)
        return program

    @property
    def _own(self) -> tuple[str, str]:
        return ("board.c", f"board_{self.board}.c")

    @property
    def _link(self) -> list[str]:
        if not self.memory:
            return ["-Wl,--gc-sections"]
        names = ("FLASH", "FLASH_SIZE", "RAM", "RAM_SIZE")
        defined = [f"-Wl,--defsym={n}={v}" for n, v in zip(names, self.memory, strict=True)]
        return ["-nostartfiles", "-Wl,--gc-sections", *defined, f"-T{BOARDS / 'board.ld'}"]

    def _compile(self, source: Path, flags: tuple[str, ...], folder: Path | None = None) -> Path:
        """An object beside its source, or in a folder."""
        target = (folder or source.parent) / f"{source.stem}-{self.board}.o"
        command = [self.compiler, *SMALL, *flags, *self.flags, "-I", BOARDS]
        return compile_once(command, source, target)

    def run(self, program: Path) -> dict[str, int]:
        """The numbers that a program tells, by name; `end` is its status, 99 after a trap."""
        command = [*self.emulator, program]
        done = subprocess.run(
            command, capture_output=True, text=True, timeout=LONGEST_S, check=False
        )
        said = re.sub(r"\x1b\[\d*m", "", done.stdout + done.stderr)
        assert "trap" not in said, said
        return {name: int(value) for name, value in re.findall(r"^([a-z_]+) (-?\d+)\b", said, re.M)}

    def measure(self, folder: Path, source: str) -> tuple[int, int]:
        """Bytes of flash and of ram that the object of a source takes."""
        return self.measure_file(folder / f"{Path(source).stem}-{self.board}.o")

    def measure_file(self, file: Path) -> tuple[int, int]:
        """The same of an object or a program."""
        tool = self.compiler.replace("gcc", "size")
        shown = subprocess.run([tool, file], capture_output=True, text=True, check=True).stdout
        text, data, bss = map(int, shown.splitlines()[1].split()[:3])
        return text + data, data + bss


QEMU = ("-display", "none", "-icount", "shift=0", "-semihosting", "-kernel")
PROCESSORS = {
    "Cortex-M0+": Processor(
        compiler="arm-none-eabi-gcc",
        flags=("-mcpu=cortex-m0plus", "-mthumb", "--specs=nano.specs", "-DTICK=62"),
        board="arm",
        emulator=("qemu-system-arm", "-M", "microbit", *QEMU),
        memory=("0x0", "256K", "0x20000000", "16K"),
    ),
    "Cortex-M4F": Processor(
        compiler="arm-none-eabi-gcc",
        flags=(
            *("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16"),
            *("--specs=nano.specs", "-DTICK=40"),
        ),
        board="arm",
        emulator=("qemu-system-arm", "-M", "mps2-an386", *QEMU),
        memory=("0x0", "4M", "0x20000000", "4M"),
    ),
    "RISC-V 32": Processor(
        compiler="riscv64-unknown-elf-gcc",
        flags=("-march=rv32imac", "-mabi=ilp32", "--specs=picolibc.specs"),
        board="riscv",
        emulator=("qemu-system-riscv32", "-M", "virt", "-bios", "none", *QEMU),
        memory=("0x80000000", "1M", "0x80100000", "64K"),
    ),
    "ATmega328P": Processor(
        compiler="avr-gcc",
        flags=("-mmcu=atmega328p", "-Wno-double-promotion"),  # double is float there
        board="avr",
        emulator=("simavr", "-m", "atmega328p", "-f", "16000000"),
    ),
}
"""By name; the count of AVR is of cycles, that of the others of instructions."""
