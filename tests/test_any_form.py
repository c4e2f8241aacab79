"""Readings in the form that people have them in; anything else is told what is needed."""

from datetime import UTC, datetime, timedelta, timezone
from typing import Any

import numpy as np
import pytest

import agonic as ag
from agonic.simulation import simulate

SAMPLES = simulate("tumble", n=600, seed=3).samples
FIELD = SAMPLES.field
EXPECTED = ag.fit_ellipsoid(SAMPLES, ag.Reference.constant(50_000)).calibration.bias
T0 = datetime(2026, 5, 1, 12, 0, 0, 250_000)


def table(unit: str = "nT", scale: float = 1.0) -> dict[str, np.ndarray]:
    return {f"mag_{axis}_{unit}": FIELD[:, k] * scale for k, axis in enumerate("xyz")}


@pytest.mark.parametrize("given", [FIELD, FIELD.tolist(), table(), table("uT", 1e-3)])
def test_arrays_lists_and_columns_give_the_fit_of_samples(given: Any) -> None:
    unit = None if isinstance(given, dict) else "nT"
    found = ag.fit_ellipsoid(given, 50_000, unit=unit)
    assert found.calibration.bias == pytest.approx(EXPECTED, abs=1.0)


def test_a_frame_of_pandas_with_moments_as_its_index() -> None:
    pandas = pytest.importorskip("pandas")
    index = pandas.date_range("2026-05-01", periods=len(FIELD), freq="50ms", tz="Europe/Berlin")
    frame = pandas.DataFrame(table(), index=index)
    found = ag.calibrate(frame, 50_000.0)
    assert found.fit.calibration.bias == pytest.approx(EXPECTED, abs=1.0)
    assert found.samples.duration_s == pytest.approx(0.05 * (len(FIELD) - 1))
    bare = pandas.DataFrame(FIELD, columns=["a", "b", "c"])
    assert ag.fit_ellipsoid(bare, 50_000, unit="nT").ok


def test_a_path_is_read(tmp_path: Any) -> None:
    path = ag.write_csv(SAMPLES, tmp_path / "log.csv")
    for given in (path, str(path)):
        found = ag.calibrate(given, 50_000)
        assert found.fit.calibration.bias == pytest.approx(EXPECTED, abs=1e-3)
        assert found.fit.calibration.provenance.inputs[0].name == "log.csv"


@pytest.mark.parametrize("unit", ["s", "ms", "us", "ns"])
def test_moments_are_read_in_their_own_unit(unit: str) -> None:
    times = np.datetime64(T0.replace(microsecond=0), unit) + np.arange(600) * np.timedelta64(2, "s")
    made = ag.Samples(field=FIELD, unit="nT", time=times)
    assert made.time == pytest.approx(2.0 * np.arange(600))
    assert made.epoch == datetime(2026, 5, 1, 12, tzinfo=UTC)


def test_moments_of_python_and_pandas() -> None:
    pandas = pytest.importorskip("pandas")
    east = timezone(timedelta(hours=2))
    naive = [T0 + timedelta(seconds=0.5 * k) for k in range(600)]
    zoned = [moment.replace(tzinfo=UTC).astimezone(east) for moment in naive]
    index = pandas.DatetimeIndex(naive)
    for times in (naive, zoned, index, index.tz_localize("UTC").tz_convert("Asia/Tokyo")):
        made = ag.Samples(field=FIELD, unit="nT", time=times)
        assert made.time == pytest.approx(0.25 + 0.5 * np.arange(600))
        assert made.epoch == datetime(2026, 5, 1, 12, tzinfo=UTC)
    given = datetime(2026, 5, 1, 11, tzinfo=UTC)
    assert ag.Samples(field=FIELD, unit="nT", time=index, epoch=given).time[0] == 3600.25
    spans = index - index[0]
    assert ag.Samples(field=FIELD, unit="nT", time=spans).time == pytest.approx(
        0.5 * np.arange(600)
    )


def test_a_moment_that_is_none_is_left_out_and_counted() -> None:
    times = np.datetime64(T0, "us") + np.arange(600) * np.timedelta64(1, "s")
    times[7] = np.datetime64("NaT", "us")
    made = ag.Samples(field=FIELD, unit="nT", time=times)
    assert len(made) == 599
    assert dict(made.rejected) == {"NaN or infinite time": 1}


@pytest.mark.parametrize(("scale", "unit"), [(1e-3, "uT"), (1e-5, "G"), (1e-2, "mG"), (1e-9, "T")])
def test_a_unit_is_asked_for_where_the_size_says_another(scale: float, unit: str) -> None:
    with pytest.raises(ag.UnitError, match=f"look like {unit}: give unit='{unit}'"):
        ag.Samples(field=FIELD * scale)
    assert ag.Samples(field=FIELD * scale, unit=unit).field == pytest.approx(FIELD)
    assert ag.Samples(field=FIELD * scale, unit="raw").unit == "raw"
    assert ag.Samples(field=FIELD).unit == "nT"


@pytest.mark.parametrize("scale", [1e-3, 1e-5, 1e3])
def test_readings_in_another_unit_are_not_corrected(scale: float) -> None:
    made = ag.fit_ellipsoid(SAMPLES, 50_000).calibration
    with pytest.raises(ag.UnitError, match="another unit"):
        made.correct(FIELD * scale)
    assert made.correct(FIELD[0]).shape == (3,)
    assert np.isfinite(made.correct(np.zeros(3))).all()


def test_what_follows_a_fit_takes_what_the_fit_took(tmp_path: Any) -> None:
    """Fits and files stand for calibrations, paths, frames and arrays for samples."""
    pandas = pytest.importorskip("pandas")
    fit = ag.fit_ellipsoid(SAMPLES, 50_000)
    log, mag = ag.write_csv(SAMPLES, tmp_path / "log.csv"), ag.save(fit, tmp_path / "mag.json")
    frame = pandas.DataFrame(table())
    expected = fit.calibration.correct(FIELD)
    for calibration in (fit, mag, str(mag), fit.calibration):
        assert ag.apply(calibration, FIELD) == pytest.approx(expected)
        assert ag.apply(calibration, log).field == pytest.approx(expected, rel=1e-3)
        applied = ag.apply(calibration, frame)
        assert list(applied) == list(frame)
        assert applied.to_numpy() == pytest.approx(expected)
        assert not ag.compare(calibration, fit).matters
        for samples in (log, str(log), frame, SAMPLES):
            assert ag.verify(calibration, samples, 50_000).passed
    assert fit.calibration(frame).equals(ag.apply(fit, frame))
    upright = SAMPLES.with_columns(roll_deg=0 * FIELD[:, 0], pitch_deg=0 * FIELD[:, 0])
    levelled = ag.write_csv(upright, tmp_path / "level.csv")
    setup = ag.Setup(compasses=(ag.Compass(calibration=fit.calibration),), declination_deg=0.0)
    found = ag.heading(levelled, ag.save_setup(setup, tmp_path / "setup.toml"))
    assert len(found.true_deg) == len(FIELD)


def test_a_magnitude_is_in_the_unit_of_the_readings() -> None:
    for given in (FIELD / 1e3, (FIELD / 1e3).tolist()):
        assert ag.fit_ellipsoid(given, 50, unit="uT").calibration.magnitude == 50_000
    with pytest.warns(ag.AgonicWarning, match="give it in uT"):
        found = ag.fit_ellipsoid(FIELD / 1e3, 50_000, unit="uT")
    assert found.calibration.magnitude == 50_000


def test_readings_without_a_unit_are_raw_in_every_form() -> None:
    """An array says as little of its unit as columns without one."""
    columns = {name: FIELD[:, k] for k, name in enumerate("xyz")}
    for given in (FIELD, FIELD.tolist(), columns):
        found = ag.fit_ellipsoid(given)
        assert (found.calibration.unit_in, found.calibration.unit_out) == ("raw", "raw")
        assert "raw" in repr(found)


CALIBRATION = ag.Affine(bias=[0, 0, 0], matrix=np.eye(3))
MISUSE = {
    "no readings": lambda: ag.fit_ellipsoid(None, 50_000),
    "a number": lambda: ag.fit_ellipsoid(7.0),
    "one axis": lambda: ag.fit_ellipsoid(FIELD[:, 0], 50_000),
    "axes in rows": lambda: ag.fit_ellipsoid(FIELD.T, 50_000),
    "words": lambda: ag.fit_ellipsoid([["a", "b", "c"]], 50_000),
    "a fit": lambda: ag.fit_ellipsoid(CALIBRATION, 50_000),
    "columns of other things": lambda: ag.calibrate({"heading_deg": [1.0], "speed": [2.0]}),
    "no columns": lambda: ag.calibrate({}),
    "a unit twice": lambda: ag.fit_ellipsoid(SAMPLES, 50_000, unit="uT"),
    "an unknown unit": lambda: ag.fit_ellipsoid(FIELD, 50_000, unit="tesla per hour"),
    "no file": lambda: ag.calibrate("nowhere.bin"),
    "a reference in words": lambda: ag.fit_ellipsoid(SAMPLES, "fifty"),
    "a reference of no size": lambda: ag.fit_ellipsoid(SAMPLES, 0.0),
    "a reference of vectors": lambda: ag.fit_ellipsoid(SAMPLES, FIELD),
    "a magnitude for an attitude": lambda: ag.fit_levelled(SAMPLES, 50_000),
    "no reference": lambda: ag.fit_vector(SAMPLES, None),
    "samples to correct": lambda: CALIBRATION.correct(SAMPLES),
    "two columns to correct": lambda: CALIBRATION.correct(FIELD[:, :2]),
    "words to correct": lambda: CALIBRATION.correct("readings"),
    "two columns to apply to": lambda: ag.apply(CALIBRATION, FIELD[:, :2]),
    "a number to verify": lambda: ag.verify(CALIBRATION, 3.0),
    "the wrong way round": lambda: ag.apply(SAMPLES, CALIBRATION),
}


@pytest.mark.parametrize("misuse", MISUSE.values(), ids=MISUSE)
def test_misuse_is_told_what_was_given_and_what_is_needed(misuse: Any) -> None:
    with pytest.raises(ag.AgonicError) as told:
        misuse()
    assert len(str(told.value)) > 30
