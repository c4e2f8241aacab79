"""A scalar magnetometer beside a vector one: nine numbers of the vector sensor by its readings."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.cli import run
from agonic.fit import Fit
from tests.command_line import answer

Array = NDArray[np.float64]
ARCSEC = np.degrees(1) * 3600
N = 3000
NOISE, SCALAR_NOISE = 0.3, 0.1  # nT
PACKED = ([0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2])


def orbit_field(t: Array) -> Array:
    """The magnitude on the way of a satellite, nT."""
    return 45_000 + 8_000 * np.sin(2 * np.pi * t / 5600) + 20 * np.sin(2 * np.pi * t / 300)


def record(
    seed: int, *, offset: float = 0.0, delay_s: float = 0.0, moving: bool = True
) -> tuple[Array, Array, Array, Array]:
    """Times, readings, scalar readings and the nine numbers, of Ørsted's three kinds: offsets,
    scale values, angles between the axes (Olsen et al. 2003, equation 2)."""
    rng = np.random.default_rng(seed)
    t = np.arange(float(N))
    paces, begins, sizes = (rng.uniform(*at, (3, 4)) for at in ((3e-3, 0.02), (0, 6.3), (0.5, 2)))
    turns = [
        sum(1.2 * s * np.sin(2 * np.pi * p * t + b) for s, p, b in zip(*each, strict=True))
        for each in zip(sizes, paces, begins, strict=True)
    ]

    def size(time: Array) -> Array:
        return orbit_field(time) if moving else np.full(len(time), 45_000.0)

    way = Rotation.from_rotvec(np.stack(turns, axis=1)).apply(np.tile([0.6, 0.0, 0.8], (N, 1)))
    a, b, c = np.radians(rng.normal(size=3) * 0.1)
    skewed = [
        [1, 0, 0],
        [-np.sin(a), np.cos(a), 0],
        [np.sin(b), np.sin(c), np.sqrt(1 - np.sin(b) ** 2 - np.sin(c) ** 2)],
    ]
    gains = np.diag(1 + 2e-3 * rng.normal(size=3)) @ skewed
    bias = 50 * rng.normal(size=3)
    raw = size(t)[:, None] * way @ gains.T + bias + NOISE * rng.normal(size=(N, 3))
    scalar = size(t - delay_s) + offset + SCALAR_NOISE * rng.normal(size=N)
    inverse = np.linalg.inv(gains)
    values, axes = np.linalg.eigh(inverse.T @ inverse)
    return t, raw, scalar, np.r_[bias, ((axes * np.sqrt(values)) @ axes.T)[PACKED]]


def fit_scalar(t: Array, raw: Array, scalar: Array, sd: float) -> Fit:
    samples = ag.Samples(time=t, field=raw, unit="nT")
    return ag.fit_ellipsoid(samples, ag.Reference.magnitude(scalar, sd=sd))


def numbers(fit: Fit) -> Array:
    return np.r_[fit.calibration.bias, fit.calibration.matrix[PACKED]]


def said(fit: Fit, what: str) -> tuple[float, float]:
    """A number and its standard error in what is said of a fit."""
    found = re.search(
        rf"{what} of the scalar instrument is (-?[\d.]+) ± ([\d.]+)", " ".join(fit.remarks)
    )
    assert found is not None, fit.remarks
    return float(found[1]), float(found[2])


def check_honest(z: Array) -> None:
    """Errors over their standard errors (k, m) have a mean of 0 and a spread of 1, or less where
    they are of one sign for all gains."""
    k = len(z)
    assert np.abs(z.mean(axis=0)).max() < 3.3 / np.sqrt(k)
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1.0, abs=0.35)


def test_nine_numbers_to_a_tenth_of_a_nanotesla_and_to_arcseconds() -> None:
    errors, z = [], []
    for seed in range(16):
        t, raw, scalar, truth = record(seed, offset=0.1 * np.random.default_rng(seed).normal())
        fit = fit_scalar(t, raw, scalar, 0.1)
        assert fit.verdict == "good", fit.status
        errors.append(numbers(fit) - truth)
        z.append(errors[-1] / fit.sd)
    off = np.abs(errors).max(axis=0)
    assert off[:3].max() < 0.1  # nT
    assert off[6:].max() * ARCSEC < 1.0
    assert off[3:6].max() < 1e-5  # 0.45 nT of the whole field, an offset of the scalar's and noise
    check_honest(np.array(z))


def test_what_the_scalar_is_off_by_is_found_where_the_field_changes() -> None:
    z, offsets, delays = [], [], []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        offset, delay_s = 3 * rng.normal(), 0.2 * rng.normal()
        t, raw, scalar, truth = record(40 + seed, offset=offset, delay_s=delay_s)
        fit = fit_scalar(t, raw, scalar, 3.0)
        assert fit.verdict == "good", fit.status
        z.append((numbers(fit) - truth) / fit.sd)
        found, sd = said(fit, "offset")
        assert sd < 0.2  # nT
        offsets.append((found - offset) / sd)
        found, sd = said(fit, "delay")
        assert sd < 2.0  # ms
        delays.append((found - 1e3 * delay_s) / sd)
    check_honest(np.array(z))
    for each in (offsets, delays):
        check_honest(np.array(each)[:, None])


def test_in_a_constant_field_nothing_is_learnt_of_an_offset() -> None:
    t, raw, scalar, truth = record(3, offset=0.8, moving=False)
    fit = fit_scalar(t, raw, scalar, 0.5)
    assert fit.verdict == "good"
    assert np.abs((numbers(fit) - truth) / fit.sd).max() < 3
    assert said(fit, "offset")[1] == pytest.approx(0.5, rel=0.05)


def test_without_its_terms_the_same_fit_would_be_wrong() -> None:
    """The offset is seen by its term: taken for exact, it goes into the gains, many errors far."""
    t, raw, scalar, truth = record(4, offset=4.0)
    exact, known = (fit_scalar(t, raw, scalar, sd) for sd in (0.0, 5.0))
    assert np.abs((numbers(exact) - truth) / exact.sd)[3:6].min() > 8
    assert np.abs((numbers(known) - truth) / known.sd).max() < 4


@pytest.mark.parametrize("seed", [0, 1])
def test_what_is_not_the_field_is_refused(seed: int) -> None:
    t, raw, scalar, _ = record(seed)
    drawn = np.random.default_rng(seed).permutation(scalar)
    for wrong in (45_000 + 1_000 * np.sin(t / 77), drawn):
        fit = fit_scalar(t, raw, wrong, 0.5)
        assert fit.verdict == "refused"
        assert "not those of the field at the sensor" in fit.status
    t, raw, scalar, _ = record(seed, moving=False)
    fit = fit_scalar(t, raw, scalar + 100 * np.sin(t / 77), 0.5)
    assert fit.verdict == "refused"


def test_a_noisy_scalar_in_a_constant_field_is_no_fault() -> None:
    """1 nT of noise beside a vector of 0.3 nT: its mean counts."""
    t, raw, scalar, truth = record(6, moving=False)
    fit = fit_scalar(t, raw, scalar + np.random.default_rng(6).normal(size=N), 0.5)
    assert fit.verdict == "good", fit.status
    assert np.abs((numbers(fit) - truth) / fit.sd).max() < 3


def write(path: Path, header: str, *columns: Array) -> Path:
    rows = (
        ",".join("" if np.isnan(v) else f"{v:.4f}" for v in row)
        for row in zip(*columns, strict=True)
    )
    path.write_text("\n".join([header, *rows]) + "\n")
    return path


VECTOR = "time_s,mag_x_nT,mag_y_nT,mag_z_nT"


@pytest.fixture(scope="module")
def recorded() -> tuple[Array, Array, Array, Array]:
    return record(5, offset=0.4, delay_s=0.15)


@pytest.mark.parametrize("how", ["known name", "column", "table", "slower", "held", "with a gap"])
def test_columns_and_tables_of_a_scalar_instrument(
    how: str, recorded: tuple[Array, Array, Array, Array], tmp_path: Path, capsys
) -> None:
    t, raw, scalar, truth = recorded
    every = np.full(N, np.nan)
    every[::5] = scalar[::5]
    gap = np.where((t > 1000) & (t < 1600), np.nan, scalar)
    log, options, rows = tmp_path / "log.csv", [], N
    if how == "column":
        write(log, f"{VECTOR},F_ovh_nT", t, *raw.T, scalar)
        options = ["--scalar", "F_ovh_nT"]
    elif how == "table":
        at = t[::4] + 0.3
        write(log, VECTOR, t, *raw.T)
        own = write(tmp_path / "ovh.csv", "time_s,F_uT", at, np.interp(at, t, scalar) / 1000)
        options, rows = ["--scalar", f"{own}:F_uT"], N - 4
    else:
        other = {"slower": every, "held": np.repeat(scalar[::5], 5), "with a gap": gap}
        write(log, f"{VECTOR},scalar_nT", t, *raw.T, other.get(how, scalar))
        rows = {"slower": N - 4, "held": N - 4, "with a gap": N - 599}.get(how, N)
    _, made = answer(capsys, "fit", "ellipsoid", str(log), *options)
    assert (made["verdict"], made["n"]) == ("good", rows)
    assert np.abs(np.array(made["bias_nT"]) - truth[:3]).max() < 0.1
    matrix = np.array(made["matrix"])[PACKED]
    assert np.abs(matrix - truth[3:]).max() * ARCSEC < 2.5  # 1e-5 of a gain
    late = re.search(r"delay of the scalar instrument is ([\d.]+) ±", made["status"])
    assert late is not None
    assert float(late[1]) == pytest.approx(150, abs=6 if how == "table" else 4)


BAD = {
    "dead": (lambda raw, scalar: np.full(N, 47_000.0), "nT", "reads 47000 nT in all 3000 rows"),
    "off": (lambda raw, scalar: np.zeros(N), "nT", "nothing above zero"),
    "stuck": (lambda raw, scalar: np.where(np.arange(N) < 600, 5e4, scalar), "nT", "on end"),
    "unit": (lambda raw, scalar: scalar, "uT", "1000 times too large"),
    "no unit": (lambda raw, scalar: scalar, "", "its header names no unit"),
    "itself": (lambda raw, scalar: np.linalg.norm(raw, axis=1), "nT", "of the vector itself"),
}


@pytest.mark.parametrize("why", BAD)
def test_a_scalar_that_is_none_is_refused_in_a_sentence(
    why: str, recorded: tuple[Array, Array, Array, Array], tmp_path: Path, capsys
) -> None:
    t, raw, scalar, _ = recorded
    make, unit, text = BAD[why]
    header = f"F_{unit}" if unit else "F"
    log = write(tmp_path / "log.csv", f"{VECTOR},{header}", t, *raw.T, make(raw, scalar))
    for command in (["fit", "ellipsoid"], ["calibrate"]):
        out = ["-o", str(tmp_path / "made")]
        assert run([*command, str(log), "--scalar", header, *out]) == 2
        assert text in capsys.readouterr().err
    assert run(["fit", "ellipsoid", str(log), "--scalar", "G_nT"]) == 2
    assert "--scalar names 'G_nT'; the columns are" in capsys.readouterr().err


def test_calibrate_takes_it_unless_a_place_is_given(
    recorded: tuple[Array, Array, Array, Array], tmp_path: Path, capsys
) -> None:
    t, raw, scalar, truth = recorded
    log = write(tmp_path / "log.csv", f"{VECTOR},scalar_nT", t, *raw.T, scalar)
    out = str(tmp_path / "made")
    made = answer(capsys, "calibrate", str(log), "-o", out)[1]["sensors"][0]
    assert made["verdict"] == "good"
    assert np.abs(np.array(made["bias_nT"]) - truth[:3]).max() < 0.1
    for options in (["--scalar", "none"], ["--field", "45000"]):
        assert run(["calibrate", str(log), "-o", out, "--json", *options]) == 1
        assert "scalar instrument" not in capsys.readouterr().out


def test_swarm_and_its_scalar_instrument(recordings: Path) -> None:
    """The field of Swarm A turned into a made-up sensor of known numbers, and its own ASM."""
    real = ag.read(recordings / "orbit/swarmA_MAGA_LR_1B_20160101_10s.cdf")
    assert real.scalar is not None
    rng = np.random.default_rng(1)
    turned = Rotation.random(len(real), random_state=1).apply(real.field.copy())
    gains = np.diag(1 + 1e-3 * rng.normal(size=3)) + np.tril(3e-4 * rng.normal(size=(3, 3)), -1)
    bias = 50 * rng.normal(size=3)
    samples = ag.Samples(time=real.time, field=turned @ gains.T + bias, unit="nT")
    fit = ag.fit_ellipsoid(samples, ag.Reference.magnitude(real.scalar, sd=0.5))
    assert fit.verdict == "good", fit.status
    assert np.abs(fit.calibration.bias - bias).max() < 0.1
    inverse = np.linalg.inv(gains)
    square = fit.calibration.matrix.T @ fit.calibration.matrix - inverse.T @ inverse
    assert np.abs(square[np.triu_indices(3, 1)]).max() / 2 * ARCSEC < 1.0
