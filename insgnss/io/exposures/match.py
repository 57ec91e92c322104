"""Events and images that belong together, by their order.

A camera's event is stamped at its pulse; the exposure's middle comes a constant delay later:

    time = stamp + delay                                                                       (E.1)

Names are matched by order, and one event or image too many or too few moves every name behind it.
So the counts must agree. Where they do not, the match is refused with the place where an event or
an image seems to be missing: by the images' own times, whose clock may be off by any constant; else
by the gaps in their numbers; else by the longest interval. The answer is `skip_events` or
`skip_images`.

Counts agree, too, where one of each is missing. So the images' own times are asked first
(`clocks`): where they show the order wrong, it is refused; where they fit neither the order nor
another match, as they may not be those of the exposures, that is noted.
Times that fall by less than a second, from a camera that writes its fractions wrong, are not asked.
"""

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.errors import InputError, UsageError
from ...base.wording import setting, some, spell
from ...records import Array, CameraEvents, Finding
from ...records.cameras.mounting import LONGEST_DELAY_S
from ..formats.events.events import UNNAMED
from ..formats.text.order import note
from .clocks import ClockMatch, match_clocks, misfit

FEWEST_TIMES = 3  # times of images by which a match is looked for: two differences agree by chance
# fall (s) of the images' times up to which a note does: stamps in whole seconds make it
UNSURE_FALL_S = 1.0


def name_events(
    events: CameraEvents,
    images: Sequence[str] | None,
    *,
    taken_s: ArrayLike | None = None,
    skip_events: Collection[int] = (),
    skip_images: Collection[str] = (),
) -> CameraEvents:
    """Give events of any source the names of images in order.

    Parameters
    ----------
    events : CameraEvents
        The events; without images they keep their names.
    images : sequence of str, optional
        Names in the order of exposure.
    taken_s : array_like, shape (n,), optional
        s, of each image by a clock of its own (Exif), any zero.
    skip_events : collection of int
        Numbers, from 1, of events without an image.
    skip_images : collection of str
        Names without an event.

    Raises
    ------
    InputError
        Where the events have names of their own as well, events and images are not the same number,
        or `taken_s` shows another order.
    UsageError
        For skipping an event or image that does not exist.
    """
    path, count, notes = events.source or "camera events", events.time.size, events.notes
    _check_skipped(path, "events", skip_events, range(1, count + 1))
    _check_skipped(path, "images", skip_images, images or ())
    number = np.array([k + 1 for k in range(count) if k + 1 not in skip_events], dtype=np.int64)
    time = events.time[number - 1]
    names = [events.images[k - 1] for k in number]
    if images is not None:
        _refuse_named(path, events)
        notes = tuple(check for check in notes if check.name != UNNAMED)
        kept = [k for k, name in enumerate(images) if name not in skip_images]
        names = [images[k] for k in kept]
        image_times_s, doubts = (
            (None, ()) if taken_s is None else _image_times(path, taken_s, images, kept)
        )
        notes += doubts + _Match(path, time, number, names, image_times_s, notes).checked()
    return replace(events[number - 1], images=tuple(names), source=path, notes=notes)


def check_delay(delay_s: float) -> None:
    """Raise UsageError for a delay, s, that is no number or beyond 10 s."""
    if not abs(delay_s) <= LONGEST_DELAY_S:
        raise UsageError(
            f"camera delay {delay_s} s is outside +-{LONGEST_DELAY_S:g} s; give it in seconds"
        )


def delay_events(events: CameraEvents, delay_s: float) -> CameraEvents:
    """Return the events at the middles of their exposures, `delay_s` behind the stamps (E.1).

    Raises
    ------
    UsageError
        As `check_delay` raises it.
    """
    check_delay(delay_s)
    return replace(events, time=events.time + delay_s)


def _refuse_named(path: str, events: CameraEvents) -> None:
    """Refuse events whose names are more than numbers."""
    if names := [name for name in events.images if not name.isdecimal()]:
        message = (
            f"the events already have image names ({names[0]}), and a list of images gives names as"
            " well; leave the list out"
        )
        raise InputError.in_file(
            path, f"{message}, or give the events by columns without the names"
        )


def _check_skipped(
    path: str, kind: str, skipped: Collection[object], available: Collection[object]
) -> None:
    if unknown := [item for item in skipped if item not in available]:
        raise UsageError(
            f"{path}: {spell(f'camera.skip_{kind}')} names {unknown[0]}, which is none of the"
            f" {len(available)} {kind}"
        )


def _image_times(
    path: str, taken_s: ArrayLike, images: Sequence[str], kept: Sequence[int]
) -> tuple[Array | None, tuple[Finding, ...]]:
    """The own times (n,) s of the images at the places `kept`, None with a note where their
    fractions of a second cannot be right.
    """
    image_times_s = np.asarray(taken_s, dtype=np.float64)
    if image_times_s.shape != (len(images),) or not np.isfinite(image_times_s).all():
        raise UsageError(
            f"the images' own times have the shape {image_times_s.shape}, expected {len(images)}"
            " finite numbers, one an image"
        )
    image_times_s = image_times_s[kept]
    if image_times_s.size < 2 or (step := np.diff(image_times_s)).min() >= 0.0:
        return image_times_s, ()
    k = int(np.argmin(step))
    finding = (
        f"image {images[kept[k + 1]]} was taken {-step[k]:.3f} s before {images[kept[k]]}, by the"
        " images' own times"
    )
    if -step[k] < UNSURE_FALL_S:
        return None, (
            note(
                "times of the images",
                f"{finding}; these times were not used",
                "times in order",
                "images and events were paired by their order",
            ),
        )
    raise InputError.in_file(path, f"{finding}; order them by exposure, in a list of their names")


@dataclass(frozen=True)
class _Match:
    """Events (n,), s and number from 1, and names (m,) that are to belong together, the images' own
    times (m,) s or None, and the notes of reading the events."""

    path: str
    time: Array
    number: NDArray[np.int64]
    names: Sequence[str]
    taken: Array | None
    event_notes: Sequence[Finding]

    def checked(self) -> tuple[Finding, ...]:
        """Notes of the match; InputError with the place where something is missing where there is
        none.
        """
        if self.time.size == len(self.names):
            return self.in_order()
        hint = self.by_clocks() or _number_advice(self.time, self.number, self.names)
        hint = hint or _interval_advice(self.time, self.number, len(self.names))
        raise self.refusal(f"one too many or too few shifts all later names: {hint}", "; ")

    def in_order(self) -> tuple[Finding, ...]:
        """Notes of as many images as events; InputError where their times show another order."""
        notes: tuple[Finding, ...] = ()
        timed = self.taken is not None and self.time.size >= FEWEST_TIMES
        discrepancy = misfit(self.time, self.taken) if timed and self.taken is not None else None
        if discrepancy is not None and discrepancy.better is not None:
            matched = _clock_advice(discrepancy.better, self.number, self.names)
            raise self.refusal(
                f"but they do not fit in time: {matched}; if the times are wrong, give a list of"
                " the names"
            )
        if discrepancy is not None:
            names = some([self.names[row] for row in discrepancy.images], 5)
            finding = (
                f"{len(discrepancy.images)} of {len(self.names)} are off by more than"
                f" {discrepancy.near_s:.2f}"
                f" s: {names}"
            )
            advice = (
                "images were paired by order; cameras that stamp the end of writing differ so; else"
                " check that no event or image is missing"
            )
            notes = (
                note("times of the images", finding, "times of the events plus a constant", advice),
            )
        if (not timed or notes) and (gaps := _number_gaps(self.names)):
            finding = f"as many images as events, but image numbers skip {some(gaps, 5)}"
            advice = "check that no event is missing or additional"
            notes += (note("names of the images", finding, "numbers without a gap", advice),)
        return notes

    def by_clocks(self) -> str:
        """What the images' own times say of another number of events, empty without them or with
        too few; InputError for other flights.
        """
        if self.taken is None or min(self.time.size, self.taken.size) < FEWEST_TIMES:
            return ""
        match = match_clocks(self.time, self.taken)
        if 2 * (pairs := self.taken.size - len(match.images)) < min(
            self.time.size, self.taken.size
        ):
            message = (
                f"but by the images' own times only {pairs} of {self.taken.size} images pair with"
                " an event"
            )
            raise self.refusal(
                f"{message}; see that these are images of this flight; if the times are wrong,"
                " give a"
                " list of the names"
            )
        return _clock_advice(match, self.number, self.names)

    def refusal(self, message: str, joint: str = ", ") -> InputError:
        """The error `message` behind the counts, with the notes of reading the events."""
        remarks = "".join(f"; {check.name}: {check.found}" for check in self.event_notes)
        return InputError.in_file(
            self.path,
            f"{self.time.size} camera events and {len(self.names)} images{joint}{message}{remarks}",
        )


def _clock_advice(match: ClockMatch, number: NDArray[np.int64], names: Sequence[str]) -> str:
    """Return which events and images have no partner by the clock, as advice."""
    events = [int(number[k]) for k in match.events]
    images = [names[k] for k in match.images]
    summary = (
        f"by the images' own times (offset {match.offset_s:.3f} s, remainder {match.rms_s:.3f} s)"
    )
    if events:
        summary += f" no image belongs to event {some(events, 5)}"
    if images:
        summary += f"{' and' if events else ''} no event to image {some(images, 5)}"
    left_out = {"camera.skip_events": events[:8], "camera.skip_images": images[:8]}
    answer = [setting(key, skipped) for key, skipped in left_out.items() if skipped]
    return f"{summary}; if that is so, set {' and '.join(answer)}"


def _number_advice(time: Array, number: NDArray[np.int64], names: Sequence[str]) -> str:
    """Advice from gaps in the images' numbers, if they are as many as events without an image."""
    gaps = _number_gaps(names)
    if not gaps or len(gaps) != time.size - len(names):
        return ""
    start = _numbers(names)[0]
    events = [int(number[gap - start]) for gap in gaps]
    answer = setting("camera.skip_events", events[:8])
    return (
        f"the image numbers skip {some(gaps, 5)}; if these images were exposed and lost, set"
        f" {answer}"
    )


def _interval_advice(time: Array, number: NDArray[np.int64], count: int) -> str:
    """Return advice for events and images of unlike number, from the intervals of events."""
    step = np.diff(time)
    if step.size == 0:
        return (
            f"list events without an image in {spell('camera.skip_events')}, images without an"
            f" event in {spell('camera.skip_images')}"
        )
    if time.size == 2 * count and np.median(step[::2]) < 0.5 * np.median(
        step[1::2] if step.size > 1 else step
    ):
        ms = 1e3 * float(np.median(step[::2]))
        finding = f"the events come in pairs {ms:.1f} ms apart, as from both edges of a pulse"
        return f"{finding}; list the events of one edge in {spell('camera.skip_events')}"
    k = int(np.argmax(step))
    where = (
        f"the longest interval of events is {step[k]:.3f} s, after event {number[k]}, the median"
        f" {np.median(step):.3f} s"
    )
    key = "camera.skip_events" if time.size > count else "camera.skip_images"
    return f"{where}; give the images' own times, or name those without a partner in {spell(key)}"


def _numbers(names: Sequence[str]) -> list[int]:
    """The last number in the stem of each name, where all have one."""
    digits = [re.findall(r"\d+", Path(name).stem) for name in names]
    return [int(item[-1]) for item in digits] if digits and all(digits) else []


def _number_gaps(names: Sequence[str]) -> list[int]:
    """Numbers that increasing numbers of images leave out; none where there are more of them than
    images.
    """
    numbers = _numbers(names)
    if (
        len(numbers) < 2
        or any(b <= a for a, b in pairwise(numbers))
        or numbers[-1] - numbers[0] >= 2 * len(numbers)
    ):
        return []
    return sorted(set(range(numbers[0], numbers[-1] + 1)) - set(numbers))
