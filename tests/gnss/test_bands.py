"""Which bands the engine takes: its own table, and what it makes of a file."""

from importlib.util import find_spec
from types import SimpleNamespace

import numpy as np
import pytest

from insgnss.gnss.engine.preflight import satellites_with_phases
from insgnss.gnss.options import EngineOptions
from insgnss.gnss.satellites.frequencies import (
    CHANNEL_HERTZ,
    ENGINE_BANDS,
    HERTZ,
    engine_phases,
    kappa,
)


def test_the_table_is_the_engines():
    """Oracle: RTKLIB's code2idx and code2freq for every code that it knows; a place beyond the
    third is not taken.
    """
    if find_spec("pyrtklib5") is None:
        pytest.skip("pyrtklib5 is not installed")
    import pyrtklib5 as rtklib

    codes = {name[6:]: getattr(rtklib, name) for name in dir(rtklib) if name.startswith("CODE_L")}
    systems = {
        "G": rtklib.SYS_GPS,
        "R": rtklib.SYS_GLO,
        "E": rtklib.SYS_GAL,
        "J": rtklib.SYS_QZS,
        "C": rtklib.SYS_CMP,
    }
    for letter, system in systems.items():
        taken = ["", "", ""]
        for band in HERTZ[letter]:
            code = next(
                number
                for name, number in codes.items()
                if name[0] == band and rtklib.code2freq(system, number, 0) > 0.0
            )
            assert rtklib.code2freq(system, code, 0) == pytest.approx(HERTZ[letter][band], abs=1.0)
            if (place := rtklib.code2idx(system, code)) < rtklib.NFREQ:
                taken[place] += band
        assert tuple("".join(sorted(bands)) for bands in taken) == ENGINE_BANDS[letter]


def one_epoch(signals, satellites):
    """Observations of one epoch: by satellite the phases that it has."""
    values = np.array(
        [
            [1e8 if name in has.split() else np.nan for name in signals]
            for has in satellites.values()
        ]
    )
    return SimpleNamespace(satellite=np.array(list(satellites)), signals=signals, values=values)


SATELLITES = {
    "G01": "L1C L2W",
    "G02": "L1C L5Q",
    "E01": "L1C L5Q",
    "E02": "L1C L7Q",
    "C01": "L2I L6I",
    "C02": "L2I L7I",
    "C03": "L1P L5P",
    "R01": "L1C L2P",
    "R02": "L4A L6A",
    "I01": "L5A L9A",
    "S20": "L1C L5I",
}


@pytest.mark.parametrize(
    ("frequencies", "with_phases"),
    [
        (1, "G01 G02 E01 E02 C01 C02 R01 R02"),
        (2, "G01 E02 C02 R01 R02"),
        (3, "G01 G02 E01 E02 C02 R01 R02"),
    ],
)
def test_satellites_of_which_the_engine_has_bands(frequencies, with_phases):
    """Oracle: the table, worked out by hand: E5a and L5 are third, B3 and B1C of BeiDou none; SBAS
    and NavIC are not asked for.
    """
    signals = tuple(sorted({name for has in SATELLITES.values() for name in has.split()}))
    observed = one_epoch(signals, SATELLITES)
    rows = satellites_with_phases(observed, EngineOptions(frequencies=frequencies))
    assert " ".join(observed.satellite[rows].tolist()) == with_phases
    only = satellites_with_phases(observed, EngineOptions(frequencies=frequencies, systems="R"))
    assert observed.satellite[only].tolist() == ["R01", "R02"]


def test_a_phase_of_zero_is_none():
    """Oracle: RINEX, where a blank or 0.0 stands for a missing observation."""
    observed = one_epoch(("L1C", "L2W"), {"G01": "L1C L2W"})
    observed.values[0, 1] = 0.0
    assert engine_phases(observed, 3).tolist() == [[True, False, False]]


def test_kappa():
    """Oracle: the ratio of whole numbers that GPS's carriers are of: 154, 120 and 115 times 10.23
    MHz.
    """
    assert [kappa("G", band) for band in "125"] == pytest.approx(
        [1.0, (154 / 120) ** 2, (154 / 115) ** 2], rel=1e-12
    )
    assert kappa("R", "2") / kappa("R", "1") == pytest.approx((9 / 7) ** 2, rel=1e-12)


def test_carriers_are_multiples_of_the_fundamental_frequency() -> None:
    """Oracle: interface documents: 10.23 MHz times 154, 120, 115 and so on; FDMA of GLONASS by
    nine sixteenths and seven sixteenths of a megahertz a channel.
    """
    times = {
        "G": {"1": 154, "2": 120, "5": 115},
        "J": {"1": 154, "2": 120, "5": 115, "6": 125},
        "E": {"1": 154, "5": 115, "6": 125, "7": 118, "8": 116.5},
        "C": {"1": 154, "2": 152.6, "5": 115, "6": 124, "7": 118, "8": 116.5},
        "R": {"3": 117.5, "4": 156.5, "6": 122},
    }
    carriers = {s: dict(bands) for s, bands in HERTZ.items()}
    assert (carriers["R"].pop("1"), carriers["R"].pop("2")) == (1602.0e6, 1246.0e6)
    assert CHANNEL_HERTZ == {"1": 9e6 / 16, "2": 7e6 / 16}
    for system, bands in times.items():
        assert carriers[system] == {b: pytest.approx(n * 10.23e6) for b, n in bands.items()}
    assert carriers.keys() == times.keys()
    assert kappa("E", "5") == pytest.approx((154 / 115) ** 2)
