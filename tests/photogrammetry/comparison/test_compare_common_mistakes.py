"""The commonest mistakes between two files, with exact data: the simplest explanation, its numbers
exact, and nothing beside it.
"""

import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from compared_files import Written
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.cli import compare as verb
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.io.formats.exports import EXPORTS
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.comparison.compare import compare_files, compare_poses
from insgnss.photogrammetry.comparison.poses import Poses
from insgnss.photogrammetry.comparison.position import without
from insgnss.photogrammetry.comparison.reading import POSE_FORMS, read_poses
from insgnss.photogrammetry.comparison.result import Comparison, percent, quantity
from insgnss.photogrammetry.comparison.tables import LAYOUTS

LEVER = np.array([0.462, -0.001, -0.065])


@pytest.fixture(scope="module")
def eo(flight: Written) -> Poses:
    return read_poses(flight["eo.json"])


def antenna(eo: Poses, up: float = 0.0) -> Poses:
    """Positions at the end of the lever arm, without attitude, heights shifted."""
    at = without(eo, eo, -(eo.C_Ex @ LEVER))
    return replace(at, C_Ex=None, point="antenna", height=at.height + up)


def lever_of(c: Comparison) -> list[float]:
    found = next(f for f in c.findings if f.name == "lever arm")
    return [found.values[f"{axis}_m"] for axis in ("right", "down", "view")]


def left(c: Comparison) -> float:
    return max(float(np.abs(x.difference).max()) for x in c.remaining[:3])


def test_an_exported_antenna_shows_its_lever_arm_and_no_height_shift(
    flight: Written, tmp_path: Path
) -> None:
    """Oracle: the lever arm of the export, to the digits of the file."""
    EXPORTS["rtklib_pos"].write(
        in_frame(flight.eo, "geographic"), tmp_path / "antenna.pos", lever_m=LEVER
    )
    c = compare_files(flight["eo.json"], tmp_path / "antenna.pos")
    assert [f.name for f in c.findings] == ["lever arm"]
    assert_allclose(lever_of(c), LEVER, atol=1e-4)
    assert left(c) < 2e-4


def test_the_lever_arm_to_a_trajectory_is_exact_in_height(flight: Written) -> None:
    """Oracle: the rig's lever arm; 10 Hz interpolated."""
    c = compare_files(flight["eo.json"], flight["trajectory.csv"])
    assert [f.name for f in c.findings] == ["lever arm"]
    expected = -(flight.eo.camera_from_body @ flight.eo.boresight @ flight.camera_lever_b)
    assert_allclose(lever_of(c), expected, atol=2e-4)
    assert left(c) < 2e-4


@pytest.mark.parametrize("up", [0.5, -49.6])
def test_exact_data_tell_a_lever_arm_from_a_height_shift(eo: Poses, up: float) -> None:
    """Oracle: both put in; the images lean by a degree, enough for data without noise."""
    c = compare_poses(eo, antenna(eo, up))
    assert len(c.findings) == 2
    assert_allclose(lever_of(c), LEVER, atol=1e-5)
    assert c.findings[1].values["up_m"] == pytest.approx(up, abs=1e-5)
    assert "cannot be separated" not in c.findings[0].statement


def test_noise_does_not_tell_a_lever_arm_from_a_height_shift(eo: Poses) -> None:
    """Oracle: 1 cm of noise over 0.02 rad is half a metre of height: the one explanation, and its
    doubt, are stated.
    """
    b = antenna(eo)
    b = without(b, b, 0.01 * np.random.default_rng(4).standard_normal((eo.n, 3)))
    c = compare_poses(eo, b)
    assert [f.name for f in c.findings] == ["lever arm"]
    assert "its vertical part cannot be separated from a height shift" in c.findings[0].statement
    assert_allclose(lever_of(c), LEVER, atol=0.015)


def test_a_lever_arm_is_not_bent_by_heights_in_feet(eo: Poses) -> None:
    """Oracle: the lever arm; heights a kilometre off by metres from image to image have no say in
    it.
    """
    b = antenna(eo)
    c = compare_poses(eo, replace(b, height=b.height / 0.3048))
    assert [f.name for f in c.findings][:2] == ["lever arm", "feet"]
    assert_allclose(lever_of(c), LEVER, atol=2e-4)


@pytest.mark.parametrize(
    ("shift", "words"),
    [
        ((1.2, 0.0, 0.0), "E +1.200"),
        ((0.35, -0.6, 0.8), "E +0.350 N -0.600 U +0.800 m"),
        ((100.0, -50.0, 3.0), "E +100.000 N -50.000 U +3.000 m"),
    ],
)
@pytest.mark.parametrize("size", [1.0, 20.0])
@pytest.mark.parametrize("plane", [True, False])
def test_a_constant_shift_is_nothing_else(
    eo: Poses, shift: tuple[float, ...], words: str, size: float, plane: bool
) -> None:
    """Oracle: the shift, in the tangent plane or at each point, of a block of 0.3 or 6 km."""
    assert eo.plane is not None
    assert eo.local is not None
    local = eo.local * [size, size, 1.0]
    a = eo.moved(*eo.plane.geodetic_from_position(local))
    b = (
        a.moved(*eo.plane.geodetic_from_position(local + shift))
        if plane
        else without(a, a, np.tile(-np.array(shift), (a.n, 1)))
    )
    c = compare_poses(a, b)
    assert [f.name for f in c.findings] == ["shift"]
    assert c.findings[0].alternatives == ()
    assert_allclose(
        list(c.findings[0].values.values()),
        shift,
        atol=(5e-3 if size > 1.0 else 3e-4) if plane else 1e-4,
    )
    assert size > 1.0 or words in c.findings[0].statement


def test_heights_of_a_in_feet_are_told_from_those_of_b(eo: Poses) -> None:
    """Oracle: heights of the first file divided by 0.3048."""
    c = compare_poses(replace(eo, height=eo.height / 0.3048), eo)
    assert [f.name for f in c.findings] == ["metres for feet"]
    assert left(c) < 1e-6


def test_a_length_is_printed_in_metres_from_one_on() -> None:
    """Oracle: by hand."""
    assert [quantity(x, "m") for x in (0.9994, 1.0, 12.345)] == ["999 mm", "1 m", "12.35 m"]
    assert [percent(x) for x in (0.5, 0.991, 1.0 - 1e-8, 1.0)] == [
        *("50.0 %", "99.10 %", "more than 99.99 %", "all")
    ]


@pytest.mark.parametrize(
    ("east", "up", "names"),
    [
        (0.0048, 0.0, []),
        (0.0052, 0.0, ["shift"]),
        (0.0, -0.0048, []),
        (0.0, 0.0052, ["height shift"]),
        (0.0, 4.9, ["height shift"]),
        (0.0, -5.1, ["geoid-sized height"]),
        (0.0, 109.0, ["geoid-sized height"]),
        (0.0, -111.0, ["height shift"]),
    ],
)
def test_from_where_on_a_shift_is_stated(eo: Poses, east: float, up: float, names: list) -> None:
    """Oracle: half a centimetre; heights of a geoid from 5 to 110 m."""
    shifted = without(eo, eo, np.tile([-east, 0.0, -up], (eo.n, 1)))
    assert [f.name for f in compare_poses(eo, shifted).findings] == names


@pytest.mark.parametrize(("length", "found"), [(9.9, True), (10.1, False)])
def test_no_lever_arm_is_longer_than_a_vehicle(eo: Poses, length: float, found: bool) -> None:
    """Oracle: 10 m, across the view of images that turn by half a circle from line to line."""
    assert eo.C_Ex is not None
    lever = length * np.array([0.6, 0.8, 0.0])
    b = replace(without(eo, eo, -(eo.C_Ex @ lever)), C_Ex=None, point="antenna")
    names = [f.name for f in compare_poses(eo, b).findings]
    assert ("lever arm" in names) == found


@pytest.mark.parametrize(("late_s", "names"), [(0.00045, []), (-0.00055, ["time"])])
def test_stamps_half_a_millisecond_apart_are_the_same(
    eo: Poses, late_s: float, names: list
) -> None:
    """Oracle: what was put into the stamps."""
    assert eo.time is not None
    c = compare_poses(eo, replace(eo, time=eo.time + late_s))
    assert [f.name for f in c.findings] == names


@pytest.mark.parametrize("size", [1.0, 20.0])
def test_a_constant_shift_beside_a_geoid_is_nothing_else(eo: Poses, size: float) -> None:
    """Oracle: a shift in the tangent plane, whose height is that of a geoid and leans by half an
    arc minute over 6 km.
    """
    assert eo.plane is not None
    assert eo.local is not None
    local = eo.local * [size, size, 1.0]
    a, b = (
        eo.moved(*eo.plane.geodetic_from_position(local + by))
        for by in ([0.0, 0.0, 0.0], [100.0, 20.0, -49.6])
    )
    c = compare_poses(a, b)
    assert [f.name for f in c.findings] == ["shift", "geoid-sized height"]
    assert_allclose(list(c.findings[0].values.values()), [100.0, 20.0], atol=5e-3)
    assert left(c) < 0.02


@pytest.mark.parametrize("shift", [0.0, 1.2])
def test_less_than_a_millimetre_is_no_scale(eo: Poses, shift: float) -> None:
    """Oracle: 2 ppm of a block of 0.3 km, beside a shift: the shift alone is told."""
    assert eo.plane is not None
    assert eo.local is not None
    c = compare_poses(
        eo,
        eo.moved(
            *eo.plane.geodetic_from_position(
                eo.local * [1.0 + 2e-6, 1.0 + 2e-6, 1.0] + [shift, 0.0, 0.0]
            )
        ),
    )
    assert [f.name for f in c.findings] == ["shift"] * (shift > 0.0)


@pytest.mark.parametrize(
    ("name", "turn", "scale"), [("scale", 0.0, 4e-4), ("turn of the block", np.radians(0.657), 0.0)]
)
def test_scales_and_turns_are_still_told(eo: Poses, name: str, turn: float, scale: float) -> None:
    """Oracle: the grid's scale or convergence, put in."""
    assert eo.plane is not None
    assert eo.local is not None
    R = rotation_from_vector(np.array([0.0, 0.0, turn]))
    c = compare_poses(
        eo,
        eo.moved(
            *eo.plane.geodetic_from_position(eo.local * [1.0 + scale, 1.0 + scale, 1.0] @ R.T)
        ),
    )
    assert [f.name for f in c.findings] == [name]


@pytest.mark.parametrize("k", [-5, -2, -1, 1, 3, 5])
@pytest.mark.parametrize("timed", [True, False])
def test_names_off_by_some_images(eo: Poses, k: int, timed: bool) -> None:
    """Oracle: names moved along the list; beside them a lever arm and a geoid, which must come out
    too.
    """
    b = antenna(eo, -49.6)
    c = compare_poses(
        replace(eo, time=eo.time if timed else None),
        replace(b, images=tuple(np.roll(eo.images, -k)), time=None),
    )
    assert [f.name for f in c.findings] == ["names", "lever arm", "geoid-sized height"]
    assert c.findings[0].values == {"images": -float(k)}
    by = f"{'one' if abs(k) == 1 else abs(k)} {'before' if k > 0 else 'after'} it"
    assert f"the pose of the image {by}" in c.findings[0].statement
    assert_allclose(lever_of(c), LEVER, atol=1e-4)
    assert left(c) < 1e-4
    assert c.findings[0].before > 20.0
    assert "rms" in c.findings[0].sentence()


def test_names_off_by_one_alone_leave_nothing(eo: Poses) -> None:
    """Oracle: the names, moved by one; attitudes follow."""
    c = compare_poses(eo, replace(eo, images=tuple(np.roll(eo.images, 1)), time=None))
    assert [f.name for f in c.findings] == ["names"]
    assert (len(c.remaining[0].difference), c.left_a, c.left_b) == (eo.n - 1, 0, 0)
    assert all(float(np.abs(x.difference).max()) < 1e-9 for x in c.remaining)
    assert c.figure().startswith(b"\x89PNG")


def test_names_in_reversed_order(eo: Poses) -> None:
    """Oracle: the names, reversed."""
    c = compare_poses(eo, replace(eo, images=eo.images[::-1], time=None))
    assert [f.name for f in c.findings] == ["names"]
    assert "reversed order" in c.findings[0].statement
    assert left(c) < 1e-9


def test_a_late_trigger_is_no_names(eo: Poses) -> None:
    """Oracle: an offset of time of 0.95 exposures on a straight line, of which names off by one
    would leave a twentieth.
    """
    assert eo.plane is not None
    time = 2.0 * np.arange(30)
    many = replace(
        eo.taken(np.arange(30) % eo.n),
        images=tuple(f"{k}" for k in range(30)),
        time=time,
        C_Ex=None,
    )
    a, b = (
        many.moved(*eo.plane.geodetic_from_position(np.outer(t, [3.0, 25.0, 0.0])))
        for t in (time, time + 1.9)
    )
    c = compare_poses(replace(a, velocity=np.tile([3.0, 25.0, 0.0], (30, 1))), b)
    assert "names" not in [f.name for f in c.findings]


def test_names_beside_a_line(eo: Poses) -> None:
    """Oracle: uneven steps along a straight line, names off by one: no offset of time and no shift
    explains as much.
    """
    assert eo.plane is not None
    steps = np.random.default_rng(2).uniform(0.5, 2.0, 30)
    at = np.outer(np.cumsum(steps), [3.0, 25.0, 0.0])
    a = replace(
        eo.taken(np.arange(30) % eo.n),
        images=tuple(f"{k:02d}" for k in range(30)),
        time=np.cumsum(steps),
        C_Ex=None,
    )
    a = a.moved(*eo.plane.geodetic_from_position(at))
    c = compare_poses(a, replace(a, images=tuple(np.roll(a.images, 1)), time=None))
    assert [f.name for f in c.findings] == ["names"]


READABLE = [(form, kind) for form in LAYOUTS for kind in EXPORTS[form].frames]


@pytest.mark.parametrize(("form", "kind"), READABLE)
def test_tables_for_other_programs_are_read(
    flight: Written, tmp_path: Path, form: str, kind: str
) -> None:
    """Oracle: the master; what printed digits leave; the format shows itself but for a table
    without header.
    """
    path = tmp_path / f"{form}.txt"
    EXPORTS[form].write(
        (
            in_frame(flight.eo, kind, MapProjection("EPSG:2056"))
            if kind == "projected"
            else in_frame(flight.eo, kind)
        ),
        path,
    )
    bare = form == "pix4d_mapper"
    c = compare_files(
        flight["eo.json"],
        path,
        form_b=form if bare else None,
        crs="EPSG:2056" if bare and kind == "projected" else None,
    )
    assert c.form_b == form
    assert c.matched_by == ("time" if form == "tum" else "image")
    assert c.findings == ()
    assert max(float(np.abs(x.difference).max()) for x in c.components[:3]) < 2e-4
    assert max(float(np.abs(x.difference).max()) for x in c.components[3:]) < np.radians(4e-6)


@pytest.mark.parametrize("form", ["metashape", "metashape_opk"])
@pytest.mark.parametrize("kind", ["geographic", "projected", "tangent plane"])
def test_standard_deviations_of_tables_are_those_of_the_master(
    flight: Written, tmp_path: Path, form: str, kind: str
) -> None:
    """Oracle: the master's, equal for east and north; a fifth of the variance is what the file
    drops with the correlations.
    """
    EXPORTS[form].write(
        in_frame(flight.eo, kind, MapProjection("EPSG:2056") if kind == "projected" else None),
        tmp_path / "eo.csv",
    )
    b, a = read_poses(tmp_path / "eo.csv"), read_poses(flight["eo.json"])
    assert b.cov_position is not None
    assert b.cov_attitude is not None
    assert a.cov_position is not None
    assert a.cov_attitude is not None
    diagonal = [
        np.diagonal(P, axis1=1, axis2=2)
        for P in (a.cov_position, b.cov_position, a.cov_attitude, b.cov_attitude)
    ]
    assert_allclose(diagonal[1], diagonal[0], rtol=1e-3)
    assert_allclose(diagonal[3], diagonal[2], rtol=0.25)


def test_a_table_of_another_frame_or_layout_is_refused(flight: Written, tmp_path: Path) -> None:
    """Oracle: errors say what compare can do; it has no option columns."""
    framed = in_frame(flight.eo, "projected", MapProjection("EPSG:2056"))
    EXPORTS["metashape_offset"].write(framed, tmp_path / "offset.csv")
    with pytest.raises(InputError, match="without the bore-sight: export metashape"):
        read_poses(tmp_path / "offset.csv")
    EXPORTS["pix4d_mapper"].write(framed, tmp_path / "mapper.csv")
    with pytest.raises(InputError, match="--crs"):
        read_poses(tmp_path / "mapper.csv", "pix4d_mapper")
    with pytest.raises(
        InputError, match=r"7 fields, but pix4d_mapper|fields, but inpho_ascii|fields, but tum"
    ):
        read_poses(tmp_path / "mapper.csv", "tum")
    (tmp_path / "strange.txt").write_text("a b c d e f\n" + "1 2 3 4 5 6\n" * 8)
    with pytest.raises(
        InputError, match="give its format, --format-a or --format-b: eo_json"
    ) as refusal:
        read_poses(tmp_path / "strange.txt")
    assert "columns =" not in str(refusal.value)


def test_help_lists_the_forms_without_numpy() -> None:
    """Oracle: the readers' own table."""
    assert tuple(POSE_FORMS) == verb.FORMS
    code = (
        "import sys; from insgnss.cli import build_parser; from insgnss.cli.compare import FORMS;"
        " of_verb = build_parser()._subparsers._group_actions[0].choices['compare'];"
        " h = ' '.join(of_verb.format_help().split()); assert all(f in h for f in FORMS), h;"
        " assert 'numpy' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


@pytest.mark.parametrize(
    ("columns", "words"),
    [
        ([1, 0, 2], "longitude and latitude in degrees"),
        ([0, 1, 2], "latitude and longitude in deg"),
    ],
)
def test_degrees_in_columns_of_metres_are_no_scale(
    eo: Poses, columns: list[int], words: str
) -> None:
    """Oracle: the geographic coordinates of the same images, read as metres of the plane."""
    assert eo.plane is not None
    degrees = np.column_stack([np.degrees(eo.lat), np.degrees(eo.lon), eo.height])[:, columns]
    b = eo.moved(*eo.plane.geodetic_from_position(degrees))
    c = compare_poses(eo, replace(b, local=degrees, C_Ex=None, C_fE=None))
    assert [f.name for f in c.findings] == ["degrees for metres"]
    assert words in c.findings[0].statement
    assert left(c) < 1e-4


def test_no_cause_of_absurd_size_is_named(eo: Poses) -> None:
    """Oracle: a block shrunk to millimetres, and one 300 km away: neither a scale nor a datum."""
    assert eo.plane is not None
    assert eo.local is not None
    small = eo.moved(*eo.plane.geodetic_from_position(eo.local * [1.6e-5, 1.6e-5, 1.0]))
    assert compare_poses(eo, replace(small, local=None)).findings == ()
    far = eo.moved(*eo.plane.geodetic_from_position(eo.local + [3e5, 0.0, 0.0]))
    c = compare_poses(eo, replace(far, local=None, C_Ex=None))
    assert c.findings == ()
    assert any("km apart, which no datum or base station explains" in note for note in c.notes)
    assert not any("km apart" in note for note in compare_poses(eo, eo).notes)
