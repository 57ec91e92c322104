"""Camera events and the images that belong to them: names in order, and the place where one is
missing.
"""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from insgnss.base.errors import InputError, UsageError
from insgnss.io.exposures.clocks import match_clocks, misfit
from insgnss.io.exposures.match import delay_events, name_events
from insgnss.io.formats import read_events
from insgnss.io.formats.events.events import numbered_names
from insgnss.records import CameraEvents, Check

TOW = 4 * 86400 + 43200.0
SHOTS = np.round(np.cumsum(np.random.default_rng(4).uniform(1.6, 2.4, 60)), 7)
NAMES = tuple(f"DSC{k:05d}.JPG" for k in range(101, 161))


def flown(shots, *notes):
    """Events with numbers alone at the shots."""
    names, told = numbered_names(len(shots))
    return CameraEvents(names, TOW + np.asarray(shots), 2021, "rover.rnx", (*notes, told))


def test_events_get_the_names_in_order_and_the_delay():
    """Oracle: what was written; a delay of 12.5 ms moves every instant by 12.5 ms."""
    found = delay_events(name_events(flown(SHOTS), NAMES), 0.0125)
    assert found.images == NAMES
    assert found.gps_week == 2021
    assert_allclose(found.time, TOW + SHOTS + 0.0125, rtol=0.0, atol=1e-9)
    assert found.notes == ()


def test_without_names_events_are_numbered():
    """Oracle: the numbers from 1, and a note that says so; a skipped event keeps its number to
    itself.
    """
    found = name_events(flown(SHOTS), None, skip_events=[1])
    assert found.images == tuple(str(k) for k in range(2, 61))
    assert "no image names" in found.notes[0].found


@pytest.mark.parametrize("lost", [0, 27, 59])
def test_an_image_too_few_is_refused_with_its_place(lost):
    """Oracle: the image taken away; by times of a camera clock of whole seconds, 3 h off."""
    observations = flown(SHOTS)
    names = NAMES[:lost] + NAMES[lost + 1 :]
    taken = np.floor(np.delete(SHOTS, lost) + 10800.37)
    with pytest.raises(
        InputError,
        match=(
            rf"60 camera events and 59 images.* event {lost + 1}; .*set camera\.skip_events ="
            rf" \[{lost + 1}\]"
        ),
    ) as refused:
        name_events(observations, names, taken_s=taken)
    assert "\n" not in str(refused.value)
    found = name_events(observations, names, taken_s=taken, skip_events=[lost + 1])
    assert found.images == names
    assert_allclose(found.time, TOW + np.delete(SHOTS, lost), rtol=0.0, atol=1e-9)


@pytest.mark.parametrize("lost", [0, 31, 59])
def test_an_event_too_few_is_refused_with_its_image(lost):
    """Oracle: the event that was not written."""
    observations = flown(np.delete(SHOTS, lost))
    taken = np.round(SHOTS - 4000.0, 2)
    with pytest.raises(
        InputError,
        match=rf"59 camera events and 60 images.* no event to image {NAMES[lost]}; .*skip_images",
    ):
        name_events(observations, NAMES, taken_s=taken)
    found = name_events(observations, NAMES, taken_s=taken, skip_images=[NAMES[lost]])
    assert found.images == NAMES[:lost] + NAMES[lost + 1 :]


def test_one_too_many_and_one_too_few_are_found_behind_equal_counts():
    """Oracle: the event and the image that were taken away; without times the counts agree and
    nothing can be said.
    """
    observations = flown(np.delete(SHOTS, 40))
    names, taken = NAMES[:10] + NAMES[11:], np.delete(SHOTS, 10) + 77.0
    with pytest.raises(
        InputError, match=rf"do not fit in time: .* event 11 and no event to image {NAMES[40]}"
    ):
        name_events(observations, names, taken_s=taken)
    found = name_events(observations, names)
    assert "skip 111" in found.notes[0].found


def test_gaps_in_the_numbers_tell_what_was_lost():
    """Oracle: the two images that were taken away."""
    names = [name for name in NAMES if name not in (NAMES[4], NAMES[50])]
    with pytest.raises(
        InputError,
        match=(
            r"60 camera events and 58 images.* skip 105, 151; .* camera\.skip_events = \[5,"
            r" 51\]"
        ),
    ):
        name_events(flown(SHOTS), names)


def test_what_the_reader_left_out_is_told_with_the_counts():
    """Oracle: the note; that the events have no names is none, once images name them."""
    odd = Check("event rows", "1 double rows left out, of 61", "each stamp once", "note")
    with pytest.raises(
        InputError,
        match=r"60 camera events and 59 images.*; event rows: 1 double rows left out, of 61$",
    ):
        name_events(flown(SHOTS, odd), NAMES[:-1])
    assert name_events(flown(SHOTS, odd), NAMES).notes == (odd,)


def test_events_that_have_names_are_not_named_again():
    """Oracle: the names; numbers, as an .MRK has them, are none."""
    own = CameraEvents(NAMES, TOW + SHOTS, 2021, "Events.txt")
    with pytest.raises(
        InputError,
        match=(
            r"Events\.txt: the events already have image names \(DSC00101\.JPG\).*leave the"
            r" list out"
        ),
    ):
        name_events(own, NAMES)
    assert name_events(own, None, skip_events=[1]).images == NAMES[1:]
    counted = CameraEvents(tuple(str(k) for k in range(7, 67)), TOW + SHOTS, 2021, "Timestamp.MRK")
    assert name_events(counted, NAMES).images == NAMES


def test_without_any_hint_the_longest_interval_is_shown():
    """Oracle: the gap that was written, some 20 s behind the third event, of test exposures on the
    ground.
    """
    shots = np.concatenate([SHOTS[:3], SHOTS[3:] + 20.0])
    with pytest.raises(
        InputError,
        match=(
            r"60 camera events and 57 images.*longest interval of events is 2\d\.\d+ s, after"
            r" event 3, the median"
        ),
    ):
        name_events(flown(shots), NAMES[:57])


def test_both_edges_of_a_pulse_are_recognised():
    """Oracle: pairs of events 8 ms apart."""
    shots = np.sort(np.concatenate([SHOTS, SHOTS + 0.008]))
    observations = flown(shots)
    with pytest.raises(InputError, match=r"in pairs 8\.0 ms apart, as from both edges"):
        name_events(observations, NAMES)
    found = name_events(observations, NAMES, skip_events=range(2, 121, 2))
    assert_allclose(found.time, TOW + SHOTS, rtol=0.0, atol=1e-9)


@pytest.mark.parametrize(
    ("options", "error", "message"),
    [
        ({"skip_events": [61]}, UsageError, "skip_events names 61, which is none of the 60 events"),
        ({"skip_images": ["x"]}, UsageError, "skip_images names x, which is none of the 60 images"),
        ({"taken_s": [1.0]}, UsageError, "expected 60 finite numbers"),
        (
            {"taken_s": np.append(SHOTS[:-1], 0.0)},
            InputError,
            r"image DSC00160.JPG was taken 1\d+\.\d+ s before",
        ),
        (
            {"taken_s": np.linspace(0.0, 9.0, 59), "images": NAMES[:-1]},
            InputError,
            "of 59 images pair with an event",
        ),
        ({"images": [*NAMES[:-1], NAMES[0]]}, InputError, "occurs twice"),
    ],
)
def test_what_cannot_be_is_refused(options, error, message):
    """Oracle: the fault that was put in."""
    with pytest.raises(error, match=message):
        name_events(flown(SHOTS), **({"images": NAMES} | options))


@pytest.mark.parametrize("delay", [12.5, float("nan")])
def test_a_delay_that_is_none_is_refused(delay):
    """Oracle: the limit of 10 s."""
    with pytest.raises(UsageError, match="give it in seconds"):
        delay_events(flown(SHOTS), delay)


def test_events_of_other_files_are_matched_by_the_same_rules(tmp_path):
    """Oracle: a text file of times without names, one image lost."""
    path = tmp_path / "events.txt"
    path.write_text("".join(f"{TOW + t:.7f}\n" for t in SHOTS))
    events = read_events(path, gps_week=2021)
    names = NAMES[:7] + NAMES[8:]
    with pytest.raises(
        InputError,
        match=(
            r"events.txt: 60 camera events and 59 images.* skip 108; .* camera\.skip_events ="
            r" \[8\]"
        ),
    ):
        name_events(events, names)
    found = delay_events(name_events(events, names, skip_events=[8]), -0.05)
    assert (found.images, found.gps_week) == (names, 2021)
    assert_allclose(found.time, TOW + np.delete(SHOTS, 7) - 0.05, rtol=0.0, atol=1e-7)


@pytest.mark.parametrize("seed", range(5))
def test_clocks_are_matched_whatever_is_lost(seed):
    """Oracle: the events and images that were taken away, up to four of each, and the offset of the
    clocks to its resolution.
    """
    rng = np.random.default_rng(seed)
    shots = np.cumsum(rng.uniform(1.9, 2.3, 300))
    events, images = (np.sort(rng.choice(300, n, replace=False)) for n in rng.integers(0, 5, 2))
    images = np.setdiff1d(images, events)
    kept_events, kept_images = (
        np.delete(shots, events),
        np.round(np.delete(shots, images) + 1234.5, 1),
    )
    match = match_clocks(kept_events, kept_images)
    assert_array_equal(np.delete(np.arange(300), events)[list(match.events)], images)
    assert_array_equal(np.delete(np.arange(300), images)[list(match.images)], events)
    assert abs(match.offset_s - 1234.5) < 0.01
    assert match.rms_s < 0.06


@pytest.mark.parametrize(("events", "images"), [(0, 3), (3, 0), (0, 0)])
def test_nothing_is_matched_where_one_side_is_empty(events, images):
    """Oracle: the definition."""
    match = match_clocks(np.arange(float(events)), np.arange(float(images)))
    assert (match.events, match.images) == (tuple(range(events)), tuple(range(images)))
    assert match.rms_s == np.inf


def lost(event, image, n=60):
    """Times of n events and n images of n + 1 exposures, of which one was not stamped and another
    not kept (numbers from 1).
    """
    shots = np.cumsum(np.random.default_rng(11).uniform(1.6, 2.4, n + 1))
    return np.delete(shots, event - 1), np.delete(shots, image - 1) + 5000.0


STAMPS = {
    "exact": lambda taken: taken,
    "hundredths": lambda taken: np.floor(100.0 * taken) / 100.0,
    "whole seconds": np.floor,
    "written 0 to 0.3 s later": lambda taken: (
        taken + np.random.default_rng(3).uniform(0.0, 0.3, taken.size)
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("stamps", STAMPS)
@pytest.mark.parametrize(
    ("event", "image", "n"), [(8, 2, 9), (2, 8, 9), (41, 11, 60), (30, 32, 60), (1, 61, 60)]
)
def test_one_of_each_missing_is_refused_whatever_the_camera_stamps(stamps, event, image, n):
    """Oracle: the exposure that has no event and the one that has no image, also where that moves
    all others.
    """
    time, taken = lost(event, image, n)
    found = misfit(time, STAMPS[stamps](taken))
    assert found is not None
    assert found.better is not None
    assert found.better.events == (image - 1 - (image > event),)
    assert found.better.images == (event - 1 - (event > image),)


@pytest.mark.parametrize("stamps", STAMPS)
def test_times_that_fit_say_nothing(stamps):
    """Oracle: the same exposures on both sides; a clock 20 ppm fast over the two minutes."""
    assert misfit(TOW + SHOTS, STAMPS[stamps](SHOTS * 1.00002 + 77.3)) is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_a_camera_that_stamps_the_end_of_writing_is_not_refused(seed):
    """Oracle: nothing is missing. Lines of 30 exposures 1 to 2 s apart with turns between; writing
    lags by a buffer that fills up to 4 s and is empty again behind the turn, with or without whole
    seconds."""
    rng = np.random.default_rng(seed)
    step = rng.uniform(1.0, 2.0) * rng.uniform(0.98, 1.02, 300)
    step[::30] += 20.0
    shots = np.cumsum(step)
    lag = np.minimum(
        rng.uniform(0.02, 0.3) * (np.arange(300) % 30), rng.uniform(0.5, 4.0)
    ) + rng.uniform(0.0, 0.2, 300)
    taken = np.maximum.accumulate(shots + lag)
    for stamped in (taken, np.floor(taken)):
        found = misfit(shots, stamped)
        assert found is None or found.better is None


def test_an_image_that_is_skipped_may_have_any_time():
    """Oracle: the picture of the camera's maker, of another year, before the others."""
    names, taken = ("A.JPG", *NAMES), np.append(3e7, SHOTS)
    with pytest.raises(
        InputError,
        match=r"image DSC00101.JPG was taken \d+\.\d+ s before A.JPG, .* in a list of their names",
    ):
        name_events(flown(SHOTS), names, taken_s=taken)
    assert name_events(flown(SHOTS), names, taken_s=taken, skip_images=["A.JPG"]).images == NAMES


def test_times_that_do_not_tell_are_told():
    """Oracle: one image stamped 1.3 s late; a clock that stands; fractions that fall; none of them
    is refused.
    """
    late = SHOTS.copy()
    late[19] += 1.3
    found = name_events(flown(SHOTS), NAMES, taken_s=late)
    assert found.images == NAMES
    assert found.notes[0].found == "1 of 60 are off by more than 0.30 s: DSC00120.JPG"
    still = name_events(flown(SHOTS), NAMES, taken_s=np.zeros(60)).notes
    assert still[0].found.startswith("59 of 60 are off by more than 0.55 s: DSC00")
    tangled = SHOTS.copy()
    tangled[30] = tangled[29] - 0.4
    told = name_events(flown(SHOTS), NAMES, taken_s=tangled).notes
    assert (
        "DSC00131.JPG was taken 0.400 s before DSC00130.JPG, by the images' own times; these times"
        " were not used" in told[0].found
    )
    gaps = name_events(flown(SHOTS), (*NAMES[:-1], "DSC00170.JPG"), taken_s=late).notes
    assert [check.name for check in gaps] == ["times of the images", "names of the images"]
