"""The engine in its processes: what it is asked, and what is trusted of its answer, with a script
in its place.
"""

import errno
import gzip
import importlib.util
import json
import os
import time

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scripted_engine import BASE, BASE_LLH, HEAD, Fake, observations, one_line, pos
from written_rinex import epoch3, header3, record

from insgnss.base.errors import DataError, UsageError
from insgnss.base.wording import spoken_as
from insgnss.gnss.engine.preflight import satellites_with_phases
from insgnss.gnss.engine.program import INSTALL, check_names, engine_command
from insgnss.gnss.options import (
    EngineOptions,
    base_antenna,
    check_dynamics,
    option_file,
    prediction_sd,
    single_point_file,
)
from insgnss.gnss.rinex import header
from insgnss.gnss.rinex.observations import read_observations


@pytest.fixture
def fake(tmp_path):
    if os.name == "nt":
        pytest.skip("a script is no program on Windows")
    return Fake(tmp_path)


def test_options_are_those_that_hold(tmp_path):
    """Oracle: the issue's list, with RTKLIB's numbers for its choices (options.c of EX 2.5.0)."""
    base = header_of(tmp_path, observations(approx=BASE))
    lines = dict(
        line.split("=")
        for line in option_file(EngineOptions(), base, "combined", 0.2, 1.0).splitlines()
    )
    expected = {
        "posmode": 2,
        "frequency": 2,
        "soltype": 2,
        "elmask": 15.0,
        "dynamics": 1,
        "navsys": 61,
    }
    assert {name: float(lines[f"pos1-{name}"]) for name in expected} == expected
    expected = {"armode": 1, "gloarmode": 3, "arthres": 3.0, "maxage": 30.0}
    assert {name: float(lines[f"pos2-{name}"]) for name in expected} == expected
    expected = {
        "timeform": 0,
        "timendec": 9,
        "degform": 0,
        "solformat": 0,
        "height": 0,
        "timesys": 0,
    }
    assert {name: float(lines[f"out-{name}"]) for name in expected} == expected
    assert (
        lines["misc-timeinterp"] == "0"
    )  # the is on; tests/simulation/test_base_between_epochs.py shows its cost
    assert lines["ant2-postype"] == "1"
    assert_allclose([float(lines[f"ant2-pos{k}"]) for k in (1, 2, 3)], BASE, atol=1e-4)


@pytest.mark.parametrize(
    ("acceleration", "limit"), [((3.0, 1.0), 4.57), ((0.3, 0.1), 11.48), ((10.0, 1.0), 2.82)]
)
def test_dynamics_are_off_where_epochs_are_rare(tmp_path, acceleration, limit):
    """Oracle: T of 30 m after (O.1), by hand; and its sigma against 4000 random walks of the
    acceleration.
    """
    base, options = (
        header_of(tmp_path, observations(approx=BASE)),
        EngineOptions(acceleration_mps2=acceleration),
    )
    for interval, on in ((limit - 0.01, True), (limit + 0.01, False)):
        lines = option_file(options, base, "combined", interval, interval).splitlines()
        assert f"pos1-dynamics={int(on)}" in lines
        assert [check.verdict for check in check_dynamics(options, interval)] == (
            [] if on else ["note"]
        )
    (check,) = check_dynamics(options, 30.0)
    assert check.found.startswith("off: epochs every 30 s")
    assert f"every {limit:.1f} s at most" in check.expected
    step = limit / 200
    walk = np.cumsum(
        np.random.default_rng(6).normal(0.0, acceleration[0] * step**0.5, (200, 4000)), axis=0
    )
    place = np.cumsum(np.cumsum(walk, axis=0), axis=0)[-1] * step**2
    assert prediction_sd(options, limit) == pytest.approx(
        place.std(), rel=0.06
    )  # 1.1 % of the sample, 1.5 % of the steps, four sigma


@pytest.mark.parametrize("wish", ["0", "1", "on"])
def test_dynamics_that_are_asked_for_win(tmp_path, wish):
    """Oracle: the option as it was given, at 0.1 s and 30 s."""
    base, options = (
        header_of(tmp_path, observations(approx=BASE)),
        EngineOptions(rtklib_options={"pos1-dynamics": wish}),
    )
    for interval in (0.1, 30.0):
        lines = option_file(options, base, "forward", interval, interval).splitlines()
        assert dict(line.split("=") for line in lines)["pos1-dynamics"] == wish
        assert check_dynamics(options, interval) == ()


def test_a_solution_on_a_full_disk_is_refused(fake, monkeypatch):
    """Oracle: the file, which an engine in C leaves without its last epochs in silence."""

    def full(path):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))

    monkeypatch.setattr("insgnss.gnss.engine.rtklib.refuse_cut_off", full)
    with pytest.raises(OSError, match=r"No space left on device: .*\.pos"):
        fake.solve()


def test_rare_epochs_of_the_rover_reach_the_engine_without_dynamics(fake):
    """Oracle: the option file that the script was given, and the note."""
    fake.rover.write_text(observations(approx=(BASE[0] - 400.0, *BASE[1:]), step=5.0))
    fake.base.write_text(observations(approx=BASE, step=5.0))
    (check,) = fake.solve().checks
    assert (check.name, check.verdict) == ("engine dynamics", "note")
    assert all("pos1-dynamics=0\n" in fake.told()[name]["conf"] for name in ("forward", "backward"))


def header_of(directory, text):
    path = directory / "header.18o"
    path.write_text(text)
    return header.header_of(path, header.load_rinex(path)[0])[0]


def test_only_a_marker_has_the_delta_of_the_header(tmp_path):
    """Oracle: (B.1) of the module, by hand."""
    delta = record(f"{1.5:14.4f}{0.02:14.4f}{-0.03:14.4f}", "ANTENNA: DELTA H/E/N")
    base = header_of(
        tmp_path,
        observations(approx=BASE).replace(
            record("", "END OF HEADER"), delta + record("", "END OF HEADER")
        ),
    )
    for point, expected in (("marker", (0.02, -0.03, 1.5)), ("arp", (0, 0, 0)), ("apc", (0, 0, 0))):
        lines = base_antenna(EngineOptions(base_position_m=BASE, base_point=point), base)
        assert tuple(float(lines[f"ant2-antdel{axis}"]) for axis in "enu") == expected


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"base_position_m": BASE}, "base_point"),
        ({"base_position_m": BASE, "base_point": "pole"}, "apc, arp or marker"),
        ({"base_position_m": BASE_LLH, "base_point": "apc"}, "from the Earth's centre"),
        ({"elevation_mask_deg": 95.0}, "0 to 60"),
        ({"ratio": 0.5}, "1 to 100"),
        ({"frequencies": 4}, "1, 2 or 3"),
        ({"systems": "GX"}, "letters of"),
        ({"rtklib_options": {"out-timeform": "1"}}, "out-timeform"),
        (
            {"rtklib_options": {"pos1-posmode": "single"}},
            "cannot be set there: it is always kinematic",
        ),
        (
            {"rtklib_options": {"pos1-elmask": "10"}},
            r"cannot be set there: gnss\.elevation_mask_deg sets it",
        ),
        ({"rtklib_options": {"Arminfix": "10"}}, "'Arminfix' is not the name of an RTKLIB option"),
        ({"rtklib_options": {"pos2-arminfix": "10\nout-solformat=1"}}, "line break"),
        ({"acceleration_mps2": (0.0, 1.0)}, "greater than zero"),
    ],
)
def test_options_that_cannot_be_are_refused(options, what):
    """Oracle: the words of the error."""
    with pytest.raises(UsageError, match=what) as info:
        EngineOptions(**options)
    one_line(info)


def same_as(fake, text, path):
    """The observations of a file that the engine got are those of another one, value by value."""
    written = fake.directory / "got.obs"
    written.write_text(text)
    got, given = read_observations(written), read_observations(path)
    assert got.header.version == 3.04
    assert (got.gps_week, got.time.tolist()) == (given.gps_week, given.time.tolist())
    assert (got.satellite == given.satellite).all()
    assert (got.epoch == given.epoch).all()
    for signal in given.signals:
        np.testing.assert_array_equal(got.of(signal), given.of(signal))


def test_a_program_gets_the_same_options_and_plain_files(fake):
    """Oracle: what the script was given, word by word, and the files that it left."""
    run = fake.solve(rtklib_options={"pos2-arminfix": "7"})
    told = fake.told()
    assert sorted(told) == ["backward", "forward", "where_base"]
    for name, soltype in (("forward", 0), ("backward", 1)):
        assert told[name]["words"] == [
            "-k",
            f"{name}.conf",
            "-o",
            f"{name}.pos",
            "rover.obs",
            "base.obs",
            "navigation1.nav",
        ]
        assert f"pos1-soltype={soltype}\n" in told[name]["conf"]
        assert "pos2-arminfix=7\n" in told[name]["conf"]
        *observed, broadcast = told[name]["files"]
        for text, path in zip(observed, (fake.rover, fake.base), strict=True):
            same_as(fake, text, path)
        assert broadcast == fake.nav.read_text()
        assert run.option_files[name].read_text() == told[name]["conf"]
        assert getattr(run, name).read_text() == json.loads(fake.plan.read_text())[name]["pos"]
    assert told["where_base"]["words"][-2:] == ["base.obs", "navigation1.nav"]
    assert told["where_base"]["conf"] == single_point_file(EngineOptions())
    assert run.engine == f"RTKLIB EX 2.5.0 ({fake.program})"
    (check,) = run.checks  # a script holds no names of options
    assert (check.name, check.verdict, check.found) == (
        "engine options",
        "note",
        f"{fake.program} does not show whether it knows these options: pos2-arminfix",
    )
    assert fake.solve().checks == ()
    assert run.cpu_s == pytest.approx(sum(run.cpu_of.values()))
    assert 0.0 < run.cpu_s < 60.0
    assert sorted(path.name for path in fake.out.iterdir()) == [
        *("backward.conf", "backward.pos", "combined.pos", "forward.conf", "forward.pos")
    ]


def test_a_backward_solution_is_put_in_order(fake):
    """Oracle: the same rows from the first to the last."""
    rows = [(392700.0 + k, 53.29, -9.05, 75.0) for k in range(9)]
    fake.does(backward={"pos": pos(rows[::-1])}, forward={"pos": pos(rows)})
    run = fake.solve()
    assert run.backward.read_text() == run.forward.read_text() == pos(rows)


@pytest.mark.parametrize(
    ("system", "codes", "frequencies", "has"),
    [
        ("E", ("L1C", "L5Q"), 2, False),
        ("E", ("L1C", "L5Q"), 3, True),
        ("E", ("L1C", "L7Q"), 2, True),
        ("C", ("L2I", "L7I"), 2, True),
        ("R", ("L1C", "L2C"), 2, True),
        ("G", ("L1C", "C2W"), 2, False),
        ("G", ("L2W", "L5Q"), 3, False),
        ("G", ("L1C", "C1C"), 1, True),
        ("S", ("L1C", "L5I"), 3, False),
    ],
)
def test_frequencies_are_those_of_the_engine(tmp_path, system, codes, frequencies, has):
    """Oracle: RTKLIB EX's table of bands by system (rtkcmn.c: L1 G1 E1 B1, L2 G2 E5b B2b, L5 G3 E5a
    B2a).
    """
    path = tmp_path / "rover.obs"
    path.write_text(
        header3({system: codes}) + epoch3((2018, 10, 4, 13, 5, 0.0), {f"{system}05": [1e8, 1e8]})
    )
    rows = satellites_with_phases(read_observations(path), EngineOptions(frequencies=frequencies))
    assert rows.tolist() == [has]


def test_packed_files_are_unpacked(fake):
    """Oracle: the file before it was packed."""
    plain, text = fake.rover, fake.rover.read_text()
    fake.rover = fake.directory / "rover.18o.gz"
    fake.rover.write_bytes(gzip.compress(text.encode()))
    pytest.importorskip("hatanaka", reason="packed files need hatanaka")
    fake.solve()
    same_as(fake, fake.told()["forward"]["files"][0], plain)


def test_the_engine_gets_no_camera_events(fake):
    """Oracle: the file as it was before an event of 5 October 2018 was written behind its last
    epoch.
    """
    text = fake.rover.read_text()
    event = " 18 10  5 13  5  9.3000000  5  0\n"
    fake.solve()
    fake.rover.write_text(text + event)
    fake.log.rename(fake.directory / "log before")
    before = json.loads((fake.directory / "log before").read_text().splitlines()[-1])["files"][0]
    fake.solve()
    assert fake.told()["forward"]["files"][0] == before


def test_an_old_version_is_told(fake):
    """Oracle: the version that rnx2rtkp of 2.4.3 b34 writes."""
    fake.does(forward={"pos": pos([(392700.0, 53.29, -9.05, 75.0)], "2.4.3")})
    (check,) = fake.solve().checks
    assert (check.name, check.verdict) == ("engine", "note")
    assert "2.4.3" in check.found


def program_of(directory, names):
    """The binary of a program that holds these names, as a compiler leaves its strings."""
    path = directory / "rnx2rtkp"
    path.write_bytes(b"\x7fELF\0" + b"".join(name.encode() + b"\0" for name in names))
    return [str(path)]


def test_names_that_a_program_does_not_know_are_told(tmp_path):
    """Oracle: the names that were left out of the program; rnx2rtkp says nothing of them."""
    options = EngineOptions(rtklib_options={"pos2-arminfix": "7"})
    text = option_file(
        options, header_of(tmp_path, observations(approx=BASE)), "combined", 0.2, 1.0
    )
    names = [line.split("=")[0] for line in text.splitlines()]
    assert check_names(program_of(tmp_path, names), text, options) == ()
    (check,) = check_names(
        program_of(tmp_path, [name for name in names if name != "pos2-arthresmin"]), text, options
    )
    assert (check.name, check.verdict) == ("engine options", "note")
    assert check.found.endswith("rnx2rtkp: pos2-arthresmin")
    known = [*(name for name in names if name != "pos2-arminfix"), "pos2-arminfixes"]
    with pytest.raises(
        UsageError, match=r"rnx2rtkp has no option pos2-arminfix; did you mean pos2-arminfixes\?$"
    ) as info:
        check_names(program_of(tmp_path, known), text, options)
    one_line(info)


def test_a_choice_that_the_engine_refuses_is_told(fake):
    """Oracle: the words of RTKLIB 2.4.3 b34, which then goes on with what it does by itself."""
    progress = "processing : 2018/10/04 13:05:00 Q=0\r" * 2000
    said = {"say": "\rinvalid option value pos2-gloarmode (forward.conf:11)\n" + progress}
    fake.does(forward={"pos": pos([(392700.0, 53.29, -9.05, 75.0)]), **said})
    (check,) = fake.solve().checks
    assert (check.name, check.verdict, check.found) == (
        "engine options",
        "note",
        "values that it refused: pos2-gloarmode",
    )
    with pytest.raises(
        UsageError, match=r"gnss\.rtklib_options: the engine refused pos2-gloarmode = always$"
    ) as info:
        fake.solve(rtklib_options={"pos2-gloarmode": "always"})
    one_line(info)


@pytest.mark.parametrize("left", [{}, {"pos": HEAD.format(version="EX 2.5.0")}])
def test_an_output_without_epochs_is_no_success(fake, left):
    """Oracle: exit code 0 with no file, and with a header alone, as postpos() leaves them."""
    fake.does(forward={**left, "say": "no nav data\r"})
    with pytest.raises(
        DataError, match=r"forward solution: the engine solved no epoch.*no nav data$"
    ) as info:
        fake.solve()
    one_line(info)
    assert list(fake.out.iterdir()) == []


def test_what_the_engine_said_last_is_told(fake):
    """Oracle: exit code and last line of the script, behind 50 kB of progress."""
    fake.does(backward={"code": 3, "say": "processing\r" * 5000 + "malloc error\n\r\n"})
    with pytest.raises(
        DataError,
        match=r"backward solution: the engine stopped with exit code 3; it said: malloc error$",
    ) as info:
        fake.solve()
    one_line(info)


@pytest.mark.parametrize(
    ("options", "says"), [({}, r"gnss\.timeout_s"), ({"gnss.timeout_s": "--timeout"}, "--timeout")]
)
def test_an_engine_that_hangs_is_ended_and_with_it_the_others(fake, options, says):
    """Oracle: the processes are gone (signal 0); the message, which a thread makes, is in the words
    of who asks.
    """
    fake.does(backward={"sleep": 60.0}, forward={"sleep": 60.0})
    start = time.monotonic()
    with (
        spoken_as(options),
        pytest.raises(
            DataError, match=rf"did not finish in 1\.5 s; raise {says}; it said: nothing$"
        ) as info,
    ):
        fake.solve(timeout_s=1.5)
    one_line(info)
    assert time.monotonic() - start < 30.0
    for line in fake.told().values():
        with pytest.raises(ProcessLookupError):
            os.kill(line["pid"], 0)


def test_no_engine_says_how_to_get_one(monkeypatch, tmp_path):
    """Oracle: the words of the issue."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(tmp_path))
    for engine in ("auto", "pyrtklib5", "rnx2rtkp"):
        with pytest.raises(UsageError, match=r"pip install 'insgnss\[ppk\]'") as info:
            engine_command(engine)
        assert one_line(info).endswith(INSTALL)


def test_a_path_that_is_no_program_is_told_as_such(monkeypatch, tmp_path):
    """Oracle: the words; how to get an engine is told only where none is installed."""
    (tmp_path / "notes.txt").write_text("no program\n")
    for engine in (tmp_path / "rnx2rtkp", tmp_path / "notes.txt", tmp_path):
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: object())
        with pytest.raises(
            UsageError, match=r"no program that can be run; .* use pyrtklib5, which is installed"
        ) as info:
            engine_command(str(engine))
        assert "pip install" not in one_line(info)
        monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
        with pytest.raises(
            UsageError, match="no program that can be run; no GNSS engine: pip install"
        ):
            engine_command(str(engine))


@pytest.mark.parametrize(
    ("plan", "said"),
    [({}, "nothing"), ({"code": 2, "say": "ls: cannot access\n"}, "exit code 2.*cannot access")],
)
def test_a_program_that_is_no_engine_is_told_as_such(fake, plan, said):
    """Oracle: what `true` and `ls` do: no output, with exit code 0 and 2; a program with RTKLIB's
    names is not doubted.
    """
    fake.does(where_base=plan)
    with pytest.raises(
        UsageError, match=rf"engine = .*rnx2rtkp': left no solution .* is it an rnx2rtkp\? .*{said}"
    ) as info:
        fake.solve()
    one_line(info)
    fake.program.write_text(f"{fake.program.read_text()}# pos1-posmode\n")
    with pytest.raises(
        DataError,
        match=(
            "no position from codes"
            if not plan
            else "position of the base by codes: the engine stopped"
        ),
    ):
        fake.solve()


def test_a_program_on_path_is_the_fall_back(monkeypatch, fake):
    """Oracle: the script, found by its name."""
    monkeypatch.setattr(importlib.util, "find_spec", lambda name: None)
    monkeypatch.setenv("PATH", str(fake.directory))
    assert engine_command() == [str(fake.program)]


@pytest.mark.parametrize(
    ("base_interval", "on"), [(1.0, "0"), (5.0, "0"), (15.0, "1"), (30.0, "1")]
)
def test_a_slow_base_is_interpolated(tmp_path, base_interval, on):
    """Oracle: the limit of `INTERPOLATED_S`; an option given by the user wins."""
    base = header_of(tmp_path, observations(approx=BASE))
    for more, expected in (({}, on), ({"misc-timeinterp": "1"}, "1")):
        lines = option_file(
            EngineOptions(rtklib_options=more), base, "combined", 0.1, base_interval
        ).splitlines()
        assert f"misc-timeinterp={expected}" in lines
