"""The thresholds of the finder and the page that tells them."""

from dataclasses import fields
from pathlib import Path

import pytest

from femupdate.discrepancy.thresholds import GROUPS, threshold_table

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "thresholds.md"


def test_the_page_tells_the_thresholds_of_the_code():
    page = PAGE.read_text(encoding="utf-8")
    missing = [line for line in threshold_table().splitlines() if line not in page]
    assert missing == [], f"put the text of threshold_table() into {PAGE.name}"


@pytest.mark.parametrize("group", GROUPS, ids=lambda group: type(group).__name__)
def test_every_threshold_says_what_it_means_and_where_it_comes_from(group):
    for one in fields(group):
        assert one.metadata["meaning"], one.name
        assert one.metadata["source"], one.name
