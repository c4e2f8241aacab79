"""The error tree: every message says where, and the parts of it can be asked for."""

import pytest

import agonic as ag


@pytest.mark.parametrize(
    "error",
    [
        ag.LogError("bad"),
        ag.UnitError("bad"),
        ag.FrameError("bad", left="m", right="b"),
        ag.CoverageError("bad"),
        ag.ConvergenceError("bad"),
        ag.ValidityError("bad"),
        ag.MissingExtraError("bad", "px4"),
    ],
    ids=lambda error: type(error).__name__,
)
def test_every_error_is_one_that_the_user_can_do_something_about(error: Exception) -> None:
    assert isinstance(error, ag.AgonicError)
    assert "bad" in str(error)


def test_a_log_error_says_where() -> None:
    assert str(ag.LogError("no header", path="a.csv", row=7)) == "a.csv, row 7: no header"
    assert str(ag.LogError("no header", path="a.csv")) == "a.csv: no header"
    assert str(ag.LogError("no header")) == "no header"
    error = ag.LogError("no header", path="a.csv", row=7)
    assert (error.path, error.row) == ("a.csv", 7)


def test_a_frame_error_names_both_ends() -> None:
    error = ag.FrameError("steps must meet", left="m", right="b")
    assert str(error) == "steps must meet (m does not meet b)"


def test_a_coverage_error_says_which_turns_to_add() -> None:
    error = ag.CoverageError("z is open", undetermined="bias z", turns="tip the nose")
    assert str(error) == "z is open; tip the nose"
    assert (error.undetermined, error.turns) == ("bias z", "tip the nose")
    assert str(ag.CoverageError("z is open")) == "z is open"


def test_a_missing_part_says_how_to_get_it() -> None:
    assert "pip install 'agonic[px4]'" in str(ag.MissingExtraError("PX4 logs", "px4"))
