"""`insgnss calibrate similarity`: adjusted poses and antenna positions, as files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from pyproj import CRS, Transformer
from scipy.spatial.transform import Rotation
from sites import orientation_at

from insgnss.base.errors import InputError
from insgnss.cli import main
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.projection import MapProjection
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.orientation.mounting_file import read_mounting_file
from insgnss.navigation.orient.frame import in_frame
from insgnss.photogrammetry.comparison.hints import Hints
from insgnss.photogrammetry.lever_arm.flight_direction import (
    flight_direction,
    neighbour_correlation,
)
from insgnss.photogrammetry.mounting_calibration.options import PlaceOptions, SimilarityOptions
from insgnss.photogrammetry.mounting_calibration.poses import (
    compared_with,
    read_camera_poses,
    read_positions,
    refuse_distant,
)
from insgnss.photogrammetry.mounting_calibration.similarity_files import calibrate_similarity
from insgnss.report.charts.files import charts_of

ARM = np.array([0.098, -0.070, -0.091])  # in-flight calibration of Table 1, paper 002
NADIR = np.diag([1.0, -1.0, -1.0])
FOCAL, WIDTH, HEIGHT = 3600.0, 5472, 3648
TAIWAN = Path(__file__).parents[4] / "shared/data/metashape_p4p_taiwan"


class Flown:
    """Six strips of ten images, 100 m above four ground points, in axes and a unit of its own."""

    def __init__(self, opposite=True, tilt_deg=4.0, delay_m=0.0, seed=1, n=60, correlated=0.0):
        rng, i = np.random.default_rng(seed), np.arange(n)
        line, along = i // 10, i % 10
        down = opposite & (line % 2 == 1)
        # the image's top looks ahead; every second strip is flown back
        y = np.where(down, 4.5 - along, along - 4.5) * 15.0
        X = np.stack([(line - 2.5) * 25.0, y, 100.0 + 0.0 * i], axis=1)
        tilt = np.sqrt(2.0) * tilt_deg
        roll = tilt * np.sin(2.0 * np.pi * i * 7 / n + 0.3)
        pitch = tilt * np.cos(2.0 * np.pi * i * 11 / n + 0.7)
        heading = np.where(down, 180.0, 0.0)
        C = Rotation.from_euler("ZXY", np.stack([heading, roll, pitch], axis=1), degrees=True)
        C = C * Rotation.from_matrix(NADIR)
        noise = rng.normal(0.0, [0.01, 0.01, 0.02], (n, 3))
        for k in range(1, n):
            noise[k] = correlated * noise[k - 1] + np.sqrt(1.0 - correlated**2) * noise[k]
        ahead = np.where(down, -1.0, 1.0)[:, None] * [0.0, 1.0, 0.0]
        self.antenna = X + C.apply(ARM) + noise - delay_m * ahead
        self.ground = np.array([[x, y, 0.0] for x in (-60.0, 60.0) for y in (-65.0, 65.0)])
        R, self.scale = Rotation.from_rotvec([0.4, -0.2, 2.0]), 3.7
        self.T, self.axes = np.array([5.0, -2.0, 9.0]), R.as_matrix()
        self.centres = R.inv().apply(X - self.T) / self.scale
        self.centres += rng.normal(0.0, 3e-3 / self.scale, (n, 3))
        self.C = (R.inv() * C).as_matrix()
        u = np.einsum("nji,mnj->mni", C.as_matrix(), self.ground[:, None] - X)
        uv = FOCAL * u[..., :2] / u[..., 2:] + [WIDTH / 2, HEIGHT / 2]
        uv += rng.normal(0.0, 0.1, uv.shape)
        self.seen = [
            (k, f"G{m + 1}", *uv[m, k])
            for m in range(4)
            for k in range(n)
            if ((uv[m, k] > 0) & (uv[m, k] < [WIDTH, HEIGHT])).all()
        ]
        self.ground += rng.normal(0.0, 0.005, self.ground.shape)

    def write(self, directory, opk=True, antenna=None, time=True):
        antenna = self.antenna if antenna is None else antenna
        angles = Rotation.from_matrix(self.C @ NADIR).as_euler("XYZ", degrees=True)
        rows = [
            f"I{k}.jpg," + ",".join(f"{v:.8f}" for v in (*self.centres[k], *angles[k])) + "\n"
            for k in range(len(self.C))
        ]
        (directory / "cameras.csv").write_text("image,x,y,z,omega,phi,kappa\n" + "".join(rows))
        rows = [
            f"I{k}," + ",".join(f"{v:.4f}" for v in g) + f",0.01,0.01,0.02,{1000 + 1.5 * k}\n"
            for k, g in enumerate(antenna)
        ]
        head = "image,x,y,z,sd_x,sd_y,sd_z,tow\n"
        (directory / "antenna.csv").write_text(head + "".join(rows))
        rows = [
            f"G{m + 1}," + ",".join(f"{v:.4f}" for v in g) + ",0.005,0.005,0.005\n"
            for m, g in enumerate(self.ground)
        ]
        (directory / "gcp.csv").write_text("point,x,y,z,sigma_x,sigma_y,sigma_z\n" + "".join(rows))
        rows = [f"I{k}.jpg,{name},{u:.3f},{v:.3f},0.1\n" for k, name, u, v in self.seen]
        (directory / "points.csv").write_text("image,point,x,y,sigma\n" + "".join(rows))
        (directory / "camera.toml").write_text(
            f'name = "FC6310"\nmodel = "forward"\nwidth = {WIDTH}\nheight = {HEIGHT}\nf = {FOCAL}\n'
            f"cx = {WIDTH / 2}\ncy = {HEIGHT / 2}\n"
        )


GROUND = ("--ground", "gcp.csv", "--points", "points.csv", "--camera", "camera.toml")


def run(directory, *more, sigma="0.003,0.0001", cameras="cameras.csv"):
    words = [str(directory / name) for name in (cameras, "antenna.csv")]
    more = [str(directory / word) if "." in word and word[0].isalpha() else word for word in more]
    out = ["--out", str(directory / "mounting.toml"), "--pose-sigma", sigma]
    return main(["calibrate", "similarity", *words, *out, "-q", *more])


def test_opposite_strips_and_ground_points_determine_every_component(tmp_path, capsys) -> None:
    """Oracle: the simulated lever arm, Table 1 of paper 002; 1.4/1.4/7 mm for one ground point."""
    Flown().write(tmp_path)
    assert run(tmp_path, *GROUND, "--json") == 0
    document = json.loads(capsys.readouterr().out)
    assert [c["verdict"] for c in document["components"][:3]] == ["determined"] * 3
    assert document["ground_points"] == 4
    got, _ = read_mounting_file(tmp_path / "mounting.toml")
    sigma = got.sigma("antenna_m")
    assert (np.abs(got.antenna_m - ARM) < 4.0 * sigma).all()
    assert sigma[:2].max() < 2e-3
    assert sigma[2] < 8e-3
    _, charts = charts_of(tmp_path / "mounting.html")
    assert [chart.name for chart in charts] == ["residuals", "residuals-course", "map"]
    residual = np.column_stack([panel.layers[-1].y for panel in charts[0].panels])
    rms = 1e3 * np.array(document["residual_rms_m"])
    assert np.sqrt((residual**2).mean(axis=0)) == pytest.approx(rms, rel=1e-4)
    along = document["along_flight_direction"]
    assert along["speed_mps"] == pytest.approx(10.0, rel=0.02)
    # ahead is minus y of the image: the lever arm along it is that of camera y, reversed
    assert abs(along["lever_arm_m"] + ARM[1]) < 4.0 * along["sigma_m"] + 1e-3


@pytest.mark.parametrize("name", ["D:\\photos\\I{}.jpg", "I{}", "i{}.TIF"])
def test_images_with_a_folder_or_another_ending_are_those_of_the_points(name, tmp_path) -> None:
    """Oracle: the simulated lever arm; points.csv has I0.jpg."""
    Flown().write(tmp_path)
    head, *rows = (tmp_path / "cameras.csv").read_text().splitlines()
    rows = [f"{name.format(k)},{row.partition(',')[2]}" for k, row in enumerate(rows)]
    (tmp_path / "cameras.csv").write_text("\n".join([head, *rows]) + "\n")
    assert run(tmp_path, *GROUND) == 0
    got, _ = read_mounting_file(tmp_path / "mounting.toml")
    assert (np.abs(got.antenna_m - ARM) < 4.0 * got.sigma("antenna_m")).all()


def test_stated_sigmas_that_are_too_large_are_said_with_their_size(tmp_path, capsys) -> None:
    """Oracle: antenna noise of 10, 10, 20 mm under stated 80 and 160 mm."""
    Flown().write(tmp_path)
    assert run(tmp_path, "--antenna-sigma", "0.08,0.16") == 4
    words = " ".join(capsys.readouterr().out.split())
    factor = words.partition(" times smaller than the standard deviations")[0].split()[-1]
    assert float(factor) == pytest.approx(8.0, rel=0.15)


def test_what_is_not_determined_is_a_comment_with_its_reason(tmp_path, capsys) -> None:
    """Oracle: without ground points the vertical goes with the translation (paper 002, 3.1), and
    one heading tells nothing.
    """
    Flown().write(tmp_path)
    assert run(tmp_path) == 4
    text = (tmp_path / "mounting.toml").read_text()
    assert re.search(r"^# antenna_m: x \+0\.09.*, y -0\.0.*, z not determined", text, re.MULTILINE)
    assert read_mounting_file(tmp_path / "mounting.toml")[0].antenna_m is None
    captured = capsys.readouterr()
    assert "correlation with the translation" in captured.err
    assert captured.out.count("  not determined") == 2  # z, and the IMU
    Flown(opposite=False, tilt_deg=0.1).write(tmp_path)
    assert run(tmp_path) == 2
    assert "mounting.toml exists and was made from other inputs" in (capsys.readouterr().err)
    assert run(tmp_path, "--force") == 4
    assert capsys.readouterr().out.count("all images have one heading") == 2


def test_a_delay_looks_as_a_lever_arm_along_the_flight_and_that_is_told(tmp_path, capsys) -> None:
    """Oracle: 50 ms at 10 m/s are 0.5 m; 400 ms are beyond what an aircraft has room for."""
    Flown(delay_m=0.5).write(tmp_path)
    assert run(tmp_path, *GROUND) == 0
    text = capsys.readouterr().out
    along = float(re.search(r"\(camera -y\) the lever arm is ([+-][\d.]+)", text)[1])
    assert along == pytest.approx(-0.5 - ARM[1], abs=0.01)
    assert "1 ms is 10.0 mm at 10.0 m/s" in text
    assert re.search(r"antenna_m y  determined +.* delay of the exposures times speed", text)
    Flown(delay_m=4.0).write(tmp_path)
    assert run(tmp_path, *GROUND) == 4
    captured = capsys.readouterr()
    assert "along the flight direction (limit 3 m): a delay of the exposures" in captured.out
    assert read_mounting_file(tmp_path / "mounting.toml")[0].antenna_m is None


def test_stamps_that_scatter_are_told(tmp_path, capsys) -> None:
    """Oracle: 20 ms of jitter at 10 m/s, 0.2 m along the flight and nothing across."""
    flown = Flown()
    rng = np.random.default_rng(4)
    flown.antenna[:, 1] += rng.normal(0.0, 0.2, 60)
    flown.write(tmp_path)
    assert run(tmp_path, *GROUND) == 4
    assert "times those across: a delay of the exposures" in capsys.readouterr().out


@pytest.mark.slow
def test_correlated_errors_grow_the_standard_errors(tmp_path, capsys) -> None:
    """Oracle: (1 + rho) / (1 - rho) of neighbours with a correlation of 0.8; none of white ones."""
    white, sigma = Flown(), []
    for flown in (white, Flown(correlated=0.9)):
        flown.write(tmp_path)
        run(tmp_path, *GROUND, "--json")
        document = json.loads(capsys.readouterr().out)
        told = any("neighbouring images are alike" in line for line in document["details"])
        sigma.append((np.array(document["sigma_m"]), told))
    assert [told for _, told in sigma] == [False, True]
    assert (sigma[1][0] > 1.7 * sigma[0][0]).all()
    rng = np.random.default_rng(0)
    alike = [neighbour_correlation(rng.normal(size=(60, 3))).any() for _ in range(300)]
    assert np.mean(alike) < 0.02


def test_the_flight_direction(tmp_path) -> None:
    """Oracle: a camera whose image top looks ahead sees the flight along -y; one on a gimbal that
    keeps north sees none.
    """
    flown = Flown(tilt_deg=0.0)
    C = np.einsum("ij,njk->nik", Rotation.from_rotvec([0.4, -0.2, 2.0]).as_matrix(), flown.C)
    got = flight_direction(flown.antenna, C, 1.5 * np.arange(60))
    assert np.abs(got.in_camera - [0.0, -1.0, 0.0]).max() < 0.01
    assert np.isnan(got.course_deg).sum() == 12  # both ends of six strips
    assert flight_direction(flown.antenna, np.broadcast_to(NADIR, (60, 3, 3)), None) is None


FLOWN = Flown()
WRONG = {
    "mirrored": (FLOWN.antenna * [1, -1, 1], "y with the other sign"),
    "exchanged": (FLOWN.antenna[:, [1, 0, 2]], "x and y exchanged"),
    "heights reversed": (FLOWN.antenna * [1, 1, -1], "z with the other sign"),
    "shifted": (np.roll(FLOWN.antenna, 1, axis=0), "its rows one too late"),
    "another flight": (FLOWN.antenna[np.random.default_rng(0).permutation(60)], "another flight"),
}


@pytest.mark.parametrize(
    ("name", "ground"),
    # heights of a level flight are one number, which the translation takes
    [
        pytest.param(name, g, marks=[pytest.mark.slow] if g else [])
        for name in WRONG
        for g in (GROUND, ())
        if g or name != "heights reversed"
    ],
)
def test_wrong_antenna_positions_are_refused_by_name(tmp_path, capsys, name, ground) -> None:
    """Oracle: what was done to them; millimetres are a scale, which is estimated."""
    antenna, words = WRONG[name]
    FLOWN.write(tmp_path, antenna=antenna)
    code = run(tmp_path, *ground)
    error = capsys.readouterr().err
    assert code == 3, error
    assert words in error, error
    assert not (tmp_path / "mounting.toml").exists()


ANGLES = {
    "exchanged": (
        lambda C: angles_of(C, lambda a: a[:, ::-1]),
        "has omega and kappa exchanged",
    ),
    "reversed": (
        lambda C: angles_of(C, lambda a: -a),
        "omega and phi and kappa with the other sign",
    ),
    "transposed": (
        lambda C: C.transpose(0, 2, 1),
        "has rotations that take the axes into the camera",
    ),
    "other camera axes": (lambda C: C @ NADIR, "angles of the camera x right, y down"),
}


def angles_of(C, changed):
    angles = changed(Rotation.from_matrix(C @ NADIR).as_euler("XYZ"))
    return Rotation.from_euler("XYZ", angles).as_matrix() @ NADIR


@pytest.mark.parametrize("name", ANGLES)
def test_wrong_attitudes_are_refused(tmp_path, capsys, name) -> None:
    """Oracle: what was done to them; a lever arm of 15 cm hides them in residuals of 2 cm."""
    flown, (changed, words) = Flown(), ANGLES[name]
    flown.C = changed(flown.C)
    flown.write(tmp_path)
    assert run(tmp_path) == 3
    assert words in capsys.readouterr().err
    assert run(tmp_path, *GROUND) == 3
    error = capsys.readouterr().err
    assert re.search(r"ground point G\d(:| by \d+ px)", error), error


def test_three_poses_are_too_few(tmp_path, capsys) -> None:
    """Oracle: ten unknowns."""
    FLOWN.write(tmp_path)
    path = tmp_path / "cameras.csv"
    path.write_text("".join(path.read_text().splitlines(keepends=True)[:4]))
    assert run(tmp_path) == 3
    assert "3 images and 0 ground points give 9 observations" in capsys.readouterr().err


def test_ground_points_must_be_seen(tmp_path, capsys) -> None:
    """Oracle: what is missing."""
    FLOWN.write(tmp_path)
    assert run(tmp_path, "--ground", "gcp.csv") == 3
    assert "has no image observations of ground points; give them by --points" in (
        capsys.readouterr().err
    )
    assert run(tmp_path, *GROUND[:4]) == 3
    assert "no interior orientation; give --camera" in capsys.readouterr().err
    path = tmp_path / "points.csv"
    path.write_text(path.read_text().replace(",G", ",H"))
    assert run(tmp_path, *GROUND) == 3
    assert "none of its 4 points, such as G1, is measured" in capsys.readouterr().err


@pytest.mark.slow
def test_antenna_positions_by_latitude_and_longitude(tmp_path, capsys) -> None:
    """Oracle: the same flight in local axes; pyproj's geodetic coordinates of a tangent plane."""
    pyproj = pytest.importorskip("pyproj")
    FLOWN.write(tmp_path)
    assert run(tmp_path, "--json") == 4
    local = json.loads(capsys.readouterr().out)
    plane = pyproj.Transformer.from_pipeline(
        "+proj=pipeline +step +inv +proj=topocentric +lat_0=46.57 +lon_0=6.54 +h_0=500"
        " +step +inv +proj=cart +ellps=WGS84"
    )
    lon, lat, h = plane.transform(*FLOWN.antenna.T)
    path = tmp_path / "antenna.csv"
    rows = [
        f"I{k},{lat[k]:.11f},{lon[k]:.11f},{h[k]:.5f},0.01,0.01,0.02\n" for k in range(len(lat))
    ]
    path.write_text("image,lat[deg],lon[deg],h[m],sd_e,sd_n,sd_u\n" + "".join(rows))
    assert run(tmp_path, "--json") == 4
    got = json.loads(capsys.readouterr().out)
    assert got["lever_arm_m"] == pytest.approx(local["lever_arm_m"], abs=2e-4)
    path.write_text(path.read_text().replace("lat[deg],lon", "lon[deg],lat").replace("6.5", "96.5"))
    assert run(tmp_path) == 3
    assert "are latitude and longitude exchanged?" in capsys.readouterr().err


@pytest.mark.slow
def test_a_block_of_metashape_with_on_board_gnss(tmp_path, capsys) -> None:
    """Oracle: README of the data: adjusted centres minus on-board GNSS E -0.9 +- 0.45, N -3.4 +-
    4.7, h -2.6 +- 4.0 m; N-S strips, single-point positions, a delay.
    """
    file = TAIWAN / "MARKER_LABEL.xml"
    if not file.is_file():
        pytest.skip("../shared/data/metashape_p4p_taiwan is not there")
    words = ["calibrate", "similarity", str(file), str(file), "--antenna-sigma", "1,2", "-q"]
    for more in ([], ["--ground", str(file)]):
        assert main([*words, *more, "--out", str(tmp_path / "m.toml"), "--json"]) == 4
        document = json.loads(capsys.readouterr().out.partition('\n{\n  "error"')[0])
        line = next(d for d in document["details"] if "as they stand" in d)
        numbers = [float(x) for x in re.findall(r"[+-]?\d+\.\d+", line)]
        readme = [-0.9, 0.45, -3.4, 4.7, -2.6, 4.0]
        assert np.abs(np.array(numbers) - readme).max() < 0.06
        along = document["along_flight_direction"]
        assert -4.5 < along["lever_arm_m"] < -2.5
        assert along["residual_rms_m"] > 5.0 * along["residual_across_rms_m"]
        text = " ".join(document["details"] + [c["text"] for c in document["components"]])
        for named in ("a delay of the exposures", "neighbouring images are alike", "stamps of"):
            assert named in text
        assert document["mounting"] == {}
    got, _ = read_mounting_file(tmp_path / "m.toml")
    assert (got.camera, got.image_size) == ("FC6310 (8.8mm)", (5472, 3648))


ELSEWHERE = {  # factors and order of latitude and longitude, deg, and what is named
    "exchanged": (1.0, [1, 0], "b has latitude and longitude exchanged"),
    "radians": (np.pi / 180.0, [0, 1], "b has latitude and longitude in radians"),
    "gon": (1.0 / 0.9, [0, 1], "b has latitude and longitude in gon"),
}


@pytest.mark.parametrize("name", ELSEWHERE)
def test_antennas_of_another_place_than_the_poses_are_named(name, tmp_path, capsys) -> None:
    """Oracle: what was done to the table; a similarity would bring any two places together."""
    factor, order, why = ELSEWHERE[name]
    eo = orientation_at(46.57, 6.54)
    write_eo_json(eo, tmp_path / "eo.json")
    lat, lon, h = TangentPlane(*eo.origin).geodetic_from_position(eo.position_m)
    table = np.column_stack([factor * np.degrees([lat, lon]).T[:, order], h])
    rows = [
        f"{name},{a:.11f},{b:.11f},{c:.4f}\n"
        for name, (a, b, c) in zip(eo.images, table.tolist(), strict=True)
    ]
    (tmp_path / "antenna.csv").write_text("image,lat,lon,h\n" + "".join(rows))
    assert run(tmp_path, cameras="eo.json") == 3
    assert f"{tmp_path / 'antenna.csv'} (b): {why}\n" in capsys.readouterr().err


@pytest.mark.parametrize("crs", ["EPSG:4326", "EPSG:2056"])
def test_a_reference_table_of_metashape_holds_antenna_positions(crs, tmp_path) -> None:
    """Oracle: the positions; the same header has degrees and metres, which its CRS tells."""
    eo = orientation_at(46.57, 6.54)
    plane = TangentPlane(*eo.origin)
    lat, lon, h = plane.geodetic_from_position(eo.position_m)
    x = np.column_stack([*np.degrees([lon, lat]), h])
    if crs == "EPSG:2056":
        x = MapProjection(crs).forward(lat, lon, h)
    head = "#Label,X/Longitude,Y/Latitude,Z/Altitude,Yaw,Pitch,Roll,Error_(m),X_error,Y_error,"
    head += "Z_error,Error_(deg),Yaw_error,Pitch_error,Roll_error,X_est,Y_est,Z_est\n"
    rows = [
        f"{image},{a:.11f},{b:.11f},{c:.5f}" + 14 * ",1.5" + "\n"
        for image, (a, b, c) in zip(eo.images, x.tolist(), strict=True)
    ]
    path = tmp_path / "reference.csv"
    path.write_text(f"# CoordinateSystem: {CRS(crs).to_wkt('WKT1_GDAL')}\n{head}{''.join(rows)}")
    positions = read_positions(path, PlaceOptions(), plane)
    assert positions.names == eo.images
    assert np.abs(positions.position - eo.position_m).max() < 1e-4
    path.write_text(head + "".join(rows))
    if crs == "EPSG:4326":
        with pytest.raises(InputError, match=r"its x and y are degrees: .*--crs EPSG:4326"):
            read_positions(path, PlaceOptions(crs="EPSG:2056"), plane)
    positions = read_positions(path, PlaceOptions(crs=crs), plane)
    assert np.abs(positions.position - eo.position_m).max() < 1e-4


POSED_ELSEWHERE = {  # CRS that is declared of UTM 32, factors and order, and what is named
    "feet": (
        "EPSG:32632",
        (1.0, 1.0, 1.0 / 0.3048),
        [0, 1, 2],
        "heights of b are in feet where",
    ),
    "order": ("EPSG:32632", (1.0, 1.0, 1.0), [1, 0, 2], "b has east and north exchanged"),
    "zone": ("EPSG:32631", (1.0, 1.0, 1.0), [0, 1, 2], "numbers of a fit EPSG:32632 WGS 84"),
}


@pytest.mark.parametrize("name", POSED_ELSEWHERE)
def test_poses_of_another_place_than_the_flight_are_named(name, tmp_path) -> None:
    """Oracle: what was done to the coordinates of UTM 32; calibrate mounting asks as well."""
    crs, factors, order, why = POSED_ELSEWHERE[name]
    eo = orientation_at(46.57, 6.54)
    framed = in_frame(eo, "projected", MapProjection("EPSG:32632"))
    opk = Rotation.from_matrix(framed.C_fc @ NADIR).as_euler("XYZ", degrees=True)
    table = np.column_stack([(framed.coordinates * factors)[:, order], opk]).tolist()
    rows = [
        f"{image} {' '.join(f'{v:.8f}' for v in row)} c\n"
        for image, row in zip(eo.images, table, strict=True)
    ]
    (path := tmp_path / "a.OPK").write_text("NOM X Y Z O P K CAMERA\n" + "".join(rows))
    camera, hints = read_camera_poses(path, Hints(crs=crs)), Hints(crs=crs)
    placed = eo.position_m, TangentPlane(*eo.origin), "flight.toml"
    assert why in compared_with(camera, hints, *placed)
    if name == "feet":
        refuse_distant(camera, hints, *placed)
        return
    with pytest.raises(InputError, match=why):
        refuse_distant(camera, hints, *placed)


MISREAD = {  # what was done to omega, phi, kappa, deg, of good poses; what is asked
    "good": (np.array, ""),
    "gon": (lambda opk: opk / 0.9, "angles in gon that were read as degrees"),
    "radians": (np.radians, "angles in radians that were read as degrees"),
    "sign": (lambda opk: opk * [1.0, 1.0, -1.0], "kappa with the other sign"),
}


@pytest.mark.parametrize("name", MISREAD)
@pytest.mark.parametrize("turn_deg", [12.0, -70.0])
def test_angles_that_no_residual_shows_are_asked_about(name, turn_deg, tmp_path) -> None:
    """Oracle: what was done to the angles of cameras along their courses, with 1.5 deg of crab."""
    change, clause = MISREAD[name]
    eo = orientation_at(59.91, 10.75)
    crab = Rotation.from_euler("z", np.repeat([[1.5], [-1.5]], 6, axis=0), degrees=True)
    turn = Rotation.from_euler("z", turn_deg, degrees=True).as_matrix()
    C, position = turn @ crab.as_matrix() @ eo.C_mc, eo.position_m @ turn.T
    opk = change(Rotation.from_matrix(C @ NADIR).as_euler("XYZ", degrees=True))
    rows = [
        f"{image},{','.join(f'{v:.6f}' for v in row)}\n"
        for image, row in zip(eo.images, np.column_stack([position, opk]).tolist(), strict=True)
    ]
    (cameras := tmp_path / "poses.csv").write_text("name,x,y,z,omega,phi,kappa\n" + "".join(rows))
    fixes = position + C @ [0.05, -0.1, -0.25]
    rows = [
        f"{image},{','.join(f'{v:.4f}' for v in row)}\n"
        for image, row in zip(eo.images, fixes.tolist(), strict=True)
    ]
    (antenna := tmp_path / "antenna.csv").write_text("name,x,y,z\n" + "".join(rows))
    notes = calibrate_similarity(cameras, antenna, SimilarityOptions()).summary()
    notes = " ".join(notes.split())
    assert ("askew to their courses" in notes) == bool(clause)
    assert clause in notes


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ([1, 0, 2], "omega and phi exchanged|phi omega kappa"),
        (None, ""),
    ],
)
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_omega_and_phi_that_are_exchanged_are_asked_for(tmp_path, capsys, change, words, seed):
    """Oracle: the columns that were exchanged, which leave cameras as level and along courses."""
    flown = Flown(seed=seed)
    flown.centres = flown.T + flown.scale * (flown.centres @ flown.axes.T)
    flown.C = flown.axes @ flown.C
    if change is not None:
        angles = Rotation.from_matrix(flown.C @ NADIR).as_euler("XYZ")[:, change]
        flown.C = Rotation.from_euler("XYZ", angles).as_matrix() @ NADIR
    flown.write(tmp_path)
    run(tmp_path)
    captured = capsys.readouterr()
    asked = [row for row in (captured.out + captured.err).split("\n") if "read rightly" in row]
    assert bool(asked) == bool(words)
    assert re.search(words, " ".join((captured.out + captured.err).split()))


BERN = np.array([2538000.0, 1152000.0, 450.0])  # of LV95, m


def of_zone_31(x):
    """The places of LV95 in the zone of UTM west of it."""
    east, north = Transformer.from_crs(2056, 32631, always_xy=True).transform(*x.T[:2])
    return np.column_stack([east, north, x[:, 2]])


OUTSIDE = {
    "zone": (of_zone_31, "give their own CRS"),
    "LV03": (lambda x: x - [2e6, 1e6, 0.0], "give their own CRS"),
    "feet": (lambda x: x / 0.3048, "inside it if they are feet"),
    "exchanged": (lambda x: x[:, [1, 0, 2]], "inside it if x and y are exchanged"),
    "shift": (lambda x: x - BERN, "add what was subtracted from them"),
}


@pytest.mark.parametrize("name", OUTSIDE)
def test_antenna_positions_outside_the_area_of_their_crs_are_refused(tmp_path, capsys, name):
    """Oracle: what was done to coordinates of LV95, which a similarity takes in as it stretches."""
    change, words = OUTSIDE[name]
    flown = Flown()
    flown.write(tmp_path, antenna=change(flown.antenna + BERN))
    assert run(tmp_path, "--crs", "EPSG:2056") == 3
    error = capsys.readouterr().err
    assert "lie outside the area of EPSG:2056" in error
    assert words in error
    flown.write(tmp_path, antenna=flown.antenna + BERN)
    assert run(tmp_path, "--crs", "EPSG:2056") != 3


@pytest.mark.parametrize("factor", [1.0 / 0.3048, 1.0])
def test_antenna_positions_in_feet_beside_poses_in_metres_are_asked_for(tmp_path, capsys, factor):
    """Oracle: the unit; a free scale turns it into a lever arm 3.28 times as long."""
    flown = Flown()
    flown.centres = flown.T + flown.scale * (flown.centres @ flown.axes.T)
    flown.C = flown.axes @ flown.C
    flown.write(tmp_path, antenna=factor * flown.antenna)
    run(tmp_path)
    assert ("are they feet?" in " ".join(capsys.readouterr().out.split())) == (factor > 1.0)
