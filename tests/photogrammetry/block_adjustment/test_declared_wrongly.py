"""Ground points and positions of `insgnss adjust` in a frame that is declared wrongly: named or
asked about, and nothing else.
"""

from dataclasses import replace

import numpy as np
import pytest
from pyproj import Transformer

from insgnss.base.errors import DataError, InputError
from insgnss.geodesy.frames import TangentPlane, geodetic_to_ecef
from insgnss.io.formats.blocks.ground_points import read_ground_points
from insgnss.photogrammetry.block_adjustment.plausibility import _cause_of_shift
from insgnss.photogrammetry.block_adjustment.run import adjust

pytestmark = pytest.mark.slow
UTM, FOOT = "EPSG:32632", 1 / 0.3048


def in_crs(crs):
    to = Transformer.from_crs("EPSG:4979", crs, always_xy=True)
    return lambda x: np.column_stack(to.transform(*x.T))


def plan(crs):
    to = Transformer.from_crs("EPSG:4326", crs, always_xy=True)
    return lambda x: np.column_stack([*to.transform(*x[:, :2].T), x[:, 2]])


def utm(factors=(1, 1, 1), terms=(0, 0, 0), columns=(0, 1, 2)):
    return lambda x: (in_crs(UTM)(x) * factors + terms)[:, columns]


def globe(factors=(1, 1, 1), columns=(0, 1, 2)):
    return lambda x: (x * factors)[:, columns]


def geocentric(x):
    return geodetic_to_ecef(np.radians(x[:, 1]), np.radians(x[:, 0]), x[:, 2])


RAD = np.pi / 180
# coordinates of longitude, latitude, height; CRS that is declared; what is said of ground points,
# and of positions of the images
WRONG = {
    "zone west": (utm(), "EPSG:32631", "their numbers fit EPSG:32632", "b fit EPSG:32632"),
    "zone east": (utm(), "EPSG:32633", "their numbers fit EPSG:32632", "b fit EPSG:32632"),
    "south": (utm(), "EPSG:32732", "their numbers fit EPSG:32632", "b fit EPSG:32632"),
    "UTM for LV95": (utm(), "EPSG:2056", "their numbers fit EPSG:32632", "outside the area"),
    "LV95 for UTM": (plan("EPSG:2056"), UTM, "their numbers fit EPSG:2056", "outside the area"),
    "LV95 for LV03": (plan("EPSG:2056"), "EPSG:21781", "fit EPSG:2056", "outside the area"),
    "feet": (utm([FOOT] * 3), UTM, "if their numbers are feet", "outside the area"),
    "plan in feet": (utm([FOOT, FOOT, 1]), UTM, "if their numbers are feet", "outside the area"),
    "heights in feet": (
        utm([1, 1, FOOT]),
        UTM,
        "if they had heights in feet",
        "heights of b are in feet",
    ),
    "centimetres": (utm([100, 100, 1]), UTM, "numbers are centimetres", "does not reach"),
    "kilometres": (utm([1e-3, 1e-3, 1]), UTM, "numbers are kilometres", "outside the area"),
    "heights in mm": (utm([1, 1, 1e3]), UTM, "km in metres; give", "km in metres; give"),
    "heights in cm": (
        utm([1, 1, 100]),
        UTM,
        "if they had heights in centimetres",
        "heights of b are in centimetres",
    ),
    "depths": (utm([1, 1, -1]), UTM, "height with the other sign", "counts heights downwards"),
    "north first": (utm(columns=(1, 0, 2)), UTM, "exchange the columns", "east and north exch"),
    "height second": (utm(columns=(0, 2, 1)), UTM, "5160 km in metres", "5160 km in metres"),
    "west for east": (utm([-1, 1, 1]), UTM, "eastings have the other sign", "b has east with"),
    "degrees": (globe(), UTM, "fit EPSG:4326 WGS 84", "outside the area"),
    "metres for degrees": (utm(), "EPSG:4326", "fit EPSG:32632", "no longitude and latitude"),
    "latitude first": (
        globe(columns=(1, 0, 2)),
        "EPSG:4326",
        "latitude exchanged",
        "latitude and longitude exchanged",
    ),
    "radians": (globe([RAD, RAD, 1]), "EPSG:4326", "numbers are radians", "in radians"),
    "gon": (globe([1 / 0.9, 1 / 0.9, 1]), "EPSG:4326", "numbers are gon", "in gon"),
    "west": (globe([-1, 1, 1]), "EPSG:4326", "longitudes have the other", "longitudes with the"),
    "southern": (globe([1, -1, 1]), "EPSG:4326", "latitudes have the other", "latitudes with the"),
    "ECEF": (geocentric, UTM, "4609 km in metres", "km in metres"),
    "another datum": (in_crs("EPSG:23032"), UTM, "coordinates of another datum", "another datum"),
    "sea level": (utm(terms=[0, 0, -49.6]), UTM, "above sea level", "above sea level"),
    "lost shift": (utm(terms=[-3e5, -51e5, 0]), UTM, "300000 5100000 were sub", "subtracted"),
    "prefix": (utm(terms=[32e6, 0, 0]), UTM, "-32000000 0 were sub", "does not reach"),
    "no false easting": (utm(terms=[-5e5, 0, 0]), UTM, "500000 0 were sub", "subtracted"),
    "lost kilometre": (utm(terms=[-1e3, 0, 0]), UTM, "a constant was sub", "a constant was sub"),
    "lost height": (
        utm(terms=[0, 0, -400]),
        UTM,
        "subtracted from the heights",
        "subtracted from the heights",
    ),
}


def written(path, head, names, x, ends):
    digits = 10 if np.abs(x[:, :2]).max() < 400 else 4
    rows = [
        f"{name},{e:.{digits}f},{n:.{digits}f},{h:.4f},{end}\n"
        for name, (e, n, h), end in zip(names, x, ends, strict=True)
    ]
    path.write_text("".join([head, *rows]))
    return path


@pytest.fixture
def declared(flown, tmp_path, monkeypatch):
    """The block with its ground points, and positions alone, declared as a case says."""
    monkeypatch.setenv("INSGNSS_SHOWN", str(tmp_path))
    root, sigmas = flown.directory, "sigma_x,sigma_y,sigma_z"
    with np.load(root / "truth/eo.npz") as file:
        true = {key: file[key] for key in file.files}
    plane = TangentPlane(*true["origin"])

    def places(x):
        lat, lon, h = plane.geodetic_from_position(x)
        return np.column_stack([np.degrees(lon), np.degrees(lat), h])

    def ground(case):
        table = read_ground_points(root / "01_Observations/Camera/Block/ground_points.csv")
        ends = [f"0.01,0.01,0.015,{'check' if c else 'control'}" for c in table.check]
        x, head = case[0](places(table.position_m)), f"point,x,y,z,{sigmas},role\n"
        path = written(tmp_path / "gcp.csv", head, table.points, x, ends)
        return replace(flown.block, ground=replace(flown.block.ground, file=path, crs=case[1]))

    def positions(case):
        names = [str(name) for name in true["images"]]
        x = case[0](places(true["position_enu"]))
        ends = ["0.02,0.02,0.03"] * len(names)
        path = written(tmp_path / "pos.csv", f"image,x,y,z,{sigmas}\n", names, x, ends)
        initial = root / "truth/EO_local-plane.txt"
        block = ground((utm(), UTM))
        control = replace(block.aerial_control, file=path, initial=initial, crs=case[1])
        return replace(block, aerial_control=control)

    return {"ground": ground, "positions": positions}


@pytest.mark.parametrize("kind", ["ground", "positions"])
@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_declaration_is_named_or_asked_about(declared, kind, name) -> None:
    """Oracle: what was done to pyproj's coordinates of the simulated places."""
    case = WRONG[name]
    with pytest.raises((InputError, DataError)) as refusal:
        adjust(declared[kind](case), write=False)
    assert case[2 if kind == "ground" else 3] in str(refusal.value)


@pytest.mark.parametrize("kind", ["ground", "positions"])
def test_another_epoch_is_a_shift_of_its_size(declared, kind) -> None:
    """Oracle: 0.5 m, as ETRS89 lies from ITRF2014; the shift of ground control, to 5 cm."""
    terms = np.array([0.5, -0.4, 0.0])
    result = adjust(declared[kind]((utm(terms=terms), UTM)), write=False).as_dict()
    assert result["verdict"] == "contradiction"
    assert "shift of ground control of " in result["headline"]
    text = result["headline"].partition("shift of ground control of ")[2].split(" mm")[0]
    found = np.array([float(x) for x in text.split(" / ")[:2]]) * 1e-3
    convergence = np.radians(-1.8)  # of UTM 32 at 6.5 deg east
    c, s = np.cos(convergence), np.sin(convergence)
    expected = np.array([[c, s], [-s, c]]) @ terms[:2] * (1 if kind == "ground" else -1)
    assert np.abs(found - expected).max() < 0.1


@pytest.mark.parametrize("kind", ["ground", "positions"])
def test_what_is_declared_rightly_is_consistent(declared, kind) -> None:
    """Oracle: the simulation."""
    for case in ((utm(), UTM), (globe(), "EPSG:4326"), (plan("EPSG:2056"), "EPSG:2056")):
        assert adjust(declared[kind](case), write=False).as_dict()["verdict"] == "consistent"


@pytest.mark.parametrize(
    ("shift", "cause"),
    [
        ((0.1, 0.0, -1482.3), "heights of the aerial control are in feet"),
        ((0.1, 0.0, -2110.0), "heights of the aerial control are in centimetres"),
        ((0.0, 0.2, -4262.5), "metres with the other sign"),
        ((0.0, 0.2, 55.0), "above sea level"),
        ((0.0, 0.2, -900.0), "a constant was subtracted from the heights"),
        ((300.0, 0.2, -90.0), "coordinates of another datum"),
        ((3000.0, 0.2, -90.0), "a constant was subtracted from the coordinates"),
    ],
)
def test_a_shift_has_the_cause_of_its_size(shift, cause) -> None:
    """Oracle: by hand; cameras 2131 m up as they were read."""
    cameras = np.array([[0.0, 0.0, 2126.0], [9.0, 9.0, 2131.0], [0.0, 9.0, 2137.0]])
    assert cause in _cause_of_shift(np.array(shift), cameras, 5.0)
