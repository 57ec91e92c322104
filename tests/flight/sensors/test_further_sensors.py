"""Tables [[measurement]]: every shipped kind on simulated flights, and what is refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from shipped_sensors import EXPECTED, STATION, written

import insgnss
from insgnss.base.errors import InputError, UsageError
from insgnss.flight.sensors.kinds import read_measurement
from insgnss.flight.sensors.options import SHIPPED, MeasurementInput
from insgnss.flight.sensors.trials import trial_sensors
from insgnss.geodesy.frames import LocalFrame


@pytest.fixture(scope="module")
def dataset(tmp_path_factory):
    root = tmp_path_factory.mktemp("sensors") / "ign8"
    sim = insgnss.simulate("ign8", 1.0, directory=root, imu_rate_hz=50.0, seed=5, start_in_air=True)
    return root, sim.simulated


@pytest.mark.slow
@pytest.mark.parametrize("kind", SHIPPED)
def test_a_kind_finds_what_is_unknown_of_its_sensor(dataset, kind):
    """Oracle: the rotation and the scale factor that were put in, to four sigmas; scatter of the
    values and of the heading's error as their sigmas say.
    """
    root, sim = dataset
    result = insgnss.process(written(root, sim, kind), write=False)
    found = [e for e in result.states if e.state.group == kind]
    values, sigmas = (np.array([getattr(e, n) for e in found]) for n in ("value", "sigma"))
    assert (np.abs(values - EXPECTED[kind]) < 4.0 * sigmas).all()
    check = next(c for c in result.checks if c.name == "measurements")
    assert f"{kind}: 0 of " in check.found
    assert 0.85 < float(check.found.split("scatter ")[1].split()[0]) < 1.15
    truth = sim.truth.trajectory.at(result.trajectory.time[100:101])
    turn = result.trajectory.C_nb[100] @ truth.C_nb[0].T
    assert abs(turn[1, 0]) < 4.0 * np.sqrt(result.trajectory.cov[100, 8, 8])


@pytest.mark.slow
def test_a_wrong_sign_is_a_contradiction(dataset):
    """Oracle: the headings turned round: most values are rejected, and the run stops."""
    root, sim = dataset
    file = written(root, sim, "heading")
    table = np.loadtxt(root / "heading.csv", delimiter=",", skiprows=1)
    table[:, 1] += 180.0
    np.savetxt(root / "heading.csv", table, "%.9f", ",", header="tow,heading", comments="")
    with pytest.raises(InputError, match="measurements"):
        insgnss.process(file, write=False)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "more", "said"),
    [
        (
            "heading",
            {"offset_sigma_deg": 0.0},
            r"heading.* offset (of|at) 1\.[3-7].* deg .*stated 0",
        ),
        ("body_velocity", {"scale_sigma": 0.0}, r"scale factor (of|at) 0\.01[3-7]"),
        (
            "position",
            {"station": [STATION[0] - 5e-6, *STATION[1:]]},
            r"station north is 0\.5.* m by this flight, but 0 \+- 0\.02",
        ),
    ],
)
def test_a_constant_that_is_stated_wrong_is_named(dataset, kind, more, said):
    """Oracle: an antenna turned by 1.5 deg, a wheel 1.5 % larger than stated as exact, a station
    that stands 0.56 m further north: the run stops and gives the constant that the flight has; the
    default sigmas cover the first two.
    """
    with pytest.raises(InputError, match=said):
        insgnss.process(written(*dataset, kind, **more), write=False)


@pytest.mark.slow
def test_values_that_scatter_more_than_stated_are_a_note(dataset):
    """Oracle: values of 0.2 deg stated as 0.1: the note gives a factor near two."""
    root, sim = dataset
    file = written(root, sim, "heading")
    file.write_text(file.read_text().replace("sigma = 0.2", "sigma = 0.1"))
    result = insgnss.process(file, write=False)
    check = next(c for c in result.checks if c.name == "measurements")
    assert check.verdict == "note"
    assert 1.6 < float(check.found.split("scatter ")[1].split()[0]) < 2.3


def options(tmp_path: Path, text: str, **more) -> MeasurementInput:
    file = tmp_path / "x.csv"
    file.write_text(text)
    return MeasurementInput(**({"kind": "heading", "file": file} | more))


def test_rows_are_read_with_units_weeks_and_offsets(tmp_path):
    """Oracle: by hand: a week later is 604800 s more, an offset is added, rad stay rad."""
    read, _ = read_measurement(
        options(
            tmp_path,
            "week,tow,heading_rad,sd_heading\n2001,10.0,3.1,0.01\n2001,11.0,-3.1,0.02\n",
            time_offset_s=0.5,
        ),
        2000,
    )
    np.testing.assert_allclose(read.time, [604810.5, 604811.5])
    np.testing.assert_allclose(read.values[:, 0], [3.1, -3.1])
    np.testing.assert_allclose(read.cov[:, 0, 0], [1e-4, 4e-4])
    assert read.name == "heading"
    assert [state.unit for state in read.states] == ["rad"]


def sentence(body: str) -> str:
    """With its checksum, after the definition."""
    check = 0
    for letter in body:
        check ^= ord(letter)
    return f"${body}*{check:02X}\n"


def test_headings_of_a_receivers_log(tmp_path):
    """Oracle: by hand: the time of the GGA before; 07:31:13.4 UTC of 2018-07-03, a Tuesday, is
    199891.4 s of week 2008; what is marked V is none; a standard deviation is asked for.
    """
    gga = "GNGGA,0731{},4634.20000000,N,00632.40000000,E,4,34,0.6,580.5000,M,49.5000,M,1.4,74"
    text = sentence(gga.format("13.40"))
    text += sentence("GNRMC,073113.40,A,4634.2,N,00632.4,E,0.012,325.9,030718,,,A")
    text += sentence("GNHDT,253.21,T") + sentence(gga.format("13.60"))
    text += sentence("GNTHS,253.3,V") + sentence(gga.format("13.80")) + sentence("GNTHS,253.5,A")
    read, _ = read_measurement(options(tmp_path, text, sigma=0.3), 2008)
    np.testing.assert_allclose(read.time, [199891.4, 199891.8])
    np.testing.assert_allclose(np.degrees(read.values[:, 0]), [253.21, 253.5])
    np.testing.assert_allclose(np.degrees(np.sqrt(read.cov[:, 0, 0])), 0.3)
    for more, said in (
        ({}, "give measurement.sigma"),
        ({"columns": ("tow",)}, "columns: belongs to "),
    ):
        with pytest.raises((InputError, UsageError), match=said):
            read_measurement(options(tmp_path, text, **more), 2008)
    with pytest.raises(InputError, match="no HDT or THS sentence"):
        read_measurement(options(tmp_path, text[: text.index("$GNHDT")]), 2008)


def oem(content: str, corrupt: int = 0) -> str:
    """A log with its CRC-32, bit by bit as NovAtel's manual has it."""
    crc = 0
    for letter in content.encode():
        crc ^= letter
        for _ in range(8):
            crc = (crc >> 1) ^ (0xEDB88320 if crc & 1 else 0)
    return f"#{content}*{crc ^ corrupt:08x}\r\n"


BODY = 'NARROW_INT,1.02,{},-0.5,0.0,0.31,0.42,"999",27,21,21,15,3,01,3,f3'
OEM = "HEADING2A,COM1,0,39.5,FINESTEERING,2008,{},02040000,f9bf,6521;{}," + BODY
UNI = "UNIHEADINGA,78,GPS,FINE,2008,{},0,0,18,11;{}," + BODY


def test_headings_of_novatel_and_unicore(tmp_path):
    """Oracle: by hand: seconds and milliseconds of the week, columns of the manuals; what is not
    computed is left out with a note; a wrong checksum is refused with its line.
    """
    rows = [(604799.9, "SOL_COMPUTED", 253.21), (604799.95, "INSUFFICIENT_OBS", 0.0)]
    text = "".join(oem(OEM.format(*row)) for row in rows)
    text += oem(OEM.format(0.1, "SOL_COMPUTED", 1.5).replace(",2008,", ",2009,"))
    read, notes = read_measurement(options(tmp_path, text), 2008)
    np.testing.assert_allclose(read.time, [604799.9, 604800.1])
    np.testing.assert_allclose(np.degrees(read.values[:, 0]), [253.21, 1.5])
    np.testing.assert_allclose(np.degrees(np.sqrt(read.cov[:, 0, 0])), 0.31)
    assert "1 without solution" in notes[0].found
    read, _ = read_measurement(
        options(tmp_path, oem(UNI.format(375570200, "SOL_COMPUTED", 7.0))), 2008
    )
    np.testing.assert_allclose(read.time, [375570.2])
    for bad, message in (
        (text + oem(OEM.format(3, "SOL_COMPUTED", 4), corrupt=1), "x.csv:4: no right checksum in"),
        (oem(OEM.format(3, "COLD_START", 4)), "no heading with a solution; let the receiver"),
        (oem(OEM.format(3, "SOL_COMPUTED", 4).replace("0.31", "0")), "x.csv:1: standard deviation"),
    ):
        with pytest.raises(InputError, match=message):
            read_measurement(options(tmp_path, bad), 2008)


def test_attitudes_of_septentrio(tmp_path):
    """Oracle: by hand: the columns of sbf2asc's source; weeks of 604800 s; what is float, in error
    or -2e10 is left out; two antennas give no roll, three do.
    """
    begin = 2008 * 604800 + 200010

    def lines(after_s: float, heading: float, error: int = 0, mode: int = 2) -> str:
        time = f"{begin + after_s:13.2f}"
        att = f"-4 {time} {heading:14.5f}       -0.50000        0.70000 {error:3d} {mode:3d}   9"
        cov = f"-5 {time}        0.04000        0.09000        0.01000   0"
        return f"{att} 0 0 0 0 0 0\n{cov} 0 0 0 0 0 0 0 0\n"

    other = f"-1 {begin:13.2f} 0.8 0.11 580.0 49.5 0 0 0 0 0 9 4 0 0 12.0\n"
    text = other + lines(0.0, 253.21) + lines(0.1, 253.3, mode=1) + lines(0.2, 253.4, error=1)
    text += lines(0.3, -2e10) + lines(0.4, 253.5)
    read, notes = read_measurement(options(tmp_path, text), 2008)
    np.testing.assert_allclose(read.time, [200010.0, 200010.4])
    np.testing.assert_allclose(np.degrees(read.values[:, 0]), [253.21, 253.5])
    np.testing.assert_allclose(np.degrees(np.sqrt(read.cov[:, 0, 0])), 0.2)
    assert "left out 3 of 5 attitudes" in notes[0].found
    with pytest.raises(InputError, match="two antennas give no roll, take kind heading"):
        read_measurement(options(tmp_path, text, kind="attitude"), 2008)
    three = lines(0.0, 253.21, mode=4) + lines(0.1, 253.3, mode=4)
    read, _ = read_measurement(options(tmp_path, three, kind="attitude"), 2008)
    np.testing.assert_allclose(np.degrees(read.values[0]), [0.7, -0.5, 253.21])
    np.testing.assert_allclose(np.degrees(np.sqrt(np.diagonal(read.cov[0]))), [0.1, 0.3, 0.2])
    without = "".join(row for row in text.splitlines(True) if not row.startswith("-5"))
    with pytest.raises(InputError, match="no standard deviations; give meas"):
        read_measurement(options(tmp_path, without), 2008)
    assert len(read_measurement(options(tmp_path, without, sigma=0.2), 2008)[0].time) == 2
    with pytest.raises(InputError, match=r"x.csv:12: 5 fields, expected 14"):
        read_measurement(options(tmp_path, text + f"-4 {begin}.00 253.1 0 0"), 2008)


def test_a_table_of_septentrio_is_read_by_its_header(tmp_path):
    """Oracle: by hand: milliseconds, weeks, degree signs; -2e10 is no value and is left out."""
    text = "TOW [0.001 s],WNc [w],NrSV,Error,Mode,Heading [°],Pitch [°],Roll [°]\n"
    for tow, heading in ((200010000, 253.2), (200010100, -2e10), (200010200, 253.3)):
        text += f"{tow},2008,9,0,2,{heading},-0.5,0\n"
    read, notes = read_measurement(options(tmp_path, text, sigma=0.2), 2007)
    np.testing.assert_allclose(read.time, [804810.0, 804810.2])
    np.testing.assert_allclose(np.degrees(read.values[:, 0]), [253.2, 253.3])
    assert "left out 1 rows with -2e10" in notes[-1].found


def test_baselines_of_a_moving_base(tmp_path):
    """Oracle: by hand: east, north, up as north, east, down; float rows are left out with a note;
    a `.pos` of positions is refused.
    """
    head = "%  GPST  e-baseline(m)  n-baseline(m)  u-baseline(m)   Q  ns"
    head += "   sde(m)   sdn(m)   sdu(m)  sden(m)  sdnu(m)  sdue(m) age(s)  ratio\n"
    row = "2008 {}.000  0.3000  0.9000 -0.1000  {}  12  0.004 0.005 0.010 0 0 0 0.0 9.9\n"
    text = head + row.format(100, 1) + row.format(101, 2) + row.format(102, 1)
    more = {"kind": "baseline", "lever_m": (1.0, 0.2, 0.1)}
    read, notes = read_measurement(options(tmp_path, text, **more), 2008)
    np.testing.assert_allclose(read.time, [100.0, 102.0])
    np.testing.assert_allclose(read.values, [[0.9, 0.3, 0.1]] * 2)
    np.testing.assert_allclose(np.sqrt(np.diagonal(read.cov[0])), [0.005, 0.004, 0.01])
    assert "left out 1 of 3 baselines" in notes[0].found
    with pytest.raises(InputError, match="none of 1 baselines has fixed"):
        read_measurement(options(tmp_path, head + row.format(1, 5), **more), 2008)
    for name, other in (
        ("e-baseline", "latitude"),
        ("n-baseline", "longitude"),
        ("u-baseline", "height"),
    ):
        text = text.replace(f"{name}(m)", f"{other}(deg)")
    with pytest.raises(InputError, match="has positions, not vectors"):
        read_measurement(options(tmp_path, text, **more), 2008)


@pytest.mark.parametrize("units", [{"length": "cm", "time": "ms"}, None])
def test_a_relposned_of_u_blox_is_a_table(tmp_path, units):
    """Oracle: by hand: ms and cm, stated or in the header."""
    names = "iTOW,relPosN,relPosE,relPosD,accN,accE,accD"
    if units is None:
        names = names.replace(",", " [cm],").replace("W [cm]", "W [ms]") + " [cm]"
    text = f"{names}\n200010000,12.1,99.0,1.2,0.4,0.5,0.9\n200010100,12.2,99.0,1.2,0.4,0.5,0.9\n"
    more = {"kind": "baseline", "lever_m": (1.0, 0.0, 0.0), "units": units}
    read, _ = read_measurement(options(tmp_path, text, **more), 2008)
    np.testing.assert_allclose(read.time, [200010.0, 200010.1])
    np.testing.assert_allclose(read.values[0], [0.121, 0.99, 0.012])
    np.testing.assert_allclose(np.sqrt(np.diagonal(read.cov[0])), [0.004, 0.005, 0.009])


def test_an_odometer_has_a_scale_and_two_angles(tmp_path):
    """Oracle: by hand: an angle about the one axis that is measured does nothing; what is stated
    as exact can still be contradicted.
    """
    given = options(
        tmp_path, "tow,speed\n1.0,2.0\n2.0,2.1\n", kind="body_velocity", sigma=0.1, scale_sigma=0.0
    )
    states = read_measurement(given, 2000)[0].states
    assert [s.name for s in states] == ["scale factor", "offset right", "offset down"]
    assert [s.sigma for s in states] == pytest.approx([1e-4, *np.radians([2.0, 2.0])])


@pytest.mark.parametrize(
    ("kind", "text", "more", "said"),
    [
        ("heading", "tow,heading\n1,2\n2,3\n", {}, "no column sigma_heading; give measurement.sig"),
        ("heading", "tow,course\n1,2\n2,3\n", {"sigma": 1.0}, "does not name heading"),
        ("heading", "tow,heading,sd\n1,2,0.1\n2,3,0\n", {}, "x.csv:3: sigma_heading 0 deg"),
        ("body_velocity", "tow,speeds\n1,2\n2,3\n", {"sigma": 1.0}, "no column out of forward"),
        ("heading", "tow,heading\n1,2\n", {"scale_sigma": 0.1}, "scale_sigma: is not used by kind"),
        (
            "baseline",
            "tow,n,e,d\n1,2,3,4\n2,2,3,4\n",
            {"sigma": 0.1},
            r"lever_m: is missing; kind 'baseline'",
        ),
    ],
)
def test_a_file_that_cannot_be_is_refused(tmp_path, kind, text, more, said):
    """Oracle: the rule of each kind, by hand."""
    with pytest.raises((InputError, UsageError), match=said):
        read_measurement(options(tmp_path, text, kind=kind, **more), 2000)


def test_two_of_one_name_and_an_unknown_kind_are_refused(dataset):
    """Oracle: by hand: file and key are named."""
    root, sim = dataset
    file = written(root, sim, "heading")
    file.write_text(file.read_text() + '[[measurement]]\nkind = "heading"\nfile = "heading.csv"\n')
    with pytest.raises(InputError, match="two measurements are named 'heading'"):
        insgnss.load_flight(file)
    file.write_text(file.read_text().replace('kind = "heading"', 'kind = "headings"', 1))
    with pytest.raises(InputError, match=r"measurement.kind.*headings"):
        insgnss.load_flight(file)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("sigma", "late_s", "words"),
    [
        (0.05, 0.0, "rejected; the other values scatter 0.0"),  # degrees for radians
        (np.radians(0.05), 604800.0, "values lies within the flight, TOW 205200"),
        (np.radians(0.05), 0.0, "the state bias varies from "),
    ],
)
def test_mistakes_with_a_sensor_of_ones_own_are_told(sigma, late_s, words):
    """Oracle: what was planted: a sigma in another unit, times of another week, a walking bias."""
    sim = insgnss.simulate("ign8", 2.0, imu_rate_hz=50.0, seed=7, start_in_air=True)
    truth = sim.truth.trajectory[10:-10:10]
    noise = np.random.default_rng(1).standard_normal(len(truth))
    bias = np.radians(0.1 * np.sin(truth.time / 30.0) + 0.05 * noise)
    mine = insgnss.Measurement(
        "pitchmeter",
        truth.time + late_s,
        truth.rpy[:, 1] + bias,
        sigma,
        lambda motion, states: motion.roll_pitch_heading[:, 1:2] + states,
        (insgnss.OwnState("bias", np.radians(0.3), "rad", correlation_time_s=60.0),),
    )
    result = insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        mounting=sim.mounting,
        measurements=[mine],
        accept=["measurements"],
    )
    (check,) = [check for check in result.checks if check.name == "measurements"]
    assert words in check.found
    assert (check.verdict == "ok") is ("bias" in words)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("noise", "sigma_deg", "spell_deg"),
    [
        ("navchip", 0.2, 0.8),
        ("consumer", 0.5, 0.8),
        ("tactical", 0.2, -0.8),
        ("navchip", 0.5, 0.0),
        ("consumer", 0.5, 0.0),
    ],
)
def test_values_that_are_off_for_half_a_minute_are_named_and_left_out(noise, sigma_deg, spell_deg):
    """Oracle: the spell put in, to a piece of 5 s at either end; the true heading, to four sigmas
    throughout; an honest sensor loses no value.
    """
    sim = insgnss.simulate("ign8", 3.0, imu_rate_hz=50.0, noise=noise, seed=7, start_in_air=True)
    truth = sim.truth.trajectory[10:-10]
    begin = truth.time[0] + 70.0
    off = spell_deg * ((truth.time > begin) & (truth.time < begin + 30.0))
    values = truth.rpy[:, 2] + np.radians(
        off + sigma_deg * np.random.default_rng(1).standard_normal(len(truth))
    )
    antennas = insgnss.Measurement(
        "antennas",
        truth.time,
        values,
        np.radians(sigma_deg),
        lambda motion, states: motion.roll_pitch_heading[:, 2:] + states,
        (insgnss.OwnState("offset", np.radians(2.0), "rad"),),
        period=2.0 * np.pi,
    )
    result = insgnss.estimate(
        *(sim.imu, sim.gnss, sim.events),
        mounting=sim.mounting,
        noise=noise,
        measurements=[antennas],
    )
    path = result.trajectory
    exact = sim.truth.trajectory.at(path.time)
    turn = np.einsum("kj,kj->k", path.C_nb[:, 1], exact.C_nb[:, 0])
    assert (np.abs(turn) < 4.0 * np.sqrt(path.cov[:, 8, 8])).all()
    notes = [check.found for check in result.checks if check.verdict == "note"]
    spells = [found for found in notes if "they are left out" in found]
    assert len(spells) == (spell_deg != 0.0)
    assert not any("explains the innovations" in found for found in notes)
    if spells:
        first, last = (float(spells[0].split(word)[1].split()[0]) for word in ("antennas,", " to "))
        assert begin - 10.0 < first < begin + 1.0
        assert begin + 29.0 < last < begin + 40.0


@pytest.mark.slow
def test_the_advice_of_two_antennas_was_tried_on_this_flight():
    """Oracle: the same flight estimated with the headings of two antennas, to 2 %; a flight with a
    good heading, or with a sensor for it, tries nothing.
    """
    sims = {
        name: insgnss.simulate("ign8", 1.0, imu_rate_hz=50.0, noise=name, seed=7, start_in_air=True)
        for name in ("consumer", "tactical")
    }
    truth = sims["consumer"].truth.trajectory
    noise = np.radians(0.2) * np.random.default_rng(1).standard_normal(len(truth))
    antennas = insgnss.Measurement(
        "antennas",
        truth.time,
        truth.rpy[:, 2] + noise,
        np.radians(0.2),
        lambda motion, states: motion.roll_pitch_heading[:, 2],
        period=2.0 * np.pi,
    )

    def estimated(noise: str, *measurements: insgnss.Measurement) -> dict:
        sim = sims[noise]
        return insgnss.estimate(
            *(sim.imu, sim.gnss, sim.events),
            mounting=sim.mounting,
            noise=noise,
            measurements=measurements,
        ).report

    report, equipped = estimated("consumer"), estimated("consumer", antennas)
    tried = report["heading_with_antennas_deg"]
    advice = next(text for text in report["limits"] if "two antennas" in str(text))
    assert "(antennas 1 m apart would give 0.0" in str(advice)
    assert tried == pytest.approx(equipped["exposures"]["attitude_deg"]["median"][2], rel=0.02)
    assert tried < 0.5 * report["exposures"]["attitude_deg"]["median"][2]
    assert equipped["heading_with_antennas_deg"] is None
    assert estimated("tactical")["heading_with_antennas_deg"] is None


@pytest.mark.slow
@pytest.mark.parametrize("seed", [7, 8])
def test_the_advice_of_other_sensors_was_tried_on_this_flight(seed):
    """Oracle: the same flight estimated with values of each sensor that is advised, whose states
    start where they are stated: its heading to 5 %, which is the better one.
    """
    options = {"imu_rate_hz": 50.0, "noise": "consumer", "seed": seed, "start_in_air": True}
    sim = insgnss.simulate("ign8", 1.0, **options)
    truth = sim.truth.trajectory
    path = truth.at(sim.gnss.time[np.abs(sim.gnss.time - truth.time.mean()) < 29.0])
    zero, frame = np.zeros((len(path), 3)), LocalFrame(path.lat[0], path.lon[0], 0.0)
    motion = insgnss.Motion(path.time, zero, path.velocity_ned, path.C_nb, zero, zero, frame)

    def estimated(*measurements: insgnss.Measurement) -> dict:
        return insgnss.estimate(
            *(sim.imu, sim.gnss, sim.events),
            mounting=sim.mounting,
            noise="consumer",
            measurements=measurements,
        ).report

    alone = estimated()
    tried = alone["heading_with_sensors_deg"]
    assert "a magnetometer" in tried
    without = alone["exposures"]["attitude_deg"]["median"][2]
    for name, expected in tried.items():
        sensor = trial_sensors()[name]
        exact = sensor.predict(motion, np.zeros((len(path), len(sensor.states))))
        sigma = float(np.sqrt(sensor.cov[0, 0, 0]))
        noise = sigma * np.random.default_rng(seed).standard_normal(exact.shape)
        read = replace(sensor, time=path.time, values=exact + noise, sigma=sigma)
        report = estimated(read)
        assert report["heading_with_sensors_deg"] == {}
        median = report["exposures"]["attitude_deg"]["median"][2]
        assert median == pytest.approx(expected, rel=0.05)
        assert median < 0.85 * without
