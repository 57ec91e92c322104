"""The names of the checks that a flight file may accept."""

import re
from pathlib import Path

from insgnss.records.verdicts import CHECKS

PAGE = Path(__file__).parents[3] / "data_specs" / "flight_file.md"


def test_the_page_lists_what_may_be_accepted() -> None:
    """Oracle: section `accept` of data_specs/flight_file.md, all of it in quotation marks."""
    section = PAGE.read_text().partition("## accept\n")[2].partition("\n## ")[0]
    listed = re.findall(r'"([^"]+)"', section.strip().split("\n\n")[1])
    assert listed == list(CHECKS)
