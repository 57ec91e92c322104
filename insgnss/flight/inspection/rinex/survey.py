"""Which RINEX files there are, what they hold, and which receiver flew.

Files are taken by their first line, packed ones as well. Observation files of one marker, antenna
and version are one receiver's. The rover is the receiver that the files tell from the others, by
the first of these that distinguishes: camera events (flag 5), which only a rover has; a marker
type of the header (GEODETIC stands, NON_GEODETIC moves); epochs that come oftener; a time that
lies within that of the others. Of several bases the one that covers most of the rover's time is
taken.
"""

import re
from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ....base.errors import InsgnssError
from ....geodesy.gpstime import WEEK_S
from ....gnss.engine.preflight import interval
from ....gnss.rinex.header import RinexHeader, load_rinex
from ....gnss.rinex.navigation_message import Navigation, read_navigation
from ....gnss.rinex.observation_record import Observations
from ....gnss.rinex.observations import read_observations
from ....navigation.prepare.gaps import LEAST_GAP_INTERVALS

RINEX_NAME = re.compile(r"\.(obs|rnx|crx|nav|\d\d[odnghplq])(\.(gz|z|bz2|zip))?$", re.IGNORECASE)
DEEPEST, MOST_RINEX_FILES = 6, 500  # folders below the one given; files that are read (chosen)
OFTENER = 1.5  # times the rate of another receiver, to be the one that flew
WITHIN = 0.9  # share of another's time
FULL_SYSTEM_NAMES = {
    "G": "GPS",
    "R": "GLONASS",
    "E": "Galileo",
    "C": "BeiDou",
    "J": "QZSS",
    "S": "SBAS",
}


@dataclass(frozen=True)
class Receiver:
    """What the observation files of one receiver hold.

    Parameters
    ----------
    files : tuple of Path
        In order of time.
    header : RinexHeader
        Of the first.
    first_s, last_s : float
        Of its epochs, s since 1980-01-06, GPST.
    interval_s : float
        Between epochs, the median.
    epochs, gaps, events : int
        Epochs, intervals longer than 1.5 of the usual, camera events (flag 5).
    satellites : dict of str to int
        Satellites by letter of the system.
    bands : dict of str to tuple of str
        Bands with a phase by system.
    """

    files: tuple[Path, ...]
    header: RinexHeader
    first_s: float
    last_s: float
    interval_s: float
    epochs: int
    gaps: int
    events: int
    satellites: dict[str, int]
    bands: dict[str, tuple[str, ...]]

    @property
    def gps_week(self) -> int:
        """GPS week of the first epoch."""
        return int(self.first_s // WEEK_S)

    @property
    def described(self) -> str:
        """What it holds, in one line."""
        systems = ", ".join(
            f"{FULL_SYSTEM_NAMES.get(k, k)} {count} (bands {' '.join(self.bands[k]) or 'none'})"
            for k, count in self.satellites.items()
        )
        antenna = " ".join(self.header.antenna.split()) or "not named"
        up = float(self.header.antenna_delta_m[0])
        return (
            f"{self.epochs} epochs every {self.interval_s:g} s over"
            f" {(self.last_s - self.first_s) / 60.0:.1f} min, {self.gaps} gaps, {systems};"
            f" antenna {antenna}, {up:.4f} m above its marker; {self.events} camera events"
        )


@dataclass(frozen=True)
class Survey:
    """RINEX files of a recording.

    Parameters
    ----------
    receivers : tuple of Receiver
        All of them.
    rover, base : Receiver, optional
        The one that flew, and the one it is solved against, as far as the files tell.
    why : str
        What tells the rover from the others, or why nothing does.
    navigation : tuple of Path
        Files of broadcast messages.
    messages : dict of str to int
        Satellites with messages by letter of the system.
    left_out : tuple
        Files that could not be read, with the reason.
    """

    receivers: tuple[Receiver, ...]
    rover: Receiver | None
    base: Receiver | None
    why: str
    navigation: tuple[Path, ...]
    messages: dict[str, int]
    left_out: tuple[tuple[Path, str], ...]

    @property
    def missing(self) -> str:
        """What PPK lacks, empty where nothing is."""
        if not self.receivers:
            return "observations of rover and base"
        if self.rover is None or self.base is None:
            return self.why
        return "" if self.navigation else "a navigation file (broadcast ephemerides) of that day"


def survey(paths: Sequence[Path]) -> Survey:
    """Look for RINEX files in directories, and among the files that are named.

    Parameters
    ----------
    paths : sequence of Path
        Files and directories.

    Returns
    -------
    Survey
        Without receivers where there is no RINEX.
    """
    read: list[Observations] = []
    navigation: list[Path] = []
    broadcast: list[Navigation] = []
    left_out: list[tuple[Path, str]] = []
    for path in _candidates(paths):
        try:
            kind = kind_of(path)
            if kind == "O":
                read.append(read_observations(path))
            elif kind:
                broadcast.append(read_navigation(path))
                navigation.append(path)
        except InsgnssError as error:
            left_out.append((path, str(error)))
    receivers = tuple(_receiver(group) for group in _groups(read))
    rover, base, why = rover_and_base(receivers)
    satellites = {str(code) for ephemerides in broadcast for code in ephemerides.satellite}
    messages = Counter(sorted(code[0] for code in satellites))
    return Survey(receivers, rover, base, why, tuple(navigation), dict(messages), tuple(left_out))


def _candidates(paths: Sequence[Path]) -> list[Path]:
    """The files with names of RINEX below the paths, in order of name."""
    files: list[Path] = []
    for path in paths:
        if path.is_file():
            files.append(path)
            continue
        files += sorted(
            file
            for file in path.rglob("*")
            if len(file.relative_to(path).parts) <= DEEPEST and file.is_file()
        )
    return [file for file in files if RINEX_NAME.search(file.name)][:MOST_RINEX_FILES]


def kind_of(path: Path) -> str:
    """Return the letter of a RINEX file's kind, O for observations; empty for other files."""
    first_lines = bytes(load_rinex(path)[0][:200]).decode("latin-1").splitlines()
    first = first_lines[0] if first_lines else ""
    if "RINEX VERSION / TYPE" not in first[60:]:
        return ""
    return first[20:21].upper()


def _groups(read: list[Observations]) -> list[list[Observations]]:
    """Observations by receiver, each in order of time."""
    by_receiver: dict[tuple[str, ...], list[Observations]] = {}
    for file in sorted(read, key=lambda o: (o.gps_week, float(o.time[0]))):
        header = file.header
        approximate = header.approx_position_m
        key = (
            header.marker or header.path,
            header.antenna,
            str(header.version),
            "" if approximate is None else str(np.round(approximate / 1e3).tolist()),
        )
        by_receiver.setdefault(key, []).append(file)
    return list(by_receiver.values())


def _receiver(group: list[Observations]) -> Receiver:
    """Return what the files of one receiver hold together: span (s), interval, gaps, bands."""
    first_file, last_file = group[0], group[-1]
    time = np.concatenate([file.gps_week * WEEK_S + file.time for file in group])
    usual_interval = interval(first_file)
    names = sorted({str(code) for file in group for code in np.unique(file.satellite)})
    letters = dict.fromkeys(name[0] for name in names)
    return Receiver(
        tuple(Path(file.header.path) for file in group),
        first_file.header,
        float(first_file.gps_week * WEEK_S + first_file.time[0]),
        float(last_file.gps_week * WEEK_S + last_file.time[-1]),
        usual_interval,
        time.size,
        int((np.diff(time) > LEAST_GAP_INTERVALS * usual_interval).sum()),
        sum(file.events.size for file in group),
        {letter: sum(name[0] == letter for name in names) for letter in letters},
        {letter: _bands(first_file, letter) for letter in letters},
    )


def _bands(observations: Observations, letter: str) -> tuple[str, ...]:
    """Bands in which some satellite of a system has a phase."""
    rows = np.char.startswith(observations.satellite, letter)
    phases = [(k, name) for k, name in enumerate(observations.signals) if name[0] == "L"]
    measured = {name[1] for k, name in phases if np.isfinite(observations.values[rows, k]).any()}
    return tuple(sorted(measured))


def rover_and_base(receivers: Sequence[Receiver]) -> tuple[Receiver | None, Receiver | None, str]:
    """Return the receiver that flew, the base for it, and what tells them apart.

    Parameters
    ----------
    receivers : sequence of Receiver
        All that were found.
    """
    if len(receivers) < 2:
        return (
            None,
            None,
            "the observations are of one receiver; give those of a base station as well (hourly "
            "files, or a station of the reference network)",
        )
    rules: tuple[tuple[str, Callable[[Receiver], bool]], ...] = (
        ("only its file has camera events", lambda receiver: receiver.events > 0),
        (
            "its header calls the marker NON_GEODETIC",
            lambda receiver: _marker_moves(receiver.header),
        ),
        (
            "its observation rate is higher than that of the others",
            lambda receiver: all(
                receiver.interval_s * OFTENER < r.interval_s for r in receivers if r is not receiver
            ),
        ),
        (
            "its time lies within that of the others",
            lambda receiver: all(_is_within(receiver, r) for r in receivers if r is not receiver),
        ),
    )
    for why, moves in rules:
        moving = [receiver for receiver in receivers if moves(receiver)]
        if len(moving) == 1:
            rover = moving[0]
            candidates = [receiver for receiver in receivers if receiver is not rover]
            base = max(candidates, key=lambda r: _common(rover, r))
            if _common(rover, base) <= 0.0:
                return rover, None, "no other receiver observed at the rover's time"
            return rover, base, why
    names = ", ".join(receiver.files[0].name for receiver in receivers)
    return None, None, f"the files do not show which receiver of {names} flew; name the rover"


def _marker_moves(header: RinexHeader) -> bool:
    kind = " ".join(header.records.get("MARKER TYPE", ())).strip().upper()
    return kind.startswith(("NON_GEODETIC", "AIRBORNE", "GROUND_CRAFT", "HUMAN"))


def _common(first: Receiver, second: Receiver) -> float:
    """Seconds that both observed."""
    return min(first.last_s, second.last_s) - max(first.first_s, second.first_s)


def _is_within(inner: Receiver, outer: Receiver) -> bool:
    """Return whether the span of a receiver lies inside that of another."""
    longer = outer.last_s - outer.first_s
    return inner.last_s - inner.first_s < WITHIN * longer and _common(inner, outer) > WITHIN * (
        inner.last_s - inner.first_s
    )
