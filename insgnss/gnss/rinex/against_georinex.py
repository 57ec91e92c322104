"""A file of observations by this package's reader and by georinex, compared value by value.

Both read the same unpacked text; of version 4, which georinex does not know, as version 3.05, whose
observations are written alike. Zero is missing. georinex takes no events, stamps epochs up to a
microsecond early, and may lose the epoch behind an event with records: what this reader alone has
is told and counts for nothing, what georinex alone has, or has otherwise, is a difference.
"""

import io
import warnings
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...base.errors import DataError, InputError, words_of
from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from .header import codes_of, load_rinex
from .observations import read_observations
from .through_georinex import library

SAME_EPOCH_NS = 10_000_000  # stamps of both readers (ns): 10 ms, as epochs are 50 ms apart at least
AS_VERSION_3 = "     3.05"


@dataclass(frozen=True)
class SignalComparison:
    """Values of one signal of a system: of both readers, those that differ and the largest
    difference, and those of one reader alone.
    """

    system: str
    signal: str
    shared: int
    different: int
    largest: float
    ours_alone: int
    theirs_alone: int


@dataclass(frozen=True)
class ReaderComparison:
    """Result of `compare_with_georinex`.

    Parameters
    ----------
    path : str
        The file.
    epochs, their_epochs : int
        Epochs of this reader, and of georinex.
    stamps_s : float
        Largest difference of a stamp, s.
    signals : tuple of SignalComparison
        By system and signal.
    flags, different_flags : int
        Flags of lost lock and strength that were compared, and those that differ.
    """

    path: str
    epochs: int
    their_epochs: int
    stamps_s: float
    signals: tuple[SignalComparison, ...]
    flags: int
    different_flags: int

    def total(self, name: str) -> int:
        """Return the sum of a count over all signals."""
        return sum(int(getattr(signal, name)) for signal in self.signals)

    @property
    def passed(self) -> bool:
        """Whether all that georinex has is here, alike."""
        return not (self.total("different") + self.total("theirs_alone") + self.different_flags)

    @property
    def refusal(self) -> DataError | None:
        """The error where the readers do not agree, else None."""
        advice = "look at the first such signal, and report a difference that stays"
        return None if self.passed else DataError(f"{self.headline()}; {advice}")

    def headline(self) -> str:
        """Return one sentence with the result."""
        return (
            f"this reader and georinex {'agree' if self.passed else 'DO NOT AGREE'}:"
            f" {self.total('shared')} values of both, {self.total('different')} differ,"
            f" {self.total('theirs_alone')} of georinex alone, {self.total('ours_alone')} of this"
            f" reader alone; {self.different_flags} of {self.flags} flags differ"
        )

    def summary(self) -> str:
        """Return the headline and a table for the terminal."""
        lines = [
            self.headline(),
            f"epochs: {self.epochs}, georinex {self.their_epochs}; stamps differ by"
            f" {self.stamps_s:.1e} s at most",
            "signal        both   differ     largest  this alone  georinex alone",
        ]
        lines += [
            f"{s.system} {s.signal:4} {s.shared:10d} {s.different:8d} {s.largest:11.3e}"
            f" {s.ours_alone:11d} {s.theirs_alone:15d}"
            for s in self.signals
        ]
        return "\n".join(lines)

    def as_dict(self) -> dict[str, Any]:
        """Return the result for JSON."""
        return {"passed": self.passed, "headline": self.headline()} | asdict(self)


def compare_with_georinex(
    path: str | Path, progress: Callable[[str], None] = lambda _: None
) -> ReaderComparison:
    """Read a file of observations by both readers and compare all values and flags.

    Parameters
    ----------
    path : path-like
        RINEX 2 to 4, plain or packed.
    progress : callable
        Gets the step that runs.

    Raises
    ------
    InputError
        Where one of the readers cannot read it, or georinex is not installed.
    """
    progress("read")
    ours = read_observations(path)
    georinex = library(path, "the other side of the comparison")
    text = load_rinex(path)[0].tobytes().decode("latin-1")
    text = AS_VERSION_3 + text[len(AS_VERSION_3) :] if ours.header.version >= 4.0 else text
    progress("georinex")
    try:
        with warnings.catch_warnings(action="ignore"):
            table = georinex.load(io.StringIO(text), useindicators=True)
        if table.time.size == 0:
            raise ValueError("georinex finds no epoch in the file")
    except (AssertionError, LookupError, TypeError, ValueError) as error:
        message = f"georinex cannot read this file: {words_of(error)}; insgnss ppk can"
        raise InputError.in_file(path, message) from None
    start = int(GPS_EPOCH_UNIX_S + ours.gps_week * WEEK_S) * 10**9
    our_stamps = start + 100 * np.rint(1e7 * ours.time).astype(np.int64)
    stamps = table.time.values.astype("datetime64[ns]").astype(np.int64)
    nearest = np.maximum(np.searchsorted(stamps, our_stamps + SAME_EPOCH_NS) - 1, 0)
    interval = np.abs(stamps[nearest] - our_stamps)
    names = np.array([str(name).replace(" ", "0") for name in table.sv.values])
    column = {name: k for k, name in enumerate(names.tolist())}
    where = np.array([column.get(name, -1) for name in ours.satellite.tolist()])
    matched = (interval < SAME_EPOCH_NS)[ours.epoch] & (where >= 0)
    index = nearest[ours.epoch], where
    signals, flags, different_flags = [], 0, 0
    for system in sorted({name[0] for name in column} | set(ours.satellite.astype("U1").tolist())):
        rows = ours.satellite.astype("U1") == system
        mine = np.char.startswith(names, system)
        types = ours.header.types.get(system if ours.header.version >= 3 else "", ())
        for name, code in zip(types, codes_of(ours.header.version, system, types), strict=True):
            value = ours.of(code)
            listed = name in table
            theirs = np.where(matched & listed, table[name].values[index] if listed else 0.0, 0.0)
            theirs = np.where(theirs == 0.0, np.nan, theirs)
            in_ours, in_theirs = np.isfinite(value) & rows, np.isfinite(theirs) & rows
            difference = np.abs(value - theirs)[in_ours & in_theirs]
            all_of_theirs = np.nan_to_num(table[name].values[:, mine]) if listed else np.zeros(1)
            signals.append(
                SignalComparison(
                    *(system, name, int(difference.size), int(np.count_nonzero(difference))),
                    *(float(difference.max(initial=0.0)), int((in_ours & ~in_theirs).sum())),
                    int(np.count_nonzero(all_of_theirs)) - int(difference.size),
                )
            )
            for tail, array in (("lli", ours.loss_of_lock), ("ssi", ours.strength)):
                if name + tail in table:
                    theirs = np.nan_to_num(table[name + tail].values[index])[rows & matched]
                    flags += theirs.size
                    differs = array[rows & matched, ours.column(code)] != theirs
                    different_flags += int(np.count_nonzero(differs))
    return ReaderComparison(
        *(str(path), ours.time.size, stamps.size),
        float(interval[interval < SAME_EPOCH_NS].max(initial=0)) / 1e9,
        *(tuple(signals), flags, different_flags),
    )
