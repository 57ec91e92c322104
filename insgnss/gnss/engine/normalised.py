"""Observations as the engine gets them: RINEX 3.04 with one column a band, kind and system.

RTKLIB takes of a file one code for each band, by the header alone: the first of its own order that
the header lists, whether it has values or not. A satellite whose values stand under another code
has one band less, which costs fixes and leaves floats metres off. So every file is written anew
from what was read: of each satellite and band the first code in the engine's order that has nearly
as many phases (`MOST_OF_CODES`) as any; where it has none and another one has more than `SHORT`,
that one, with the flag of a lost lock at every change. Codes, Doppler and C/N0 are those of the
phase's code, else of the first that has one. Camera events are left out, behind which RTKLIB EX 2.5
drops an epoch; stamps are GPST, scale factors taken out, and odd lines are gone.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from ...records import Array
from ..phase.time_differences import LOCK_LOST
from ..rinex.observation_record import Observations
from ..satellites.frequencies import rows_of_systems
from ..satellites.orbits import unique_satellites

Index = NDArray[np.int64]
Flags = NDArray[np.int8]

# codes of each band in the engine's order of preference (`getcodepri` of RTKLIB EX 2.5.0)
ORDER = {
    "G": {"1": "CPYWMNSLX", "2": "CPYWMNDLSX", "5": "IQX"},
    "R": {"1": "CPABX", "2": "CPX", "3": "IQX", "4": "ABX", "6": "CPABX"},
    "E": {"1": "CABXZ", "5": "XIQ", "6": "ABCXZ", "7": "XIQ", "8": "IQX"},
    "J": {"1": "CLSXZBE", "2": "LSX", "5": "IQXDPZ", "6": "LSXEZ"},
    "C": {"1": "DPXSLZAN", "2": "IQX", "5": "DPX", "6": "IQXDPZA", "7": "IQXDPZ", "8": "DPX"},
}
MIXED_CODES = "+"  # between the codes of one band
IN_BAND = "CLDS"
PHASE = IN_BAND.index("L")
# share of the phases of a satellite's richest code that its first code must have: 0.9, since phases
# of P(Y) come and go at low elevations
MOST_OF_CODES = 0.9
# phases that a code may lack without another's in their place: 5, over which the engine keeps the
# ambiguity that a change of code would end
SHORT = 5
CHUNK = 2000  # epochs that are put together at a time: 2000, some 10 MB
TICKS_PER_S = 10_000_000  # of a stamp in RINEX, which has seven decimals of a second
EPOCH_WIDTH = 36  # characters of the line of an epoch
# characters of an observation in RINEX 3: its value F14.3, then flags of lock and strength
VALUE_WIDTH, FIELD = 14, 16
CODES_A_LINE = 13  # of SYS / # / OBS TYPES in RINEX 3
HEADER_KEPT = (  # header records that the engine looks at, and names
    *("MARKER NAME", "REC # / TYPE / VERS", "ANT # / TYPE", "APPROX POSITION XYZ"),
    *("ANTENNA: DELTA H/E/N", "GLONASS SLOT / FRQ #", "GLONASS COD/PHS/BIS"),
)


@dataclass(frozen=True, eq=False)
class _Band:
    """What fills the columns of one band of a system, m rows and the kinds of `IN_BAND`.

    names : codes of the columns, empty where a kind has no value; used : codes of the phases, most
    first.
    """

    names: tuple[str, ...]
    used: tuple[str, ...]
    values: Array
    lock: Flags
    strength: Flags


def engine_observations(observations: Observations) -> tuple[bytes, str]:
    """Return the file for the engine, and the codes of its phases, such as "G L1C L2W+L2X"."""
    o = observations
    systems = {
        letter: (rows, _bands(o, letter, rows))
        for letter, rows in rows_of_systems(o.satellite).items()
        if letter in ORDER
    }
    header = [f"{'     3.04           OBSERVATION DATA    M':60}RINEX VERSION / TYPE"]
    for label in HEADER_KEPT:
        header += [f"{record:60}{label}" for record in o.header.records.get(label, ())]
    for letter, (_, bands) in systems.items():
        codes = [f" {name}" for band in bands for name in band.names if name]
        for k in range(0, len(codes), CODES_A_LINE):
            count = f"{letter}  {len(codes):3d}" if k == 0 else " " * 6
            line = count + "".join(codes[k : k + CODES_A_LINE])
            header.append(f"{line:60}SYS / # / OBS TYPES")
    header.append(f"{'GPS':>51}{'':9}TIME OF FIRST OBS\n{'':60}END OF HEADER\n")
    text = "\n".join(header).encode("latin-1", "replace") + b"".join(_epoch_lines(o, systems))
    phases = {
        letter: [" "] + [MIXED_CODES.join(band.used) for band in bands if band.used]
        for letter, (_, bands) in systems.items()
    }
    return text, ", ".join(letter + " ".join(used)[1:] for letter, used in phases.items())


def _bands(o: Observations, letter: str, rows: Index) -> list[_Band]:
    """Return the bands in which `rows` (m,), the satellites of one system, have a value."""
    _, satellite = unique_satellites(o.satellite[rows])
    bands = []
    for band, order in ORDER[letter].items():
        column_of = {name: k for k, name in enumerate(o.signals) if name[1:2] == band}
        codes = sorted(
            {name[2] for name in column_of if len(name) == 3},
            key=lambda code: order.find(code) % (len(order) + 1),
        )
        if not codes:
            continue
        columns = np.array(
            [[column_of.get(kind + band + c, -1) for c in codes] for kind in IN_BAND]
        )
        values = np.where(columns < 0, np.nan, o.values[rows][:, columns])  # (m, kinds, codes)
        finite = np.isfinite(values)
        chosen = _phase_codes_of_rows(finite[:, PHASE], satellite)
        # of each kind the code of the phase, else the first that has a value
        fitting = finite.astype(np.int8)
        fitting[np.arange(rows.size), :, chosen] *= np.where(chosen < 0, 1, 2)[:, None]
        code = fitting.argmax(axis=2)
        code[:, PHASE] = np.maximum(chosen, 0)
        pick = np.arange(rows.size)[:, None], np.arange(len(IN_BAND)), code
        filled = values[pick]
        filled[chosen < 0, PHASE] = np.nan
        if not np.isfinite(filled).any():
            continue
        column = columns[pick[1], code]
        lock, strength = (flags[rows[:, None], column] for flags in (o.loss_of_lock, o.strength))
        lock[_rows_of_code_changes(chosen, satellite), PHASE] |= LOCK_LOST
        count = np.bincount(chosen[chosen >= 0], minlength=len(codes))
        used = [codes[k] for k in np.argsort(-count, kind="stable") if count[k]]
        code_count = np.bincount(code[np.isfinite(filled[:, 0]), 0], minlength=len(codes))
        name = band + (used or [codes[int(code_count.argmax())]])[0]
        names = tuple(
            kind + name if has_value else ""
            for kind, has_value in zip(IN_BAND, np.isfinite(filled).any(axis=0), strict=True)
        )
        phases = tuple(f"L{band}{c}" for c in used)
        bands.append(_Band(names, phases, filled, np.where(lock > 0, lock, 0), strength))
    return bands


def _phase_codes_of_rows(phases: NDArray[np.bool_], satellite: Index) -> Index:
    """Return the code (m,) whose phase each row takes, -1 for none, of `phases` (m, codes)."""
    chosen = np.full(satellite.size, -1)
    for number in range(int(satellite.max(initial=-1)) + 1):
        rows_of_satellite = np.flatnonzero(satellite == number)
        has_phase = phases[rows_of_satellite]
        count = has_phase.sum(axis=0)
        main_code = int(np.argmax(count >= MOST_OF_CODES * max(int(count.max()), 1)))
        chosen[rows_of_satellite[has_phase[:, main_code]]] = main_code
        edges = np.flatnonzero(np.diff(np.pad(~has_phase[:, main_code], 1).astype(np.int8)))
        for start, stop in zip(edges[::2], edges[1::2], strict=True):
            gap = has_phase[start:stop]
            filler = int(gap.sum(axis=0).argmax())
            if gap[:, filler].sum() > SHORT:
                chosen[rows_of_satellite[start:stop][gap[:, filler]]] = filler
    return chosen


def _rows_of_code_changes(chosen: Index, satellite: Index) -> Index:
    """Return the rows whose phase is of another code than the satellite's phase before."""
    with_phase = np.flatnonzero(chosen >= 0)
    rows = with_phase[np.argsort(satellite[with_phase], kind="stable")]
    same_satellite = satellite[rows[1:]] == satellite[rows[:-1]]
    return rows[1:][same_satellite & (chosen[rows[1:]] != chosen[rows[:-1]])]


def _epoch_lines(
    o: Observations, systems: Mapping[str, tuple[Index, list[_Band]]]
) -> Iterator[bytes]:
    """Yield the lines of `CHUNK` epochs and their satellites at a time, RINEX 3.04."""
    width = {
        letter: 3 + FIELD * sum(bool(name) for band in bands for name in band.names)
        for letter, (_, bands) in systems.items()
    }
    longest = max(EPOCH_WIDTH, *width.values()) if width else EPOCH_WIDTH
    ticks = np.rint(TICKS_PER_S * o.time).astype(np.int64)
    week_start = np.datetime64(int(GPS_EPOCH_UNIX_S + o.gps_week * WEEK_S), "s")
    count = np.zeros(o.time.size, dtype=np.int64)
    for rows, _ in systems.values():
        count += np.bincount(o.epoch[rows], minlength=count.size)
    for first_epoch in range(0, o.time.size, CHUNK):
        epochs = np.arange(first_epoch, min(first_epoch + CHUNK, o.time.size))
        start, stop = np.searchsorted(o.epoch, (epochs[0], epochs[-1] + 1))
        # a line an epoch, before those of its satellites
        satellite_line = np.arange(stop - start) + o.epoch[start:stop] - first_epoch + 1
        epoch_line = np.searchsorted(o.epoch[start:stop], epochs) + np.arange(epochs.size)
        text = np.full((stop - start + epochs.size, longest + 1), ord(" "), dtype=np.uint8)
        length = np.zeros(len(text), dtype=np.int64)
        for k, line in zip(epochs.tolist(), epoch_line.tolist(), strict=True):
            second, fraction = divmod(int(ticks[k]), TICKS_PER_S)
            date = (week_start + second).item()
            record = f"> {date:%Y %m %d %H %M %S}.{fraction:07d}  {o.flag[k]}{count[k]:3d}\n"
            text[line, : len(record)] = np.frombuffer(record.encode(), dtype=np.uint8)
            length[line] = len(record) if count[k] else 0
        for letter, (rows, bands) in systems.items():
            within = slice(*np.searchsorted(rows, (start, stop)))
            lines = satellite_line[rows[within] - start]
            names = np.ascontiguousarray(o.satellite[rows[within]], dtype="S3")
            text[lines, :3] = names.view(np.uint8).reshape(-1, 3)
            text[lines, width[letter]] = ord("\n")
            length[lines] = width[letter] + 1
            column = 3
            for band in bands:
                for k in [k for k, name in enumerate(band.names) if name]:
                    end = column + VALUE_WIDTH
                    text[lines, column:end] = _format_f14_3(band.values[within, k])
                    for flags in (band.lock[within, k], band.strength[within, k]):
                        text[lines, end] = np.where(flags > 0, flags + ord("0"), ord(" "))
                        end += 1
                    column += FIELD
        yield text[np.arange(longest + 1) < length[:, None]].tobytes()


def _format_f14_3(x: Array) -> NDArray[np.uint8]:
    """Characters (m, 14) of numbers (m,) with three decimals; blanks for what is none."""
    out = np.full((x.size, 14), ord(" "), dtype=np.uint8)
    finite = np.isfinite(x)
    digits = np.rint(1e3 * np.abs(np.where(finite, x, 0.0))).astype(np.int64)
    blanks = np.full(x.size, 9)
    for column in (13, 12, 11, *range(9, -1, -1)):
        shown = finite & ((digits > 0) | (column >= 9))
        out[shown, column] = digits[shown] % 10 + ord("0")
        blanks[shown & (column < 9)] = column
        digits //= 10
    out[finite, 10] = ord(".")
    negative = np.flatnonzero(finite & (x < 0.0) & (blanks > 0))
    out[negative, blanks[negative] - 1] = ord("-")
    return out
