"""Targets in real photographs: 21 of a calibration sheet, with the marks of another program.

`../shared` holds them (dbat/camcal_images); where it is absent these tests are skipped. The marks
themselves give the orientation (an adjustment of the sheet's grid), which is then turned by 2 mrad
(rms), some 5 px: a prediction says nothing of tenths of a pixel.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from insgnss.flight.config.block_file import BlockFile, CameraTable, GroundTableInput, ImagesInput
from insgnss.geodesy.rotation import rotation_from_vector
from insgnss.io.formats.blocks.camera_toml import read_camera_toml, write_camera_toml
from insgnss.io.formats.blocks.ground_points import read_ground_points, write_ground_points
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.photogrammetry.target_measurement.request import Target, TargetRequest
from insgnss.photogrammetry.target_measurement.run import MeasurementResult, measure_targets
from insgnss.records import ExteriorOrientation

Array = NDArray[np.float64]
SHEET = Path(__file__).parents[4] / "shared" / "data" / "dbat" / "camcal_images"
pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not SHEET.is_dir(), reason="../shared/data/dbat/camcal_images is not here"),
]
CORNERS = {1001: (9, 2), 1002: (2, 2), 1003: (9, 9), 1004: (2, 9)}  # ring-coded, by their grid
CODES = {1001: 31, 1002: 51, 1003: 37, 1004: 85}  # read off the photographs by eye
SPACING_M, DISC_M = 0.1, 0.0222  # the unit of the sheet is free


@dataclass(frozen=True, eq=False)
class Sheet:
    """Files of the sheet, and its marks."""

    directory: Path
    marks: dict[tuple[str, int], Array]

    def request(
        self, photographs: Path, target: Target, ground: str = "ground.csv"
    ) -> TargetRequest:
        names = ("eo.json", ground, "camera.toml")
        return TargetRequest(*(self.directory / name for name in names), photographs, target=target)


def marked() -> dict[tuple[str, int], Array]:
    lines = (SHEET / "markpts.txt").read_text().splitlines()
    rows = [line.split(",") for line in lines if not line.startswith("#")]
    return {
        (f"P82500{20 + int(i)}.JPG", int(p)): np.array([float(u), float(v)])
        for i, p, u, v, _ in rows
    }


def grid(marks: dict[tuple[str, int], Array]) -> dict[int, Array]:
    """Column and row of each point: the corners' homography, rounded to whole ones."""
    first = {p: uv for (image, p), uv in marks.items() if image == "P8250021.JPG"}
    rows = []
    for p, (X, Y) in CORNERS.items():
        x, y = first[p]
        rows.append([x, y, 1, 0, 0, 0, -X * x, -X * y, -X])
        rows.append([0, 0, 0, x, y, 1, -Y * x, -Y * y, -Y])
    H = np.linalg.svd(np.array(rows, dtype=float))[2][-1].reshape(3, 3)
    out = {}
    for p, uv in first.items():
        q = H @ [*uv, 1.0]
        out[p] = np.rint(q[:2] / q[2])
    return out


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Sheet:
    into, marks = tmp_path_factory.mktemp("sheet"), marked()
    rows = [f"{i},{p},{u},{v},0.1\n" for (i, p), (u, v) in marks.items()]
    (into / "points.csv").write_text("image,point,x,y,sigma\n" + "".join(rows))
    cells = grid(marks).items()
    rows = [f"{p},{SPACING_M * c},{SPACING_M * r},0,0.002,0.002,0.004\n" for p, (c, r) in cells]
    head = "point,x,y,z,sigma_x,sigma_y,sigma_z\n"
    (into / "ground.csv").write_text(head + "".join(rows))
    (into / "first.toml").write_text(
        'model = "forward"\nwidth = 2272\nheight = 1704\nf = 2350\ncx = 1136\ncy = 852\n'
        'free = ["f", "cx", "cy", "k1", "k2", "p1", "p2"]\n'
    )
    block = BlockFile(
        path=into / "block.toml",
        images=ImagesInput(file=into / "points.csv"),
        camera=CameraTable(file=into / "first.toml"),
        ground=GroundTableInput(file=into / "ground.csv"),
    )
    solved = adjust(block, write=False).solved
    values, images = solved.result.values, solved.result.problem.block.images
    (camera,) = values.cameras(solved.result.problem.block.cameras)
    write_camera_toml(camera, into / "camera.toml")
    n, rng = len(images), np.random.default_rng(8)
    turns = np.array([rotation_from_vector(v) for v in 2e-3 * rng.normal(size=(n, 3))])
    cov = np.tile(np.diag([2e-3] * 6) ** 2, (n, 1, 1))
    eo = ExteriorOrientation(
        images,
        np.arange(n) + 0.0,
        2000,
        np.array([0.8, 0.1, 0.0]),
        values.position,
        turns @ values.C_mc,
        cov,
        None,
        np.eye(3),
        np.eye(3),
    )
    write_eo_json(eo, into / "eo.json")
    assert read_camera_toml(into / "camera.toml").width == 2272
    return Sheet(into, marks)


def some(into: Path, *numbers: int) -> Path:
    """A directory with some of the photographs."""
    into.mkdir()
    for k in numbers:
        (into / f"P82500{k}.JPG").symlink_to(SHEET / f"P82500{k}.JPG")
    return into


def found(result: MeasurementResult) -> dict[tuple[str, int], Array]:
    seen = result.inputs.predictions
    return {
        (
            result.inputs.eo.images[seen.image[w.row]],
            int(result.inputs.ground.points[seen.point[w.row]]),
        ): w.measurement.match.uv
        for w in result.windows
        if w.measurement.accepted and w.measurement.match is not None
    }


def test_the_marks_of_another_program(sheet: Sheet, tmp_path: Path) -> None:
    """Oracle: PhotoModeler's marks, whose own residuals in the adjustment are 0.14 px; the bars are
    95 % of them and 0.3 px rms after removing the mean. Three photographs from three sides, among
    them the two with the largest differences of all 21 (99.7 %, 0.131 px).
    """
    photographs = some(tmp_path / "some", 22, 31, 33)
    request = sheet.request(photographs, Target("disc", DISC_M, dark=True))
    result = measure_targets(request, write=False)
    got = found(result)
    wanted = {k: uv for k, uv in sheet.marks.items() if (photographs / k[0]).exists()}
    both = [k for k in wanted if k in got]
    assert len(both) >= 0.97 * len(wanted)
    d = np.array([got[k] - wanted[k] for k in both])
    assert np.abs(d.mean(axis=0)).max() < 0.1
    assert float(np.sqrt(np.mean((d - d.mean(axis=0)) ** 2))) < 0.17
    assert np.abs(d).max() < 1.2


def test_the_ring_codes_of_the_sheet(sheet: Sheet, tmp_path: Path) -> None:
    """Oracle: the codes, read off one photograph by eye; all four in every photograph, and a point
    with the number of another one in none.
    """
    table = read_ground_points(sheet.directory / "ground.csv")
    rows = [table.points.index(str(p)) for p in CORNERS]
    for swapped in (False, True):
        names = [f"RAD{CODES[p]}" for p in CORNERS]
        names = names[1:] + names[:1] if swapped else names
        coded = type(table)(
            tuple(names), table.position_m[rows], table.cov[rows], table.check[rows]
        )
        write_ground_points(coded, sheet.directory / "coded.csv")
        target = Target("ring", DISC_M, dark=True, bits=8, ring=(2.45, 4.0))
        where = SHEET if not swapped else some(tmp_path / "some", 22)
        result = measure_targets(sheet.request(where, target, "coded.csv"), write=False)
        assert result.figures["windows"] == (4 if swapped else 84)
        if swapped:
            assert result.figures["measured"] == 0
            assert result.refusal is not None
        else:
            assert result.figures["measured"] >= 82
