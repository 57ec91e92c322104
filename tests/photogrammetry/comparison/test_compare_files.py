"""Two files against each other: formats, matching, statistics, and the answer's three shapes."""

import json
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compared_files import Written
from numpy.testing import assert_allclose

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.cli import main
from insgnss.geodesy.frames import TangentPlane, ecef_to_geodetic
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.orientation.eo_local_plane import write_eo_local_plane
from insgnss.io.formats.orientation.generic_ascii import write_generic_ascii
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.comparison.compare import compare_files, compare_poses
from insgnss.photogrammetry.comparison.matching import covered_instants, match, times
from insgnss.photogrammetry.comparison.reading import read_poses
from insgnss.photogrammetry.comparison.result import Comparison
from insgnss.report.charts.files import charts_of

EO_FILES = ("eo.json", "EO_local-plane.txt", "metashape.csv")


def largest(c: Comparison, names: tuple[str, ...]) -> float:
    return max(float(np.abs(x.difference).max()) for x in c.components if x.name in names)


@pytest.mark.parametrize("a", EO_FILES)
@pytest.mark.parametrize("b", EO_FILES)
def test_the_formats_of_one_orientation_agree_to_their_digits(
    flight: Written, a: str, b: str
) -> None:
    """Oracle: what their printed digits leave: 0.1 mm, 1e-6 deg."""
    c = compare_files(flight[a], flight[b])
    assert c.matched_by == "image"
    assert c.n == len(flight.eo.images)
    assert largest(c, ("east", "north", "up")) < 2e-4
    assert largest(c, ("about east", "about north", "about up")) < np.radians(4e-6)
    assert c.findings == ()


def test_trajectories_agree_to_their_digits(flight: Written) -> None:
    """Oracle: what the digits of trajectory.csv leave; the SBET is exact."""
    c = compare_files(flight["trajectory.csv"], flight["trajectory.sbet"])
    assert c.matched_by == "time"
    assert c.n == flight.trajectory.time.size
    assert largest(c, ("east", "north", "up")) < 1e-4
    assert largest(c, ("v east", "v north", "v up")) < 1e-5
    assert c.findings == ()


def test_images_meet_the_interpolated_trajectory_but_for_the_lever_arm(flight: Written) -> None:
    """Oracle: the rig's lever arm, and the simulated motion between the samples of 10 Hz."""
    c = compare_files(flight["trajectory.sbet"], flight["eo.json"], gps_week=2008)
    assert c.matched_by == "time"
    assert c.n == len(flight.eo.images)
    lever = next(f for f in c.findings if f.name == "lever arm")
    assert_allclose(
        [lever.values["forward_m"], lever.values["right_m"]], flight.camera_lever_b[:2], atol=0.003
    )
    assert lever.after < 0.002
    assert largest(c, ("about east", "about north", "about up")) < np.radians(0.02)


def test_antenna_positions_show_their_lever_arm_and_the_statistics_of_the_fixes(
    flight: Written,
) -> None:
    """Oracle: the rig's lever arm; errors of the fixes are as large as their standard
    deviations.
    """
    c = compare_files(flight["trajectory.csv"], flight["antenna.txt"], gps_week=2008)
    assert [f.name for f in c.findings] == ["lever arm"]
    values = c.findings[0].values
    assert_allclose([values["forward_m"], values["right_m"]], flight.antenna_lever_b[:2], atol=0.01)
    east = next(x for x in c.remaining if x.name == "east")
    assert 0.7 < east.statistics()["normalised_rms"] < 1.2


def test_fixes_of_rtklib_and_of_a_table_are_the_same(flight: Written) -> None:
    """Oracle: one set of fixes, written twice."""
    c = compare_files(flight["antenna.pos"], flight["antenna.txt"])
    assert (c.form_a, c.point_a, c.matched_by) == ("gnss", "antenna", "time")
    assert largest(c, ("east", "north", "up")) < 2e-4


def test_fixes_without_standard_deviations_have_none(flight: Written, tmp_path: Path) -> None:
    """Oracle: the columns cut off by hand; nothing is invented in their place."""
    lines = [
        " ".join(line.lstrip("# ").split()[:4])
        for line in flight["antenna.txt"].read_text().splitlines()
    ]
    (tmp_path / "bare.txt").write_text("\n".join(lines) + "\n")
    assert read_poses(tmp_path / "bare.txt").cov_position is None
    assert read_poses(flight["antenna.txt"]).cov_position is not None


@pytest.mark.parametrize("crs", [None, "EPSG:2056", "EPSG:32632"])
def test_a_table_in_any_frame_is_brought_to_one(
    flight: Written, tmp_path: Path, crs: str | None
) -> None:
    """Oracle: the master; a grid turns the attitude by 0.66 or 1.8 deg, and heights stay those
    above the ellipsoid.
    """
    framed = (
        in_frame(flight.eo, "geocentric")
        if crs is None
        else in_frame(flight.eo, "projected", MapProjection(crs))
    )
    write_generic_ascii(framed, tmp_path / "eo.txt")
    c = compare_files(flight["eo.json"], tmp_path / "eo.txt")
    assert largest(c, ("east", "north", "up")) < 3e-4
    assert largest(c, ("about east", "about north", "about up")) < np.radians(4e-6)


def test_statistics_of_known_differences(flight: Written) -> None:
    """Oracle: drawn with the standard deviations of both files: root of the mean square over sigma
    is 1 within its own scatter.
    """
    a = read_poses(flight["eo.json"])
    n = 4000
    rows = np.arange(n) % a.n
    many = replace(a.taken(rows), images=tuple(f"{k}" for k in range(n)), time=None)
    e = (
        np.random.default_rng(1).standard_normal((n, 6))
        * np.sqrt(2.0)
        * [0.01, 0.01, 0.02, 5e-4, 5e-4, 2e-3]
    )
    at = np.einsum("nij,nj->ni", many.C_eE, e[:, :3])
    assert many.C_Ex is not None
    moved = replace(
        many.moved(*ecef_to_geodetic(many.ecef + at)),
        C_Ex=rotation_from_vector(e[:, 3:]) @ many.C_Ex,
    )
    c = compare_poses(many, moved)
    assert [x.name for x in c.components] == [
        "east",
        "north",
        "up",
        "about east",
        "about north",
        "about up",
    ]
    for k, x in enumerate(c.components):
        s = x.statistics()
        assert_allclose(x.difference, e[:, k], atol=1e-6)
        assert s["rms"] == pytest.approx(np.sqrt(np.mean(e[:, k] ** 2)), rel=1e-4)
        assert s["largest"] == pytest.approx(np.abs(e[:, k]).max(), rel=1e-3)
        assert abs(s["normalised_rms"] - 1.0) < 0.04
    assert c.findings == ()


def test_answer_as_text_as_dict_and_as_picture(flight: Written) -> None:
    """Oracle: the same numbers in all; PNG's magic."""
    c = compare_files(flight["eo.json"], flight["metashape.csv"])
    assert f"{c.n} poses matched by image" in c.summary()
    assert "no mismatch" in c.summary()
    told = json.loads(json.dumps(c.as_dict()))
    assert told["matched"] == c.n
    assert told["components"]["up"]["unit"] == "m"
    assert told["components"]["up"]["rms"] == c.components[2].statistics()["rms"]
    assert c.figure().startswith(b"\x89PNG")
    assert c.figure("pdf").startswith(b"%PDF")


@pytest.mark.slow
def test_page_and_picture_show_the_same_differences(
    flight: Written, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Oracle: the differences that the comparison has, in the units of the screen."""
    files = [str(flight[name]) for name in ("eo.json", "metashape.csv")]
    page = tmp_path / "compare.html"
    figure = tmp_path / "compare.svg"
    other = str(flight["EO_local-plane.txt"])
    argv = ["--page", str(page), "--figure", str(figure), "-q"]
    assert main(["compare", *files, *argv]) == 0
    before = page.read_bytes()
    assert main(["compare", files[0], other, *argv]) == 2  # other inputs
    assert page.read_bytes() == before
    assert main(["compare", files[0], other, *argv[:2], "-q"]) == 2
    assert "compare.svg exists and was made from other inputs" in capsys.readouterr().err
    for word in ([], ["--force"]):
        assert main(["compare", *files, *argv, *word]) == 0
    assert figure.read_bytes().startswith(b"<?xml")
    _, charts = charts_of(page)
    result = compare_files(*map(Path, files))
    assert len(charts[0].panels) == len(result.components)
    for panel, component in zip(charts[0].panels, result.components, strict=True):
        shown = next(x for x in panel.layers if x.kind in ("line", "points")).y
        expected = component.screen[0] * component.difference
        assert_allclose(shown[np.isfinite(shown)], expected, atol=1e-3 * np.ptp(expected) + 1e-6)
    html = page.read_text()
    assert "<strong>Good</strong>: names, axes," in html
    assert "no mismatch recognised" in html
    capsys.readouterr()


def test_names_without_directory_and_ending_are_matched(flight: Written, tmp_path: Path) -> None:
    """Oracle: the names, changed by hand."""
    eo = replace(
        flight.eo,
        images=tuple(f"flight/{name.removesuffix('.tif')}.JPG" for name in flight.eo.images),
    )
    write_eo_json(eo, tmp_path / "other.json")
    c = compare_files(flight["eo.json"], tmp_path / "other.json")
    assert (c.matched_by, c.n) == ("image", len(eo.images))


def test_poses_without_partner_are_counted(flight: Written, tmp_path: Path) -> None:
    """Oracle: three images taken out."""
    lines = flight["metashape.csv"].read_text().splitlines(keepends=True)
    (tmp_path / "metashape.csv").write_text("".join(lines[:1] + lines[4:]))
    c = compare_files(flight["eo.json"], tmp_path / "metashape.csv")
    assert (c.left_a, c.left_b) == (3, 0)


def test_a_tangent_plane_without_origin_takes_that_of_the_other_file(
    flight: Written, tmp_path: Path
) -> None:
    """Oracle: a note says so; alone it is refused, and an origin given by the caller serves."""
    text = flight["EO_local-plane.txt"].read_text()
    path = tmp_path / "EO.txt"
    path.write_text("".join(line + "\n" for line in text.splitlines() if "origin:" not in line))
    c = compare_files(flight["eo.json"], path)
    assert largest(c, ("east", "north", "up")) < 2e-4
    assert any("does not give the origin of its tangent plane" in note for note in c.notes)
    with pytest.raises(InputError, match="coordinates of a tangent plane without its origin"):
        compare_files(flight["metashape.csv"], path)
    lat, lon = np.degrees(flight.eo.origin[:2])
    c = compare_files(flight["metashape.csv"], path, origin=(lat, lon, flight.eo.origin[2]))
    assert largest(c, ("east", "north", "up")) < 2e-4
    lines = flight["metashape.csv"].read_text().splitlines()
    for value in ("0", "-0.01"):
        changed = lines[2].split(",")
        changed[8] = value
        path.write_text("\n".join([*lines[:2], ",".join(changed), *lines[3:]]) + "\n")
        with pytest.raises(InputError, match=f"pose 2: a standard deviation of {value}, others"):
            read_poses(path, "metashape")
    for value in ("\N{MINUS SIGN}46.5", "4,65", "465.7", "1_0", "\N{ARABIC-INDIC DIGIT THREE}"):
        other = re.sub(r"(?<=latitude )\S+", value, text, count=1)
        path.write_text(other, encoding="utf-8")
        with pytest.raises(
            InputError, match=f"the header's 'latitude {value} deg, .* is no origin"
        ):
            compare_files(flight["metashape.csv"], path)


def test_another_origin_is_no_difference(flight: Written, tmp_path: Path) -> None:
    """Oracle: the same poses written about an origin 2 km away, whose axes lean by a minute of
    arc.
    """
    plane, other = (
        TangentPlane(*flight.eo.origin),
        TangentPlane(flight.eo.origin[0] + 3e-4, flight.eo.origin[1], 100.0),
    )
    geodetic = plane.geodetic_from_position(flight.eo.position_m)
    turn = other.C_em.T @ plane.C_em
    assert np.abs(turn - np.eye(3)).max() > 1e-4
    moved = replace(
        flight.eo,
        origin=np.array([other.lat, other.lon, other.height]),
        position_m=other.position_from_geodetic(*geodetic),
        C_mc=turn @ flight.eo.C_mc,
    )
    write_eo_local_plane(in_frame(moved, "tangent plane"), tmp_path / "EO.txt")
    c = compare_files(flight["eo.json"], tmp_path / "EO.txt")
    assert largest(c, ("east", "north", "up")) < 2e-4
    assert largest(c, ("about east", "about north", "about up")) < np.radians(4e-6)


def test_heights_above_the_geoid_compare_once_its_height_is_given(
    flight: Written, tmp_path: Path
) -> None:
    """Oracle: the file before 47.3 m were taken off its heights."""
    text = flight["antenna.pos"].read_text()
    rows = [line.split() for line in text.splitlines() if not line.startswith("%")]
    head = [
        line.replace("ellipsoidal", "geodetic")
        for line in text.splitlines()
        if line.startswith("%")
    ]
    lower = tmp_path / "above_geoid.pos"
    lower.write_text(
        "\n".join(
            [
                *head,
                *(" ".join([*row[:4], f"{float(row[4]) - 47.3:.4f}", *row[5:]]) for row in rows),
            ]
        )
        + "\n"
    )
    assert (
        main(["compare", str(flight["antenna.pos"]), str(lower), "--undulation-b", "47.3", "-q"])
        == 0
    )
    c = compare_files(flight["antenna.pos"], lower, undulation_b_m=47.3)
    assert largest(c, ("east", "north", "up")) < 2e-4
    with pytest.raises(InputError, match="--undulation-a, --undulation-b"):
        compare_files(flight["antenna.pos"], lower)
    with pytest.raises(UsageError, match="leave the height of the geoid out"):
        compare_files(flight["eo.json"], lower, undulation_a_m=47.3, undulation_b_m=47.3)


def test_gaps_are_not_interpolated(flight: Written, tmp_path: Path) -> None:
    """Oracle: a hole of 20 s cut into the trajectory: images within it have no partner."""
    lines = flight["trajectory.csv"].read_text().splitlines(keepends=True)
    (tmp_path / "trajectory.csv").write_text("".join(lines[:400] + lines[600:]))
    t = flight.trajectory.time
    hidden = int(((flight.eo.time > t[398]) & (flight.eo.time < t[599])).sum())
    assert hidden > 3
    assert compare_files(flight["eo.json"], tmp_path / "trajectory.csv").left_a == hidden


def test_gaps_of_three_steps_are_interpolated() -> None:
    """Oracle: three times the usual step of 0.1 s, a little less and a little more; nothing before
    the first sample and after the last.
    """
    before = 0.1 * np.arange(20.0)
    for gap, inside in ((0.299, True), (0.301, False)):
        samples = np.concatenate([before, before[-1] + gap + before])
        wanted = np.array([-0.01, 0.0, 1.0, before[-1] + 0.1, samples[-1], samples[-1] + 0.01])
        expected = [False, True, True, inside, True, False]
        assert covered_instants(samples, wanted).tolist() == expected


@pytest.mark.parametrize("weeks", [-1, 1, 3])
def test_times_of_another_week_are_those_of_the_first(flight: Written, weeks: int) -> None:
    """Oracle: the same instants, counted from the start of a week before or after."""
    eo, path = read_poses(flight["eo.json"]), read_poses(flight["trajectory.csv"])
    assert path.gps_week is not None
    assert path.time is not None
    moved = replace(path, gps_week=path.gps_week + weeks, time=path.time - 604800.0 * weeks)
    assert_allclose(times(eo, moved)[1], path.time, rtol=0, atol=1e-6)
    want, got = match(eo, path), match(eo, moved)
    assert (got.left_a, got.left_b) == (want.left_a, want.left_b)
    assert_allclose(got.b.ecef, want.b.ecef, rtol=0, atol=1e-4)


def test_refusals(flight: Written, tmp_path: Path) -> None:
    """Oracle: the house rule: what, and what to do."""
    with pytest.raises(UsageError, match="format 'pdf' cannot be compared; it is one of eo_json"):
        compare_files(flight["eo.json"], flight["eo.json"], form_a="pdf")
    with pytest.raises(InputError, match="cannot be read"):
        compare_files(flight["eo.json"], tmp_path / "none.txt")
    with pytest.raises(
        DataError,
        match=r"has no times, .* no image names: nothing tells which poses belong together",
    ):
        compare_files(flight["metashape.csv"], flight["trajectory.csv"])
    eo = replace(flight.eo, images=tuple(f"x{name}" for name in flight.eo.images))
    write_eo_local_plane(in_frame(eo, "tangent plane"), tmp_path / "EO.txt")
    with pytest.raises(DataError, match="no image has the same name"):
        compare_files(flight["eo.json"], tmp_path / "EO.txt")
    late = replace(read_poses(flight["trajectory.csv"]), gps_week=2010)
    with pytest.raises(DataError, match="the time spans of the files do not overlap"):
        compare_poses(read_poses(flight["eo.json"]), late)


def test_formats_are_told_by_content_not_by_name(flight: Written, tmp_path: Path) -> None:
    """Oracle: files under other names."""
    for name, form in (
        ("eo.json", "eo_json"),
        ("EO_local-plane.txt", "eo_local_plane"),
        ("metashape.csv", "metashape"),
    ):
        shutil.copy(flight[name], tmp_path / "a.txt")
        assert read_poses(tmp_path / "a.txt").form == form
    shutil.copy(flight["trajectory.csv"], tmp_path / "b.txt")
    assert read_poses(tmp_path / "b.txt").form == "trajectory_csv"
    shutil.copy(flight["antenna.txt"], tmp_path / "c.txt")
    assert read_poses(tmp_path / "c.txt").form == "gnss"


def test_points_and_cameras_of_two_adjustments_are_compared(flight: Written, tmp_path) -> None:
    """Oracle: by hand: x is 3 mm off at sigmas of 3 and 4 mm, f 5 px at 0.6 and 0.8 px; a point
    and a camera parameter that one of both does not have take no part.
    """
    for name, x, f, sigma, extra in (
        ("a", 1.0, 3000.0, 0.003, 0.6),
        ("b", 1.003, 3005.0, 0.004, 0.8),
    ):
        (directory := tmp_path / name).mkdir()
        shutil.copy(flight["eo.json"], directory / "eo.json")
        rows = [f"P{k},{x + k},2,3,{sigma},1,1,0,0,0,4,tie" for k in range(3)] + [
            f"of_{name},0,0,0,1,1,1,0,0,0,2,tie"
        ]
        header = "point,x,y,z,sd_x,sd_y,sd_z,cov_xy,cov_xz,cov_yz,rays,role"
        (directory / "points.csv").write_text("\n".join([header, *rows]) + "\n")
        of_f = {"value": f, "sigma": extra, "estimated": True}
        held = {"value": 0.0, "sigma": None, "estimated": False}
        camera = {"name": "C", "parameters": {"f": of_f, "k4": held}}
        (directory / "adjust.json").write_text(json.dumps({"cameras": [camera]}))
    c = compare_files(tmp_path / "a", tmp_path / "b" / "adjust.json")
    of_x = c.adjusted.points[0].statistics()
    assert_allclose([of_x["mean"], of_x["normalised_rms"]], [0.003, 0.6], rtol=1e-9)
    (of_f,) = c.adjusted.parameters
    assert_allclose([of_f.difference, of_f.ratio], [5.0, 5.0])
    assert "f of C 5.0" in c.summary()
    assert c.as_dict()["cameras"][0]["sigma"] == pytest.approx(1.0)
    (tmp_path / "b" / "points.csv").unlink()
    without = compare_files(tmp_path / "a", tmp_path / "b")
    assert without.adjusted.points == ()
    assert "output.tables" in without.summary()
    assert compare_files(flight["eo.json"], tmp_path / "b").adjusted.parameters == ()
    (tmp_path / "b" / "eo.json").unlink()
    with pytest.raises(InputError, match=r"adjust\.json: no eo\.json beside it"):
        compare_files(tmp_path / "a", tmp_path / "b")
