"""Camera events of RINEX event records."""

import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest
import written_rinex as w
from numpy.testing import assert_allclose

from insgnss.base.errors import InputError
from insgnss.gnss.engine.normalised import engine_observations
from insgnss.gnss.rinex.camera_events import RoverEvents, camera_events, unasked_events
from insgnss.gnss.rinex.observations import read_observations
from insgnss.io.exposures.match import name_events

DATA = Path(__file__).parents[3] / "shared" / "data"
TOW = 4 * 86400 + 43200.0
SHOTS = np.round(np.cumsum(np.random.default_rng(4).uniform(1.6, 2.4, 60)), 7)
NAMES = tuple(f"DSC{k:05d}.JPG" for k in range(101, 161))


def flown(tmp_path, shots, records=()):
    """Observations with an epoch a second over 150 s and an event at each shot."""
    text, k = w.header3({"G": ["C1C"]}), 0
    for second in range(150):
        text += w.epoch3((2018, 10, 4, 12, second // 60, float(second % 60)), {"G01": [2e7]})
        while k < len(shots) and shots[k] < second + 1:
            minute, rest = divmod(float(shots[k]), 60.0)
            text += w.event3((2018, 10, 4, 12, int(minute), rest), 5, records[k] if records else ())
            k += 1
    path = tmp_path / "rover.rnx"
    path.write_text(text)
    return read_observations(path)


def test_two_inputs_are_told_apart_by_their_record_lines(tmp_path):
    """Oracle: what was written: every second event comes from another input."""
    records = [[w.record(f"EVENT {'AB'[k % 2]}", "COMMENT")] for k in range(60)]
    found = camera_events(flown(tmp_path, SHOTS, records), RoverEvents("EVENT B"))
    assert_allclose(found.time, TOW + SHOTS[1::2], rtol=0.0, atol=1e-9)
    with pytest.raises(InputError, match="has a record line with 'EVENT C'"):
        camera_events(flown(tmp_path, SHOTS, records), RoverEvents("EVENT C"))


INVALID = [w.record(" Time mark is not valid", "COMMENT")]
RTKLIB_WRITES = """
import sys
import pyrtklib5 as rtklib
out, options, row = rtklib.FileWrapper(sys.argv[1], "w"), rtklib.rnxopt_t(), rtklib.obsd_t()
options.rnxver, options.navsys, row.sat, row.rcv = int(sys.argv[2]), 1, 1, 1
options.nobs[0], row.code[0] = 1, 1

def when(second):
    stamp = rtklib.Arr1Ddouble(6)
    for k, part in enumerate((2018, 10, 4, 13, 5, second)):
        stamp[k] = part
    return rtklib.epoch2time(stamp)

for k in range(4):
    row.time, row.eventime, row.timevalid = when(1.0 + k), when(0.25 + k), int(k > 0)
    rtklib.outrnxobsb(out, options, row, 1, 5)
del out  # closes the file
"""


@pytest.mark.parametrize("version", [211, 304])
def test_marks_are_recognised_as_rtklib_writes_them(tmp_path, version):
    """Oracle: RTKLIB EX's own writer of events, in a process of its own; of four marks it calls the
    first not valid.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    subprocess.run(
        [sys.executable, "-c", RTKLIB_WRITES, str(tmp_path / "body"), str(version)],
        check=True,
        timeout=60,
    )
    path = tmp_path / "rover.obs"
    path.write_text(
        (w.header2(["C1"]) if version < 300 else w.header3({"G": ["C1C"]}))
        + (tmp_path / "body").read_text()
    )
    found = camera_events(read_observations(path))
    assert_allclose(
        found.time, 4 * 86400 + 13 * 3600 + 300.25 + np.arange(1, 4), rtol=0.0, atol=1e-7
    )
    assert "1 of 4 are marked as not valid" in found.notes[0].found


def test_marks_that_the_receiver_calls_not_valid_are_left_out_and_told(tmp_path):
    """Oracle: what was written: the first two of sixty marks had no valid time; `invalid_events`
    takes them all the same.
    """
    observations = flown(tmp_path, SHOTS, [INVALID] * 2 + [()] * 58)
    found = camera_events(observations)
    assert_allclose(found.time, TOW + SHOTS[2:], rtol=0.0, atol=1e-9)
    assert found.images == tuple(str(k) for k in range(1, 59))
    told = next(check for check in found.notes if check.name == "time marks")
    times = ", ".join(f"{TOW + t:.3f} s" for t in SHOTS[:2])
    assert (
        told.found
        == f"2 of 60 are marked as not valid by the receiver, at {times}, and are left out"
    )
    assert "camera.invalid_events" in told.advice
    kept = camera_events(observations, RoverEvents(invalid_events=True))
    assert kept.time.size == 60
    assert "and are taken" in kept.notes[0].found


def test_marks_without_a_valid_time_alone_are_no_exposures(tmp_path):
    """Oracle: the file, every mark of which is not valid: refused where they are asked for, with
    the line of the first and the way out, else told with the same way out."""
    observations = flown(tmp_path, SHOTS[:7], [INVALID] * 7)
    with pytest.raises(
        InputError,
        match=(
            r"rover\.rnx:\d+: camera events: 7 of 7 are marked as not valid.* s and 2 more; camera"
        ),
    ):
        camera_events(observations)
    assert camera_events(observations, RoverEvents(invalid_events=True)).time.size == 7
    events, (told,) = unasked_events(observations)
    assert events is None
    assert (told.name, told.verdict) == ("time marks", "note")
    assert told.found.startswith("7 of 7 are marked as not valid by the receiver, at ")
    assert "camera.invalid_events" in told.advice
    assert unasked_events(flown(tmp_path, [])) == (None, ())
    events, told = unasked_events(flown(tmp_path, SHOTS[:7]))
    assert (events.time.size, told) == (7, ())


def test_images_of_marks_that_are_not_valid_are_told_where_counts_do_not_agree(tmp_path):
    """Oracle: sixty images, of which two have marks that are not valid; what was left out stands in
    the one line.
    """
    events = camera_events(flown(tmp_path, SHOTS, [INVALID] * 2 + [()] * 58))
    with pytest.raises(
        InputError,
        match=r"58 camera events and 60 images;.*; time marks: 2 of 60 are marked.* left out",
    ) as told:
        name_events(events, NAMES)
    assert "\n" not in str(told.value)
    named = name_events(events, NAMES, skip_images=NAMES[:2])
    assert named.images == NAMES[2:]
    assert [check.name for check in named.notes] == ["time marks"]


def test_double_and_late_events(tmp_path):
    """Oracle: the house's rule: the same stamp once, late ones in order where they are few, both
    told.
    """
    shots = np.sort(np.append(SHOTS, SHOTS[7]))
    found = camera_events(flown(tmp_path, shots))
    assert_allclose(found.time, TOW + SHOTS, rtol=0.0, atol=1e-9)
    assert "1 double rows left out" in found.notes[0].found


def test_events_outside_of_the_epochs_are_told(tmp_path):
    """Oracle: an event behind the last epoch, which is at 149 s."""
    found = camera_events(flown(tmp_path, np.append(SHOTS, 149.5)))
    assert "1 of 61 lie outside of the epochs" in found.notes[0].found


@pytest.mark.parametrize("lines", [0, 2])
def test_a_file_can_be_written_without_its_events(tmp_path, lines):
    """Oracle: the same file written without them, byte by byte; other events go as well."""
    observations = flown(tmp_path, SHOTS, [[w.record("shot", "COMMENT")] * lines] * 60)
    for_engine = engine_observations(observations)
    assert for_engine == engine_observations(flown(tmp_path, []))
    path = tmp_path / "moves.rnx"
    text = (tmp_path / "rover.rnx").read_text()
    path.write_text(text + w.event3(None, 2) + w.event3((2018, 10, 4, 13, 0, 0.0)))
    assert engine_observations(read_observations(path)) == for_engine


def test_a_file_without_events_is_refused(tmp_path):
    """Oracle: the file."""
    with pytest.raises(InputError, match="holds no external event"):
        camera_events(flown(tmp_path, []))


def test_events_of_the_simulated_flight_match_the_truth():
    """Oracle: the instants that the simulation wrote beside its file."""
    if not (DATA / "rinex_sim_6min").is_dir():
        pytest.skip("the recording rinex_sim_6min is not here")
    observations = read_observations(DATA / "rinex_sim_6min" / "rover.18o")
    truth = np.load(DATA / "rinex_sim_6min" / "truth.npz")["events"]
    assert_allclose(camera_events(observations).time, truth, rtol=0.0, atol=1e-7)
