"""Every object says what it is: a short repr, a summary, a page in notebooks, a figure."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.simulation import simulate

MADE = simulate("hand", n=1500, seed=2)
FIELD = 50_000.0


@pytest.fixture(scope="module")
def result() -> ag.Calibrated:
    return ag.calibrate(MADE.samples, FIELD)


@pytest.fixture(scope="module")
def shown(result: ag.Calibrated) -> dict[str, object]:
    """An object of each kind that people meet."""
    fit, samples = result.fit, MADE.samples
    swing = np.arange(0.0, 360.0, 30.0)
    tracker = ag.inflight.Tracker(params=ag.inflight.TrackerParams(noise=200.0, history_s=1.0))
    tracker.update(samples, ag.Reference.constant(FIELD))
    setup = ag.Setup(compasses=(ag.Compass(calibration=fit.calibration),), declination_deg=2.0)
    return {
        "samples": samples,
        "reference": ag.Reference.constant(FIELD),
        "calibration": fit.calibration,
        "fit": fit,
        "calibrated": result,
        "coverage": fit.coverage,
        "verification": result.verification,
        "deviation": ag.fit_deviation(swing, swing + 2.0),
        "latency": ag.fit_latency(simulate("flight", n=2000).samples),
        "heading": ag.heading(samples, setup),
        "coil": ag.fit_coil(ag.alignment.simulate_coil().session),
        "tracker": tracker,
        "setup": setup,
        "comparison": ag.compare(fit, MADE.truth),
    }


NAMES = (
    "samples",
    "reference",
    "calibration",
    "fit",
    "calibrated",
    "coverage",
    "verification",
    "deviation",
    "latency",
    "heading",
    "coil",
    "tracker",
    "setup",
    "comparison",
)


@pytest.mark.parametrize("name", NAMES)
def test_it_says_what_it_is_in_a_few_lines(shown: dict[str, ag.Fit], name: str) -> None:
    lines = repr(shown[name]).splitlines()
    assert lines[0].startswith(type(shown[name]).__name__)
    assert len(lines) <= 16
    assert max(map(len, lines)) < 160
    assert "array([" not in repr(shown[name])
    assert shown[name].summary()


@pytest.mark.parametrize("again", [copy.deepcopy, lambda one: pickle.loads(pickle.dumps(one))])
@pytest.mark.parametrize("name", NAMES)
def test_it_can_be_sent_to_another_process(
    shown: dict[str, ag.Fit], name: str, again: Callable[[Any], Any]
) -> None:
    other = again(shown[name])
    assert other is not shown[name]
    assert other.summary() == shown[name].summary()
    for key, value in vars(shown[name]).items():
        if isinstance(value, np.ndarray) and not value.flags.writeable:
            assert not getattr(other, key).flags.writeable
            assert np.array_equal(getattr(other, key), value, equal_nan=value.dtype.kind == "f")


@pytest.mark.parametrize("name", NAMES)
def test_a_notebook_shows_its_page(shown: dict[str, ag.Fit], name: str) -> None:
    page = shown[name]._repr_html_()
    assert page.startswith(("<iframe ", "<pre "))


def test_results_show_the_page_of_the_command_line(shown: dict[str, ag.Fit]) -> None:
    for name in ("calibrated", "deviation", "coil", "tracker"):
        assert 'srcdoc="&lt;!' in shown[name]._repr_html_()
    assert "Sphere before and after" in shown["calibrated"]._repr_html_()
    assert "Ladder of fits" in shown["calibrated"].summary()


def test_numbers_are_in_the_repr(result: ag.Calibrated) -> None:
    said = repr(result)
    assert said.startswith("Calibrated 'mag': good, ellipsoid")
    assert f"{result.fit.bias[0]:.6g}" in said
    assert "1500 readings in nT" in repr(MADE.samples)
    assert "50000 nT (given)" in repr(ag.Reference.constant(FIELD))


def test_what_is_saved_is_equal_when_it_is_loaded(result: ag.Calibrated, tmp_path) -> None:
    calibration = result.fit.calibration
    loaded = ag.load(ag.save(calibration, tmp_path / "mag.json"))
    assert loaded == calibration
    assert len({loaded, calibration}) == 1
    moved = ag.Affine(bias=calibration.bias + 1e-9, matrix=calibration.matrix)
    assert moved != calibration
    assert calibration != "mag"
    half = Rotation.from_euler("zyx", [1.0, 0.2, 0.3])
    turned = ag.alignment.Alignment(rotation=half, covariance=1e-6 * np.eye(3))
    assert ag.load(ag.save(turned, tmp_path / "turn.json")) == turned
    chain = ag.Chain(steps=(calibration, turned))
    assert ag.load(ag.save(chain, tmp_path / "chain.json")) == chain


def test_a_calibration_is_called_on_readings_and_samples(result: ag.Calibrated) -> None:
    calibration, samples = result.calibration, MADE.samples
    expected = calibration.correct(samples.field)
    assert np.array_equal(calibration(samples.field), expected)
    assert np.array_equal(calibration(samples).field, expected)
    assert np.array_equal(result.fit.matrix, calibration.matrix)


def test_rows_of_samples() -> None:
    samples = MADE.samples
    part = samples[10:20]
    assert np.array_equal(part.field, samples.field[10:20])
    assert np.array_equal(part.time, samples.time[10:20])
    assert np.array_equal(samples[samples.time > 1].time, samples.time[samples.time > 1])
    assert np.array_equal(samples[[3, 5]].field, samples.field[[3, 5]])
    assert np.array_equal(samples[-1].field, samples.field[-1:])
    for misuse in ("field", (1, 2, "x"), 1.5, 10_000, np.ones(3, dtype=bool)):
        with pytest.raises(ag.AgonicError, match="rows"):
            samples[misuse]
    with pytest.raises(ag.AgonicError, match=r"samples\.field"):
        np.asarray(samples)


PLOTTED = ("calibrated", "fit", "heading", "tracker")


@pytest.mark.parametrize("name", PLOTTED)
def test_a_figure_can_be_saved(shown: dict[str, ag.Fit], name: str, tmp_path) -> None:
    pytest.importorskip("matplotlib").use("Agg")
    figure = shown[name].plot()
    figure.savefig(tmp_path / "figure.png")
    assert (tmp_path / "figure.png").stat().st_size > 10_000
    for axes in figure.axes:
        assert axes.get_title() or axes.get_ylabel() or axes.get_xlabel()


def test_a_thermal_calibration_is_drawn_over_its_temperatures() -> None:
    pytest.importorskip("matplotlib").use("Agg")
    warm = ag.thermal.Thermal(
        bias=[[100.0, 0, 0], [50.0, 0, 0]],
        matrix=[np.eye(3), np.zeros((3, 3))],
        centre_C=20.0,
        half_range_C=30.0,
    )
    panels = warm.plot().axes
    assert [one.get_ylabel() for one in panels[:2]] == ["bias x, nT", "bias y, nT"]
    assert len(panels) == 9
    for k, panel in enumerate(panels[:3]):
        (line,) = panel.lines
        assert np.array_equal(line.get_ydata(), warm.bias_at(line.get_xdata())[:, k])


def test_what_has_no_figure_says_what_has() -> None:
    with pytest.raises(ag.AgonicError, match="these have one"):
        MADE.samples.plot()
