"""The proof scene in the format of every program, read back and re-projected."""

import re
from pathlib import Path

import numpy as np
import pytest
from block_scene import (
    CX,
    CY,
    FX,
    FY,
    K1,
    K2,
    K3,
    P1,
    P2,
    POINTS_ECEF,
    SCENE,
    Metashape,
    distorted_pixels,
    observed,
    ply,
    utm_points,
    write_opensfm,
    zipped,
)
from format_pages import UNREADABLE, on_page
from oracles import oracle

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.flight.proof.scene import HEIGHT_PX, WIDTH_PX
from insgnss.io.formats.blocks.bingo import read_bingo
from insgnss.io.formats.blocks.gcp_list import read_gcp_list
from insgnss.io.formats.blocks.measured_block import MeasuredBlock, image_points, no_poses
from insgnss.io.formats.blocks.metashape_block import read_metashape_block
from insgnss.io.formats.blocks.metashape_chunk import read_metashape_references
from insgnss.io.formats.blocks.opensfm_model import read_opensfm_model
from insgnss.io.formats.blocks.reading import FORMATS, read_measured_block, recognise_format
from insgnss.records.cameras.camera import pixels_of

DATA = Path(__file__).parents[4] / "shared" / "data"
CLOSE_PX = 1e-4  # single precision of Metashape's tables is 6e-5 px at 1000


def residuals(block, names, truth):
    """Pixels (n, 2), observed minus computed, of points with coordinates in the block's axes."""
    seen = block.measured.observations
    row = {name: k for k, name in enumerate(names)}
    q = np.empty((len(seen), 2))
    for k, (i, p) in enumerate(zip(seen.image, seen.point, strict=True)):
        x = block.C_mc[i].T @ (truth[row[block.measured.points[p]]] - block.position_m[i])
        camera = block.cameras[block.camera[i]]
        q[k] = seen.uv[k] - pixels_of(camera, x[None, :2] / x[2])[0]
    return q


@pytest.mark.parametrize("kind", ["xml", "psz", "psx"])
def test_metashape(kind, tmp_path):
    """Oracle: the scene by OpenCV's formula and pyproj; what the files say of accuracies; the
    disabled image, the marker that was not placed and the track without coordinates are not there.
    """
    made = Metashape()
    path = getattr(made, f"write_{kind}")(tmp_path / f"a project.{kind}")
    block = read_measured_block(path)
    assert recognise_format(path) == "metashape"
    names = [*SCENE.names[:5], *(f"T{p}" for p in range(5, 9))]
    assert np.abs(residuals(block, names, POINTS_ECEF)).max() < CLOSE_PX
    assert block.measured.images == SCENE.eo.images
    assert [c.name for c in block.cameras] == ["first", "second"]
    assert block.camera.tolist() == [0, 0, 1, 1]
    assert (block.local, block.geocentric) == (False, True)
    of_markers = [row for row in made.seen if row[1] < 5]
    expected = made.seen if kind != "xml" else of_markers
    assert len(block.measured.observations) == len(expected)
    sigma = dict(
        zip(
            [block.measured.points[p] for p in block.measured.observations.point],
            block.measured.observations.sigma_px[:, 0],
            strict=True,
        )
    )
    assert {sigma[name] for name in SCENE.names[:5] if name in sigma} == {0.3}
    assert kind == "xml" or {sigma[f"T{p}"] for p in range(5, 9)} == {1.6}
    assert np.abs(block.ground.position_m - utm_points()[:5]).max() == 0.0
    assert block.ground.check.tolist() == [False, True, False, False, False]
    assert np.sqrt(np.diag(block.ground.cov[0])).tolist() == pytest.approx([0.02, 0.02, 0.05])
    assert "32632" in block.crs
    assert block.notes == (
        "1 disabled images left out",
        "1 projections of markers left out: not placed or confirmed by hand",
    )


def test_calibration_of_photoscan(tmp_path):
    """Oracle: the older manual's formula, f_x, f_y, skew, P_2 with r^2 + 2 x^2, and cx, cy from the
    corner: the same pixels.
    """
    old = (
        f"<fx>{FX!r}</fx><fy>{FY!r}</fy><cx>{CX!r}</cx><cy>{CY!r}</cy><skew>0.7</skew>"
        f"<k1>{K1!r}</k1><k2>{K2!r}</k2><k3>{K3!r}</k3><p1>{P1!r}</p1><p2>{P2!r}</p2>"
    )
    block = read_metashape_block(Metashape(old).write_xml(tmp_path / "old.xml"))
    assert np.abs(residuals(block, SCENE.names, POINTS_ECEF)).max() < CLOSE_PX


def test_a_chunk_without_transform_has_axes_of_its_own(tmp_path):
    """Oracle: the scene's points taken to the chunk's axes by the similarity."""
    made = Metashape()
    text = made.write_xml(tmp_path / "a.xml").read_text()
    text = re.sub("<components.*</components>", "", text).replace(' component_id="0"', "")
    (tmp_path / "a.xml").write_text(text)
    block = read_metashape_block(tmp_path / "a.xml")
    assert (block.local, block.geocentric) == (True, False)
    inside = (POINTS_ECEF - made.t) @ made.R / made.scale
    assert np.abs(residuals(block, SCENE.names, inside)).max() < CLOSE_PX


def test_components_that_are_not_connected(tmp_path):
    """Oracle: images of another component have no pose where it has no transform, nor where none
    has one and it is the smaller.
    """
    path = Metashape().write_xml(tmp_path / "a.xml")
    text = path.read_text()
    second = '<component id="1"/></components>'
    apart = text.replace("</components>", second).replace(
        'sensor_id="1" component_id="0" label="8004', 'sensor_id="1" component_id="1" label="8004'
    )
    for content in (apart, re.sub("<component id=.0.>.*</component>", "", apart)):
        path.write_text(content)
        block = read_metashape_block(path)
        assert block.oriented.tolist() == [True, True, True, False]
        assert block.local is (content is not apart)
        assert (
            "1 poses left out: they belong to components that are not connected to the block"
            in block.notes
        )


def test_a_camera_without_calibration(tmp_path):
    """Oracle: 8.8 mm over pixels of 2.4 um, the principal point in the middle."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    nominal = (
        '<property name="pixel_width" value="0.0024"/><property name="focal_length" value="8.8"/>'
    )
    text = re.sub("<calibration.*?</calibration>", "", path.read_text(), flags=re.DOTALL)
    path.write_text(text.replace("</sensor>", f"{nominal}</sensor>"))
    block = read_metashape_block(path)
    assert block.cameras[0].interior.tolist() == pytest.approx([8.8 / 0.0024, 640, 480, *[0] * 8])
    assert "has no calibration; its nominal focal length is taken" in block.notes[1]
    path.write_text(text)
    with pytest.raises(InputError, match="has neither calibration nor focal length"):
        read_metashape_block(path)


def test_a_local_system(tmp_path):
    """Oracle: the words of the CRS: poses stand in the axes of the markers, not on the globe."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    local = '<reference>LOCAL_CS["Local Coordinates (m)",UNIT["metre",1]]</reference>'
    path.write_text(re.sub("<reference>.*</reference>", local, path.read_text()))
    block = read_metashape_block(path)
    assert (block.local, block.geocentric) == (False, False)


def test_tangential_coefficients_in_an_order_that_nothing_confirms(tmp_path):
    """Oracle: f with a principal point from the corner, which no later version writes."""
    both = f"<f>{FY!r}</f><cx>{CX!r}</cx><cy>{CY!r}</cy><p1>0.001</p1>"
    block = read_metashape_block(Metashape(both).write_xml(tmp_path / "a.xml"))
    assert block.cameras[0].of("cx") == CX
    assert any("P1 and P2 of a project before PhotoScan 1.4" in note for note in block.notes)


def test_names_and_rows_of_a_block():
    """Oracle: what the record's docstring refuses."""
    one = image_points(("a", "b"), [0, 1], ["p", "p"], [[1, 2], [3, 4]], [1.0, 1.0])[0]
    rows = np.zeros(2, dtype=np.int64)
    with pytest.raises(InputError, match=r"MeasuredBlock.camera: row 1 of 0 cameras"):
        MeasuredBlock((), rows + 1, one, *no_poses(2), None, None, local=True)
    with pytest.raises(InputError, match=r"MeasuredBlock.position_m: shape \(3, 3\), expected"):
        MeasuredBlock((), rows, one, *no_poses(3), None, None, local=True)
    twice = image_points(("a", "a"), [0, 1], ["p", "p"], [[1, 2], [3, 4]], [1.0, 1.0])[0]
    with pytest.raises(InputError, match=r"MeasuredBlock.images: 'a' is there twice"):
        MeasuredBlock((), rows, twice, *no_poses(2), None, None, local=True)


def test_markers_alone(tmp_path):
    """Oracle: the projections and coordinates that stand there; no camera, no pose."""
    made = Metashape()
    rows = "".join(f'<camera id="{k + 10}" label="{n}"/>' for k, n in enumerate(SCENE.eo.images))
    off = '<camera id="90" label="off.tif" enabled="0"/>'
    (tmp_path / "markers.xml").write_text(
        f'<document version="2.0.0"><chunk label="c"><cameras>{rows}{off}</cameras>'
        f"<markers>{made.ground()}</markers><frames><frame id='0'>{made.projections()}</frame>"
        "</frames></chunk></document>"
    )
    block = read_measured_block(tmp_path / "markers.xml", sigma_px=0.4)
    assert block.cameras == ()
    assert not block.oriented.any()
    assert block.crs is None
    seen = block.measured.observations
    assert sorted(seen.uv.tolist()) == sorted([u, v] for _, p, u, v in made.seen if p < 5)
    assert set(seen.sigma_px.ravel()) == {0.4}
    assert block.ground.points == SCENE.names[:5]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("</document>", "", ":5: is no XML"),
        ("<document", "<settings", "is no XML"),
        ('class="adjusted">', 'class="adjusted"><p3>0.1</p3>', "'first': p3 other than zero"),
        (
            'type="frame" class="adjusted"',
            'type="spherical" class="adjusted"',
            "of the type spherical",
        ),
        (f"<f>{FY!r}</f>", "", "no <f>, nor <fx> and <fy>"),
        (f"<f>{FY!r}</f>", "<f>x</f>", "camera first: f: 'x' is no number"),
        (f"<cx>{CX - WIDTH_PX / 2!r}<", "<cx>5000<", "is neither near the image's centre nor"),
        ('sensor_id="1"', 'sensor_id="5"', "no <sensor> with the id 5"),
        ('label="8002.tif"', 'label="8001.tif"', "image 'first/8001.tif' occurs twice"),
        ('label="P2"', 'label="P1"', "marker 'P1' is there twice"),
        ('sxy="0.02"', 'sxy="0"', "marker P1: accuracy: 0; it must be greater than zero"),
        ('camera_id="11"', 'camera_id="55"', "measured in an image of the id 55"),
        ('marker_id="3"', 'marker_id="33"', "no marker with the id 33"),
        ('8001.tif"><transform>', '8001.tif"><transform>1 ', "17 numbers, expected 16"),
        ("0.0 0.0 0.0 1.0</trans", "0.0 0.0 0.5 1.0</trans", "8001.tif: is no rotation"),
        ("</frame>", '</frame><frame id="1"/>', "2 frames (a moving object)"),
        (
            "</chunk>",
            '</chunk><chunk label="b"><cameras><camera id="1"/></cameras></chunk>',
            "name",
        ),
    ],
)
def test_what_is_wrong_in_metashape_is_named(old, new, message, tmp_path):
    """Oracle: the fault that was written."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)) as refusal:
        read_metashape_block(path)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    "place",
    [
        *("(?<=<f>)1400[^<]*", "(?<=<k3>)[^<]*", '(?<="adjusted"><resolution width=")\\d+'),
        *("(?<=<translation>)[^ ]*", "(?<=<scale>)[^<]*", "(?<=<transform>)[-.e0-9]+"),
        *('(?<=sxy=")[^"]*', '(?<=value=")0.8', '(?<=pinned="true" x=")[^"]*'),
        *(
            '(?<=pinned=")true',
            '(?<=label="off.tif" enabled=")false',
            '(?<=enabled=")false(?="/></m)',
        ),
    ],
)
def test_a_value_of_metashape_that_cannot_be_read(place, tmp_path):
    """Oracle: the value that was written."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    whole = path.read_text()
    for value in UNREADABLE:
        text, count = re.subn(place, value, whole, count=1)
        assert count == 1
        path.write_text(text, encoding="utf-8")
        with pytest.raises(InputError) as refusal:
            read_metashape_block(path)
        assert value in str(refusal.value)


@pytest.mark.parametrize("value", ["0", "-1", "x", ""])
def test_an_accuracy_that_is_none_stands_for_no_other(value, tmp_path):
    """Oracle: the value that was written; a setting of zero was taken as not written, and an empty
    accuracy of an axis as that of all.
    """
    reference = f'<reference x="1" y="2" z="3" sx="{value}" sxyz="0.1"/></camera>'
    text = Metashape().write_xml(tmp_path / "a.xml").read_text()
    path = tmp_path / "b.xml"
    path.write_text(text.replace("</transform></camera>", f"</transform>{reference}"))
    with pytest.raises(InputError, match=rf"camera 8001\.tif: accuracy: .*{value}"):
        read_metashape_references(path)
    path.write_text(text.replace('value="0.3"', f'value="{value}"'))
    with pytest.raises(InputError, match=rf"setting accuracy_projections: .*{value}"):
        read_metashape_block(path)


def test_several_chunks(tmp_path):
    """Oracle: the label that is named."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    other = '</chunk><chunk label="b"><cameras><camera id="1" label="x.tif"/></cameras></chunk>'
    path.write_text(path.read_text().replace("</chunk>", other))
    with pytest.raises(InputError, match="2 chunks have images, of 'Chunk 1', 'b'; name one by"):
        read_metashape_block(path)
    assert read_metashape_block(path, chunk="b").measured.images == ("x.tif",)
    assert len(read_measured_block(path, chunk="Chunk 1").measured.images) == 4
    with pytest.raises(InputError, match="no chunk 'c'"):
        read_metashape_block(path, chunk="c")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda data: data[:-40], "is no readable zip archive"),
        (lambda data: zipped({"a": b""}), "has no doc.xml inside"),
    ],
)
def test_a_damaged_project(change, message, tmp_path):
    """Oracle: the damage."""
    path = Metashape().write_psz(tmp_path / "a.psz")
    path.write_bytes(change(path.read_bytes()))
    with pytest.raises(InputError, match=message):
        read_measured_block(path)


@pytest.mark.parametrize(
    ("table", "message"),
    [
        (
            b"ply\nformat ascii 1.0\nelement vertex 0\nend_header\n",
            "is no binary little-endian PLY",
        ),
        (ply([("float", "x"), ("float", "y")], [(1, 2)]), "has no column id"),
        (ply([("float", "x"), ("float", "y"), ("int", "id")], [(1, 2, 3)])[:-1], "0 of 1 rows"),
    ],
)
def test_a_damaged_table_of_tie_points(table, message, tmp_path):
    """Oracle: the damage."""
    made = Metashape()
    tables = made.tables() | {"p0.ply": table}
    made.tables = lambda: tables
    with pytest.raises(InputError, match=message):
        read_measured_block(made.write_psz(tmp_path / "a.psz"))


def test_a_psx_without_its_folder(tmp_path):
    """Oracle: the folder that is not there."""
    (tmp_path / "a.psx").write_text('<document path="{projectname}.files/project.zip"/>')
    with pytest.raises(InputError, match=r"no such file; a project needs <name>\.psx and"):
        read_measured_block(tmp_path / "a.psx")


MODELS = {  # parameters, and the terms of the scene's camera that the model has
    "SIMPLE_PINHOLE": ((FY, CX, CY), {"fx": FY, "k3": 0, "p": (0, 0), "radial": (0, 0)}),
    "PINHOLE": ((FX, FY, CX, CY), {"k3": 0, "p": (0, 0), "radial": (0, 0)}),
    "SIMPLE_RADIAL": ((FY, CX, CY, K1), {"fx": FY, "k3": 0, "p": (0, 0), "radial": (K1, 0)}),
    "RADIAL": ((FY, CX, CY, K1, K2), {"fx": FY, "k3": 0, "p": (0, 0)}),
    "OPENCV": ((FX, FY, CX, CY, K1, K2, P1, P2), {"k3": 0}),
    "FULL_OPENCV": ((FX, FY, CX, CY, K1, K2, P1, P2, K3, 0, 0, 0), {}),
}


def colmap_model(model, parameters, seen):
    """A reconstruction of pycolmap."""
    pycolmap = oracle("pycolmap")
    eo, made = SCENE.eo, pycolmap.Reconstruction()
    camera = pycolmap.Camera(
        model=model, width=WIDTH_PX, height=HEIGHT_PX, params=list(parameters), camera_id=3
    )
    made.add_camera_with_trivial_rig(camera)
    tracks = [pycolmap.Track() for _ in SCENE.names]
    for k, name in enumerate(eo.images):
        own = [(p, (u, v)) for i, p, u, v in seen if i == k]
        image = pycolmap.Image(name=f"day1/{name}", camera_id=3, image_id=k + 5)
        image.points2D = pycolmap.Point2DList([pycolmap.Point2D(np.array(x)) for _, x in own])
        C = eo.C_mc[k].T
        pose = pycolmap.Rigid3d(pycolmap.Rotation3d(C), -C @ eo.position_m[k])
        made.add_image_with_trivial_frame(image, pose)
        for row, (p, _) in enumerate(own):
            tracks[p].add_element(k + 5, row)
    for x, track in zip(SCENE.points, tracks, strict=True):
        made.add_point3D(x, track, np.zeros(3, dtype=np.uint8))
    return made


@pytest.mark.parametrize("model", MODELS)
def test_colmap(model, tmp_path):
    """Oracle: pycolmap writes the model and projects its points by itself; OpenCV's formula."""
    parameters, terms = MODELS[model]
    seen = observed(distorted_pixels(**terms))
    made = colmap_model(model, parameters, seen)
    assert np.abs(made.image(5).project_point(SCENE.points[seen[0][1]]) - seen[0][2:]).max() < 1e-8
    for kind in ("text", "binary"):
        (tmp_path / kind).mkdir()
        getattr(made, f"write_{kind}")(str(tmp_path / kind))
        block = read_measured_block(tmp_path / kind, sigma_px=0.7)
        names = [str(p + 1) for p in range(len(SCENE.names))]
        assert np.abs(residuals(block, names, SCENE.points)).max() < CLOSE_PX
        assert block.measured.images == SCENE.eo.images
        assert len(block.measured.observations) == len(seen)
        assert set(block.measured.observations.sigma_px.ravel()) == {0.7}
        assert block.local
    assert recognise_format(tmp_path / "text" / "images.txt") == "colmap"


def test_what_colmap_cannot_give(tmp_path):
    """Oracle: models that are not Brown's, and directories without one."""
    seen = observed(distorted_pixels())
    for model, parameters, message in (
        ("FOV", (FX, FY, CX, CY, 0.1), "model FOV is not Brown's"),
        (
            "FULL_OPENCV",
            (FX, FY, CX, CY, 0, 0, 0, 0, 0, 0.1, 0, 0),
            "rational polynomial .k4 not zero",
        ),
    ):
        colmap_model(model, parameters, seen).write_text(str(tmp_path))
        with pytest.raises(InputError, match=message):
            read_measured_block(tmp_path)
    (tmp_path / "images.txt").unlink()
    with pytest.raises(InputError, match="holds no COLMAP model"):
        read_measured_block(tmp_path)


@pytest.mark.parametrize("value", UNREADABLE)
def test_a_text_model_of_colmap_with_what_is_no_number(value, tmp_path):
    """Oracle: the value that was written; pycolmap takes 5% for 5 and 0x10 for 0."""
    parameters, terms = MODELS["OPENCV"]
    colmap_model("OPENCV", parameters, observed(distorted_pixels(**terms))).write_text(
        str(tmp_path)
    )
    for name, row, column in (
        ("cameras.txt", -1, 2),
        ("cameras.txt", -1, -1),
        ("images.txt", -2, 3),
    ):
        lines = (tmp_path / name).read_text().splitlines()
        words = lines[row].split(" ")
        words[column] = value
        changed = "\n".join([*lines[:row], " ".join(words), *lines[row:][1:]]) + "\n"
        (tmp_path / name).write_text(changed, encoding="utf-8")
        with pytest.raises(
            InputError, match=rf"{name}:{len(lines) + 1 + row}: .*missing or is no number"
        ):
            read_measured_block(tmp_path)
        (tmp_path / name).write_text("\n".join(lines) + "\n")
    read_measured_block(tmp_path)
    text = (tmp_path / "images.txt").read_text()
    last = text.splitlines()[-1].split()[0]
    (tmp_path / "images.txt").write_text(text.replace(last, f"{value}%"), encoding="utf-8")
    with pytest.raises(InputError, match="missing or is no number"):
        read_measured_block(tmp_path)


def test_colmap_without_pycolmap(tmp_path, monkeypatch):
    """Oracle: a Python without it."""
    monkeypatch.setitem(__import__("sys").modules, "pycolmap", None)
    (tmp_path / "cameras.txt").write_text("")
    with pytest.raises(UsageError, match=re.escape("pip install 'insgnss[colmap]'")):
        read_measured_block(tmp_path)


SIZE = {"width": WIDTH_PX, "height": HEIGHT_PX}
CENTRE = {"c_x": (CX - WIDTH_PX / 2) / WIDTH_PX, "c_y": (CY - HEIGHT_PX / 2) / WIDTH_PX}
BROWN = SIZE | CENTRE | {"projection_type": "brown", "k1": K1, "k2": K2, "k3": K3}
BROWN |= {"focal_x": FX / WIDTH_PX, "focal_y": FY / WIDTH_PX, "p1": P1, "p2": P2}


def test_opensfm(tmp_path):
    """Oracle: the scene by OpenCV's formula; a feature of twice the scale has twice the sigma."""
    seen = observed(distorted_pixels())
    block = read_measured_block(write_opensfm(tmp_path, BROWN, seen), sigma_px=0.6)
    names = [str(100 + p) for p in range(len(SCENE.names))]
    assert np.abs(residuals(block, names, POINTS_ECEF)).max() < CLOSE_PX
    assert (block.local, block.geocentric) == (False, True)
    assert block.measured.images == SCENE.eo.images
    assert len(block.measured.observations) == len(seen)
    of = [int(block.measured.points[p]) - 99 for p in block.measured.observations.point]
    assert block.measured.observations.sigma_px[:, 0] == pytest.approx(
        0.6 * np.array(of) / np.median(of)
    )
    block = read_opensfm_model(write_opensfm(tmp_path, BROWN, seen, reference=False))
    assert (block.local, block.geocentric) == (True, False)
    assert np.abs(residuals(block, names, SCENE.points)).max() < CLOSE_PX


def test_opensfm_perspective_and_older_tracks(tmp_path):
    """Oracle: OpenSfM's perspective camera, f and k1, k2 about the centre; tracks of version 0."""
    camera = SIZE | {"projection_type": "perspective", "focal": FY / WIDTH_PX, "k1": K1, "k2": K2}
    pixels = distorted_pixels(fx=FY, k3=0, p=(0, 0)) + [WIDTH_PX / 2 - CX, HEIGHT_PX / 2 - CY]
    (tmp_path / "opensfm").mkdir()
    write_opensfm(tmp_path / "opensfm", camera, observed(pixels))
    file = tmp_path / "opensfm" / "tracks.csv"
    rows = [line.split("\t") for line in file.read_text().splitlines()[1:]]
    file.write_text("".join("\t".join(row[:5] + row[6:9]) + "\n" for row in rows))
    block = read_measured_block(tmp_path)
    names = [str(100 + p) for p in range(len(SCENE.names))]
    assert np.abs(residuals(block, names, POINTS_ECEF)).max() < CLOSE_PX
    assert set(block.measured.observations.sigma_px.ravel()) == {1.0}


def test_reconstructions_that_are_not_connected(tmp_path):
    """Oracle: a second one with an image of its own, without reference."""
    more = [{"cameras": {}, "shots": {"x.tif": {}}}]
    write_opensfm(tmp_path, BROWN, observed(distorted_pixels()), False, more)
    block = read_measured_block(tmp_path / "reconstruction.json")
    assert block.measured.images == SCENE.eo.images
    assert block.notes[0].startswith("1 images left out: they belong to 1 reconstructions")


@pytest.mark.parametrize(
    ("file", "old", "new", "message"),
    [
        ("reconstruction.json", '"brown"', '"fisheye62"', "'fisheye62' is not Brown's"),
        ("reconstruction.json", '"width": 1280', '"width": "w"', "width 'w' is no number"),
        ("reconstruction.json", '"rotation": [', '"rotation": [1, ', "is not three numbers"),
        ("reconstruction.json", '"v2 cam"}', '"v3 cam"}', "no camera 'v3 cam'"),
        ("reconstruction.json", '"shots"', '"shorts"', "is no list of reconstructions with shots"),
        ("reconstruction.json", "[{", "[", "is no JSON"),
        ("reconstruction.json", '"width": 1280', '"width": 1280.5', "no whole numbers of pixels"),
        ("reconstruction.json", '"width": 1280', '"width": "1280"', "width '1280' is no number"),
        ("reconstruction.json", '"k1": ', '"k1": true, "x": ', "k1 True is no number"),
        ("reconstruction.json", '"k1": ', f'"k1": 1{"0" * 400}, "x": ', "is no number"),
        ("reconstruction.json", '"k1": ', '"k1": NaN, "x": ', "k1 nan is no number"),
        ("reconstruction.json", '"rotation": [', '"rotation": ["1", 1, 1], "x": [', "is not three"),
        ("reconstruction.json", '"altitude": ', '"altitude": null, "x": ', "altitude None is no"),
        ("tracks.csv", "_v2", "_v\N{ARABIC-INDIC DIGIT TWO}", ":1: version"),
        ("tracks.csv", "_v2", "_v7", ":1: version 'OPENSFM_TRACKS_VERSION_v7'; read are 0 to 2"),
        ("tracks.csv", "\t-1\t-1\n", "\t-1\n", ":2: 10 fields, expected 11"),
        ("tracks.csv", "\t7\t", "\t7\tx", ":2: 'x"),
        ("tracks.csv", "tif", "jpg", "observes no image of reconstruction.json"),
    ],
)
def test_what_is_wrong_in_opensfm_is_named(file, old, new, message, tmp_path):
    """Oracle: the fault that was written."""
    write_opensfm(tmp_path, BROWN, observed(distorted_pixels()))
    text = (tmp_path / file).read_text()
    assert old in text
    text = text.replace(old, new) if new == "jpg" else text.replace(old, new, 1)
    (tmp_path / file).write_text(text)
    with pytest.raises(InputError, match=re.escape(message)):
        read_measured_block(tmp_path)


def test_opensfm_without_tracks(tmp_path):
    """Oracle: the file that is not there."""
    write_opensfm(tmp_path, BROWN, observed(distorted_pixels()))
    (tmp_path / "tracks.csv").unlink()
    with pytest.raises(InputError, match=r"tracks\.csv: no such file"):
        read_measured_block(tmp_path)


@pytest.mark.parametrize("head", ["EPSG:32632", "WGS84 UTM 32N", "+proj=utm +zone=32 +datum=WGS84"])
def test_gcp_list(head, tmp_path):
    """Oracle: the scene's points by pyproj; pixels of the program are less by 0.5, its first pixel
    has the centre (0, 0).
    """
    seen, utm = observed(distorted_pixels()), utm_points()
    rows = [
        f"{' '.join(map(repr, utm[p].tolist()))}\t{u - 0.5!r} {v - 0.5!r} {SCENE.eo.images[i]}"
        f" {SCENE.names[p]}\n"
        for i, p, u, v in seen
    ]
    (tmp_path / "gcp_list.txt").write_text(f"{head}\n# comment\n{''.join(rows)}")
    block = read_measured_block(tmp_path / "gcp_list.txt", sigma_m=(0.01, 0.01, 0.03))
    got = block.measured.observations
    assert np.abs(got.uv - [row[2:] for row in seen]).max() < CLOSE_PX
    places = dict(zip(block.ground.points, block.ground.position_m.tolist(), strict=True))
    assert places == {SCENE.names[p]: utm[p].tolist() for _, p, _, _ in seen}
    assert [block.measured.points[p] for p in got.point] == [SCENE.names[r[1]] for r in seen]
    assert [block.measured.images[i] for i in got.image] == [SCENE.eo.images[r[0]] for r in seen]
    assert block.crs == (head if head.startswith("+") else "EPSG:32632")
    assert block.ground.cov[0, 2, 2] == pytest.approx(0.03**2)
    nameless = "".join(row.rsplit(" ", 1)[0] + "\n" for row in rows)
    (tmp_path / "gcp_list.txt").write_text(f"{head}\n{nameless}")
    block = read_gcp_list(tmp_path / "gcp_list.txt")
    assert len(block.ground.points) == len(places)
    assert block.ground.points[0] == "GCP1"


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("EPSG:32632", "EPSG:99999", ":1: CRS 'EPSG:99999' is unknown"),
        ("EPSG:32632", "UTM 32", ":1: 'UTM 32' is no CRS"),
        ("EPSG:32632", "WGS84 UTM \N{ARABIC-INDIC DIGIT THREE}2N", "is unknown"),
        ("8001.tif G1\n", "\n", ":2: 5 fields"),
        ("1011.2", "nan", ":2: 'nan' where a finite number must stand"),
        ("8002.tif G2\n", "8002.tif", ":4: truncated: the file ends within this line"),
        (
            "8002.tif G1\n312611.50 5161377.10 1003.8 3401.0 2210.50 8002.tif G2\n",
            "8002.tif G",
            ":3: truncated: the file ends within this line",
        ),
        ("8002.tif G1", "8001.tif G1", ":3: point 'G1' is measured twice in image '8001.tif'"),
    ],
)
def test_what_is_wrong_in_a_gcp_list_is_named(old, new, message, tmp_path):
    """Oracle: the fault that was written into the page's example."""
    text = on_page("gcp_list")
    assert old in text
    (tmp_path / "x").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_gcp_list(tmp_path / "x")


@pytest.mark.parametrize(("unit", "um"), [("mm", 1e3), ("um", 1.0), ("px", 0.0)])
def test_bingo(unit, um, tmp_path):
    """Oracle: photo coordinates of the scene's pixels, x right and y up from the image's centre, by
    the pixel's size; the older files of pixels as they are.
    """
    seen, text = observed(distorted_pixels()), ""
    for i, name in enumerate(SCENE.eo.images):
        text += f"{name.removesuffix('.tif')} CAM\n"
        for _, p, u, v in (row for row in seen if row[0] == i):
            x, y = (
                (u, v)
                if unit == "px"
                else (
                    (u - WIDTH_PX / 2) * 5.5 / um,
                    (HEIGHT_PX / 2 - v) * 5.5 / um,
                )
            )
            text += f" {SCENE.names[p]} {x:.9f} {y:.9f}\n"
        text += "-99\n"
    (tmp_path / "image.dat").write_text(text)
    size = {} if unit == "px" else {"pixel_um": 5.5, "width": WIDTH_PX, "height": HEIGHT_PX}
    block = read_measured_block(tmp_path / "image.dat", unit=unit, **size)
    got = block.measured
    assert np.abs(got.observations.uv - [row[2:] for row in seen]).max() < CLOSE_PX
    assert got.images == ("8001", "8002", "8003", "8004")
    assert [got.points[p] for p in got.observations.point] == [SCENE.names[r[1]] for r in seen]
    assert block.cameras == ()
    with pytest.raises(DataError, match="unit 'inch'"):
        read_bingo(tmp_path / "image.dat", unit="inch")
    with pytest.raises(DataError, match="need pixel_um, width and height of the camera"):
        read_bingo(tmp_path / "image.dat", unit="mm")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("-99\n8002", "-99\n1 2 3\n8002", ":5: '1 2 3': stands before the first image"),
        ("8002", "8001", ":5: image '8001' occurs in two blocks"),
        ("1006", "1020", ":3: point '1020' is measured twice in image '8001', before in line 2"),
        ("-1.90643", "left", ":2: 'left' where a finite number"),
        (
            " -1.90643",
            "",
            ":2: the previous image lacks its final -99, or this line lacks a number",
        ),
        ("1.87814\n-99\n", "1.87814\n", ":6: truncated: the file ends before the -99 of image"),
        ("1.87814\n-99\n", "1.87814\n-9", ":7: truncated"),
    ],
)
def test_what_is_wrong_in_bingo_is_named(old, new, message, tmp_path):
    """Oracle: the fault that was written into the page's example."""
    text = on_page("bingo")
    assert old in text
    (tmp_path / "x").write_text(text.replace(old, new, 1))
    with pytest.raises(InputError, match=re.escape(message)):
        read_bingo(tmp_path / "x", unit="px")


def test_plain_tables_and_dbat(tmp_path):
    """Oracle: the examples of their pages."""
    (tmp_path / "points.csv").write_text(on_page("image_points"))
    block = read_measured_block(tmp_path / "points.csv", sigma_px=0.1)
    assert block.measured.images == ("8001.tif", "8002.tif")
    assert not block.oriented.any()
    for kind, name in (("script", "b.xml"), ("images", "images.txt"), ("eo", "eo.txt")):
        (tmp_path / name).write_text(on_page("dbat", kind))
    (tmp_path / "points.txt").write_text(on_page("dbat"))
    block = read_measured_block(tmp_path / "b.xml", sigma_px=0.1)
    assert block.cameras[0].backward
    assert block.oriented.all()
    assert block.ground is None


def test_what_is_known_of_none(tmp_path):
    """Oracle: a file of another kind, and options that a format does not take."""
    (tmp_path / "x").write_text("hello\n")
    with pytest.raises(
        InputError, match="is not recognised as image observations; readable are"
    ) as told:
        read_measured_block(tmp_path / "x")
    assert all(word in str(told.value) for _, _, word in FORMATS.values())
    (tmp_path / "y").write_text("<kml/>")
    for path in (tmp_path, tmp_path / "y"):
        with pytest.raises(InputError, match="is not recognised as image observations"):
            read_measured_block(path)
    with pytest.raises(UsageError, match=r"format 'bingos' .* did you mean 'bingo'"):
        read_measured_block(tmp_path / "x", format="bingos")
    (tmp_path / "points.csv").write_text(on_page("image_points"))
    with pytest.raises(UsageError, match="of the format image_points, which takes no chunk"):
        read_measured_block(tmp_path / "points.csv", chunk="a")
    with pytest.raises(DataError, match="sigma_px 0; it must be positive"):
        read_measured_block(tmp_path / "points.csv", sigma_px=0.0)


def test_a_point_measured_twice_by_a_program(tmp_path):
    """Oracle: tracks with two features of an image: neither of them is taken."""
    seen = observed(distorted_pixels())
    write_opensfm(tmp_path, BROWN, [*seen, (seen[0][0], seen[0][1], 5.0, 5.0)])
    block = read_measured_block(tmp_path)
    assert len(block.measured.observations) == len(seen) - 1
    assert block.notes[0].startswith("2 observations left out: their points are measured more")


@pytest.mark.parametrize(
    ("name", "count", "median", "rms"),
    [("MARKER_LABEL", 183, (0.79, 0.42), (1.0, 0.7)), ("MARKER_LABEL_XY", 611, None, (2.0, 1.4))],
)
def test_control_points_of_a_real_block(name, count, median, rms):
    """Oracle: coordinates of ground control by pyproj, and figures of an earlier, independent
    evaluation of these files, to their printed digits.
    """
    from pyproj import CRS, Transformer

    path = DATA / "metashape_p4p_taiwan" / f"{name}.xml"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    block = read_measured_block(path)
    to_ecef = Transformer.from_crs(CRS.from_wkt(block.crs).to_3d(), "EPSG:4978", always_xy=True)
    truth = np.column_stack(to_ecef.transform(*block.ground.position_m.T))
    e = residuals(block, block.ground.points, truth)
    assert len(e) == count
    if median:
        assert np.abs(np.median(np.abs(e), axis=0) - median).max() < 0.005
    assert np.abs(np.sqrt((e * e).mean(axis=0)) - rms).max() < 0.05


def test_a_real_project_with_tie_points():
    """Oracle: DBAT's own extract of the markers (four decimals), and the program's object points,
    which its tie points see to some tenths of a pixel: half a pixel of origin would show.
    """
    from insgnss.io.formats.blocks.metashape_project import opened_project, read_ply

    path = DATA / "dbat" / "sxb" / "psprojects" / "sxb.psz"
    if not path.is_file():
        pytest.skip(f"{path} is not here")
    block = read_measured_block(path)
    seen = block.measured.observations
    marks = np.loadtxt(
        DATA / "dbat" / "script" / "sxb" / "measurements" / "markpts.txt", delimiter=","
    )
    for _, image, u, v in marks:
        assert np.abs(seen.uv[seen.image == image - 1] - (u, v)).max(axis=1).min() < 1e-3
    root, place = opened_project(path)
    points = read_ply(place, "points0.ply", ("x", "y", "z", "id"))
    parts = [root.find(f".//chunk/transform/{k}") for k in ("rotation", "translation", "scale")]
    R, t, s = (np.array(part.text.split(), dtype=float) for part in parts)
    X = t + s * np.column_stack([points[k] for k in "xyz"]).astype(float) @ R.reshape(3, 3).T
    row = {f"T{number}": k for k, number in enumerate(points["id"].tolist())}
    tied = np.array([block.measured.points[p] in row for p in seen.point])
    assert tied.sum() == 4019
    at = [row[block.measured.points[p]] for p in seen.point[tied]]
    q = X[at] - block.position_m[seen.image[tied]]
    x = np.einsum("nji,nj->ni", block.C_mc[seen.image[tied]], q)
    e = seen.uv[tied] - pixels_of(block.cameras[0], x[:, :2] / x[:, 2:])
    assert np.abs(np.median(e, axis=0)).max() < 0.1
    assert np.sqrt((e * e).mean(axis=0)).max() < 0.4
