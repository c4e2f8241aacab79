"""What is unusual is said in the rows that it is about, and in no other."""

from __future__ import annotations

from agonic.population import Population, Row, compare


def board(k: int, **more: object) -> Row:
    bias = 40.0 * (-1) ** k + 3.0 * k
    given: dict[str, object] = {
        "sensor": f"s{k:02d}",
        "source": f"{k:02d}.csv",
        "sha256": f"{k:064x}",
        "unit_in": "nT",
        "bias_x": bias,
        "bias_y": 0.1 * bias,
        "bias_z": -50.0 - bias,
        "noise": 100.0 + k,
    }
    return Row(verdict="good", status="", **{**given, **more})


def test_rows_say_what_is_unlike_the_others() -> None:
    rows = [board(k) for k in range(24)]
    rows.append(board(24, bias_x=9000.0, noise=2000.0))
    rows.append(board(25, sha256=rows[3].sha256))
    compared = compare(Population.of(rows))
    unusual = dict(zip(compared.population["sensor"], compared.population["unusual"], strict=True))
    named = {sensor for sensor, said in unusual.items() if said}
    assert named == {"s24", "s03", "s25"}
    assert "bias" in unusual["s24"]
    assert "noise" in unusual["s24"]
    assert "03.csv and 25.csv are the same log" in unusual["s03"]
    assert {one.sensor for one in compared.outliers} == {"s24"}
    assert len(compared.duplicates) == 1


def test_rows_given_stay_as_they_are() -> None:
    population = Population.of([board(k) for k in range(24)] + [board(24, bias_x=9000.0)])
    compare(population)
    assert set(population["unusual"]) == {""}
