"""What the engine gets: one column a band, filled from whatever code has the value."""

from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import written_rinex as w
from broadcast import START, TOW, WEEK, gps_elements, header, message
from numpy.testing import assert_array_equal

from insgnss.gnss.engine.normalised import ORDER, SHORT, engine_observations
from insgnss.gnss.engine.preflight import check_navigation, within_navigation
from insgnss.gnss.engine.rtklib import solve
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.rinex.navigation_message import read_navigation
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.formats.gnss.rtklib_pos import read_rtklib_pos

DATA = Path(__file__).parents[3] / "shared" / "data"
CODES = ["C1C", "L1C", "C2W", "L2W", "D2W", "S2W", "C2X", "L2X", "D2X", "S2X"]
SYSTEMS = {"G": "SYS_GPS", "R": "SYS_GLO", "E": "SYS_GAL", "J": "SYS_QZS", "C": "SYS_CMP"}


def at(k):
    return (2018, 10, 4, 12, k // 60, float(k % 60))


def observed(tmp_path, rows_of_epoch, n=40, types=None, head=""):
    """Observations of n epochs a second apart, whose satellites' fields `rows_of_epoch` gives."""
    path = tmp_path / "rover.rnx"
    text = w.header3(types or {"G": CODES}, head)
    path.write_text(text + "".join(w.epoch3(at(k), rows_of_epoch(k)) for k in range(n)))
    return read_observations(path)


def written(tmp_path, observations):
    """The file for the engine, read again, and its codes."""
    text, codes = engine_observations(observations)
    path = tmp_path / "engine.obs"
    path.write_bytes(text)
    return read_observations(path), codes


def test_the_order_of_codes_is_the_engines():
    """Oracle: RTKLIB's getcodepri for every band and code of ours, and of no other letter."""
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    import pyrtklib5 as rtklib

    for letter, bands in ORDER.items():
        system = getattr(rtklib, SYSTEMS[letter])
        for band, codes in bands.items():
            level = {
                c: rtklib.getcodepri(system, rtklib.obs2code(band + c), "")
                for c in "".join(chr(k) for k in range(65, 91))
                if rtklib.obs2code(band + c)
            }
            known = sorted((c for c in level if level[c] > 0), key=lambda c: -level[c])
            assert "".join(known) == codes, (letter, band)


def test_every_number_and_flag_comes_through(tmp_path):
    """Oracle: what was written: random numbers of full width with flags, blanks, three systems,
    stamps of a tenth of a microsecond, over the seam between two chunks.
    """
    rng = np.random.default_rng(3)
    types = {"G": CODES[:6], "R": ["C1C", "L1C", "D1C"], "E": ["C1C", "L1C"], "S": ["C1C"]}

    def rows(k):
        return {
            name: [
                None
                if rng.random() < 0.1
                else (
                    float(rng.integers(-999_999_999_999, 9_999_999_999_999) / 1000.0),
                    f"{rng.choice(list(' 123'))}{rng.choice(list(' 59'))}",
                )
                for _ in types[name[0]]
            ]
            for name in ("G01", "R07", "E11", "S20", "G32")
        }

    given = observed(tmp_path, rows, 30, types)
    given = replace(given, time=given.time + np.round(rng.uniform(0, 0.9, 30), 7))
    got, codes = written(tmp_path, given)
    assert codes == "E L1C, G L1C L2W, R L1C"
    assert got.header.version == 3.04
    assert_array_equal(got.time, np.round(given.time, 7))
    known = given.satellite != "S20"  # of systems that the engine takes
    assert_array_equal(got.satellite, given.satellite[known])
    for signal in given.signals:
        assert_array_equal(got.of(signal), given.of(signal)[known])
    for flags, theirs in (
        (got.loss_of_lock, given.loss_of_lock),
        (got.strength, given.strength),
    ):
        for signal in given.signals:
            assert_array_equal(flags[:, got.column(signal)], theirs[known][:, given.column(signal)])


def second(k, code):
    """Fields of a satellite at epoch k whose second band stands under one code, or under none."""
    first, band = [2e7 + k, 1e8 + k], [2.1e7 + k, 8e7 + k, 100.0 + k, 40.0]
    none = [None] * 4
    return [*first, *(band if code == "W" else none), *(band if code == "X" else none)]


def test_satellites_of_other_codes_stand_in_one_column(tmp_path):
    """Oracle: the same numbers under one code: GPS of even number under 2X, the others 2W."""
    mixed = observed(
        tmp_path, lambda k: {f"G{n:02d}": second(k, "WX"[n % 2 == 0]) for n in range(1, 6)}
    )
    got, codes = written(tmp_path, mixed)
    one = observed(tmp_path, lambda k: {f"G{n:02d}": second(k, "W") for n in range(1, 6)})
    right, _ = written(tmp_path, one)
    assert codes == "G L1C L2W+L2X"
    assert got.signals == right.signals == tuple(w for w in right.signals if w[1:] in ("1C", "2W"))
    assert_array_equal(got.values, right.values)
    assert not got.loss_of_lock.any()


def test_empty_columns_before_the_full_one_are_no_code(tmp_path):
    """Oracle: the file without the empty columns, which stand first and are of a better code."""
    full = observed(tmp_path, lambda k: {"G01": second(k, "X")})
    got, codes = written(tmp_path, full)
    assert codes == "G L1C L2X"
    assert [s for s in got.signals if s[1] == "2"] == ["C2X", "L2X", "D2X", "S2X"]
    assert_array_equal(got.of("L2X"), 8e7 + np.arange(40.0))


def test_a_code_that_ends_is_followed_by_another_with_a_flag(tmp_path):
    """Oracle: 2W up to epoch 19, 2X from 20 on: one arc, and the lock is lost there alone."""
    got, _ = written(
        tmp_path, observed(tmp_path, lambda k: {"G01": second(k, "W" if k < 20 else "X")})
    )
    phase = got.column("L2W")
    assert_array_equal(got.values[:, phase], 8e7 + np.arange(40.0))
    assert np.flatnonzero(got.loss_of_lock[:, phase]).tolist() == [20]
    assert got.loss_of_lock.sum() == 1


def test_a_short_gap_of_the_code_stays_one(tmp_path):
    """Oracle: a gap of SHORT phases, over which the engine keeps the ambiguity, and none longer:
    what another code has there is not taken, nor flagged.
    """
    both = [2.2e7, 9e7, 1.0, 30.0]

    def rows(k, gap):
        fields = second(k, "X" if 10 <= k < 10 + gap else "W")
        return {"G01": [*fields[:6], *both]}

    for gap in (SHORT, SHORT + 1):
        got, _ = written(tmp_path, observed(tmp_path, lambda k, gap=gap: rows(k, gap), 100))
        phase = got.of("L2W")
        assert np.isnan(phase).sum() == (gap if gap == SHORT else 0)
        assert got.loss_of_lock.sum() == (0 if gap == SHORT else 2)
        code = 2.1e7 + np.arange(100.0)
        code[10 : 10 + gap] = 2.2e7
        assert_array_equal(got.of("C2W"), code)


def test_codes_without_a_phase_are_of_the_first_that_has_one(tmp_path):
    """Oracle: the fields by hand: no phase on band 2, codes under W and X first, then X alone."""
    none = [None] * 3

    def rows(k):
        return {"G01": [2e7, 1e8, 2.1e7 if k < 20 else None, *none, 2.2e7, *none]}

    got, codes = written(tmp_path, observed(tmp_path, rows))
    assert (codes, got.signals) == ("G L1C", ("C1C", "L1C", "C2W"))
    assert_array_equal(got.of("C2W"), np.where(np.arange(40) < 20, 2.1e7, 2.2e7))


def test_epochs_of_other_days_than_the_navigation_are_left_out(tmp_path):
    """Oracle: the file without its first epochs, which are of 6 January 1980: a receiver that does
    not know the date; stamps stay exact to a tick.
    """
    rows = {"G01": [2e7, 1e8]}
    body = "".join(w.epoch3((2024, 3, 6, 12, 0, 0.1 * k), rows) for k in range(1, 30))
    lost = "".join(w.epoch3((1980, 1, 6, 0, 0, 10.0 + k), rows) for k in range(3))
    head = w.header3({"G": ["C1C", "L1C"]})
    event = w.event3((2024, 3, 6, 12, 0, 1.2345678))
    read = []
    for k, text in enumerate((head + body + event, head + lost + body + event)):
        path = tmp_path / f"{k}.rnx"
        path.write_text(text)
        read.append(read_observations(path))
    nav = tmp_path / "brdc.nav"
    elements = gps_elements(toe=TOW)
    nav.write_text(
        header(3.04, "N: GNSS NAV DATA", "M: MIXED")
        + message(3.04, "G01", (0, 0, 0), elements, START)
    )
    navigation = read_navigation(nav)
    right, odd = (within_navigation(one, navigation) for one in read)
    assert right is read[0]
    assert odd.gps_week == right.gps_week == WEEK
    for name in ("time", "events", "epoch", "values", "satellite"):
        assert_array_equal(getattr(odd, name), getattr(right, name))
    (note,) = odd.notes
    assert note.verdict == "note"
    assert "3 of 32 epochs of" in note.found
    assert "1980-01-06 00:00:10 to 1980-01-06 00:00:12" in note.found
    other = replace(right, time=right.time + 9 * 86400.0)
    assert within_navigation(other, navigation) is other
    with pytest.raises(Exception, match="give the navigation of that day"):
        check_navigation(navigation, other, EngineOptions())


@pytest.mark.slow
def test_mixed_codes_are_solved_as_one_code_is(tmp_path):
    """Oracle: the same simulated flight under one code, row by row."""
    if find_spec("pyrtklib5") is None or not (DATA / "rinex_sim_6min").is_dir():
        pytest.skip("the engine or the recording is not here")
    place = DATA / "rinex_sim_6min"
    rover, base = (read_observations(place / name) for name in ("rover.18o", "base.18o"))
    rover = rover.only(np.round(rover.time, 7) % 1.0 == 0.0)
    moved = np.array([name[0] == "G" and int(name[1:]) % 2 == 0 for name in rover.satellite])
    k = [rover.column(name) for name in ("C2W", "L2W", "D2W", "S2W")]
    other = np.where(moved[:, None], rover.values[:, k], np.nan)
    values = rover.values.copy()
    values[np.ix_(moved, k)] = np.nan
    mixed = replace(
        rover,
        signals=(*rover.signals, "C2X", "L2X", "D2X", "S2X"),
        values=np.hstack([values, other]),
        loss_of_lock=np.hstack([rover.loss_of_lock, rover.loss_of_lock[:, k]]),
        strength=np.hstack([rover.strength, rover.strength[:, k]]),
    )
    options = EngineOptions()
    files = [place / "brdc.18n", place / "brdc.18g"]
    solved = []
    for name, one in (("one", rover), ("mixed", mixed)):
        run = solve("", "", files, options, tmp_path / name, None, (one, base))
        solved.append(read_rtklib_pos(run.combined))
    assert (solved[1].quality == 1).all()
    assert_array_equal(solved[0].lat, solved[1].lat)
    assert_array_equal(solved[0].height, solved[1].height)
