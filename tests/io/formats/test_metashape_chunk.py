"""Poses and references of a chunk of Metashape 2: rigs, covariances, CRS of their own."""

import re

import numpy as np
import pytest
from block_scene import SCENE, TO_ECEF, Metashape, numbers
from numpy.testing import assert_allclose
from scipy.spatial.transform import Rotation

from insgnss.base.errors import InputError
from insgnss.io.formats.blocks.joined import match_names
from insgnss.io.formats.blocks.metashape_block import read_metashape_block
from insgnss.io.formats.blocks.metashape_chunk import read_metashape_references
from insgnss.io.formats.returned.projects import read_metashape_xml

WORLD = 'GEOGCS["WGS 84",DATUM["World Geodetic System 1984"]]'


def changed(path, pattern, text, count=1):
    """The file with the first match of a pattern replaced."""
    content = path.read_text()
    assert re.search(pattern, content, re.DOTALL)
    path.write_text(re.sub(pattern, lambda _: text, content, count=count, flags=re.DOTALL))
    return path


def test_a_slave_camera_stands_on_its_master(tmp_path):
    """Oracle: the rule of a rig, T_slave = T_master [R t], t in the chunk's unit, by hand."""
    made = Metashape()
    path = made.write_xml(tmp_path / "a.xml")
    slave = r'<camera id="12" sensor_id="1" component_id="0" (label="[^"]*")>.*?</camera>'
    label = re.search(slave, path.read_text())[1]
    changed(path, slave, f'<camera id="12" sensor_id="1" master_id="11" {label}/>')
    R, t = Rotation.from_euler("xyz", [3, -40, 7], degrees=True).as_matrix(), [0.1, -0.02, 0.05]
    place = f"<rotation>{numbers(R)}</rotation><location>{numbers(t)}</location></sensor>"
    path.write_text(place.join(path.read_text().rsplit("</sensor>", 1)))
    got = read_metashape_xml(path)
    C = TO_ECEF @ SCENE.eo.C_mc[1]
    assert_allclose(got.C[2], C @ R, atol=1e-9)
    centre = SCENE.plane.origin_ecef + TO_ECEF @ SCENE.eo.position_m[1]
    assert_allclose(got.position[2], centre + made.scale * C @ t, atol=1e-6)
    assert got.notes == ("1 disabled images left out",)


def test_covariances_stand_in_the_frame(tmp_path):
    """Oracle: R P R^T by hand: of a location with the scale of the chunk, of a rotation from the
    camera's axes; without those of one image there are none.
    """
    made = Metashape()
    path = made.write_xml(tmp_path / "a.xml")
    location, rotation = np.diag([1e-6, 4e-6, 9e-6]), np.diag([1e-8, 2e-8, 3e-8])
    both = f"<location_covariance>{numbers(location)}</location_covariance>"
    both += f"<rotation_covariance>{numbers(rotation)}</rotation_covariance></camera>"
    whole = path.read_text()
    path.write_text(whole.replace("</transform></camera>", f"</transform>{both}"))
    got = read_metashape_xml(path)
    assert_allclose(got.cov_position[1], made.scale**2 * made.R @ location @ made.R.T, rtol=1e-9)
    C = TO_ECEF @ SCENE.eo.C_mc[1]
    assert_allclose(got.cov_attitude[1], C @ rotation @ C.T, rtol=1e-6, atol=1e-16)
    path.write_text(whole.replace("</transform></camera>", f"</transform>{both}", 1))
    assert read_metashape_xml(path).cov_position is None
    short = both.replace(numbers(rotation), "1e-8 2e-8")
    path.write_text(whole.replace("</transform></camera>", f"</transform>{short}", 1))
    with pytest.raises(InputError, match=r"rotation covariance of image .*: 2 numbers, expected 9"):
        read_metashape_xml(path)


def test_references_have_their_own_crs_and_accuracies(tmp_path):
    """Oracle: what is written: longitude and latitude beside a chunk in UTM; an accuracy of the
    image before that of the settings, plan and height by themselves, before the common one.
    """
    path = Metashape().write_xml(tmp_path / "a.xml")
    reference = '<reference x="6.54" y="46.57" z="500"{}/></camera>'
    for accuracy in (' sxy="0.02"', ""):
        changed(path, "(?<=</transform>)</camera>", reference.format(accuracy))
    setting = '<property name="accuracy_cameras{}" value="{}"/>'
    settings = "".join(setting.format(*v) for v in (("", 9), ("_xy", 0.5), ("_z", 0.7)))
    changed(path, "<settings>", f"<settings>{settings}")
    assert "PROJCS" in read_metashape_references(path)[1]
    own = "".join(f"<{kind}_reference>{WORLD}</{kind}_reference>" for kind in ("camera", "marker"))
    changed(path, "<settings>", f"{own}<settings>")
    table, crs = read_metashape_references(path)
    assert crs == WORLD
    sigma = np.sqrt(np.diagonal(table.cov, axis1=1, axis2=2))
    assert_allclose(sigma, [[0.02, 0.02, 0.7], [0.5, 0.5, 0.7]])
    block = read_metashape_block(path)
    assert (block.crs, block.geocentric) == (WORLD, True)


def test_equal_labels_of_a_rig_go_by_their_sensors(tmp_path):
    """Oracle: the block without the change; names with the directory of a camera find theirs."""
    path = Metashape().write_xml(tmp_path / "a.xml")
    plain, block = read_metashape_xml(path), read_metashape_block(path)
    first, _, third = plain.images[:3]
    path.write_text(path.read_text().replace(f'label="{third}"', f'label="{first}"'))
    got = read_metashape_xml(path)
    sensors = [block.cameras[block.camera[k]].name for k in (0, 2)]
    names = [f"{sensor}/{first}" for sensor in sensors]
    assert [got.images[k] for k in (0, 2)] == names
    assert_allclose(got.position, plain.position)
    assert [read_metashape_block(path).measured.images[k] for k in (0, 2)] == names
    stem = first.partition(".")[0].lower()
    assert match_names([f"raw/{name}/{stem}.jpg" for name in sensors], got.images).tolist() == [
        0,
        2,
    ]
    assert match_names([f"{stem}.jpg"], got.images).tolist() == [-1]
