"""What the verb ppk says and refuses: in its own words, and before it takes the place of a file."""

import argparse

import numpy as np
import pytest

from insgnss.base.wording import setting, spell, spoken_as
from insgnss.cli import build_parser, main
from insgnss.cli import ppk as verb
from insgnss.flight.config.command_line import names_of
from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.antenna_files import ANTENNA_FILES
from insgnss.gnss.ppk import PpkResult
from insgnss.io.formats.gnss.rtklib_pos import read_pos_rows, read_rtklib_pos
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.records import GnssFixes

WORDS = [
    ("gnss.max_age_s", 0.0, "gnss.max_age_s = 0.0", "--max-age 0.0"),
    ("gnss.systems", "GX", "gnss.systems = 'GX'", "--systems GX"),
    ("camera.skip_events", [3, 5], "camera.skip_events = [3, 5]", "--skip-events 3 5"),
    (
        "camera.skip_images",
        ["a b.jpg", "c"],
        "camera.skip_images = ['a b.jpg', 'c']",
        "--skip-images 'a b.jpg' c",
    ),
    ("camera.invalid_events", True, "camera.invalid_events = true", "--invalid-events"),
    ("gnss.wet_delay", False, "gnss.wet_delay = false", "--no-wet-delay"),
    (
        "gnss.acceleration_mps2",
        (0.0, 1.0),
        "gnss.acceleration_mps2 = (0.0, 1.0)",
        "--acceleration 0.0 1.0",
    ),
    ("gnss.atmosphere.humidity", 40.0, "gnss.atmosphere.humidity = 40.0", "--humidity 40.0"),
    (
        "gnss.gate_sigma",
        4.0,
        "gnss.gate_sigma = 4.0",
        "gnss.gate_sigma = 4.0",
    ),  # the verb has no such option
]


@pytest.mark.parametrize(("key", "value", "of_the_file", "of_the_verb"), WORDS)
def test_messages_name_the_options_of_the_verb(key, value, of_the_file, of_the_verb):
    """Oracle: words written by hand; they hold as long as the verb runs."""
    with spoken_as(names_of()):
        assert setting(key, value) == of_the_verb
        assert of_the_verb.startswith(spell(key))
    assert (spell(key), setting(key, value)) == (key, of_the_file)


def test_every_key_has_an_option_of_the_verb():
    """Oracle: the parser of the verb."""
    parser = argparse.ArgumentParser()
    verb.add_arguments(parser)
    known = {option for action in parser._actions for option in action.option_strings}
    assert {option for option in names_of().values() if option != "ROVER"} <= known


def test_lists_that_are_given_in_parts_are_put_together():
    """Oracle: the words of the command line."""
    words = "ppk r --base b --navigation n g --navigation p --skip-events 1 --skip-events 4 5"
    words += " --rtklib-options pos2-arminfix=1 --rtklib-options pos2-rejionno=2"
    given = build_parser().parse_args(words.split())
    assert [path.name for path in given.navigation] == ["n", "g", "p"]
    assert verb.input_of(given).match.skip_events == (1, 4, 5)
    assert verb.input_of(given).options.rtklib_options == {
        "pos2-arminfix": "1",
        "pos2-rejionno": "2",
    }
    assert (
        build_parser().parse_args(["ppk", "r", "--base", "b", "--navigation", "n"]).skip_events
        == []
    )


def test_an_error_of_the_command_is_in_its_words(tmp_path, capsys):
    """Oracle: the option as it was given; exit code 2."""
    for name in ("r", "b", "n"):
        (tmp_path / name).write_text("RINEX\n")
    files = [
        str(tmp_path / "r"),
        "--base",
        str(tmp_path / "b"),
        "--navigation",
        str(tmp_path / "n"),
    ]
    assert main(["ppk", *files, "--max-age", "0", "--out", str(tmp_path / "out")]) == 2
    assert capsys.readouterr().err.startswith("insgnss: error: ppk: --max-age 0.0: must be 0.01")


@pytest.mark.parametrize("name", ANTENNA_FILES)
def test_positions_of_others_are_not_overwritten(tmp_path, name, capsys):
    """Oracle: the file's text and the exit code; beside a ppk.pos of an earlier run its files are
    our own.
    """
    out, files = tmp_path / "out", []
    for role in ("r", "b", "n"):
        (tmp_path / role).write_text("RINEX\n")
        files.append(str(tmp_path / role))
    out.mkdir()
    (out / name).write_text("surveyed\n")
    words = ["ppk", files[0], "--base", files[1], "--navigation", files[2], "--out", str(out)]
    assert main(words) == 2
    assert f"holds {name} and no ppk.pos: its positions were not written" in capsys.readouterr().err
    assert [(path.name, path.read_text()) for path in out.iterdir()] == [(name, "surveyed\n")]
    (out / "ppk.pos").write_text("")
    assert main(words) == 3  # the RINEX is none
    assert "were not written" not in capsys.readouterr().err


def solved(n=40):
    """A result of n fixes with velocities, and of each the satellites, age and ratio."""
    time, rng = 604790.0 + 0.5 * np.arange(n), np.random.default_rng(4)
    spread = rng.normal(size=(2, n, 3, 5))
    cov, velocity_cov = (
        np.diag([3e-3, 5e-3, 9e-3]) @ spread @ spread.swapaxes(2, 3) @ np.diag([3e-3, 5e-3, 9e-3])
    )
    place = np.radians(-46.57) + 1e-7 * time, np.radians(6.54) + 2e-7 * time, 500.0 + 0.1 * time
    fixes = GnssFixes(
        time, *place, cov, rng.normal(size=(n, 3)), velocity_cov, rng.integers(1, 6, n), 2021
    )
    beside = {
        "satellites": rng.integers(5, 30, n),
        "age_s": rng.integers(-99, 99, n) / 100.0,
        "ratio": rng.integers(0, 9999, n) / 10.0,
    }
    return PpkResult(fixes, None, (), "good", {}, beside, {}, "fake", 0.0)


def test_satellites_age_and_ratio_are_written_and_the_fixes_come_back(tmp_path):
    """Oracle: what was written, to the digits of the file; without them the columns are there and
    0.
    """
    result, names = solved(), {"satellites": "ns", "age_s": "age", "ratio": "ratio"}
    result.write(tmp_path / "ppk.pos")
    rows, back = read_pos_rows(tmp_path / "ppk.pos"), read_rtklib_pos(tmp_path / "ppk.pos")
    for field, column in names.items():
        assert np.array_equal(rows.columns[column], result.series[field])
    write_rtklib_pos(result.fixes, tmp_path / "bare.pos")
    bare = read_rtklib_pos(tmp_path / "bare.pos")
    assert not any(
        read_pos_rows(tmp_path / "bare.pos").columns[column].any() for column in names.values()
    )
    for field, digits in {
        "time": 1e-6,
        "lat": 2e-12,
        "height": 1e-4,
        "quality": 0,
        "velocity_ned": 1e-5,
        "cov_ned": 1e-7,
    }.items():
        assert np.allclose(
            getattr(back, field), getattr(result.fixes, field), rtol=0.0, atol=digits
        ), field
        assert np.array_equal(getattr(back, field), getattr(bare, field)), field
    assert rows.base_ecef is None  # else its roots would be calibrated once more


def test_rtklib_reads_what_we_write(tmp_path):
    """Oracle: RTKLIB's own reader, which goes by the place of the fields; it holds roots as single
    precision variances over ECEF.
    """
    rtklib = pytest.importorskip("pyrtklib5", reason="pyrtklib5 is not installed")
    result = solved()
    result.write(tmp_path / "ppk.pos")
    read, fixes = rtklib.solbuf_t(), result.fixes
    assert rtklib.readsol([str(tmp_path / "ppk.pos")], 1, read) == 1
    assert read.n == fixes.time.size
    for k in range(read.n):
        sol = read.data[k]
        state = np.array([sol.rr[i] for i in range(6)])
        C_en = rotation_en(*ecef_to_geodetic(state[:3])[:2])
        assert (
            np.abs(state[:3] - geodetic_to_ecef(fixes.lat[k], fixes.lon[k], fixes.height[k])).max()
            < 1e-3
        )
        assert np.allclose(C_en.T @ state[3:], fixes.velocity_ned[k], atol=2e-5)
        assert (sol.stat, sol.ns) == (fixes.quality[k], result.series["satellites"][k])
        assert np.allclose(
            [sol.age, sol.ratio], [result.series[name][k] for name in ("age_s", "ratio")], rtol=1e-6
        )
        assert np.isclose(sum(sol.qr[i] for i in range(3)), np.trace(fixes.cov_ned[k]), rtol=1e-2)
        assert np.isclose(
            sum(sol.qv[i] for i in range(3)), np.trace(fixes.velocity_cov_ned[k]), rtol=1e-2
        )
