"""Results whose fields say how they are shown."""

from dataclasses import dataclass
from typing import Annotated

from agonic.readable import Shown, make_record
from agonic.report.digits import THIN
from agonic.report.fields import FRACTION, make_table, write_field
from agonic.report.tables import NOTHING


@dataclass(frozen=True, kw_only=True)
class Found:
    name: Annotated[str, Shown("Fit")]
    count: Annotated[int, Shown("Readings")]
    share: Annotated[float, Shown("Share", FRACTION)]
    error: Annotated[float, Shown("Error", "{unit}", 2, sd="sd", most=180.0)]
    sd: Annotated[float, Shown()]
    taken: Annotated[bool, Shown()] = False
    unit: str

    @property
    def double(self) -> Annotated[float, Shown(key="double_nT")]:
        """Twice the error."""
        return 2 * self.error


def make(error: float = 1.234, sd: float = 0.12, unit: str = "°") -> Found:
    return Found(name="full", count=12_000, share=0.25, error=error, sd=sd, unit=unit)


def test_a_value_has_its_own_unit_digits_and_standard_error() -> None:
    assert write_field(make(), "count") == f"12{THIN}000"
    assert write_field(make(), "share").endswith("%")
    assert write_field(make(), "error") == "1.23 ±\N{NO-BREAK SPACE}0.12°"
    assert write_field(make(sd=0.001), "error") == "1.2°"
    assert write_field(make(unit="nT", sd=0.0), "error").endswith("nT")


def test_what_is_not_known_is_a_dash_on_the_page_and_null_for_programs() -> None:
    assert write_field(make(float("nan")), "error") == NOTHING
    assert write_field(make(200.0), "error") == NOTHING
    assert make_record(make(float("nan")))["error"] is None
    assert make_record(make(200.0))["error"] == 200.0


def test_a_table_has_what_is_labelled_and_a_record_all_but_what_is_left_out() -> None:
    table = make_table([make(), make()], taken=lambda one: one.error > 1)
    assert table.head == ["Fit", "Readings", "Share", "Error"]
    assert [row[0] for row in table.rows] == ["✓ full", "✓ full"]
    assert [*make_record(make())] == ["name", "count", "share", "error", "sd", "taken", "double_nT"]
