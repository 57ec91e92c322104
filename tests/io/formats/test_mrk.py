"""Camera events of DJI and Autel drones."""

import re
from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_events, sniff_events

DATA = Path(__file__).parents[3].parent / "shared" / "data"
LINE = (
    "{}\t{}\t[2024]\t   -26,N\t    19,E\t  "
    " 191,V\t-36.41144502,Lat\t174.63075195,Lon\t170.415,Ellh\t1.492559, 1.368525, 3.180128\t16,Q"
)


def write(tmp_path: Path, *lines: str, end: str = "\n") -> Path:
    path = tmp_path / "Timestamp.MRK"
    path.write_text("\n".join(lines) + end)
    return path


@pytest.mark.parametrize(
    "form",
    [
        LINE,
        LINE.replace("\t", "   "),
        LINE.replace("\t", ","),
        LINE.replace("\t[2024]", ""),
        LINE.replace("\t16,Q", ""),
        LINE.replace("\t1.492559, 1.368525, 3.180128", ""),
        "{},{},[2024],-26,N,19,E,191,V,-36.41144502,Lat,174.63075195,Lon,170.415,Ellh,"
        "1.492559,1.368525,3.180128,16,Q",
        "{} {} [2024] 0,N 0,E 0,V 1.0,Lat 2.0,Lon 3.0,Ellh",
    ],
)
def test_variants(tmp_path: Path, form: str) -> None:
    """Oracle: the numbers as a person reads them."""
    path = write(tmp_path, form.format(1, 275295.301059), form.format(2, 275298.098988))
    assert sniff_events(path) == "mrk"
    events = read_events(path, gps_week=2024)
    assert events.images == ("1", "2")
    assert events.time.tolist() == [275295.301059, 275298.098988]
    assert events.gps_week == 2024


@pytest.mark.parametrize(
    ("second", "end", "message"),
    [
        (
            LINE.format(2, 6.0)[:-5],
            "",
            r":2: truncated: the file ends within this line; 12 values, expected 13",
        ),
        (
            LINE.format(2, 6.0).replace("19,E", "x,E"),
            "\n",
            r":2: 'x' where a finite number must stand",
        ),
        (LINE.format(2, 6.0).replace("1.368525, ", ""), "\n", r":2: 4 values without a name"),
        (LINE.format(2, 6.0).replace("191,V", "191,N"), "\n", r":2: N stands twice"),
        (LINE.format(2, 6.0).replace("16,Q", "1.5,Q"), "\n", r":2: q 1.5 is no whole number"),
        (LINE.format(1, 6.0), "\n", r":2: image 1 occurs twice, first in line 1"),
        (LINE.format(2, 4.0), "\n", r":2: time 4.000000 s follows 5.000000 s; time must increase"),
    ],
)
def test_refusals(tmp_path: Path, second: str, end: str, message: str) -> None:
    """Oracle: data_specs/mrk.md."""
    with pytest.raises(InputError, match=re.escape("Timestamp.MRK") + message):
        read_events(write(tmp_path, LINE.format(1, 5.0), second, end=end))


def test_recorded_flight() -> None:
    """Oracle: the lines of the recording cut by column numbers; its description: week 2024, 04:28
    to 04:36 GPST, 2.8 s apart.
    """
    path = DATA / "dji_p4rtk/100_0004_Timestamp.MRK"
    if not path.exists():
        pytest.skip("the recording dji_p4rtk is not at hand; it is not shipped")
    events = read_events(path)
    raw = [re.split(r"\t", line) for line in path.read_text().splitlines()]
    assert events.images == tuple(row[0] for row in raw)
    assert events.time.tolist() == [float(row[1]) for row in raw]
    assert (len(events.images), events.gps_week) == (163, 2024)
    day = events.time % 86400.0
    assert 4 * 3600 + 28 * 60 < day[0] < day[-1] < 4 * 3600 + 36 * 60
    assert np.median(np.diff(events.time)) == pytest.approx(2.8, abs=0.05)


@pytest.mark.parametrize("named", [0, 2023])
def test_exposures_of_a_stale_week_are_taken_from_their_times_of_week(tmp_path, named):
    """Oracle: the exposures over a week's end, the first three after it with an old week."""
    lines = []
    for k in range(30):
        tow, week = (604770.0 + 2.0 * k) % 604800.0, 2023 + (k >= 15)
        week = named if 15 <= k < 18 else week
        lines.append(LINE.format(k + 1, f"{tow:.6f}").replace("[2024]", f"[{week}]"))
    events = read_events(write(tmp_path, *lines))
    assert events.gps_week == 2023
    np.testing.assert_allclose(events.time, 604770.0 + 2.0 * np.arange(30))
    assert "the GPS week of 3 of 30 rows contradicts" in events.notes[0].found
