"""From RINEX to antenna positions, events and files: a simulated flight with truth, a real moving receiver, and the antenna files."""

import argparse
import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from insgnss.errors import DataError, InputError, UsageError
from insgnss.formats.gnss_text import read_gnss_text, read_image_positions
from insgnss.geodesy.frames import LocalFrame, TangentPlane, ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss import ppk, verb
from insgnss.gnss.antenna_files import ALL, IMAGES, PLANE, positions_at, write_antenna_files
from insgnss.gnss.covariance import MODEL
from insgnss.gnss.engine import EngineRun
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.ppk import PpkInput, solve_ppk
from insgnss.records import CameraEvents, GnssFixes
from insgnss.report.gnss import draw_quality

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
    (scratch / "images.txt").write_text("".join(f"{8001 + k}.tif\n" for k in range(truth["events"].size)))
    given = PpkInput(
        rover,
        place / "base.18o",
        (place / "brdc.18n", place / "brdc.18g"),
        EngineOptions(base_position_m=tuple(truth["rb"].tolist()), base_point="apc"),
        images=scratch / "images.txt",
    )
    steps = []
    return solve_ppk(given, scratch / "out", steps.append), truth, steps, given


def errors(fixes, truth):
    """Position and velocity errors (n, 3) north, east, down; the truth's own positions are 0.1 s apart and are interpolated by cubics."""
    from scipy.interpolate import CubicSpline

    C = rotation_en(fixes.lat, fixes.lon)
    place = geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height) - CubicSpline(truth["tow"], truth["xyz"])(fixes.time)
    true_velocity = np.einsum("nji,nj->ni", C, CubicSpline(truth["tow"], truth["vel"])(fixes.time))
    return np.einsum("nji,nj->ni", C, place), fixes.velocity_ned - true_velocity


def normalised(error, cov):
    return float(np.mean(np.einsum("ni,nij,nj->n", error, np.linalg.inv(cov), error)) / 3.0)


def test_positions_of_a_simulated_flight_are_as_good_as_their_sigmas(flown):
    """Oracle: the truth. Fix rate 99 %, none off by 10 cm, 3 mm horizontally and 10 mm in height, no height bias, NEES 0.5 to 2."""
    result, truth, _, _ = flown
    assert result.quality["fix_rate"] >= 0.99
    error, _ = errors(result.fixes, truth)
    assert np.abs(error).max() < 0.1
    rms = np.sqrt(np.mean(error**2, axis=0))
    assert (rms < [0.0035, 0.0035, 0.010]).all(), rms
    assert abs(error[:, 2].mean()) < 0.003
    assert 0.5 < normalised(error, result.fixes.cov_ned) < 2.0


def test_velocities_of_a_simulated_flight_are_as_good_as_their_sigmas(flown):
    """Oracle: the truth, whose sway 1 Hz does not resolve; the first and the last epoch have no velocity from phase, and say so: 1 m/s."""
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
    """Oracle: the truth of the simulation; 1 Hz fixes interpolated by cubics."""
    result, truth, _, _ = flown
    assert result.events.images[0] == "8001.tif"
    assert np.allclose(result.events.time, truth["events"], atol=1e-6)
    at, known = positions_at(result.fixes, result.events.time)
    assert known.all()
    error = geodetic_to_ecef(*at.T) - truth["events_xyz"]
    assert np.sqrt(np.mean(np.sum(error**2, axis=1))) < 0.05


def test_progress_and_files_are_there(flown):
    """Oracle: the names that are promised."""
    result, _, steps, _ = flown
    assert next(step for step in steps if step.startswith("engine")) == "engine: three solutions"
    assert {"reading observations", "wet delay", "velocity"} <= set(steps)
    assert set(result.files) == {"combined", "forward", "backward", "solution"}
    assert all(path.stat().st_size > 1000 for path in result.files.values())


def test_one_image_too_few_is_refused_before_the_engine_runs(flown, tmp_path):
    """Oracle: 73 events."""
    _, _, _, given = flown
    names = given.images.read_text().splitlines()
    (tmp_path / "images.txt").write_text("\n".join(names[:-1]) + "\n")
    steps = []
    with pytest.raises(InputError, match="73 camera events and 72 images"):
        solve_ppk(replace(given, images=tmp_path / "images.txt"), tmp_path, steps.append)
    assert steps == ["reading observations"]


@pytest.fixture
def again(flown, monkeypatch):
    """Solve the simulated flight with other inputs from the engine's three solutions that are there."""
    result, _, _, given = flown
    at = {name: result.files[name] for name in ("combined", "forward", "backward")}
    engine_run = EngineRun(**at, engine=result.engine, cpu_s=0.0, cpu_of={}, option_files={})
    monkeypatch.setattr(ppk, "solve", lambda *_: engine_run)
    return lambda **changes: solve_ppk(replace(given, **changes))


def test_wet_delay_and_atmosphere_are_as_asked(flown, again):
    """Oracle: the zenith delay of the layer, 0.2 mm a metre over 100 m; dry air leaves out nothing, moist air twice as much as dry."""
    result, _, _, _ = flown
    without = again(wet_delay=False).fixes.height
    rise = result.fixes.height - result.fixes.height.min()
    high = rise > 0.8 * rise.max()
    raised = {share: (again(atmosphere={"humidity": share}).fixes.height - without)[high].mean() for share in (0.0, 0.35, 0.7)}
    assert 0.012 < (result.fixes.height - without)[high].mean() < 0.030
    assert raised[0.7] == pytest.approx((result.fixes.height - without)[high].mean(), abs=1e-6)  # the standard's own
    assert abs(raised[0.0]) < 0.2 * raised[0.7]
    assert raised[0.35] == pytest.approx(0.5 * (raised[0.0] + raised[0.7]), abs=5e-4)
    assert "given atmosphere" in next(c.expected for c in again(atmosphere={"humidity": 0.35}).checks if c.name == "GNSS wet delay")


def test_velocities_and_covariance_are_as_asked(flown, again):
    """Oracle: no velocity without it; variances that grow by the square of the floor."""
    result, _, _, _ = flown
    given = again(velocity=False, covariance=MODEL.with_changes({"floor_m": {"fixed": (0.1, 0.1, 0.2)}}))
    assert given.fixes.velocity_ned is None
    grown = np.diagonal(given.fixes.cov_ned - result.fixes.cov_ned, axis1=1, axis2=2)[result.fixes.quality == 1]
    np.testing.assert_allclose(grown[10:-10], np.tile([0.01, 0.01, 0.04], (len(grown) - 20, 1)), rtol=2e-3)


def test_events_of_a_file_take_the_place_of_the_rovers(flown, again, tmp_path):
    """Oracle: the truth's times written as .MRK, and as a text without a week; one of another week is refused."""
    _, truth, _, _ = flown
    place = {week: tmp_path / f"{week}.MRK" for week in (2021, 2022)}
    for week, path in place.items():
        path.write_text("".join(f"{k}\t{t:.6f}\t[{week}]\t0,N\t0,E\t0,V\n" for k, t in enumerate(truth["events"][:5], start=1)))
    (tmp_path / "events.txt").write_text("image tow\n" + "".join(f"{k}.tif {t:.7f}\n" for k, t in enumerate(truth["events"][:5])))
    for path in (place[2021], tmp_path / "events.txt"):
        found = again(events=path, images=None, camera_delay_s=0.01).events
        np.testing.assert_allclose(found.time, truth["events"][:5] + 0.01, rtol=0.0, atol=1e-6)
    assert found.images[0] == "0.tif"
    with pytest.raises(InputError, match=r"2022\.MRK:1: GPS week 2022, but the flight is said to be of week 2021"):
        again(events=place[2022], images=None)
    with pytest.raises(InputError, match=r"5 camera events and 73 images"):
        again(events=place[2021])
    assert again(events=False).events is None
    assert again(images=None).events.images[0] == "1"


def test_an_image_too_few_is_found_by_the_images_own_times(flown, again, tmp_path):
    """Oracle: the picture that is missing, of events in the rover's file; Pillow writes the times."""
    image = pytest.importorskip("PIL.Image")
    _, truth, _, _ = flown
    for k, t in enumerate(np.delete(truth["events"], 30), start=1):
        exif = image.Exif()
        minute, milli = divmod(round(1000 * (t - truth["events"][0])), 60000)
        written = {0x9003: f"2018:10:04 12:{minute:02d}:{milli // 1000:02d}", 0x9291: f"{milli % 1000:03d}"}
        exif.get_ifd(0x8769).update(written)
        image.new("L", (1, 1)).save(tmp_path / f"{k}.jpg", exif=exif)
    with pytest.raises(InputError, match=r"73 camera events and 72 images.* no image belongs to event 31; .* skip_events = \[31\]"):
        again(images=tmp_path)
    assert len(again(images=tmp_path, skip_events=(31,)).events.images) == 72


@pytest.fixture(scope="module")
def moved(tmp_path_factory):
    """A real moving receiver through the verb."""
    place = recording("cssrlib_rtk")
    lat, lon, height = ecef_to_geodetic(np.array(RTK_BASE))
    position = f"{np.degrees(lat):.12f},{np.degrees(lon):.12f},{height:.5f}"
    out = tmp_path_factory.mktemp("moved") / "out"
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    words = [place / "SEPT265G.21O", "--base", place / "3034265G.21O", "--navigation", place / "SEPT2650.21P"]
    return verb.ppk(
        parser.parse_args([*map(str, words), "--base-position", position, "--out", str(out)]), lambda _: None, draw_quality
    ), out


def test_a_real_moving_receiver_is_fixed(moved):
    """Oracle: the bar of 97 %; others get 344 of 360 with an earlier version of the engine."""
    run, _ = moved
    assert run.result.quality["fix_rate"] >= 0.97
    assert run.result.quality["epochs"] == 360


def test_the_verb_writes_positions_figure_and_document(moved):
    """Oracle: the readers of the written formats."""
    run, out = moved
    fixes = read_gnss_text(out / ALL, gps_week=2176)
    assert np.allclose(fixes.height, run.result.fixes.height, atol=1e-4)
    document = json.loads((out / "ppk.json").read_text())
    assert document["verdict"] == run.result.verdict
    assert document["quality"]["epochs"] == 360
    assert document["input"]["options"]["base_point"] == "apc"
    assert (out / "gnss_quality.png").read_bytes().startswith(b"\x89PNG")
    assert run.summary().startswith(run.result.verdict)
    assert {path.name for path in run.files} == {path.name for path in out.iterdir()} - {"combined.conf", "forward.conf", "backward.conf"}


def asked(*words):
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    return verb.input_of(parser.parse_args(["r.obs", "--base", "b.obs", "--navigation", "n.nav", *map(str, words)]))


def test_the_verb_asks_for_no_more_than_the_defaults():
    """Oracle: the defaults of `PpkInput`."""
    assert asked() == PpkInput(Path("r.obs"), Path("b.obs"), (Path("n.nav"),))


def test_the_verb_has_the_options_of_the_flight_file(tmp_path):
    """Oracle: the words of the command line."""
    (tmp_path / "covariance.toml").write_text("ppm = 2\n[scale]\nfixed = [1.5, 1.5, 2]\n")
    words = ["--max-age", 5, "--acceleration", 6, 2, "--more", "pos2-arminfix=10", "--covariance", tmp_path / "covariance.toml"]
    given = asked(*words, "--pressure", 955, "--humidity", 0.4, "--no-velocity", "--events", "x.MRK")
    options = given.options
    assert (options.max_age_s, options.acceleration_mps2, options.more) == (5.0, (6.0, 2.0), {"pos2-arminfix": "10"})
    assert given.covariance == MODEL.with_changes({"ppm": 2.0, "scale": {"fixed": (1.5, 1.5, 2.0)}})
    assert (given.atmosphere, given.velocity) == ({"pressure_hpa": 955.0, "humidity": 0.4}, False)
    assert given.events == Path("x.MRK")
    assert not asked("--no-wet-delay").wet_delay


@pytest.mark.parametrize(
    ("words", "what"),
    [
        (["--humidity", 40], r"atmosphere\.humidity: 40 is outside 0 to 1"),
        (["--humidity", 0.4, "--no-wet-delay"], "--no-wet-delay is given as well"),
        (["--more", "arminfix"], "'arminfix' is no NAME=VALUE"),
        (["--max-age", -1], r"max_age_s = -1\.0: must be"),
        (["--acceleration", 0, 1], "must be two positive numbers"),
        (["--events", "x.MRK", "--events-containing", "cam"], "--events is given as well"),
    ],
)
def test_words_that_contradict_are_refused(words, what):
    """Oracle: the ranges that the help names."""
    with pytest.raises(UsageError, match=what):
        asked(*words)


@pytest.mark.parametrize(
    ("text", "line", "what"),
    [("ppm = -1\n", 1, "from 0 to 1000"), ("[scale]\nflaot = 3\n", 2, "did you mean 'float'"), ("\ngate = 'x'\n", 2, "is a text")],
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
    [("46.5,6.5", "no LAT,LON,H"), ("139.4,35.3,40", "swapped"), ("46.5,six,400", "no LAT,LON,H"), ("46.5,6.5,40000", "order and units")],
)
def test_a_place_that_is_none_is_refused(text, word):
    """Oracle: the ranges of latitude, longitude and height."""
    with pytest.raises(UsageError, match=word):
        verb.place(text, "--base-position")


FRAME = LocalFrame(np.radians(46.57), np.radians(6.54), 500.0)


def circling(time, radius=15.0, speed=10.0):
    """Fixes on a circle, and their positions (n, 3) in the local frame."""
    angle = speed / radius * time
    place = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), -50.0 - 0.1 * time])
    lat, lon, height = FRAME.geodetic_from_position(place)
    return GnssFixes(time, lat, lon, height, np.broadcast_to(np.eye(3) * 1e-4, (time.size, 3, 3)), gps_week=2008), place


def test_positions_between_fixes_follow_the_turn():
    """Oracle: the circle itself; (3/128) h^4 of the fourth derivative is 7 micrometres at 10 Hz."""
    fixes, _ = circling(0.1 * np.arange(300))
    when = np.linspace(0.3, 29.0, 97)
    at, known = positions_at(fixes, when)
    assert known.all()
    assert np.abs(FRAME.position_from_geodetic(*at.T) - circling(when)[1]).max() < 1.5e-5


def test_no_position_is_made_up_in_a_gap_or_outside():
    """Oracle: three seconds of fixes left out; beside the gap the line between two fixes is taken, 12 mm off at most."""
    time = 0.1 * np.arange(300)
    fixes, _ = circling(time[(time < 10.05) | (time > 13.05)])
    when = np.array([-0.1, 9.95, 10.5, 13.0, 13.15, 29.95])
    at, known = positions_at(fixes, when)
    assert known.tolist() == [False, True, False, False, True, False]
    assert np.isnan(at[~known]).all()
    assert np.abs(FRAME.position_from_geodetic(*at[known].T) - circling(when[known])[1]).max() < 0.012


def test_the_three_antenna_files_agree(tmp_path):
    """Oracle: the tangent plane's transformation of the geographic file (formats.md A.7); images in a gap are told, not written."""
    time = 0.1 * np.arange(300)
    fixes, _ = circling(time[(time < 10.05) | (time > 13.05)])
    events = CameraEvents(("8001.tif", "8002.tif", "8003.tif"), np.array([5.03, 11.0, 20.07]), 2008)
    origin = np.array([np.radians(46.57), np.radians(6.54), 0.0])
    files, missing = write_antenna_files(fixes, events, tmp_path, origin)
    assert [path.name for path in files] == [ALL, IMAGES, PLANE]
    geodetic, plane = read_image_positions(tmp_path / IMAGES), read_image_positions(tmp_path / PLANE)
    assert geodetic.images == plane.images == ("8001.tif", "8003.tif")
    assert np.abs(TangentPlane(*origin).position_from_geodetic(*geodetic.position.T) - plane.position).max() < 2e-4
    assert "1 of 3 images" in missing.found
    assert "8002.tif" in missing.found


def test_exposures_of_another_flight_are_refused(tmp_path):
    """Oracle: times a day off."""
    fixes, _ = circling(0.1 * np.arange(300))
    with pytest.raises(DataError, match="none of the 1 exposures"):
        write_antenna_files(fixes, CameraEvents(("1",), np.array([86405.0]), 2008), tmp_path)
