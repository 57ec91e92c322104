"""Poses that are not of the flight, or not as somebody thinks, are refused with an explanation."""

from dataclasses import replace

import numpy as np
import pytest
from posed_flights import PLAIN, Posed, only, posed

from insgnss.base.errors import InputError
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.photogrammetry.mounting_calibration.options import Assumptions
from insgnss.photogrammetry.mounting_calibration.plausibility import (
    FlightPath,
    gross_errors,
    misfit,
    refuse_frame,
    refuse_implausible,
)
from insgnss.photogrammetry.mounting_calibration.records import CameraPoses
from insgnss.photogrammetry.mounting_calibration.solution import solve

OF_ITS_OWN = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def refused(of: Posed, path: FlightPath | None = None) -> str:
    with pytest.raises(InputError) as caught:
        refuse_implausible(of.block, of.flight, of.rows, path)
    return str(caught.value)


def changed(of: Posed, **parts) -> Posed:
    return replace(of, block=replace(of.block, cov=None, **parts))


def shifted(of: Posed, images: int) -> Posed:
    """Each image beside the pose of another."""
    rows = of.rows[images:] if images > 0 else of.rows[:images]
    poses = of.rows[:-images] if images > 0 else of.rows[-images:]
    block = of.block.taken(poses)
    return replace(of, block=replace(block, images=of.block.taken(rows).images), rows=rows)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("georeferenced", [True, False])
def test_no_good_poses_are_refused(seed, georeferenced) -> None:
    of = posed(seed=seed, georeferenced=georeferenced)
    refuse_implausible(of.block, of.flight, of.rows, None)
    refuse_frame(solve(of.block, of.flight, of.rows, Assumptions()))


@pytest.mark.parametrize(("images", "words"), [(1, "the pose 1 before it"), (-2, "2 behind it")])
def test_images_that_are_shifted(images, words) -> None:
    assert words in refused(shifted(posed(seed=1), images))


def test_the_reversed_order() -> None:
    of = posed(replace(PLAIN, headings_deg=(10.0, 190.0, 100.0), speeds=(15.0,) * 3), seed=1)
    block = of.block
    reverse = changed(of, position=block.position[::-1], C_rc=block.C_rc[::-1])
    assert "reversed order" in refused(reverse)


@pytest.mark.parametrize("georeferenced", [True, False])
def test_axes_that_are_exchanged_or_mirrored(georeferenced) -> None:
    of = posed(seed=2, georeferenced=georeferenced)
    X = of.block.position
    assert "x and y exchanged" in refused(changed(of, position=X @ OF_ITS_OWN))
    assert "z with the other sign" in refused(changed(of, position=X * [1.0, 1.0, -1.0]))


def test_attitudes_of_the_other_sense() -> None:
    of = posed(seed=2)
    said = refused(changed(of, C_rc=of.block.C_rc.swapaxes(1, 2)))
    assert "rotations that take the axes into the camera" in said


def test_left_handed_attitudes_are_no_rotations() -> None:
    of = posed(seed=2)
    with pytest.raises(InputError, match=r"determinant -1\.0000; 1 is expected\): mirrored axes"):
        changed(of, C_rc=of.block.C_rc * np.array([1.0, 1.0, -1.0]))


def test_poses_of_another_flight() -> None:
    of, other = posed(seed=2), posed(replace(PLAIN, headings_deg=(40.0, 300.0, 80.0) + (0.0,) * 2))
    said = refused(changed(of, position=other.block.position, C_rc=other.block.C_rc))
    assert "poses of another flight" in said
    assert "5 m and 3 deg" in said


def test_three_poses() -> None:
    of = posed(seed=2)
    assert "3 of its images are of this flight; at least 4" in refused(only(of, np.arange(3)))


def test_the_poses_of_the_flight_itself() -> None:
    of = posed(seed=2)
    eo = of.flight.eo
    own = changed(of, position=eo.position_m, C_rc=eo.C_mc)
    assert "those of the flight itself" in refused(own)
    near = replace(own, block=replace(own.block, position=eo.position_m + [0.0, 0.0, 0.01]))
    rng = np.random.default_rng(5)
    noisy = eo.position_m + 2e-4 * rng.standard_normal(eo.position_m.shape)
    near = replace(near, block=replace(near.block, position=noisy))
    with pytest.raises(InputError, match="of this flight's own trajectory"):
        refuse_frame(solve(near.block, near.flight, near.rows, Assumptions()))


@pytest.mark.slow
def test_a_scale_that_was_held_wrong() -> None:
    of = posed(seed=3)
    X = of.block.position
    large = changed(of, position=X.mean(axis=0) + 1.003 * (X - X.mean(axis=0)))
    refuse_implausible(large.block, large.flight, large.rows, None)
    with pytest.raises(InputError, match=r"0\.30 % too large for its coordinates"):
        refuse_frame(solve(large.block, large.flight, large.rows, Assumptions()))
    free = Assumptions(frame="similarity")
    refuse_frame(solve(large.block, large.flight, large.rows, free))  # asked for


def test_camera_axes_of_another_program() -> None:
    """A camera that sits the other way has another T, one with axes right-up-back has not."""
    of = posed(seed=3)
    other = changed(of, C_rc=of.block.C_rc * np.array([-1.0, -1.0, 1.0]))
    with pytest.raises(InputError, match=r"camera_from_body is wrong; with \[\[1, 0, 0\]"):
        refuse_frame(solve(other.block, other.flight, other.rows, Assumptions()))
    up = changed(of, C_rc=of.block.C_rc * np.array([1.0, -1.0, -1.0]))
    with pytest.raises(InputError, match="a camera with other axes, such as right, up, back"):
        refuse_frame(solve(up.block, up.flight, up.rows, Assumptions()))


@pytest.mark.parametrize(("off_m", "off_deg"), [(1.0, 0.0), (0.0, 2.0)])
def test_a_single_pose_that_is_wrong_is_named(off_m, off_deg) -> None:
    """Oracle: the image that was changed, by so much."""
    of = posed(seed=4)
    assert gross_errors(solve(of.block, of.flight, of.rows, Assumptions()))[1] == ()
    X, C = of.block.position.copy(), of.block.C_rc.copy()
    X[17, 2] += off_m
    C[17] = rotation_from_vector(np.radians([0.0, 0.0, off_deg])) @ C[17]
    wrong = replace(of, block=replace(of.block, position=X, C_rc=C))
    good, (words,) = gross_errors(solve(wrong.block, wrong.flight, wrong.rows, Assumptions()))
    assert np.flatnonzero(~good).tolist() == [17]
    assert words.startswith("0017.tif is left out")


def test_exposures_in_utc() -> None:
    """Oracle: the stamps are 18 s early; the path of the flight tells so."""
    of = posed(seed=4)
    eo = of.flight.eo
    t = np.arange(eo.time[0] - 30.0, eo.time[-1] + 30.0, 0.05)

    def interpolated(x):
        return np.stack([np.interp(t, eo.time + 18.0, x[:, k]) for k in range(3)], axis=1)

    nearest = np.abs(t[:, None] - eo.time - 18.0).argmin(axis=1)
    path = FlightPath(t, interpolated(eo.position_m), eo.C_mc[nearest])
    late = replace(of.flight, eo=replace(eo, position_m=path.at(eo.time)[0]))
    said = refused(replace(of, flight=late), path)
    assert "+18.0 s" in said
    assert "the 18 leap seconds between GPS time and UTC" in said


def test_poses_that_are_not_finite() -> None:
    of = posed(seed=4)
    X = of.block.position.copy()
    X[7, 1] = np.nan
    with pytest.raises(InputError, match=r"position of image 0007\.tif is not finite"):
        replace(of.block, position=X)
    with pytest.raises(InputError, match="shape"):
        CameraPoses(("a",), np.zeros((2, 3)), np.zeros((1, 3, 3)))


def test_the_misfit_is_what_was_put_in() -> None:
    """Oracle: noise of 2 m in each coordinate, a tilt of 1 deg rms about each axis."""
    of = posed(seed=5, noise=0.0)
    rng = np.random.default_rng(6)
    X = of.block.position + 2.0 * rng.standard_normal(of.block.position.shape)
    eo = of.flight.eo
    found = misfit(X, of.block.C_rc, eo.position_m, eo.C_mc)
    assert found.position_m == pytest.approx(2.0 * np.sqrt(3.0), rel=0.15)
    assert found.attitude_rad < np.radians(0.3)
