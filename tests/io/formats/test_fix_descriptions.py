"""What files say of the solution of a fix beside its position: satellites, ratio, age, dilution."""

from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from insgnss.base.errors import InputError
from insgnss.io.formats import read_gnss
from insgnss.io.formats.gnss.rtklib_pos_write import write_rtklib_pos
from insgnss.navigation.prepare.clock import cut_fixes
from insgnss.records import GnssFixes
from insgnss.records.from_tables import gnss_fixes
from insgnss.records.observations import in_week

HEADER = (
    "%  GPST latitude(deg) longitude(deg) height(m) Q ns sdn(m) sde(m) sdu(m) sdne(m) sdeu(m)"
    " sdun(m) age(s) ratio"
)
ROW = "2008 {t:.1f} 46.57 6.54 {h} 1 {ns} 0.01 0.01 0.02 0.0 0.0 0.0 {age} {ratio}"


def written(path: Path, lines: list[str]) -> Path:
    path.write_text("\n".join(lines) + "\n")
    return path


def pos(path: Path, rows: list[tuple[float, int, float, float]], more: str = "") -> Path:
    head = HEADER + ("" if not more else " PDOP")
    body = [
        ROW.format(t=t, h=600 + t, ns=ns, age=age, ratio=ratio) + more for t, ns, age, ratio in rows
    ]
    return written(path, [head, *body])


def sentence(body: str) -> str:
    check = 0
    for c in body:
        check ^= ord(c)
    return f"${body}*{check:02X}"


def test_of_rtklib(tmp_path: Path) -> None:
    """Oracle: the numbers written; rows out of order carry theirs along, a double row is one."""
    rows = [(1.0, 12, 0.0, 9.5), (1.2, 14, -0.2, 3.25), (1.1, 13, 0.1, 0.0), (1.2, 14, -0.2, 3.25)]
    rows += [(2.0 + 0.1 * k, 15, 0.3, 4.0) for k in range(200)]
    got = read_gnss(pos(tmp_path / "a.pos", rows, " 1.7"))
    assert_array_equal(got[:3].satellites, [12, 13, 14])
    assert_array_equal(got[:3].ratio, [9.5, 0.0, 3.25])
    assert_array_equal(got[:3].age_s, [0.0, 0.1, -0.2])
    assert_array_equal(got.pdop, np.full(len(got), 1.7))
    assert got.hdop is None
    cut = cut_fixes(in_week(got, 2007), 604801.1, 604801.2)
    assert_array_equal(cut.satellites, [13, 14])
    back = gnss_fixes(got.to_pandas())
    assert_array_equal(back.satellites, got.satellites)
    write_rtklib_pos(got, tmp_path / "b.pos")
    again = read_gnss(tmp_path / "b.pos")
    assert_array_equal(again.satellites, got.satellites)
    assert_array_equal(again.age_s, got.age_s)


def test_zeros_for_unknown_are_left_out(tmp_path: Path) -> None:
    """Oracle: a writer that does not know them writes zeros; an age of zero is one beside them."""
    got = read_gnss(pos(tmp_path / "a.pos", [(1.0, 0, 0.0, 0.0), (1.2, 0, 0.0, 0.0)]))
    assert (got.satellites, got.ratio, got.age_s) == (None, None, None)
    got = read_gnss(pos(tmp_path / "a.pos", [(1.0, 7, 0.0, 0.0), (1.2, -1, 0.0, 0.0)]))
    assert_array_equal(got.satellites, [7.0, np.nan])
    assert_array_equal(got.age_s, [0.0, 0.0])


def test_of_nmea(tmp_path: Path) -> None:
    """Oracle: fields of GGA (7 satellites, 8 HDOP, 13 age) and GSA (15 PDOP) of NMEA 0183; 99.9 and
    empty fields are unknown. The fix without GST is left out with what describes it.
    """
    lines: list[str] = []
    for k in range(101):
        clock = f"1000{k // 10:02d}.{k % 10}0"
        age, hdop, pdop = ("", "99.9", "") if k == 2 else ("1.4", "0.6", f"{1 + k / 100:.2f}")
        lines += [
            sentence(f"GNRMC,{clock},A,4634.2,N,00632.4,E,0.0,0.0,030718,,,A"),
            sentence(f"GNGGA,{clock},4634.2,N,00632.4,E,4,{10 + k},{hdop},580.5,M,49.5,M,{age},74"),
            sentence(f"GNGSA,A,3,01,02,03,,,,,,,,,,{pdop},0.6,1.5"),
        ]
        if k != 1:
            lines.append(sentence(f"GNGST,{clock},2.21,0.01,0.01,49.4,0.010,0.011,0.026"))
    got = read_gnss(written(tmp_path / "x.nmea", lines))
    assert len(got) == 100
    assert_array_equal(got[:3].satellites, [10, 12, 13])
    assert_array_equal(got[:3].hdop, [0.6, np.nan, 0.6])
    assert_array_equal(got[:3].pdop, [1.0, np.nan, 1.03])
    assert_array_equal(got[:3].age_s, [1.4, np.nan, 1.4])
    assert got.ratio is None


def test_of_a_text_table(tmp_path: Path) -> None:
    """Oracle: the columns of the header; text, a second column of a name and differences between
    double rows refuse nothing.
    """
    lines = ["tow,lat,lon,h,sd_n,sd_e,sd_u,Num Sats,ns,Ratio,PDOP[-],age"]
    lines += [
        f"{1 + 0.1 * k:.1f},46.5,6.5,600,0.01,0.01,0.02,{9 + k},3,2.5,1.8,n/a" for k in range(5)
    ]
    lines.append("1.4,46.5,6.5,600,0.01,0.01,0.02,11,3,2.5,1.8,n/a")
    got = read_gnss(written(tmp_path / "x.csv", lines))
    assert_array_equal(got.satellites, np.arange(9.0, 14.0))
    assert_array_equal(got.pdop, np.full(5, 1.8))
    assert_array_equal(got.ratio, np.full(5, 2.5))
    assert got.age_s is None
    names = {"tow": "tow", "lat": "lat", "lon": "lon", "h": "h", "satellites": "ns"}
    named = read_gnss(tmp_path / "x.csv", columns=names, sigma_m=[1, 1, 1])
    assert_array_equal(named.satellites, np.full(5, 3.0))


def test_of_arrays(tmp_path: Path) -> None:
    """Oracle: the arrays saved; not-a-number of what weighs nothing is no reason to refuse."""
    n = 6
    arrays = {"t": np.arange(n) + 1.0, "ns": np.arange(n) + 5.0, "dop": np.full(n, np.nan)}
    arrays |= {"lat": np.linspace(46.5, 46.6, n), "lon": np.full(n, 6.5), "h": np.full(n, 500.0)}
    np.savez(tmp_path / "x.npz", **arrays)
    columns = {"tow": "t", "lat": "lat", "lon": "lon", "h": "h", "satellites": "ns", "pdop": "dop"}
    got = read_gnss(tmp_path / "x.npz", columns=columns, sigma_m=[1, 1, 1])
    assert_array_equal(got.satellites, arrays["ns"])
    assert got.pdop is None


def test_the_record_wants_a_value_for_each_fix() -> None:
    """Oracle: the shape (n,)."""
    one = np.ones(2)
    with pytest.raises(InputError, match=r"GnssFixes.satellites: shape \(3,\)"):
        GnssFixes(
            np.arange(2.0), one, one, one, np.tile(np.eye(3), (2, 1, 1)), satellites=np.ones(3)
        )
