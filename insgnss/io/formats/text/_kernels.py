"""Byte kernels: tables of decimal numbers, NMEA sentences, messages of ArduPilot logs.

A decimal is an integer mantissa m and a power of ten, x = m 10^e. With m < 2^53 and |e| <= 22 both
are exact doubles and one multiplication or division rounds correctly. Otherwise m = h + l and 10^e
= H + L are taken as unevaluated sums of two doubles (Dekker 1971) and

    x = hH + (err(hH) + hL + lH)                                                               (K.1)

is within one unit in the last place. At most 18 significant digits enter m; what follows weighs
less than 1e-17 of x.
"""

import math

import numpy as np

from ....base.compilation import njit

# largest power of ten in (K.1): its parts, and m 10^e, stay within the range of doubles
EXPONENT_LIMIT = 280

OK, BAD_NUMBER, TOO_FEW, TOO_MANY = 0, 1, 2, 3  # status of `parse_rows`
PRINTED = 32  # bytes that a number takes at most, its sign and what separates it among them
WHITESPACE = 256  # as a delimiter: runs of blanks and tabs

_NEWLINE, _BLANK = 10, 32  # bytes of ASCII
_BLANKS = (32, 9, 13)  # blank, tab, carriage return
_SPLIT = 134217729.0  # 2^27 + 1


def _powers_of_ten():
    exponents = range(-EXPONENT_LIMIT - 20, EXPONENT_LIMIT + 21)
    high = [float(f"1e{e}") for e in exponents]
    low = []
    for e, x in zip(exponents, high, strict=True):
        p, q = x.as_integer_ratio()
        up, down = 10 ** max(e, 0), 10 ** max(-e, 0)
        low.append((up * q - p * down) / (q * down))  # of integers, rounded once
    return np.array(high), np.array(low)


_TEN, _TEN_LOW = _powers_of_ten()
_TEN_ZERO = EXPONENT_LIMIT + 20  # index of 10^0 in `_TEN`


@njit(cache=True, allocates=False)
def _scale_by_power_of_ten(m, e):
    """m 10^e for 0 <= m < 10^18 and any e within the table."""
    if m < 9007199254740992 and -22 <= e <= 22:
        if e < 0:
            return np.float64(m) / _TEN[_TEN_ZERO - e]
        return np.float64(m) * _TEN[_TEN_ZERO + e]
    h = np.float64(m)
    l = np.float64(m - np.int64(h))
    H, L = _TEN[_TEN_ZERO + e], _TEN_LOW[_TEN_ZERO + e]
    p = h * H
    s = _SPLIT * h
    h1 = s - (s - h)
    h2 = h - h1
    s = _SPLIT * H
    H1 = s - (s - H)
    H2 = H - H1
    err = ((h1 * H1 - p) + h1 * H2 + h2 * H1) + h2 * H2
    return p + (err + h * L + l * H)  # (K.1)


@njit(cache=True, allocates=False)
def _long_mantissa(buf, i, decimal):
    """Return the mantissa of up to 18 significant digits from i on, and the power of ten after it.

    The power stands for the digits that follow these.
    """
    m, kept, e, fraction = np.int64(0), 0, 0, False
    while True:
        c = np.int64(buf[i])
        if c == decimal:
            fraction = True
        else:
            d = c - 48
            if d < 0 or d > 9:
                return m, e
            if kept < 18:
                m = 10 * m + d
                if m > 0:
                    kept += 1
                if fraction:
                    e -= 1
            elif not fraction:
                e += 1
        i += 1


@njit(cache=True, allocates=False)
def _exponent(buf, i):
    """Return the signed exponent at i behind its letter, the index after it, whether it was one."""
    negative = buf[i] == 45
    if negative or buf[i] == 43:
        i += 1
    start, e = i, np.int64(0)
    d = np.int64(buf[i]) - 48
    while 0 <= d <= 9:
        if e < 10000:
            e = 10 * e + d
        i += 1
        d = np.int64(buf[i]) - 48
    return (-e if negative else e), i, i > start


@njit(cache=True, allocates=False)
def _number(buf, i, decimal):
    """Return the number at i, the index after it, and whether it was one.

    A number beyond 10^+-280 is none.
    """
    negative = buf[i] == 45
    if negative or buf[i] == 43:
        i += 1
    start, m = i, np.int64(0)
    d = np.int64(buf[i]) - 48
    while 0 <= d <= 9:
        m = 10 * m + d
        i += 1
        d = np.int64(buf[i]) - 48
    digits, e = i - start, 0
    if buf[i] == decimal:
        i += 1
        point = i
        d = np.int64(buf[i]) - 48
        while 0 <= d <= 9:
            m = 10 * m + d
            i += 1
            d = np.int64(buf[i]) - 48
        e = point - i
        digits -= e
    if digits == 0:
        return 0.0, i, False
    if digits > 18:
        m, e = _long_mantissa(buf, start, decimal)
    if buf[i] == 101 or buf[i] == 69:
        exponent, i, fine = _exponent(buf, i + 1)
        if not fine:
            return 0.0, i, False
        e += exponent
    if m == 0:
        return (-0.0 if negative else 0.0), i, True
    if abs(e) > EXPONENT_LIMIT:
        return 0.0, i, False
    x = _scale_by_power_of_ten(m, e)
    return (-x if negative else x), i, True


@njit(cache=True, nogil=True, allocates=False)
def count_newlines(buf):
    """Return the number of newlines in `buf`."""
    n = 0
    for c in buf:
        n += c == _NEWLINE
    return n


@njit(cache=True, allocates=False)
def _field_end(buf, i, delimiter):
    """Return the index of the delimiter or newline behind the field at i.

    Of blanks it is the last one before the next field.
    """
    if delimiter == WHITESPACE:
        while buf[i] > _BLANK:
            i += 1
        while buf[i] in _BLANKS:
            i += 1
        return i
    while buf[i] != delimiter and buf[i] != _NEWLINE:
        i += 1
    return i


@njit(cache=True, nogil=True, allocates=False)
def parse_rows(buf, i, line, delimiter, decimal, values, lines, bad):
    """Parse data lines of `buf` into `values` and their `lines`.

    Parameters
    ----------
    buf
        Bytes that end in a newline.
    i, line
        Index and line of the first data line.
    delimiter, decimal
        Bytes.
    values, lines
        (n, m) and (n,) outputs.
    bad
        (m, 2), -1 before: index and line of the first field of each column that is no number;
        not-a-number stands for such a field.

    Returns
    -------
    rows, status, index, line
        A status other than OK with the index and the line of the error.
    """
    end, n_fields, row = buf.size, values.shape[1], 0
    while i < end:
        k = i
        while buf[k] in _BLANKS:
            k += 1
        c = buf[k]
        if c == _NEWLINE:
            i = k + 1
            line += 1
            continue
        if c == 35 or c == 37 or c == 33 or c == 59 or (c == 47 and buf[k + 1] == 47):
            while buf[k] != _NEWLINE:
                k += 1
            i = k
            continue
        while buf[i] in _BLANKS and buf[i] != delimiter:
            i += 1
        for col in range(n_fields):
            start = i
            x, i, fine = _number(buf, i, decimal)
            c = buf[i]
            while c in _BLANKS and c != delimiter:
                i += 1
                c = buf[i]
            apart = delimiter == WHITESPACE and i > start and buf[i - 1] <= _BLANK
            if not fine or not (c in (delimiter, _NEWLINE) or apart):
                if bad[col, 0] < 0:
                    bad[col, 0], bad[col, 1] = start, line
                x, i = np.nan, _field_end(buf, start, delimiter)
                c = buf[i]
            values[row, col] = x
            if col + 1 < n_fields:
                if c == _NEWLINE:
                    return row, TOO_FEW, start, line
                if c == delimiter:
                    i += 1
                    while buf[i] in _BLANKS and buf[i] != delimiter:
                        i += 1
                    if buf[i] == _NEWLINE and col + 2 < n_fields:  # the last one may be empty
                        return row, TOO_FEW, start, line
        if c == delimiter:  # one delimiter may close a line
            i += 1
            while buf[i] in _BLANKS:
                i += 1
        if buf[i] != _NEWLINE:
            return row, TOO_MANY, i, line
        lines[row] = line
        row += 1
        i += 1
        line += 1
    return row, OK, end, line


@njit(cache=True, nogil=True, allocates=False)
def take_columns(table, columns, to, factors, out):
    """Write columns of a table, each times its factor, into columns of another array.

    Parameters
    ----------
    table
        (n, m).
    columns, to, factors
        (k,) columns of `table`, those of `out` and the factors.
    out
        (n, l).
    """
    for row in range(table.shape[0]):
        for k in range(columns.size):
            out[row, to[k]] = table[row, columns[k]] * factors[k]


@njit(cache=True)
def print_rows(table, row, decimals, before, after, out):
    """Print rows of numbers with fixed decimals into `out`, from `row` on, as printf does.

    A decimal digit is rounded right where |x| 10^d, rounded once, is not nearer to a half than that
    rounding; of a number for which it is, or that is too large, nothing is said.

    Parameters
    ----------
    table
        (n, m) numbers.
    row
        Where to begin.
    decimals
        (m,) decimals; -1 for a whole number, cut to it as %d does.
    before, after
        Bytes between the numbers of a row, a comma or the like, and behind the last one.
    out
        Bytes, enough for `PRINTED` a number.

    Returns
    -------
    row, length
        The row that it ended before: the number of rows, or one to be printed by others.
    """
    end, n, m = 0, table.shape[0], table.shape[1]
    digits = np.empty(32, dtype=np.uint8)
    while row < n:
        start = end
        for col in range(m):
            x, d = table[row, col], decimals[col]
            scaled = abs(x) * _TEN[_TEN_ZERO + max(d, 0)]
            if not scaled < 4503599627370496.0:
                return row, start
            whole = np.int64(scaled)
            rest = scaled - np.float64(whole)
            if d >= 0:
                if abs(rest - 0.5) <= 2.3e-16 * scaled:
                    return row, start
                whole += rest > 0.5
            if math.copysign(1.0, x) < 0.0 and (d >= 0 or whole > 0):
                out[end] = 45
                end += 1
            k = 0
            while k < d:
                digits[k] = 48 + whole % 10
                whole //= 10
                k += 1
            if d > 0:
                digits[k] = 46
                k += 1
            digits[k] = 48 + whole % 10
            whole //= 10
            k += 1
            while whole > 0:
                digits[k] = 48 + whole % 10
                whole //= 10
                k += 1
            while k > 0:
                k -= 1
                out[end] = digits[k]
                end += 1
            out[end] = before if col + 1 < m else after
            end += 1
        row += 1
    return row, end


@njit(cache=True, allocates=False)
def nmea_sentences(buf, starts, stars, lines):
    """Find the sentences, and what else is not blank: start, star and line of each.

    A sentence opens with '$' and ends before the next '$' or with its line, so that sentences of a
    line that lost an end between them are all found. The star is the index of the '*' before a
    right checksum, that of '*' or the end with the sign turned for a sentence without one, else 0;
    the checksum is the exclusive or of the bytes up to '*', in two hexadecimal digits. Returns the
    count.
    """
    n, i, line = 0, 0, 1
    while i < buf.size:
        while buf[i] <= _BLANK and buf[i] != _NEWLINE:
            i += 1
        if buf[i] == _NEWLINE:
            i += 1
            line += 1
            continue
        first = i
        i += 1
        while buf[i] != _NEWLINE and buf[i] != 36:
            i += 1
        check, k = np.int64(0), first + 1
        while k < i and buf[k] != 42:
            check ^= np.int64(buf[k])
            k += 1
        right = (
            buf[first] == 36
            and k + 2 < i
            and 16 * _hex_digit(buf[k + 1]) + _hex_digit(buf[k + 2]) == check
        )
        star = k if right else -k if buf[first] == 36 else 0
        starts[n], stars[n], lines[n] = first, star, line
        n += 1
    return n


@njit(cache=True, allocates=False)
def _hex_digit(c):
    if 48 <= c <= 57:
        return np.int64(c) - 48
    if 65 <= c <= 70:
        return np.int64(c) - 55
    if 97 <= c <= 102:
        return np.int64(c) - 87
    return -1000


@njit(cache=True, allocates=False)
def dataflash_messages(buf, lengths, kinds, places):
    """Find the messages of an ArduPilot log: kind and index of each.

    `lengths` (256,) of the kinds, zero of those not known yet, is filled by the FMT messages (kind
    128: kind, length, ...).

    Returns
    -------
    tuple
        Count, bytes of no message, index of a message that the file's end cuts or -1, index of an
        FMT that is none or -1.
    """
    n, i, n_lost, size = 0, 0, 0, buf.size
    while i + 3 <= size:
        kind = np.int64(buf[i + 2])
        length = lengths[kind]
        if buf[i] != 0xA3 or buf[i + 1] != 0x95 or length == 0:
            n_lost += 1
            i += 1
            continue
        if i + length > size:
            return n, n_lost, i, -1
        if kind == 128:
            if buf[i + 4] < 3:
                return n, n_lost, -1, i
            lengths[np.int64(buf[i + 3])] = np.int64(buf[i + 4])
        kinds[n], places[n] = kind, i
        n += 1
        i += length
    return n, n_lost + size - i, -1, -1


@njit(cache=True, allocates=False)
def ulog_end(buf, i):
    """Return the index of the first message of a PX4 log, from i on, whose length exceeds the file.

    It is the file's size where all fit.
    """
    while i + 3 <= buf.size:
        following = i + 3 + np.int64(buf[i]) + 256 * np.int64(buf[i + 1])
        if following > buf.size:
            return i
        i = following
    return i
