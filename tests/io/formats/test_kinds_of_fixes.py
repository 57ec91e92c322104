"""Files that hold fixes of several kinds."""

import re

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss

METRES_A_DEGREE = np.radians(6.37e6)


def written(path, block, up_m=4.5, sense=-1.0, stated="0.020"):
    """A circle of 100 m in 60 s, fixed (1) and single (5) fixes in turn, `block` rows each; the
    single ones lie higher, and have velocities of a sense of their own."""
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 120.0, 0.2)
    angle, speed = 2.0 * np.pi * t / 60.0, 2.0 * np.pi * 100.0 / 60.0
    single = (np.arange(t.size) // block) % 2 == 1
    north, east = 100.0 * np.cos(angle), 100.0 * np.sin(angle)
    up = 500.0 + 0.2 * t + np.where(single, up_m + 0.3 * rng.normal(size=t.size), 0.0)
    turn = np.where(single, sense, 1.0)
    v = turn * speed * np.array([-np.sin(angle), np.cos(angle), 0.0 * angle])
    rows = [
        f"{t[k]:.1f},{45.0 + north[k] / METRES_A_DEGREE:.9f},"
        f"{6.0 + east[k] / METRES_A_DEGREE / np.cos(np.pi / 4.0):.9f},{up[k]:.3f},"
        + ",".join([stated if not single[k] else ""] * 3)
        + f",{5 if single[k] else 1},{v[0, k]:.3f},{v[1, k]:.3f},{v[2, k]:.3f}\n"
        for k in range(t.size)
    ]
    path.write_text("tow,lat,lon,h_ell,sd_n,sd_e,sd_u,q,vn,ve,vd\n" + "".join(rows))
    how = {"sigma_m": (2.0, 2.0, 4.0), "sigma_velocity": (0.3, 0.3, 0.3)}
    return read_gnss(path, **how), single, (speed, angle)


@pytest.mark.parametrize("block", [1, 50])
def test_kinds_are_believed_by_themselves(tmp_path, block):
    """Oracle: the simulated circle: its velocity in all rows; 4.5 m as they were added, within five
    of its sigmas and 0.3 m; each row's deviations as the file states them or as they are given."""
    fixes, single, (speed, angle) = written(tmp_path / "fixes.csv", block)
    assert np.allclose(fixes.velocity_ned[:, 0], -speed * np.sin(angle), atol=1e-3)
    assert np.allclose(fixes.cov_ned[:, 2, 2], np.where(single, 16.0, 4e-4))
    texts = [note.found for note in fixes.notes]
    (found,) = filter(None, (re.search(r"(\S+) m up.*sigma \S+ \S+ (\S+) m", x) for x in texts))
    up, sigma = map(float, found.groups())
    assert abs(up - 4.5) < min(0.3, 5.0 * sigma + 0.05)
    assert any("300 fixes of quality single point against" in text for text in texts)


@pytest.mark.parametrize(("up_m", "sense"), [(0.2, 1.0), (0.0, 1.0)])
def test_kinds_that_agree_have_no_note(tmp_path, up_m, sense):
    """Oracle: 0.2 m is within what single fixes are off."""
    fixes, _, _ = written(tmp_path / "fixes.csv", 50, up_m, sense)
    assert {note.name for note in fixes.notes} == {"GNSS rows"}


def test_a_deviation_that_is_no_number_needs_another(tmp_path):
    """Oracle: the first line without one; nothing stands in for it unasked."""
    written(tmp_path / "fixes.csv", 50)
    with pytest.raises(
        InputError, match=r"fixes\.csv:52: nothing in field 5 where a finite number"
    ):
        read_gnss(tmp_path / "fixes.csv", sigma_velocity=(0.3, 0.3, 0.3))
