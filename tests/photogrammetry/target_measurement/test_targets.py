"""`insgnss targets`: predictions, measurements, files for other programs, wrong input.

Oracle: a rendered flight (`rendered_flight`), whose pixels are those of a pinhole camera by hand.
"""

import csv
import json
import re
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from rendered_flight import HEIGHT, WIDTH, RenderedFlight, mirrored, rendered_flight
from rendered_targets import Pattern, ringed

from insgnss.base.errors import InputError
from insgnss.cli.main import main
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.io.formats.blocks.gcp_list import read_gcp_list
from insgnss.io.formats.blocks.ground_points import GroundAxes, GroundTable
from insgnss.io.formats.blocks.image_points import ImagePoints
from insgnss.io.formats.blocks.reading import read_measured_block
from insgnss.photogrammetry.target_measurement.photographs import photographs_in, read_grey
from insgnss.photogrammetry.target_measurement.request import Target, TargetRequest
from insgnss.photogrammetry.target_measurement.run import MeasurementResult, measure_targets
from insgnss.photogrammetry.target_measurement.windows import number_in
from insgnss.photogrammetry.targets.codes import smallest

Array = NDArray[np.float64]
MISSING = "G2"
SPECS = Path(__file__).parents[3] / "data_specs"


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> RenderedFlight:
    return rendered_flight(tmp_path_factory.mktemp("rendered") / "flight", missing=(MISSING,))


@pytest.fixture(scope="module")
def measured(flight: RenderedFlight) -> MeasurementResult:
    return measure_targets(request(flight))


def request(flight: RenderedFlight, **changes: object) -> TargetRequest:
    return replace(TargetRequest(*map(Path, flight.arguments)), **changes)  # type: ignore[arg-type]


def copied(flight: RenderedFlight, to: Path) -> RenderedFlight:
    shutil.copytree(flight.directory, to, ignore=shutil.ignore_patterns("targets"))
    return replace(flight, directory=to)


def rows_of(path: Path) -> list[dict[str, str]]:
    lines = [line for line in path.read_text().splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


def test_predictions_hold_the_true_pixels(flight: RenderedFlight, tmp_path: Path) -> None:
    """Oracle: the pixels by hand; 16 errors of two coordinates in units of their covariance."""
    out = tmp_path / "p.csv"
    argv = ["targets", "predict", *flight.arguments[:3], "--out", str(out), "-q"]
    out.write_text("of the user\n")
    assert [main(argv), out.read_text()] == [2, "of the user\n"]
    assert main([*argv, "--force"]) == 0
    assert main(argv) == 0
    squares = []
    for row in rows_of(out):
        assert row["visibility"] == "visible"
        u, v, su, sv, rho, a, b, along = (float(row[k]) for k in list(row)[2:10])
        d = flight.pixel(row["image"], row["point"]) - [u, v]
        C = np.array([[su * su, rho * su * sv], [rho * su * sv, sv * sv]])
        squares.append(d @ np.linalg.solve(C, d))
        t = np.array([np.cos(np.radians(along)), np.sin(np.radians(along))])
        np.testing.assert_allclose(C @ t, a * a * t, atol=0.02 * a * a)
        assert a * b == pytest.approx(np.sqrt(np.linalg.det(C)), rel=0.01)
    assert len(squares) == 16
    assert 0.4 < np.mean(squares) / 2.0 < 1.8


def test_targets_are_where_they_are_and_the_missing_one_is_rejected(
    flight: RenderedFlight, measured: MeasurementResult
) -> None:
    """Oracle: the pixels by hand; a target that was never laid out."""
    assert measured.refusal is None
    got = seen(read_measured_block(flight.directory / "targets" / "image_points.csv").measured)
    assert len(got) == 12
    for (image, point), (uv, sigma) in got.items():
        assert point != MISSING
        error = np.abs(uv - flight.pixel(image, point))
        assert error.max() < 0.1
        assert (error < 5.0 * sigma).all()
    rejected = rows_of(flight.directory / "targets" / "rejected.csv")
    assert {row["point"] for row in rejected} == {MISSING}
    assert all(row["reason"] for row in rejected)
    assert measured.figures["points"][MISSING] == {"windows": 4, "measured": 0}
    assert "1 of 4 ground points were measured in no photograph: G2" in measured.summary()


def seen(points: ImagePoints) -> dict[tuple[str, str], tuple[Array, Array]]:
    of = points.observations
    return {
        (points.images[i], points.points[p]): (uv, sigma)
        for i, p, uv, sigma in zip(of.image, of.point, of.uv, of.sigma_px, strict=True)
    }


def test_files_of_other_programs_say_the_same(
    flight: RenderedFlight, measured: MeasurementResult
) -> None:
    """Oracle: the readers of image blocks, held against files of these programs elsewhere; for
    PIX4Dmatic its description: image, point, x, y, accuracy.
    """
    into = flight.directory / "targets"
    own = seen(read_measured_block(into / "image_points.csv").measured)
    markers = read_measured_block(into / "markers.xml")
    gcp = read_gcp_list(into / "gcp_list.txt")
    for block, without, at in ((markers, "", 1e-4), (gcp, "G4", 1e-4)):
        theirs = seen(block.measured)
        assert {(Path(i).stem, p) for i, p in theirs} == {
            (Path(i).stem, p) for i, p in own if p != without
        }
        for (image, point), (uv, _) in theirs.items():
            np.testing.assert_allclose(uv, own[f"{Path(image).stem}.jpg", point][0], atol=at)
        assert block.ground is not None
        plane = TangentPlane(*flight.eo.origin)
        there = block.ground.in_plane(GroundAxes(block.crs or ""), plane)
        for name, X in zip(there.points, there.position_m, strict=True):
            row = flight.ground.points.index(name)
            np.testing.assert_allclose(X, flight.ground.position_m[row], atol=2e-4)
    assert markers.ground is not None
    assert markers.ground.check[markers.ground.points.index("G4")]
    lines = (into / "pix4d_marks.csv").read_text().splitlines()
    image, point, *numbers = lines[0].split(",")
    np.testing.assert_allclose([float(x) for x in numbers[:2]], own[image, point][0], atol=1e-4)
    assert len(lines) == 12
    assert len(numbers) == 3


def test_the_table_and_the_points_are_what_adjust_takes(
    flight: RenderedFlight, measured: MeasurementResult, tmp_path: Path, capsys
) -> None:
    """Oracle: `insgnss adjust`, of what stands in the directory; a camera without free parameters,
    as four photographs tell nothing of it.
    """
    into = flight.directory / "targets"
    command = ["adjust", flight.arguments[0], "--images", str(into / "image_points.csv")]
    command += ["--ground", str(into / "ground_points.csv"), "--camera", flight.arguments[2]]
    code = main([*command, "--boresight-sigma", "0", "--out", str(tmp_path), "--json", "-q"])
    figures = json.loads(capsys.readouterr().out)
    assert code == 0, figures
    assert figures["counts"]["image_observations"] == 12
    assert figures["counts"]["ground_control"] == 2


def test_the_sheet_shows_every_window_and_loads_nothing(
    flight: RenderedFlight, measured: MeasurementResult
) -> None:
    """Oracle: the numbers of windows; no address in the page."""
    page = (flight.directory / "targets" / "targets.html").read_text()
    assert page.count("<svg") == 16
    assert page.count('class="window bad"') == 4
    assert "http" not in page.replace("http-equiv", "")
    for window in measured.windows:
        if window.measurement.rejected:
            assert window.measurement.rejected in page


def test_a_ground_point_in_one_code_of_a_crs_stays_as_it_is(
    flight: RenderedFlight, tmp_path: Path
) -> None:
    """Oracle: pyproj's UTM of the points; the files say the numbers that were given."""
    own = copied(flight, tmp_path / "utm")
    lat, lon, h = TangentPlane(*flight.eo.origin).geodetic_from_position(flight.ground.position_m)
    pyproj = pytest.importorskip("pyproj")
    to = pyproj.Transformer.from_crs("EPSG:4326", "EPSG:32631", always_xy=True)
    e, n = to.transform(np.degrees(lon), np.degrees(lat))
    table = GroundTable(
        flight.ground.points, np.column_stack([e, n, h]), flight.ground.cov, flight.ground.check
    )
    replace(own, ground=table).write()
    result = measure_targets(request(own, crs="EPSG:32631"))
    assert result.figures["measured"] == 12
    first = (own.directory / "targets" / "gcp_list.txt").read_text().splitlines()
    assert first[0] == "EPSG:32631"
    np.testing.assert_allclose(
        [float(x) for x in first[1].split()[:3]], [e[0], n[0], h[0]], atol=1e-4
    )


def _spoil_size(own: RenderedFlight) -> None:
    from PIL import Image

    path = own.directory / "photographs" / "8001.jpg"
    Image.open(path).resize((WIDTH // 2, HEIGHT // 2)).save(path)


def _spoil_turned(own: RenderedFlight) -> None:
    from PIL import Image

    path = own.directory / "photographs" / "8001.jpg"
    Image.open(path).transpose(Image.Transpose.ROTATE_90).save(path)


def _spoil_truncated(own: RenderedFlight) -> None:
    path = own.directory / "photographs" / "8001.jpg"
    path.write_bytes(path.read_bytes()[:3000])


def _spoil_names(own: RenderedFlight) -> None:
    for path in (own.directory / "photographs").iterdir():
        path.rename(path.with_name(f"DSC_{path.name}"))


def _spoil_twice(own: RenderedFlight) -> None:
    into = own.directory / "photographs"
    (into / "again").mkdir()
    shutil.copy(into / "8001.jpg", into / "again")


def _spoil_far(own: RenderedFlight) -> None:
    far = replace(own.ground, position_m=own.ground.position_m + [2.5e6, 1.1e6, 0.0])
    replace(own, ground=far).write()


def _spoil_beside(own: RenderedFlight) -> None:
    beside = replace(own.ground, position_m=own.ground.position_m + [300.0, 0.0, 0.0])
    replace(own, ground=beside).write()


def _spoil_above(own: RenderedFlight) -> None:
    above = replace(own.ground, position_m=own.ground.position_m + [0.0, 0.0, 60.0])
    replace(own, ground=above).write()


def _spoil_shifted(own: RenderedFlight) -> None:
    names = own.eo.images
    own.write(replace(own.eo, images=(*names[1:], names[0])))


def _spoil_no_camera(own: RenderedFlight) -> None:
    (own.directory / "camera.toml").unlink()


def _spoil_millimetres(own: RenderedFlight) -> None:
    path = own.directory / "camera.toml"
    path.write_text(path.read_text().replace("f = 400.0", "f = 8.8"))


WRONG: list[tuple[Callable[[RenderedFlight], None], int, str]] = [
    (_spoil_size, 3, "8001.jpg: 160 x 120 pixels, the camera has 320 x 240"),
    (_spoil_turned, 3, "8001.jpg: 240 x 320 pixels, .* it was turned"),
    (_spoil_truncated, 3, "8001.jpg: not a photograph that can be read"),
    (_spoil_names, 3, "none of its 4 photographs"),
    (_spoil_twice, 3, "have the same name"),
    (_spoil_far, 3, "they stand in a CRS: name it"),
    (_spoil_beside, 4, "no ground point lies in any image .* belong to another place"),
    (_spoil_above, 4, "their heights have different references"),
    (_spoil_no_camera, 2, "CAMERA .* does not exist"),
    (_spoil_millimetres, 3, "f is in pixels"),
]


NOTHING = "targets found .* nearly nothing is where it is expected"
SHIFTED = pytest.param(_spoil_shifted, 4, NOTHING, marks=pytest.mark.slow)


@pytest.mark.parametrize(
    ("spoil", "code", "words"), [*WRONG, SHIFTED], ids=lambda x: getattr(x, "__name__", "")
)
def test_wrong_input_is_named_in_one_line_and_no_observations_are_written(
    spoil: Callable[[RenderedFlight], None],
    code: int,
    words: str,
    flight: RenderedFlight,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Oracle: what was planted."""
    own = copied(flight, tmp_path / "wrong")
    spoil(own)
    assert main(["targets", "measure", *own.arguments, "-q"]) == code
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 1
    assert re.search(words, lines[0]), lines[0]
    assert not (own.directory / "targets" / "image_points.csv").exists()


@pytest.mark.parametrize(
    ("more", "code", "words"),
    [
        (["predict", 4], 2, "takes no photographs"),
        (["measure", 3], 2, "IMAGES is missing"),
        (["measure", 4, "--signal", "picture"], 2, "--picture FILE belongs to"),
        (["measure", 4, "--signal", "ring", "--bits", "3"], 3, "4 to 32 segments"),
        (["measure", 4, "--signal", "cross", "--arm", "0.2"], 3, "at most half as wide"),
        (["measure", 4, "--size", "0.1"], 4, "too small in this image"),
        (["measure", 4, "--search-px", "-1"], 2, "0 to 1000 px"),
    ],
)
def test_options_that_do_not_go_together_are_refused(
    more: list[str | int],
    code: int,
    words: str,
    flight: RenderedFlight,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    """Oracle: the message."""
    job, count, *options = more
    assert isinstance(count, int)
    command = ["targets", str(job), *flight.arguments[:count], *map(str, options)]
    assert main([*command, "--out", str(tmp_path / "out"), "-q"]) == code
    assert words in capsys.readouterr().err


@pytest.mark.slow
def test_mirrored_axes_are_refused_in_json_too(
    flight: RenderedFlight, tmp_path: Path, capsys
) -> None:
    """Oracle: the exit code and the words of the line."""
    own = copied(flight, tmp_path / "wrong")
    own.write(mirrored(own.eo))
    assert main(["targets", "measure", *own.arguments, "--json"]) == 4
    document = json.loads(capsys.readouterr().out)
    assert document["exit_code"] == 4
    assert "nearly nothing" in document["error"]
    assert {p.name for p in (own.directory / "targets").iterdir()} == {
        "rejected.csv",
        "targets.html",
        "targets.json",
    }


@pytest.mark.slow
@pytest.mark.parametrize(
    ("target", "turned", "words"),
    [
        pytest.param(Target(size_m=0.6), 0.0, "with --size 0.3 ", marks=pytest.mark.slow),
        (Target(), 0.02, "with --search-px 10 "),
        pytest.param(Target("disc", 0.2), 0.0, "shows the windows. If the", marks=pytest.mark.slow),
    ],
)
def test_what_would_have_found_the_targets_is_said(
    target: Target, turned: float, words: str, flight: RenderedFlight, tmp_path: Path
) -> None:
    """Oracle: the size that was rendered; poses tilted by 0.03 rad, some 11 px; targets of another
    kind, of which no trial finds any.
    """
    own = copied(flight, tmp_path / "wrong")
    R = rotation_from_vector([turned, -turned, 0.0])
    own.write(replace(own.eo, C_mc=R @ own.eo.C_mc))
    result = measure_targets(request(own, target=target), write=False)
    assert result.refusal is not None
    assert words in str(result.refusal)


def test_one_image_that_lies_is_found_by_the_others(flight: RenderedFlight, tmp_path: Path) -> None:
    """Oracle: a target moved by 8 px in one photograph of four, by hand. Its point is known to
    5 px, so the ellipse allows it; the poses are known to half a pixel.
    """
    from PIL import Image

    own = copied(flight, tmp_path / "moved")
    path = own.directory / "photographs" / "8000.jpg"
    grey = np.asarray(Image.open(path)).copy()
    u, v = np.rint(flight.pixel("8000.jpg", "G1")).astype(int)
    cut = grey[v - 14 : v + 14, u - 14 : u + 14].copy()
    grey[v - 14 : v + 14, u - 6 : u + 22] = cut
    Image.fromarray(grey).save(path, quality=95)
    cov = np.tile(np.diag([0.01, 0.01, 0.01, 1e-4, 1e-4, 1e-4]) ** 2, (4, 1, 1))
    near = replace(own.eo, position_m=flight.position_m, C_mc=flight.C_mc, cov=cov)
    points = np.tile(0.1**2 * np.eye(3), (1, 1, 1))
    alone = GroundTable(("G1",), own.ground.position_m[:1], points, np.array([False]))
    replace(own, ground=alone).write(near)
    result = measure_targets(request(own), write=False)
    wrong = [w for w in result.windows if "what the other images say" in w.measurement.rejected]
    assert [own.eo.images[result.inputs.predictions.image[w.row]] for w in wrong] == ["8000.jpg"]


@pytest.mark.slow
def test_ring_coded_targets_are_told_by_their_numbers(tmp_path: Path) -> None:
    """Oracle: a pattern drawn with a number; a point of another number is not measured."""
    number = smallest([bool(0b000001011 >> (8 - k) & 1) for k in range(9)])
    pattern: Pattern = ringed(0.2, 9, number)
    flight = rendered_flight(tmp_path / "ring", pattern=pattern)
    names = (f"A{number}", "A1", f"B{number}", "C")
    replace(flight, ground=replace(flight.ground, points=names)).write()
    target = Target("ring", 0.2, bits=9)
    result = measure_targets(request(flight, target=target))
    points = {name: of["measured"] for name, of in result.figures["points"].items()}
    assert points["A1"] == points["C"] == 0
    assert points[f"A{number}"] + points[f"B{number}"] >= 6
    reasons = {w.measurement.rejected for w in result.windows}
    assert f"its ring says {number}, not 1" in reasons
    assert f"its ring says {number}; the name of the point has no number" in reasons


def test_pages_of_the_files(flight: RenderedFlight, tmp_path: Path) -> None:
    """Oracle: the pages; their examples are read, and have the columns that are written."""
    out = tmp_path / "p.csv"
    assert main(["targets", "predict", *flight.arguments[:3], "--out", str(out), "-q"]) == 0
    assert example("targets", "predictions").splitlines()[:3] == out.read_text().splitlines()[:3]
    markers = tmp_path / "markers.xml"
    markers.write_text(example("metashape_markers", "true"))
    got = read_measured_block(markers)
    assert got.measured.observations.uv.tolist() == [[195.4372, 155.5939]]
    assert len(example("pix4d_marks", "true").strip().split(",")) == 5


def example(page: str, kind: str) -> str:
    text = (SPECS / f"{page}.md").read_text(encoding="utf-8")
    return text.partition(f"```{kind}\n")[2].partition("```")[0]


def test_photographs_of_all_depths_are_read_as_they_are_stored(tmp_path: Path) -> None:
    """Oracle: the pixels that were written; an Orientation tag turns nothing."""
    from PIL import Image

    grey = np.arange(12, dtype=np.uint16).reshape(3, 4)
    Image.fromarray(grey * 4000).save(tmp_path / "deep.tif")
    assert read_grey(tmp_path / "deep.tif", (4, 3)).tolist() == (grey * 4000.0).tolist()
    tags = Image.Exif()
    tags[0x0112] = 6
    colours = np.repeat(grey.astype(np.uint8)[:, :, None] * 20, 3, axis=2)
    Image.fromarray(colours).save(tmp_path / "turned.png", exif=tags)
    assert read_grey(tmp_path / "turned.png", (4, 3)).tolist() == (grey * 20.0).tolist()
    with pytest.raises(InputError, match="Orientation 6"):
        read_grey(tmp_path / "turned.png", (3, 4))
    found = photographs_in(tmp_path, ["DEEP.JPG", "other.tif"])
    assert found.files == (tmp_path / "deep.tif", None)
    assert found.strangers == (tmp_path / "turned.png",)


def test_numbers_of_names_and_of_rings() -> None:
    """Oracle: by hand."""
    assert [number_in(name) for name in ("G17", "17", "GCP-007", "G17a", "")] == [
        17,
        17,
        7,
        None,
        None,
    ]
    assert smallest([True, False, False, False]) == 1
    assert smallest([False, True, True, False]) == 3
    assert smallest([True] * 5) == 31
