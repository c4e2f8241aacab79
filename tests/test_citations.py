"""The bibliography."""

import re

import pytest

from agonic.citations import CITATIONS, find_citation
from agonic.errors import AgonicError


def test_every_reference_names_the_authors_and_the_year_of_its_key():
    for key in CITATIONS:
        *authors, year = key.split("-")
        plain = find_citation(key).replace(" ", "").lower()
        assert year in plain
        assert all(author in plain for author in authors), key


def test_every_reference_can_be_looked_up():
    handle = re.compile(r"doi:10\.\d{4,}/\S+$|Pub\. No\. \d+|Patent [A-Z]{2} \d+|ISBN [\d-]+$")
    assert all(handle.search(text) for text in CITATIONS.values())


def test_an_unknown_key_names_the_known_ones():
    with pytest.raises(AgonicError, match=r"no citation 'newton-1687'.*huber-1981"):
        find_citation("newton-1687")
