"""The page of a plan fits small screens: what is wider scrolls."""

import pytest

from agonic.ellipsoid.plan import plan_calibration
from agonic.recording.plan_documents import describe_plan


@pytest.mark.parametrize("width", [360, 400, 1280])
def test_the_page_of_a_plan_fits_every_width(opened, width: int) -> None:
    page = describe_plan(plan_calibration(wanted_deg=1.0), wanted_deg=1.0).to_html()
    shown = opened(page, viewport={"width": width, "height": 900})
    assert shown.evaluate("document.documentElement.scrollWidth") == width
