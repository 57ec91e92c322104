"""`insgnss adjust --plan`: what a block will determine, beside what it then did."""

import json

import numpy as np
import pytest

from insgnss.cli.main import main
from insgnss.photogrammetry.block_adjustment.plan import plan_block
from insgnss.report.charts.files import charts_of


def quiet(_: str) -> None:
    """No progress."""


@pytest.fixture(scope="module")
def plan(flown):
    return plan_block(flown.block, quiet)


@pytest.mark.slow
def test_precision_is_that_of_the_measured_block(plan, adjusted) -> None:
    """Oracle: the standard deviations of the block as it was measured, with as many tie points."""
    got, measured = plan.figures, adjusted.figures
    ratio = got["counts"]["image_observations"] / measured["counts"]["image_observations"]
    for name, own in measured["cameras"][0]["parameters"].items():
        if own["estimated"]:
            expected = own["sigma"] / np.sqrt(ratio)
            assert got["cameras"][0]["parameters"][name]["sigma"] == pytest.approx(
                expected, rel=0.4
            )
    boresight = measured["mounting"]["bore-sight"]["sigma"]
    assert got["mounting"]["bore-sight"]["sigma"] == pytest.approx(boresight, rel=0.3)


@pytest.mark.slow
def test_a_control_point_is_tried_where_points_are_worst(flown, tmp_path, capsys) -> None:
    """Oracle: the same block with a point of the survey there, by its own plan."""
    root = flown.directory
    words = ["adjust", str(root / "02_Processed/GPS-INS/eo.json"), "--plan", "-q", "--camera"]
    words += [str(root / "01_Observations/Camera/Block/camera.toml"), "--out", str(tmp_path)]
    assert main([*words, "--ground-height", "510"]) == 0
    text = capsys.readouterr().out
    document = json.loads((tmp_path / "plan.json").read_text())
    best = document["next_control_point"]
    before = best["largest_height_sigma_before_m"]
    assert best["largest_height_sigma_after_m"] < before
    assert "one more ground control point would" in text
    _, charts = charts_of(tmp_path / "plan.json")
    assert [chart.name for chart in charts] == ["precision"]
    ground = "point,x,y,z,sigma_x,sigma_y,sigma_z\nG1,{:.3f},{:.3f},{:.3f},0.01,0.01,0.015\n"
    (tmp_path / "ground.csv").write_text(ground.format(*best["position_m"]))
    out = ["--ground", str(tmp_path / "ground.csv"), "--out", str(tmp_path / "more")]
    assert main([*words[:-2], *out]) == 0
    capsys.readouterr()
    more = json.loads((tmp_path / "more/plan.json").read_text())
    # another worst point; what this one gains is there for all
    f = [d["cameras"][0]["parameters"]["f"]["sigma"] for d in (document, more)]
    assert f[1] < f[0]
    assert more["counts"]["ground_control"] == 1


def test_what_a_plan_cannot_go_without(flown, capsys) -> None:
    """Oracle: the words of the message."""
    eo = str(flown.directory / "02_Processed/GPS-INS/eo.json")
    assert main(["adjust", eo, "--plan"]) == 3
    assert "the camera is missing; give --camera" in capsys.readouterr().err
    camera = str(flown.directory / "01_Observations/Camera/Block/camera.toml")
    assert main(["adjust", eo, "--plan", "--camera", camera]) == 3
    assert "height of the ground is missing" in capsys.readouterr().err
    assert main(["adjust", eo, "--camera", camera]) == 2
    assert "image observations are missing; name their table" in capsys.readouterr().err
