"""The one thing to do next."""

from dataclasses import replace

from agonic.health import Finding
from agonic.recording.document import choose_move
from agonic.recording.parts import HALVES, find_refusals
from agonic.report.verdict import WHEN_GOOD
from agonic.verification import DIP


def test_a_good_calibration_is_to_be_used(good):
    assert choose_move(good) == WHEN_GOOD


def test_the_gravest_finding_has_the_first_word(good):
    found = (
        Finding("noise", "note", "it is noisy", "move it away from the motor"),
        Finding("range", "check", "the field is weak", "move it away from iron"),
        Finding("static", "refuse", "it did not turn", "turn it about all axes"),
    )
    refused = replace(good, fit=replace(good.fit, findings=found))
    assert choose_move(refused) == "turn it about all axes"
    checked = replace(good, fit=replace(good.fit, findings=found[:2]))
    assert choose_move(checked) == "move it away from iron"


def test_without_a_move_the_check_that_failed_says_what_to_do(good):
    first, *others = good.verification.checks
    failed = replace(first, passed=False, meaning="record again away from the car")
    verification = replace(good.verification, checks=(*others, failed))
    result = replace(good, verification=verification)
    assert choose_move(result) == "record again away from the car"


def test_unseen_readings_that_dip_far_off_refuse_a_fit(good):
    """As with roll and pitch of another vehicle, which a fit to them may swallow."""
    check = replace(good.verification.checks[0], name=DIP, value=45.0)
    (refusal,) = find_refusals((*good.verification.checks, check))
    assert (refusal.name, refusal.severity) == ("attitude", "refuse")
    assert "off by 45°" in refusal.what
    failed = replace(check, value=6.0)  # no more than a failed check
    assert not [*find_refusals((*good.verification.checks, failed))]
    assert not [*find_refusals(good.verification.checks)]


def test_halves_that_point_elsewhere_refuse_a_fit(good):
    halves = replace(good.verification.checks[0], name=HALVES, value=0.3, limit=2.0, unit="°")
    assert not [*find_refusals((halves,))]
    assert not [*find_refusals((replace(halves, value=6.0, passed=False),))]  # failed, no more
    stated = replace(halves, value=20.0, limit=25.0)
    assert not [*find_refusals((stated,))]  # by no more than they state
    (refusal,) = find_refusals((replace(halves, value=20.0, passed=False),))
    assert (refusal.name, refusal.severity) == (HALVES, "refuse")
    assert "agree, 20°" in refusal.what
