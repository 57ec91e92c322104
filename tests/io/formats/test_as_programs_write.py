"""Poses and cameras as programs and people were seen to write them."""

import json
import re
from pathlib import Path

import numpy as np

from insgnss.cli.main import main
from insgnss.io.formats.returned.tables import read_pix4d_external

HEAD = "imageName X Y Z Omega Phi Kappa\n"


def test_names_in_quotation_marks_may_hold_blanks(tmp_path: Path) -> None:
    """Oracle: by hand."""
    path = tmp_path / "external.txt"
    rows = [f'"img {k}.jpg" {1.5 * k} {0.3 * k} 2.0 0.1 0.02 1.5\n' for k in range(3)]
    path.write_text(HEAD + "".join(rows))
    poses = read_pix4d_external(path)
    assert tuple(poses.images) == ("img 0.jpg", "img 1.jpg", "img 2.jpg")
    np.testing.assert_allclose(poses.position[:, 0], [0.0, 1.5, 3.0])


def test_a_focal_length_in_pixels_is_none_of_the_longer_side(tmp_path: Path, capsys) -> None:
    """Oracle: 622 px of 800 are 0.78; read as 622 sides it was 497 760 px."""
    path = tmp_path / "camera_models.json"
    path.write_text(json.dumps({"one": {"width": 800, "height": 600, "focal": 622.2}}))
    assert main(["camera", str(path)]) == 3
    assert re.search(r"focal 622\.2 is in pixels.*longer side, 800 px", capsys.readouterr().err)
