"""`insgnss adjust` on a simulated flight: against the truth, and through its products."""

import csv
import json
import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import chi2

from insgnss import read_eo
from insgnss.cli.main import main
from insgnss.flight.config.load import load_flight
from insgnss.flight.processing.pipeline import process
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.io.formats.blocks.camera_toml import read_camera_toml
from insgnss.photogrammetry.adjust.aerial import COMMON_OF_TRAJECTORY
from insgnss.photogrammetry.block_adjustment.products import write_points, write_residuals
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.records.block import INTERIOR
from insgnss.report.charts.files import charts_of

BLOCK = "01_Observations/Camera/Block"
EO = "02_Processed/GPS-INS/eo.json"


def edited(path, old, new) -> None:
    """Change a text that must be there."""
    text = path.read_text()
    assert old in text, f"{old!r} is not in {path.name}"
    path.write_text(text.replace(old, new))


def truth(flown):
    """Poses of the truth, by image."""
    with np.load(flown.directory / "truth/eo.npz") as file:
        names = [str(x) for x in file["images"]]
        return dict(zip(names, zip(file["position_enu"], file["C_mc"], strict=True), strict=True))


def errors(eo, true):
    X = np.array([true[name][0] for name in eo.images]) - eo.position_m
    C = np.array([true[name][1] for name in eo.images])
    return np.hstack([X, vector_from_rotation(C @ eo.C_mc.swapaxes(1, 2))])


def test_poses_and_camera_are_the_truth_within_their_covariance(flown, adjusted) -> None:
    """Oracle: the truth, by chi-square, 99.9 %; the joint covariance of neighbours too."""
    eo = read_eo(flown.directory / "02_Processed/Adjustment/eo.json")
    e = errors(eo, truth(flown))
    single = np.array([x @ np.linalg.solve(P, x) for x, P in zip(e, eo.cov, strict=True)])
    assert single.mean() / 6.0 == pytest.approx(1.0, abs=0.5)  # neighbours share their error
    joint = np.block([[eo.cov[3], eo.cross[3]], [eo.cross[3].T, eo.cov[4]]])
    both = np.concatenate([e[3], e[4]])
    assert both @ np.linalg.solve(joint, both) < chi2.ppf(0.999, 12)
    camera = read_camera_toml(flown.directory / "truth/camera.toml")
    free = adjusted.solved.result.problem.layout.columns
    off = (camera.interior - adjusted.solved.result.values.interior[0])[free]
    P = adjusted.solved.precision.cov(("camera", 0))
    low, high = chi2.ppf((5e-4, 1 - 5e-4), free.size)
    assert low < off @ np.linalg.solve(P, off) < high
    assert adjusted.figures["verdict"] == "consistent"
    assert max(trial.gain for trial in adjusted.judgement.trials_made) < 20.0  # by chance
    assert INTERIOR[free[0]] == "f"


def test_tables_of_points_and_residuals(adjusted, tmp_path) -> None:
    """Oracle: root mean squares, rejections and rays by image of the document, recomputed from the
    table; covariances of the points as the adjustment has them."""
    solved = adjusted.solved
    write_residuals(solved, tmp_path / "residuals.csv")
    write_points(solved, tmp_path / "points.csv")
    rows = list(csv.DictReader((tmp_path / "residuals.csv").read_text().splitlines()[1:]))
    assert len(rows) == len(solved.result.problem.block.observations)
    for image in (adjusted.figures["images"][k] for k in (0, 17)):
        mine = [row for row in rows if row["image"] == image["image"]]
        part = [row for row in mine if row["redundancy_x"] != "nan"]
        square = sum(float(row[f"residual_{axis}"]) ** 2 for row in part for axis in "xy")
        assert len(part) == image["observations"]
        assert np.sqrt(square / (2 * len(part))) == pytest.approx(image["rms_px"], abs=1e-4)
        assert sum(row["rejected"] == "yes" for row in mine) == image["rejected"]
    points = list(csv.DictReader((tmp_path / "points.csv").read_text().splitlines()[1:]))
    names = list(solved.result.problem.block.points)
    k = names.index(points[5]["point"])
    P = solved.precision.point_cov[k]
    assert float(points[5]["cov_yz"]) == pytest.approx(P[1, 2], rel=1e-5)
    assert float(points[5]["sd_z"]) == pytest.approx(np.sqrt(P[2, 2]), abs=1e-6)
    assert {row["role"] for row in points} == {"tie", "control", "check"}


def test_products(flown, adjusted, tmp_path, capsys) -> None:
    """Oracle: they read back; the document has what the result says."""
    out = flown.directory / "02_Processed/Adjustment"
    names = {path.name for path in adjusted.files}
    assert names == {
        *("EO_local-plane.txt", "adjust.html", "adjust.json", "camera.toml", "eo.json"),
        *("camera_metashape.xml", "mounting.toml", "poses.csv"),
    }
    document = json.loads((out / "adjust.json").read_text())
    assert document["headline"] == adjusted.judgement.headline
    assert set(document["products"]) == names
    page = (Path(__file__).parents[3] / "data_specs/adjust_json.md").read_text()
    assert [key for key in document if f"`{key}" not in page] == []
    f = document["cameras"][0]["parameters"]["f"]
    assert read_camera_toml(out / "camera.toml").of("f") == f["value"]
    page = re.sub("<[^>]+>", "", (out / "adjust.html").read_text())  # terms are links
    assert adjusted.judgement.headline in page
    _, charts = charts_of(out / "adjust.json")  # which says that the page is of the same run
    assert [chart.name for chart in charts] == ["map", "precision", "format-ignCal2", "by-image"]
    assert charts[-1].panels[0].layers[0].y == pytest.approx(
        [image["rms_px"] for image in document["images"]], rel=1e-6
    )
    words = ["export", str(out / "eo.json"), "metashape", "--out", str(tmp_path / "m.csv")]
    assert main(words) == 0
    rows = (out / "poses.csv").read_text().splitlines()[2:]
    assert len(rows) == document["counts"]["images"]
    name, *values = rows[0].split(",")
    eo = read_eo(out / "eo.json")
    assert np.array(values[:3], dtype=float) == pytest.approx(eo[name].position_m[0], abs=1e-4)
    capsys.readouterr()


@pytest.mark.slow
def test_the_command_line_asks_for_the_same(flown, adjusted, tmp_path, capsys) -> None:
    """Oracle: the result of the block file."""
    root = flown.directory
    words = ["adjust", str(root / EO), "--images", str(root / BLOCK / "image_points.csv")]
    words += ["--camera", str(root / BLOCK / "camera.toml")]
    words += ["--ground", str(root / BLOCK / "ground_points.csv"), "--out", str(tmp_path / "a")]
    assert main(words) == 0
    text = capsys.readouterr().out
    assert adjusted.judgement.headline in text
    assert "adjusting" in text  # progress
    ours, theirs = (
        json.loads((d / "adjust.json").read_text())
        for d in (tmp_path / "a", root / "02_Processed/Adjustment")
    )
    for document in (ours, theirs):
        of_making = ("inputs_sha256", "products_sha256", "inputs_directory", "run")
        for key in ("name", "block_file", "products", *of_making):
            document.pop(key)
    assert ours == theirs
    assert main([*words, "--json", "-q"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "consistent"


@pytest.mark.slow
def test_what_all_lines_share_does_not_make_the_boresight_better(flown, adjusted, tmp_path) -> None:
    """Oracle: the covariance of all images at once as one strip, which a flight of 5 min has; with
    the common errors left out the bore-sight seems known by a quarter better than it is.
    """
    from insgnss.flight.processing.orientation import strips
    from insgnss.io.formats.orientation import eo_covariance as file

    def sigma(result):
        return np.array(result.figures["mounting"]["bore-sight"]["sigma"])

    own = flown.copied(tmp_path / "flight")
    path = own.directory / "02_Processed/GPS-INS" / file.FILE
    with np.load(path) as archive:
        content = {name: archive[name] for name in archive.files}
    assert content["common"].shape[2] < 30
    assert sum(name == COMMON_OF_TRAJECTORY for name, _ in adjusted.solved.control.blocks) == 1
    kinds = {c["name"]: c for c in adjusted.figures["components"]}
    assert kinds[COMMON_OF_TRAJECTORY]["observations"] == content["common"].shape[2]
    assert not [
        d
        for d in adjusted.figures["correlations"]
        if COMMON_OF_TRAJECTORY in d["first"] + d["second"]
    ]
    content = {name: value for name, value in content.items() if name != "common"}
    np.savez(path, **content)
    independent = sigma(adjust(own.block, write=False))
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(strips, "strip_rows", lambda eo, _: (np.arange(len(eo)),))
        process(load_flight(own.directory))
    exact = sigma(adjust(own.block, write=False))
    assert sigma(adjusted)[:2] == pytest.approx(exact[:2], rel=0.05)
    assert (independent[:2] < 0.85 * exact[:2]).all()


def turned(eo, boresight, delay):
    """An orientation of another bore-sight and of exposures that lag."""
    C = eo.C_mc @ rotation_from_vector(np.radians(boresight)).T
    C = rotation_from_vector(-delay * eo.rate_radps) @ C
    return replace(eo, position_m=eo.position_m - delay * eo.velocity_mps, C_mc=C)


@pytest.mark.slow
def test_control_of_plan_or_height_alone(flown, adjusted, tmp_path) -> None:
    """Oracle: the same points with their true coordinates at sigmas of 10 km: poses within 1e-6
    sigma; what is not known has no residual, and is no observation.
    """
    lines = flown.block.ground.file.read_text().splitlines()
    results = []
    for name, sigma in (("empty", ""), ("wide", "10000")):
        rows, k = [], 0
        for row in (line.split(",") for line in lines[2:]):
            if row[-1] == "control" and (k := k + 1) % 3:
                columns = (1, 2, 4, 5) if k % 3 == 1 else (3, 6)
                for column in columns if not sigma else columns[len(columns) // 2 :]:
                    row[column] = sigma
            rows.append(",".join(row))
        path = tmp_path / f"{name}.csv"
        path.write_text("\n".join([*lines[:2], *rows]) + "\n")
        ground = replace(flown.block.ground, file=path)
        results.append(adjust(replace(flown.block, ground=ground), write=False))
    empty, wide = (done.solved.result for done in results)
    sigma = np.sqrt(np.diagonal(results[0].solved.precision.pose_cov, axis1=1, axis2=2))[:, :3]
    assert np.abs((empty.values.position - wide.values.position) / sigma).max() < 1e-6
    control = results[0].figures["ground_control"]
    assert control[0]["residual_m"][:2] == [None, None]
    assert control[1]["residual_m"][2] is None
    unknown = sum(x is None for point in control for x in point["residual_m"])
    before = adjusted.solved.result
    rays = [int(result.problem.rays.active.sum()) for result in (empty, before)]
    points = [int(result.problem.determined.sum()) for result in (empty, before)]
    expected = 2 * (rays[0] - rays[1]) - 3 * (points[0] - points[1]) - unknown
    assert empty.redundancy - before.redundancy == expected


@pytest.mark.slow
def test_a_wrong_delay_is_named_and_estimated(flown, tmp_path) -> None:
    """Oracle: what was done to the orientation: 6 ms and half a degree."""
    from insgnss.io.formats.orientation.eo_json import write_eo_json

    own = flown.copied(tmp_path / "flight")
    eo = turned(read_eo(own.directory / EO), [0.5, -0.3, 0.2], 0.006)
    write_eo_json(eo, own.directory / EO)
    block = own.block
    result = adjust(block, write=False)
    assert result.judgement.contradicted
    assert "aerial control contradicts the rest" in result.judgement.headline
    assert "delay of the exposures of +" in result.judgement.headline
    options = replace(block.aerial_control, time_offset_sigma_s=0.1)
    result = adjust(replace(block, aerial_control=options))
    assert result.figures["verdict"] == "consistent"
    delay = result.figures["mounting"]["time offset"]
    assert abs(delay["value"][0] - 0.006) < 4.0 * delay["sigma"][0] < 0.002
    found = result.figures["mounting"]["bore-sight"]
    off = np.array(found["value"]) - np.radians([0.5, -0.3, 0.2])
    assert (np.abs(off) < 4.0 * np.array(found["sigma"]) + 1e-5).all()


@pytest.mark.slow
def test_the_mounting_is_what_process_takes(flown, tmp_path) -> None:
    """Oracle: the bore-sight of the simulation, which a wrong one in the flight file hides."""
    own = flown.copied(tmp_path / "flight")
    (tmp_path / "wrong.toml").write_text("[mounting]\nboresight_deg = { opk = [0.9, 0.1, -1.0] }\n")
    words = ["process", str(own.directory / "flight.toml"), "-q", "--mounting"]
    assert main([*words, str(tmp_path / "wrong.toml")]) == 0
    assert main(["adjust", str(own.directory / "block.toml"), "-q"]) == 0
    found = own.directory / "02_Processed/Adjustment/mounting.toml"
    assert main([*words, str(found), "--out", str(tmp_path / "again")]) == 0
    again, before = read_eo(tmp_path / "again/eo.json"), read_eo(flown.directory / EO)
    psi = np.degrees(vector_from_rotation(again.boresight @ before.boresight.T))
    assert np.abs(psi).max() < 0.1  # 1.4 deg in the wrong one; of the heading 0.03 deg is one sigma
    turn = np.degrees(vector_from_rotation(again.C_mc @ before.C_mc.swapaxes(1, 2)))
    assert np.abs(turn).max() < 0.1


@pytest.mark.slow
def test_a_calibration_is_an_observation(flown, adjusted, tmp_path) -> None:
    """Oracle: of two independent normal values the precision matrices add up; the block's own is
    that without the calibration.
    """
    own = flown.copied(tmp_path / "flight")
    path = own.directory / BLOCK / "camera.toml"
    sigma = {"f": 0.5, "cx": 0.3, "k1": 1e-3}
    lines = [f"{name} = {value}" for name, value in sigma.items()]
    path.write_text(path.read_text() + "\n".join(["[sigma]", *lines]) + "\n")
    block = own.block
    weighed = replace(block.camera, weighed=True)
    result = adjust(replace(block, camera=weighed), write=False)
    free = [INTERIOR[k] for k in result.solved.result.problem.layout.columns]
    rows = [free.index(name) for name in sigma]
    before, after = (
        np.linalg.inv(r.solved.precision.cov(("camera", 0))) for r in (adjusted, result)
    )
    gain = (after - before)[np.ix_(rows, rows)]
    expected = np.diag([value**-2 for value in sigma.values()])
    scale = np.sqrt(np.diagonal(after)[rows])
    assert gain / scale / scale[:, None] == pytest.approx(
        expected / scale / scale[:, None], abs=0.03
    )
    assert any(c["name"] == "interior orientation" for c in result.figures["components"])


@pytest.mark.slow
def test_options_change_a_block_file(flown, adjusted, tmp_path, capsys) -> None:
    """Oracle: the counts and the parameters that they ask for."""
    names = [p["point"] for p in adjusted.figures["ground_control"]]
    words = ["adjust", str(flown.directory), "-q", "--json", "--out", str(tmp_path / "a")]
    assert main([*words, "--check", *names[:3], "--free", "f", "cx", "cy"]) == 0
    document = json.loads(capsys.readouterr().out)
    before = adjusted.figures["counts"]
    assert document["counts"]["ground_control"] == before["ground_control"] - 3
    assert document["counts"]["check_points"] == before["check_points"] + 3
    own = document["cameras"][0]["parameters"]
    assert [k for k in own if own[k]["estimated"]] == ["f", "cx", "cy"]
    assert main([*words, "--camera", "nowhere.toml"]) == 2
    assert "--camera nowhere.toml does not exist" in capsys.readouterr().err


def test_the_camera_goes_into_an_export(flown, adjusted, tmp_path, capsys) -> None:
    """Oracle: the adjusted camera constant, in COLMAP's own file."""
    out = flown.directory / "02_Processed/Adjustment"
    camera = f"camera={out / 'camera.toml'}"
    words = ["export", str(out / "eo.json"), "colmap", "--out", str(tmp_path / "model")]
    assert main([*words, "--set", camera]) in (0, 3)
    error = capsys.readouterr().err
    f = adjusted.figures["cameras"][0]["parameters"]["f"]["value"]
    if error:  # b2 is more than COLMAP can leave out
        assert "cannot hold b2" in error
    else:
        line = (tmp_path / "model/cameras.txt").read_text().splitlines()[-1]
        assert abs(float(line.split()[5]) - f) < 1e-5  # six decimals


@pytest.mark.slow
def test_columns_of_tables(flown, adjusted, tmp_path) -> None:
    """Oracle: the block with the usual names."""
    own = flown.copied(tmp_path / "flight")
    table = own.directory / BLOCK / "image_points.csv"
    edited(table, "image,point,x,y,sigma", "photo_file,nr,px_x,px_y,s")
    words = '{ image = "photo_file", point = "nr", x = "px_x", y = "px_y", sigma = "s" }'
    edited(own.directory / "block.toml", "[camera]", f"columns = {words}\n[camera]")
    result = adjust(own.block, write=False)
    assert result.figures["counts"] == adjusted.figures["counts"]


@pytest.mark.slow
def test_weights_without_the_covariance_of_lines_are_noted(flown, tmp_path) -> None:
    """Oracle: the file beside eo.json, which is taken away; scripts/adjust_simulated.py has by how
    much the standard deviations are too small.
    """
    own = flown.copied(tmp_path / "flight")
    words = "standard deviations of bore-sight and camera are too small"
    assert not any(words in note for note in adjust(own.block, write=False).figures["notes"])
    (own.directory / "02_Processed/GPS-INS/eo_covariance.npz").unlink()
    result = adjust(own.block, write=False)
    assert result.figures["covariance_of_aerial_control"] == "chain"
    assert any(words in line for line in result.summary().splitlines())
