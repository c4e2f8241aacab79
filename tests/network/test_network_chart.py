"""Charts of training and table: well-formed, drawn to scale."""

from xml.etree import ElementTree

import numpy as np
import pytest

from agonic.network.fit import choose_network, fit_network
from agonic.network.report.chart import (
    FOOT,
    HEIGHT,
    LEFT,
    RIGHT,
    TOP,
    WIDTH,
    Curve,
    chart,
    table_chart,
    training_chart,
)
from agonic.network.simulate import simulate_paper

SVG = "{http://www.w3.org/2000/svg}"


def points(drawn: str) -> list[np.ndarray]:
    """The points of each curve, pixels."""
    root = ElementTree.fromstring(drawn)
    paths = [p.get("d", "") for p in root.iter(f"{SVG}path") if p.get("class") == "curve"]
    return [
        np.array([[float(n) for n in pair.split()] for pair in path[1:].split("L")])
        for path in paths
    ]


def test_points_stand_where_their_values_are():
    (curve,) = points(chart("a", "x", "y", [Curve("c", [0.0, 1.0, 4.0], [0.0, 5.0, 10.0])]))
    across = (curve[:, 0] - LEFT) / (WIDTH - LEFT - RIGHT)
    np.testing.assert_allclose(across, [0.0, 0.25, 1.0], atol=1e-3)
    up = (HEIGHT - FOOT - curve[:, 1]) / (HEIGHT - TOP - FOOT)
    np.testing.assert_allclose(np.diff(up), 0.5 / 1.12, atol=2e-3)


def test_the_largest_of_very_many_points_is_kept():
    values = np.zeros(20_000)
    values[12_345] = 7.0
    (curve,) = points(chart("a", "x", "y", [Curve("c", np.arange(20_000), values)]))
    assert curve[:, 1].min() == pytest.approx(
        points(chart("a", "x", "y", [Curve("c", [0, 1], [0.0, 7.0])]))[0][1, 1]
    )


def test_text_is_escaped():
    root = ElementTree.fromstring(chart("a < b & c", "x", "y", [Curve("<i>", [0, 1], [1, 2])]))
    assert any(text.text == "a < b & c" for text in root.iter(f"{SVG}text"))


def test_training_and_table_are_drawn():
    made = simulate_paper(6.0, directions="space")
    settings = {"base": None, "stopping": "plain"}
    fit = fit_network(made.samples, made.reference, restarts=1, compared=False, **settings)
    (curve,) = points(training_chart(fit))
    assert len(curve) == fit.iterations
    assert (np.diff(curve[:, 1]) >= -0.11).all()  # the error falls, so the curve goes down
    choice = choose_network(made.samples, made.reference, hidden=(3, 2), **settings)
    rms, largest = points(table_chart(choice))
    assert (largest[:, 1] < rms[:, 1]).all()
    early = fit_network(made.samples, made.reference, stopping="early", compared=False)
    assert len(points(training_chart(early))) == 2
