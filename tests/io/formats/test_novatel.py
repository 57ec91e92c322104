"""Position logs of NovAtel in ASCII."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss

# recorded lines of receivers in the field, of three makers, with their checksums
SINGLE = (
    "#BESTPOSA,COM1,0,83.5,FINESTEERING,2163,329760.000,02400000,b1f6,65535;SOL_COMPUTED,SINGLE,"
    "51.15043874397,-114.03066788586,1097.6822,-17.0000,WGS84,1.3648,1.1806,3.1112,"
    '"",0.000,0.000,18,18,18,0,00,02,11,01*c3194e35'
)
FIXED = (
    "#BESTPOSA,USB1,0,51.5,FINESTEERING,2404,603797.000,03000800,cdba,18018;SOL_COMPUTED,NARROW_INT"
    ",51.07899643518,-114.13251416136,1114.2977,-16.6000,WGS84,0.0079,0.0056,0.0141,"
    '"3920",1.000,0.000,34,31,31,30,00,21,7f,37*a5cec5c7'
)
NONE = (
    "#BESTPOSA,COM2,0,0.0,FINE,2349,479940.000,,,;INSUFFICIENT_OBS,NONE,0.00000000,0.00000000,0.000"
    ',17.230,WGS84,0.0000,0.0000,0.0000,"",0.0,0.0,31,0,,,,,,*9cefb0ad'
)


@pytest.mark.parametrize("before", ["", "12:00:01 rx> "])
def test_a_recorded_log_is_read(tmp_path, before):
    """Oracle: the line's own numbers, by eye; a log without a solution is counted."""
    path = tmp_path / "x.log"
    path.write_text(f"[monitor]\n{before}{NONE}\n{before}{FIXED}\n")
    fixes = read_gnss(path)
    assert (fixes.gps_week, fixes.time.tolist(), fixes.quality.tolist()) == (2404, [603797.0], [1])
    assert_allclose(np.degrees([fixes.lat[0], fixes.lon[0]]), [51.07899643518, -114.13251416136])
    assert_allclose(fixes.height, 1114.2977 - 16.6)
    assert_allclose(np.sqrt(np.diagonal(fixes.cov_ned[0])), [0.0079, 0.0056, 0.0141])
    assert [fixes.satellites[0], fixes.age_s[0]] == [31.0, 1.0]
    (left,) = (note.found for note in fixes.notes)
    assert left == "left out 0 logs without a right checksum, 1 without solution"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (SINGLE.replace("51.15", "51.25"), r":1: no right checksum in '#BESTPOSA"),
        (NONE, "none of its 1 BESTPOSA logs has a solution"),
    ],
)
def test_a_damaged_log_is_refused(tmp_path, text, message):
    """Oracle: one line of what is wrong."""
    (tmp_path / "x.log").write_text(text + "\n")
    with pytest.raises(InputError, match=message):
        read_gnss(tmp_path / "x.log")
