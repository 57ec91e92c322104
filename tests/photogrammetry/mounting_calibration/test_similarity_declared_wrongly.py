"""Poses of `calibrate similarity` that are declared wrongly are refused or asked about."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from test_similarity_files import GROUND, NADIR, Flown, run

Angles = Callable[[Rotation], np.ndarray]


def opk(order: str, *places: int, by: object = 1.0) -> Angles:
    """Angles of rotations in an order, deg, in some places of the table and multiplied."""
    return lambda turn: turn.as_euler(order, degrees=True)[:, list(places)] * by


RAYS = r"rays of 1\d images miss ground point G1 by|meet behind a camera"
WRONG_ANGLES: dict[str, Angles] = {
    "phi omega kappa": opk("YXZ", 1, 0, 2),
    "kappa phi omega": opk("ZYX", 2, 1, 0),
    "omega of the other sign": opk("XYZ", 0, 1, 2, by=[-1.0, 1.0, 1.0]),
    "phi of the other sign": opk("XYZ", 0, 1, 2, by=[1.0, -1.0, 1.0]),
    "kappa of the other sign": opk("XYZ", 0, 1, 2, by=[1.0, 1.0, -1.0]),
    "omega and phi exchanged": opk("XYZ", 1, 0, 2),
    "gon": opk("XYZ", 0, 1, 2, by=400.0 / 360.0),
    "radians": opk("XYZ", 0, 1, 2, by=np.pi / 180.0),
    "a quarter of a turn": lambda turn: turn.as_euler("XYZ", degrees=True) + [0.0, 0.0, 90.0],
    "the reverse rotation": lambda turn: turn.inv().as_euler("XYZ", degrees=True),
}
WRONG_AXES = {"x and y exchanged": [1, 0, 2], "y and z exchanged": [0, 2, 1]}
WRONG_NAMES = {  # name of image k, what is said
    "doubled": (lambda k: f"I{k // 2 * 2}.jpg", r"'I0\.jpg' is there twice"),
    "of the next image": (lambda k: f"I{k + 1}.jpg", RAYS),
    "of another flight": (lambda k: f"P{k + 100}.jpg", r"0 of its 60 names.*named alike"),
}


def written(root: Path, centres: np.ndarray, angles: np.ndarray, name=lambda k: f"I{k}.jpg"):
    """cameras.csv of other centres, angles and names."""
    rows = [
        ",".join([name(k), *(f"{v:.8f}" for v in (*centres[k], *angles[k]))])
        for k in range(len(centres))
    ]
    (root / "cameras.csv").write_text("image,x,y,z,omega,phi,kappa\n" + "\n".join(rows) + "\n")


@pytest.fixture
def flown(tmp_path):
    flown = Flown()
    flown.write(tmp_path)
    return flown, Rotation.from_matrix(flown.C @ NADIR)


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG_ANGLES)
def test_other_angles_miss_the_ground_points(name, flown, tmp_path, capsys) -> None:
    """Oracle: the angles of the simulated poses, changed; nothing is written as determined."""
    written(tmp_path, flown[0].centres, WRONG_ANGLES[name](flown[1]))
    assert run(tmp_path, *GROUND) == 3
    assert re.search(RAYS, capsys.readouterr().err)
    assert not (tmp_path / "mounting.toml").exists()


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG_AXES)
def test_exchanged_axes_miss_the_ground_points(name, flown, tmp_path, capsys) -> None:
    """Oracle: the centres of the simulated poses with two axes exchanged."""
    angles = flown[1].as_euler("XYZ", degrees=True)
    written(tmp_path, flown[0].centres[:, WRONG_AXES[name]], angles)
    assert run(tmp_path, *GROUND) == 3
    assert not (tmp_path / "mounting.toml").exists()
    assert "ground point G1" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.parametrize("name", WRONG_NAMES)
def test_wrong_names_are_said(name, flown, tmp_path, capsys) -> None:
    """Oracle: the name of each image, changed."""
    image, words = WRONG_NAMES[name]
    angles = flown[1].as_euler("XYZ", degrees=True)
    written(tmp_path, flown[0].centres, angles, image)
    assert run(tmp_path, *GROUND) == 3
    assert re.search(words, capsys.readouterr().err)


def test_a_document_of_sensors_alone_has_no_poses(tmp_path, capsys) -> None:
    """Oracle: a calibration as Metashape exports it without cameras."""
    Flown().write(tmp_path)
    text = '<document version="2.0.0"><chunk label="c" enabled="true"><sensors>'
    text += '<sensor id="0" label="P1" type="frame"><resolution width="5120" height="3840"/>'
    (tmp_path / "s.xml").write_text(f"{text}</sensor></sensors></chunk></document>")
    assert run(tmp_path, cameras="s.xml") == 3
    assert "no chunk has images ('c'), so no poses" in capsys.readouterr().err
