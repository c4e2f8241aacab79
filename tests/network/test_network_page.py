"""Pages about networks: what they show is what was fitted, and they hold in a browser."""

import re
from html import unescape

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import agonic as ag
from agonic.calibration.alignment import Alignment
from agonic.calibration.chain import Chain
from agonic.calibration.retraining import RetrainerParams
from agonic.calibration.steps import find_step
from agonic.network.fit import choose_network, fit_network
from agonic.network.report.document import describe_network, describe_network_file
from agonic.network.retraining import Retrainer
from agonic.network.retraining.document import describe_retraining
from agonic.network.simulate import simulate_nonaffine, simulate_paper
from agonic.report.digits import MINUS, NO_BREAK, THIN
from agonic.verification import verify


def words(page: str) -> str:
    """The words of a page, with plain spaces and hyphens."""
    body = re.sub(r"<style.*?</style>", " ", page, flags=re.DOTALL)
    text = unescape(re.sub(r"<[^>]*>", " ", body))
    return re.sub(r"\s+", " ", text.replace(THIN, " ").replace(NO_BREAK, " ")).replace(MINUS, "-")


@pytest.fixture(scope="module")
def made():
    return simulate_nonaffine(n=3000, hysteresis=0.0, seed=1)


@pytest.fixture(scope="module")
def fit(made):
    return fit_network(made.samples, made.reference, hidden=6)


@pytest.fixture(scope="module")
def page(fit, made) -> str:
    return describe_network(fit, made.samples, title="bent.csv").to_html()


@pytest.fixture(scope="module")
def followed():
    """A retrainer after the published change, and a poisoned end."""
    flight = simulate_paper(40.0, seed=1)
    before = flight.select(flight.samples.time < 15.0)
    ground = fit_network(before.samples, before.reference, compared=False).calibration
    retrainer = Retrainer(ground, RetrainerParams(window_s=15.0))
    known = np.array(flight.field)
    known[3800:] *= -1.0
    reference = ag.Reference.vector(known, frame="m")
    return retrainer, retrainer.update(flight.samples, reference)


def test_errors_of_base_and_network_are_those_of_the_comparison(page, fit) -> None:
    text, comparison = words(page), fit.comparison
    for name, errors in (("network", comparison.network), ("base", comparison.base)):
        found = re.search(rf"Unseen, {name} ([\d. ]+) nT", text)
        assert found
        assert float(found[1].replace(" ", "")) == pytest.approx(errors.rms, rel=0.006)
    assert f"{100 * comparison.ratio:.2g} % of the error of the base is left" in text
    assert "Chosen: the network" in text


def test_two_curves_lie_where_the_errors_are(page, fit) -> None:
    drawn = page[page.index("Error over time") :]
    heights = {}
    for name in ("by-base", "by-network"):
        path = re.search(rf'<path d="M([^"]*)" class="{name}"', drawn)
        assert path
        heights[name] = np.array([float(p.split()[1]) for p in path[1].split("L")])
    share = (1000 - heights["by-network"].mean()) / (1000 - heights["by-base"].mean())
    assert share == pytest.approx(fit.comparison.ratio, rel=0.1)


def test_every_weight_is_shown_with_its_standard_error(page, fit) -> None:
    text, network = words(page), fit.calibration
    for value, sd in zip(network.weights, fit.sd, strict=True):
        near = [(float(a), float(b)) for a, b in re.findall(r"(-?\d[\d.]*) ± (\d[\d.]*)", text)]
        assert any(abs(a - value) <= 0.06 * sd and abs(b / sd - 1) < 0.06 for a, b in near)


def test_guard_counts_readings_far_from_the_training(made, fit) -> None:
    far = np.array(made.samples.field)
    far[1500:] *= 2.5
    samples = made.samples.with_columns(field=far)
    share = float((fit.calibration.inside(far) < 0.5).mean())
    assert 0.3 < share < 0.6
    turned = Chain(
        steps=(
            fit.calibration,
            Alignment(rotation=Rotation.from_euler("z", 20, degrees=True), frame_out="b"),
        )
    )
    with pytest.warns(ag.AgonicWarning):
        checked = verify(turned, samples, None)
    network = find_step(turned, ag.network.Network)
    page = describe_network_file(turned, network, samples=samples, verification=checked).to_html()
    assert f"{100 * share:.2g} % of 3 000 readings lie so far" in words(page)
    assert 'class="guarded"' in page


@pytest.mark.slow
def test_table_of_nodes_has_the_figures_of_the_choice() -> None:
    flat = simulate_paper(15.0, directions="space")
    choice = choose_network(
        flat.samples, flat.reference, hidden=(3, 2), base=None, stopping="plain"
    )
    text = words(describe_network(choice.fit, flat.samples, choice=choice).to_html())
    for row in choice.table:
        assert f"{row.hidden} {row.regression:.5f} {row.maximum:.2f} {row.rms:.2f}" in text
        assert f"{row.unseen_regression:.5f}" in text
    assert "0.001 (scaled), as published" in text
    assert "no base to fall back to" in text


def test_magnitude_only_says_what_it_cannot_teach(made, page) -> None:
    assert "A magnitude cannot show" not in words(page)
    known = ag.Reference.magnitude(np.linalg.norm(made.field, axis=1))
    fit = fit_network(made.samples, known, target="magnitude")
    assert "A magnitude cannot show" in words(describe_network(fit, made.samples).to_html())
    assert "A magnitude cannot show" in words(
        describe_network_file(fit.calibration, fit.calibration).to_html()
    )


def test_history_marks_every_retraining_where_it_was(followed) -> None:
    retrainer, seen = followed
    page = describe_retraining(retrainer, seen, title="flight.csv").to_html()
    text, count = words(page), len(seen.retrainings)
    accepted = sum(one.accepted for one in seen.retrainings)
    assert f"Accepted {accepted} of {count} retrainings" in text
    assert 0 < accepted < count
    for one in seen.retrainings:
        name = "accepted" if one.accepted else "rejected"
        place = 1000 * (one.time - seen.time[0]) / (seen.time[-1] - seen.time[0])
        assert f"M{place:.1f} 0V1000" in re.search(f'<path d="([^"]*)" class="{name}"', page)[1]
    [change, *_] = (one for one in seen.retrainings if one.onset is not None)
    place = 1000 * change.onset / (seen.time[-1] - seen.time[0])
    assert f"M{place:.1f} 0V1000" in re.search('<path d="([^"]*)" class="onset"', page)[1]
    poisoned = [one for one in seen.retrainings if one.poisoned]
    assert poisoned
    assert "wrong reference" in text.lower()
    assert "Check : look before use" in text


@pytest.mark.parametrize("width", [360, 1000])
@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_pages_hold_in_a_browser(width, scheme, page, followed, opened) -> None:
    for text in (page, describe_retraining(*followed).to_html()):
        view = opened(text, viewport={"width": width, "height": 800}, color_scheme=scheme)
        assert view.evaluate("document.documentElement.scrollWidth") <= width
        assert view.complaints == []
        assert len(view.requests) == 1
        unseen = view.evaluate(
            "[...document.querySelectorAll('.area path')].map(path => getComputedStyle(path))"
            ".filter(s => s.stroke == 'none' && s.fill == 'none').length"
        )
        assert unseen == 0
        assert len(text) < 200_000


def test_the_regression_is_that_of_each_axis(page, fit, made) -> None:
    """R of the paper's figure, axis by axis, of what the network gives and what is known."""
    used = fit.weights > 0
    found, _ = fit.calibration.evaluated(made.samples.field, {})
    known = made.reference.values
    text = words(page)
    for axis in range(3):
        r = np.corrcoef(found[used, axis], known[used, axis])[0, 1]
        assert f"Along {'xyz'[axis]}: R = {r:.5f}" in text
    assert page.count('class="dots"') == 3
