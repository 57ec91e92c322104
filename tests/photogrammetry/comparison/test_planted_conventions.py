"""Thirty mistaken conventions, each planted into the text of a file, against an orientation that
differs by what an adjustment changes: each is named, with nothing beside it.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from compared_files import Written

from insgnss.base.errors import InputError
from insgnss.geodesy.projection import MapProjection
from insgnss.geodesy.rotation import (
    CV_RUB,
    NED_ENU,
    opk_from_rotation,
    pok_from_rotation,
    rotation_from_opk,
    rotation_from_vector,
    ypr_from_rotation,
)
from insgnss.io.formats.exports import EXPORTS
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.comparison.compare import compare_files, compare_poses
from insgnss.photogrammetry.comparison.poses import Poses
from insgnss.photogrammetry.comparison.reading import read_poses

Change = Callable[[np.ndarray], np.ndarray]
LV95, UTM, PLANE, GLOBE, SPACE = (
    "EPSG:2056",
    "EPSG:32632",
    "tangent plane",
    "geographic",
    "geocentric",
)
SIGMA_M, SIGMA_RAD = 0.01, np.radians(0.003)  # by which the adjustment has moved the images


def written(flight: Written, root: Path, form: str, where: str, **options: object) -> Path:
    """The flight in a format and frame."""
    grid = where.startswith("EPSG:")
    framed = (
        in_frame(flight.eo, "projected", MapProjection(where))
        if grid
        else in_frame(flight.eo, where)
    )
    path = root / EXPORTS[form].product
    EXPORTS[form].write(framed, path, **options)
    return path


def rewritten(path: Path, change: Change, first: int, count: int) -> None:
    """Some of the columns of a table, changed row by row."""
    delimiter = "," if path.suffix == ".csv" else None
    lines = []
    for line in path.read_text().splitlines():
        fields = line.split(delimiter)
        if not line.startswith("#") and len(fields) >= first + count:
            values = np.array([float(x) for x in fields[first : first + count]])
            fields[first : first + count] = [f"{x:.10f}" for x in change(values)]
            line = (delimiter or " ").join(fields)
        lines.append(line)
    path.write_text("\n".join(lines) + "\n")


def order(*columns: int) -> Change:
    return lambda x: x[list(columns)]


def times(*factors: float) -> Change:
    return lambda x: x * factors


def plus(*terms: float) -> Change:
    return lambda x: x + terms


def of_matrix(change: Change) -> Change:
    """A change of a matrix of nine columns."""
    return lambda x: change(x.reshape(3, 3)).reshape(9)


def of_opk(angles: Change) -> Change:
    """Other angles of the rotation of omega, phi, kappa, deg."""
    return lambda x: np.degrees(angles(rotation_from_opk(np.radians([x])))[0])


@dataclass(frozen=True)
class Planted:
    """A change of `count` columns from `first` on of a table, and what must be found."""

    form: str
    where: str
    first: int
    count: int
    change: Change
    name: str
    words: str = ""
    options: tuple[tuple[str, str], ...] = ()


MATRIX = (("columns", "image xyz matrix"),)
MATRIX_CV = (*MATRIX, ("camera_axes", "CV"))
QUARTER = rotation_from_vector(np.array([0.0, 0.0, 0.5 * np.pi]))
POK_WORDS = "rotations in the order phi omega kappa"
PLANTED: dict[str, Planted] = {
    "east and north of a plane": Planted(
        "eo_local_plane", PLANE, 1, 2, order(1, 0), "east for north"
    ),
    "easting and northing of LV95": Planted(
        "metashape_opk", LV95, 1, 2, order(1, 0), "east for north"
    ),
    "easting and northing of UTM": Planted(
        "generic_ascii", UTM, 1, 2, order(1, 0), "east for north"
    ),
    "east westwards": Planted("eo_local_plane", PLANE, 1, 1, times(-1.0), "east reversed"),
    "north southwards": Planted("eo_local_plane", PLANE, 2, 1, times(-1.0), "north reversed"),
    "latitude and longitude": Planted(
        "metashape", GLOBE, 1, 2, order(1, 0), "latitude for longitude"
    ),
    "a geoid": Planted("metashape", GLOBE, 3, 1, plus(-49.6), "geoid-sized height"),
    "heights in feet": Planted("metashape", GLOBE, 3, 1, times(1.0 / 0.3048), "feet"),
    "heights in feet of LV95": Planted("metashape_opk", LV95, 3, 1, times(1.0 / 0.3048), "feet"),
    "another base": Planted("metashape_opk", LV95, 1, 2, plus(0.8, -0.5), "shift"),
    "omega and phi": Planted("eo_local_plane", PLANE, 4, 2, order(1, 0), "angles exchanged"),
    "omega and phi of the grid": Planted(
        "metashape_opk", LV95, 4, 2, order(1, 0), "angles exchanged"
    ),
    "pitch and roll": Planted("metashape", GLOBE, 5, 2, order(1, 0), "angles exchanged"),
    "kappa with the other sign": Planted(
        "eo_local_plane", PLANE, 6, 1, times(-1.0), "sign of angles"
    ),
    "yaw counted to the left": Planted("metashape", GLOBE, 4, 1, times(-1.0), "sign of angles"),
    "radians": Planted(
        "metashape_opk", LV95, 4, 3, times(*[np.pi / 180.0] * 3), "radians for degrees"
    ),
    "gon": Planted("metashape_opk", LV95, 4, 3, times(*[10.0 / 9.0] * 3), "gon for degrees"),
    "phi omega kappa in columns of omega phi kappa": Planted(
        "metashape_opk",
        LV95,
        4,
        3,
        of_opk(lambda R: pok_from_rotation(R)[:, [1, 0, 2]]),
        "angle set",
        POK_WORDS,
    ),
    "phi omega kappa in their order": Planted(
        "eo_local_plane",
        PLANE,
        4,
        3,
        of_opk(pok_from_rotation),
        "angle set",
        "b has phi omega kappa that",
    ),
    "yaw pitch roll": Planted(
        "eo_local_plane",
        PLANE,
        4,
        3,
        of_opk(ypr_from_rotation),
        "angle set",
        "b has yaw pitch roll that",
    ),
    "omega phi kappa of the inverse": Planted(
        "metashape_opk",
        LV95,
        4,
        3,
        of_opk(lambda R: opk_from_rotation(np.swapaxes(R, 1, 2))),
        "inverse",
        "transposed matrix",
    ),
    "a transposed matrix": Planted(
        "generic_ascii", LV95, 4, 9, of_matrix(np.transpose), "inverse", "transposed", MATRIX
    ),
    "a transposed matrix, camera axes down": Planted(
        "generic_ascii", PLANE, 4, 9, of_matrix(np.transpose), "inverse", "inverse", MATRIX_CV
    ),
    "a transposed matrix in ECEF": Planted(
        "generic_ascii", SPACE, 4, 9, of_matrix(np.transpose), "inverse", "transposed", MATRIX
    ),
    "camera axes right, up, back": Planted(
        "generic_ascii", PLANE, 4, 9, of_matrix(lambda R: R @ CV_RUB), "camera axes", "", MATRIX
    ),
    "north, east, down": Planted(
        "generic_ascii",
        PLANE,
        4,
        9,
        of_matrix(lambda R: NED_ENU @ R),
        "axes of the frame",
        "",
        MATRIX,
    ),
    "the image's top": Planted(
        "generic_ascii", UTM, 4, 9, of_matrix(lambda R: R @ QUARTER.T), "yaw turned", "", MATRIX
    ),
    "heading for yaw": Planted("metashape", GLOBE, 4, 1, plus(-90.0), "yaw turned"),
    "grid north": Planted("metashape", GLOBE, 4, 1, plus(0.657), "north"),
    "the bore-sight": Planted(
        "generic_ascii",
        LV95,
        4,
        9,
        of_matrix(lambda R: R @ rotation_from_vector(np.radians([0.66, 0.57, -0.51]))),
        "boresight",
        "",
        MATRIX,
    ),
}


@pytest.fixture(scope="module")
def adjusted(flight: Written) -> Poses:
    """The master as an adjustment would change it: a centimetre and 3 thousandths of a degree."""
    eo = read_poses(flight["eo.json"])
    rng = np.random.default_rng(11)
    assert eo.C_Ex is not None
    turn = rotation_from_vector(SIGMA_RAD * rng.standard_normal((eo.n, 3)))
    east, north, up = SIGMA_M * rng.standard_normal((3, eo.n))
    radius = 6.38e6
    moved = eo.moved(
        eo.lat + north / radius, eo.lon + east / radius / np.cos(eo.lat), eo.height + up
    )
    return replace(moved, C_Ex=turn @ eo.C_Ex, angles=None)


@pytest.mark.slow
@pytest.mark.parametrize("what", PLANTED)
def test_each_is_named_alone(flight: Written, adjusted: Poses, tmp_path: Path, what: str) -> None:
    """Oracle: what was planted."""
    planted = PLANTED[what]
    path = written(flight, tmp_path, planted.form, planted.where, **dict(planted.options))
    rewritten(path, planted.change, planted.first, planted.count)
    c = compare_poses(adjusted, read_poses(path, planted.form))
    assert [f.name for f in c.findings] == [planted.name]
    assert planted.words in c.findings[0].sentence()
    for x in c.remaining:
        limit = 4.0 * (SIGMA_M if x.unit == "m" else SIGMA_RAD)
        assert np.sqrt(np.mean(x.difference**2)) < limit


@pytest.mark.slow
@pytest.mark.parametrize("form", ["metashape_opk", "metashape", "generic_ascii", "inpho_ascii"])
def test_right_files_have_nothing_to_explain(
    flight: Written, adjusted: Poses, tmp_path: Path, form: str
) -> None:
    """Oracle: nothing was planted."""
    path = written(flight, tmp_path, form, LV95)
    assert compare_poses(adjusted, read_poses(path, form)).findings == ()


QUICK = (
    "easting and northing of LV95",
    "a transposed matrix",
    "phi omega kappa in columns of omega phi kappa",
)


@pytest.mark.parametrize("what", QUICK)
def test_the_hardest_are_named_exactly(flight: Written, tmp_path: Path, what: str) -> None:
    """Oracle: what was planted into exact data; nothing remains but digits."""
    planted = PLANTED[what]
    path = written(flight, tmp_path, planted.form, planted.where, **dict(planted.options))
    rewritten(path, planted.change, planted.first, planted.count)
    c = compare_poses(read_poses(flight["eo.json"]), read_poses(path, planted.form))
    assert [f.name for f in c.findings] == [planted.name]
    assert planted.words in c.findings[0].sentence()
    assert c.findings[0].alternatives == ()
    for x in c.remaining:
        assert np.abs(x.difference).max() < (2e-4 if x.unit == "m" else 1e-7)


BLOCKS: dict[str, tuple[str, dict[str, object], str | None]] = {
    "bentley": (UTM, {}, None),
    "inpho_prj": (LV95, {"focal_mm": 35.0, "ground_m": 500.0}, LV95),
    "micmac_xml": (PLANE, {}, None),
    "colmap": (PLANE, {"camera": "SIMPLE_PINHOLE 5120 3840 5607 2560 1920"}, None),
}


@pytest.mark.parametrize("form", BLOCKS)
def test_blocks_that_were_given_back_are_compared(
    flight: Written, tmp_path: Path, form: str
) -> None:
    """Oracle: the master; files without a frame take the plane of the other, and say so."""
    where, options, crs = BLOCKS[form]
    path = written(flight, tmp_path, form, where, **options)
    c = compare_files(flight["eo.json"], path, crs=crs)
    assert c.form_b == form
    assert c.findings == ()
    assert max(float(np.abs(x.difference).max()) for x in c.components) < 2e-4
    borrowed = any("does not give the origin of its tangent plane" in note for note in c.notes)
    assert borrowed is (form in ("micmac_xml", "colmap"))


def test_a_frame_that_nothing_names_is_asked_for(flight: Written, tmp_path: Path) -> None:
    """Oracle: coordinates of a national grid; a directory without poses."""
    path = written(flight, tmp_path, "inpho_prj", LV95, focal_mm=35.0, ground_m=500.0)
    with pytest.raises(InputError, match="does not say the CRS of its coordinates, 25"):
        compare_files(flight["eo.json"], path)
    with pytest.raises(InputError, match="is a directory without poses"):
        compare_files(flight["eo.json"], tmp_path)
