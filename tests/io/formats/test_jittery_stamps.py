"""Stamps of an even sensor that the logger delays, repeats or bunches, with samples lost."""

import numpy as np
import pytest

from insgnss.base.errors import InputError
from insgnss.io.formats import read_imu
from insgnss.io.formats.text.stamps import without_jitter, without_repetitions

N = 12000
CLEAN = 200000.0 + 0.01 * np.arange(N)
RNG = np.random.default_rng(7)
HANDED_OVER = {
    "normal": CLEAN + RNG.normal(0.0, 3e-3, N),
    "uniform": CLEAN + RNG.uniform(-6e-3, 6e-3, N),
    "late": CLEAN + RNG.exponential(4e-3, N),
    "milliseconds": np.round(CLEAN + RNG.normal(0.0, 3e-3, N), 3),
    "an interval": CLEAN + RNG.normal(0.0, 1e-2, N),
    "bunches of 4": np.repeat(CLEAN[3::4], 4),
    "bunches of 10": np.repeat(CLEAN[9::10], 10),
    "late bunches": np.repeat(CLEAN[9::10] + RNG.normal(0.0, 3e-3, N // 10), 10),
    "slow bus": np.repeat(CLEAN[9::10], 10) + np.tile(3e-4 * np.arange(10), N // 10),
    "a fifth doubled": np.where(np.arange(N) % 5 == 1, np.roll(CLEAN, 1), CLEAN),
    "coarse clock": np.floor((CLEAN - 200000.0) / 1.2 / 0.01) * 0.01 + 200000.0,
}


@pytest.mark.parametrize("kind", HANDED_OVER)
def test_every_sample_is_kept_and_spread(kind):
    """Oracle: the instants before the logger delayed their stamps, but for its mean delay."""
    time, repeat_notes = without_repetitions(HANDED_OVER[kind])
    spread, notes = without_jitter(time)
    clean = (CLEAN - CLEAN[0]) / 1.2 if kind == "coarse clock" else CLEAN
    assert np.std(spread - clean) < 0.4e-3
    assert spread.size == N
    assert np.abs(np.diff(spread) - np.median(np.diff(spread))).max() < 0.4e-3
    assert repeat_notes or notes


@pytest.mark.parametrize("lost", [1, 3, 20, 400])
def test_lost_samples_stay_a_gap(lost):
    """Oracle: the instants of the samples that are left, between the gaps, and their number."""
    kept = np.ones(N, dtype=bool)
    kept[5000 : 5000 + lost] = False
    time, clean = HANDED_OVER["normal"][kept], CLEAN[kept]
    spread, _ = without_jitter(time)
    assert np.flatnonzero(np.diff(spread) > 0.015).size == 1
    far = np.abs(np.arange(clean.size) - 5000) > 60  # where a single one lacks, jitter hides it
    np.testing.assert_allclose(spread[far], clean[far], atol=0.6e-3)


def test_uneven_sensors_and_two_sensors_in_one_file_stay():
    """Oracle: the stamps as they are: intervals that vary, samples lost one by one, single rows
    out of order, and rows that share every stamp.
    """
    late = CLEAN.copy()
    late[1000::100] += 0.055
    for stamps in (
        200000.0 + np.cumsum(RNG.uniform(0.004, 0.018, N)),
        200000.0 + np.cumsum(RNG.choice([0.01, 0.02], N)),
        np.delete(CLEAN, RNG.integers(1, N, 300)),
        CLEAN[np.argsort(late, kind="stable")],
        np.append(CLEAN, CLEAN[-1]),
        np.insert(CLEAN, 0, CLEAN[0]),
        np.repeat(CLEAN, 2),
        np.repeat(CLEAN, 3),
        np.concatenate([CLEAN, CLEAN]),
    ):
        spread, notes = without_jitter(without_repetitions(stamps)[0])
        assert spread is stamps
        assert notes == ()


def test_a_file_with_jitter_is_read_in_the_order_of_its_lines(tmp_path):
    """Oracle: the rows as they were written; of two sensors a file is refused."""
    values = RNG.normal(size=(2000, 6))
    path = tmp_path / "imu.csv"
    for stamps in (HANDED_OVER["normal"][:2000], HANDED_OVER["bunches of 10"][:2000]):
        table = np.column_stack([stamps, values])
        np.savetxt(path, table, fmt=["%.4f", *["%.6f"] * 6])
        imu = read_imu(path)
        np.testing.assert_allclose(imu.accel, values[:, 3:], atol=1e-6)
        assert [note.name for note in imu.notes] == ["IMU rows"]
    table[:, 0] = np.repeat(CLEAN[:1000], 2)
    np.savetxt(path, table, fmt=["%.4f", *["%.6f"] * 6])
    with pytest.raises(InputError, match="keep one row for each time"):
        read_imu(path)
