"""RTKLIB itself on recorded and simulated sets, which are no part of the project: without them, or
without RTKLIB, the tests skip.
"""

import importlib.util
import re
import shutil
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scripted_engine import one_line
from written_rinex import record

from insgnss.base.errors import InputError, UsageError
from insgnss.geodesy.frames import ecef_to_geodetic, geodetic_to_ecef, rotation_en
from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.io.formats.gnss.rtklib_pos import read_rtklib_pos
from insgnss.io.formats.read_options import ReadOptions

pytestmark = pytest.mark.slow

DATA = Path(__file__).parents[3] / "shared" / "data"
MILLIMETRE = 1e-3


ENGINES = ("pyrtklib5", "rnx2rtkp")


def recorded(*names, engine="pyrtklib5"):
    """Files of a recording; skips without it or without the engine."""
    if engine == "pyrtklib5" and importlib.util.find_spec(engine) is None:
        pytest.skip("pyrtklib5 is not installed")
    if engine == "rnx2rtkp" and shutil.which(engine) is None:
        pytest.skip("no rnx2rtkp on PATH (Debian: rtklib)")
    files = [DATA / name for name in names]
    if not all(file.is_file() for file in files):
        pytest.skip(f"the recording {names[0].split('/')[0]} is not here")
    return files


def ecef(fixes):
    return geodetic_to_ecef(fixes.lat, fixes.lon, fixes.height)


def errors(fixes, truth):
    """North, east, down, m."""
    return (ecef(fixes) - truth) @ rotation_en(fixes.lat[0], fixes.lon[0])


CSSR, SEPT = (-3959400.631, 3385704.533, 3667523.111), (-3962108.673, 3381309.574, 3668678.638)


def static_set(engine="pyrtklib5"):
    names = ("SEPT078M1.21O", "3034078M1.21O", "SEPT078M.21P", "30340780.21q")
    return recorded(*(f"cssrlib_rtk/{name}" for name in names), engine=engine)


def test_a_standing_receiver_is_where_it_is_published(tmp_path):
    """Oracle: published coordinates of cssrlib's static set; bar 5 mm, of the mean and of the last
    epoch.
    """
    rover, base, *navigation = static_set()
    truth = np.array(SEPT)
    run = solve(
        rover, base, navigation, EngineOptions(base_position_m=CSSR, base_point="apc"), tmp_path
    )
    fixes = read_rtklib_pos(run.combined)
    assert (fixes.quality == 1).all()
    off = errors(fixes, truth)
    assert np.linalg.norm(off.mean(axis=0)) < 5 * MILLIMETRE
    assert np.linalg.norm(off[-1]) < 5 * MILLIMETRE
    assert run.checks == ()
    assert "EX 2.5" in run.engine


def test_marker_antenna_and_phase_centre_are_the_same_base(tmp_path):
    """Oracle: the solution with the coordinates of the phase centre; those of ARP and marker are
    0.1 m and 1.6 m below it by hand.
    """
    rover, base, *navigation = static_set()
    lat, lon, _ = ecef_to_geodetic(np.array(CSSR))
    up = -rotation_en(lat, lon)[:, 2]
    text = base.read_text()
    old = next(line for line in text.splitlines(keepends=True) if "ANT # / TYPE" in line)
    delta = next(line for line in text.splitlines(keepends=True) if "ANTENNA: DELTA" in line)
    text = text.replace(old, record(f"{'':20}TESTANTENNA     NONE", "ANT # / TYPE")).replace(
        delta, record(f"{1.5:14.4f}{0.0:14.4f}{0.0:14.4f}", "ANTENNA: DELTA H/E/N")
    )
    mine = tmp_path / "base.21O"
    mine.write_text(text)
    antex = tmp_path / "antennas.atx"
    antex.write_text(antex_of("TESTANTENNA     NONE", 100.0))
    found = []
    for point, below in (("apc", 0.0), ("arp", 0.1), ("marker", 1.6)):
        given = tuple(float(x) for x in np.array(CSSR) - below * up)
        options = EngineOptions(base_position_m=given, base_point=point, antex=antex, systems="G")
        found.append(
            ecef(
                read_rtklib_pos(solve(rover, mine, navigation, options, tmp_path / point).combined)
            )
        )
    assert_allclose(found[1], found[0], rtol=0, atol=2 * MILLIMETRE)
    assert_allclose(found[2], found[0], atol=2 * MILLIMETRE)
    with pytest.raises(InputError, match="does not know the base's antenna"):
        solve(rover, base, navigation, replace(options, antex=antex), tmp_path / "unknown")


def antex_of(name, up_mm):
    """An ANTEX file of one receiver antenna, its phase centres of GPS `up_mm` above the ARP."""
    band = "".join(
        record(f"   G0{k}", "START OF FREQUENCY")
        + record(f"{0.0:10.2f}{0.0:10.2f}{up_mm:10.2f}", "NORTH / EAST / UP")
        + "   NOAZI" + "    0.00" * 19 + "\n"
        + record(f"   G0{k}", "END OF FREQUENCY")
        for k in (1, 2)
    )  # fmt: skip
    head = (
        record("     1.4            M", "ANTEX VERSION / SYST")
        + record("A", "PCV TYPE / REFANT")
        + record("", "END OF HEADER")
    )
    about = (
        record(name, "TYPE / SERIAL NO")
        + record("     0.0", "DAZI")
        + record("     0.0  90.0   5.0", "ZEN1 / ZEN2 / DZEN")
    )
    count = record("     2", "# OF FREQUENCIES")
    return (
        head + record("", "START OF ANTENNA") + about + count + band + record("", "END OF ANTENNA")
    )


def moving_set():
    return recorded(
        *(f"cssrlib_rtk/{name}" for name in ("SEPT265G.21O", "3034265G.21O", "SEPT2650.21P"))
    )


def test_a_moving_receiver_is_fixed(tmp_path):
    """Oracle: the bar of 97 % of epochs fixed."""
    rover, base, navigation = moving_set()
    fixes = read_rtklib_pos(
        solve(
            rover, base, navigation, EngineOptions(base_position_m=CSSR, base_point="apc"), tmp_path
        ).combined
    )
    assert fixes.time.size == 360
    assert np.mean(fixes.quality == 1) >= 0.97


WRONG_OPTIONS = [
    ("pos2-arminfxi", "3", "no option pos2-arminfxi; did you mean pos2-arminfix"),
    ("pos2-arminfix", "ten", "pos2-arminfix = ten is not a number"),
    ("pos2-arminfix", "1.5", r"pos2-arminfix = 1\.5 is not a number"),
    ("stats-eratio1", "", "stats-eratio1 =  is not a number"),
    ("pos2-armode", "always", "the engine refused pos2-armode = always$"),
]


@pytest.mark.parametrize(("name", "value", "what"), WRONG_OPTIONS)
def test_options_that_rtklib_does_not_take_are_told(tmp_path, name, value, what):
    """Oracle: RTKLIB's table of options; it goes on without them, and reads a word as 0."""
    rover, base, navigation = moving_set()
    with pytest.raises(UsageError, match=what) as info:
        solve(
            rover,
            base,
            navigation,
            EngineOptions(base_position_m=CSSR, base_point="apc", rtklib_options={name: value}),
            tmp_path,
        )
    one_line(info)


def test_swapped_files_are_told(tmp_path):
    """Oracle: the order in which the files are given; the whole drive, and five seconds of it, in
    which codes see no motion.
    """
    rover, base, navigation = moving_set()
    head, *epochs = rover.read_text().split("\n> ")
    short = tmp_path / "short.21O"
    short.write_text("\n> ".join([head, *epochs[150:156]]) + "\n")
    for named_base in (rover, short):
        with pytest.raises(
            InputError,
            match=r"the base moves: .*, by phase; the rover .*3034265G.21O stands: are .* swapped",
        ) as info:
            solve(
                base,
                named_base,
                navigation,
                EngineOptions(base_position_m=CSSR, base_point="apc"),
                tmp_path,
            )
        one_line(info)


def test_swapped_files_of_two_that_stand_are_told(tmp_path):
    """Oracle: the order in which the files of a set are given, 3 km apart."""
    rover, base, navigation, _ = geonet_set()
    with pytest.raises(
        InputError,
        match=r"07590920\.05o: stands \d+ m from .*30400920\.05o stands at them: .* are swapped",
    ) as info:
        solve(
            base,
            rover,
            navigation,
            EngineOptions(base_position_m=GEONET_BASE, base_point="apc", systems="G"),
            tmp_path,
        )
    one_line(info)


@pytest.mark.slow
def test_five_systems_run_as_moving(tmp_path):
    """Oracle: published positions of MatRTKLIB's static set; bar 5 mm at every epoch."""
    names = ("rover.obs", "base.obs", "base.nav", "base_position.txt", "rover_position.txt")
    rover, base, navigation, *places = recorded(*(f"matrtklib/static/{name}" for name in names))
    at, truth = (geodetic_to_ecef(*np.radians(x[:2]), x[2]) for x in map(np.loadtxt, places))
    run = solve(
        rover,
        base,
        navigation,
        EngineOptions(base_position_m=tuple(map(float, at)), base_point="apc"),
        tmp_path,
    )
    fixes = read_rtklib_pos(run.combined)
    assert (fixes.quality == 1).all()
    assert np.linalg.norm(errors(fixes, truth), axis=1).max() < 5 * MILLIMETRE


@pytest.mark.slow
def test_a_simulated_flight_is_fixed_and_never_wrongly(tmp_path):
    """Oracle: truth of the simulated flight; bars 99 % fixed, no fixed position off by 0.1 m. The
    wet delay is corrected elsewhere.
    """
    names = ("rover.18o", "base.18o", "brdc.18n", "brdc.18g", "truth.npz")
    rover, base, *navigation, known = recorded(*(f"rinex_sim_6min/{name}" for name in names))
    with np.load(known) as file:
        truth = {name: file[name] for name in ("tow", "xyz", "rb")}
    run = solve(
        rover,
        base,
        navigation,
        EngineOptions(base_position_m=tuple(map(float, truth["rb"])), base_point="apc"),
        tmp_path,
    )
    for path, most in ((run.combined, 0.99), (run.forward, 0.99), (run.backward, 0.99)):
        fixes = read_rtklib_pos(path)
        at = np.column_stack(
            [np.interp(fixes.time, truth["tow"], column) for column in truth["xyz"].T]
        )
        fixed = fixes.quality == 1
        off = errors(fixes, at)[fixed]
        assert fixed.mean() >= most
        assert np.linalg.norm(off, axis=1).max() < 0.1
        assert (off.std(axis=0) < [3 * MILLIMETRE, 3 * MILLIMETRE, 10 * MILLIMETRE]).all()


def geonet_set(engine="pyrtklib5"):
    names = ("07590920.05o", "30400920.05o", "30400920.05n", "published_0759_3040.pos")
    return recorded(*(f"rtklib_gsi_static/{name}" for name in names), engine=engine)


GEONET_LLH = (
    np.radians(35 + 7 / 60 + 55.40544 / 3600),
    np.radians(139 + 37 / 60 + 27.50368 / 3600),
    np.float64(73.9077),
)
GEONET_BASE = tuple(map(float, geodetic_to_ecef(*GEONET_LLH)))
# of RTKLIB's own table at the rover; the published heights are above it, that of the base is not
GEONET_GEOID_M = 36.4774
GEONET_MORE = {  # what RTKLIB 2.4.2 did by default
    "pos1-dynamics": "0",
    "pos2-armode": "3",
    "pos2-arfilter": "0",
    "pos2-arminfix": "10",
    "pos2-arthres1": "1000",
    "pos2-aroutcnt": "5",
    "pos2-rejionno": "1000",
    "pos2-rejcode": "1000",
    "pos2-varholdamb": "0.001",
    "pos2-gainholdamb": "1",
    "stats-eratio1": "100",
    "stats-eratio2": "100",
}
OF_EX = {"pos2-arfilter", "pos2-rejcode", "pos2-varholdamb", "pos2-gainholdamb"}


def geonet_options(engine):
    more = {
        name: value
        for name, value in GEONET_MORE.items()
        if engine == "pyrtklib5" or name not in OF_EX
    }
    return EngineOptions(
        base_position_m=GEONET_BASE,
        base_point="apc",
        systems="G",
        rtklib_options=more,
        engine=shutil.which(engine) or engine,
    )


def geonet_published(known):
    """The published fixes, and in which of them the base is that of 30 s later."""
    rows = [line for line in known.read_text().splitlines() if not line.startswith("%")]
    return read_rtklib_pos(known, ReadOptions(undulation_m=GEONET_GEOID_M)), np.array(
        [float(row.split()[-2]) < -1.0 for row in rows]
    )


@pytest.mark.parametrize("engine", ENGINES)
def test_the_published_solution_of_geonet_comes_back(tmp_path, engine):
    """Oracle: solution published with RTKLIB 2.4.2, to its digits (0.00001", 0.1 mm), in its 69
    epochs with the base of the same time.

    From 00:33 on the stamps of rover and base are 5 ms apart. 2.4.2 takes that for two epochs and
    in 46 of its epochs, of age -30 s, the base of 30 s later, by which it scatters by centimetres;
    later versions match to 25 ms.
    """
    rover, base, navigation, known = geonet_set(engine)
    published, late = geonet_published(known)
    assert (late.sum(), late.size) == (46, 115)
    fixes = read_rtklib_pos(
        solve(rover, base, navigation, geonet_options(engine), tmp_path).forward
    )
    assert_allclose(fixes.time, published.time, rtol=0, atol=1e-8)
    assert (fixes.quality == published.quality).all()
    off = np.abs(errors(fixes, ecef(published)))
    assert (
        off[~late].max() < 0.4 * MILLIMETRE
    )  # a unit of the last digit of latitude, and half of ours
    assert (off[late] < 3.0 * np.sqrt(published.cov_ned[late][:, [0, 1, 2], [0, 1, 2]])).all()
    assert (ecef(fixes)[late].std(axis=0) < 0.5 * ecef(published)[late].std(axis=0)).all()


@pytest.mark.parametrize("engine", ENGINES)
def test_so_do_its_epochs_with_a_base_of_later(tmp_path, engine):
    """Oracle: the same solution, in all 115 epochs, with the engine shown the base's epochs that
    2.4.2 took.

    It takes three runs: a base's epoch that one rover's epoch must not find is that which the epoch
    before needs, and 2.4.2 interpolates between bases up to 60 s apart, so that of the epochs that
    are all late every third is left. The fix is held from before.
    """
    rover, base, navigation, known = geonet_set(engine)
    published, late = geonet_published(known)
    place, all_late = ecef(published), np.flatnonzero(~late)[-1] + 1
    head, *epochs = re.split(r"(?m)^(?= 05  4  2 )", base.read_text())
    off, shown = np.full((late.size, 3), np.nan), tmp_path / "base.05o"
    for third in range(3):
        left = [
            k
            for k in range(len(epochs))
            if (k < all_late and not late[k]) or (k > all_late and k % 3 == third)
        ]
        shown.write_text(head + "".join(epochs[k] for k in left))
        fixes = read_rtklib_pos(
            solve(rover, shown, navigation, geonet_options(engine), tmp_path / str(third)).forward
        )
        at = np.rint((fixes.time - published.time[0]) / 30.0).astype(int)
        rows = np.flatnonzero((at < all_late) | ((at + 1) % 3 == third) & (at < late.size))
        assert (fixes.quality[rows] == published.quality[at[rows]]).all()
        off[at[rows]] = np.abs(
            (ecef(fixes)[rows] - place[at[rows]]) @ rotation_en(published.lat[0], published.lon[0])
        )
    assert off[:-1].max() < 0.4 * MILLIMETRE
    assert (
        off[-1].max() < 1.5 * MILLIMETRE
    )  # sigma 0.27 and 0.68 m, 5 satellites: what the filter remembers


def test_rare_epochs_are_fixed_without_dynamics(tmp_path):
    """Oracle: the published solution, 30 s between epochs, to 2 mm (the same integers, other
    weights); dynamics asked for, and not had.
    """
    rover, base, navigation, known = geonet_set()
    published, late = geonet_published(known)
    options = EngineOptions(base_position_m=GEONET_BASE, base_point="apc")
    run = solve(rover, base, navigation, options, tmp_path)
    assert "engine dynamics" in [check.name for check in run.checks]
    fixes = read_rtklib_pos(run.combined)
    assert (fixes.quality == 1).all()
    rows = np.flatnonzero(~late)
    at = np.searchsorted(fixes.time, published.time[rows] - 0.1)
    assert np.linalg.norm(ecef(fixes)[at] - ecef(published)[rows], axis=1).max() < 2 * MILLIMETRE
    forced = solve(
        rover,
        base,
        navigation,
        replace(options, rtklib_options={"pos1-dynamics": "1"}),
        tmp_path / "forced",
    )
    assert "engine dynamics" not in [check.name for check in forced.checks]
    rows = [
        row.split() for row in forced.combined.read_text().splitlines() if not row.startswith("%")
    ]
    assert np.mean([float(row[7]) == 0.0 for row in rows]) > 0.3


# The fall-back


def test_an_rnx2rtkp_puts_a_standing_receiver_where_it_is_published(tmp_path):
    """Oracle: published coordinates of cssrlib's static set: 5 mm; 2.4.3 fixes a tenth, to half a
    cycle, and it is told what it lacks.
    """
    rover, base, *navigation = static_set("rnx2rtkp")
    options = EngineOptions(base_position_m=CSSR, base_point="apc", engine=shutil.which("rnx2rtkp"))
    run = solve(rover, base, navigation, options, tmp_path)
    fixes = read_rtklib_pos(run.combined)
    fixed, off = fixes.quality == 1, errors(fixes, np.array(SEPT))
    assert fixed.any()
    if "RTKLIB 2.4.3" not in run.engine:
        assert fixed.all()
        assert np.linalg.norm(off.mean(axis=0)) < 5 * MILLIMETRE
    else:
        assert np.linalg.norm(off[fixed], axis=1).max() < 0.1
        told = " ".join(check.found for check in run.checks)
        assert all(name in told for name in ("pos2-arthresmin", "pos2-gloarmode", "2.4.3"))
    with pytest.raises(
        UsageError, match=r"rnx2rtkp has no option pos2-arminfxi; did you mean pos2-arminfix"
    ):
        solve(
            rover,
            base,
            navigation,
            replace(options, rtklib_options={"pos2-arminfxi": "3"}),
            tmp_path,
        )
    with pytest.raises(UsageError, match=r"the engine refused pos2-armode = always$"):
        solve(
            rover,
            base,
            navigation,
            replace(options, rtklib_options={"pos2-armode": "always"}),
            tmp_path,
        )


def test_an_rnx2rtkp_fixes_a_simulated_flight(tmp_path):
    """Oracle: truth of 50 s of the simulated flight, with camera events in the rover's file; bars
    as of EX.
    """
    names = ("rover.18o", "base.18o", "brdc.18n", "brdc.18g", "truth.npz")
    rover, base, *navigation, known = recorded(
        *(f"rinex_sim_6min/{name}" for name in names), engine="rnx2rtkp"
    )
    with np.load(known) as file:
        truth = {name: file[name] for name in ("tow", "xyz", "rb")}
    head, *epochs = re.split(r"(?m)^(?= 18 10  4 )", rover.read_text())
    piece = tmp_path / "rover.18o"
    piece.write_text(head + "".join(epochs[2000:2500]))
    options = EngineOptions(
        base_position_m=tuple(map(float, truth["rb"])),
        base_point="apc",
        engine=shutil.which("rnx2rtkp"),
    )
    fixes = read_rtklib_pos(solve(piece, base, navigation, options, tmp_path).combined)
    at = np.column_stack([np.interp(fixes.time, truth["tow"], column) for column in truth["xyz"].T])
    fixed = fixes.quality == 1
    assert fixed.mean() >= 0.97
    assert np.linalg.norm(errors(fixes, at)[fixed], axis=1).max() < 0.1


def test_an_rnx2rtkp_tells_swapped_files(tmp_path):
    """Oracle: the order in which the files are given."""
    names = ("rover.18o", "base.18o", "brdc.18n", "brdc.18g")
    rover, base, *navigation = recorded(
        *(f"rinex_sim_6min/{name}" for name in names), engine="rnx2rtkp"
    )
    with pytest.raises(
        InputError, match=r"the base moves: .*base\.18o stands: are rover and base swapped"
    ) as info:
        solve(base, rover, navigation, EngineOptions(engine=shutil.which("rnx2rtkp")), tmp_path)
    one_line(info)
