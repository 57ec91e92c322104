"""What a million mutated files showed; the rest of them stands with each reader's own tests."""

import json
import time

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.formats import unit_factor
from insgnss.formats.blocks.opensfm_model import read_opensfm_poses
from insgnss.formats.orientation.generic_ascii import read_generic_ascii
from insgnss.formats.trajectory.odyn import read_odyn_poses
from insgnss.gnss.rinex.observations import read_observations
from insgnss.orient.mounting_file import read_mounting_file

HUGE = "1e200"
ROW = "{} 46.57 6.54 400.0 {} 0.0 0.0 0.0\n"
SHOT = {"rotation": [1e200, 0.0, 0.0], "translation": [0.0, 0.0, 0.0], "camera": "c"}
CAMERA = {"projection_type": "brown", "width": 100, "height": 100, "focal_x": 1.0, "focal_y": 1.0}
MODEL = [{"cameras": {"c": CAMERA}, "points": {}, "shots": {"a.jpg": SHOT}}]
HEADER = (
    f"{'2.11':>9}{'':11}{'OBSERVATION DATA':20}{'G (GPS)':20}RINEX VERSION / TYPE\n"
    f"{'     0':60}# / TYPES OF OBSERV\n{'':60}END OF HEADER\n"
)
CASES = {
    "camera axes of no words": (
        read_generic_ascii,
        "# frame kind: tangent\n# camera axes:\n# image east\na 1.0\n",
        "has no header line .# attitude",
    ),
    "a quaternion beyond any number": (
        read_odyn_poses,
        ROW.format(1.0, 1.0) + ROW.format(2.0, HUGE) + ROW.format(3.0, 1.0),
        r":2: quaternion of length inf",
    ),
    "a lever arm beyond any number": (
        lambda path: read_mounting_file(path, np.eye(3)),
        f"[mounting]\nantenna_m = [0.4, {HUGE}, 0.0]\n",
        r":2: mounting.antenna_m: .* is 1e\+200 m long",
    ),
    "a turn beyond any number": (read_opensfm_poses, json.dumps(MODEL), "rotation is not three"),
    "no types of observations": (read_observations, HEADER, "holds no epoch"),
}


@pytest.mark.parametrize("case", CASES)
def test_it_is_refused_in_one_line(case, tmp_path):
    """Oracle: the place and the reason by hand; no warning, which would be an error here."""
    read, text, says = CASES[case]
    path = tmp_path / "x.txt"
    path.write_text(text)
    with pytest.raises(InputError, match=says) as refusal:
        read(path)
    assert len(str(refusal.value)) < 500


def test_a_unit_that_is_none_takes_no_time():
    """Oracle: linear time; 40 000 blanks took the square of it, minutes."""
    start = time.process_time()
    with pytest.raises(UsageError, match="is none of") as refusal:
        unit_factor(40_000 * "a " + "b", "gyro")
    assert time.process_time() - start < 2.0
    assert len(str(refusal.value)) < 500
