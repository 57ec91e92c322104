"""Camera events of RINEX event records.

A receiver stamps the pulse of the camera (u-blox: TIM-TM2, a mark for each rising edge) and its
converter writes an external event, flag 5, before the epoch that follows. The stamp is the pulse's.

RTKLIB's convbin writes the marks of a u-blox receiver that had no valid time, too, with the comment
"Time mark is not valid": their stamps may be off by anything. They are left out unless they are
requested, and reported in a note.
"""

from dataclasses import dataclass

import numpy as np

from ...base.errors import InputError
from ...base.wording import setting, some, spell
from ...io.formats.events.events import numbered_names
from ...io.formats.text.layout import quote
from ...io.formats.text.order import note, put_in_order
from ...io.options.camera_options import RoverEvents
from ...records import CameraEvents, Finding
from .observation_record import EventRecord, Observations

NOT_VALID = "time mark is not valid"
EXTERNAL_EVENT = 5  # flag of an event of the camera or another device in RINEX
MOST_TIMES_LISTED = 5  # times in a message of one line (chosen)

Records = tuple[EventRecord, ...]

ALL_VALID = RoverEvents()


@dataclass(frozen=True)
class _EventLines:
    """Where the events stand, for refusals."""

    path: str
    records: Records

    def error_at(self, row: int, message: str) -> InputError:
        return InputError.at_line(self.path, self.records[row].line, message)


def camera_events(observations: Observations, wanted: RoverEvents = ALL_VALID) -> CameraEvents:
    """Return the external events of a file, numbered from 1, each once, in order.

    Raises
    ------
    InputError
        Where there is no such event, or time falls.
    """
    path = observations.header.path
    records, left_out_notes = _exposure_events(observations, wanted)
    time = np.array([record.time for record in records], dtype=np.float64)
    rows, findings = put_in_order(
        _EventLines(path, records), time, lambda i, k: True, "camera events"
    )
    if rows is not None:
        time = time[rows]
    notes = (*left_out_notes, *findings)
    span = observations.time
    if outside := int(np.sum((time < span[0]) | (time > span[-1]))):
        finding = f"{outside} of {time.size} lie outside of the epochs"
        finding += f", {span[0]:.3f} to {span[-1]:.3f} s"
        advice = "they get no position; leave these images out"
        notes += (note("camera events", finding, "epochs before and behind each", advice),)
    names, unnamed = numbered_names(time.size)
    return CameraEvents(names, time, observations.gps_week, path, (*notes, unnamed))


def unasked_events(observations: Observations) -> tuple[CameraEvents | None, tuple[Finding, ...]]:
    """Return the events of a file where none are requested.

    None without any, and None with a note where all are marked as not valid.
    """
    records, invalid = _select_events(observations, ALL_VALID)
    if len(invalid) < len(records):
        return camera_events(observations), ()
    finding = (
        f"{_describe_invalid(records, invalid)}, and are left out, so that no exposures remain"
    )
    return None, (note("time marks", finding, "valid ones", _setting_to_keep()),) if invalid else ()


def _setting_to_keep() -> str:
    return f"{setting('camera.invalid_events', True)} takes them"


def _select_events(observations: Observations, wanted: RoverEvents) -> tuple[Records, Records]:
    """Return the events whose record lines hold the text, and which are marked not valid."""
    events = (record for record in observations.records if record.flag == EXTERNAL_EVENT)
    records = tuple(
        record for record in events if wanted.events_containing in "\n".join(record.records)
    )
    return records, tuple(
        record for record in records if any(NOT_VALID in line.lower() for line in record.records)
    )


def _exposure_events(
    observations: Observations, wanted: RoverEvents
) -> tuple[Records, tuple[Finding, ...]]:
    """Return the events that are exposures, and a note on those marked as not valid."""
    path = observations.header.path
    records, invalid = _select_events(observations, wanted)
    if not records and observations.events.size:
        message = (
            f"no external event has a record line with {quote(wanted.events_containing)}; look up"
            " the text of the events in the file"
        )
        raise InputError.in_file(path, message)
    if not records:
        message = (
            "holds no external event (flag 5); convert the receiver's log with its events (time"
            " marks), or give a file of events"
        )
        raise InputError.in_file(path, message)
    if not invalid:
        return records, ()
    finding = _describe_invalid(records, invalid)
    if wanted.invalid_events:
        advice = "their time stamps may be wrong by any amount"
        return records, (note("time marks", f"{finding}, and are taken", "valid ones", advice),)
    if len(invalid) == len(records):
        raise InputError.at_line(
            path, invalid[0].line, f"camera events: {finding}; {_setting_to_keep()}"
        )
    advice = (
        f"{_setting_to_keep()}; where they are exposures and their stamps are wrong, name their"
        f" images in {spell('camera.skip_images')}"
    )
    valid = tuple(record for record in records if record not in invalid)
    return valid, (note("time marks", f"{finding}, and are left out", "valid ones", advice),)


def _describe_invalid(records: Records, invalid: Records) -> str:
    times = some((f"{record.time:.3f} s" for record in invalid), MOST_TIMES_LISTED)
    return f"{len(invalid)} of {len(records)} are marked as not valid by the receiver, at {times}"
