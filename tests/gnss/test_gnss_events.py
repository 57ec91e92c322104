"""Camera events of RINEX event records and the images they belong to."""

from pathlib import Path

import numpy as np
import pytest
import written_rinex as w
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.errors import InputError, UsageError
from insgnss.formats import read_events
from insgnss.gnss.events import camera_events, image_names, match_clocks, name_events, without_events
from insgnss.gnss.rinex import read_observations

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


def test_events_get_the_names_in_order_and_the_delay(tmp_path):
    """Oracle: what was written; a delay of 12.5 ms moves every instant by 12.5 ms."""
    found = camera_events(flown(tmp_path, SHOTS), NAMES, 0.0125)
    assert found.images == NAMES
    assert found.gps_week == 2021
    assert_allclose(found.time, TOW + SHOTS + 0.0125, rtol=0.0, atol=1e-9)
    assert found.notes == ()


def test_without_names_events_are_numbered(tmp_path):
    """Oracle: the numbers from 1, and a note that says so; a skipped event keeps its number to itself."""
    found = camera_events(flown(tmp_path, SHOTS), None, skip_events=[1])
    assert found.images == tuple(str(k) for k in range(2, 61))
    assert "no image names" in found.notes[0].found


@pytest.mark.parametrize("lost", [0, 27, 59])
def test_an_image_too_few_is_refused_with_its_place(tmp_path, lost):
    """Oracle: the image that was taken away; by times of a camera clock of whole seconds, 3 h off."""
    observations = flown(tmp_path, SHOTS)
    names = NAMES[:lost] + NAMES[lost + 1 :]
    taken = np.floor(np.delete(SHOTS, lost) + 10800.37)
    with pytest.raises(
        InputError, match=rf"60 camera events and 59 images.* event {lost + 1}; .*set skip_events = \[{lost + 1}\]"
    ) as refused:
        camera_events(observations, names, taken_s=taken)
    assert "\n" not in str(refused.value)
    found = camera_events(observations, names, taken_s=taken, skip_events=[lost + 1])
    assert found.images == names
    assert_allclose(found.time, TOW + np.delete(SHOTS, lost), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("lost", [0, 31, 59])
def test_an_event_too_few_is_refused_with_its_image(tmp_path, lost):
    """Oracle: the event that was not written."""
    observations = flown(tmp_path, np.delete(SHOTS, lost))
    taken = np.round(SHOTS - 4000.0, 2)
    with pytest.raises(InputError, match=rf"59 camera events and 60 images.* no event to image {NAMES[lost]}; .*skip_images"):
        camera_events(observations, NAMES, taken_s=taken)
    found = camera_events(observations, NAMES, taken_s=taken, skip_images=[NAMES[lost]])
    assert found.images == NAMES[:lost] + NAMES[lost + 1 :]


def test_one_too_many_and_one_too_few_are_found_behind_equal_counts(tmp_path):
    """Oracle: the event and the image that were taken away; without times the counts agree and nothing can be said."""
    observations = flown(tmp_path, np.delete(SHOTS, 40))
    names, taken = NAMES[:10] + NAMES[11:], np.delete(SHOTS, 10) + 77.0
    with pytest.raises(InputError, match=rf"do not fit in time: .* event 11 and no event to image {NAMES[40]}"):
        camera_events(observations, names, taken_s=taken)
    found = camera_events(observations, names)
    assert "leave out 111" in found.notes[0].found


def test_gaps_in_the_numbers_tell_what_was_lost(tmp_path):
    """Oracle: the two images that were taken away."""
    names = [name for name in NAMES if name not in (NAMES[4], NAMES[50])]
    with pytest.raises(InputError, match=r"60 camera events and 58 images.* leave out 105, 151; .* skip_events = \[5, 51\]"):
        camera_events(flown(tmp_path, SHOTS), names)


def test_without_any_hint_the_longest_interval_is_shown(tmp_path):
    """Oracle: the gap that was written, some 20 s behind the third event, of test exposures on the ground."""
    shots = np.concatenate([SHOTS[:3], SHOTS[3:] + 20.0])
    with pytest.raises(InputError, match=r"60 camera events and 57 images.*longest interval is 2\d\.\d+ s, behind event 3, the median"):
        camera_events(flown(tmp_path, shots), NAMES[:57])


def test_both_edges_of_a_pulse_are_recognised(tmp_path):
    """Oracle: pairs of events 8 ms apart."""
    shots = np.sort(np.concatenate([SHOTS, SHOTS + 0.008]))
    observations = flown(tmp_path, shots)
    with pytest.raises(InputError, match=r"in pairs 8\.0 ms apart, as from both edges"):
        camera_events(observations, NAMES)
    found = camera_events(observations, NAMES, skip_events=range(2, 121, 2))
    assert_allclose(found.time, TOW + SHOTS, rtol=0.0, atol=1e-9)


def test_two_inputs_are_told_apart_by_their_record_lines(tmp_path):
    """Oracle: what was written: every second event comes from another input."""
    records = [[w.record(f"EVENT {'AB'[k % 2]}", "COMMENT")] for k in range(60)]
    found = camera_events(flown(tmp_path, SHOTS, records), NAMES[:30], containing="EVENT B")
    assert_allclose(found.time, TOW + SHOTS[1::2], rtol=0.0, atol=1e-9)
    with pytest.raises(InputError, match="has a record line with 'EVENT C'"):
        camera_events(flown(tmp_path, SHOTS, records), NAMES, containing="EVENT C")


def test_double_and_late_events(tmp_path):
    """Oracle: the house's rule: the same stamp once, late ones in order where they are few, both told."""
    shots = np.sort(np.append(SHOTS, SHOTS[7]))
    found = camera_events(flown(tmp_path, shots), NAMES)
    assert_allclose(found.time, TOW + SHOTS, rtol=0.0, atol=1e-9)
    assert "1 double rows left out" in found.notes[0].found


def test_events_outside_of_the_epochs_are_told(tmp_path):
    """Oracle: an event behind the last epoch, which is at 149 s."""
    found = camera_events(flown(tmp_path, np.append(SHOTS, 149.5)), None)
    assert "1 of 61 lie outside of the epochs" in found.notes[0].found


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"delay_s": 12.5}, UsageError, "give it in seconds"),
        ({"delay_s": float("nan")}, UsageError, "give it in seconds"),
        ({"skip_events": [61]}, UsageError, "skip_events names 61, which is none of the 60 events"),
        ({"skip_images": ["x"]}, UsageError, "skip_images names x, which is none of the 60 images"),
        ({"taken_s": [1.0]}, UsageError, "expected 60 finite numbers"),
        ({"taken_s": np.append(SHOTS[:-1], 0.0)}, InputError, "image DSC00160.JPG was taken before"),
        ({"taken_s": np.linspace(0.0, 9.0, 60)}, InputError, "of 60 images pair with an event"),
        ({"images": [*NAMES[:-1], NAMES[0]]}, InputError, "occurs twice"),
    ],
)
def test_what_cannot_be_is_refused(tmp_path, options, error, message):
    """Oracle: the fault that was put in."""
    with pytest.raises(error, match=message):
        camera_events(flown(tmp_path, SHOTS), **({"images": NAMES} | options))


def test_events_of_other_files_are_matched_by_the_same_rules(tmp_path):
    """Oracle: a text file of times without names, one image lost."""
    path = tmp_path / "events.txt"
    path.write_text("".join(f"{TOW + t:.7f}\n" for t in SHOTS))
    events = read_events(path, gps_week=2021)
    names = NAMES[:7] + NAMES[8:]
    with pytest.raises(InputError, match=r"events.txt: 60 camera events and 59 images.* leave out 108; .* skip_events = \[8\]"):
        name_events(events, names)
    found = name_events(events, names, -0.05, skip_events=[8])
    assert (found.images, found.gps_week) == (names, 2021)
    assert_allclose(found.time, TOW + np.delete(SHOTS, 7) - 0.05, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("lines", [0, 2])
def test_a_file_can_be_written_without_its_events(tmp_path, lines):
    """Oracle: the same file written without them, byte by byte; other events stay."""
    observations = flown(tmp_path, SHOTS, [[w.record("shot", "COMMENT")] * lines] * 60)
    there = without_events(observations).decode()
    flown(tmp_path, [])
    assert there == (tmp_path / "rover.rnx").read_text()
    path = tmp_path / "moves.rnx"
    path.write_text(there + w.event3(None, 2) + w.event3((2018, 10, 4, 13, 0, 0.0)))
    assert without_events(read_observations(path)).decode() == there + w.event3(None, 2)


def test_a_file_without_events_is_refused(tmp_path):
    """Oracle: the file."""
    with pytest.raises(InputError, match="holds no external event"):
        camera_events(flown(tmp_path, []), NAMES)


@pytest.mark.parametrize("seed", range(5))
def test_clocks_are_matched_whatever_is_lost(seed):
    """Oracle: the events and images that were taken away, up to four of each, and the offset of the clocks to its resolution."""
    rng = np.random.default_rng(seed)
    shots = np.cumsum(rng.uniform(1.9, 2.3, 300))
    events, images = (np.sort(rng.choice(300, n, replace=False)) for n in rng.integers(0, 5, 2))
    images = np.setdiff1d(images, events)
    kept_events, kept_images = np.delete(shots, events), np.round(np.delete(shots, images) + 1234.5, 1)
    match = match_clocks(kept_events, kept_images)
    assert_array_equal(np.delete(np.arange(300), events)[list(match.events)], images)
    assert_array_equal(np.delete(np.arange(300), images)[list(match.images)], events)
    assert abs(match.offset_s - 1234.5) < 0.01
    assert match.rms_s < 0.06


def test_names_of_a_directory_are_in_the_order_of_their_numbers(tmp_path):
    """Oracle: the numbers."""
    for name in ("IMG_10.JPG", "IMG_9.JPG", "IMG_101.JPG", "notes.txt", ".hidden.jpg"):
        (tmp_path / name).touch()
    assert image_names(tmp_path) == ("IMG_9.JPG", "IMG_10.JPG", "IMG_101.JPG")
    (tmp_path / "IMG_9.ARW").touch()
    with pytest.raises(InputError, match=r"the same image as \.ARW and \.JPG; say which"):
        image_names(tmp_path)
    assert image_names(tmp_path, "arw") == ("IMG_9.ARW",)
    with pytest.raises(InputError, match="holds no image"):
        image_names(tmp_path, ".png")


def test_names_of_a_list_stand_as_they_are(tmp_path):
    """Oracle: the list."""
    path = tmp_path / "images.txt"
    path.write_text("\ufeff# in order\nB.tif\n\nA.tif\r\n", encoding="utf-8")
    assert image_names(path) == ("B.tif", "A.tif")
    path.write_text("A.tif\nA.tif\n")
    with pytest.raises(InputError, match=r"image 'A.tif' occurs twice"):
        image_names(path)
    with pytest.raises(InputError, match="cannot be read"):
        image_names(tmp_path / "none.txt")


def test_events_of_the_simulated_flight_match_the_truth():
    """Oracle: the instants that the simulation wrote beside its file."""
    if not (DATA / "rinex_sim_6min").is_dir():
        pytest.skip("the recording rinex_sim_6min is not here")
    observations = read_observations(DATA / "rinex_sim_6min" / "rover.18o")
    truth = np.load(DATA / "rinex_sim_6min" / "truth.npz")["events"]
    found = camera_events(observations, [f"{8001 + k}.tif" for k in range(truth.size)], 0.003)
    assert_allclose(found.time, truth + 0.003, rtol=0.0, atol=1e-7)
