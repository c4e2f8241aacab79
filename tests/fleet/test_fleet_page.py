"""The page of a fleet: its words and figures are the table's, and it stays fluent in a browser."""

from __future__ import annotations

import re
from dataclasses import replace
from datetime import UTC, datetime, timedelta
from html import unescape
from typing import Any

import numpy as np
import pytest

from agonic.fleet.document import describe_population
from agonic.population import Population, find_outliers
from agonic.report.digits import MINUS, NO_BREAK, THIN
from tests.population.drawn import changed, drawn, joined, refused, with_bias

EVIL = "</script><img src=x onerror=alert(1)>"


def words(page: str) -> str:
    """The words of a page, with plain spaces and hyphens."""
    body = re.sub(r"<(style|script).*?</\1>", " ", page, flags=re.DOTALL)
    text = unescape(re.sub(r"<[^>]*>", " ", body))
    return re.sub(r"\s+", " ", text.replace(THIN, " ").replace(NO_BREAK, " ")).replace(MINUS, "-")


def page_of(population: Population, **settings: Any) -> str:
    return describe_population(population, **settings).to_html()


def boards(n: int) -> Population:
    """Boards with temperatures and times; on x 20 nT/°C, on z 2000 nT a year."""
    rng = np.random.default_rng(6)
    days, celsius = rng.uniform(0, 400, n), rng.normal(22, 7, n)
    start = [datetime(2025, 3, 1, tzinfo=UTC) + timedelta(days=float(day)) for day in days]
    made = drawn(
        n,
        seed=2,
        start=start,
        temperature_C=celsius,
        report=[f"s{k:06d}/report.html" for k in range(n)],
        calibration=[f"s{k:06d}/mag #{k}.json" for k in range(n)],
    )
    warm = made["bias_x"] + 20 * (celsius - 22)
    return changed(made, np.arange(n), bias_x=warm, bias_z=made["bias_z"] + 2000 * days / 365.25)


@pytest.fixture(scope="module")
def fleet() -> Population:
    """400 boards: one far off, eleven refused, a log that is there twice, names to beware of."""
    many = boards(400)
    far = with_bias(many, np.array([7]), np.array([[60_000.0, 0.0, 0.0]]))
    copy = [replace(row, source="copy.csv", report=None) for row in far if row.sensor == "s000003"]
    bad = [refused(f"r{k}", f"only {k} % of the sphere was seen", "coverage") for k in range(9)]
    names = [refused(EVIL, "the file is empty"), refused("javascript:alert(1)", EVIL)]
    odd = [
        replace(row, verdict="check", findings=("outliers",), status="3 % are strays")
        for row in far
        if row.sensor in ("s000010", "s000011")
    ]
    rest = [row for row in far if row.sensor not in ("s000010", "s000011")]
    return joined(rest, odd, copy, bad, names)


@pytest.fixture(scope="module")
def page(fleet: Population) -> str:
    return page_of(fleet, title="Boards of May")


@pytest.fixture
def view(opened: Any, page: str) -> Any:
    return ready(opened(page, viewport={"width": 1200, "height": 800}))


def ready(view: Any) -> Any:
    view.wait_for_selector("html[data-ready]", state="attached")
    return view


def count(view: Any) -> str:
    """The number of rows that are selected, as the page says it, when it has settled."""
    view.wait_for_timeout(250)
    text: str = view.inner_text(".count")
    return text.replace(THIN, " ")


# ---- what it says --------------------------------------------------------------------------------


def test_the_headline_counts_what_the_table_has(page: str) -> None:
    text = words(page)
    assert "Sensors 411" in text
    assert "Logs 412 412 calibrations" in text
    assert "Good 399 " in text
    assert "Check 2 " in text
    assert "Refused 11 " in text
    assert "Stand out 1 " in text
    assert "Duplicates 1 " in text
    assert "copy.csv and logs/s000003.csv are the same log." in text


def test_outliers_are_named_with_sentence_and_report(page: str, fleet: Population) -> None:
    [found] = find_outliers(fleet)
    assert found.sensor == "s000007"
    assert '<a href="s000007/report.html">s000007</a>' in page
    assert found.sentence[1:].replace("-", "") in words(page).replace("-", "")


def test_reasons_come_by_number_with_examples(page: str) -> None:
    text = words(page)
    assert "coverage 9 0 Only 0 % of the sphere was seen. r0.csv, r1.csv, r2.csv" in text
    assert "the file is empty 1 0 The file is empty." in text
    assert "outliers 0 2 3 % are strays." in text
    assert (
        text.index("coverage 9 0")
        < text.index("the file is empty 1 0")
        < text.index("outliers 0 2")
    )


def test_histograms_hold_every_calibration(page: str, fleet: Population) -> None:
    """The areas of the bars are the counts, on the axis that the figure names."""
    for column, values in (("bias_y", fleet["bias_y"]), ("gain_x", fleet["matrix_xx"])):
        begin = page.index(f'data-columns="{column}"')
        tag = page[page.rindex("<div", 0, begin) : page.index(">", begin)]
        low, high = map(float, re.search(r'data-x="(\S+) (\S+)"', tag).groups())  # type: ignore
        most = float(re.search(r'data-y="\S+ (\S+)"', tag)[1])  # type: ignore
        path = re.search(r'd="M0 1000L([^"]*)L1000 1000Z" class="bars"', page[begin:])
        assert path
        heights = [float(p.split()[1]) for p in path[1].split("L")][::2]
        drawn_counts = np.round((1000 - np.array(heights)) / 1000 * most).astype(int)
        known = values[np.isfinite(values)]
        counts, _ = np.histogram(np.clip(known, low, high), 40, (low, high))
        np.testing.assert_allclose(drawn_counts, counts, atol=1)


def test_slopes_are_those_that_were_planted(page: str) -> None:
    text = words(page)
    warm = re.search(r"It changes on x: x \+([\d.]+) ± ([\d.]+), .{10,60} nT per °C", text)
    assert warm
    assert abs(float(warm[1]) - 20) < 3 * float(warm[2])
    yearly = re.search(r"It changes on z: x .{10,60} z \+([\d ]+) ± (\d+) nT per year", text)
    assert yearly
    assert abs(float(yearly[1].replace(" ", "")) - 2000) < 3 * float(yearly[2])


def test_within_sensors_the_slope_is_far_sharper() -> None:
    """Boards differ by 300 nT, but each was seen at four temperatures."""
    rng = np.random.default_rng(4)
    rows = [
        replace(
            row,
            source=f"{row.sensor}-{k}.csv",
            sha256="",
            report=None,
            temperature_C=t,
            bias_x=row.bias_x + 5 * (t - 20) + rng.normal(0, 5),
        )
        for row in drawn(20, seed=3)
        for k, t in enumerate((0.0, 15.0, 30.0, 45.0))
    ]
    text = words(page_of(Population.of(rows), title="four times"))
    found = re.search(r"x \+([\d.]+) ± ([\d.]+), .{5,60} per °C \(within 20 sensors", text)
    assert found
    assert float(found[2]) < 0.1
    assert abs(float(found[1]) - 5) < 4 * float(found[2])


def test_few_sensors_are_said_to_be_few() -> None:
    text = words(page_of(drawn(4), title="four"))
    assert "4 sensors (readings in nT) are too few to find what is usual: at least" in text
    assert "sensors differ by" not in text
    nothing = words(page_of(Population.of([]), title="none"))
    assert "Sensors 0" in nothing


def test_the_same_rows_give_the_same_bytes(page: str, fleet: Population) -> None:
    again = Population.of(reversed(list(fleet)))
    assert page_of(again, title="Boards of May") == page


# ---- in a browser --------------------------------------------------------------------------------


def test_names_neither_run_nor_break_the_page(view: Any) -> None:
    assert view.complaints == []
    assert len([url for url in view.requests if not url.startswith("data:")]) == 1
    assert view.locator("img").count() == 0
    view.fill("#find", "onerror")
    assert count(view) == "2 of 412"
    assert EVIL in view.inner_text(".scroller")
    schemes = view.evaluate("[...document.links].map(a => new URL(a.href).protocol)")
    assert set(schemes) == {"file:"}


def test_rows_carry_the_numbers_of_the_table(view: Any, fleet: Population) -> None:
    view.fill("#find", "s000123")
    assert count(view) == "1 of 412"
    cells = view.locator(".scroller tbody tr[data-row]").first.locator("th, td").all_inner_texts()
    [row] = [row for row in fleet if row.sensor == "s000123"]
    shown = dict(zip(view.locator(".scroller thead th").all_inner_texts(), cells, strict=True))
    assert shown["Verdict"] == "Good"
    assert float(shown["Bias x"].replace(MINUS, "-")) == pytest.approx(row.bias_x, abs=10)
    assert float(shown["Noise"]) == pytest.approx(row.noise, rel=0.02)
    assert shown["Readings"] == str(row.rows)
    view.locator(".scroller tbody tr[data-row] td").nth(3).click()
    details = view.inner_text(".details")
    assert f"start\n{row.start:%Y-%m-%d %H:%M}" in details
    assert row.source in details
    links = view.evaluate(
        "[...document.querySelectorAll('.links a')].map(a => a.getAttribute('href'))"
    )
    assert links == ["s000123/report.html", "s000123/mag%20%23123.json"]


def test_a_column_sorts_both_ways_with_the_missing_last(view: Any, fleet: Population) -> None:
    def column() -> list[str]:
        view.wait_for_timeout(200)
        texts: list[str] = (
            view.locator(".scroller tbody tr[data-row]")
            .locator(".number:nth-child(4)")
            .all_inner_texts()
        )
        return texts

    head = view.locator(".scroller thead th", has_text="Bias x")
    known = np.sort(fleet["bias_x"][np.isfinite(fleet["bias_x"])])
    head.locator("button").click()
    assert float(column()[0].replace(MINUS, "-")) == pytest.approx(known[0], abs=10)
    assert head.get_attribute("aria-sort") == "ascending"
    head.locator("button").click()
    assert float(column()[0].replace(MINUS, "-")) == pytest.approx(known[-1], rel=1e-3)
    assert head.get_attribute("aria-sort") == "descending"
    view.evaluate("document.querySelector('.scroller').scrollTop = 1e9")
    assert column()[-11:] == ["–"] * 11


def test_bars_select_their_calibrations(view: Any, fleet: Population) -> None:
    """A drag over half of the figure selects what the table has in that range."""
    canvas = view.locator('.live[data-columns="noise"] canvas')
    canvas.scroll_into_view_if_needed()
    box = canvas.bounding_box()
    view.wait_for_timeout(200)
    view.mouse.move(box["x"] + 1, box["y"] + 20)
    view.mouse.down()
    view.mouse.move(box["x"] + box["width"] / 2 - 2, box["y"] + 20, steps=4)
    view.mouse.up()
    low, high = map(float, view.get_attribute('.live[data-columns="noise"]', "data-x").split())
    expected = int((fleet["noise"] <= low + (high - low) / 2).sum())
    assert count(view) == f"{expected} of 412"
    assert view.locator(".chip").count() == 1
    view.locator(".chip").click()
    assert count(view) == "412 calibrations"


def test_the_keyboard_selects_bars_too(view: Any, fleet: Population) -> None:
    figure = view.locator('.live[data-columns="bias_y"]')
    figure.locator("canvas").focus()
    view.wait_for_timeout(200)
    view.keyboard.press("Home")
    view.keyboard.press("Shift+End")
    known = int(np.isfinite(fleet["bias_y"]).sum())
    assert count(view) == f"{known} of 412"
    said = figure.locator(".picked").inner_text()
    assert re.match(r"from .* calibration", said)
    view.keyboard.press("Escape")
    assert count(view) == "412 calibrations"


def test_a_rectangle_of_biases_finds_the_outlier(view: Any, fleet: Population) -> None:
    """Verdict, outliers and a reason select as well, and all of it together."""
    view.select_option("#kind", "noted")
    assert count(view) == "1 of 412"
    view.select_option("#kind", "refused")
    assert count(view) == "11 of 412"
    view.locator(".reasons button", has_text="coverage").click()
    assert count(view) == "9 of 412"
    view.locator(".controls button", has_text="Show all").click()
    box = view.locator(".live.scatter canvas").first
    box.scroll_into_view_if_needed()
    view.wait_for_timeout(200)
    area = box.bounding_box()
    view.mouse.move(area["x"] + 1, area["y"] + 1)
    view.mouse.down()
    view.mouse.move(area["x"] + area["width"] - 1, area["y"] + area["height"] - 1, steps=3)
    view.mouse.up()
    (xl, xh), (yl, yh) = (
        map(float, view.locator(".live.scatter").first.get_attribute(name).split())
        for name in ("data-x", "data-y")
    )
    x, y = fleet["bias_x"], fleet["bias_y"]
    inside = int(((x > xl) & (x < xh) & (y > yl) & (y < yh)).sum())
    assert abs(int(count(view).split()[0]) - inside) <= 2


@pytest.mark.parametrize("width", [360, 768, 1440])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_it_fits_every_width_in_both_themes(
    opened: Any, page: str, width: int, scheme: str
) -> None:
    view = ready(opened(page, viewport={"width": width, "height": 800}, color_scheme=scheme))
    assert view.evaluate("document.documentElement.scrollWidth") <= width
    assert view.complaints == []
    ground = view.evaluate(
        "getComputedStyle(document.body).backgroundColor.match(/\\d+/g).map(Number)"
    )
    assert (max(ground) < 40) if scheme == "dark" else (min(ground) > 240)
    unseen = view.evaluate(
        "[...document.querySelectorAll('.area path')].map(path => getComputedStyle(path))"
        ".filter(s => s.stroke == 'none' && s.fill == 'none').length"
    )
    assert unseen == 0


def test_without_javascript_the_findings_and_figures_are_there(opened: Any, page: str) -> None:
    view = opened(page, java_script_enabled=False)
    text = view.locator("body").inner_text()
    assert "Its bias is" in text
    assert "412 calibrations to search, sort and select with JavaScript on." in text
    assert view.locator(".area path.bars").count() == 9
    shown = "getComputedStyle(document.querySelector('.live.scatter path.dots')).display"
    assert view.evaluate(shown) == "inline"
    assert "1 calibration beyond the axes." in text


@pytest.mark.slow
def test_a_hundred_thousand_stay_fluent(opened: Any) -> None:
    """Below 15 MB; drawn rows, work of a filter and of a frame do not grow with the fleet.

    Time is that of the page's own thread, so that a busy machine fails nothing.
    """
    n = 100_000
    many = boards(n)
    page = page_of(many, title="many", outliers=())
    assert len(page) < 15e6
    view = opened(page, apart=True, viewport={"width": 1200, "height": 800})
    session = view.context.new_cdp_session(view)
    session.send("Performance.enable", {"timeDomain": "threadTicks"})

    def busy() -> float:
        metrics = session.send("Performance.getMetrics")["metrics"]
        return next(m["value"] for m in metrics if m["name"] == "TaskDuration")

    ready(view)
    assert busy() < 3.0
    view.evaluate("document.querySelector('.scroller').scrollIntoView()")
    before = busy()
    view.evaluate(
        """async () => {
            const box = document.querySelector(".scroller");
            for (let k = 0; k < 60; k++) {
                box.scrollTop += 300;
                await new Promise(requestAnimationFrame);
            }
        }"""
    )
    assert (busy() - before) / 60 < 0.033
    assert view.locator(".scroller tbody tr").count() < 60
    assert view.get_attribute(".scroller table", "aria-rowcount") == f"{n + 1}"
    before = busy()
    view.fill("#find", "s09999")
    assert count(view) == "10 of 100 000"
    assert busy() - before < 1.0
    view.evaluate("document.querySelector('.scroller').scrollTop = 1e9")
    view.wait_for_timeout(100)
    assert view.locator(".scroller tbody tr[data-row] th").last.inner_text() == "s099999"
