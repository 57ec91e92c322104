"""A row whose first field is empty is no comment, although `;` begins both."""

from pathlib import Path

import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_events
from insgnss.io.formats.text import layout


@pytest.mark.parametrize("piece", [layout.SCAN_BYTES, 7, 24])
def test_an_empty_first_field_between_semicolons_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, piece: int
) -> None:
    """Oracle: the number of exposures that were written: the third has no name."""
    monkeypatch.setattr(layout, "SCAN_BYTES", piece)
    path = tmp_path / "events.csv"
    path.write_text("image;tow\na.jpg;100\nb.jpg;101\n;102\nd.jpg;103\n")
    with pytest.raises(InputError, match=r":4: ';102' begins with an empty field; fill it in"):
        read_events(path)


def test_a_comment_behind_a_semicolon_stays_one(tmp_path: Path) -> None:
    """Oracle: the exposures that were written: words are no row, nor are more or fewer fields."""
    path = tmp_path / "events.csv"
    path.write_text("image;tow\na.jpg;100\n; lost; here\n;;;\n; five\nb.jpg;101\n;102;103;104\n")
    assert len(read_events(path).time) == 2
