"""COLMAP triangulates the points of the scene in the model that is written for its database."""

import itertools
import sqlite3
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scene
from oracles import oracle

from insgnss.base.errors import InputError, UsageError
from insgnss.flight.exporting.export import export
from insgnss.flight.proof.scene import make_scene
from insgnss.io.formats.bundle.colmap import write_colmap
from insgnss.io.formats.bundle.colmap_database import COLMAP_MODELS

CAMERA = "PINHOLE 5120 3840 5607 5607 2590.4 1971.9"
LIMIT_M = 5e-4  # keypoints are of single precision: 2e-4 px, at 140 m and a base of 20 m


def database(
    path: Path,
    pycolmap: Any,
    *,
    frames: bool = True,
    folder: str = "",
    two_in_a_rig: bool = False,
    focal_px: float = 5607.0,
) -> None:
    """Features and matches of the scene as COLMAP has them, with numbers of its own: images in
    another order behind one that is not exported, a second camera, frames that count from 1.
    """
    db = pycolmap.Database.open(path)
    camera = pycolmap.Camera(
        model="PINHOLE", width=5120, height=3840, params=[focal_px, focal_px, 2590.4, 1971.9]
    )
    db.write_camera(camera)
    used = db.write_camera(camera)
    rig = pycolmap.Rig()
    rig.add_ref_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, used))
    if two_in_a_rig:
        rig.add_sensor(pycolmap.sensor_t(pycolmap.SensorType.CAMERA, 1), pycolmap.Rigid3d())
    rig_id = db.write_rig(rig) if frames else 0
    numbers, rows = {}, {}
    for name in ("0000.tif", *reversed(scene.NAMES)):
        image = pycolmap.Image(name=folder + name, camera_id=used)
        image.image_id = numbers[name] = db.write_image(image)
        if frames:
            frame = pycolmap.Frame()
            frame.rig_id = rig_id
            frame.add_data_id(image.data_id)
            db.write_frame(frame)
        if name not in scene.NAMES:
            continue
        k = scene.NAMES.index(name)
        rows[name] = {row: i for i, row in enumerate(np.flatnonzero(scene.SEEN[k]).tolist())}
        pixels = scene.PIXELS[k][scene.SEEN[k]].astype(np.float32)
        db.write_keypoints(image.image_id, pixels)
    for a, b in itertools.combinations(scene.NAMES, 2):
        pairs = [[rows[a][row], rows[b][row]] for row in rows[a] if row in rows[b]]
        geometry = pycolmap.TwoViewGeometry()
        geometry.inlier_matches = np.array(pairs, dtype=np.uint32)
        geometry.config = pycolmap.TwoViewGeometryConfiguration.CALIBRATED
        db.write_matches(numbers[a], numbers[b], geometry.inlier_matches)
        db.write_two_view_geometry(numbers[a], numbers[b], geometry)
    db.close()


def triangulated(model: Path, path: Path, pycolmap: Any) -> np.ndarray:
    """Points (n, 3) that COLMAP's point_triangulator makes with known poses."""
    options = pycolmap.IncrementalPipelineOptions()
    options.min_num_matches, options.extract_colors = 3, False
    pycolmap.logging.minloglevel = 2
    (model / "out").mkdir()
    made = pycolmap.triangulate_points(
        pycolmap.Reconstruction(str(model)), path, model, model / "out", options=options
    )
    return np.array([point.xyz for point in made.points3D.values()]).reshape(-1, 3)


@pytest.mark.parametrize(
    ("frames", "folder", "camera"), [(True, "day1/", None), (False, "", CAMERA)]
)
def test_colmap_triangulates_the_scene(
    tmp_path: Path, frames: bool, folder: str, camera: str | None
) -> None:
    """Oracle: the scene's points, and pycolmap, which is point_triangulator."""
    pycolmap = oracle("pycolmap")
    path = tmp_path / "database.db"
    exif = 5607.0 if camera is None else 4800.0  # what COLMAP took from the images' EXIF
    database(path, pycolmap, frames=frames, folder=folder, focal_px=exif)
    before = path.read_bytes()
    write_colmap(scene.framed("tangent plane"), tmp_path / "m", camera=camera, database=path)
    assert path.read_bytes() == before
    points = triangulated(tmp_path / "m", path, pycolmap)
    away = np.linalg.norm(points[:, None] - scene.POINTS, axis=2)
    assert len(points) == len(scene.POINTS)
    assert sorted(away.argmin(axis=1).tolist()) == list(range(len(points)))
    assert away.min(axis=1).max() < LIMIT_M


def test_numbers_from_one_belong_to_no_database(tmp_path: Path) -> None:
    """Oracle: pycolmap, which ends or finds no point: what `database` is for."""
    pycolmap = oracle("pycolmap")
    path = tmp_path / "database.db"
    database(path, pycolmap)
    write_colmap(scene.framed("tangent plane"), tmp_path / "m", camera=CAMERA)
    with pytest.raises(ValueError, match="Check failed"):
        triangulated(tmp_path / "m", path, pycolmap)


def test_names_of_camera_models_are_those_of_colmap() -> None:
    """Oracle: pycolmap's own numbers."""
    pycolmap = oracle("pycolmap")
    members = pycolmap.CameraModelId.__members__
    assert {int(value): name for name, value in members.items() if name != "INVALID"} == dict(
        enumerate(COLMAP_MODELS)
    )


def plain_database(path: Path, names: list[str]) -> None:
    """The tables of a database older than COLMAP 3.12, by SQL."""
    db = sqlite3.connect(path)
    db.execute("CREATE TABLE images (image_id INTEGER, name TEXT, camera_id INTEGER)")
    columns = "camera_id INTEGER, model INTEGER, width INTEGER, height INTEGER, params BLOB"
    db.execute(f"CREATE TABLE cameras ({columns})")
    db.executemany(
        "INSERT INTO images VALUES (?, ?, 7)", [(k, name) for k, name in enumerate(names, 11)]
    )
    params = np.array([5600.0, 2560.0, 1920.0, 0.01], dtype="<f8").tobytes()
    db.execute("INSERT INTO cameras VALUES (7, 2, 5120, 3840, ?)", (params,))
    db.commit()
    db.close()


def test_numbers_and_cameras_are_those_of_the_database(tmp_path: Path) -> None:
    """Oracle: the tables written by SQL."""
    eo, path = scene.framed("tangent plane"), tmp_path / "old.db"
    plain_database(path, ["x.tif", *reversed(scene.NAMES)])
    write_colmap(eo, tmp_path / "m", database=path)
    lines = (tmp_path / "m" / "images.txt").read_text().splitlines()
    rows = [line.split() for line in lines if line and not line.startswith("#")]
    assert [(row[0], row[8], row[9]) for row in rows] == [
        (str(15 - k), "7", name) for k, name in enumerate(scene.NAMES)
    ]
    cameras = (tmp_path / "m" / "cameras.txt").read_text().splitlines()
    assert cameras[1:] == ["7 SIMPLE_RADIAL 5120 3840 5600 2560 1920 0.01"]
    assert not (tmp_path / "m" / "frames.txt").exists()


def test_databases_that_do_not_fit_are_refused(tmp_path: Path) -> None:
    """Oracle: what is wrong with each."""
    eo = scene.framed("tangent plane")
    path = tmp_path / "d.db"
    plain_database(path, scene.NAMES[1:])
    with pytest.raises(InputError, match=r"has no image '8001\.tif' \(1 of 4 are missing\)"):
        write_colmap(eo, tmp_path / "m", database=path)
    path.unlink()
    plain_database(path, ["a/8001.tif", "b/8001.tif", *scene.NAMES[1:]])
    with pytest.raises(InputError, match="may mean either"):
        write_colmap(eo, tmp_path / "m", database=path)
    path.unlink()
    plain_database(path, scene.NAMES)
    with pytest.raises(UsageError, match=r"camera is 4000 x 3000 px, camera 7 of .* 5120 x 3840"):
        write_colmap(eo, tmp_path / "m", "SIMPLE_PINHOLE 4000 3000 1 2 3", database=path)
    with pytest.raises(UsageError, match=r"camera is a PINHOLE, camera 7 of .* a SIMPLE_RADIAL"):
        write_colmap(eo, tmp_path / "m", CAMERA, database=path)
    for content, why in ((b"no database" * 9, "no SQLite file"), (b"", "no SQLite file")):
        path.write_bytes(content)
        with pytest.raises(InputError, match=f"is no database of COLMAP: {why}"):
            write_colmap(eo, tmp_path / "m", database=path)
    with pytest.raises(InputError, match=r"none\.db: cannot be read"):
        write_colmap(eo, tmp_path / "m", database=tmp_path / "none.db")
    assert not (tmp_path / "m").exists()


def test_rigs_of_several_cameras_are_refused(tmp_path: Path) -> None:
    """Oracle: pycolmap's rig of two cameras."""
    pycolmap = oracle("pycolmap")
    database(tmp_path / "d.db", pycolmap, two_in_a_rig=True)
    with pytest.raises(UsageError, match="belongs to a rig of several cameras"):
        write_colmap(scene.framed("tangent plane"), tmp_path / "m", database=tmp_path / "d.db")


def test_a_database_of_other_names_or_fewer_images_has_a_way_through(tmp_path: Path) -> None:
    """Oracle: the names in the tables; each advice of a refusal is followed."""
    eo, out = make_scene().eo, tmp_path / "m"
    few, blanks, other = (tmp_path / name for name in ("few.db", "blanks.db", "other.db"))
    plain_database(few, scene.NAMES[1:])
    plain_database(blanks, [f"my {name}" for name in scene.NAMES])
    plain_database(other, [f"IMG_{name}" for name in scene.NAMES])
    with pytest.raises(InputError, match="leave out what is missing"):
        export(eo, "colmap", out, database=few)
    done = export(eo, "colmap", out, database=few, missing="skip")
    assert "1 of 4 images are not in the database and were left out, such as 8001.tif" in done.notes
    rows = [x.split() for x in (out / "images.txt").read_text().splitlines() if x[:1].isdigit()]
    whole = tmp_path / "whole"
    plain_database(tmp_path / "all.db", scene.NAMES)
    export(eo, "colmap", whole, database=tmp_path / "all.db")
    of_all = [x.split() for x in (whole / "images.txt").read_text().splitlines() if x[:1].isdigit()]
    assert [row[1:8] + row[9:] for row in rows] == [row[1:8] + row[9:] for row in of_all[1:]]
    with pytest.raises(InputError, match=r"no image '8001\.tif' .*; it has 'IMG_8001.*--rename"):
        export(eo, "colmap", out, database=other)
    with pytest.raises(InputError, match="4 of 4 are missing"):  # nothing is left to skip to
        export(eo, "colmap", out, database=other, missing="skip")
    rules = [f"{name}=IMG_{name}" for name in scene.NAMES]
    export(eo, "colmap", tmp_path / "renamed", None, rules, database=other)
    rules = [f"{name}=my {name}" for name in scene.NAMES]
    with pytest.raises(InputError, match=r"'my 8001\.tif' .*extract .* export with --rename safe"):
        export(eo, "colmap", tmp_path / "x", None, rules, database=blanks)
