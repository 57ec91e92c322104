"""Tracks of GPX as fixes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.flight.inspection.discovery import sources_of
from insgnss.io.formats import read_gnss

SIGMA = (2.0, 2.0, 4.0)


def written(path, *points, space=' xmlns="http://www.topografix.com/GPX/1/1"'):
    body = "".join(f'<trkpt lat="46.57" lon="6.54">{inner}</trkpt>' for inner in points)
    path.write_text(f'<?xml version="1.0"?>\n<gpx{space}><trk><trkseg>{body}</trkseg></trk></gpx>')
    return path


@pytest.mark.parametrize("space", ["", ' xmlns="http://www.topografix.com/GPX/1/0"'])
@pytest.mark.parametrize(
    ("geoid", "undulation_m", "height", "noted"),
    [
        ("<geoidheight>49.5</geoidheight>", None, 630.0, False),
        ("", 50.0, 630.5, False),
        ("", None, 580.5, True),
    ],
)
def test_a_track_is_read(tmp_path, space, geoid, undulation_m, height, noted):
    """Oracle: the numbers written; 2018-07-03 is the Tuesday of GPS week 2008, GPST 18 s ahead."""
    clock = "<time>2018-07-03T07:31:1{}.250Z</time>"
    points = [f"<ele>580.5</ele>{clock.format(k)}{geoid}<sat>9</sat>" for k in range(3)]
    path = written(tmp_path / "a.gpx", *points, space=space)
    fixes = read_gnss(path, sigma_m=SIGMA, undulation_m=undulation_m)
    tuesday = 2 * 86400.0 + 7 * 3600.0 + 31 * 60.0 + 18.0
    assert_allclose(fixes.time, tuesday + 10.25 + np.arange(3.0))
    assert fixes.gps_week == 2008
    assert_allclose(fixes.height, height)
    assert_allclose(fixes.satellites, 9.0)
    assert any("above sea level" in note.found for note in fixes.notes) == noted
    (source,) = sources_of(path)
    assert (source.role, "sigma_m" in source.keys) == ("gnss", True)


@pytest.mark.parametrize(
    ("point", "message"),
    [
        ("<ele>1</ele>", r"a\.gpx: trkpt 1: time '' is no date in UTC"),
        ("<time>2018-07-03T07:31:10Z</time>", r"a\.gpx: trkpt 1: ele is no number"),
    ],
)
def test_a_point_without_time_or_height_is_refused(tmp_path, point, message):
    """Oracle: its number in the track, and what it lacks."""
    with pytest.raises(InputError, match=message):
        read_gnss(written(tmp_path / "a.gpx", point), sigma_m=SIGMA)
