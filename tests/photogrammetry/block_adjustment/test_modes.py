"""Modes of orientation and relative control on the records of one processed flight."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from insgnss import adjust_block, read_eo
from insgnss.base.errors import DataError, InputError, OptionError
from insgnss.cli.main import main
from insgnss.geodesy.rotation import rotation_from_vector, vector_from_rotation
from insgnss.io.formats.blocks.camera_toml import read_camera_toml, write_camera_toml
from insgnss.io.formats.blocks.image_points import read_image_points, write_image_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.photogrammetry.adjust.aerial import BORESIGHT
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.plan import plan_block

EO = "02_Processed/GPS-INS/eo.json"


def quiet(_: str) -> None:
    pass


def in_mode(block, mode="iso", **control):
    return replace(
        block,
        adjustment=replace(block.adjustment, mode=mode),
        aerial_control=replace(block.aerial_control, **control),
    )


@pytest.fixture(scope="module")
def calibrated(flown, tmp_path_factory):
    """The block with the true camera, as a calibration before would give it."""
    true = read_camera_toml(flown.directory / "truth/camera.toml")
    path = tmp_path_factory.mktemp("calibrated") / "camera.toml"
    write_camera_toml(replace(true, free=()), path)
    file = flown.block
    return replace(file, camera=replace(file.camera, file=path))


class Modes(dict):
    """Results by mode and control."""

    def __init__(self, block) -> None:
        super().__init__()
        self.block = block

    def __missing__(self, name: str):
        words, *control = name.split()
        mode = {"FAT": "fast_at", "ISO": "iso"}.get(words, words)
        file = in_mode(self.block, mode, control=(control or ["Ap/Aa"])[0])
        self[name] = adjust_block(file, write=False)
        return self[name]


@pytest.fixture(scope="module")
def done(calibrated):
    """Each mode and control once, when it is asked for."""
    return Modes(calibrated)


NAMES = [f"FAT {c}" for c in ("Ap/Aa", "Ap/Ra", "Rp/Ra")] + ["direct"]
NAMES += [
    pytest.param(name, marks=pytest.mark.slow)
    for name in ("ISO Ap/Ra", "ISO Rp/Ra", "ISO Ap", "indirect")
]


@pytest.mark.parametrize("name", NAMES)
def test_check_points_agree_with_their_covariance(done, name) -> None:
    """Joint normalised square within 99.9 % of chi-square, and nothing contradicts."""
    result = done[name]
    together = result.figures["check_points_together"]
    low, high = chi2.ppf((5e-4, 1 - 5e-4), together["degrees_of_freedom"])
    assert low < together["normalised_square"] < high
    assert result.figures["verdict"] == "consistent", result.judgement.headline


@pytest.mark.parametrize("name", NAMES)
def test_poses_agree_with_their_covariance(done, flown, name) -> None:
    """Oracle: the truth. One pose by its own covariance, 99.99 % of chi-square."""
    result = done[name].solved
    with np.load(flown.directory / "truth/eo.npz") as file:
        row = {str(n): k for k, n in enumerate(file["images"])}
        images = result.result.problem.block.images
        middle = len(images) // 2
        X, C = (file[key][row[images[middle]]] for key in ("position_enu", "C_mc"))
    values = result.result.values
    psi = vector_from_rotation(C @ values.C_mc[middle].T)
    e = np.concatenate([X - values.position[middle], psi])
    assert e @ np.linalg.solve(result.precision.pose_cov[middle], e) < chi2.ppf(0.9999, 6)


def test_fast_at_uses_ground_points_alone_and_orients_all_images(done, flown) -> None:
    result = done["FAT Ap/Ra"]
    block = result.solved.result.problem.block
    assert len(block.points) == 15
    assert set(block.images) == set(read_eo(flown.directory / EO).images)
    assert all(camera.free == () for camera in block.cameras)
    assert any("take no part" in note for note in result.figures["notes"])
    unseen = set(range(len(block.images))) - set(block.observations.image.tolist())
    assert unseen  # images without any observation are oriented by their line


def test_relative_attitudes_have_no_bore_sight(done) -> None:
    assert (BORESIGHT, 0) not in done["FAT Ap/Ra"].solved.result.values.blocks
    assert (BORESIGHT, 0) in done["FAT Ap/Aa"].solved.result.values.blocks
    assert done["FAT Rp/Ra"].figures["flight_lines"][0]["control"] == "Rp/Ra"


@pytest.mark.slow
@pytest.mark.parametrize("mode", ["iso", "fast_at"])
def test_relative_attitudes_do_not_care_for_the_bore_sight(
    calibrated, flown, done, tmp_path, mode
) -> None:
    """Attitudes that are 5 deg off by their bore-sight give the same check points."""
    eo = read_eo(flown.directory / EO)
    turn = rotation_from_vector(np.radians([3.0, -3.0, 2.6]))
    path = tmp_path / "eo.json"
    write_eo_json(replace(eo, C_mc=eo.C_mc @ turn), path)
    (tmp_path / "eo_covariance.npz").write_bytes(
        (flown.directory / EO).with_name("eo_covariance.npz").read_bytes()
    )
    file = in_mode(calibrated, mode, control="Ap/Ra", file=path)
    result = adjust_block(file, write=False)
    name = {"iso": "ISO Ap/Ra", "fast_at": "FAT Ap/Ra"}[mode]
    for one, two in zip(
        result.figures["check_points"], done[name].figures["check_points"], strict=True
    ):
        # a tenth of the standard deviation of 10 mm: one image observation may be rejected in one
        # of both, and its covariances are those of other attitudes
        assert one["difference_m"] == pytest.approx(two["difference_m"], abs=1.5e-3)


def test_direct_orientation_leaves_poses_alone(done, flown) -> None:
    result = done["direct"].solved
    eo = read_eo(flown.directory / EO)
    rows = result.inputs.eo_row
    np.testing.assert_array_equal(result.result.values.position, eo.position_m[rows])
    # the covariance of each pose is what eo.json has, by the inverse of whole lines and what they
    # have in common
    scale = np.sqrt(np.diagonal(eo.cov[rows], axis1=1, axis2=2))
    both = scale[:, :, None] * scale[:, None, :]
    np.testing.assert_allclose(result.precision.pose_cov / both, eo.cov[rows] / both, atol=1e-5)
    assert len(done["direct"].figures["check_points"]) == 15
    assert done["direct"].figures["ground_control"] == []


@pytest.mark.slow
def test_statistics_of_check_points(done) -> None:
    figures = done["ISO Ap"].figures
    d = np.array([c["difference_m"] for c in figures["check_points"]])
    own = figures["check_points_together"]
    np.testing.assert_allclose(own["mean_m"], d.mean(axis=0))
    np.testing.assert_allclose(own["rms_m"], np.sqrt((d**2).mean(axis=0)))
    assert np.abs(own["largest_m"]) == pytest.approx(np.abs(d).max(axis=0))


@pytest.mark.slow
def test_lines_may_differ(calibrated) -> None:
    first = inputs_of(calibrated, quiet).eo.images[0]
    file = in_mode(calibrated, lines=(f"{first} Rp/Ra",))
    result = adjust_block(file, write=False)
    controls = [line["control"] for line in result.figures["flight_lines"]]
    assert controls[0] == "Rp/Ra"
    assert set(controls[1:]) == {"Ap/Aa"}
    assert result.figures["verdict"] == "consistent"


@pytest.mark.slow
def test_a_line_that_nothing_holds_is_told(calibrated) -> None:
    """One ground point, and no other that ties lines: most images are known to 5 m and 2 deg."""
    file = in_mode(calibrated, "fast_at", control="Rp/Ra")
    ground = replace(file.ground, skip=tuple(f"G{k:02d}" for k in range(2, 16)))
    result = adjust_block(replace(file, ground=ground), write=False)
    held = result.figures["weakly_held"]
    assert sum(chain["images"] for chain in held) > 40
    said = [f for f in result.judgement.findings if f.name == "relative control"]
    assert "5 m and 2 deg" in said[0].found
    assert max(max(i["sigma_m"]) for i in result.figures["images"]) > 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mode": "fast_at", "control": "Ap"}, "does not orient images in mode"),
        ({"mode": "direct", "control": "Rp/Ra"}, "does not orient images in mode"),
        ({"mode": "iso", "relative_weights": "gyro"}, "has no meaning without relative control"),
        ({"mode": "iso", "lines": ("8001.tif",)}, "the name of an image and one of"),
        ({"mode": "indirect", "control": "Rp/Ra"}, "has no meaning in mode"),
    ],
)
def test_options_without_meaning_are_refused(flown, changes, message) -> None:
    with pytest.raises(OptionError, match=message):
        in_mode(flown.block, **changes)


def test_a_camera_that_is_held_is_not_estimated(flown) -> None:
    file = flown.block
    with pytest.raises(OptionError, match="the camera is fixed in mode"):
        in_mode(replace(file, camera=replace(file.camera, free=("f",))), "fast_at")


def test_a_block_without_datum_is_refused(flown) -> None:
    ground = replace(flown.block.ground, check=tuple(f"G{k:02d}" for k in range(3, 16)))
    with pytest.raises(DataError, match=r"mode indirect: 2 ground control points .* at least 3"):
        inputs_of(in_mode(replace(flown.block, ground=ground), "indirect"), quiet)


@pytest.mark.slow
def test_an_image_that_is_none(flown) -> None:
    with pytest.raises(InputError, match="is no image of the aerial control"):
        adjust_block(in_mode(flown.block, lines=("9999.tif Ap",)), write=False)


@pytest.mark.slow
def test_one_line_has_one_control(flown) -> None:
    first, second = read_eo(flown.directory / EO).images[:2]
    lines = (f"{first} Ap", f"{second} Rp")
    with pytest.raises(InputError, match="lie in one flight line, which cannot be both Ap and Rp"):
        adjust_block(in_mode(flown.block, lines=lines), write=False)


@pytest.mark.slow
def test_a_wrong_camera_is_named_in_fast_at(calibrated, tmp_path) -> None:
    """f off by 30 px, of which poses and ground points know."""
    camera = read_camera_toml(calibrated.camera.file)
    off = camera.interior.copy()
    off[0] += 30.0
    write_camera_toml(replace(camera, interior=off), tmp_path / "camera.toml")
    file = in_mode(calibrated, "fast_at")
    file = replace(file, camera=replace(file.camera, file=tmp_path / "camera.toml"))
    result = adjust_block(file, write=False)
    assert result.figures["verdict"] == "contradiction"
    assert "interior orientation" in result.judgement.headline
    assert "adjust the tie points in mode iso" in result.judgement.headline


@pytest.mark.slow
def test_what_explains_nearly_as_well_is_named_once(calibrated, tmp_path) -> None:
    """Of relative positions the camera constant and a lever arm look alike."""
    camera = read_camera_toml(calibrated.camera.file)
    off = camera.interior.copy()
    off[0] += 60.0
    write_camera_toml(replace(camera, interior=off), tmp_path / "camera.toml")
    file = in_mode(calibrated, "fast_at", control="Rp/Ra")
    file = replace(file, camera=replace(file.camera, file=tmp_path / "camera.toml"))
    result = adjust_block(file, write=False)
    words = " ".join(f.sentence for f in result.judgement.findings if f.rank >= 1.0)
    assert "interior orientation of -6" in words or "interior orientation of -5" in words
    for finding in result.judgement.findings:
        assert finding.advice.count("lever arm of") <= 1


def test_the_command_line(flown, tmp_path, capsys) -> None:
    out = tmp_path / "out"
    command = ["adjust", str(flown.directory), "--mode", "direct", "--out", str(out), "--quiet"]
    assert main(command) == 0, capsys.readouterr().err
    page = (out / "adjust.html").read_text()
    assert "direct: poses and camera held" in page
    assert "root mean square" in page
    assert main(["adjust", str(flown.directory), "--mode", "indirectly"]) == 2
    assert "--mode" in capsys.readouterr().err


@pytest.mark.parametrize("mode", ["fast_at", "direct"])
def test_a_plan_says_what_comes_out(calibrated, done, mode) -> None:
    """Sigmas of check points of the dry run beside those of the adjustment, from the same poses."""
    plan = plan_block(in_mode(calibrated, mode), quiet)
    name = {"fast_at": "FAT Ap/Aa", "direct": "direct"}[mode]
    rows = [
        np.array([c["sigma_adjusted_m"] for c in figures["check_points"] if "sigma_m" in c])
        for figures in (plan.figures, done[name].figures)
    ]
    ratio = np.sqrt((rows[0] ** 2).mean(axis=0) / (rows[1] ** 2).mean(axis=0))
    # targets are planned in all images that see them, at 0.3 px; they were measured at 0.2 px
    assert ((ratio > 0.7) & (ratio < 1.4)).all(), ratio


@pytest.mark.slow
def test_direct_orientation_rejects_gross_errors_alone(calibrated, done, flown, tmp_path) -> None:
    """Errors that poses share are no gross errors: nothing is rejected but what was planted."""
    assert done["direct"].solved.rejected.size == 0
    assert all(c["images"] >= 3 for c in done["direct"].figures["check_points"])
    measured = read_image_points(calibrated.images.file)
    seen, uv = measured.observations, measured.observations.uv.copy()
    many = np.bincount(seen.point)[seen.point] >= 5
    gross = np.flatnonzero(many)[::120]
    uv[gross] += np.where(uv[gross] > 1000.0, -80.0, 80.0)
    path = tmp_path / "image_points.csv"
    write_image_points(replace(measured, observations=replace(seen, uv=uv)), path)
    file = in_mode(calibrated, "direct")
    result = adjust_block(replace(file, images=replace(file.images, file=path)), write=False)
    names = {(measured.images[seen.image[k]], measured.points[seen.point[k]]) for k in gross}
    rejected = {(r["image"], r["point"]) for r in result.figures["rejected"]}
    assert len(gross) > 5
    assert names <= rejected
    # of a point with few rays left nothing tells which one is wrong
    assert {point for _, point in rejected} == {point for _, point in names}
    assert result.figures["verdict"] == "consistent"


def test_indirect_orientation_has_no_aerial_control(done) -> None:
    figures = done["indirect"].figures
    assert figures["covariance_of_aerial_control"] == "none"
    assert figures["flight_lines"] == []
    assert [c["name"] for c in figures["components"]] == ["image observations", "ground control"]
