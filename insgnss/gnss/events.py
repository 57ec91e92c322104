"""Camera events of RINEX event records, and the images they belong to.

A receiver stamps the pulse of the camera (u-blox: TIM-TM2, a mark for each rising edge) and its converter writes an external event,
flag 5, before the epoch that follows. The stamp is the pulse's; the exposure's middle comes a constant delay later:

    time = stamp + delay                                                                            (E.1)

Names are matched by order, and one event or image too many or too few moves every name behind it. So the counts must agree. Where they
do not, the match is refused with the place where an event or an image seems to be missing: by the images' own times, whose clock may be
off by any constant; else by the gaps in their numbers; else by the longest interval. The answer is `skip_events` or `skip_images`.

The offset of the images' clock is the one among the differences of single pairs that brings most events within 0.45 of the shortest
interval between events of an image, each at most once; of these the one with the smallest remainders.
"""

import math
import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..errors import InputError, UsageError
from ..formats._layout import decode, shown
from ..formats._order import note, put_in_order
from ..records import Array, CameraEvents, Check
from .rinex import EventRecord, Observations
from .rinex_header import load_rinex

IMAGE_ENDINGS = {
    *(".jpg", ".jpeg", ".tif", ".tiff", ".png", ".dng", ".raw", ".iiq", ".arw", ".cr2", ".cr3", ".nef", ".nrw", ".raf", ".rw2", ".orf"),
    *(".3fr", ".fff", ".pef", ".srw", ".x3f", ".webp", ".jp2", ".heic"),
}
SHARE_OF_INTERVAL = 0.45
LEADS = 40  # images at the start whose differences to events are tried as offsets of the images' clock
LONGEST_DELAY_S = 10.0


@dataclass(frozen=True)
class _Lines:
    """Where the events stand, for refusals."""

    path: str
    records: tuple[EventRecord, ...]

    def at(self, row: int, what: str) -> InputError:
        return InputError.at(self.path, self.records[row].line, what)


@dataclass(frozen=True)
class ClockMatch:
    """Events and images by their times: places from 0 of those without a partner, offset of the images' clock and remainder (rms), s."""

    events: tuple[int, ...]
    images: tuple[int, ...]
    offset_s: float
    rms_s: float


def camera_events(
    observations: Observations,
    images: Sequence[str] | None,
    delay_s: float = 0.0,
    *,
    taken_s: ArrayLike | None = None,
    containing: str = "",
    skip_events: Collection[int] = (),
    skip_images: Collection[str] = (),
) -> CameraEvents:
    """Mid-exposure instants of a file's external events, with the images' names in order; numbers from 1 without names.

    images : names in the order of exposure.   delay_s : s from the stamp to the middle of the exposure, positive where it comes later.
    taken_s : (n,) s of each image by a clock of its own (EXIF), any zero.   containing : take only events whose record lines hold this.
    skip_events : numbers, from 1, of events without an image, counted after `containing`.   skip_images : names without an event.
    Raises InputError where there is no event, time falls, or events and images are not the same number or do not fit `taken_s`;
    UsageError for a delay beyond 10 s and for skipping what is not there.
    """
    time, notes = _in_order(observations, containing)
    span = observations.time
    if outside := int(np.sum((time + delay_s < span[0]) | (time + delay_s > span[-1]))):
        found = f"{outside} of {time.size} lie outside of the epochs, {span[0]:.3f} to {span[-1]:.3f} s"
        notes += (note("camera events", found, "epochs before and behind each", "they get no position; leave these images out"),)
    if images is None:
        found = f"no image names; the {time.size} events are numbered from 1"
        notes += (note("camera events", found, "a name for each event", "give the images: a list or their directory"),)
    numbered = CameraEvents(tuple(str(k + 1) for k in range(time.size)), time, observations.gps_week, observations.header.path, notes)
    return name_events(numbered, images, delay_s, taken_s=taken_s, skip_events=skip_events, skip_images=skip_images)


def name_events(
    events: CameraEvents,
    images: Sequence[str] | None,
    delay_s: float = 0.0,
    *,
    taken_s: ArrayLike | None = None,
    skip_events: Collection[int] = (),
    skip_images: Collection[str] = (),
) -> CameraEvents:
    """Events of any source (RINEX, .MRK, text) with the names of `images` in order, later by `delay_s`; the rest as in `camera_events`.

    Without images the events keep their names.
    """
    if not abs(delay_s) <= LONGEST_DELAY_S:
        raise UsageError(f"camera delay {delay_s} s is outside +-{LONGEST_DELAY_S:g} s; give it in seconds")
    path, count, notes = events.source or "camera events", events.time.size, events.notes
    _check_skipped(path, "events", skip_events, range(1, count + 1))
    _check_skipped(path, "images", skip_images, images or ())
    number = np.array([k + 1 for k in range(count) if k + 1 not in skip_events], dtype=np.int64)
    time = events.time[number - 1]
    names = [events.images[k - 1] for k in number]
    if images is not None:
        given = [k for k, name in enumerate(images) if name not in skip_images]
        names = [images[k] for k in given]
        taken = None if taken_s is None else _taken(path, taken_s, images)[given]
        notes += _matched(path, time, number, names, taken)
    return CameraEvents(tuple(names), time + delay_s, events.gps_week, path, notes)  # (E.1)


def without_events(observations: Observations) -> bytes:
    """The file of these observations, unpacked, without its external events and their record lines; all else as it stands.

    RTKLIB EX 2.5 drops the epoch behind an external event where the interval between epochs is not the one before.
    """
    buf, _, _ = load_rinex(observations.header.path)
    starts = np.concatenate([[0], np.flatnonzero(buf == ord("\n")) + 1])
    gone = [(record.line - 1, record.line + len(record.records)) for record in observations.records if record.flag == 5]
    edges = [0, *(int(starts[line]) for span in gone for line in span), buf.size]
    return b"".join(buf[a:b].tobytes() for a, b in zip(edges[::2], edges[1::2], strict=True))


def _in_order(observations: Observations, containing: str) -> tuple[Array, tuple[Check, ...]]:
    """Times of the events, each once, in order."""
    path = observations.header.path
    records = tuple(record for record in observations.records if record.flag == 5)
    if not records:
        what = "holds no external event (flag 5); convert the receiver's log with its events (time marks), or give a file of events"
        raise InputError.at(path, None, what)
    records = tuple(record for record in records if containing in "\n".join(record.records))
    if not records:
        raise InputError.at(path, None, f"no external event has a record line with {shown(containing)}; read the lines of the events")
    time = np.array([record.time for record in records], dtype=np.float64)
    rows, notes = put_in_order(_Lines(path, records), time, lambda i, k: True, "camera events")
    return (time if rows is None else time[rows]), notes


def _check_skipped(path: str, kind: str, skipped: Collection[object], there: Collection[object]) -> None:
    if unknown := [item for item in skipped if item not in there]:
        raise UsageError(f"{path}: skip_{kind} names {unknown[0]}, which is none of the {len(there)} {kind}")


def _taken(path: str, taken_s: ArrayLike, images: Sequence[str]) -> Array:
    taken = np.asarray(taken_s, dtype=np.float64)
    if taken.shape != (len(images),) or not np.isfinite(taken).all():
        raise UsageError(f"the images' own times have the shape {taken.shape}, expected {len(images)} finite numbers, one an image")
    if (falls := np.diff(taken) < 0.0).any():
        k = int(np.argmax(falls)) + 1
        raise InputError.at(
            path, None, f"image {images[k]} was taken before {images[k - 1]}, by the images' own times; order them by exposure"
        )
    return taken


def _matched(path: str, time: Array, number: NDArray[np.int64], names: Sequence[str], taken: Array | None) -> tuple[Check, ...]:
    """Notes of a match; InputError with the place where something is missing where there is none."""
    counts = f"{time.size} camera events and {len(names)} images"
    match = None
    if taken is not None and min(time.size, taken.size) >= 3:
        match = match_clocks(time, taken)
        if 2 * (pairs := taken.size - len(match.images)) < min(time.size, taken.size):
            what = f"by the images' own times only {pairs} of {taken.size} images pair with an event"
            raise InputError.at(path, None, f"{counts}, but {what}; see that these are images of this flight, or leave the times out")
    found = _of_clocks(match, number, names) if match is not None and (match.events or match.images) else ""
    if time.size == len(names):
        if found:
            raise InputError.at(path, None, f"{counts}, but they do not fit in time: {found}")
        gaps = _number_gaps(names)
        if match is None and gaps:
            told = f"as many as events, but their numbers leave out {_first_of(gaps)}"
            return (note("names of the images", told, "numbers without a gap", "see that no event is missing or too many as well"),)
        return ()
    hint = found or _of_numbers(time, number, names) or _of_intervals(time, number, len(names))
    raise InputError.at(path, None, f"{counts}; one too many or too few moves all names behind it: {hint}")


def match_clocks(time: Array, taken: Array) -> ClockMatch:
    """Which events and images belong together by their times (n,) and (m,), s, of clocks that differ by an unknown constant."""
    near = SHARE_OF_INTERVAL * (float(np.min(np.diff(time))) if time.size > 1 else 1.0)
    lead = min(LEADS, taken.size)
    reach = abs(time.size - taken.size) + LEADS
    best: tuple[int, float, float] | None = None
    for i in range(lead):
        for j in range(max(0, i - reach), min(time.size, i + reach + 1)):
            offset = float(taken[i] - time[j])
            _, _, rest = _pairs(time + offset, taken, near)
            if rest.size and (best is None or (rest.size, -float(np.std(rest))) > (best[0], -best[1])):
                best = (rest.size, float(np.std(rest)), offset + float(np.mean(rest)))
    offset = best[2] if best else 0.0
    events, images, rest = _pairs(time + offset, taken, near)
    lonely_events = tuple(np.setdiff1d(np.arange(time.size), events).tolist())
    lonely_images = tuple(np.setdiff1d(np.arange(taken.size), images).tolist())
    return ClockMatch(lonely_events, lonely_images, offset, float(np.sqrt(np.mean(rest**2))) if rest.size else math.inf)


def _pairs(time: Array, taken: Array, near: float) -> tuple[NDArray[np.intp], NDArray[np.intp], Array]:
    """Events and images nearest to each other, both ways, within `near`; and image minus event, s."""
    nearest = _nearest(time, taken)
    back = _nearest(taken, time)
    rest = taken[nearest] - time
    events = np.flatnonzero((back[nearest] == np.arange(time.size)) & (np.abs(rest) <= near))
    return events, nearest[events], rest[events]


def _nearest(time: Array, others: Array) -> NDArray[np.intp]:
    """Place in the increasing `others` of the one nearest to each time."""
    after = np.clip(np.searchsorted(others, time), 1, max(others.size - 1, 1))
    if others.size == 1:
        return np.zeros(time.size, dtype=np.intp)
    return np.where(time - others[after - 1] <= others[after] - time, after - 1, after)


def _of_clocks(match: ClockMatch, number: NDArray[np.int64], names: Sequence[str]) -> str:
    events = [int(number[k]) for k in match.events]
    images = [names[k] for k in match.images]
    told = f"by the images' own times (offset {match.offset_s:.3f} s, remainder {match.rms_s:.3f} s)"
    if events:
        told += f" no image belongs to event {_first_of(events)}"
    if images:
        told += f"{' and' if events else ''} no event to image {_first_of(images)}"
    answer = [f"skip_events = {events[:8]}"] * bool(events) + [f"skip_images = {images[:8]}"] * bool(images)
    return f"{told}; if that is so, set {' and '.join(answer)}"


def _of_numbers(time: Array, number: NDArray[np.int64], names: Sequence[str]) -> str:
    """What the gaps in the images' numbers say, if they are as many as the events without an image."""
    gaps = _number_gaps(names)
    if not gaps or len(gaps) != time.size - len(names):
        return ""
    start = _numbers(names)[0]
    events = [int(number[gap - start]) for gap in gaps]
    return f"the images' numbers leave out {_first_of(gaps)}; if these were exposed and are lost, set skip_events = {events[:8]}"


def _of_intervals(time: Array, number: NDArray[np.int64], count: int) -> str:
    step = np.diff(time)
    if step.size == 0:
        return "name those that have no partner in skip_events or skip_images"
    if time.size == 2 * count and np.median(step[::2]) < 0.5 * np.median(step[1::2] if step.size > 1 else step):
        ms = 1e3 * float(np.median(step[::2]))
        return f"the events come in pairs {ms:.1f} ms apart, as from both edges of a pulse; keep the edge you want with skip_events"
    k = int(np.argmax(step))
    where = f"the longest interval is {step[k]:.3f} s, behind event {number[k]}, the median {np.median(step):.3f} s"
    more = "skip_events" if time.size > count else "skip_images"
    return f"{where}; give the images' own times, or name those without a partner in {more}"


def _numbers(names: Sequence[str]) -> list[int]:
    """The last number in the stem of each name, where all have one."""
    found = [re.findall(r"\d+", Path(name).stem) for name in names]
    return [int(item[-1]) for item in found] if found and all(found) else []


def _number_gaps(names: Sequence[str]) -> list[int]:
    """Numbers that increasing numbers of images leave out; none where there are more of them than images."""
    numbers = _numbers(names)
    if len(numbers) < 2 or any(b <= a for a, b in pairwise(numbers)) or numbers[-1] - numbers[0] >= 2 * len(numbers):
        return []
    return sorted(set(range(numbers[0], numbers[-1] + 1)) - set(numbers))


def _first_of(items: Sequence[object]) -> str:
    told = ", ".join(map(str, items[:5]))
    return told if len(items) <= 5 else f"{told} and {len(items) - 5} more"


def image_names(place: str | Path, ending: str | None = None) -> tuple[str, ...]:
    """Names of the images in a directory, in the order of the numbers in them, or of a list with one name a line, as it stands.

    ending : of the files to take, such as ".jpg"; needed where the directory holds the same images in several formats.
    Raises InputError where there is no image, a name twice, or several formats of the same image.
    """
    path = Path(place)
    if path.is_dir():
        files = [entry.name for entry in path.iterdir() if entry.is_file() and not entry.name.startswith(".")]
        endings = IMAGE_ENDINGS if ending is None else {"." + ending.lower().lstrip(".")}
        names = sorted((name for name in files if Path(name).suffix.lower() in endings), key=_natural)
        if len({Path(name).stem for name in names}) < len(names):
            kinds = sorted({Path(name).suffix for name in names})
            raise InputError.at(path, None, f"holds the same image as {' and '.join(kinds)}; say which ending to take")
    else:
        try:
            names = [line.strip() for line in decode(path.read_bytes()).removeprefix("\ufeff").splitlines()]
        except OSError as error:
            raise InputError.at(path, None, f"cannot be read: {error.strerror or error}; give a directory or a list of names") from None
        names = [name for name in names if name and not name.startswith("#")]
    if not names:
        raise InputError.at(path, None, "holds no image; check the path and the ending")
    if len(set(names)) < len(names):
        twice = next(name for k, name in enumerate(names) if name in names[:k])
        raise InputError.at(path, None, f"image {shown(twice)} occurs twice; correct the list")
    return tuple(names)


def _natural(name: str) -> tuple[tuple[int, int, str], ...]:
    """Order in which IMG_9 stands before IMG_10."""
    return tuple((1, int(part), "") if part.isdigit() else (0, 0, part.lower()) for part in re.findall(r"\d+|\D+", name))
