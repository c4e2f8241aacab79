"""The page of a sensor's history, as text and in a browser."""

from datetime import UTC, datetime, timedelta
from typing import Any

import numpy as np
import pytest

from agonic.history.document import describe_drift
from agonic.history.fit import drift
from agonic.history.result import Drift
from agonic.population import Population, Row

START = datetime(2024, 1, 1, tzinfo=UTC)


def rows_of(n: int, sensor: str = "board <7>") -> list[Row]:
    """A calibration a month that drifts and steps, with one that is astray."""
    rng = np.random.default_rng(1)
    made = []
    for k in range(n):
        bias = rng.normal(0, 10.0, 3) + [0.0, 300.0 * (k >= 9), -20.0 * k] + 400.0 * (k == 14)
        gain = 1.0 + rng.normal(0, 1e-4, 3)
        made.append(
            Row(
                sensor=sensor,
                source=f"{k:03d} <log>.csv",
                verdict="good",
                status="fine",
                rows=300,
                start=START + timedelta(days=30 * k),
                unit_in="nT",
                unit_out="nT",
                model="diagonal",
                gauge="symmetric",
                bias_x=bias[0],
                bias_y=bias[1],
                bias_z=bias[2],
                bias_x_sd=5.0,
                bias_y_sd=5.0,
                bias_z_sd=5.0,
                matrix_xx=gain[0],
                matrix_yy=gain[1],
                matrix_zz=gain[2],
                matrix_xx_sd=1e-4,
                matrix_yy_sd=1e-4,
                matrix_zz_sd=1e-4,
                temperature_C=21.5,
            )
        )
    return made


def page_of(rows: list[Row]) -> str:
    found = drift(Population.of(rows), START + timedelta(days=700))
    return describe_drift(found).to_html()


@pytest.fixture(scope="module")
def found() -> Drift:
    return drift(Population.of(rows_of(20)), START + timedelta(days=700))


@pytest.mark.parametrize("scheme", ["light", "dark"])
@pytest.mark.parametrize("width", [360, 1200])
def test_page_fits_and_shows_bands_and_steps(
    opened: Any, found: Drift, scheme: str, width: int
) -> None:
    page = opened(
        describe_drift(found).to_html(),
        color_scheme=scheme,
        viewport={"width": width, "height": 800},
    )
    assert page.complaints == []
    assert len(page.requests) == 1
    assert page.evaluate("document.documentElement.scrollWidth") <= width
    assert page.locator(".plot").count() == 6  # a diagonal model has nothing between the axes
    strips = page.locator(".plot", has_text="bias y")
    assert strips.locator("path.step").count() == 1
    assert page.locator("path.astray").count() == 6
    y = page.locator(".plot", has_text="bias z").locator("path.band")
    assert y.bounding_box()["height"] > 20
    assert strips.locator("path.seen").get_attribute("d").count("M") == 19
    assert page.locator("table.calibrations tbody tr").count() == 20


def test_band_encloses_line_and_is_enclosed_by_that_of_calibrations(
    opened: Any, found: Drift
) -> None:
    page = opened(describe_drift(found).to_html())
    strip = page.locator(".plot", has_text="bias x")
    boxes = [
        strip.locator(f"path.{name}").bounding_box() for name in ("level", "band", "calibrations")
    ]
    tops, feet = zip(*((box["y"], box["y"] + box["height"]) for box in boxes), strict=True)
    assert tops[0] > tops[1] > tops[2]
    assert feet[0] < feet[1] < feet[2]


def test_page_says_what_the_drift_says(found: Drift) -> None:
    page = describe_drift(found, title="Board 7").to_html()
    assert "<h1>Board 7</h1>" in page
    assert "<log>" not in page
    assert "&lt;log&gt;" in page
    step = next(event for event in found.events if event.kind == "step")
    assert f"{step.after:%Y-%m-%d} to {step.before:%Y-%m-%d}" in page
    for finding in found.findings:
        assert f"<code>{finding.name}</code>" in page


def test_few_calibrations_make_a_page_without_strips() -> None:
    page = page_of(rows_of(2))
    assert 'class="plot' not in page
    assert "few calibrations" in page


def test_long_histories_are_cut_short_in_the_table_only() -> None:
    rows = [
        Row(
            sensor="7",
            source=f"{k:04d}.csv",
            verdict="refused",
            status="no",
            start=START + timedelta(days=k),
        )
        for k in range(230)
    ]
    page = page_of(rows)
    assert "30 earlier ones left out." in page
