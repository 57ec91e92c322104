"""A vehicle in a block: its files joined, adjusted, wrong ones refused or told by name."""

import json
from contextlib import nullcontext
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import vehicles
from vehicles import ARM, NED, ORIGIN, VEHICLE, WITH_SIZES, Road, driven, write

from insgnss.base.errors import DataError, InputError, OptionError
from insgnss.cli.main import main
from insgnss.flight.config.block_file import VehicleTable, load_block
from insgnss.geodesy.frames import TangentPlane
from insgnss.geodesy.rotation import rotation_from_rpy
from insgnss.io.formats.blocks.image_points import ImagePoints, write_image_points
from insgnss.io.formats.orientation.eo_covariance import write_eo_covariance
from insgnss.io.formats.orientation.eo_json import write_eo_json
from insgnss.io.formats.trajectory.trajectory_csv import read_trajectory_csv, write_trajectory_csv
from insgnss.io.formats.vehicle.target_positions import TargetPositions, write_target_positions
from insgnss.photogrammetry.adjust.kinematic import (
    KINEMATIC_CONTROL,
    TARGET_ARM,
    TARGET_SIZES,
    VEHICLE_CLOCK,
    VEHICLE_SHIFT,
)
from insgnss.photogrammetry.block_adjustment.inputs import inputs_of
from insgnss.photogrammetry.block_adjustment.plausibility import refuse_implausible
from insgnss.photogrammetry.block_adjustment.run import adjust
from insgnss.photogrammetry.block_adjustment.trials import converging
from insgnss.photogrammetry.block_adjustment.vehicle.observed import observed_target
from insgnss.photogrammetry.block_adjustment.vehicle.rays import _refuse_sizes
from insgnss.photogrammetry.block_adjustment.vehicle.track import Track, along_course
from insgnss.photogrammetry.block_adjustment.vehicle.verdict import frame_of
from insgnss.records import ExteriorOrientation
from insgnss.records.block import ImageObservations
from insgnss.records.strips import CommonErrors, StripCovariance

quiet = lambda _: None  # noqa: E731
EARTH_M = 6.37e6  # radius: half a metre of latitude to a part in 300


@pytest.fixture(scope="module")
def made():
    return driven()


@pytest.fixture(scope="module")
def adjusted(made, tmp_path_factory):
    file = write(made, tmp_path_factory.mktemp("vehicle") / "b", VEHICLE + WITH_SIZES)
    return adjust(load_block(file))


def changed(made, tmp_path, vehicle=VEHICLE, **trajectory):
    """The block file of a data set with another trajectory."""
    return load_block(
        write(replace(made, trajectory=replace(made.trajectory, **trajectory)), tmp_path, vehicle)
    )


def test_a_good_vehicle_is_adjusted_and_nothing_is_said_against_it(made, adjusted) -> None:
    """Oracle: the truth, by the covariance; the same places in adjust.json and on the page."""
    assert adjusted.refusal is None
    assert not adjusted.judgement.contradicted
    own = adjusted.figures["vehicle"]
    assert (own["exposures"], own["left_out"], own["sizes"]) == (16, 0, 16)
    names = {c["name"]: c for c in adjusted.figures["components"]}
    assert names[KINEMATIC_CONTROL]["observations"] == 48
    assert names[TARGET_SIZES]["observations"] == 16
    result = adjusted.solved.result
    row = {name: k for k, name in enumerate(result.problem.block.points)}
    truth = dict(zip(made.measured.points, made.point, strict=True))
    keys = [("point", row[p["point"]]) for p in own["points"]]
    error = np.concatenate(
        [
            result.values.point[k] - truth[p["point"]]
            for (_, k), p in zip(keys, own["points"], strict=True)
        ]
    )
    nees = error @ np.linalg.solve(adjusted.solved.precision.cov(*keys), error) / error.size
    assert 0.4 < nees < 1.9  # 48 components, 99.9 %
    page = next(f for f in adjusted.files if f.name == "adjust.html").read_text()
    assert "Kinematic ground control: trajectory of the vehicle minus adjusted" in page
    written = json.loads(next(f for f in adjusted.files if f.name == "adjust.json").read_text())
    assert written["vehicle"]["points"][3]["image"] == "IMG_0003.jpg"


@pytest.mark.slow
def test_fast_at_takes_the_vehicle(made, tmp_path) -> None:
    """Its points, which one image sees, take part beside the ground points; tie points do not."""
    file = load_block(write(made, tmp_path / "b", VEHICLE))
    result = adjust(
        replace(
            file,
            camera=replace(file.camera, free=None),
            adjustment=replace(file.adjustment, mode="fast_at"),
            aerial_control=replace(file.aerial_control, control="Ap/Aa"),
        ),
        write=False,
    )
    names = {c["name"]: c["observations"] for c in result.figures["components"]}
    assert names[KINEMATIC_CONTROL] == 48
    assert not any("measured once" in note for note in result.figures["notes"])
    assert all(name[0] != "T" for name in result.solved.result.problem.block.points)


@pytest.mark.slow
def test_the_vehicle_makes_check_points_better(made, adjusted, tmp_path) -> None:
    """Oracle: the covariance without it."""
    without = adjust(load_block(write(made, tmp_path / "b", "")), write=False)
    sigma = [
        np.array([c["sigma_adjusted_m"] for c in r.figures["check_points"]]).mean(axis=0)
        for r in (adjusted, without)
    ]
    assert (sigma[0] < 0.9 * sigma[1]).all()


@pytest.mark.parametrize(
    ("seconds", "words"),
    [
        (18.0, r"18\.00 s later: the stamps of the vehicle are off \(the 18 leap .* = -18\.00"),
        (604800.0, "as if off by 1 GPS week: the GPS week of one file is wrong"),
        (-7200.0, "as if off by a time zone of 2 h"),
        (500.0, "none of the 16 exposures .* give the vehicle's file of this flight"),
    ],
)
def test_stamps_of_another_scale_are_refused(made, tmp_path, seconds, words) -> None:
    """Oracle: by how much they were moved."""
    long = made
    if seconds == 18.0:
        long = driven(Road(images=40, tie_points=600))
    file = changed(long, tmp_path / "b", time=long.trajectory.time + seconds)
    with pytest.raises((InputError, DataError), match=words):
        refuse_implausible(inputs_of(file, quiet))


def test_headings_in_radians_are_refused(made, tmp_path) -> None:
    """Oracle: the same attitudes, written so."""
    rpy = made.trajectory.rpy % (2.0 * np.pi)
    C_nb = rotation_from_rpy(np.radians(rpy))  # what readers make of radians in columns of degrees
    file = changed(made, tmp_path / "b", C_nb=C_nb)
    with pytest.raises(InputError, match="as radians; give degrees"):
        inputs_of(file, quiet)


@pytest.mark.slow
def test_a_clock_off_by_a_second_is_named(made, tmp_path) -> None:
    """Oracle: by how much it was moved; the same delay stated makes the block good again. A second
    is seen by rays, a fifth of one by the adjustment.
    """
    second = changed(made, tmp_path / "s", time=made.trajectory.time + 1.0)
    with pytest.raises(
        DataError, match=r"where it was (0\.9|1\.0)\d s later: the stamps of the vehicle are off"
    ):
        adjust(second, write=False)
    file = changed(made, tmp_path / "b", time=made.trajectory.time + 0.2)
    result = adjust(file, write=False)
    assert result.refusal is not None
    assert "kinematic ground control" in str(result.refusal)
    best = next(t for t in result.judgement.trials_made if t.explains)
    assert best.name == VEHICLE_CLOCK
    assert best.value == pytest.approx([-0.2], abs=0.015)
    assert "vehicle.time_offset_s = -0.2" in str(result.refusal)
    good = replace(file, vehicle=replace(file.vehicle, time_offset_s=-0.2))
    assert adjust(good, write=False).refusal is None


WRONG_ARMS = {
    "up": ("[0.4, -0.25, 2.1]", "it was given upwards instead of down"),
    "exchanged": ("[-0.25, 0.4, -2.1]", "forward and right were exchanged"),
    "camera": ("[-0.25, -2.1, 0.4]", "it was given in the axes of a camera that looks ahead"),
}


@pytest.mark.slow
def test_what_the_vehicle_lacks_is_tried_where_a_block_does_not_converge(made, tmp_path) -> None:
    """Oracle: the half metre north by which the base of the vehicle was planted elsewhere."""
    lat = made.trajectory.lat + 0.5 / EARTH_M
    best = converging(inputs_of(changed(made, tmp_path / "b", lat=lat), quiet), quiet)
    assert best is not None
    assert best.name == VEHICLE_SHIFT
    assert best.value == pytest.approx([0.0, 0.5, 0.0], abs=0.07)


@pytest.mark.slow
@pytest.mark.parametrize("case", WRONG_ARMS)
def test_a_lever_arm_in_other_axes_is_named(made, tmp_path, case) -> None:
    """Oracle: what was done to it."""
    given, words = WRONG_ARMS[case]
    file = changed(made, tmp_path / "b", VEHICLE.replace("[0.4, -0.25, -2.1]", given))
    result = adjust(file, write=False)
    assert result.judgement.contradicted
    best = next(t for t in result.judgement.trials_made if t.explains)
    assert best.name == TARGET_ARM
    assert words in result.judgement.headline
    if case != "up":
        assert result.refusal is not None


@pytest.mark.slow
def test_another_base_is_named(made, tmp_path) -> None:
    """Oracle: by how much the vehicle was moved: 0.4 m north."""
    file = changed(made, tmp_path / "b", lat=made.trajectory.lat + 0.4 / EARTH_M)
    result = adjust(file, write=False)
    assert result.judgement.contradicted
    best = next(t for t in result.judgement.trials_made if t.explains)
    assert best.name == VEHICLE_SHIFT
    assert best.value[1] == pytest.approx(0.4, abs=0.08)
    assert "check coordinates, datum and antenna of the vehicle's base" in best.remedy


@pytest.mark.slow
def test_a_single_wrong_measurement_is_left_out_and_told(made, tmp_path) -> None:
    """Oracle: which it was; the others stay."""
    seen = made.measured.observations
    uv = np.array(seen.uv)
    row = made.measured.points.index("K_IMG_0007.jpg")
    uv[seen.point == row] += (35.0, -20.0)
    wrong = replace(seen, uv=uv)
    off = replace(made, measured=replace(made.measured, observations=wrong))
    result = adjust(load_block(write(off, tmp_path / "b")), write=False)
    assert result.refusal is None
    own = result.figures["vehicle"]
    assert [p["image"] for p in own["points"] if p["left_out"]] == ["IMG_0007.jpg"]
    assert "1 of 16 measurements of the vehicle's target do not fit" in result.summary()


@pytest.mark.slow
def test_another_target_size_is_told(made, tmp_path) -> None:
    """Oracle: 5 % of its diameter."""
    sizes = WITH_SIZES.replace("1.2", "1.26")
    file = load_block(write(made, tmp_path / "b", VEHICLE + sizes))
    result = adjust(file, write=False)
    assert result.judgement.contradicted
    assert TARGET_SIZES in {f.name for f in result.judgement.findings if f.rank >= 1.0}
    scaled = replace(file, vehicle=replace(file.vehicle, size_sigma_m=0.1))
    again = adjust(scaled, write=False)
    own = again.figures["vehicle"]["parameters"]["size of the target"]
    assert own["value"][0] == pytest.approx(-0.06, abs=4.0 * own["sigma"][0])
    assert not again.judgement.contradicted


def test_a_target_of_another_diameter_is_refused_before_the_adjustment(made, tmp_path) -> None:
    """Millimetres for metres, and twice the diameter; the remedy is the true diameter."""
    for wrong in ("1200.0", "2.4"):
        sizes = WITH_SIZES.replace("1.2", wrong)
        file = load_block(write(made, tmp_path / wrong, VEHICLE + sizes))
        with pytest.raises(DataError, match=r"a diameter of 1\.\d+ m fits"):
            adjust(file, write=False)


# ---- files


def as_eo(made) -> tuple[ExteriorOrientation, list[StripCovariance], CommonErrors]:
    """The vehicle as a run of `process` with the exposures as its events: two lines."""
    plane = TangentPlane(ORIGIN[0] + 1e-5, ORIGIN[1] - 2e-5, 880.0)
    here = TangentPlane(*ORIGIN)
    turn = plane.C_em.T @ here.C_em
    at = made.trajectory.at(made.eo.time)
    geodetic = (at.lat, at.lon, at.height)
    C = plane.C_mn(at.lat, at.lon) @ at.C_nb
    n = len(made.eo.images)
    T = np.array([[0.0, 1.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])
    factor = np.zeros((n, 6, 2))
    factor[:, :2, 0] = 0.01
    factor[:, 2, 1] = 0.03
    factor[:, 3, 1] = 1e-4
    sigma = np.array([0.01, 0.01, 0.02, 2e-4, 2e-4, 8e-4])
    common = np.einsum("iaq,jbq->iajb", factor, factor).reshape(6 * n, 6 * n)
    whole = common + np.kron(np.eye(n), np.diag(sigma**2))
    half = n // 2
    strips = [
        StripCovariance(np.arange(a, b), whole[6 * a : 6 * b, 6 * a : 6 * b])
        for a, b in ((0, half), (half, n))
    ]
    blocks = whole.reshape(n, 6, n, 6)[np.arange(n), :, np.arange(n)]
    v = np.einsum("nij,nj->ni", plane.C_mn(at.lat, at.lon), at.velocity_ned)
    offset = C @ ARM
    later = made.trajectory.at(made.eo.time + 0.1)
    arms = [(plane.C_mn(x.lat, x.lon) @ x.C_nb) @ ARM for x in (at, later)]
    rate = np.zeros((n, 3))
    up = turn @ [0.0, 0.0, 1.0]
    rate += (
        up
        * np.einsum("ni,ni->n", np.cross(arms[0], (arms[1] - arms[0]) / 0.1), np.tile(up, (n, 1)))[
            :, None
        ]
        / (np.linalg.norm(np.cross(arms[0], up), axis=1) ** 2)[:, None]
    )
    eo = ExteriorOrientation(
        made.eo.images,
        made.eo.time,
        made.eo.gps_week,
        np.array([plane.lat, plane.lon, plane.height]),
        plane.position_from_geodetic(*geodetic) + offset,
        C @ T.T,
        blocks,
        None,
        np.eye(3),
        T,
        velocity_mps=v + np.cross(rate, offset),
        rate_radps=rate,
    )
    return eo, strips, CommonErrors(np.zeros(n, dtype=np.int64), factor)


def test_the_events_of_a_processed_vehicle_are_joined_by_name_and_by_stamp(made, tmp_path) -> None:
    """Oracle: the trajectory of the same vehicle; the covariance written out."""
    into = tmp_path / "b"
    ways = {}
    write(made, into)
    ways["trajectory"] = inputs_of(load_block(into), quiet).vehicle
    eo, strips, common = as_eo(made)
    text = '[vehicle]\nfile = "v/eo.json"\n'
    (into / "v").mkdir()
    for name, images in (("name", eo.images), ("stamp", tuple(f"E{k}" for k in range(16)))):
        other = replace(eo, images=images)
        write_eo_json(other, into / "v/eo.json")
        write_eo_covariance(other, strips, into / "v/eo_covariance.npz", common)
        (into / "block.toml").write_text(vehicles.BLOCK + text)
        ways[name] = inputs_of(load_block(into), quiet).vehicle
    for name in ("name", "stamp"):
        off = ways[name].exposures.position_m - ways["trajectory"].exposures.position_m
        assert np.abs(off).max() < 2e-4  # rounding of trajectory.csv
        assert (
            np.abs(ways[name].exposures.velocity - ways["trajectory"].exposures.velocity).max()
            < 0.02
        )
        assert ways[name].images == made.sizes.images
        turned = ways[name].exposures.C_mv - ways["trajectory"].exposures.C_mv
        assert np.abs(turned).max() < 1e-5
    P = ways["name"].cov.reshape(16, 3, 16, 3)
    here, there = TangentPlane(*ORIGIN), TangentPlane(*eo.origin)
    turn = here.C_em.T @ there.C_em
    A = common.factor[0, :3]
    assert pytest.approx(turn @ A @ A.T @ turn.T, abs=1e-12) == P[2, :, 13]
    own = turn @ (A @ A.T + np.diag([1e-4, 1e-4, 4e-4])) @ turn.T
    assert pytest.approx(own, abs=1e-12) == P[2, :, 2]


def test_a_table_of_target_positions(made, tmp_path) -> None:
    """Oracle: the trajectory of the same vehicle, by image and by stamp, with interpolation."""
    into = tmp_path / "b"
    write(made, into)
    first = inputs_of(load_block(into), quiet).vehicle
    cov = first.cov.reshape(16, 3, 16, 3)[np.arange(16), :, np.arange(16)]
    named = TargetPositions(made.eo.images, None, None, first.exposures.position_m, cov)
    write_target_positions(named, into / "named.csv")
    t = read_trajectory_csv(into / "vehicle.csv")
    plane = TangentPlane(*ORIGIN)
    C = plane.C_mn(t.lat, t.lon) @ t.C_nb
    position = plane.position_from_geodetic(t.lat, t.lon, t.height) + C @ ARM
    stamped = TargetPositions(
        None, t.time, t.gps_week, position, np.tile(cov[0], (len(position), 1, 1))
    )
    write_target_positions(stamped, into / "stamped.csv")
    for name in ("named", "stamped"):
        (into / "block.toml").write_text(vehicles.BLOCK + f'[vehicle]\nfile = "{name}.csv"\n')
        got = inputs_of(load_block(into), quiet).vehicle
        assert np.abs(got.exposures.position_m - first.exposures.position_m).max() < 1e-3
        speed = np.linalg.norm(got.exposures.velocity - first.exposures.velocity, axis=1)
        assert np.median(speed) < (0.02 if name == "stamped" else 0.5)
    (into / "block.toml").write_text(
        vehicles.BLOCK + '[vehicle]\nfile = "named.csv"\ntarget_m = [0, 0, -2]\n'
    )
    with pytest.raises(
        InputError, match=r"positions of the target itself, so that vehicle\.target_m"
    ):
        inputs_of(load_block(into), quiet)


def test_between_rows_position_and_velocity_are_those_of_a_cubic() -> None:
    """Oracle: a polynomial of third degree and its derivative (numpy): the cubic through positions
    and velocities of two rows is the polynomial itself.
    """
    path = np.random.default_rng(3).normal(size=(4, 3))
    slope = np.polynomial.polynomial.polyder(path)
    time, between = np.array([0.0, 0.4, 0.5, 1.3, 2.0]), np.array([0.1, 0.47, 0.7, 1.0, 1.9])
    x, v = (np.polynomial.polynomial.polyval(time, c).T for c in (path, slope))
    C = np.tile(np.eye(3), (5, 1, 1))
    track, within = Track("table", None, time, 2008, x, v, C, np.zeros(3)).at(between, 1.0)
    assert within.all()
    for values, c in ((track.position_m, path), (track.velocity, slope)):
        expected = np.polynomial.polynomial.polyval(between, c).T
        np.testing.assert_allclose(values, expected, rtol=0, atol=1e-12)


def test_errors_that_last_and_the_lever_arm_are_in_the_covariance(made, tmp_path) -> None:
    """Oracle: (KI.1) written out for two exposures, with axes by hand, to the 5e-5 rad by which the
    vertical there differs from that of the origin; the lever arm's share is 5e-7 m^2.
    """
    file = load_block(write(made, tmp_path / "b"))
    vehicle = inputs_of(file, quiet).vehicle
    P = vehicle.cov.reshape(16, 3, 16, 3)
    gap = vehicle.time[9] - vehicle.time[4]
    rho = 0.75 * np.exp(-gap / 300.0)
    at = made.trajectory.at(made.eo.time[[4, 9]])
    C = [NED.T @ rotation_from_rpy(rpy) for rpy in at.rpy]
    t = read_trajectory_csv(tmp_path / "b" / "vehicle.csv")
    B = []
    for k in (0, 1):
        a = C[k] @ ARM
        # psi of each angle, in the axes of the block: heading about down, pitch about the level
        # right axis, roll about forward
        h = at.rpy[k, 2]
        sd = t.sigma[np.argmin(np.abs(t.time - at.time[k])), 6:]
        right = np.array([np.cos(h), -np.sin(h), 0.0])
        axes = np.column_stack([C[k][:, 0], right, [0.0, 0.0, -1.0]])
        lever = np.column_stack([np.cross(axes[:, j], a) for j in range(3)]) * sd
        B.append(np.hstack([NED.T @ np.diag([0.02, 0.02, 0.04]), lever]))
    assert pytest.approx(B[0] @ B[0].T, abs=8e-8) == P[4, :, 4]
    assert pytest.approx(rho * B[0] @ B[1].T, abs=8e-8) == P[4, :, 9]


def test_nothing_is_extrapolated_and_gaps_are_told(made, tmp_path) -> None:
    """Oracle: the exposures in a gap of 4 s, and those before the first row."""
    t = made.trajectory
    stamp = made.eo.time
    keep = (t.time > stamp[0] + 0.5) & ((t.time < stamp[5] - 2.0) | (t.time > stamp[5] + 2.0))
    path = tmp_path / "b"
    write(made, path)
    write_trajectory_csv(t[np.flatnonzero(keep)], path / "vehicle.csv")
    inputs = inputs_of(load_block(path), quiet)
    missing = sorted(set(made.sizes.images) - set(inputs.vehicle.images))
    assert missing == ["IMG_0000.jpg", "IMG_0005.jpg"]
    assert any(
        "2 of 16 exposures of the vehicle's target lie outside its rows or in a gap of more than 1"
        in note
        for note in inputs.notes
    )


# ---- names


def points_of(rows: list[tuple[str, str]]) -> ImagePoints:
    images = tuple(dict.fromkeys(i for i, _ in rows))
    points = tuple(dict.fromkeys(p for _, p in rows))
    n = len(rows)
    return ImagePoints(
        images,
        points,
        ImageObservations(
            np.array([images.index(i) for i, _ in rows]),
            np.array([points.index(p) for _, p in rows]),
            np.arange(2.0 * n).reshape(n, 2),
            np.ones((n, 2)),
        ),
    )


def test_one_name_in_all_images_is_divided_by_images() -> None:
    """Oracle: names by hand; tie points and pixels stay."""
    given = points_of([("a", "T1"), ("a", "KITE"), ("b", "KITE"), ("b", "T1"), ("c", "KITE")])
    got = observed_target(given, "KITE")
    assert got.images == ("a", "b", "c")
    assert got.points == ("KITE_a", "KITE_b", "KITE_c")
    assert got.divided == ("KITE",)
    assert got.measured.points == ("T1", "KITE_a", "KITE_b", "KITE_c")
    seen = got.measured.observations
    assert [got.measured.points[p] for p in seen.point] == [
        "T1",
        "KITE_a",
        "KITE_b",
        "T1",
        "KITE_c",
    ]
    assert seen.uv.tolist() == given.observations.uv.tolist()
    # of a prefix only what several images have is divided
    mixed = points_of([("a", "K_a"), ("b", "K_b"), ("c", "K_b")])
    got = observed_target(mixed, "K_")
    assert got.points == ("K_a", "K_b'", "K_c")
    assert observed_target(points_of([("a", "K_a"), ("b", "K_b")]), "K_").divided == ()


@pytest.mark.parametrize(
    ("rows", "target", "ground", "words"),
    [
        (
            [("a", "T1"), ("b", "T1")],
            "K_",
            (),
            "no point of the image observations begins with 'K_'",
        ),
        ([("a", "K_1"), ("b", "K_1")], "K_", ("K_1",), "'K_1' begins with 'K_' and is a ground"),
        ([("a", "P1"), ("a", "P2")], "P", (), "image 'a' sees 2 points that begin with 'P'"),
    ],
)
def test_names_that_cannot_be_a_vehicle_are_refused(rows, target, ground, words) -> None:
    """Oracle: the words."""
    with pytest.raises(InputError, match=words):
        observed_target(points_of(rows), target, ground)


@pytest.mark.slow
def test_a_block_whose_target_has_one_name_is_adjusted_and_says_so(made, tmp_path) -> None:
    """Oracle: the same block with a name an image."""
    seen, names = made.measured.observations, made.measured.points
    kite = np.array([name.startswith("K_") for name in names])
    kept = [name for name, k in zip(names, kite, strict=True) if not k]
    row = np.where(kite, len(kept), np.cumsum(~kite) - 1)
    one = ImagePoints(made.measured.images, (*kept, "KITE"), replace(seen, point=row[seen.point]))
    into = tmp_path / "b"
    write(made, into, VEHICLE + 'target = "KITE"\n')
    write_image_points(one, into / "image_points.csv")
    inputs = inputs_of(load_block(into), quiet)
    assert len(inputs.vehicle.images) == 16
    assert any("'KITE' of the vehicle had one name in several images" in n for n in inputs.notes)


# ---- words


def test_frames_of_lever_arms() -> None:
    """Oracle: what was done to [0.4, -0.25, -2.1]."""
    true, sigma = np.array([0.4, -0.25, -2.1]), np.full(3, 0.01)
    assert frame_of(true * (1, 1, -1), true, sigma) == "it was given upwards instead of down"
    assert frame_of(true[[1, 0, 2]], true, sigma) == "forward and right were exchanged"
    assert "east, north, up" in frame_of(np.array([-0.25, 0.4, 2.1]), true, sigma)
    assert frame_of(np.array([0.1, 0.1, 0.1]), true, sigma) == ""
    assert frame_of(np.zeros(3), true, sigma) == ""
    assert "left" in frame_of(true * (1, -1, 1), true, sigma)


def test_a_course_is_forward_right_down() -> None:
    """Oracle: a vehicle that drives east has south to its right; standing, it keeps its course."""
    C = along_course(np.array([[3.0, 0.0, 0.1], [0.0, 0.0, 0.0]]))
    assert pytest.approx(np.array([[1, 0, 0], [0, -1, 0], [0, 0, -1]]), abs=1e-15) == C[0]
    assert pytest.approx(C[0]) == C[1]


def test_options_that_do_not_go_together_are_refused(made, tmp_path, capsys) -> None:
    """Oracle: the words."""
    with pytest.raises(OptionError, match=r"size_m.*has no meaning without vehicle\.sizes"):
        VehicleTable(size_m=1.0)
    with pytest.raises(OptionError, match=r"target_m.*has no meaning without vehicle\.file"):
        VehicleTable(target_m=(0.0, 0.0, 0.0))
    file = write(made, tmp_path / "b", '[vehicle]\nfile = "vehicle.csv"\n')
    assert main(["adjust", str(file), "-q"]) == 3
    assert "vehicle.target_m (targets: --target-m) is missing" in capsys.readouterr().err


@pytest.mark.parametrize(("count", "refused"), [(3, False), (4, True)])
def test_sizes_of_another_target_are_refused_from_four_sightings_on(count, refused):
    """Oracle: f / distance of a target of half a metre, which is given as one of a metre."""
    options = SimpleNamespace(size_m=1.0, size_sigma_m=0.01, sizes="sizes.csv")
    camera = SimpleNamespace(of=lambda _: 5000.0)
    block = SimpleNamespace(cameras=[camera], camera=np.zeros(count, dtype=int))
    vehicle = SimpleNamespace(options=options, size_px=np.full(count, 25.0))
    refusal = pytest.raises(DataError, match=r"appears 0.5 times as large .* 0\.50 m fits")
    with refusal if refused else nullcontext():
        _refuse_sizes(vehicle, block, np.arange(count), np.full(count, 100.0))
