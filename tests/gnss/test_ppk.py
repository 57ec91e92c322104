"""From RINEX to antenna positions, events and files: a simulated flight with truth, a real moving
receiver, and the antenna files.
"""

import argparse
import json
import re
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import written_rinex as w
from written import image_positions

from insgnss.base.errors import DataError, InputError, UsageError
from insgnss.base.wording import spoken_as
from insgnss.cli import ppk as verb
from insgnss.flight.config.command_line import names_of
from insgnss.geodesy.frames import (
    LocalFrame,
    TangentPlane,
    ecef_to_geodetic,
    geodetic_to_ecef,
    rotation_en,
)
from insgnss.gnss import ppk
from insgnss.gnss.antenna_files import ALL, IMAGES_FILE, PLANE, positions_at, write_antenna_files
from insgnss.gnss.covariance_model import MODEL
from insgnss.gnss.engine.rtklib import EngineRun
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.ppk import PpkInput, solve_ppk
from insgnss.gnss.rinex.camera_events import RoverEvents
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.exposures.naming import ImageMatch
from insgnss.io.formats.gnss.gnss_text import read_gnss_text
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows
from insgnss.io.formats.read_options import ReadOptions
from insgnss.io.options.kinds import comma_numbers
from insgnss.records import CameraEvents, GnssFixes
from insgnss.report.charts.files import charts_of

DATA = Path(__file__).parents[3] / "shared" / "data"
RTK_BASE = (-3959400.631, 3385704.533, 3667523.111)


def recording(name):
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    if not (DATA / name).is_dir():
        pytest.skip(f"the recording {name} is not here")
    return DATA / name


def every_second(source, target):
    """Copy a RINEX 2.11 file with the epochs at full seconds and all event records."""
    lines = source.read_text().splitlines(keepends=True)
    end = next(k for k, text in enumerate(lines) if "END OF HEADER" in text) + 1
    out, k = lines[:end], end
    while k < len(lines):
        flag, count = int(lines[k][28]), int(lines[k][29:32])
        length = 1 + count if flag > 1 else 1 + (count - 1) // 12 + 2 * count
        if flag > 1 or float(lines[k][15:26]) % 1.0 == 0.0:
            out += lines[k : k + length]
        k += length
    target.write_text("".join(out))
    return target


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    """The simulated flight at 1 Hz, solved; and its truth."""
    place = recording("rinex_sim_6min")
    scratch = tmp_path_factory.mktemp("flown")
    rover = every_second(place / "rover.18o", scratch / "rover.18o")
    truth = np.load(place / "truth.npz")
    (scratch / "images.txt").write_text(
        "".join(f"{8001 + k}.tif\n" for k in range(truth["events"].size))
    )
    given = PpkInput(
        rover,
        place / "base.18o",
        (place / "brdc.18n", place / "brdc.18g"),
        EngineOptions(base_position_m=tuple(truth["rb"].tolist()), base_point="apc"),
        match=ImageMatch(scratch / "images.txt"),
    )
    steps = []
    return solve_ppk(given, scratch / "out", steps.append), truth, steps, given


def errors(fixes, truth):
    """Position and velocity errors (n, 3) north, east, down; the truth's own positions are 0.1 s
    apart and are interpolated by cubics.
    """
    from scipy.interpolate import CubicSpline

    C = rotation_en(fixes.lat, fixes.lon)
    place = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - CubicSpline(
        truth["tow"], truth["xyz"]
    )(fixes.time)
    true_velocity = np.einsum("nji,nj->ni", C, CubicSpline(truth["tow"], truth["vel"])(fixes.time))
    return np.einsum("nji,nj->ni", C, place), fixes.velocity_ned - true_velocity


def normalised(error, cov):
    return float(np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)) / 3.0)


@pytest.mark.slow
def test_positions_of_a_simulated_flight_are_as_good_as_their_sigmas(flown):
    """Oracle: the truth. Fix rate 99 %, none off by 10 cm, 3 mm horizontally and 10 mm in height,
    no height bias, NEES 0.5 to 2.
    """
    result, truth, _, _ = flown
    assert result.quality["fix_rate"] >= 0.99
    error, _ = errors(result.fixes, truth)
    assert np.abs(error).max() < 0.1
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert (rms < [0.0035, 0.0035, 0.010]).all(), rms
    assert abs(error[:, 2].mean()) < 0.003
    assert 0.5 < normalised(error, result.fixes.cov_ned) < 2.0


@pytest.mark.slow
def test_velocities_of_a_simulated_flight_are_as_good_as_their_sigmas(flown):
    """Oracle: the truth, whose sway 1 Hz does not resolve; the first and the last epoch have no
    velocity from phase, and say so: 1 m/s.
    """
    result, truth, _, _ = flown
    _, error = errors(result.fixes, truth)
    inner, cov = error[1:-1], result.fixes.velocity_cov_ned
    assert 0.1 < normalised(inner, cov[1:-1]) < 2.0
    assert np.sqrt(np.diagonal(cov, axis1=1, axis2=2))[[0, -1]].min() >= 1.0


def test_the_wet_delay_is_taken_off_and_told(flown):
    """Oracle: the truth; without the correction heights fall behind by 0.16 mm a metre."""
    result, truth, _, _ = flown
    check = next(check for check in result.checks if check.name == "GNSS wet delay")
    assert "mm per metre above the base" in check.found
    error, _ = errors(result.fixes, truth)
    rise = result.fixes.height - result.fixes.height.min()
    assert abs(np.polyfit(rise, error[:, 2], 1)[0]) < 8e-5


def test_events_have_the_names_of_the_images_and_their_times(flown):
    """Oracle: the truth of the simulation, its clock taken off the stamps; 1 Hz fixes interpolated
    by cubics.
    """
    result, truth, _, _ = flown
    assert result.events.images[0] == "8001.tif"
    clock = np.interp(truth["events"], truth["tow"], truth["dtr"])
    np.testing.assert_allclose(result.events.time, truth["events"] - clock, rtol=0.0, atol=1e-6)
    at, known = positions_at(result.fixes, result.events.time)
    assert known.all()
    error = geodetic_to_ecef(*at.T) - truth["events_xyz"]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.05


def test_progress_and_files_are_there(flown):
    """Oracle: the names that are promised."""
    result, _, steps, _ = flown
    first = next(step for step in steps if step.startswith("engine"))
    assert first == "engine: forward and backward solutions"
    assert {"reading observations", "wet delay", "velocity"} <= set(steps)
    runs = ("forward", "backward")
    options = (f"options of {run}" for run in runs)
    assert set(result.files) == {*runs, "combined", "solution", *options}
    assert all(
        path.stat().st_size > 1000 for path in result.files.values() if path.suffix == ".pos"
    )


def test_one_image_too_few_is_refused_before_the_engine_runs(flown, tmp_path):
    """Oracle: 73 events."""
    _, _, _, given = flown
    names = given.match.images.read_text().splitlines()
    (tmp_path / "images.txt").write_text("\n".join(names[:-1]) + "\n")
    steps = []
    with pytest.raises(InputError, match="73 camera events and 72 images"):
        solve_ppk(replace(given, match=ImageMatch(tmp_path / "images.txt")), tmp_path, steps.append)
    assert steps == ["reading observations"]


@pytest.fixture
def again(flown, monkeypatch):
    """Solve the simulated flight with other inputs from the engine's solutions that are
    there.
    """
    result, _, _, given = flown
    at = {name: result.files[name] for name in ("combined", "forward", "backward")}
    rows = {name: read_pos_rows(path) for name, path in at.items()}
    engine_run = EngineRun(
        **at, engine=result.engine, cpu_s=0.0, cpu_of={}, option_files={}, rows=rows
    )
    monkeypatch.setattr(ppk, "solve", lambda *_: engine_run)
    return lambda **changes: solve_ppk(replace(given, **changes))


def test_wet_delay_and_atmosphere_are_as_asked(flown, again):
    """Oracle: the zenith delay of the layer, 0.2 mm a metre over 100 m; dry air leaves out nothing,
    moist air twice as much as dry.
    """
    result, _, _, _ = flown
    without = again(wet_delay=False).fixes.height
    rise = result.fixes.height - result.fixes.height.min()
    high = rise > 0.8 * rise.max()
    raised = {
        share: (again(atmosphere={"humidity": share}).fixes.height - without)[high].mean()
        for share in (0.0, 0.35, 0.7)
    }
    assert 0.012 < (result.fixes.height - without)[high].mean() < 0.030
    assert raised[0.7] == pytest.approx(
        (result.fixes.height - without)[high].mean(), abs=1e-6
    )  # the standard's own
    assert abs(raised[0.0]) < 0.2 * raised[0.7]
    assert raised[0.35] == pytest.approx(0.5 * (raised[0.0] + raised[0.7]), abs=5e-4)
    assert "given atmosphere" in next(
        c.expected
        for c in again(atmosphere={"humidity": 0.35}).checks
        if c.name == "GNSS wet delay"
    )


def test_velocities_and_covariance_are_as_asked(flown, again):
    """Oracle: no velocity without it; variances that grow by the square of the floor."""
    result, _, _, _ = flown
    given = again(
        velocity=False, covariance=MODEL.with_changes({"floor_m": {"fixed": (0.1, 0.1, 0.2)}})
    )
    assert given.fixes.velocity_ned is None
    grown = np.diagonal(given.fixes.cov_ned - result.fixes.cov_ned, axis1=1, axis2=2)[
        result.fixes.quality == 1
    ]
    np.testing.assert_allclose(
        grown[10:-10], np.tile([0.01, 0.01, 0.04], (len(grown) - 20, 1)), rtol=2e-3
    )


def test_events_of_a_file_take_the_place_of_the_rovers(flown, again, tmp_path):
    """Oracle: the truth's times written as .MRK, and as a text without a week; one of another week
    is refused.
    """
    _, truth, _, _ = flown
    place = {week: tmp_path / f"{week}.MRK" for week in (2021, 2022)}
    for week, path in place.items():
        path.write_text(
            "".join(
                f"{k}\t{t:.6f}\t[{week}]\t0,N\t0,E\t0,V\n"
                for k, t in enumerate(truth["events"][:5], start=1)
            )
        )
    (tmp_path / "events.txt").write_text(
        "image tow\n" + "".join(f"{k}.tif {t:.7f}\n" for k, t in enumerate(truth["events"][:5]))
    )
    for path in (place[2021], tmp_path / "events.txt"):
        found = again(events=path, match=ImageMatch(), camera_delay_s=0.01).events
        np.testing.assert_allclose(found.time, truth["events"][:5] + 0.01, rtol=0.0, atol=1e-6)
    assert found.images[0] == "0.tif"
    with pytest.raises(
        InputError, match=r"2022\.MRK:1: the times are of GPS week 2022, but gps_week is 2021"
    ):
        again(events=place[2022], match=ImageMatch())
    with pytest.raises(InputError, match=r"5 camera events and 73 images"):
        again(events=place[2021])
    assert again(events=False).events is None
    assert again(match=ImageMatch()).events.images[0] == "1"


def test_events_of_a_file_are_held_against_those_of_the_rover(flown, again, tmp_path):
    """Oracle: the truth's times in GPST, its clock taken off; the same in UTC, 18 s less."""
    _, truth, _, _ = flown
    time = truth["events"] - np.interp(truth["events"], truth["tow"], truth["dtr"])
    found = {}
    for name, behind in (("gpst", 0.0), ("utc", 18.0)):
        place = tmp_path / f"{name}.txt"
        place.write_text(
            "image tow\n" + "".join(f"{k}.tif {t - behind:.7f}\n" for k, t in enumerate(time))
        )
        result = again(events=place, match=ImageMatch(), camera_delay_s=0.6)
        told = {check.name: check for check in result.checks}
        assert (told["camera delay"].verdict, told["camera delay"].found.split()[0]) == (
            "note",
            "+0.6",
        )
        found[name] = told["camera events"], result.verdict
    assert found["gpst"][0].verdict == "ok"
    assert "73 of the 73 events" in found["gpst"][0].found
    assert found["utc"][0].verdict == "contradiction"
    assert found["utc"][0].found.endswith("but for -18.000 s, the 18 leap seconds: UTC?")
    assert found["utc"][1].startswith("usable with care: 100.0 % of 361 epochs")
    assert "look at camera events" in found["utc"][1]


def test_epochs_that_the_engine_leaves_out_are_told(flown, monkeypatch, tmp_path):
    """Oracle: the combined solution without its second half, by hand; the rover has 361
    epochs, one a second.
    """
    result, _, _, given = flown
    lines = result.files["combined"].read_text().splitlines(keepends=True)
    head = sum(line.startswith("%") for line in lines)
    (tmp_path / "combined.pos").write_text("".join(lines[: head + 181]))
    at = {
        "forward": result.files["forward"],
        "backward": result.files["backward"],
        "combined": tmp_path / "combined.pos",
    }
    rows = {name: read_pos_rows(path) for name, path in at.items()}
    run = EngineRun(**at, engine="", cpu_s=0.0, cpu_of={}, option_files={}, rows=rows)
    monkeypatch.setattr(ppk, "solve", lambda *_: run)
    half = solve_ppk(given)
    assert half.verdict.startswith(
        "poor: 50.1 % of 361 epochs are fixed and confirmed, 180 have no solution"
    )
    told = next(check for check in half.checks if check.name == "GNSS epochs")
    assert (told.verdict, told.found) == (
        "note",
        "180 of 361 epochs have no solution, from 392881.0 s to 393060.0 s",
    )
    assert (half.quality["epochs"], half.quality["epochs_observed"], half.quality["unsolved"]) == (
        181,
        361,
        180,
    )
    assert half.quality["fix_rate"] == 1.0
    assert half.quality["fix_rate_observed"] == pytest.approx(181 / 361)


def test_a_point_of_the_base_that_nobody_chose_is_told(flown, again):
    """Oracle: the coordinates that the flight was made with."""
    result, truth, _, _ = flown
    told = next(check for check in result.checks if check.name == "base point")
    assert told.verdict == "ok"
    assert (
        told.found
        == f"{truth['base_llh'][0]:.9f},{truth['base_llh'][1]:.9f},{truth['base_llh'][2]:.4f},"
        f" {APC}"
    )
    assert result.verdict.startswith("good")
    assert "usable with care: 100.0 % of 361 epochs" in (
        doubted := again(base_point_chosen=False).verdict
    )
    assert "look at base point" in doubted


APC = "taken as the antenna's phase centre (apc)"


def test_an_image_too_few_is_found_by_the_images_own_times(flown, again, tmp_path):
    """Oracle: the missing picture, of events in the rover's file; Pillow writes the times."""
    image = pytest.importorskip("PIL.Image")
    _, truth, _, _ = flown
    for k, t in enumerate(np.delete(truth["events"], 30), start=1):
        exif = image.Exif()
        minute, milli = divmod(round(1000 * (t - truth["events"][0])), 60000)
        written = {
            0x9003: f"2018:10:04 12:{minute:02d}:{milli // 1000:02d}",
            0x9291: f"{milli % 1000:03d}",
        }
        exif.get_ifd(0x8769).update(written)
        image.new("L", (1, 1)).save(tmp_path / f"{k}.jpg", exif=exif)
    with pytest.raises(
        InputError,
        match=(
            r"73 camera events and 72 images.* no image belongs to event 31; .* camera\.skip_events"
            r" = \[31\]"
        ),
    ):
        again(match=ImageMatch(tmp_path))
    assert len(again(match=ImageMatch(tmp_path, skip_events=(31,))).events.images) == 72


def test_events_of_the_rover_are_told_or_later_as_asked(flown, again, tmp_path):
    """Oracle: the same events ten milliseconds later; of a copy of the rover's file whose events
    are all marked as not valid a note.
    """
    result, _, _, given = flown
    np.testing.assert_allclose(
        again(camera_delay_s=0.01).events.time, result.events.time + 0.01, rtol=0.0, atol=1e-9
    )
    lines = given.rover.read_text().splitlines(keepends=True)
    marked = [
        f"{line[:29]}  1\n{INVALID[0].rstrip()}\n" if line[26:32] == "  5  0" else line
        for line in lines
    ]
    (tmp_path / "rover.18o").write_text("".join(marked))
    left_out = again(rover=tmp_path / "rover.18o", match=ImageMatch())
    assert left_out.events is None
    assert "73 of 73 are marked as not valid" in next(
        check.found for check in left_out.checks if check.name == "time marks"
    )


def rover_with(tmp_path, *records):
    """Observations with an epoch a second and an event with each of the records."""
    text = w.header3({"G": ["C1C"]})
    for k in range(10):
        text += w.epoch3((2018, 10, 4, 12, 0, float(k)), {"G01": [2e7]})
        text += w.event3((2018, 10, 4, 12, 0, k + 0.5), 5, records[k]) if k < len(records) else ""
    path = tmp_path / "rover.rnx"
    path.write_text(text)
    return read_observations(path)


ONE = [w.record("shot", "COMMENT")]
INVALID = [w.record(" Time mark is not valid", "COMMENT")]


@pytest.mark.parametrize(
    ("records", "asked_for", "message"),
    [
        ([], {"camera_delay_s": 0.01}, r"rover\.rnx: holds no external event"),
        ([], {"match": ImageMatch(skip_events=(1,))}, "holds no external event"),
        ([], {"rover_events": RoverEvents(invalid_events=True)}, "holds no external event"),
        (
            [ONE],
            {"rover_events": RoverEvents("shto")},
            "no external event has a record line with 'shto'",
        ),
        (
            [INVALID],
            {"camera_delay_s": 0.01},
            r"rover\.rnx:\d+: camera events: 1 of 1 are marked as not valid",
        ),
        ([ONE], {"camera_delay_s": 100.0}, "give it in seconds"),
    ],
)
def test_what_is_said_of_events_asks_for_them(tmp_path, records, asked_for, message):
    """Oracle: the file and the one wish that differs from the defaults."""
    rover = rover_with(tmp_path, *records)
    given = PpkInput(Path("rover.rnx"), Path("b.obs"), (Path("n.nav"),), **asked_for)
    with pytest.raises((InputError, UsageError), match=message) as refused:
        ppk._events(given, rover)
    assert "\n" not in str(refused.value)
    assert ppk._events(replace(given, events=False, camera_delay_s=0.0), rover) == (None, ())


def test_events_that_are_all_invalid_are_left_out_with_a_note(tmp_path):
    """Oracle: the file; nothing is said of events, so that there need not be any, but what there is
    is told.
    """
    given = PpkInput(Path("rover.rnx"), Path("b.obs"), (Path("n.nav"),))
    events, (told,) = ppk._events(given, rover_with(tmp_path, INVALID, INVALID))
    assert events is None
    assert told.verdict == "note"
    assert told.found.startswith("2 of 2 are marked as not valid by the receiver")
    assert ppk._events(given, rover_with(tmp_path)) == (None, ())
    assert ppk._events(given, rover_with(tmp_path, ONE))[0].images == ("1",)


def test_the_clock_is_that_of_the_stamp_and_not_of_the_exposure(tmp_path):
    """Oracle: closed form. The clock is 0.5 ms ahead and jumps to -0.5 ms at the epoch of 5 s; an
    event stamped 4.95 s, with a delay of 0.1 s, is exposed at 4.95 - 0.0005 + 0.1 s, and one of a
    file of events, in GPST, at 4.95 + 0.1 s."""
    rover = rover_with(tmp_path)
    time = rover.time - np.where(rover.time - rover.time[0] < 4.5, 5e-4, -5e-4)
    n = time.size
    fixes = GnssFixes(
        time,
        np.full(n, 0.8),
        np.full(n, 0.1),
        np.full(n, 500.0),
        np.tile(np.eye(3), (n, 1, 1)),
        gps_week=rover.gps_week,
    )
    stamps = CameraEvents(("a",), rover.time[:1] + 4.95, rover.gps_week)
    given = PpkInput(Path("rover.rnx"), Path("b.obs"), (Path("n.nav"),), camera_delay_s=0.1)
    assert ppk._at_exposures(stamps, given, rover, fixes).time[0] - rover.time[0] == pytest.approx(
        5.0495, abs=1e-9
    )
    other = ppk._at_exposures(stamps, replace(given, events=Path("x.MRK")), rover, fixes)
    assert other.time[0] - rover.time[0] == pytest.approx(5.05, abs=1e-9)


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """A real moving receiver through the verb."""
    place = recording("cssrlib_rtk")
    lat, lon, height = ecef_to_geodetic(np.array(RTK_BASE))
    position = f"{np.degrees(lat):.12f},{np.degrees(lon):.12f},{height:.5f}"
    out = tmp_path_factory.mktemp("moved") / "out"
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    words = [
        place / "SEPT265G.21O",
        "--base",
        place / "3034265G.21O",
        "--navigation",
        place / "SEPT2650.21P",
    ]
    return (
        verb.ppk(
            parser.parse_args([*map(str, words), "--base-position", position, "--out", str(out)]),
            lambda _: None,
        ),
        out,
    )


@pytest.mark.slow
def test_a_real_moving_receiver_is_fixed(moved):
    """Oracle: the bar of 97 %; others get 344 of 360 with an earlier version of the engine."""
    run, _ = moved
    assert run.result.quality["fix_rate"] >= 0.97
    assert run.result.quality["epochs"] == 360


def test_the_verb_writes_positions_figure_and_document(moved):
    """Oracle: the readers of the written formats."""
    run, out = moved
    fixes = read_gnss_text(out / ALL, ReadOptions(gps_week=2176))
    assert np.allclose(fixes.height, run.result.fixes.height, atol=1e-4)
    document = json.loads((out / "ppk.json").read_text())
    assert document["verdict"] == run.result.verdict
    assert document["quality"]["epochs"] == 360
    assert document["input"]["options"]["base_point"] == "apc"
    assert (out / "gnss_quality.png").read_bytes().startswith(b"\x89PNG")
    _, charts = charts_of(out / "ppk.json")
    assert [chart.name for chart in charts] == ["gnss-solution", "gnss-signals"]
    assert run.summary().startswith(run.result.verdict)
    assert {path.name for path in run.files} == {path.name for path in out.iterdir()}


def asked(*words):
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    return verb.input_of(
        parser.parse_args(["r.obs", "--base", "b.obs", "--navigation", "n.nav", *map(str, words)])
    )


def test_the_verb_asks_for_no_more_than_the_defaults():
    """Oracle: the defaults of `PpkInput`."""
    assert asked() == PpkInput(Path("r.obs"), Path("b.obs"), (Path("n.nav"),))


def test_the_verb_tells_what_nobody_chose():
    """Oracle: the words of the command line."""
    place = "--base-position=46.5,6.5,400"
    assert not asked(place).base_point_chosen
    assert asked(place, "--base-point", "apc").base_point_chosen
    assert asked(place).options == asked(place, "--base-point", "apc").options


def test_the_verb_has_the_options_of_the_flight_file(tmp_path):
    """Oracle: the words of the command line."""
    (tmp_path / "covariance.toml").write_text("ppm = 2\n[scale]\nfixed = [1.5, 1.5, 2]\n")
    words = [
        "--max-age",
        5,
        "--acceleration",
        6,
        2,
        "--rtklib-options",
        "pos2-arminfix=10",
        "--covariance",
        tmp_path / "covariance.toml",
    ]
    given = asked(
        *words,
        "--timeout",
        90,
        "--pressure",
        955,
        "--humidity",
        0.4,
        "--no-velocity",
        "--events",
        "x.MRK",
    )
    options = given.options
    assert (options.max_age_s, options.acceleration_mps2, options.rtklib_options) == (
        5.0,
        (6.0, 2.0),
        {"pos2-arminfix": "10"},
    )
    assert options.timeout_s == 90.0
    assert given.covariance == MODEL.with_changes({"ppm": 2.0, "scale": {"fixed": (1.5, 1.5, 2.0)}})
    assert (given.atmosphere, given.velocity) == ({"pressure_hpa": 955.0, "humidity": 0.4}, False)
    assert given.events == Path("x.MRK")
    assert not asked("--no-wet-delay").wet_delay
    for option in ("--no-wet-delay", "--no-ionosphere"):  # the other one takes the air
        assert asked("--humidity", 0.4, option).atmosphere == {"humidity": 0.4}
    assert (asked().ionosphere, asked("--no-ionosphere").ionosphere) == (True, False)
    given = asked(
        "--images",
        "photos",
        "--image-ending",
        "tif",
        "--skip-events",
        3,
        5,
        "--events-containing",
        "cam",
        "--invalid-events",
    )
    assert given.match == ImageMatch(Path("photos"), "tif", (3, 5))
    assert given.rover_events == RoverEvents("cam", True)


ENGINE_OPTIONS = {
    "--mask": "elevation_mask_deg",
    "--frequencies": "frequencies",
    "--ratio": "ratio",
    "--max-age": "max_age_s",
}
ENGINE_OPTIONS |= {"--timeout": "timeout_s", "--acceleration": "acceleration_mps2"}


def test_the_help_tells_the_defaults_of_the_engine():
    """Oracle: the fields of `EngineOptions`."""
    parser, usual = argparse.ArgumentParser(), EngineOptions()
    verb.add_arguments(parser)
    options = " ".join(parser.format_help().split()).partition("options:")[2]
    told = {
        name: re.search(rf"{name} .*?\(default: (.*?)\)", options)[1].split()
        for name in ENGINE_OPTIONS
    }
    for name, field in ENGINE_OPTIONS.items():
        assert [float(number) for number in told[name]] == np.ravel(
            getattr(usual, field)
        ).tolist(), name


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--humidity", 40], "--humidity 40.0: must be 0 to 1"),
        (
            ["--humidity", 0.4, "--no-wet-delay", "--no-ionosphere"],
            "--humidity have no effect with --no-wet-delay and --no-ionosphere",
        ),
        (["--rtklib-options", "arminfix"], "'arminfix' is no NAME=VALUE"),
        (
            ["--rtklib-options", "pos2-arminfix=1", "pos2-arminfix=2"],
            "--rtklib-options: gives pos2-arminfix 2 times",
        ),
        (
            ["--rtklib-options", "pos2-arminfix=1", "--rtklib-options", "pos2-arminfix=2"],
            "--rtklib-options: gives pos2-arminfix 2 times",
        ),
        (["--max-age", -1], r"--max-age -1\.0: must be 0\.01 to 3600"),
        (["--timeout", 0.1], r"--timeout 0\.1: must be 1 to"),
        (["--systems", ""], "--systems '': must be letters of"),
        (["--acceleration", 0, 1], "must be two numbers greater than zero"),
        (
            ["--events", "x.MRK", "--events-containing", "cam"],
            "--events-containing selects among .* --events gives another file",
        ),
        (
            ["--events", "x.MRK", "--invalid-events"],
            "--invalid-events selects among .* --events gives another file",
        ),
        (["--image-ending", ".tif"], "--image-ending: has no meaning without --images; give both"),
        (["--skip-images", "a.tif"], "--skip-images: has no meaning without --images; give both"),
    ],
)
def test_words_that_contradict_are_refused(words, what):
    """Oracle: the ranges that the help names."""
    with spoken_as(names_of()), pytest.raises(UsageError, match=what):
        asked(*words)


@pytest.mark.parametrize("option", ["ROVER", "--base", "--navigation", "--antex", "--events"])
def test_a_file_that_is_not_there_is_named_by_its_option(option, tmp_path):
    """Oracle: the words of the command line; nothing is made."""
    words = {
        "ROVER": ["r"],
        "--base": ["b"],
        "--navigation": ["n", "g"],
        "--antex": ["a"],
        "--events": ["e"],
    }
    for name in (name for names in words.values() for name in names):
        (tmp_path / name).write_text("RINEX\n")
    (tmp_path / words[option][-1]).unlink()
    line = [
        str(word)
        for key, names in words.items()
        for word in ([key] if key != "ROVER" else []) + [tmp_path / name for name in names]
    ]
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    with pytest.raises(
        InputError, match=rf"^ppk: {option} .*{words[option][-1]} does not exist; check the path$"
    ):
        verb.ppk(parser.parse_args([*line, "--out", str(tmp_path / "out")]), lambda _: None)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [
        ("ppm = -1\n", 1, "from 0 to 1000"),
        ("[scale]\nflaot = 3\n", 2, "did you mean 'float'"),
        ("\ngate = 'x'\n", 2, "must be a number"),
        ("# mine\n[gnss.covariance]\nppm = 2\n", 2, "write its keys at the top"),
        ("[covariance]\nppm = 2\n", 1, "write its keys at the top"),
        ("\ngnss.covariance.ppm = 2\n", 2, "write its keys at the top"),
    ],
)
def test_a_wrong_covariance_file_is_refused_with_its_line(tmp_path, text, line, what):
    """Oracle: line and reason written by hand."""
    path = tmp_path / "c.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=rf"c\.toml:{line}: .*{what}"):
        asked("--covariance", path)
    with pytest.raises(InputError, match="does not exist; give a TOML file"):
        asked("--covariance", tmp_path / "other.toml")


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("46.5,6.5", r"= \(46.5, 6.5\): must be latitude, longitude"),
        ("139.4,35.3,40", "swapped"),
        ("46.5,six,400", "= '46.5,six,400': must be latitude, .*; such as 46.57"),
        ("46.5,6.5,40000", "order and units"),
    ],
)
def test_a_place_that_is_none_is_refused(text, word):
    """Oracle: the ranges of latitude, longitude and height."""
    with pytest.raises(UsageError, match=word):
        verb.geodetic_position(comma_numbers(text), "gnss.base_position")


FRAME = LocalFrame(np.radians(46.57), np.radians(6.54), 500.0)


def circling(time, radius=15.0, speed=10.0):
    """Fixes on a circle, and their positions (n, 3) in the local frame."""
    angle = speed / radius * time
    place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -50.0 - 0.1 * time])
    lat, lon, height = FRAME.geodetic_from_position(place)
    return (
        GnssFixes(
            time,
            lat,
            lon,
            height,
            np.broadcast_to(np.eye(3) * 1e-4, (time.size, 3, 3)),
            gps_week=2008,
        ),
        place,
    )


def test_positions_between_fixes_follow_the_turn():
    """Oracle: the circle itself; (3/128) h^4 of the fourth derivative is 7 micrometres at 10 Hz."""
    fixes, _ = circling(0.1 * np.arange(300))
    when = np.linspace(0.3, 29.0, 97)
    at, known = positions_at(fixes, when)
    assert known.all()
    assert np.abs(FRAME.position_from_geodetic(*at.T) - circling(when)[1]).max() < 1.5e-5


def test_no_position_is_made_up_in_a_gap_or_outside():
    """Oracle: three seconds of fixes left out; beside the gap the line between two fixes is taken,
    12 mm off at most.
    """
    time = 0.1 * np.arange(300)
    fixes, _ = circling(time[(time < 10.05) | (time > 13.05)])
    when = np.array([-0.1, 9.95, 10.5, 13.0, 13.15, 29.95])
    at, known = positions_at(fixes, when)
    assert known.tolist() == [False, True, False, False, True, False]
    assert np.isnan(at[~known]).all()
    assert (
        np.abs(FRAME.position_from_geodetic(*at[known].T) - circling(when[known])[1]).max() < 0.012
    )


def test_the_three_antenna_files_agree(tmp_path):
    """Oracle: the tangent plane's transformation of the geographic file (formats.md A.7); images in
    a gap are told, not written.
    """
    time = 0.1 * np.arange(300)
    fixes, _ = circling(time[(time < 10.05) | (time > 13.05)])
    events = CameraEvents(("8001.tif", "8002.tif", "8003.tif"), np.array([5.03, 11.0, 20.07]), 2008)
    origin = np.array([np.radians(46.57), np.radians(6.54), 0.0])
    files, missing = write_antenna_files(fixes, events, tmp_path, origin)
    assert [path.name for path in files] == [ALL, IMAGES_FILE, PLANE]
    (images, geodetic), (plane_images, plane) = (
        image_positions(tmp_path / IMAGES_FILE),
        image_positions(tmp_path / PLANE),
    )
    assert images == plane_images == ("8001.tif", "8003.tif")
    assert np.abs(TangentPlane(*origin).position_from_geodetic(*geodetic.T) - plane).max() < 2e-4
    assert "1 of 3 images" in missing.found
    assert "8002.tif" in missing.found


def test_exposures_of_another_flight_are_refused(tmp_path):
    """Oracle: times a day off."""
    fixes, _ = circling(0.1 * np.arange(300))
    with pytest.raises(DataError, match="none of the 1 exposures"):
        write_antenna_files(fixes, CameraEvents(("1",), np.array([86405.0]), 2008), tmp_path)
