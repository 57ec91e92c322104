"""The file of relative control: what is written comes back, and what is no such file is refused."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.io.formats.orientation.relative_csv import (
    OUT,
    read_relative_csv,
    relative_member,
    write_relative_csv,
)
from insgnss.records.relative import RelativeControl

PAGE = Path(__file__).parents[3] / "data_specs" / "relative_csv.md"


def control(form: str = "mapping", k: int = 4) -> RelativeControl:
    rng = np.random.default_rng(4)
    A = rng.standard_normal((3, k, 6, 7)) * [[1e-2]] * 3 + 0.0
    P = A @ A.swapaxes(-1, -2) * 1e-2
    angle = rng.uniform(-1.0, 1.0, k)
    C = np.zeros((k, 3, 3))
    C[:, 2, 2] = 1.0
    C[:, 0, 0] = C[:, 1, 1] = np.cos(angle)
    C[:, 1, 0], C[:, 0, 1] = np.sin(angle), -np.sin(angle)
    images = tuple(f"a {n}.tif" for n in range(k + 1))
    i = np.arange(k)
    rest = (1e-4, 2e-5, "tangent plane", np.eye(3), ("smoothed",))
    offset, time = 20.0 * rng.standard_normal((k, 3)), 1.5 * np.arange(k + 1)
    return RelativeControl(form, images, time, 2008, i, i + 1, i // 2 + 1, offset, C, *P, *rest)  # type: ignore[arg-type]


@pytest.mark.parametrize("form", ["mapping", "camera"])
def test_round_trip(form: str, tmp_path: Path) -> None:
    """Oracle: what was written, to the printed digits."""
    c = control(form)
    write_relative_csv(c, tmp_path / "relative.csv")
    got = read_relative_csv(tmp_path / "relative.csv")
    assert got.form == form
    assert list(got.names) == c.names
    assert got.line.tolist() == [1, 1, 2, 2]
    assert_allclose(got.dt, 1.5)
    assert_allclose(got.offset, c.offset, atol=5.1e-6)
    assert_allclose(got.rotation, c.rotation, rtol=0, atol=3e-12)
    assert_allclose(got.smoothed, c.smoothed, rtol=1e-9)
    for name in ("smoothed", "independent", "gyro"):
        sigma = np.sqrt(np.diagonal(getattr(c, name), axis1=1, axis2=2))
        assert_allclose(got.sigma[name], sigma, atol=5.1e-7)


def test_weightings_stand_in_their_columns(tmp_path: Path) -> None:
    """Oracle: split by hand."""
    c = control()
    write_relative_csv(c, tmp_path / "relative.csv")
    lines = [
        line
        for line in (tmp_path / "relative.csv").read_text().splitlines()
        if not line.startswith("#")
    ]
    assert lines[0] == ",".join(OUT.names.split())
    row = dict(zip(lines[0].split(","), lines[1].split(","), strict=True))
    assert float(row["sd_y_independent"]) == pytest.approx(
        np.sqrt(c.independent[0, 1, 1]), abs=1e-6
    )
    assert float(row["sd_rz_gyro"]) == pytest.approx(np.degrees(np.sqrt(c.gyro[0, 5, 5])), abs=1e-7)
    assert float(row["cov_z_rx"]) == pytest.approx(c.smoothed[0, 2, 3], rel=1e-9)


def test_header_names_form_frame_and_figures(tmp_path: Path) -> None:
    """Oracle: the page of the format."""
    write_relative_csv(control("camera"), tmp_path / "relative.csv")
    text = (tmp_path / "relative.csv").read_text()
    assert "# form camera: offset C(i)^T (X_j - X_i)" in text
    assert "# frame: tangent plane" in text
    assert "white noise 0.00572958 deg/sqrt(s) and drift 0.00114592 deg/s" in text
    assert "# done: smoothed" in text


def test_member_of_the_master(tmp_path: Path) -> None:
    """Oracle: JSON there and back: bit by bit."""
    c = control("camera")
    member = json.loads(json.dumps(relative_member(c), allow_nan=False))
    assert member["form"] == "camera"
    assert [(pair["i"], pair["j"]) for pair in member["pairs"]] == c.names
    assert np.array([pair["cov6"] for pair in member["pairs"]]).tolist() == c.smoothed.tolist()
    assert np.array([pair["offset_m"] for pair in member["pairs"]]).tolist() == c.offset.tolist()
    gyro = np.sqrt(np.diagonal(c.gyro, axis1=1, axis2=2))
    assert np.array([pair["sigma6_gyro"] for pair in member["pairs"]]).tolist() == gyro.tolist()
    assert member["gyro"] == {"white_noise_rad_per_sqrt_s": 1e-4, "drift_rad_per_s": 2e-5}


def test_refusals(tmp_path: Path) -> None:
    """Oracle: file, line and value in the message."""
    path = tmp_path / "relative.csv"
    write_relative_csv(control(), path)
    whole = path.read_text()
    path.write_text(re.sub(r",mapping,2,", ",camera,2,", whole))
    with pytest.raises(
        InputError,
        match=r"relative.csv:1[0-9]: form 'camera'; it is mapping or camera, the same in all rows",
    ):
        read_relative_csv(path)
    fields = whole.splitlines()[-1].split(",")
    fields[OUT.names.split().index("qw")] = "1.5"
    path.write_text("\n".join([*whole.splitlines()[:-1], ",".join(fields)]) + "\n")
    with pytest.raises(InputError, match="the quaternion has the length"):
        read_relative_csv(path)


def test_image_names_that_the_file_cannot_hold_are_refused(tmp_path: Path) -> None:
    """Oracle: a line end would make two lines of the name."""
    c = control()
    object.__setattr__(c, "images", ("a\nb", *c.images[1:]))
    with pytest.raises(InputError, match=r"image name .* has a line end"):
        write_relative_csv(c, tmp_path / "relative.csv")
    assert not (tmp_path / "relative.csv").exists()


def test_page(tmp_path: Path) -> None:
    """Oracle: the page of the format."""
    true, bad, message = (
        re.search(rf"```{kind}\n(.*?)```", PAGE.read_text(), re.DOTALL)[1]
        for kind in ("true", "bad", "message")
    )  # type: ignore[index]
    path = tmp_path / "relative.csv"
    path.write_text(true)
    assert read_relative_csv(path).names == (("0.tif", "1.tif"),)
    path.write_text(true + bad)
    with pytest.raises(InputError) as refusal:
        read_relative_csv(path)
    assert message.strip() in str(refusal.value)
