"""Inspection of files: find, read and recognise them, and draft the flight file.

    discovery   which files are samples, fixes, exposures; which columns they have (tables)
    recognise   units, axes, sign of force and clock, from the motion that both sensors saw
    sensing     stationarity, white noise, gravity, Earth rate: class and noise model of the sensor
    evidence    what the data say of units, axes and clock, and where a file contradicts them
    content     the flight file with the evidence beside each key (draft writes it)

Where there is no receiver the inspection still shows what the samples are, and drafts what they
allow.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import InputError
from ...base.wording import some
from ...geodesy.axes import axes_words, parse_axes
from ...io.formats import read_events, read_gnss, read_imu
from ...io.formats.text.order import note
from ...navigation.prepare.clock import NO_WEEK, common_week
from ...navigation.prepare.fix_covariance.quality import with_floors
from ...navigation.prepare.gaps import nominal_interval
from ...navigation.recognise.claims import with_set_clock
from ...navigation.recognise.handedness import with_exchanges
from ...navigation.recognise.plausibility import check_recording
from ...navigation.recognise.recognition import Recognition, recognise
from ...navigation.recognise.streams import classes_apart
from ...navigation.recognise.turns import Forces
from ...records import CameraEvents, GnssFixes, ImuSamples
from ...records.observations import in_week
from ...report.charts.chart import Chart
from ...report.figures.recognition import answers_in_words, recognition_charts
from ...report.notebook import Charted
from ..processing.progress import Progress, quiet
from .alone import Alone, by_gravity, rest_findings
from .content import draft_flight
from .discovery import Discovery, discover
from .draft import write_draft
from .event_clock import clock_of_events, on_clock_of_samples, scale_of_dates
from .evidence import (
    assumed_rate,
    in_counts,
    in_si,
    in_units_of_file,
    likely_axes,
    strangers,
    unit_contradictions,
)
from .exchanged_axes import right_handed
from .page import inspection_document, numbers_of
from .result import InspectionData, Recorded
from .rinex.result import RinexInspection
from .rinex.survey import Survey, survey
from .sensing import sense
from .sources import InputSource, LeftOut, Role, as_long_as, in_ticks, on_one_clock, overlap
from .tables.grids import date_in
from .tables.halves import of_two_halves

_DATA_KEYS = (
    "accel_file columns variable units quantity rate_hz repeat_column reference sigma_m"
    " undulation_m time_scale"
)
DATA_KEYS = tuple(_DATA_KEYS.split())
MOST_LISTED, REASON_LENGTH = 6, 300  # files in a message, and characters of the reason of each
# a reading, in any unit; times that the stamps span what the samples fill
LARGEST, SPARSEST = 1e12, 20.0


@dataclass(frozen=True, eq=False)
class Inspection(InspectionData, Charted):
    """What was found, with its draft, picture and texts."""

    def write(self, path: Path, force: bool = False) -> "Inspection":
        """Write the draft and the files beside it; return the inspection with the files written."""
        assert self.draft is not None
        page = "".join(inspection_document(self, self.charts()).html())
        drafted = replace(self.draft, picture=self.picture(), page=page)
        return replace(self, written=tuple(write_draft(drafted, path, force)))

    def charts(self) -> tuple[Chart, ...]:
        """Return what was recognised as charts; none without a receiver."""
        recognition = self.recognition
        if recognition is None:
            return ()
        poses = recognition.curves.get("orientation", ())
        labels = [axes_words(C) for C in poses]
        return recognition_charts(recognition.curves, recognition.findings, labels)

    def picture(self) -> bytes | None:
        """Return a PNG of what was recognised; None without a receiver."""
        from ...report.charts.drawn import draw_sheet

        if self.recognition is None:
            return None
        charts = self.charts()
        other_charts = [chart for chart in charts if chart.name != "motion"]
        columns = [
            list(c) for c in ([x for x in charts if x not in other_charts], other_charts) if c
        ]
        title = f"{self.name}: IMU measurements and GNSS motion"
        return draw_sheet(columns, title, answers_in_words(self.recognition.findings))

    def summary(self) -> str:
        """Return the text for the terminal."""
        return inspection_document(self).text()

    def as_dict(self) -> dict[str, Any]:
        """Return the inspection for JSON output."""
        return numbers_of(self)


def inspect_files(
    paths: Sequence[Path], progress: Progress = quiet
) -> Inspection | RinexInspection:
    """Inspect files and directories that no flight file describes.

    Parameters
    ----------
    paths : sequence of Path
    progress : Progress
        Receives the name of each step.

    Returns
    -------
    Inspection or RinexInspection
        The latter where there is RINEX and no IMU.

    Raises
    ------
    InputError
        Where nothing, or not one recording, is found, and where a file cannot be read.
    """
    progress("looking")
    discovery = discover(paths)
    sensed = bool(discovery.of("imu") or discovery.of("gyro") or discovery.of("accel"))
    rinex = None if sensed and discovery.of("gnss") else survey(paths)
    if rinex is not None and not (rinex.receivers or rinex.navigation):
        rinex = None
    if rinex is not None and not sensed:
        return RinexInspection(_name(paths), rinex)
    imu_source, gnss_source, events_source = _choose(discovery, paths)
    if gnss_source is not None:
        imu_source, gnss_source = on_one_clock(imu_source, gnss_source)
    of_files = _name(paths), discovery.left_out, rinex
    recorded = _read_sources(of_files, imu_source, gnss_source, events_source, progress)
    counting = in_ticks(imu_source, recorded.imu, recorded.gnss, recorded.recognition)
    if counting != imu_source:
        recorded = _read_sources(of_files, counting, gnss_source, events_source, progress)
    progress("measuring noise")
    return _inspection(recorded)


def _read_sources(
    of_files: tuple[str, tuple[LeftOut, ...], Survey | None],
    imu_source: InputSource,
    gnss_source: InputSource | None,
    events_source: InputSource | None,
    progress: Progress,
) -> Recorded:
    """Read the sources and recognise what they hold; of the files name, those left out, RINEX."""
    name, left_out, rinex = of_files
    progress("reading")
    imu, gnss, events = _read(imu_source, gnss_source, events_source)
    if gnss is not None and (ticks := as_long_as(imu_source, imu, gnss)) != imu_source:
        imu_source = ticks
        imu, gnss, events = _read(imu_source, gnss_source, events_source)
    if events_source is not None and events is not None:
        events_source, events = on_clock_of_samples(events_source, events, imu_source, imu)
    if events_source is not None and events is not None and gnss is not None:
        events_source, events = scale_of_dates(events_source, events, gnss)
    clock = clock_of_events((imu_source, gnss_source, events_source), imu, gnss, events)
    imu, gnss, events, known_week = _one_week(imu_source, imu, gnss, events)
    if known_week is not None and rinex is not None and rinex.rover is not None:
        rover = rinex.rover
        known_week = rover.gps_week, f"of the epochs of {rover.files[0].name}"
    sources = tuple(
        source for source in (imu_source, gnss_source, events_source) if source is not None
    )
    progress("recognising")
    recognition, unrecognised = recognise_or_reason(imu, gnss)
    if recognition is not None and recognition.exchanges:
        imu_source, imu, recognition = right_handed(imu_source, imu, recognition)
        aiding = [source for source in sources if source.role != "imu"]
        sources = (imu_source, *aiding)
    if recognition is not None:
        recognition = in_units_of_file(imu_source, recognition)
    records = imu, gnss, events, recognition, unrecognised, known_week, clock
    return Recorded(name, sources, left_out, *records, rinex)


def _choose(
    discovery: Discovery, paths: Sequence[Path]
) -> tuple[InputSource, InputSource | None, InputSource | None]:
    """The one source of samples, and the one of fixes and exposures that belong to it."""
    where = ", ".join(map(str, paths))
    samples = discovery.of("imu")
    if not samples:
        halves = of_two_halves(discovery.of("gyro"), discovery.of("accel"))
        samples = () if halves is None else (halves,)
    if not samples:
        listed = _list_files(discovery) or "no files that could be a recording"
        raise InputError(
            f"{where}: no IMU samples found; there are {listed}; name the IMU's file, or give its "
            "columns in a flight file"
        )
    if len(samples) > 1:
        names = some((source.title for source in samples), MOST_LISTED)
        raise InputError(
            f"{where}: {len(samples)} recordings of an IMU: {names}; name the files of one of"
            " them ([[imu.further]] joins others)"
        )
    imu = samples[0]
    return (
        imu,
        _matching_source(discovery, "gnss", imu, where),
        _matching_source(discovery, "events", imu, where),
    )


def _list_files(discovery: Discovery) -> str:
    """The files found; those that could not be read first, with the reason."""
    damaged = [
        f"{file.path.name} ({file.problem[:REASON_LENGTH]})"
        for file in discovery.left_out
        if file.problem
    ]
    unused = [file.path.name for file in discovery.left_out if not file.problem]
    names = [
        *damaged,
        *(f"{source.path.name} ({source.what})" for source in discovery.sources),
        *unused,
    ]
    return some(names, MOST_LISTED, "; ")


def _matching_source(
    discovery: Discovery, role: Role, imu: InputSource, where: str
) -> InputSource | None:
    """The one source of a role; of several the one in the IMU's file."""
    candidates = discovery.of(role)
    if role == "events":  # any column that increases could be one of exposures, but for its times
        candidates = tuple(source for source in candidates if overlap(source.span, imu.span) >= 0.0)
    if len(candidates) > 1:
        inside = tuple(source for source in candidates if source.path == imu.path)
        candidates = inside or candidates
    if len(candidates) > 1:
        kind = {"gnss": "files of fixes", "events": "files of exposures"}.get(role, role)
        names = ", ".join(source.title for source in candidates[:MOST_LISTED])
        raise InputError(
            f"{where}: {len(candidates)} {kind}: {names}; name the files of one flight"
        )
    return candidates[0] if candidates else None


def _spec(source: InputSource) -> dict[str, Any]:
    """Options of the reader."""
    spec = {key: value for key, value in source.keys.items() if key in DATA_KEYS}
    if "sigma_velocity_mps" in source.keys:
        spec["sigma_velocity"] = source.keys["sigma_velocity_mps"]
    return spec


def _read(
    imu: InputSource, gnss: InputSource | None, events: InputSource | None
) -> tuple[ImuSamples, GnssFixes | None, CameraEvents | None]:
    samples = read_imu(imu.path, **_spec(imu))
    fixes = None if gnss is None else read_gnss(gnss.path, **_spec(gnss))
    if gnss is not None and fixes is not None and "undulation_m" in gnss.keys:
        finding = gnss.why["undulation_m"].partition(":")[0]
        advice = (
            "set gnss.undulation_m to the height of the geoid; without it the flight is not"
            " processed"
        )
        ask = note("GNSS position", finding, "heights above the ellipsoid", advice)
        fixes = replace(fixes, notes=(*fixes.notes, ask))
    return samples, fixes, None if events is None else read_events(events.path, **_spec(events))


def _one_week(
    source: InputSource, imu: ImuSamples, gnss: GnssFixes | None, events: CameraEvents | None
) -> tuple[ImuSamples, GnssFixes | None, CameraEvents | None, tuple[int, str] | None]:
    """The records in seconds of one week; and the week with its origin where no file gives it."""
    weeks = [r.gps_week for r in (imu, gnss, events) if r is not None and r.gps_week is not None]
    week, guess = (weeks[0], None) if weeks else _week_by_date(source.path)
    if gnss is None:
        return (
            (imu if imu.gps_week is not None else replace(imu, gps_week=week)),
            None,
            events,
            guess,
        )
    week = common_week(imu, gnss, week)
    events = None if events is None else in_week(events, week)
    return in_week(imu, week), in_week(gnss, week), events, guess


def _week_by_date(path: Path) -> tuple[int, tuple[int, str]]:
    """GPS week by a date in the file, else `NO_WEEK`; the week for the draft, with its origin."""
    date, origin = date_in(path), f"the date in {path.name}"
    in_file = date is not None
    if date is None:
        date = np.datetime64(int(path.stat().st_mtime), "s").astype("datetime64[D]")
        origin = f"the date of {path.name}, as no file gives the GPS week; correct this week"
    week = int((date - np.datetime64("1980-01-06")).astype("timedelta64[D]").astype(int) // 7)
    return week if in_file else NO_WEEK, (week, f"of {date}, {origin}")


def recognise_or_reason(imu: ImuSamples, gnss: GnssFixes | None) -> tuple[Recognition | None, str]:
    """Recognise the samples; None and the reason where that cannot be done."""
    if gnss is None:
        return None, "no fixes of a receiver"
    absurd = max(float(np.abs(imu.gyro).max()), float(np.abs(imu.accel).max()))
    if absurd > LARGEST:
        return None, f"a value of {absurd:.3g}, which no sensor can measure"
    span, kept = float(imu.time[-1] - imu.time[0]), imu.time.size * nominal_interval(imu.time)
    if span > SPARSEST * kept:
        return (
            None,
            f"time stamps span {span:.0f} s, but the samples fill {kept:.0f} s: the clock jumps",
        )
    if imu.gps_week == NO_WEEK:  # no real week, so it must not give the leap seconds
        imu, gnss = replace(imu, gps_week=None), replace(gnss, gps_week=None)
    return with_exchanges(recognise(imu, gnss), imu, gnss, recognise), ""


def _name(paths: Sequence[Path]) -> str:
    """Name of the directory or of the one file given.

    Of several files it is that of the directory which holds the first.
    """
    first = paths[0].absolute()
    return first.name if first.is_dir() else first.stem if len(paths) == 1 else first.parent.name


def _forces(recognition: Recognition | None) -> Forces | None:
    """What the forces show of the records as recognised; None where they show no clock."""
    if recognition is None or not recognition.finding("time offset").confidence:
        return None
    names = ("gyro unit", "gyro triad", "time offset")
    sure = min(recognition.finding(name).confidence for name in names)
    aligned = recognition.finding("gyro triad").found == "aligned"
    clock = recognition.finding("time offset").confidence
    return Forces(0.0, clock, sure if aligned else 0.0)


def _inspection(recorded: Recorded) -> Inspection:
    """What the recording shows, the checks of it, and the draft of its flight file."""
    raw, gnss, recognition = recorded.imu, recorded.gnss, recorded.recognition
    source = recorded.sources[0]
    alone = Alone(raw, {}, ())
    if recognition is None:
        alone = by_gravity(raw, source.header_units == {})
    imu = alone.imu if recognition is None else in_si(raw, recognition)
    time_offset = 0.0 if recognition is None else recognition.time_offset_s
    stamped = None if gnss is None else replace(gnss, time=gnss.time + time_offset)
    sensing = sense(imu, stamped)
    axes, counts = likely_axes(source, imu, recognition), alone.gyro_counts
    findings = (
        (*alone.findings, *rest_findings(sensing, counts is not None))
        if recognition is None
        else recognition.findings
    )
    checks = list(raw.notes)
    if stamped is not None:
        classes = classes_apart(stamped)
        stamped = with_floors(stamped, {q: tuple(sigma) for q, (_, sigma, _) in classes.items()})
        of_motion = check_recording(
            imu, parse_axes(axes.directions), stamped, recorded.events, None, _forces(recognition)
        )
        checks += [*stamped.notes, *with_set_clock(of_motion, imu, stamped)]
        checks += assumed_rate(source)
    if recognition is not None:
        checks += unit_contradictions(source, recognition)
        checks += [*in_counts(source, recognition), *strangers(recognition)]
    draft, missing = draft_flight(recorded, sensing, axes, alone)
    if missing and (damaged := [file.why for file in recorded.left_out if file.problem]):
        missing += f"; not taken: {damaged[0]}"
    return Inspection(
        **vars(recorded) | {"imu": imu, "gnss": stamped},
        checks=tuple(checks),
        findings=findings,
        sensing=sensing,
        gyro_counts=counts,
        draft=draft,
        missing=missing,
    )
