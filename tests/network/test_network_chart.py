"""Charts of training and table: well-formed, with the curves that they name."""

from xml.etree import ElementTree

from agonic.network.fit import choose_network, fit_network
from agonic.network.report.figures import draw_chart
from agonic.network.simulate import simulate_paper


def read_texts(drawn: bytes) -> list[str]:
    """The words of an SVG."""
    return ["".join(part.itertext()) for part in ElementTree.fromstring(drawn).iter() if part.text]


def test_training_and_table_are_drawn():
    made = simulate_paper(6.0, directions="space")
    settings = {"base": None, "stopping": "plain"}
    fit = fit_network(made.samples, made.reference, restarts=1, compared=False, **settings)
    texts = read_texts(draw_chart(fit))
    assert {"Training", "epoch", "trained on", "0.001"} <= set(texts)
    assert "held out" not in texts
    choice = choose_network(made.samples, made.reference, hidden=(3, 2), **settings)
    texts = read_texts(draw_chart(fit, choice))
    assert {"Hidden nodes", "rms of unseen readings", "largest", "3", "2"} <= set(texts)
    early = fit_network(made.samples, made.reference, stopping="early", compared=False)
    assert "held out" in read_texts(draw_chart(early))
