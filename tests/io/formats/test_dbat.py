"""Scripts of the Damped Bundle Adjustment Toolbox that are not as their page has them."""

import re
from pathlib import Path

import numpy as np
import pytest
from format_pages import UNREADABLE

from insgnss.base.errors import InputError
from insgnss.io.formats.blocks.dbat import read_dbat

PAGE = Path(__file__).parents[3] / "data_specs" / "dbat.md"
TABLES = {"script": "block.xml", "images": "images.txt", "eo": "eo.txt", "true": "points.txt"}


def written(tmp_path: Path, changes: dict[str, tuple[str, str]] | None = None) -> Path:
    """The example of the page, with `changes` of its tables: old and new text."""
    for kind, name in TABLES.items():
        text = re.search(rf"```{kind}\n(.*?)```", PAGE.read_text(), re.DOTALL)[1]
        if changes and kind in changes:
            old, new = changes[kind]
            assert old in text
            text = text.replace(old, new)
        (tmp_path / name).write_text(text)
    return tmp_path / "block.xml"


@pytest.mark.parametrize(
    ("kind", "old", "new", "message"),
    [
        ("script", "</document>", "", "is no XML"),
        ("script", "dbat_script_version", "version", "this is another kind of XML file"),
        ("script", "im,id,x,y", "im,id,x", "has no column y"),
        ("script", "im,id,x,y", "im,id,x,y,sx", "4 fields, the script names 5"),
        ("script", "<model>3</model>", "<model>-1</model>", "model '-1' in 'mm'; only 3 in mm"),
        ("script", "auto,24", "30,24", "pixels are not square; give <sensor> auto,24"),
        ("script", "auto,24", "wide", "<sensor> 'wide' is not width,height in mm"),
        ("script", "<cc>24.3581</cc>", "<cc>f</cc>", "<cc>: 'f' is not 1 numbers; write a plain"),
        (
            "script",
            "1e-5,2e-5",
            "1e-5,2e-5,0",
            "3 values in <K> and 3 in <P>; give at most 4 in <K>",
        ),
        ("script", 'units="degrees"', 'units="degree"', "did you mean 'degrees'?"),
        ("script", ">depend<", ">free<", "set_datum: 'free' of camera '1'"),
        ("script", 'ref_cam="1"', 'ref_cam="3"', "set_datum: 'depend' of camera '3'"),
        ("script", 'ref_base="longest"', 'ref_base="9"', "ref_base '9' is no image"),
        ("script", "<P>false</P><K3>", "<R>false</R><K3>", "<R>false</R> is not understood"),
        ("script", 'sxy="0.5"', 'sxy="half"', "sxy='half' is no number of pixels"),
        ("script", 'sxy="0.5"', 'sxy="0"', "it must be positive"),
        ("script", "points.txt", "point.txt", "no such file"),
        ("images", "2, images", "1, images", "image 1 is listed twice"),
        ("images", "2, images", "2.5, images", ":2: image 2.5 is no whole number"),
        ("eo", "2,  1.97", "4,  1.97", ":2: image 4 is not in the list of images"),
        ("true", "2,    1,2568", "2,    1.5,2568", ":2: point 1.5 is no whole number"),
        ("true", "2,    1,2568", "1,    1,2568", ":2: point 1 is measured twice in image 1"),
    ],
)
def test_what_is_wrong_is_named(kind, old, new, message, tmp_path) -> None:
    """Oracle: the fault that was written."""
    with pytest.raises(InputError, match=re.escape(message)):
        read_dbat(written(tmp_path, {kind: (old, new)}))


def test_first_values_of_the_script_replace_those_of_the_camera(tmp_path) -> None:
    """Oracle: b1 = aspect - 1 and b2 = -skew of the page; 'loaded' changes nothing."""
    values = "<all>loaded</all><aspect>1.25</aspect><skew>-0.5</skew><c>none</c>"
    start = f"<operations><set_initial_values><io>{values}</io></set_initial_values>"
    camera = read_dbat(written(tmp_path, {"script": ("<operations>", start)})).cameras[0]
    assert [camera.of(name) for name in ("b1", "b2", "k1")] == [0.25, 0.5, 2.174e-4]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("<K>2.174e-4,", "<K>{},"),
        ("<K>2.174e-4,-1.518e-7,0<", "<K>{}<"),
        ("<P>1e-5,", "<P>{},"),
        ("<skew>0<", "<skew>{}<"),
        ("<aspect>1<", "<aspect>{}<"),
        ("<cc>24.3581<", "<cc>{}<"),
        ("<pp>18.1143,", "<pp>{},"),
        ("<image>5616,", "<image>{},"),
        ("<sensor>auto,24", "<sensor>auto,{}"),
        ('sxy="0.5"', 'sxy="{}"'),
        ('ref_base="longest"', 'ref_base="{}"'),
    ],
)
def test_a_value_that_cannot_be_read_is_named(old, new, tmp_path) -> None:
    """Oracle: the value that was written; once K and P of such values meant no distortion."""
    for value in UNREADABLE:
        with pytest.raises(InputError) as refusal:
            read_dbat(written(tmp_path, {"script": (old, new.format(value))}))
        assert value in str(refusal.value)
        assert old.strip("<").partition(">")[0].partition("=")[0] in str(refusal.value)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("<P>1e-5,2e-5<", "<P>1e-5<", "3 values in <K> and 1 in <P>"),
        ("<K>2.174e-4,-1.518e-7,0<", "<K>2.174e-4,,0<", "<K>: '2.174e-4,,0' is not a list"),
        ("<K>2.174e-4,-1", "<nK>3</nK><K>2,174e-4,-1", "<nK> '3', but 4 coefficients are given"),
        ("<image>5616,", "<image>5616.5,", "<image> 5616.5,3744 is not whole pixels"),
        ("auto,24", "auto24,24", "<sensor> 'auto24,24' is not width,height"),
        ("auto,24", "-1,24", "<sensor> '-1,24' is not width,height"),
        ('units="degrees"', 'units=""', "prior_eo: angles in ''"),
    ],
)
def test_what_once_was_taken_for_something_else(old, new, message, tmp_path) -> None:
    """Oracle: the fault that was written; each was read as zero, as another place or a default."""
    with pytest.raises(InputError, match=re.escape(message)):
        read_dbat(written(tmp_path, {"script": (old, new)}))


@pytest.mark.parametrize("number", ["9" * 30, "-1e20"])
def test_numbers_of_points_that_no_integer_holds(number, tmp_path) -> None:
    """Oracle: the line; they wrapped around."""
    with pytest.raises(InputError, match=r":1: point .* is no whole number"):
        read_dbat(written(tmp_path, {"true": ("1,    1,1880", f"1, {number},1880")}))


def test_control_and_check_points_of_one_file(tmp_path) -> None:
    """Oracle: the filters of the script; a column of labels is left out."""
    elements = "".join(
        f'<{kind}><file format="id,label,x,y,z,sx,sy,sz">ground.txt</file>'
        f'<filter id="7,9">{action}</filter></{kind}>'
        for kind, action in (("ctrl_pts", "remove"), ("check_pts", "keep"))
    )
    path = written(tmp_path, {"script": ("<images>", f"{elements}<images>")})
    (tmp_path / "ground.txt").write_text(
        "# Id, Name, X, Y, Z, sX, sY, sZ\n"
        "1, A1, 10.5, 20, 30, 0.02, 0.03, 0.04\n"
        "7, B2, 1, 2, 3, 0.02, 0.02, 0.04\n"
        "9, B3, 4, 5, 6, 0.02, 0.02, 0.04\n"
    )
    block = read_dbat(path)
    assert [block.points[p] for p in block.control.point] == ["1"]
    assert block.control.position_m.tolist() == [[10.5, 20.0, 30.0]]
    assert block.control.cov[0] == pytest.approx(np.diag([4e-4, 9e-4, 16e-4]))
    assert [block.points[p] for p in block.check.point] == ["7", "9"]
    assert [block.points[p] for p in block.observations.point] == ["1", "1"]


def test_columns_of_one_sigma_and_attributes(tmp_path) -> None:
    """Oracle: DBAT's own rule: columns of each row, an attribute in their place."""
    path = written(tmp_path)
    table = "".join(f"{k}, 1, 1880.1, 2570.{k}, 0.{k}\n" for k in (1, 2))
    (tmp_path / "points.txt").write_text(table)
    text = path.read_text()
    for changed, expected in (
        ('format="im,id,x,y,sxy"', [[0.1, 0.1], [0.2, 0.2]]),
        ('format="im,id,x,y,sxy" sx="0.7"', [[0.7, 0.1], [0.7, 0.2]]),
        ('format="im,id,x,y,sxy" sxy="0.5"', [[0.5, 0.5], [0.5, 0.5]]),
    ):
        path.write_text(text.replace('format="im,id,x,y" sxy="0.5"', changed))
        assert read_dbat(path).observations.sigma_px.tolist() == expected


@pytest.mark.parametrize("initial", ["<all>loaded</all>", "<all>default</all>", "default"])
def test_what_lacks_is_what_dbat_takes(tmp_path, initial) -> None:
    """Oracle: DBAT's defaults: the focal length, the middle, aspect 1, skew 0, zeros of K and P."""
    path = written(tmp_path)
    text = re.sub(
        "<aspect>.*?</P>",
        "<focal>24</focal><model>3</model><nK>3</nK><nP>2</nP>",
        path.read_text(),
        flags=re.DOTALL,
        count=1,
    )
    start = f"<operations><set_initial_values><io>{initial}</io></set_initial_values>"
    elements = '<ctrl_pts><file format="id,x,y,z">ground.txt</file></ctrl_pts>'
    text = text.replace("<operations>", start).replace("<images>", f"{elements}<images>")
    path.write_text(text.replace("<P>false</P>", "<P>true</P>"))
    (tmp_path / "ground.txt").write_text("1, 10.5, 20, 30\n")
    block = read_dbat(path)
    (camera,) = block.cameras
    assert [camera.of(k) for k in ("f", "cx", "cy")] == pytest.approx([3744.0, 2808.0, 1872.0])
    assert not np.any([camera.of(k) for k in ("b1", "b2", "k1", "k2", "k3", "p1", "p2")])
    assert camera.free == ("f", "cx", "cy", "k1", "k2", "p1", "p2")
    assert block.control.cov[0] == pytest.approx(1e-12 * np.eye(3))


def test_images_without_prior_orientation(tmp_path) -> None:
    """Oracle: a script without prior_eo and datum: nothing held, no first values."""
    prior = re.search(r"  <prior_eo>.*?</prior_eo>\n", PAGE.read_text(), re.DOTALL)[0]
    path = written(tmp_path, {"script": (prior, "")})
    text = path.read_text()
    path.write_text(re.sub(r"<operation><set_datum.*?</operation>", "", text, flags=re.DOTALL))
    block = read_dbat(path)
    assert not block.held.any()
    assert not block.oriented.any()
    path.write_text(text)
    with pytest.raises(InputError, match="'depend' needs a prior orientation of every image"):
        read_dbat(path)
