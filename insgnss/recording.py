"""What the files of a flight hold, on one clock, and what the checks say of it."""

from collections.abc import Callable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from .errors import InputError, InsgnssError, UsageError
from .flight import Flight
from .records import CameraEvents, Check, GnssFixes, ImuSamples

Progress = Callable[[str], None]

LONG_LEVER_M, LARGE_BORESIGHT_DEG = 3.0, 10.0


def quiet(_: str) -> None:
    """No progress."""


@dataclass(frozen=True)
class Recording:
    """What the files of a flight hold, on one clock (seconds of `gps_week`), and what the checks say of it."""

    imu: ImuSamples
    gnss: GnssFixes
    events: CameraEvents | None
    gps_week: int
    checks: tuple[Check, ...]


@dataclass(frozen=True)
class InspectResult:
    """Checks of a recording."""

    name: str
    checks: tuple[Check, ...]

    @property
    def contradictions(self) -> list[str]:
        """One sentence for each check that the data contradict."""
        return [sentence(c) for c in self.checks if c.verdict == "contradiction"]

    def summary(self) -> str:
        """A table that a person reads."""
        width = max(len(c.name) for c in self.checks)
        mark = {"ok": "ok  ", "note": "note", "contradiction": "BAD "}
        lines = [self.name]
        for c in self.checks:
            lines.append(f"{mark[c.verdict]}  {c.name:<{width}}  {c.found}")
            if c.verdict != "ok":
                lines.append(f"      {'':<{width}}  expected: {c.expected}" + (f"; {c.advice}" if c.advice else ""))
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """JSON-able."""
        return {"name": self.name, "checks": [asdict(c) for c in self.checks]}


def sentence(check: Check) -> str:
    """A check in one sentence."""
    return f"{check.name}: {check.found}; expected {check.expected}; {check.advice}"


def read_recording(flight: Flight) -> Recording:
    """Read the files of a flight, bring them to one clock and check them."""
    from .prepare.clock import common_clock, cut_events
    from .prepare.plausibility import check_recording

    try:
        imu, gnss, events = _read_files(flight)
    except UsageError as error:  # an option of the flight file that its file's format does not have
        raise InputError(f"{flight.path}: {error}") from None
    if flight.imu.time_offset_s:
        imu = replace(imu, time=imu.time + flight.imu.time_offset_s)
    if flight.gnss.time_offset_s:
        gnss = replace(gnss, time=gnss.time + flight.gnss.time_offset_s)
    if events is not None and flight.camera is not None and flight.camera.time_offset_s:
        events = replace(events, time=events.time + flight.camera.time_offset_s)
    imu, gnss, events, week = common_clock(imu, gnss, events, flight.gps_week)
    origin = None if flight.tangent_plane is None else np.asarray(flight.tangent_plane.origin)
    checks = check_recording(imu, flight.imu.C_b_imu, gnss, events, origin)
    checks.append(_check_mounting(flight))
    if events is not None:
        every = len(events.images)
        events = cut_events(events, flight.start_tow, flight.end_tow)
        if len(events.images) < every:
            found = f"{every - len(events.images)} of {every} images left out"
            checks.append(Check("start_tow, end_tow", found, "all images within", "note"))
    return Recording(imu, gnss, events, week, tuple(checks))


def _read_files(flight: Flight) -> tuple[ImuSamples, GnssFixes, CameraEvents | None]:
    from .formats import read_events, read_gnss, read_imu

    i, g = flight.imu, flight.gnss
    imu = read_imu(i.file, columns=i.columns, units=i.units or None, quantity=i.quantity, gps_week=flight.gps_week, variable=i.variable)
    gnss = read_gnss(
        g.file,
        columns=g.columns,
        sigma_m=g.sigma_m,
        sigma_velocity=g.sigma_velocity_mps,
        units=g.units or None,
        undulation_m=g.undulation_m,
        variable=g.variable,
        new_when=g.new_when,
        gps_week=flight.gps_week,
    )
    events = None if flight.camera is None else read_events(flight.camera.events, columns=flight.camera.columns, gps_week=flight.gps_week)
    return imu, gnss, events


def _check_mounting(flight: Flight) -> Check:
    """Size of what no data check: lever arms and bore-sight."""
    m = flight.mounting
    lever = max(float(np.linalg.norm(v)) for v in (m.antenna_lever_b, m.camera_lever_b))
    angle = float(np.degrees(np.arccos(np.clip(0.5 * (np.trace(m.boresight) - 1.0), -1.0, 1.0))))
    found = f"longest lever arm {lever:.3f} m, bore-sight {angle:.2f} deg"
    odd = lever > LONG_LEVER_M or angle > LARGE_BORESIGHT_DEG
    return Check(
        "mounting",
        found,
        f"lever arms below {LONG_LEVER_M:g} m, bore-sight below {LARGE_BORESIGHT_DEG:g} deg",
        "note" if odd else "ok",
        "the data cannot tell: check units, signs and mounting by hand" if odd else "",
    )


def inspect(flight: Flight, progress: Progress = quiet) -> InspectResult:
    """Read and check a flight without processing it; what needs the attitude (heading against course) is left to `process`."""
    from .prepare.clock import common_span, refuse_outside
    from .stochastic.model import load_noise_model

    progress("reading")
    load_noise_model(flight.imu.noise)
    recording = read_recording(flight)
    checks = list(recording.checks)
    try:
        lo, hi = common_span(recording.imu, recording.gnss, flight.start_tow, flight.end_tow)
        if recording.events is not None:
            refuse_outside(recording.events, lo, hi)
    except InsgnssError as error:
        checks.append(Check("span", str(error), "IMU, GNSS and images overlap", "contradiction"))
    checks.append(Check("heading against course", "not checked here", "needs the attitude: `insgnss process` checks it"))
    return InspectResult(flight.name, tuple(checks))
