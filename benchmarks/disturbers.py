"""What the vehicle does, taken out: python -m benchmarks.disturbers [--draws 40] [--quick]."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import NamedTuple

import numpy as np

import agonic as ag
from agonic.attitude.disturbers.choice import choose_sources, judge_disturbers
from agonic.attitude.problem import Settings
from agonic.calibration.sources import list_columns, name_sources
from agonic.calibration.timing import follow
from agonic.maths.rotations import tilt as kernel
from agonic.maths.rotations.attitude import rot_nb
from agonic.simulation import simulate, simulate_vehicle
from agonic.simulation.draws import draw_motors
from benchmarks import tables

RECORDINGS = Path(os.environ.get("AGONIC_RECORDINGS", "../shared/recordings"))
FLIGHT = RECORDINGS / "vehicle" / "ardupilot" / "log171.bin"
FLOWN_S = (84.0, 236.0)
BLOCKS = 8
OUTPUTS = tuple(f"output{k}_duty^1.5" for k in (1, 2, 3, 4))
NOISE = 100.0


class Scene(NamedTuple):
    """Samples, the field of the place, and what disturbs in truth."""

    samples: ag.Samples
    reference: ag.Reference
    sources: tuple[str, ...]
    added: np.ndarray


def fly_quadrotor(seed: int) -> Scene:
    """Four motors with leads of their own, two minutes, roll and pitch of a filter."""
    made = simulate_vehicle(
        n=6000, sensors=1, noise=NOISE, stray_nT_A=(0.0, 0.0, 0.0), heading_sd_deg=None,
        motors_nT=draw_motors(4, seed), seed=seed,
    )  # fmt: skip
    samples, truth = made.samples[0].with_columns(current_A=None, throttle=None), made.truths[0]
    return Scene(
        samples, ag.wmm().along(samples), truth.sources[1:],
        truth.coefficients[:, 1:],
    )  # fmt: skip


def sail_boat(seed: int) -> Scene:
    """An alternator whose current goes in steps with the engine."""
    rng = np.random.default_rng(seed)
    made = simulate("boat", n=6000, noise=NOISE, seed=seed)
    drawn = np.repeat(rng.uniform(5.0, 40.0, 30), 200) + rng.normal(0.0, 0.3, 6000)
    added = rng.normal(0.0, 60.0, (3, 1))
    quiet = made.samples
    samples = quiet.with_columns(
        field=quiet.field + drawn[:, None] @ added.T, disturbers={"alternator_A": drawn}
    )
    place = ag.Reference.vector(made.field_n, frame="n")
    return Scene(samples, place, ("alternator_A",), added)


def fly_satellite(seed: int) -> Scene:
    """Three torquers that are commanded every ten seconds, two strings of panels in the sun."""
    rng = np.random.default_rng(seed)
    made = simulate("tumble", n=6000, rate_Hz=1.0, pace_s=400.0, noise=NOISE, seed=seed)
    quiet = made.samples
    sun = rng.normal(size=3)
    turn = rot_nb(quiet.roll_deg, quiet.pitch_deg, quiet.heading_deg)
    body = turn.transpose(0, 2, 1) @ (sun / np.linalg.norm(sun))
    lit = (np.arange(6000) % 5400) < 3500
    columns = {f"torquer_{a}_Am2": np.repeat(rng.uniform(-1, 1, 600), 10) for a in "xyz"}
    columns |= {
        f"string{k + 1}_A": lit * np.maximum(side * body[:, 0], 0.0) * 1.5
        + 0.02 * rng.normal(size=6000)
        for k, side in enumerate((1.0, -1.0))
    }
    added = rng.normal(0.0, 700.0, (3, 5))
    field = quiet.field + np.stack([*columns.values()], axis=1) @ added.T
    samples = quiet.with_columns(
        field=field, disturbers=columns, roll_deg=None, pitch_deg=None, heading_deg=None,
        acceleration=None, rotation_rate=None,
    )  # fmt: skip
    return Scene(samples, ag.Reference.constant(50_000.0), tuple(columns), added)


SCENES: dict[str, Callable[[int], Scene]] = {
    "quadrotor, four motors": fly_quadrotor,
    "boat, alternator": sail_boat,
    "satellite, three torquers, two strings": fly_satellite,
}


def study(name: str, make: Callable[[int], Scene], draws: int) -> list[str]:
    """A row: how often just these sources were taken, and errors over stated ones."""
    taken, ratios, sizes = 0, [], []
    for seed in range(draws):
        scene = make(seed)
        found = choose_sources(scene.samples, scene.reference, Settings())
        taken += set(list_columns(found.sources)) == set(list_columns(scene.sources))
        fit = ag.fit_interference(scene.samples, scene.reference, scene.sources)
        sd = fit.sd[-scene.added.size :].reshape(scene.added.shape)
        errors = fit.calibration.coefficients - scene.added
        ratios.append(errors / sd)
        sizes.append(sd)
        tables.progress(f"{name}: {seed + 1} of {draws}")
    ratio = np.concatenate([one.ravel() for one in ratios])
    spread = np.median(np.concatenate([one.ravel() for one in sizes]))
    return [
        name,
        f"{taken} of {draws}",
        f"{np.sqrt(np.mean(ratio**2)):.2f}",
        f"{ratio.mean():+.2f}",
        f"{spread:.2g} nT",
    ]


def study_shape(what: str, value: float, draws: int) -> list[str]:
    """A row: a heater whose current is recorded late or filtered, or whose field follows it."""
    found, ratios, sizes = 0, [], []
    for seed in range(draws):
        made = simulate("flight", n=3000, noise=NOISE, stray_nT_A=(0.0, 0.0, 0.0), seed=seed)
        quiet = made.samples.with_columns(current_A=None, throttle=None)
        drawn = np.repeat(np.random.default_rng(seed).uniform(0.0, 10.0, 200), 15)
        filtered = follow(quiet.time, drawn, abs(value))
        logged, acting = (filtered, drawn) if value > 0 else (drawn, filtered)
        if what == "delay":
            logged, acting = np.interp(quiet.time - value, quiet.time, drawn), drawn
        samples = quiet.with_columns(
            field=quiet.field + acting[:, None] * [300.0, -200.0, 400.0],
            disturbers={"heater_A": logged},
        )
        place = ag.Reference.vector(made.field_n, frame="n")
        shapes = choose_sources(samples, place, Settings()).shapes
        told = [one for one in shapes if one.what == what]
        found += len(told) == len(shapes) == 1
        ratios += [(one.value - value) / one.sd for one in told]
        sizes += [one.sd for one in told]
        tables.progress(f"{what} of {value:g} s: {seed + 1} of {draws}")
    rms = np.sqrt(np.mean(np.square(ratios)))
    named = f"{what} of {value:g} s"
    return [named, f"{found} of {draws}", f"{rms:.2f}", f"{1e3 * np.median(sizes):.1f} ms"]


def study_confounded(draws: int) -> list[str]:
    """A throttle that follows the pitch and a current that follows the heading: both do nothing."""
    taken, named, naive = 0, 0, []
    for seed in range(draws):
        flown = simulate("flight", n=3000, noise=NOISE, stray_nT_A=(0.0, 0.0, 0.0), seed=seed)
        quiet = flown.samples.with_columns(current_A=None, throttle=None)
        columns = {
            "motor1_duty": 0.5 + 0.02 * quiet.pitch_deg,
            "esc1_A": 12.0 + 4.0 * np.cos(np.radians(quiet.heading_deg)),
        }
        samples = quiet.with_columns(disturbers=columns)
        place = ag.Reference.vector(flown.field_n, frame="n")
        taken += bool(choose_sources(samples, place, Settings()).sources)
        named += all(one.move for one in judge_disturbers(samples, noise=NOISE))
        sphere = np.linalg.norm(samples.field - flown.truth.bias, axis=1)
        basis = np.column_stack([np.ones(len(samples)), columns["esc1_A"]])
        naive.append(abs(np.linalg.lstsq(basis, sphere, rcond=None)[0][1]) * np.ptp(basis[:, 1]))
    return [f"{taken} of {draws}", f"{named} of {draws}", f"{np.median(naive):.0f} nT"]


def compare_flight() -> Iterable[list[str]]:
    """Held-out headings of the two inner compasses of a quadrotor against the outer one."""
    sensors = [ag.read(FLIGHT, name) for name in ("MAG", "MAG2", "MAG3")]
    flown = [s.select((s.time > FLOWN_S[0]) & (s.time < FLOWN_S[1])) for s in sensors]
    outer, *inner = flown
    ahead = np.unwrap(np.radians(_heading(outer, ag.fit_levelled(outer, ag.igrf().along(outer)))))
    for samples in inner:
        reference = ag.igrf().along(samples)
        chosen = choose_sources(samples, reference, Settings()).sources
        wanted = np.interp(samples.time, outer.time, ahead)
        for what, sources in {
            "iron alone": (),
            "battery’s current": ("current_A",),
            "sum of the motors^1.5": ("+".join(o.split("^")[0] for o in OUTPUTS) + "^1.5",),
            "four motors^1.5": OUTPUTS,
            "four motors^2.5": tuple(one.replace("1.5", "2.5") for one in OUTPUTS),
            f"chosen: {name_sources(chosen)}": chosen,
        }.items():
            row = [samples.name, what]
            for run in (ag.fit_levelled, ag.fit_vector):
                error, spread = _judge(samples, reference, sources, wanted, run)
                row += [f"{error:.2f}°", f"{100 * spread:.2f} %"]
            yield row


def _judge(
    samples: ag.Samples,
    reference: ag.Reference,
    sources: tuple[str, ...],
    wanted: np.ndarray,
    run: Callable[..., ag.Fit],
) -> tuple[float, float]:
    """rms of the heading about its mean, and spread of the magnitude, on the other blocks."""
    block = np.floor(BLOCKS * (samples.time - samples.time[0]) / np.ptp(samples.time)).astype(int)
    apart, spread = [], []
    for side in (0, 1):
        seen, other = block % 2 == side, np.flatnonzero(block % 2 != side)
        rows = np.flatnonzero(seen)
        fit = run(samples.select(rows), reference.select(rows), sources=sources)
        unseen = samples.select(other)
        off = np.radians(_heading(unseen, fit)) - wanted[other]
        middle = np.angle(np.exp(1j * off).mean())
        apart.append(np.degrees(np.angle(np.exp(1j * (off - middle)))))
        size = np.linalg.norm(ag.apply(fit.calibration, unseen).field, axis=1)
        spread.append(size / reference.magnitudes(len(samples))[other] - 1)
    return tuple(float(np.sqrt(np.mean(np.concatenate(x) ** 2))) for x in (apart, spread))


def _heading(samples: ag.Samples, fit: ag.Fit) -> np.ndarray:
    tilt = kernel.tilt_from_angles(samples.roll_deg, samples.pitch_deg)
    return kernel.heading_deg(ag.apply(fit.calibration, samples).field, tilt)


def main() -> None:
    """The tables."""
    asked = tables.arguments(__doc__, 20)
    draws = 3 if asked.quick else asked.draws
    print(
        f"""Simulated, 100 nT of noise, {draws} draws: how often just the true disturbers were
taken, of all that was recorded; what each adds per unit, error over standard error, rms and mean;
the median standard error.
"""
    )
    head = ("vehicle", "taken", "error/sd, rms", "mean", "sd")
    print(tables.markdown(head, [study(name, make, draws) for name, make in SCENES.items()]))
    print(
        """
A heater behind a sensor that is late or filtered, or whose field follows its current (negative):
how often that was found, and nothing else; error over standard error, rms; the median standard
error. Twice as many draws.
"""
    )
    cases = (("delay", 0.2), ("time constant", 0.3), ("time constant", -0.6))
    rows = [study_shape(*case, 2 * draws) for case in cases]
    print(tables.markdown(("shape", "found", "error/sd, rms", "sd"), rows))
    confounded = study_confounded(draws)
    print(
        f"""
A motor's duty that only follows the pitch and a current that only follows the heading, as in a
climb and against the wind: taken in {confounded[0]} draws, named by `plan disturbers` in
{confounded[1]}; a plain regression of the magnitude on the current finds {confounded[2]}."""
    )
    if FLIGHT.is_file():
        print(
            """
A quadrotor in flight (log171, 84 to 236 s): headings of its inner compasses against the outer one,
rms about their mean, and spread of the magnitude, on alternate eighths that were not fitted; the
battery's current, and pulses of the four outputs were logged. Fitted by roll and pitch, as
`calibrate` does, and by the autopilot's heading too, which follows the outer compass.
"""
        )
        told = ("heading", "magnitude", "heading, aided by heading", "magnitude")
        head = ("compass", "disturbers", *told)
        print(tables.markdown(head, compare_flight()))


if __name__ == "__main__":
    main()
