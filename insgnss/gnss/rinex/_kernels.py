"""Byte kernel of RINEX observations: epochs, satellites and numbers of fixed columns, from one
event record to the next.

A number of 14 columns is a mantissa below 2^53 over a power of ten below 10^15, both exact doubles,
so that one division rounds correctly. Stamps are whole ticks of 1e-7 s since 1980-01-06, counted
from the calendar by the algorithm of the proleptic Gregorian calendar with years that begin in
March.
"""

import numpy as np

from ...base.compilation import njit

# why the kernel stops: at the end, for the caller to act and go on, or at a line that is wrong
DONE, EVENT, FULL, NEW_SYSTEM, BAD_EPOCH, BAD_SATELLITE, BAD_FIELD, TWICE, CUT = range(9)
OFFSET, LINE, EPOCHS, ROWS, FLAG, COUNT, TICKS, MARK, MARK_LINE, SYSTEM = range(10)  # of the state
STATE_SIZE = 10  # numbers of the state

TICKS_PER_S = 10_000_000  # RINEX writes seconds with seven decimals
_NO_NUMBER, _BAD = -1, -2  # in the place of a whole number
# characters by their ASCII codes; an epoch begins with >
_NEWLINE, _RETURN, _SPACE, _PLUS, _MINUS, _POINT, _ZERO, _EPOCH = 10, 13, 32, 43, 45, 46, 48, 62
_DAY_OF_1980_01_06 = 723125  # days since 0000-03-01
# powers of ten: 15 decimals are all that a double holds
_POWERS_OF_TEN = np.array([10.0**k for k in range(16)])
_SYSTEM_OF = np.full(256, -1, dtype=np.int64)  # number of a system by its letter; -1: none
for _k, _letter in enumerate("GRECJIS"):
    _SYSTEM_OF[ord(_letter)] = _k


@njit(cache=True)
def _end(buf, i):
    while buf[i] != _NEWLINE:
        i += 1
    return i


@njit(cache=True)
def _text_end(buf, start, stop):
    """End of a line's text: without blanks and a carriage return."""
    while stop > start and (buf[stop - 1] == _SPACE or buf[stop - 1] == _RETURN):
        stop -= 1
    return stop


@njit(cache=True)
def _whole(buf, a, b, end):
    """Whole number without sign in columns a to b of a text that ends at `end`; _NO_NUMBER, or
    _BAD.
    """
    n, digit_seen, ended = 0, False, False
    for i in range(a, min(b, end)):
        c = np.int64(buf[i])
        if c == _SPACE:
            ended = digit_seen
        elif _ZERO <= c <= _ZERO + 9 and not ended:
            n = 10 * n + c - _ZERO
            digit_seen = True
        else:
            return _BAD
    return n if digit_seen else _NO_NUMBER


@njit(cache=True)
def _f14_3(buf, a):
    """Number of the form F14.3 in the 14 columns from `a` on, as nearly all are: whether it is one,
    and the number.
    """
    stop = a + 10
    while a < stop and buf[a] == _SPACE:
        a += 1
    negative = buf[a] == _MINUS
    if negative:
        a += 1
    m, fine = np.int64(0), a < stop
    for i in range(a, stop):
        d = np.int64(buf[i]) - _ZERO
        fine &= 0 <= d <= 9
        m = 10 * m + d
    for i in range(stop + 1, stop + 4):
        d = np.int64(buf[i]) - _ZERO
        fine &= 0 <= d <= 9
        m = 10 * m + d
    x = np.float64(m) / 1000.0
    return fine, (-x if negative else x)


@njit(cache=True)
def _number(buf, a, b):
    """Number in columns a to b, which the text fills: 0 where there is none, 1, or _BAD; and the
    number.
    """
    if b - a == 14 and buf[a + 10] == _POINT:
        fine, x = _f14_3(buf, a)
        if fine:
            return 1, x
    while a < b and buf[a] == _SPACE:
        a += 1
    while a < b and buf[b - 1] == _SPACE:
        b -= 1
    if a == b:
        return 0, 0.0
    negative = buf[a] == _MINUS
    if negative or buf[a] == _PLUS:
        a += 1
    m, point, digits = np.int64(0), np.int64(-1), 0
    for i in range(a, b):
        d = np.int64(buf[i]) - _ZERO
        if 0 <= d <= 9:
            m = 10 * m + d
            digits += 1
        elif buf[i] == _POINT and point < 0:
            point = i
        else:
            return _BAD, 0.0
    if point < 0 or digits == 0 or digits > 15:
        return _BAD, 0.0
    x = np.float64(m) / _POWERS_OF_TEN[b - 1 - point]
    return 1, (-x if negative else x)


@njit(cache=True)
def _seconds(buf, a, b, end):
    """Ticks of a second of up to 7 decimals in columns a to b; _NO_NUMBER, or _BAD."""
    b = min(b, end)
    while a < b and buf[a] == _SPACE:
        a += 1
    if a >= b:
        return _NO_NUMBER
    ticks, decimals, digits = np.int64(0), np.int64(-1), 0
    for i in range(a, b):
        d = np.int64(buf[i]) - _ZERO
        if 0 <= d <= 9 and decimals < 7:
            ticks = 10 * ticks + d
            digits += 1
            if decimals >= 0:
                decimals += 1
        elif buf[i] == _POINT and decimals < 0:
            decimals = 0
        else:
            return _BAD
    if digits == 0:
        return _BAD
    for _ in range(7 - max(decimals, 0)):
        ticks *= 10
    return ticks


@njit(cache=True)
def _days(year, month, day):
    """Days from 1980-01-06 to a date."""
    if month <= 2:
        year -= 1
        month += 12
    return (
        365 * year
        + year // 4
        - year // 100
        + year // 400
        + (153 * (month - 3) + 2) // 5
        + day
        - 1
        - _DAY_OF_1980_01_06
    )


@njit(cache=True)
def _stamp(buf, offset, end, three):
    """Ticks of the calendar stamp of an epoch's line that begins at `offset`; _NO_NUMBER where all
    is blank, or _BAD.
    """
    if three:
        year, offset = _whole(buf, offset + 1, offset + 6, end), offset + 6
    else:
        year, offset = _whole(buf, offset + 1, offset + 3, end), offset + 3
        if year >= 0:
            year += 1900 if year >= 80 else 2000
    month, day = _whole(buf, offset, offset + 3, end), _whole(buf, offset + 3, offset + 6, end)
    hour, minute = (
        _whole(buf, offset + 6, offset + 9, end),
        _whole(buf, offset + 9, offset + 12, end),
    )
    ticks = _seconds(buf, offset + 12, offset + 23, end)
    if (
        year == _NO_NUMBER
        and month == _NO_NUMBER
        and day == _NO_NUMBER
        and hour == _NO_NUMBER
        and minute == _NO_NUMBER
        and ticks == _NO_NUMBER
    ):
        return _NO_NUMBER
    lengths = (
        31,
        29 if year % 4 == 0 and (year % 100 != 0 or year % 400 == 0) else 28,
        31,
        30,
        31,
        30,
        31,
        31,
        30,
        31,
        30,
        31,
    )
    if year < 1980 or not 1 <= month <= 12 or not 1 <= day <= lengths[month - 1]:
        return _BAD
    if not 0 <= hour <= 23 or not 0 <= minute <= 59 or not 0 <= ticks < 61 * TICKS_PER_S:
        return _BAD
    ticks += ((_days(year, month, day) * 24 + hour) * 60 + minute) * 60 * TICKS_PER_S
    return ticks if ticks >= 0 else _BAD


@njit(cache=True)
def _satellite(buf, offset, end, blank):
    """Hundred times the system's place plus the number of the satellite in three columns; _BAD for
    what is none.
    """
    if offset + 2 > end:
        return _BAD
    system = np.int64(blank) if buf[offset] == _SPACE else _SYSTEM_OF[buf[offset]]
    number = _whole(buf, offset + 1, offset + 3, end)
    if system < 0 or number < 1:
        return _BAD
    return 100 * system + number


@njit(cache=True)
def _fault(state, status, offset, line):
    state[MARK], state[MARK_LINE] = offset, line
    return status


@njit(cache=True)
def _epoch_line(buf, offset, end, three, state):
    """Flag, count of records and stamp of an epoch's line into the state; whether it is one."""
    flag_at = offset + (31 if three else 28)
    if (
        three
        and end > flag_at - 1
        and buf[flag_at - 1] != _SPACE
        and (end <= flag_at or buf[flag_at] == _SPACE)
    ):
        # one blank instead of two behind the seconds: a converter in wide use wrote so
        flag_at -= 1
    if three and buf[offset] != _EPOCH and buf[offset] != _SPACE:
        return False
    for i in range(offset + (29 if three else 26), min(flag_at, end)):
        if buf[i] != _SPACE:  # between seconds and flag stands nothing
            return False
    flag, count = _whole(buf, flag_at, flag_at + 1, end), _whole(buf, flag_at + 1, flag_at + 4, end)
    state[FLAG], state[COUNT] = max(flag, 0), max(count, 0)
    state[TICKS] = _stamp(buf, offset, end, three)
    if flag == _BAD or flag > 6 or count == _BAD or state[TICKS] == _BAD or end <= flag_at:
        return False
    if flag >= 2 and flag <= 5:
        return True
    return count >= 0 and state[TICKS] >= 0 and (not three or buf[offset] == _EPOCH)


@njit(cache=True)
def _satellite_list(buf, offset, end, line, count, blank, sats, state):
    """Satellites of an epoch of RINEX 2, which may go on on further lines: status, offset and line
    behind them.
    """
    first = offset
    for k in range(count):
        if k > 0 and k % 12 == 0:
            offset = _end(buf, end) + 1
            line += 1
            if offset >= buf.size:
                return _fault(state, CUT, offset, line), offset, line
            first, end = offset, _text_end(buf, offset, _end(buf, offset))
            for i in range(offset, min(offset + 32, end)):
                if buf[i] != _SPACE:
                    return _fault(state, BAD_SATELLITE, offset, line), offset, line
        sats[k] = _satellite(buf, first + 32 + 3 * (k % 12), end, blank)
        if sats[k] < 0:
            return _fault(state, BAD_SATELLITE, first, line), offset, line
    return DONE, _end(buf, end) + 1, line + 1


@njit(cache=True)
def _is_flag(c):
    return c == _SPACE or _ZERO <= c <= _ZERO + 9


@njit(cache=True)
def _field(buf, offset, end, row, column, factor, values, lock, strength):
    """One number with its flags from the field at `offset`, of a text that ends at `end`; False for
    what is none.
    """
    status, x = _number(buf, offset, min(offset + 14, end))
    if status < 0:
        return False
    if status == 1 and x != 0.0:
        values[row, column] = x / factor
    if offset + 14 < end and buf[offset + 14] != _SPACE:
        lock[row, column] = buf[offset + 14] - _ZERO
    if offset + 15 < end and buf[offset + 15] != _SPACE:
        strength[row, column] = buf[offset + 15] - _ZERO
    return (offset + 14 >= end or _is_flag(buf[offset + 14])) and (
        offset + 15 >= end or _is_flag(buf[offset + 15])
    )


@njit(cache=True)
def _observations(buf, offset, row, k, last, columns, scale, values, lock, strength):
    """Numbers k to last of a satellite, from the field at `offset` on.

    The result is the offset of the line's end, or _BAD for what is no number.

    A field that is whole and followed by others holds no line's end, so the end is looked for only
    where a field is not.
    """
    for j in range(k, last):
        if offset + 16 <= buf.size:
            last_of_line = buf[offset + 14] == _NEWLINE
            if buf[offset + 10] == _POINT and (
                last_of_line or (_is_flag(buf[offset + 14]) and _is_flag(buf[offset + 15]))
            ):
                fine, x = _f14_3(buf, offset)
                if fine:
                    if x != 0.0:
                        values[row, columns[j]] = x if scale[j] == 1.0 else x / scale[j]
                    if last_of_line:
                        return offset + 14
                    if buf[offset + 14] != _SPACE:
                        lock[row, columns[j]] = buf[offset + 14] - _ZERO
                    if buf[offset + 15] != _SPACE:
                        strength[row, columns[j]] = buf[offset + 15] - _ZERO
                    offset += 16
                    continue
            elif _text_end(buf, offset, offset + 16) == offset:
                offset += 16
                continue
        stop = _end(buf, offset)
        end = _text_end(buf, offset, stop)
        if not _field(buf, offset, end, row, columns[j], scale[j], values, lock, strength):
            return _BAD
        if end <= offset + 16:
            return stop
        offset += 16
    stop = _end(buf, offset)
    return stop if _text_end(buf, offset, stop) == offset else _BAD


@njit(cache=True)
def parse(
    buf,
    three,
    blank,
    widths,
    columns,
    scale,
    state,
    sats,
    seen,
    ticks,
    flags,
    clock,
    lines,
    epoch,
    satellite,
    values,
    lock,
    strength,
):
    """Parse from the state's offset on until the end (DONE), an event (EVENT) or a fault.

    The records of an event are not read. widths (s,) is the number of types of each system,
    negative where unknown; columns, scale (s, w) are of each of its types. Only whole epochs count:
    where the status is not DONE or EVENT the state's offset is the start of the epoch at fault, and
    MARK, MARK_LINE the fault.
    """
    offset, line = state[OFFSET], state[LINE]
    while True:
        state[OFFSET], state[LINE] = offset, line
        if offset >= buf.size:
            return DONE
        stop = _end(buf, offset)
        end = _text_end(buf, offset, stop)
        if end == offset:
            offset, line = stop + 1, line + 1
            continue
        if not _epoch_line(buf, offset, end, three, state):
            return _fault(state, BAD_EPOCH, offset, line)
        count, n, m = state[COUNT], state[EPOCHS], state[ROWS]
        if 2 <= state[FLAG] <= 5:
            state[OFFSET], state[LINE] = stop + 1, line + 1
            state[MARK], state[MARK_LINE] = offset, line
            return EVENT
        if n >= ticks.size or m + count > satellite.size:
            return FULL
        ticks[n], flags[n], lines[n], clock[n] = state[TICKS], state[FLAG], line, np.nan
        first = offset + (41 if three else 68)
        if end > first:
            is_number, x = _number(buf, first, min(first + (15 if three else 12), end))
            if is_number < 0:
                return _fault(state, BAD_FIELD, offset, line)
            if is_number == 1:
                clock[n] = x
        if three:
            offset, line = stop + 1, line + 1
        else:
            status, offset, line = _satellite_list(
                buf, offset, min(end, offset + 68), line, count, blank, sats, state
            )
            if status != DONE:
                return status
        for k in range(count):
            if offset >= buf.size:
                return _fault(state, CUT, offset, line)
            if three:
                sats[k] = _satellite(buf, offset, min(offset + 3, buf.size), _BAD)
                if sats[k] < 0:
                    return _fault(state, BAD_SATELLITE, offset, line)
            system, row = sats[k] // 100, m + k
            width = widths[system]
            if width < 0:
                state[SYSTEM] = system
                return _fault(state, NEW_SYSTEM, offset, line)
            if seen[sats[k]] == n:
                return _fault(state, TWICE, offset, line)
            seen[sats[k]] = n
            epoch[row], satellite[row] = n, sats[k]
            for j in range(values.shape[1]):
                values[row, j], lock[row, j], strength[row, j] = np.nan, 0, 0
            done = 0
            while True:
                last = width if three else min(done + 5, width)
                begin = offset + (3 if three else 0)
                stop = _observations(
                    buf,
                    begin,
                    row,
                    done,
                    last,
                    columns[system],
                    scale[system],
                    values,
                    lock,
                    strength,
                )
                if stop < 0:
                    return _fault(state, BAD_FIELD, offset, line)
                offset, line, done = stop + 1, line + 1, last
                if done >= width:
                    break
                if offset >= buf.size:
                    return _fault(state, CUT, offset, line)
        state[EPOCHS], state[ROWS] = n + 1, m + count
