"""Products do not depend on how any one stream of a flight writes its stamps."""

from pathlib import Path

import numpy as np
import pytest

import insgnss
from insgnss.base.errors import InputError
from insgnss.geodesy.gpstime import GPS_EPOCH_UNIX_S, WEEK_S
from insgnss.geodesy.rotation import rpy_from_rotation

START = 205200.0
UNIX = GPS_EPOCH_UNIX_S + 2008 * WEEK_S - 18.0
WRAP = 2.0**32 * 1e-6 - 20.0 - START  # begins anew 20 s after the start
BOOT = 205190.0
STEP = 3.7  # s by which a clock is set, 25 s after the start
FORMATS = {
    "imu": ("tow,gx,gy,gz,ax,ay,az", "%.9f"),
    "gnss": ("tow,lat,lon,h,sd_n,sd_e,sd_u", "%.10f"),
    "camera": ("", ""),
    "barometer": ("tow,h", "%.4f"),
    "measurement": ("tow,heading", "%.4f"),
    "odometer": ("tow,forward", "%.5f"),
}
PLAIN = (lambda t: t, "%.7f", "")
UNITS = 'units = {{ time = "{}" }}\n'
# stamps of GPST t, how they are written, and the keys that say so
CLOCKS = {
    "Unix": (lambda t: t + UNIX, "%.6f", UNITS.format("unix")),
    "Unix, ms": (lambda t: 1e3 * (t + UNIX), "%.3f", UNITS.format("unix_ms")),
    "GPST, ms": (lambda t: 1e3 * t, "%.4f", UNITS.format("ms")),
    "micros() that begins anew": (
        lambda t: 1e6 * (t + WRAP) % 2**32,
        "%.0f",
        f"{UNITS.format('us')}time_offset_s = {-WRAP!r}\n",
    ),
    "UTC": (lambda t: t - 18.0, "%.7f", "time_offset_s = 18.0\n"),
    "since power-up": (lambda t: t - BOOT, "%.7f", f"time_offset_s = {BOOT}\n"),
    "set back": (lambda t: t + STEP * (t < START + 25.004), "%.7f", ""),
    "set ahead": (lambda t: t - STEP * (t < START + 25.004), "%.7f", ""),
    "1970 first": (
        lambda t: np.where(t < START + 3.0, t - START, t + UNIX),
        "%.6f",
        UNITS.format("unix"),
    ),
    "stamps repeated": (
        lambda t: np.where(np.arange(t.size) % 5 == 3, np.roll(t, 1), t),
        "%.7f",
        "",
    ),
}
RATE = 1.08  # of a clock that runs 8 % fast, which counts from START
TICK = 1e-4  # s, of a counter
CLOCKS |= {
    "8 % fast": (
        lambda t: RATE * (t - START),
        "%.7f",
        f"{UNITS.format(f'{1.0 / RATE!r} s')}time_offset_s = {START!r}\n",
    ),
    "ticks": (
        lambda t: np.round((t - BOOT) / TICK),
        "%.0f",
        f"{UNITS.format(f'{TICK!r} s')}time_offset_s = {BOOT!r}\n",
    ),
    "50 ppm fast": (lambda t: t + 5e-5 * (t - START - 42.0), "%.7f", ""),
    "50 ppm slow": (lambda t: t - 5e-5 * (t - START - 42.0), "%.7f", ""),
}
# of the sigma of positions, and s, by which stamps that are rounded or drift may move products
MOVED = {"ticks": (1.0, TICK), "50 ppm fast": (1.0, 2.5e-3), "50 ppm slow": (1.0, 2.5e-3)}
MOVED["1970 first"] = (1.0, 1e-6)  # fixes without a date are left out
DRIFTS = ("50 ppm fast", "50 ppm slow")
# the intervals of exposures show no step of a clock, which is asked about, and no drift; of another
# stream that shows no motion a step ahead is a pause (the IMU's is told beside the fixes)
NOT_OF = {
    **dict.fromkeys(("barometer", "measurement", "odometer"), ("set ahead",)),
    "imu": ("set ahead", *DRIFTS),
    "gnss": DRIFTS,
    "camera": ("set back", "set ahead", "1970 first", "stamps repeated", *DRIFTS),
}


class Flown:
    """A flight of 80 s with barometer, heading sensor and odometer, written with any stamps."""

    def __init__(self, root: Path) -> None:
        self.root = root
        sim = insgnss.simulate(
            "ign8", 1.4, directory=root / "sim", imu_rate_hz=50.0, seed=5, start_in_air=True
        ).simulated
        path, draw = sim.truth.trajectory[3:-3:5], np.random.default_rng(1)
        lla = np.degrees([sim.gnss.lat, sim.gnss.lon])
        sigma = np.sqrt(np.diagonal(sim.gnss.cov_ned, axis1=1, axis2=2))
        baro = path.height + 37.0 + draw.normal(0.0, 0.3, len(path))
        heading = np.degrees(rpy_from_rotation(path.C_nb)[:, 2])
        forward = np.einsum("nji,nj->ni", path.C_nb, path.velocity_ned)[:, 0]
        self.names, self.sim = sim.events.images, sim
        self.tables = {
            "imu": np.column_stack([sim.imu.time, sim.imu.gyro, sim.imu.accel]),
            "gnss": np.column_stack([sim.gnss.time, *lla, sim.gnss.height, sigma]),
            "camera": sim.events.time[:, None],
            "barometer": np.column_stack([path.time, baro]),
            "measurement": np.column_stack([path.time, heading + draw.normal(0, 0.2, len(path))]),
            "odometer": np.column_stack([path.time, forward + draw.normal(0, 0.1, len(path))]),
        }
        toml = (root / "sim" / "flight.toml").read_text()
        self.mounting = toml[toml.index("[mounting]") : toml.index("[output]")]

    def process(self, stream="", clock=PLAIN, more="", top=""):
        """The result of the flight with the stamps of one stream of a clock, and further keys."""
        keys = dict.fromkeys(FORMATS, "")
        for name, (header, form) in FORMATS.items():
            stamps, digits, of_stream = clock if name == stream else PLAIN
            keys[name] = of_stream
            table = self.tables[name].copy()
            table[:, 0] = stamps(table[:, 0])
            if name == "camera":
                rows = zip(self.names, table[:, 0], strict=True)
                text = "".join(f"{image} {digits % t}\n" for image, t in rows)
                (self.root / "camera.txt").write_text("# image tow[s]\n" + text)
                continue
            forms = [digits, *[form] * (table.shape[1] - 1)]
            file = self.root / f"{name}.csv"
            np.savetxt(file, table, forms, ",", header=header, comments="")
        (self.root / "flight.toml").write_text(
            f'name = "any"\ngps_week = 2008\n{top}[imu]\nfile = "imu.csv"\nquantity = "mean_rate"\n'
            f'axes = "forward right down"\nnoise = "navchip"\n{keys["imu"]}'
            f'[gnss]\nfile = "gnss.csv"\n{keys["gnss"]}'
            f'[camera]\nevents = "camera.txt"\n{keys["camera"]}'
            f'[barometer]\nfile = "barometer.csv"\n{keys["barometer"]}'
            f'[[measurement]]\nkind = "heading"\nfile = "measurement.csv"\nsigma = 0.2\n'
            f"{keys['measurement']}"
            f'[[measurement]]\nkind = "body_velocity"\nfile = "odometer.csv"\nsigma = 0.1\n'
            f"{keys['odometer']}{self.mounting}{more}"
        )
        return insgnss.process(self.root / "flight.toml", write=False)


@pytest.fixture(scope="module")
def flown(tmp_path_factory):
    flown = Flown(tmp_path_factory.mktemp("any"))
    return flown, flown.process()


def cases():
    """Pairs of a stream and a clock whose stamps come back."""
    return [
        (stream, clock)
        for stream in FORMATS
        for clock in CLOCKS
        if clock not in NOT_OF.get(stream, ())
    ]


@pytest.mark.slow
@pytest.mark.parametrize(("stream", "clock"), cases())
def test_stamps_of_any_clock_leave_products_as_they_are(flown, stream, clock):
    """Oracle: the flight of streams that all count GPST: times to a microsecond, positions to a
    thousandth of their sigma, and of clocks that are rounded or drift as `MOVED` says.
    """
    flight, right = flown
    result = flight.process(stream, CLOCKS[clock])
    assert result.eo.images == right.eo.images
    sigma = np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, :3]
    share, within_s = MOVED.get(clock, (1e-3, 1e-6))
    if stream == "camera":  # a microsecond, to which stamps are written, is 15 um of the path
        share = max(share, 1e-2)
    assert (np.abs(result.eo.position_m - right.eo.position_m) < share * sigma).all()
    assert result.trajectory.gps_week == right.trajectory.gps_week == 2008
    np.testing.assert_allclose(result.eo.time, right.eo.time, rtol=0, atol=within_s)
    at = np.searchsorted(right.trajectory.time, result.trajectory.time - 5e-3)
    time = right.trajectory.time[at]
    np.testing.assert_allclose(result.trajectory.time, time, rtol=0, atol=within_s)
    apart = np.abs(result.trajectory.height - right.trajectory.height[at])
    assert (apart < share * np.sqrt(result.trajectory.cov[:, 2, 2])).all()


@pytest.mark.slow
@pytest.mark.parametrize("clock", DRIFTS)
def test_fixes_whose_clock_drifts_stay_within_what_is_allowed_for(flown, clock):
    """Oracle: the flight of streams that all count GPST; 50 ppm are 2 ms and 30 mm at its ends."""
    flight, right = flown
    result = flight.process("gnss", CLOCKS[clock])
    sigma = np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, :3]
    assert (np.abs(result.eo.position_m - right.eo.position_m) < 3.0 * sigma).all()
    np.testing.assert_allclose(result.eo.time, right.eo.time, rtol=0, atol=1e-6)


@pytest.mark.slow
def test_exposures_of_a_clock_that_was_set_ahead_are_asked_about(flown):
    """Oracle: the step, of which nothing else in the data speaks."""
    result = flown[0].process("camera", CLOCKS["set ahead"])
    (check,) = [one for one in result.checks if one.name == "exposure clock"]
    assert check.verdict == "note"
    assert float(check.found.rpartition("lack ")[2].split()[0]) == pytest.approx(STEP, abs=0.05)
    accepted = flown[0].process("camera", CLOCKS["set ahead"], "", 'accept = ["exposure clock"]\n')
    assert all(one.name != "exposure clock" for one in accepted.checks)


@pytest.mark.slow
def test_a_count_of_ticks_is_told_what_it_lacks(flown):
    """Oracle: by hand; whole numbers beyond a week."""
    ticks = (lambda t: np.round((t - BOOT) / TICK) + 123456789, "%.0f", "")
    with pytest.raises(
        InputError, match=r'camera.txt:2: .*of a counter, units = \{ time = "1e-4 s"'
    ):
        flown[0].process("camera", ticks)


@pytest.mark.slow
@pytest.mark.parametrize("late_s", [0.03, -0.05])
def test_a_latency_that_nobody_stated_is_named_and_estimated(flown, late_s):
    """Oracle: the flight without it; the images stay within their sigmas."""
    flight, right = flown
    late = (lambda t: t + late_s, "%.7f", "")
    with pytest.raises(InputError, match=r"GNSS time offset.*filter\.time_offset = true"):
        flight.process("gnss", late)
    result = flight.process("gnss", late, "[filter]\ntime_offset = true\n")
    sigma = np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, :3]
    assert (np.abs(result.eo.position_m - right.eo.position_m) < 3.0 * sigma).all()


@pytest.mark.slow
def test_events_of_a_clock_that_was_set_back_are_refused_by_line(flown):
    """Oracle: by hand; the intervals of exposures show no step, the first fall does."""
    with pytest.raises(InputError, match=r"camera.txt:10: .*add 3\.7.* if the clock was set"):
        flown[0].process("camera", CLOCKS["set back"])


@pytest.mark.slow
@pytest.mark.parametrize("rate", [5e-5, -5e-5])
def test_an_imu_whose_quartz_drifts_leaves_the_images_where_they_are(flown, rate):
    """Oracle: the flight of streams that all count GPST; 50 ppm are 2 ms at its ends."""
    flight, right = flown
    middle = START + 42.0
    result = flight.process("imu", (lambda t: t + rate * (t - middle), "%.7f", ""))
    assert result.eo.images == right.eo.images
    sigma = np.sqrt(np.diagonal(result.eo.cov, axis1=1, axis2=2))[:, :3]
    assert (np.abs(result.eo.position_m - right.eo.position_m) < sigma).all()
    np.testing.assert_allclose(result.eo.time, right.eo.time, rtol=0, atol=1e-6)
