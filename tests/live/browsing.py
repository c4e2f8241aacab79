"""Waiting for what a page shows."""

import time


def wait(page, what, seconds=20.0):
    """Until an expression is true; asked again and again, for the page forbids `eval`."""
    until = time.monotonic() + seconds
    while not page.evaluate(what):
        assert time.monotonic() < until, f"never: {what}"
        page.wait_for_timeout(50)
