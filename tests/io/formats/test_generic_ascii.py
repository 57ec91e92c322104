"""The table by template: every angle set against formats.md 0.2 and scipy, sigmas by Monte Carlo,
reading back, refusals.
"""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from ba_scene import (
    Array,
    D,
    Place,
    S,
    T,
    assert_reprojects,
    block,
    boresight,
    camera_of,
    exterior,
    framed,
    worked,
)
from draws import normal_draws
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.io.formats.orientation.generic_ascii import read_generic_ascii, write_generic_ascii

LOOK = np.array(
    [[0.0, 1, 0], [0, 0, 1], [1, 0, 0]]
)  # formats.md B10: viewing direction, right, down as columns of the camera
GROUPS = (
    "image xyz llh s_xyz opk s_opk pok s_pok ypr s_ypr ned s_ned gimbal s_gimbal matrix quaternion"
    " time"
)


def oblique(n: int = 2) -> Array:
    """Cameras far from the nadir, for which no angle set is near its singularity."""
    rng = np.random.default_rng(8)
    return (
        Rotation.from_euler(
            "ZXY",
            np.column_stack(
                [rng.uniform(-180, 180, n), rng.uniform(30, 50, n), rng.uniform(-20, 20, n)]
            ),
            degrees=True,
        ).as_matrix()
        @ D
    )


def columns(path: Path, delimiter: str | None = None) -> dict[str, list[str]]:
    """A table by hand: names from the last comment line."""
    lines = path.read_text().splitlines()
    head = [line for line in lines if line.startswith("#")][-1].lstrip("# ").split(delimiter)
    rows = [line.split(delimiter) for line in lines if not line.startswith("#")]
    return {name: [row[k] for row in rows] for k, name in enumerate(head)}


def triple(table: dict[str, list[str]], names: str, k: int = 0) -> list[float]:
    return [float(table[name][k]) for name in names.split()]


def test_worked_example(tmp_path: Path) -> None:
    """Oracle: formats.md 0.2 for every angle set, matrix and quaternion; scipy's intrinsic YXZ for
    phi omega kappa.
    """
    eo = worked()
    write_generic_ascii(eo, tmp_path / "x", GROUPS)
    got = columns(tmp_path / "x")
    assert_allclose(
        triple(got, "omega phi kappa"), [0.931051, 4.374505, -137.600874], rtol=0, atol=2e-6
    )
    assert_allclose(
        triple(got, "yaw pitch roll"), [137.648029, -3.636396, -2.605228], rtol=0, atol=2e-6
    )
    assert_allclose(triple(got, "roll_ned pitch_ned yaw_ned"), [3, -2, 47], atol=2e-6)
    pok = Rotation.from_matrix(eo.C_fc[0] @ D).as_euler("YXZ", degrees=True)
    assert_allclose(triple(got, "phi_pok omega_pok kappa_pok"), pok, rtol=0, atol=2e-6)
    write_generic_ascii(
        eo,
        tmp_path / "x",
        "image matrix quaternion opk",
        camera_axes="CV",
        attitude="frame to camera",
    )
    got = columns(tmp_path / "x")
    assert_allclose(
        triple(got, "qw qx qy qz"), [0.032646, -0.361631, 0.931504, 0.021370], atol=6e-7
    )
    R = [
        -0.736314,
        -0.675117,
        0.045363,
        -0.672327,
        0.737532,
        0.063424,
        -0.076275,
        0.016202,
        -0.996955,
    ]
    assert_allclose(triple(got, "r11 r12 r13 r21 r22 r23 r31 r32 r33"), R, atol=6e-7)
    write_generic_ascii(eo, tmp_path / "x", "image opk", camera_axes="CV")
    assert_allclose(
        triple(columns(tmp_path / "x"), "omega phi kappa"),
        [-179.068949, -4.374505, 137.600874],
        rtol=0,
        atol=2e-6,
    )


def test_gimbal_of_a_real_drone(tmp_path: Path) -> None:
    """Oracle: formats.md B8: nadir pitch 59 deg, yaw -102.4 deg, roll 0 is gimbal pitch -31; B10:
    (47, 1, 2) is (-16.4, -87.8, 63.4).
    """
    for ypr, gimbal, atol in (
        ((-102.4, 59.0, 0.0), (-102.4, -31.0, 0.0), 1e-6),
        ((47.0, 1.0, 2.0), (-16.4, -87.8, 63.4), 0.06),
    ):
        C = Rotation.from_euler("ZXY", [-ypr[0], *ypr[1:]], degrees=True).as_matrix() @ D
        write_generic_ascii(
            framed(exterior(C[None], np.zeros((1, 3))), "geographic"),
            tmp_path / "x",
            "image ypr gimbal",
        )
        got = columns(tmp_path / "x")
        assert_allclose(triple(got, "yaw pitch roll"), ypr, rtol=0, atol=2e-6)
        assert_allclose(
            triple(got, "gimbal_yaw gimbal_pitch gimbal_roll"), gimbal, rtol=0, atol=atol
        )


@pytest.mark.parametrize("where", ["geographic", "EPSG:2056", "geocentric"])
@pytest.mark.parametrize("attitude", ["camera to frame", "frame to camera"])
def test_sigmas(where: str, attitude: str, tmp_path: Path) -> None:
    """Oracle: Monte Carlo of exp(psi) C through scipy's angles (4000 draws); axes by pyproj and
    cross products.
    """
    eo = exterior(oblique(), np.array([[2000.0, 1500, 200], [1900, 1400, 210]]))
    write_generic_ascii(
        framed(eo, where), tmp_path / "x", GROUPS, attitude=attitude, decimals_angle=8
    )
    got = columns(tmp_path / "x")
    plane = Place("tangent plane", np.zeros(3)).axes
    turned = T @ boresight()
    for k in range(2):
        place = Place(where, np.array(triple(got, "x y z", k)))
        F, N = place.axes.T @ plane, place.north_axes.T @ plane
        psi = normal_draws(eo.cov[k, 3:, 3:], 4000, seed=4)
        drawn = Rotation.from_rotvec(psi) * Rotation.from_matrix(eo.C_mc[k])
        of_frame = Rotation.from_matrix(F) * drawn * Rotation.from_matrix(D)
        of_frame = of_frame if attitude == "camera to frame" else of_frame.inv()
        of_north = Rotation.from_matrix(N) * drawn
        for rotation, order, names in (
            (of_frame, "XYZ", "omega phi kappa"),
            (of_frame, "YXZ", "phi_pok omega_pok kappa_pok"),
            (of_north * Rotation.from_matrix(D), "ZXY", "yaw pitch roll"),
            (
                Rotation.from_matrix(S) * of_north * Rotation.from_matrix(turned),
                "ZYX",
                "yaw_ned pitch_ned roll_ned",
            ),
            (
                Rotation.from_matrix(S) * of_north * Rotation.from_matrix(LOOK),
                "ZYX",
                "gimbal_yaw gimbal_pitch gimbal_roll",
            ),
        ):
            angles = np.degrees(np.unwrap(rotation.as_euler(order), axis=0))
            assert_allclose(
                triple(got, " ".join(f"s_{name}" for name in names.split()), k),
                angles.std(axis=0, ddof=1),
                rtol=0.003,
            )
        assert_allclose(
            triple(got, "sx sy sz", k), np.sqrt(np.diag(F @ eo.cov[k, :3, :3] @ F.T)), atol=1e-5
        )


@pytest.mark.slow
@pytest.mark.parametrize(
    "where", ["tangent plane", "geographic", "geocentric", "EPSG:2056", "EPSG:32632", "EPSG:3413"]
)
@pytest.mark.parametrize("unit", ["deg", "gon", "rad"])
def test_points_reproject(where: str, unit: str, tmp_path: Path) -> None:
    """Oracle: angles by scipy, frames by pyproj; 0.02 px of a 5607 px camera."""
    eo = block()
    write_generic_ascii(
        framed(eo, where), tmp_path / "x", "image xyz opk ypr", delimiter="semicolon", unit=unit
    )
    got = columns(tmp_path / "x", ";")
    to_rad = {"deg": np.pi / 180, "gon": np.pi / 200, "rad": 1.0}[unit]
    of_frame, of_north = [], []
    for k in range(len(eo.images)):
        x = np.array(triple(got, "x y z", k))
        yaw, pitch, roll = np.array(triple(got, "yaw pitch roll", k)) * to_rad
        R = Rotation.from_euler(
            "XYZ", np.array(triple(got, "omega phi kappa", k)) * to_rad
        ).as_matrix()
        of_frame.append((Place(where, x), R @ D, False))
        of_north.append(
            (Place(where, x), Rotation.from_euler("ZXY", [-yaw, pitch, roll]).as_matrix() @ D, True)
        )
    assert_reprojects(eo, of_frame)
    assert_reprojects(eo, of_north)


def test_north_of_the_grid(tmp_path: Path) -> None:
    """Oracle: grid heading = true heading - convergence, -1.787 deg at 46.57, 6.54 in UTM 32
    (formats.md C3).
    """
    eo = framed(exterior(camera_of(*np.zeros((3, 1))), np.zeros((1, 3))), "EPSG:32632")
    yaws = []
    for north in ("true", "frame"):
        write_generic_ascii(eo, tmp_path / "x", "image ypr", north=north)
        yaws.append(triple(columns(tmp_path / "x"), "yaw pitch roll")[0])
    assert yaws[0] - yaws[1] == pytest.approx(-1.7870, abs=1e-4)


@pytest.mark.parametrize("delimiter", ["blank", "comma", "semicolon", "tab"])
@pytest.mark.parametrize(
    "way", [("RUB", "camera to frame", "deg"), ("CV", "frame to camera", "gon")]
)
def test_reads_back(delimiter: str, way: tuple[str, str, str], tmp_path: Path) -> None:
    """Oracle: the record written, to the printed digits, from each set of columns alone."""
    axes, attitude, unit = way
    eo = framed(block(4), "EPSG:2056")
    for group in ("opk", "pok", "matrix", "quaternion", "ypr", "gimbal"):
        template = f"number {group} image s_xyz xyz llh time"
        write_generic_ascii(
            eo, tmp_path / "x", template, delimiter, unit=unit, camera_axes=axes, attitude=attitude
        )
        back = read_generic_ascii(tmp_path / "x")
        assert back.images == eo.images
        assert back.frame_kind == "projected"
        got, want = (back.C_Ec, eo.C_Ec) if group in ("ypr", "gimbal") else (back.C_fc, eo.C_fc)
        assert got is not None
        assert_allclose(got, want, atol=6e-8)
        assert (back.C_fc is None) == (group in ("ypr", "gimbal"))
        assert_allclose(back.block("xyz"), eo.coordinates, atol=0.6e-4, rtol=0)
        assert_allclose(back.block("llh"), eo.geodetic, atol=0.6e-4, rtol=0)
        assert_allclose(back.columns["lat"], eo.geodetic[:, 0], atol=1e-12, rtol=0)
        assert_allclose(back.columns["tow"], eo.time, atol=1e-6, rtol=0)
        assert_allclose(
            back.block("s_xyz"), np.sqrt(np.einsum("nii->ni", eo.cov)[:, :3]), atol=0.6e-5
        )
        assert back.columns["number"].tolist() == [1, 2, 3, 4]


def test_geographic_coordinates_read_back_in_radians(tmp_path: Path) -> None:
    """Oracle: the record written; with angles in gon, longitude and latitude stay in degrees."""
    eo = framed(block(2), "geographic")
    write_generic_ascii(eo, tmp_path / "x", "image xyz opk", unit="gon")
    assert_allclose(
        triple(columns(tmp_path / "x"), "x y"),
        np.degrees(eo.coordinates[0, :2]),
        rtol=0,
        atol=1e-10,
    )
    assert_allclose(
        read_generic_ascii(tmp_path / "x").block("xyz"), eo.coordinates, atol=0.6e-4, rtol=0
    )


def test_time_past_the_weeks_end(tmp_path: Path) -> None:
    """Oracle: 604800 s a week."""
    eo = framed(block(2), "geographic")
    write_generic_ascii(
        replace(eo, time=np.array([604799.5, 604801.0])), tmp_path / "x", "image time"
    )
    got = columns(tmp_path / "x")
    assert got["tow"] == ["604799.500000", "1.000000"]
    assert got["week"] == ["2008", "2009"]


def test_headers_and_digits(tmp_path: Path) -> None:
    """Oracle: the template."""
    eo = worked("tangent plane")
    write_generic_ascii(
        eo, tmp_path / "x", "x image kappa", "comma", header="names", decimals_m=2, decimals_angle=3
    )
    assert (tmp_path / "x").read_text() == "x,image,kappa\n0.00,8001.tif,-137.601\n"
    write_generic_ascii(eo, tmp_path / "x", ["image", "sz"], "tab", header="none", decimals_m=2)
    assert (tmp_path / "x").read_text().startswith("8001.tif\t0.0")
    assert len((tmp_path / "x").read_text().split()[1]) == 5
    for header in ("names", "none"):
        write_generic_ascii(eo, tmp_path / "x", "image xyz opk", header=header)
        with pytest.raises(InputError, match="only tables of generic_ascii with a full header"):
            read_generic_ascii(tmp_path / "x")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"columns": "image omeg"}, "column 'omeg' is unknown"),
        ({"columns": "opk"}, "has no column image"),
        ({"columns": "image opk kappa"}, "names kappa twice"),
        ({"columns": "image s_plan"}, "s_horizontal has no meaning in a geocentric frame"),
        ({"columns": "image ypr", "north": "frame"}, "a geocentric frame has no north"),
        ({"unit": "mil"}, "unit 'mil' is unknown; it is one of deg, gon, rad"),
        ({"delimiter": "|"}, "delimiter"),
        ({"header": "yes"}, "header"),
        ({"camera_axes": "FRD"}, "camera_axes"),
        ({"attitude": "inverse"}, "attitude"),
        ({"north": "magnetic"}, "north"),
    ],
)
def test_templates_that_make_no_table(
    options: dict[str, str], message: str, tmp_path: Path
) -> None:
    """Oracle: the page of the format; one line, and nothing written."""
    eo = framed(block(1), "geocentric")
    with pytest.raises(UsageError, match=message) as refusal:
        write_generic_ascii(eo, tmp_path / "x", **options)  # type: ignore[arg-type]
    assert "\n" not in str(refusal.value)
    assert not list(tmp_path.iterdir())


def test_attitudes_that_it_cannot_hold(tmp_path: Path) -> None:
    """Oracle: a camera exactly at the nadir has no gimbal angles, but omega, phi, kappa."""
    eo = framed(exterior(D[None], np.zeros((1, 3))), "tangent plane")
    with pytest.raises(DataError, match="middle angle of roll pitch yaw"):
        write_generic_ascii(eo, tmp_path / "x", "image gimbal")
    assert not list(tmp_path.iterdir())
    write_generic_ascii(eo, tmp_path / "x", "image opk")
    assert triple(columns(tmp_path / "x"), "omega phi kappa") == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(
    ("before", "after", "message"),
    [
        ("# angle unit: deg\n", "", "no header line '# angle unit: ...'"),
        ("# north: true", "# north: up", "conventions"),
        ("# frame kind: ", "# frame kind: x", "conventions 'x"),
        (" omega ", " omaga ", "omaga"),
        ("8002.tif ", "8002.tif x", ":12: 'x"),
    ],
)
def test_tables_that_are_not_read(before: str, after: str, message: str, tmp_path: Path) -> None:
    """Oracle: the page of the format."""
    write_generic_ascii(framed(block(2), "EPSG:2056"), tmp_path / "x")
    text = (tmp_path / "x").read_text()
    assert text.count(before) == 1
    (tmp_path / "x").write_text(text.replace(before, after))
    with pytest.raises(InputError) as refusal:
        read_generic_ascii(tmp_path / "x")
    assert message in str(refusal.value)


def test_many_images(tmp_path: Path) -> None:
    """Oracle: the number written, across the pieces that are formatted at once; the name in the
    middle.
    """
    n = 20_050
    eo = framed(
        exterior(camera_of(*np.random.default_rng(1).uniform(-5, 5, (3, n))), np.zeros((n, 3))),
        "tangent plane",
    )
    write_generic_ascii(eo, tmp_path / "x", "number image kappa")
    assert columns(tmp_path / "x")["image"] == list(eo.images)
