"""A forward and a backward solution combined: RTKLIB's rule, without its combined run."""

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.engine.combined import combine_solutions
from insgnss.gnss.engine.rtklib import EngineRun, solve
from insgnss.gnss.options import SOLUTION_TYPE, EngineOptions
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows, read_rtklib_pos
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.records import GnssFixes

DATA = Path(__file__).parents[3] / "shared" / "data"
LAT, LON, HEIGHT = np.radians(46.57), np.radians(6.54), 600.0
SETS = {
    "rinex_sim_6min": ("rover.18o", "base.18o", "brdc.18g", "brdc.18n"),
    "cssrlib_rtk": ("SEPT078M1.21O", "3034078M1.21O", "SEPT078M.21P", "30340780.21q"),
    "rinex_ublox_2018": (
        *("rover-20181004-1532.obs", "glw1277p.18o"),
        *("glw1277p.18g", "glw1277p.18n"),
    ),
}


def run_of(
    seed: int, time: np.ndarray, quality: list[int], sigma_m: float = 0.05, by: float = 0.02
) -> GnssFixes:
    """Fixes scattered about one place, with full covariances of very different axes."""
    rng, n = np.random.default_rng(seed), time.size
    A = sigma_m * rng.normal(size=(n, 3, 3))
    C = rotation_en(LAT, LON)
    place = geodetic_to_ecef(LAT, LON, HEIGHT) + by * rng.normal(size=(n, 3)) @ C.T
    cov = A @ A.swapaxes(1, 2) + 1e-4 * np.eye(3)
    return GnssFixes(
        time,
        *ecef_to_geodetic(place),
        cov,
        quality=np.array(quality),
        gps_week=2008,
        satellites=np.arange(n) + 5.0 + seed,
        ratio=np.arange(n) + 3.0 * seed,
        age_s=np.full(n, 0.1 * seed),
    )


def joined(tmp_path: Path, f: GnssFixes, b: GnssFixes, **options: bool) -> GnssFixes:
    for name, fixes in (("f", f), ("b", b)):
        write_rtklib_pos(fixes, tmp_path / f"{name}.pos")
    path = tmp_path / "c.pos"
    together = combine_solutions(tmp_path / "f.pos", tmp_path / "b.pos", path, **options)
    path.write_bytes(b"".join(together.lines))
    handed, read = together.rows["combined"], read_pos_rows(path)
    for name in ("time", "gps_week", "columns", "notes"):  # numbers and text say the same
        np.testing.assert_equal(getattr(handed, name), getattr(read, name))
    assert handed.table.lines.tolist() == read.table.lines.tolist()
    return read_rtklib_pos(path)


def ecef(fixes: GnssFixes) -> np.ndarray:
    return geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_epochs_of_one_quality_are_weighed_by_their_covariances(tmp_path: Path, seed: int) -> None:
    """Oracle: least squares of the six observations of each epoch (numpy), in north, east, down of
    one point; digits of the text: 0.01 mm for 0.1 mm of height, roots of 1e-6 m.
    """
    time = 200000.0 + 0.2 * np.arange(40)
    f, b = run_of(seed, time, [2] * 40), run_of(seed + 10, time, [2] * 40)
    got = joined(tmp_path, f, b)
    C = rotation_en(LAT, LON)
    for k in range(40):
        x = [C.T @ (ecef(s)[k] - geodetic_to_ecef(LAT, LON, HEIGHT)) for s in (f, b)]
        nothing = np.zeros((3, 3))
        W = np.linalg.inv(np.block([[f.cov_ned[k], nothing], [nothing, b.cov_ned[k]]]))
        J = np.vstack([np.eye(3), np.eye(3)])
        N = J.T @ W @ J
        expected = np.linalg.solve(N, J.T @ W @ np.concatenate(x))
        at = C.T @ (ecef(got)[k] - geodetic_to_ecef(LAT, LON, HEIGHT))
        assert_allclose(at, expected, rtol=0, atol=2e-4)
        sigma = np.sqrt(np.diag(np.linalg.inv(N)))
        assert_allclose(got.cov_ned[k], np.linalg.inv(N), rtol=0, atol=1e-3 * sigma.max() ** 2)
    assert (got.quality == 2).all()
    for name in ("satellites", "ratio", "age_s"):  # as RTKLIB: of the forward solution
        assert_allclose(getattr(got, name), getattr(f, name), rtol=0, atol=0.05)


@pytest.mark.parametrize("apart_s", [-0.0048, -0.003, -0.001, 0.001, 0.003, 0.0048])
def test_stamps_up_to_five_milliseconds_apart_are_one_epoch(tmp_path: Path, apart_s: float) -> None:
    """Oracle: the epochs with one and the same stamp, at the stamps of the forward solution; 6 ms
    apart they are epochs of their own (RTKLIB: 5 ms).
    """
    time = 200000.0 + 0.2 * np.arange(5)
    f, b = run_of(1, time, [2] * 5), run_of(2, time, [2] * 5)
    want, got = joined(tmp_path, f, b), joined(tmp_path, f, replace(b, time=time + apart_s))
    assert_allclose(got.time, time, rtol=0, atol=1e-6)
    assert_allclose(ecef(got), ecef(want), rtol=0, atol=1e-6)
    assert_allclose(got.cov_ned, want.cov_ned, rtol=0, atol=1e-12)
    beyond = joined(tmp_path, f, replace(b, time=time + np.copysign(0.006, apart_s)))
    assert len(beyond) == 10


def test_the_better_quality_and_the_only_epoch_are_taken_as_they_stand(tmp_path: Path) -> None:
    """Oracle: the rows of the two files; the order fixed, PPP, float, SBAS, DGPS, single."""
    time = 200000.0 + np.arange(8.0)
    f = run_of(1, time[:7], [1, 2, 5, 6, 3, 4, 2])
    b = run_of(2, time[[0, 1, 2, 3, 4, 5, 7]], [2, 1, 4, 2, 4, 3, 5])
    got = joined(tmp_path, f, b)
    assert got.quality is not None
    assert got.quality.tolist() == [1, 1, 4, 6, 3, 3, 2, 5]
    place = {"f": ecef(f), "b": ecef(b)}
    rows = [("f", 0), ("b", 1), ("b", 2), ("f", 3), ("f", 4), ("b", 5), ("f", 6), ("b", 6)]
    expected = np.array([place[run][k] for run, k in rows])
    assert np.abs(ecef(got) - expected).max() < 1e-4
    lines = {
        line.split()[1]: line
        for name in "fb"
        for line in (tmp_path / f"{name}.pos").read_text().splitlines()
        if not line.startswith("%")
    }
    kept = [x for x in (tmp_path / "c.pos").read_text().splitlines() if not x.startswith("%")]
    assert kept[-1] == lines["200007.000000"]
    assert kept[-2] == lines["200006.000000"]


@pytest.mark.parametrize(("sigmas", "quality"), [(3.9, 1), (4.1, 2)])
@pytest.mark.parametrize("axis", range(3))
def test_fixed_epochs_that_differ_are_called_float(
    tmp_path: Path, sigmas: float, quality: int, axis: int
) -> None:
    """Oracle: four sigma of the difference on one axis of ECEF, by hand; one and the same sphere of
    1 cm for both, so that the mean is the middle. Of a standing receiver nothing is called float.
    """
    time = 200000.0 + np.arange(3.0)
    cov = np.tile(1e-4 * np.eye(3), (3, 1, 1))
    f = replace(run_of(1, time, [1, 1, 1], by=0.0), cov_ned=cov)
    by = np.zeros(3)
    by[axis] = sigmas * 0.01 * np.sqrt(2.0)
    b = replace(
        f, **dict(zip(("lat", "lon", "height"), ecef_to_geodetic(ecef(f) + by), strict=True))
    )
    got = joined(tmp_path, f, b)
    assert got.quality is not None
    assert got.quality.tolist() == [quality] * 3
    assert np.abs(ecef(got) - ecef(f) - 0.5 * by).max() < 2e-4
    assert_allclose(got.cov_ned, 0.5 * cov, rtol=1e-4, atol=1e-9)
    standing = joined(tmp_path, f, b, kinematic=False)
    assert standing.quality is not None
    assert standing.quality.tolist() == [1] * 3


def test_an_epoch_without_covariance_gives_way(tmp_path: Path) -> None:
    """Oracle: the row of the other run; of the forward run where both have none."""
    time = 200000.0 + np.arange(3.0)
    f, b = run_of(1, time, [2, 2, 2]), run_of(2, time, [2, 2, 2])
    for name, fixes, lost in (("f", f, (0, 2)), ("b", b, (1, 2))):
        write_rtklib_pos(fixes, tmp_path / f"{name}.pos")
        lines = (tmp_path / f"{name}.pos").read_text().splitlines()
        for k in lost:
            fields = lines[2 + k].split()
            lines[2 + k] = " ".join([*fields[:7], *["0.0"] * 6, *fields[13:]])
        (tmp_path / f"{name}.pos").write_text("\n".join(lines) + "\n")
    rows = [
        line.split()[2:5]
        for line in b"".join(combine_solutions(*(tmp_path / f"{name}.pos" for name in "fbc")).lines)
        .decode()
        .splitlines()
        if not line.startswith("%")
    ]
    of_run = {
        name: [
            line.split()[2:5] for line in (tmp_path / f"{name}.pos").read_text().splitlines()[2:]
        ]
        for name in "fb"
    }
    assert rows == [of_run["b"][0], of_run["f"][1], of_run["f"][2]]


@pytest.mark.slow
@pytest.mark.parametrize("name", SETS)
def test_the_engines_own_combined_run_agrees(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    """Oracle: RTKLIB's combined run of recordings and of simulated observations.

    0.15 mm are what the texts of three solutions with units of 0.1 mm leave; standard deviations
    of 4 mm and more that are known to 0.05 mm give weights to 0.5 % of the difference of the two.
    """
    if importlib.util.find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    files = [DATA / name / file for file in SETS[name]]
    if not all(file.is_file() for file in files):
        pytest.skip(f"the recording {name} is not here")
    rover, base, *navigation = files
    options = EngineOptions(frequencies=1 if name == "rinex_ublox_2018" else 2)
    run = solve(rover, base, navigation, options, tmp_path / "ours")
    monkeypatch.setitem(SOLUTION_TYPE, "forward", SOLUTION_TYPE["combined"])
    own = solve(rover, base, navigation, options, tmp_path / "own").forward
    check_same(run, own)
    assert set(run.cpu_of) == {"forward", "backward"}


def check_same(run: EngineRun, own: Path) -> None:
    ours, expected = read_rtklib_pos(run.combined), read_rtklib_pos(own)
    f, b = read_rtklib_pos(run.forward), read_rtklib_pos(run.backward)
    assert_allclose(ours.time, expected.time, rtol=0, atol=1e-6)
    assert ours.quality is not None
    assert ours.quality.tolist() == expected.quality.tolist()  # type: ignore[union-attr]
    apart = np.zeros(len(ours))
    rows = [np.searchsorted(s.time, ours.time - 1e-3) for s in (f, b)]
    both = np.all(
        [
            np.abs(s.time[np.minimum(k, len(s) - 1)] - ours.time) < 1e-3
            for s, k in zip((f, b), rows, strict=True)
        ],
        axis=0,
    )
    apart[both] = np.linalg.norm(ecef(f)[rows[0][both]] - ecef(b)[rows[1][both]], axis=1)
    off = np.linalg.norm(ecef(ours) - ecef(expected), axis=1)
    assert (off < 1.5e-4 + 0.005 * apart).all()
    for name in ("satellites", "ratio", "age_s"):
        assert_allclose(getattr(ours, name), getattr(expected, name), rtol=0, atol=0)
