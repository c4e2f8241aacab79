"""The tables in the C header of a network, beside its weights."""

from __future__ import annotations

import numpy as np

from agonic.calibration.affine import Affine
from agonic.calibration.network import Network
from agonic.exports.c_network.parts import Parts
from agonic.exports.firmware.c_text import write_array, write_literal


def write_affine_table(step: Affine | None, name: str, words: str) -> str:
    """A step of a chain beside the network; nothing where there is none."""
    if step is None:
        return ""
    return (
        f"\n/* {words}: matrix (raw - bias); bias, then the matrix row by row. */\n"
        f"static const float {name}[4][3] = {write_array(np.vstack([step.bias, step.matrix]))};\n"
    )


def write_base_table(parts: Parts, name: str) -> str:
    """What the network adds to; nothing where it stands alone."""
    if parts.base is None:
        return ""
    table = parts.table
    names = ", ".join(parts.base.signals)
    more = f", and what a unit of {names} adds to each axis" if names else ""
    text = (
        f"\n/* The base: bias (3), matrix (9) row by row{more};\n"
        "   a row a power of the temperature. */\n"
        f"static const float {name}_base[{len(table)}][{table.shape[1]}] AGONIC_FLASH = "
        f"{write_array(table)};\n"
    )
    if parts.warm:
        scale = [parts.base.centre_C, parts.base.half_range_C, *parts.base.clamp_C]
        text += (
            "\n/* Its temperature, degrees C: centre and half range, least and largest. */\n"
            f"static const float {name}_base_C[4] = {write_array(scale)};\n"
        )
    return text


def write_second_table(network: Network, name: str) -> str:
    """The weights of a second hidden layer; nothing where there is none."""
    if network.second is None:
        return ""
    rows, columns = network.second.shape
    return (
        f"static const float {name}_W[{rows}][{columns}] AGONIC_FLASH = "
        f"{write_array(network.second)};\n"
    )


def write_guard_table(parts: Parts, name: str) -> str:
    """Where it was trained."""
    network = parts.network
    text = (
        "\n/* Points that cover what it was trained on, and the reach about them. */\n"
        f"static const float {name}_centres[{len(network.centres)}][{network.shape.inputs}] "
        f"AGONIC_FLASH = {write_array(network.centres)};\n"
        f"static const float {name}_reach = {write_literal(network.reach)};\n"
    )
    if network.base is None:
        return text
    assert network.bound is not None
    return (
        f"{text}/* The longest correction, {network.unit_out}. */\n"
        f"static const float {name}_bound = {write_literal(network.bound)};\n"
    )
