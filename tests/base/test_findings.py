"""What to do about a finding, in the way in which each caller writes options."""

from insgnss.base.findings import Question, check_lines
from insgnss.base.findings.remedies import SetKey, Step, join_remedies
from insgnss.base.wording import spell, spoken_as

UNIT = SetKey("imu.units gyro", "deg/s", "rad/s")
REMEDY = Step("the values look like {}; check {imu.columns} too", UNIT)


def test_a_remedy_is_written_as_the_caller_writes_options() -> None:
    """Oracle: by hand: the flight file, an option of a command, an argument of Python."""
    assert str(REMEDY) == (
        'the values look like imu.units gyro = "deg/s" (not in rad/s); check imu.columns too'
    )
    assert str(SetKey("gnss.units", {"angle": "rad"})) == 'gnss.units = { angle = "rad" }'
    assert str(SetKey("filter.robust", False)) == "filter.robust = false"
    with spoken_as({"camera.time_scale": "--time-scale", "filter.robust": "robust"}):
        assert str(SetKey("camera.time_scale", "utc")) == "--time-scale utc"
        assert str(SetKey("filter.robust", False)) == "robust = False"
        assert str(SetKey("imu.axes", "forward right down")) == 'imu.axes = "forward right down"'


def test_a_caller_without_the_option_is_told_what_to_do_instead() -> None:
    """Oracle: by hand; the names of the caller outside go on to the one inside."""
    multiply = {"imu.units gyro": lambda unit, instead: f"{unit}: multiply gyro of {instead}"}
    with spoken_as({"imu.axes": "imu_axes"}), spoken_as(lambda key, name: f"<{name}>", multiply):
        assert str(UNIT) == "deg/s: multiply gyro of rad/s"
        assert str(join_remedies((REMEDY, "or not"), "; ")) == (
            "the values look like deg/s: multiply gyro of rad/s; check <imu.columns> too; or not"
        )
        assert spell("imu.axes") == "<imu_axes>"
    assert spell("imu.axes") == "imu.axes"


def test_what_is_in_order_needs_no_remedy() -> None:
    """Oracle: by hand: the lines of the terminal for one check of each verdict."""
    ask = Question("IMU rate", "no gaps")
    answers = [
        ask.contradiction("none", REMEDY, when=False),
        ask.note("one", "look"),
        ask.contradiction("many", SetKey("imu.rate_hz", 100)),
        ask.answer("not seen", "unknown"),
    ]
    assert [(f.verdict, f.advice) for f in answers] == [
        ("ok", ""),
        ("note", "look"),
        ("contradiction", "imu.rate_hz = 100"),
        ("unknown", ""),
    ]
    assert check_lines(answers)[:3] == [
        "ok    IMU rate  none",
        "note  IMU rate  one",
        "                expected: no gaps; look",
    ]
    assert check_lines([]) == []
