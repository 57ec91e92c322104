"""The table reader, its refusals, and the writing of whole files."""

import contextlib
import os
import time
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from insgnss.base.errors import InputError, UsageError
from insgnss.base.files import atomic_write, lines_of
from insgnss.io.exposures.images import image_names
from insgnss.io.formats import read_barometer, read_events, read_gnss
from insgnss.io.formats.events.mrk import read_mrk
from insgnss.io.formats.imu.variances import read_variances
from insgnss.io.formats.text.text import format_rows, read_table, read_text_table
from insgnss.navigation.noise_model.model import model_of_text
from insgnss.photogrammetry.comparison.reading import read_poses

ANY = settings(
    max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)

floats = st.floats(allow_nan=False, allow_infinity=False, min_value=-1e250, max_value=1e250).filter(
    lambda x: x == 0 or abs(x) > 1e-250
)
forms = st.sampled_from(["%.17g", "%.3f", "%.12f", "%.18e", "%+.9E", "%g", "%.0f."])


def text_file(tmp_path: Path, content: str | bytes) -> Path:
    path = tmp_path / "table.txt"
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


@ANY
@given(st.lists(st.tuples(floats, forms), min_size=1, max_size=30))
def test_numbers_are_those_of_python(tmp_path: Path, numbers: list[tuple[float, str]]) -> None:
    """Oracle: float(); one unit in the last place, exact where mantissa and power of ten are exact
    doubles.
    """
    texts = [form % x for x, form in numbers if abs(x) < 1e15 or form != "%.12f"]
    texts = [text for text in texts if len(text) < 60] or ["0"]
    values = read_table(text_file(tmp_path, "".join(f"{text},1\n" for text in texts))).values[:, 0]
    for text, value in zip(texts, values, strict=True):
        assert abs(value - float(text)) <= np.spacing(abs(float(text)))
        assert np.signbit(value) == np.signbit(float(text))


@ANY
@given(st.integers(-(2**53) + 1, 2**53 - 1), st.integers(0, 15))
def test_up_to_fifteen_digits_are_exact(tmp_path: Path, mantissa: int, decimals: int) -> None:
    """Oracle: float(), which rounds correctly."""
    text = f"{'-' * (mantissa < 0)}{abs(mantissa):0{decimals + 1}d}"
    text = f"{text[: len(text) - decimals]}.{text[len(text) - decimals :]}"
    assert read_table(text_file(tmp_path, f"{text} 0\n")).values[0, 0] == float(text)


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " ", "   ", ", "])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
def test_delimiters_and_newlines(tmp_path: Path, delimiter: str, newline: str) -> None:
    """Oracle: numpy.loadtxt of the same numbers in its own format."""
    table = np.random.default_rng(7).normal(size=(40, 5))
    content = newline.join(delimiter.join(repr(x) for x in row) for row in table.tolist()) + newline
    plain = tmp_path / "plain.txt"
    np.savetxt(plain, table, fmt="%.17g")
    assert np.array_equal(read_table(text_file(tmp_path, content)).values, np.loadtxt(plain))


@pytest.mark.parametrize(
    ("content", "expected"),
    [
        ("1,5;-2,25\n3;4,5e2\n", [[1.5, -2.25], [3, 450]]),
        ("1,5 2,5\n3,5 4,5\n", [[1.5, 2.5], [3.5, 4.5]]),
        ("\ufeff1,2\n3,4\n", [[1, 2], [3, 4]]),
        ("# one\n\n1,2,\n  3 , 4 ,\n! two\n// three\n5,6,\n", [[1, 2], [3, 4], [5, 6]]),
        ("+.5 5.\n1E3 1e-3\n", [[0.5, 5], [1000, 0.001]]),
        ("1,2\n3,4", [[1, 2], [3, 4]]),
    ],
)
def test_spellings_of_tables(tmp_path: Path, content: str, expected: list[list[float]]) -> None:
    """Oracle: the numbers as a person reads them."""
    assert read_table(text_file(tmp_path, content)).values.tolist() == expected


def test_lines_are_counted_over_comments_and_blank_lines(tmp_path: Path) -> None:
    """Oracle: counting by hand."""
    assert read_table(text_file(tmp_path, "% a\nx,y\n1,2\n\n# b\n3,4\n")).lines.tolist() == [3, 6]


@pytest.mark.parametrize(
    ("content", "names"),
    [
        ("tow,gyro x (rad/s)\n1,2\n", ("tow", "gyro x (rad/s)")),
        ("# a comment of some words\n# tow [s]  lat [deg]\n1 2\n", ("tow [s]", "lat [deg]")),
        ("# three words here\n1,2\n", None),
        ("1,2\n", None),
    ],
)
def test_header_is_found(tmp_path: Path, content: str, names: tuple[str, ...] | None) -> None:
    """Oracle: formats.md A.2, rule 2."""
    assert read_table(text_file(tmp_path, content)).layout.header_fields == names


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("1,2\n3,x4\n", r"table.txt:2: 'x4' in field 2 where a finite number must stand"),
        ("1,2\n3,nan\n5,6\n", r"table.txt:2: 'nan' in field 2"),
        ("1 2\n-inf 4\n5 6\n", r"table.txt:2: '-inf' in field 1"),
        ("1,2\n3,\n5,6\n", r"table.txt:2: nothing in field 2"),
        ("1,2,3\n1,,3\n", r"table.txt:2: nothing in field 2"),
        ("1\t2\n\t1\t2\n3\t4\n", r"table.txt:2: 3 fields, expected 2"),
        ("1,2\n3,4,5\n6,7\n", r"table.txt:2: 3 fields, expected 2"),
        ("# c\n1 2 3\n\n4 5\n6 7 8\n", r"table.txt:4: 2 fields, expected 3"),
        ("1,2\n3,1.2.3\n", r"table.txt:2: '1.2.3' in field 2"),
        ("1,2\n3,1e999\n", r"table.txt:2: '1e999' in field 2"),
        ("1,2,3\n4,5,6\n7,8", r"table.txt:3: truncated: .*'7,8'"),
        (
            "1.00,2.00\n4.00,5.00\n7.00,8.0",
            r"table.txt:3: truncated: the file ends within a number, '8.0' after '5.00'",
        ),
        ("1.0,2.0\n4.0,5.0\n7.0,-", r"table.txt:3: truncated"),
        (b"1,2\n3,4\n\0\0\0\0\n", r"table.txt:3: '\\x00\\x00\\x00\\x00' in field 1"),
        (b"\xff\xfe1\0,\0", r"table.txt:1: is UTF-16"),
        ("", "table.txt: is empty"),
        ("# only\n\n", "table.txt: holds no data line"),
        ("tow,lat\n", "table.txt: holds no data line"),
        (
            "%RAWIMUSA,2008,5.1;2008,5.1,77,1,2,3,4,5,6*aa\n" * 2,
            r"logs of NovAtel \(RAWIMUSA\).* write a table tow,gx,gy,gz,ax,ay,az",
        ),
    ],
)
def test_first_bad_line_is_refused(tmp_path: Path, content: str | bytes, message: str) -> None:
    """Oracle: the line and the field as a person counts them."""
    with pytest.raises(InputError, match=message):
        read_table(text_file(tmp_path, content))


@pytest.mark.parametrize(
    "line",
    ["1" * 80_000 + "x", "1," * 40_000 + "x", "1." * 40_000, "+-" * 40_000, "(" * 80_000],
)
def test_a_long_line_costs_no_time(tmp_path: Path, line: str) -> None:
    """Oracle: one number pattern took 12 s of the first, in the square of its length."""
    path = text_file(tmp_path, f"# {line}\n{line}\n1,2\n")
    start = time.process_time()
    for read in (read_table, read_text_table):
        with contextlib.suppress(InputError):
            read(path)
    assert time.process_time() - start < 2.0


def test_a_field_is_no_longer_than_a_name(tmp_path: Path) -> None:
    """Oracle: the limit, and the line; a line of many fields may be longer."""
    with pytest.raises(InputError, match=r"txt:2: a field of 5000 characters \(limit 4096\)"):
        read_text_table(text_file(tmp_path, f"a,1\n{5000 * 'b'},1\n"))
    with pytest.raises(InputError, match=r"txt:30: a field of 5000 characters \(limit 4096\)"):
        read_text_table(text_file(tmp_path, 29 * "a,1\n" + f"{5000 * 'b'},1\n"))
    with pytest.raises(InputError, match=r"txt:1: 1001 fields \(limit 1000\)"):
        read_table(text_file(tmp_path, ",".join(map(str, range(1001))) + "\n"))
    row = ",".join(map(str, range(900)))
    assert read_table(text_file(tmp_path, f"{row}\n{row}\n")).values.shape == (2, 900)


def test_a_letter_of_latin_1_ends_no_line(tmp_path: Path) -> None:
    """Oracle: editors; 0x85 is an ellipsis of Windows, at which str.splitlines splits."""
    assert lines_of("a\x85b\u2028c\x0bd\ne\r\nf\rg\n\nh") == [
        *("a\x85b\u2028c\x0bd", "e", "f", "g", "", "h"),
    ]
    assert (lines_of(""), lines_of("\n"), lines_of("a\n")) == ([], [""], ["a"])
    names = tmp_path / "names.txt"
    names.write_bytes(b"a\x85b.jpg\nc.jpg\n")
    assert image_names(names) == ("a\x85b.jpg", "c.jpg")
    noise = tmp_path / "noise.toml"
    noise.write_text("name = 'a\x85b'\nsource = ''\n[gyro]\nwhite = 1\n", encoding="utf-8")
    with pytest.raises(InputError, match=r"noise\.toml:4: "):
        model_of_text(noise, noise.read_text(encoding="utf-8"))


def test_missing_file_is_refused(tmp_path: Path) -> None:
    """Oracle: the file system."""
    with pytest.raises(InputError, match="no such file"):
        read_table(tmp_path / "none.txt")
    with pytest.raises(InputError, match="cannot be read"):
        read_table(tmp_path)


def test_text_columns(tmp_path: Path) -> None:
    """Oracle: the fields as a person reads them."""
    table = read_text_table(text_file(tmp_path, 'image;tow\n"8001.tif";1,5\n8002.tif;2,5\n'))
    assert table.strings(0) == ("8001.tif", "8002.tif")
    assert table.floats(1).tolist() == [1.5, 2.5]
    with pytest.raises(
        InputError, match=r"table.txt:2: '8001.tif' where a finite number must stand"
    ):
        table.floats(0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a 1\nb\n", r":2: 1 fields, expected 2"),
        ("a 1 2\nb 1 2\nc 1", r":3: truncated"),
        ("a 1.25\nb 1.25\nc 1.2", ":3: truncated"),
    ],
)
def test_bad_line_of_a_text_table_is_refused(tmp_path: Path, content: str, message: str) -> None:
    """Oracle: the line as a person counts it."""
    with pytest.raises(InputError, match=message):
        read_text_table(text_file(tmp_path, content))


def test_rows_are_formatted_in_chunks() -> None:
    """Oracle: Python's % row by row."""
    table = np.random.default_rng(3).normal(size=(101, 3))
    assert "".join(format_rows("%.3f %g,%.9f\n", table, chunk=10)) == "".join(
        f"{a:.3f} {b:g},{c:.9f}\n" for a, b, c in table
    )


def test_file_appears_whole_or_not_at_all(tmp_path: Path) -> None:
    """Oracle: the directory's content after a writer that fails midway."""
    path = tmp_path / "out.txt"
    atomic_write(path, "before")

    def parts():  # type: ignore[no-untyped-def]
        yield "half"
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError):
        atomic_write(path, parts())
    assert os.listdir(tmp_path) == ["out.txt"]
    assert path.read_text() == "before"
    with pytest.raises(UsageError, match="directory does not exist"):
        atomic_write(tmp_path / "none" / "out.txt", b"x")


@pytest.mark.parametrize(
    "text",
    [
        "1" * 90_000 + "x",
        "a " + "_" * 12_000 + " b\n1 2 3",
        "# a = x" + " " * 90_000 + "y\n1 2",
        "\n" * 16_000 + "x",
        "# " + "omega " * 1300 + "phi " * 1300,
        "# " + " ' " * 4000 + "(\n1 2",
    ],
)
def test_no_pattern_takes_the_square_of_a_length(tmp_path: Path, text: str) -> None:
    """Oracle: finds of scripts/fuzz_readers.py, each of which took 5 s to minutes."""
    path = text_file(tmp_path, text + "\n")
    start = time.process_time()
    for read in (read_barometer, read_events, read_mrk, read_variances, read_poses, read_gnss):
        with contextlib.suppress(InputError, UsageError):
            read(path)
    assert time.process_time() - start < 3.0


def test_a_field_that_is_not_there_is_told_by_its_count(tmp_path: Path) -> None:
    """Oracle: the line; an IndexError before, as the field is longer than what is shown."""
    path = text_file(tmp_path, "1,2,3\n4,5," + "6" * 5000 + "x\n7,8,9\n")
    with pytest.raises(InputError, match=r"txt:2: "):
        read_table(path)
