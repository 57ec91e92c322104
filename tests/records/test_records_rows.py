"""Rows of records by name, index, mask and time; trajectories between their epochs; tables."""

from dataclasses import replace

import numpy as np
import pandas
import pytest

import insgnss
from insgnss.flight.config.changes import with_changes
from insgnss.geodesy.frames import LocalFrame
from insgnss.geodesy.rotation import rotation_from_rpy, vector_from_rotation
from insgnss.navigation.orient.frame import in_frame
from insgnss.navigation.orient.relative import GyroFigures, relative_control
from insgnss.records import gnss_fixes, imu_samples

N = 6
RNG = np.random.default_rng(7)


def spd(n: int, size: int) -> np.ndarray:
    """(n, size, size) covariances, by factors of ones and small numbers."""
    L = np.eye(size) + 0.1 * np.tril(RNG.standard_normal((n, size, size)))
    return L @ np.swapaxes(L, 1, 2)


def orientation() -> insgnss.ExteriorOrientation:
    names = tuple(f"DSC{k:04d}" for k in range(N))
    C = rotation_from_rpy(0.1 * RNG.standard_normal((N, 3)))
    place = np.array([0.8, 0.1, 500.0])
    cross = 0.3 * spd(N - 1, 6)
    return insgnss.ExteriorOrientation(
        *(
            names,
            10.0 * np.arange(N),
            2008,
            place,
            RNG.standard_normal((N, 3)),
            C,
            spd(N, 6),
            cross,
            np.eye(3),
            np.eye(3),
        )
    )


def path(step_s: float = 0.1, seconds: float = 4.0) -> insgnss.Trajectory:
    """A bend of 20 m radius at 10 m/s, banked and climbing: exact pose and velocity."""
    time = np.arange(round(seconds / step_s) + 1) * step_s
    return bend(time)


def bend(time: np.ndarray) -> insgnss.Trajectory:
    frame, rate, radius = LocalFrame(0.81, 0.11, 400.0), 0.5, 20.0
    angle = rate * time
    position = np.column_stack(
        [radius * np.sin(angle), radius * (1.0 - np.cos(angle)), -0.5 * time]
    )
    velocity = np.column_stack(
        [radius * rate * np.cos(angle), radius * rate * np.sin(angle), np.full(time.size, -0.5)]
    )
    lat, lon, height = frame.geodetic_from_position(position)
    C_nl = np.swapaxes(frame.C_ln(lat, lon), 1, 2)
    C_lb = rotation_from_rpy(
        np.column_stack([np.full(time.size, 0.3), np.full(time.size, 0.05), angle])
    )
    velocity = np.einsum("nij,nj->ni", C_nl, velocity)
    cov = (1.0 + time)[:, None, None] * np.eye(9)
    return insgnss.Trajectory(time, lat, lon, height, velocity, C_nl @ C_lb, cov, 2008)


def test_rows_are_chosen_by_name_index_slice_mask_and_time():
    """Oracle: numpy on the arrays of the record."""
    eo = orientation()
    eo = replace(eo, velocity_mps=np.ones((N, 3)) * eo.time[:, None], rate_radps=eo.position_m)
    cases = [
        ("DSC0002", [2]),
        (3, [3]),
        (-1, [5]),
        (np.int64(4), [4]),
        (slice(1, 4), [1, 2, 3]),
        (slice(None, None, 2), [0, 2, 4]),
        (slice("DSC0001", "DSC0003"), [1, 2, 3]),
        (["DSC0004", "DSC0001"], [4, 1]),
        ([0, -1], [0, 5]),
        (eo.time > 25.0, [3, 4, 5]),
        ([], []),
    ]
    for key, rows in cases:
        part = eo[key]
        assert type(part) is insgnss.ExteriorOrientation
        assert part.images == tuple(eo.images[k] for k in rows)
        for field in ("time", "position_m", "C_mc", "cov", "velocity_mps", "rate_radps"):
            np.testing.assert_array_equal(getattr(part, field), getattr(eo, field)[rows])
        np.testing.assert_array_equal(part.origin, eo.origin)
    assert eo.between(10.0, 30.0).images == eo.images[1:4]
    assert eo.between(11.0, 12.0).images == ()
    assert eo.at([30.0, 10.0]).images == (eo.images[3], eo.images[1])
    assert [one.images[0] for one in eo] == list(eo.images)
    assert len(eo) == N


def test_neighbours_keep_their_cross_covariance_and_others_do_not_know_it():
    """Oracle: the blocks of the whole; rows k and k + 1 belong together."""
    eo = orientation()
    np.testing.assert_array_equal(eo[1:4].cross, eo.cross[1:3])
    np.testing.assert_array_equal(eo[[2, 3, 4]].cross, eo.cross[2:4])
    np.testing.assert_array_equal(eo[eo.time < 25.0].cross, eo.cross[:2])
    assert eo["DSC0001"].cross.shape == (0, 6, 6)
    assert eo[:0].cross.shape == (0, 6, 6)
    for key in ([0, 2], [1, 0], slice(None, None, 2), slice(None, None, -1)):
        assert eo[key].cross is None
    assert eo[[0, 2]][:1].cross is None


def test_formats_that_need_the_cross_covariance_refuse_a_choice_without_it(tmp_path):
    """Oracle: all images, which both write; eo.json keeps that it is not known."""
    eo = orientation()
    eo = replace(
        eo, C_mc=np.tile(np.eye(3), (N, 1, 1)), position_m=np.outer(np.arange(N), [50.0, 0.0, 0.0])
    )  # a straight line
    figures = GyroFigures(1e-4, 1e-5)
    for part, known in ((eo, True), (eo[[0, 1, 3]], False)):
        insgnss.export(part, "eo_json", tmp_path / "eo.json")
        back = insgnss.read_eo(tmp_path / "eo.json")
        assert (back.cross is not None) == known
        insgnss.export(part, "metashape", tmp_path / "metashape.csv")
        for write in (
            lambda part=part: insgnss.export(part, "g2o", tmp_path / "a.g2o", max_gap_s=100.0),
            lambda part=part: relative_control(
                in_frame(part, "tangent plane"), figures, gap_s=100.0
            ),
        ):
            if known:
                write()
            else:
                with pytest.raises(insgnss.InputError, match="choose successive images"):
                    write()


def test_rows_that_are_not_there_are_refused_with_the_nearest():
    """Oracle: names and indices that the record does not have."""
    eo = orientation()
    with pytest.raises(KeyError, match="'DSC001' is none of 6 images; near: DSC0001"):
        eo["DSC001"]
    for key in (6, -7, [0, 6]):
        with pytest.raises(IndexError, match="beyond 6 images"):
            eo[key]
    with pytest.raises(IndexError, match="mask of shape"):
        eo[np.ones(5, dtype=bool)]
    with pytest.raises(IndexError, match="by time"):
        eo[[1.5, 2.5]]
    with pytest.raises(
        insgnss.DataError,
        match=r"none of 6 images is at 12\.000000 s; the nearest is at 10\.000000 s",
    ):
        eo.at(12.0)
    with pytest.raises(KeyError, match="has no names"):
        path()["DSC0001"]


def test_a_trajectory_is_interpolated_between_its_epochs():
    """Oracle: the exact bend at these instants. Bounds by (T.1), h^4/384 of r w^4 = 1.25 m/s^4, and
    a bend at a constant rate.
    """
    coarse, wanted = path(0.1), np.arange(0.05, 3.9, 0.037)
    got, exact = coarse.at(wanted), bend(wanted)
    place = LocalFrame(0.81, 0.11, 400.0)
    x, y = (place.position_from_geodetic(t.lat, t.lon, t.height) for t in (got, exact))
    assert np.abs(x - y).max() < 1e-6
    assert np.abs(vector_from_rotation(got.C_nb @ np.swapaxes(exact.C_nb, 1, 2))).max() < 1e-7
    assert np.abs(got.velocity_ned - exact.velocity_ned).max() < 0.5**2 * 10.0 * 0.1**2 / 8.0 * 1.01
    np.testing.assert_allclose(got.cov, exact.cov, atol=1e-12)
    assert got.cross is None
    on = coarse.at(coarse.time)
    np.testing.assert_allclose(on.lat, coarse.lat, atol=1e-15)
    np.testing.assert_allclose(on.C_nb, coarse.C_nb, atol=1e-12)


def test_a_trajectory_is_not_interpolated_outside_or_over_a_gap():
    """Oracle: instants before, behind and in a gap of 1.5 s."""
    whole = path()
    for outside in (-0.1, 4.1):
        with pytest.raises(insgnss.DataError, match=r"is outside 0\.000000 to 4\.000000 s"):
            whole.at(outside)
    gap = whole[(whole.time < 1.0) | (whole.time > 2.45)]
    with pytest.raises(
        insgnss.DataError, match=r"1\.500000 s lies between epochs 1\.600 s apart \(limit 1 s\)"
    ):
        gap.at([0.5, 1.5])
    assert len(gap.at([0.9, 2.5])) == 2
    assert len(whole[:1].at(0.0)) == 1


def test_tables_go_out_and_come_back():
    """Oracle: the record itself; degrees and back are exact to 1e-15."""
    t = path()
    imu = insgnss.ImuSamples(t.time, t.velocity_ned, t.C_nb[:, 0], gps_week=2008)
    fixes = insgnss.GnssFixes(
        *(t.time, t.lat, t.lon, t.height, t.cov[:, :3, :3], t.velocity_ned, t.cov[:, 3:6, 3:6]),
        quality=np.full(len(t), 1),
        gps_week=2008,
    )
    again = imu_samples(imu.to_pandas())
    for name in ("time", "gyro", "accel"):
        np.testing.assert_array_equal(getattr(again, name), getattr(imu, name))
    back = gnss_fixes(fixes.to_pandas())
    for name in (
        "time",
        "lat",
        "lon",
        "height",
        "cov_ned",
        "velocity_ned",
        "velocity_cov_ned",
        "quality",
    ):
        np.testing.assert_allclose(getattr(back, name), getattr(fixes, name), rtol=1e-14)
    assert (again.gps_week, back.gps_week) == (2008, 2008)


def test_tables_carry_the_angles_of_the_products():
    """Oracle: roll, pitch, heading of the bend; standard deviations of its unit covariances about a
    level body.
    """
    table = path().to_pandas()
    np.testing.assert_allclose(
        table["heading_deg"], np.degrees(0.5 * table.index), atol=1e-3
    )  # meridians converge by 2e-4 deg
    np.testing.assert_allclose(table["roll_deg"], np.degrees(0.3), atol=1e-3)
    np.testing.assert_allclose(table["sd_n_m"], np.sqrt(1.0 + table.index), rtol=1e-12)
    assert table.index.name == "tow"
    eo = orientation().to_pandas()
    assert isinstance(eo, pandas.DataFrame)
    assert list(eo.index) == list(orientation().images)
    assert {"e_m", "omega_deg", "sd_kappa_deg", "tow"} <= set(eo.columns)


def test_arrays_go_to_xarray_with_named_dimensions():
    """Oracle: shapes of the fields."""
    data = orientation().to_xarray()
    assert data["cov"].dims == ("image", "pose", "pose_2")
    assert data["position_m"].sel(image="DSC0002").shape == (3,)
    assert path().to_xarray()["C_nb"].dims == ("time", "axis", "axis_2")


def test_a_library_that_is_not_there_is_named(monkeypatch):
    """Oracle: an import that fails."""
    import sys

    monkeypatch.setitem(sys.modules, "xarray", None)
    with pytest.raises(insgnss.UsageError, match="pip install xarray"):
        path().to_xarray()


def test_short_forms_say_what_there_is():
    """Oracle: the numbers of the records."""
    assert (
        repr(orientation())
        == "<ExteriorOrientation 6 images, TOW 0.0 to 50.0 s, week 2008, tangent plane 45.84 5.73>"
    )
    assert repr(path()) == "<Trajectory 41 epochs, TOW 0.0 to 4.0 s, week 2008, 10 Hz>"
    assert repr(orientation()[:0]) == "<ExteriorOrientation 0 images>"


def test_records_change_in_depth_and_name_what_they_do_not_have():
    """Oracle: dataclasses.replace, level by level."""
    noise = insgnss.load_noise_model("navchip")
    changed = with_changes(noise, {"name": "mine", "source": "me"})
    assert changed == replace(noise, name="mine", source="me")
    with pytest.raises(insgnss.UsageError, match="nam: there is no such key; did you mean name"):
        with_changes(noise, {"nam": "x"})
