"""A small writer of RINEX 2 and 3 observations for tests: every line is put together from the
columns that the format documents give.
"""

from collections.abc import Mapping, Sequence

Field = (
    float | tuple[float | None, str] | None
)  # a number, or a number and its two flags, or nothing
Stamp = tuple[int, int, int, int, int, float]


def record(text: str, label: str) -> str:
    """A header record."""
    return f"{text:<60}{label:<20}\n"


def field(value: Field) -> str:
    """F14.3 and two flags."""
    number, flags = value if isinstance(value, tuple) else (value, "  ")
    return (" " * 14 if number is None else f"{number:14.3f}") + f"{flags:<2}"


def header2(
    types: Sequence[str],
    more: str = "",
    version: str = "2.11",
    system: str = "M",
    clock: str = "GPS",
) -> str:
    """Header of RINEX 2; the types go on on further records after nine."""
    return (
        record(f"{version:>9}{'':11}{'OBSERVATION DATA':<20}{system}", "RINEX VERSION / TYPE")
        + record("rover", "MARKER NAME")
        + types2(types)
        + (
            record(
                f"{'2018    10     4    13     5    0.0000000':>43}{clock:>8}", "TIME OF FIRST OBS"
            )
            if clock
            else ""
        )
        + more
        + record("", "END OF HEADER")
    )


def types2(types: Sequence[str]) -> str:
    """Records of the types of RINEX 2."""
    rows = [types[k : k + 9] for k in range(0, len(types), 9)]
    counts = [f"{len(types):6d}", *[" " * 6] * len(rows)]
    return "".join(
        record(count + "".join(f"{name:>6}" for name in row), "# / TYPES OF OBSERV")
        for count, row in zip(counts, rows, strict=False)
    )


def header3(
    types: Mapping[str, Sequence[str]],
    more: str = "",
    version: str = "3.04",
    system: str = "M",
    clock: str = "GPS",
) -> str:
    """Header of RINEX 3; the types go on on further records after thirteen."""
    return (
        record(f"{version:>9}{'':11}{'OBSERVATION DATA':<20}{system}", "RINEX VERSION / TYPE")
        + record("rover", "MARKER NAME")
        + "".join(types3(name, codes) for name, codes in types.items())
        + (
            record(
                f"{'2018    10     4    13     5    0.0000000':>43}{clock:>8}", "TIME OF FIRST OBS"
            )
            if clock
            else ""
        )
        + more
        + record("", "END OF HEADER")
    )


def types3(system: str, codes: Sequence[str]) -> str:
    """Records of the types of a system of RINEX 3."""
    rows = [codes[k : k + 13] for k in range(0, len(codes), 13)]
    starts = [f"{system}  {len(codes):3d}", *[" " * 6] * len(rows)]
    return "".join(
        record(start + "".join(f" {code}" for code in row), "SYS / # / OBS TYPES")
        for start, row in zip(starts, rows, strict=False)
    )


def stamp2(when: Stamp | None) -> str:
    """Columns 1 to 26 of an epoch's line of RINEX 2."""
    if when is None:
        return " " * 26
    year, month, day, hour, minute, second = when
    return f" {year % 100:02d} {month:2d} {day:2d} {hour:2d} {minute:2d}{second:11.7f}"


def epoch2(
    when: Stamp, rows: Mapping[str, Sequence[Field]], flag: int = 0, clock: float | None = None
) -> str:
    """An epoch of RINEX 2: the list of satellites goes on after twelve, the fields of a satellite
    after five.
    """
    names = list(rows)
    first = f"{stamp2(when)}  {flag}{len(names):3d}{''.join(names[:12]):<36}" + (
        "" if clock is None else f"{clock:12.9f}"
    )
    text = first.rstrip() + "\n"
    text += "".join(" " * 32 + "".join(names[k : k + 12]) + "\n" for k in range(12, len(names), 12))
    for fields in rows.values():
        for k in range(0, max(len(fields), 1), 5):
            text += "".join(map(field, fields[k : k + 5])).rstrip() + "\n"
    return text


def event2(when: Stamp | None, flag: int = 5, records: Sequence[str] = ()) -> str:
    """An event of RINEX 2 and its records."""
    return f"{stamp2(when)}  {flag}{len(records):3d}\n" + "".join(records)


def stamp3(when: Stamp | None) -> str:
    """Columns 1 to 29 of an epoch's line of RINEX 3."""
    if when is None:
        return ">" + " " * 28
    year, month, day, hour, minute, second = when
    return f"> {year:4d} {month:02d} {day:02d} {hour:02d} {minute:02d}{second:11.7f}"


def epoch3(
    when: Stamp, rows: Mapping[str, Sequence[Field]], flag: int = 0, clock: float | None = None
) -> str:
    """An epoch of RINEX 3: one line a satellite."""
    first = f"{stamp3(when)}  {flag}{len(rows):3d}" + (
        "" if clock is None else f"{'':6}{clock:15.12f}"
    )
    return (
        first
        + "\n"
        + "".join(
            (name + "".join(map(field, fields))).rstrip() + "\n" for name, fields in rows.items()
        )
    )


def event3(when: Stamp | None, flag: int = 5, records: Sequence[str] = ()) -> str:
    """An event of RINEX 3 and its records."""
    return f"{stamp3(when)}  {flag}{len(records):3d}\n" + "".join(records)
