"""Blocks that the Damped Bundle Adjustment Toolbox has adjusted, against its printed reports. They
are not part of the project; where they are absent the tests say so and skip.
"""

import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from insgnss.cli.main import main
from insgnss.geodesy.rotation import CV_RUB, opk_from_rotation, opk_jacobian
from insgnss.io.formats.blocks.dbat import read_dbat
from insgnss.photogrammetry.adjust.adjustment import Adjusted, adjust_problem, residuals_px
from insgnss.photogrammetry.adjust.groups import control_points
from insgnss.photogrammetry.adjust.normals import problem_of
from insgnss.photogrammetry.adjust.precision import Precision, precision_of
from insgnss.photogrammetry.adjust.start import first_values
from insgnss.records.block import INTERIOR, ImageBlock

DATA = Path(__file__).parents[4] / "shared" / "data" / "dbat" / "script"
NAMES = ("Omega", "Phi", "Kappa", "Xc", "Yc", "Zc")


def block_of(name: str) -> ImageBlock:
    if not DATA.is_dir():
        pytest.skip(f"DBAT's demonstration {name} is not here")
    return read_dbat(DATA / name / f"{name}.xml")


@pytest.mark.slow
def test_a_camera_calibration_without_stated_values(tmp_path) -> None:
    """Oracle: the printed camera of DBAT's calibration, its sigmas in three digits, sigma0."""
    block = read_dbat(_calibration(tmp_path))
    result, precision = solved(block)
    unit = block.cameras[0].unit_px
    assert result.sigma0 == pytest.approx(1.6148, rel=2e-4)  # another aspect: 1.5e-4 less
    assert result.values.interior[0, :3] / unit == pytest.approx(
        [7.457, 3.61546, 2.61329], abs=1e-5
    )
    sigma = precision.sigma_interior(0)[:3] / unit
    assert sigma == pytest.approx([0.00105, 0.00082, 0.00098], abs=5e-6)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "unit", "sigma0", "redundancy", "printed_f"),
    [
        ("romabundledemo", 156.0, 0.582769, 101801, (24.5425, 0.00254)),
        ("sxb", 1.0, 1.1786, 1261, None),
        ("camcal", 1704 / 5.43764, 1.6148, None, (7.457, 0.00105)),
    ],
)
def test_a_script_is_adjusted_by_one_command(
    name, unit, sigma0, redundancy, printed_f, tmp_path, capsys
) -> None:
    """Oracle: sigma0, redundancy and camera constant of DBAT's printed reports: the datum is that
    of the script, held poses of one and held or weighed control points of the others."""
    script = DATA / name / f"{name}.xml"
    if name == "camcal":
        script = _calibration(tmp_path)
    if not script.is_file():
        pytest.skip(f"DBAT's demonstration {name} is not here")
    command = ["adjust", str(script), "--keep-all", "--reweight", "none", "--out", str(tmp_path)]
    assert main(command) in (0, 4)  # control of two blocks contradicts its standard deviations
    capsys.readouterr()
    figures = json.loads((tmp_path / "adjust.json").read_text())
    assert figures["sigma0"] == pytest.approx(sigma0, rel=2e-4)
    assert redundancy in (None, figures["redundancy"])
    if printed_f is not None:
        f = figures["cameras"][0]["parameters"]["f"]
        assert f["value"] / unit == pytest.approx(printed_f[0], abs=5e-5)
        assert sigma0 * f["sigma"] / unit == pytest.approx(printed_f[1], abs=5e-6)


def _calibration(directory: Path) -> Path:
    """Write the script of DBAT's camera calibration beside its measurements."""
    folder = DATA.parent / "camcal_images"
    if not folder.is_dir():
        pytest.skip("DBAT's camera calibration is not here")
    for name in ("images.txt", "markpts.txt"):
        (directory / name).write_bytes((folder / name).read_bytes())
    corners = "1001,0,1,0\n1002,1,1,0\n1003,0,0,0\n1004,1,0,0\n"
    (directory / "control.txt").write_text(corners)
    (directory / "block.xml").write_text(CALIBRATION)
    return directory / "block.xml"


CALIBRATION = """<document dbat_script_version="1.0"><input base_dir="$HERE">
<ctrl_pts><file format="id,x,y,z">control.txt</file></ctrl_pts>
<images><file format="id,path">images.txt</file></images>
<image_pts><file format="im,id,x,y,sxy">markpts.txt</file></image_pts>
<cameras><camera><name>C4040Z</name><unit>mm</unit><sensor>auto,5.43764</sensor>
<image>2272,1704</image><aspect>1</aspect><focal>7.5</focal><model>3</model><nK>3</nK><nP>2</nP>
</camera></cameras></input><operations><operation><set_bundle_estimate_params><io>
<all>true</all><skew>false</skew></io></set_bundle_estimate_params></operation></operations>
</document>"""


def solved(block: ImageBlock) -> tuple[Adjusted, Precision]:
    problem = problem_of(block, control_points(block.control))
    result = adjust_problem(problem, first_values(block))
    return result, precision_of(result)


def printed(text: str, name: str) -> tuple[float, float, float]:
    """Value of a parameter, half a unit of its last digit, and standard deviation (NaN if held)."""
    found = re.search(
        rf"{name}:\s+Value: +(\S+)[^\n]*(?:\n\s+Deviation: +(\S+))?", text, re.MULTILINE
    )
    assert found is not None, name
    digits, _, exponent = found[1].partition("e")
    half = 0.5 * 10.0 ** (int(exponent or 0) - len(digits.partition(".")[2]))
    return float(found[1]), half, float(found[2]) if found[2] else np.nan


def compare(found: float, sigma: float, text: str, name: str) -> None:
    """Value within 0.02 of its sigma, sigma within 1 %, besides what rounding in print leaves."""
    value, half, deviation = printed(text, name)
    if np.isnan(deviation):
        assert sigma == 0.0, name
        assert found == pytest.approx(value, abs=half), name
        return
    assert abs(found - value) <= 0.02 * deviation + half, name
    three_digits = 0.5 * 10.0 ** (np.floor(np.log10(deviation)) - 2)
    assert abs(sigma - deviation) <= 0.01 * deviation + three_digits, name


def compare_poses(result: Adjusted, precision: Precision, text: str) -> None:
    opk = opk_from_rotation(result.values.C_mc @ CV_RUB)
    F = np.linalg.inv(opk_jacobian(opk))
    cov = precision.pose_cov
    sigma = np.sqrt(np.einsum("nij,njk,nik->ni", F, cov[:, 3:, 3:], F))
    photographs = re.split(r"\n +Photo (?=\d+: )", text)[1:]
    assert len(photographs) == len(opk)
    for i, photograph in enumerate(photographs):
        values = [*np.degrees(opk[i]), *result.values.position[i]]
        sigmas = [*np.degrees(sigma[i]), *np.sqrt(np.diagonal(cov[i])[:3])]
        for found, s, name in zip(values, sigmas, NAMES, strict=True):
            compare(found, s, photograph, name)


def compare_camera(result: Adjusted, precision: Precision, text: str) -> None:
    """Pixels become millimetres, y of P2 turns up."""
    camera = result.problem.block.cameras[0].with_(result.values.interior[0])
    mm = 1.0 / camera.unit_px
    factors = {"f": mm, "cx": mm, "cy": mm, "p2": -1.0}
    sigma = precision.sigma_interior(0)
    labels = {"f": "Camera Constant", "cx": "principal point x", "cy": "principal point y"}
    labels |= {k: f"{k.upper()} - radial distortion {k[1]}" for k in ("k1", "k2", "k3")}
    labels |= {p: f"{p.upper()} - decentering distortion {p[1]}" for p in ("p1", "p2")}
    labels["b1"] = "off-unit aspect parameter"
    for name, label in labels.items():
        factor = factors.get(name, 1.0)
        found, s = factor * camera.of(name), abs(factor) * sigma[INTERIOR.index(name)]
        compare(found, float(s), text, label)


@pytest.mark.slow
def test_roma_with_five_parameters() -> None:
    """Oracle: DBAT's report of 60 images and 90 561 image points: sigma_0 to 2e-6, every printed
    parameter to 0.02 of its sigma, every standard deviation to 1 %.
    """
    block = block_of("romabundledemo")
    text = (DATA / "romabundledemo" / "result" / "report.txt").read_text()
    result, precision = solved(block)
    assert len(block.observations) == 90561
    assert result.redundancy == 101801
    assert result.sigma0 == pytest.approx(0.582769, abs=2e-6)
    assert result.values.interior[0, 0] / block.cameras[0].unit_px == pytest.approx(
        24.5425002994450807, abs=1e-8
    )
    compare_camera(result, precision, text)
    compare_poses(result, precision, text)
    rms = np.sqrt((residuals_px(result) ** 2).sum(axis=1).mean())
    assert rms == pytest.approx(0.618, abs=5e-4)
    assert np.nansum(precision.redundancy) == pytest.approx(101801, abs=1e-3)


@pytest.mark.slow
def test_roma_with_nine_parameters() -> None:
    """Oracle: DBAT's report of the same image points, whose fixed image has more digits."""
    block = block_of("romabundledemo")
    text = (DATA / "romabundledemo" / "selfcal-report.txt").read_text()
    camera = replace(block.cameras[0], free=tuple(n for n in INTERIOR if n not in ("b2", "k4")))
    result, precision = solved(replace(block, cameras=(camera,)))
    assert result.redundancy == 101797
    assert result.sigma0 == pytest.approx(0.566548, abs=1e-6)
    compare_camera(result, precision, text)


def test_aerial_block_with_control_and_check_points() -> None:
    """Oracle: DBAT's report of five aerial images without first orientation: sigma_0, poses,
    adjusted control and check points with their standard deviations.
    """
    block = block_of("sxb")
    text = (DATA / "sxb" / "result" / "report.txt").read_text()
    result, precision = solved(block)
    assert result.redundancy == 1261
    assert result.sigma0 == pytest.approx(1.1786, abs=2e-6)
    compare_poses(result, precision, text)
    found = 0
    for part in re.findall(r"Posterior\n(.*?)\n +Diff", text, re.DOTALL):
        for line in part.splitlines()[1:]:
            number, *values = (word.strip() for word in line.split(",")[:7])
            p = block.points.index(number)
            assert result.values.point[p] == pytest.approx(
                np.array(values[:3], dtype=float), abs=5.01e-4
            )
            sigma = np.sqrt(np.diagonal(precision.point_cov[p]))
            for got, want in zip(sigma, values[3:], strict=True):
                half = 0.5 * 10.0 ** -len(want.partition(".")[2])
                assert abs(got - float(want)) <= 0.01 * float(want) + half
            found += 1
    assert found == 16
    assert [c.name for c in precision.components()] == ["image observations", "ground control"]
