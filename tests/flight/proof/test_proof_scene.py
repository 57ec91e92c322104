"""What `write_proof` gives to a user: read back by readers that know nothing of the writers, and
looked at.
"""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
import scene
from oracles import oracle
from readers import bentley, master, relative
from readers.geometry import Array, Frame, Geocentric, Poses, Projected, Tangent
from readers.lines import comments, rows
from test_proof_formats import CASES

from insgnss.base.errors import InputError, InsgnssError, UsageError
from insgnss.flight.exporting.export import ExportFrame, export
from insgnss.flight.proof import write
from insgnss.flight.proof.scene import make_scene, terrain
from insgnss.flight.proof.write import write_proof
from insgnss.io.formats import EXPORTS
from insgnss.io.formats.exports import PROJECTED

LIMIT_PX = 0.01
PLANE = Tangent(6.54, 46.57, 518.0)


@pytest.fixture
def sketched(monkeypatch: pytest.MonkeyPatch) -> None:
    """Images of one pixel, which are soon made."""

    def quick(_: object, directory: Path) -> list[Path]:
        files = [directory / f"{8001 + k}.tif" for k in range(4)]
        for file in files:
            file.write_bytes(write.tiff(np.zeros((1, 1), np.uint8)))
        return files

    monkeypatch.setattr(write, "write_pictures", quick)


@pytest.fixture
def geoid(tmp_path: Path) -> Path:
    """The same undulation everywhere."""
    grid = tmp_path / "geoid.gtx"
    head = (
        np.array([40.0, 0.0, 1.0, 1.0]).astype(">f8").tobytes()
        + np.array([20, 20]).astype(">i4").tobytes()
    )
    grid.write_bytes(head + np.full(400, scene.UNDULATION_M).astype(">f4").tobytes())
    return grid


def points_of(directory: Path, crs: str | None) -> tuple[list[str], Array, Frame]:
    """Names, places in ECEF and the frame of points.csv, whose heights in a projected CRS may be
    above the geoid.
    """
    *words, columns = comments(directory / "points.csv")
    origin = re.search(r"(\S+) deg, longitude (\S+) deg, (\S+) m", words[0])
    plane = Tangent(float(origin[2]), float(origin[1]), float(origin[3])) if origin else PLANE
    frames = {
        "E_m": plane,
        "X_m": Geocentric(),
        "longitude_deg": Frame(),
        "easting_m": Projected(crs or "EPSG:32632"),
    }
    lines = rows(directory / "points.csv", ",")
    frame = frames[columns.split(",")[1]]
    x = np.array([line[1:] for line in lines], dtype=float)
    if "geoid.gtx" in words[0]:
        x[:, 2] += scene.UNDULATION_M
    return [line[0] for line in lines], frame.ecef(x), frame


def residuals(directory: Path, crs: str | None, poses: Poses) -> Array:
    """Pixels by which the points of points.csv miss those of pixels.csv, with the camera of
    camera.txt.
    """
    names, places, _ = points_of(directory, crs)
    said = {
        line[0]: [float(x) for x in line[1:] if x[0].isdigit()]
        for line in rows(directory / "camera.txt")
    }
    assert poses.axes is not None
    off = []
    for image, point, x, y in rows(directory / "pixels.csv", ","):
        if image in poses.names:
            k = poses.names.index(image)
            seen = poses.axes[k].T @ (places[names.index(point)] - poses.centre[k])
            assert seen[2] > 0.0
            off.append(
                said["focal_px"][0] * seen[:2] / seen[2]
                + said["principal_point_px"]
                - [float(x), float(y)]
            )
    return np.linalg.norm(off, axis=1)


def truth(directory: Path) -> Poses:
    """The cameras, by the master's own proof."""
    write_proof("eo_json", directory / "master")
    return master.poses(master.read(directory / "master" / "eo.json"), PLANE)


def places() -> Iterator[tuple[str, str | None]]:
    for name, form in EXPORTS.items():
        yield name, None
        yield from ((name, crs) for crs in ("EPSG:2056", "EPSG:32632") if PROJECTED in form.frames)


@pytest.mark.slow
@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize(("name", "crs"), list(places()))
def test_every_format_has_a_proof(name: str, crs: str | None, tmp_path: Path, geoid: Path) -> None:
    """Oracle: points.csv, pixels.csv and camera.txt, with the poses of an independent reader."""
    form, directory = EXPORTS[name], tmp_path / "proof"
    if name == "colmap_priors":
        oracle("pycolmap")
    product, readme, *_ = write_proof(
        name, directory, crs, geoid if form.heights == "sea level" else None
    )
    assert readme.is_file()
    assert product == directory / form.product
    true = truth(tmp_path)
    frame = points_of(directory, crs)[2]
    if name == "relative":
        poses = relative.poses(relative.read(product), frame, true)
    else:
        poses = CASES[name].poses(CASES[name].read(product), frame)
    if poses.axes is None:
        lever = true.axes @ scene.LEVER_C if name == "rtklib_pos" else 0.0  # type: ignore[operator]
        poses = Poses(poses.names, poses.centre - lever, true.axes)
    off = residuals(directory, crs, poses)
    assert off.size > (10 if name == "relative" else 27)
    assert off.max() < LIMIT_PX + (
        0.01 if name == "relative" and crs else 0.0
    )  # a difference of grid coordinates is no offset in space


@pytest.mark.usefixtures("sketched")
def test_the_points_of_bentley_are_in_its_own_frame(tmp_path: Path) -> None:
    """Oracle: the SRS of the file, whose origin lies on the ellipsoid, for both; points.csv taken
    by its columns alone.
    """
    write_proof("bentley", tmp_path / "proof")
    poses = bentley.poses(bentley.read(tmp_path / "proof" / "blocks.xml"), Frame())
    names, _, _ = points_of(tmp_path / "proof", None)
    x = np.array([line[1:] for line in rows(tmp_path / "proof" / "points.csv", ",")], dtype=float)
    globe = Frame().ecef(
        np.array(
            [line[1:] for line in rows(tmp_path / "proof" / "points_geographic.csv", ",")],
            dtype=float,
        )
    )
    assert len(names) == 9
    assert np.abs(Tangent(6.54, 46.57, 0.0).ecef(x) - globe).max() < 1e-3
    assert residuals(tmp_path / "proof", None, poses).max() < LIMIT_PX
    to_do = (tmp_path / "proof" / "README.txt").read_text().partition("Note:")[0]
    assert "518" not in to_do + (tmp_path / "proof" / "blocks.xml").read_text().partition("-->")[0]


@pytest.mark.parametrize("form", ["mapping", "camera"])
def test_relative_control_leads_from_image_to_image(form: str, tmp_path: Path) -> None:
    """Oracle: the poses of the scene, by the master's reader."""
    true = truth_of_scene(tmp_path)
    path = tmp_path / "relative.csv"
    export(make_scene().eo, "relative", path, ExportFrame(), noise="navchip", form=form)
    found = relative.poses(relative.read(path), PLANE, true)
    row = [true.names.index(name) for name in found.names]
    assert len(row) == 2
    assert np.abs(found.centre - true.centre[row]).max() < 2e-5
    assert true.axes is not None
    assert found.axes is not None
    assert np.abs(found.axes - true.axes[row]).max() < 1e-11


def truth_of_scene(directory: Path) -> Poses:
    export(make_scene().eo, "eo_json", directory / "eo.json")
    return master.poses(master.read(directory / "eo.json"), PLANE)


def test_every_export_is_read_by_somebody_else() -> None:
    """Oracle: the registry."""
    assert set(EXPORTS) - {"relative"} <= set(CASES)
    assert {name.split()[0] for name in CASES} <= set(EXPORTS)


@pytest.mark.usefixtures("sketched")
@pytest.mark.parametrize("crs", ["EPSG:32733", "EPSG:2051"])
def test_a_crs_elsewhere_takes_the_scene_along(crs: str, tmp_path: Path) -> None:
    """Oracle: the independent reader, on the other half of the Earth; EPSG:2051 counts west and
    south.
    """
    write_proof("bentley", tmp_path / "south", crs)
    poses = bentley.poses(bentley.read(tmp_path / "south" / "blocks.xml"), Frame())
    assert residuals(tmp_path / "south", crs, poses).max() < LIMIT_PX
    lat = float(rows(tmp_path / "south" / "points_geographic.csv", ",")[0][2])
    assert lat < -20.0


@pytest.mark.slow
def test_the_crosses_stand_where_the_file_says(tmp_path: Path) -> None:
    """Oracle: the middle of the white pixels; the same ground has the same grey in two images."""
    write_proof("metashape", tmp_path / "proof")
    made = make_scene()
    picture = {}
    for name in made.eo.images:
        data = (tmp_path / "proof" / "images" / name).read_bytes()
        assert data[:4] == b"II*\0"
        picture[name] = (
            np.frombuffer(data[-1280 * 960 :], dtype=np.uint8).reshape(960, 1280).astype(float)
        )
    checked = 0
    for image, point, x, y in rows(tmp_path / "proof" / "pixels.csv", ","):
        x, y = float(x), float(y)
        if not (20 < x < 1260 and 90 < y < 940):
            continue
        i, j = int(y) - 6, int(x) - 6
        white = np.where(picture[image][i : i + 13, j : j + 13] > 200.0, 1.0, 0.0)
        down, right = np.mgrid[i : i + 13, j : j + 13] + 0.5
        assert abs((white * right).sum() / white.sum() - x) < 0.4, (image, point)
        assert abs((white * down).sum() / white.sum() - y) < 0.4, (image, point)
        checked += 1
    assert checked > 20
    plan = np.random.default_rng(2).uniform(-15.0, 15.0, (400, 2))
    ground = np.column_stack([plan + [5200.0, 3900.0], terrain(*plan.T)])
    grey = []
    for k, name in enumerate(made.eo.images[:2]):
        x, y, z = ((ground - made.eo.position_m[k]) @ made.eo.C_mc[k]).T
        column, row = (1400.0 * x / z + 640.0).astype(int), (1400.0 * y / z + 480.0).astype(int)
        inside = (column >= 0) & (column < 1280) & (row >= 90) & (row < 960)
        grey.append(np.where(inside, picture[name][row.clip(0, 959), column.clip(0, 1279)], np.nan))
    both = np.isfinite(grey).all(axis=0)
    assert both.sum() > 150
    assert np.corrcoef(np.array(grey)[:, both])[0, 1] > 0.85


@pytest.mark.usefixtures("sketched")
def test_the_readme_says_what_mistakes_cost(tmp_path: Path) -> None:
    """Oracle: the order of magnitude of each, from focal length, angles and heights."""
    write_proof("metashape_opk", tmp_path / "proof", "EPSG:32632")
    text = (tmp_path / "proof" / "README.txt").read_text(encoding="utf-8")
    costs = {
        line[13:]: float(line[:8]) for line in text.splitlines() if re.match(r" *[\d.]+ px  ", line)
    }
    assert len(costs) >= 14
    assert min(costs.values()) > 0.5
    (turned,) = [px for what, px in costs.items() if what.startswith("the heading of the aircraft")]
    (boresight,) = [
        px for what, px in costs.items() if what.startswith("the bore-sight is left out")
    ]
    assert 300.0 < turned < 1000.0
    assert boresight == pytest.approx(1400.0 * np.radians(np.hypot(0.657, 0.574)), rel=0.1)
    assert "EPSG:32632" in text
    assert "-1.7" in text


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("metashap", "new"), "did you mean 'metashape'"),
        (("metashape", "full"), "not an empty directory"),
        (("eo_local_plane", "new", "EPSG:2056"), "cannot carry a frame of kind projected"),
        (("kml", "new"), "geoid"),
        (("metashape", "new", "EPSG:99999"), "unknown"),
    ],
)
@pytest.mark.usefixtures("sketched")
def test_refusals_leave_nothing(arguments: tuple[str, ...], words: str, tmp_path: Path) -> None:
    """Oracle: the message, and the directory's listing."""
    (tmp_path / "full").mkdir()
    (tmp_path / "full" / "file").touch()
    name, directory, *crs = arguments
    with pytest.raises((UsageError, InputError), match=words) as caught:
        write_proof(name, tmp_path / directory, *crs)
    assert isinstance(caught.value, InsgnssError)
    assert [path.name for path in tmp_path.iterdir()] == ["full"]


def test_the_pages_that_the_readme_names_exist() -> None:
    """Oracle: the directory of data_specs."""
    pages = Path(__file__).parents[3] / "data_specs"
    assert [n for n in EXPORTS if not (pages / f"{EXPORTS[n].page}.md").is_file()] == []
