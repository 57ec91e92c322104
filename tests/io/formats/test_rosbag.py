"""IMU messages of bags that rosbags itself has written."""

from pathlib import Path

import numpy as np
import pytest

from insgnss.base.errors import InputError, UsageError
from insgnss.io.formats import describe, read_imu, sniff_imu
from insgnss.io.formats.logs.rosbag import bag_file
from insgnss.noise.tuning.options import TuneOptions
from insgnss.noise.tuning.recordings import read_samples

rosbags = pytest.importorskip("rosbags")
START_NS = 1_530_623_100_123_456_789  # 2018-07-03 13:05:00 UTC
N = 60
CUT = r"is no whole ROS bag|no sensor_msgs|holds \d+ of 60 messages"
RNG = np.random.default_rng(8)
VALUES = np.column_stack([RNG.normal(size=(N, 3)), RNG.normal(size=(N, 3)) + [0, 0, 9.8]])
STAMPS = START_NS + 5_000_000 * np.arange(N)


def written(
    path: Path, kind: str, stamps: np.ndarray = STAMPS, topics: tuple[str, ...] = ("/imu",)
) -> Path:
    """A bag by rosbags' own writers."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if kind == "bag" else Stores.ROS2_HUMBLE)
    of = {name.rpartition("/")[2]: value for name, value in store.types.items()}
    of["Time"] = store.types["builtin_interfaces/msg/Time"]
    if kind == "bag":
        from rosbags.rosbag1 import Writer

        writer = Writer(path / "x.bag")
    else:
        from rosbags.rosbag2 import StoragePlugin, Writer

        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer(path / "bag", version=8, storage_plugin=plugin)
    with writer:
        for topic in topics:
            connection = writer.add_connection(topic, "sensor_msgs/msg/Imu", typestore=store)
            for k, (ns, row) in enumerate(zip(stamps.tolist(), VALUES.tolist(), strict=True)):
                stamp = of["Time"](sec=ns // 10**9, nanosec=ns % 10**9)
                seq = {"seq": k} if kind == "bag" else {}
                message = of["Imu"](
                    header=of["Header"](stamp=stamp, frame_id="imu", **seq),
                    orientation=of["Quaternion"](x=0.0, y=0.0, z=0.0, w=1.0),
                    angular_velocity=of["Vector3"](*row[:3]),
                    linear_acceleration=of["Vector3"](*row[3:]),
                    **{
                        f"{name}_covariance": np.zeros(9)
                        for name in ("orientation", "angular_velocity", "linear_acceleration")
                    },
                )
                pack = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
                writer.write(connection, START_NS + k, pack(message, "sensor_msgs/msg/Imu"))
    return path / "x.bag" if kind == "bag" else bag_file(path / "bag")


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_samples_are_those_written(kind: str, tmp_path: Path) -> None:
    """Oracle: rosbags' writer, and the leap seconds of 2018: GPST is 18 s ahead of UTC."""
    path = written(tmp_path, kind)
    assert sniff_imu(path) == "rosbag"
    imu = read_imu(path)
    np.testing.assert_array_equal(np.hstack([imu.gyro, imu.accel]), VALUES)
    seconds = (STAMPS - START_NS) * 1e-9 + START_NS * 1e-9 + 18.0 - 315964800.0
    assert imu.gps_week == int(seconds[0] // 604800)
    np.testing.assert_allclose(imu.time, seconds - imu.gps_week * 604800, rtol=0, atol=1e-6)
    (table,) = describe(path)
    assert (table.name, table.rows) == ("/imu", N)
    again, channels = read_samples(path, TuneOptions())
    assert all(channels)
    np.testing.assert_array_equal(again.gyro, imu.gyro)


def test_several_topics_and_clocks_of_their_own(tmp_path: Path) -> None:
    """Oracle: the topics written; a simulator's stamps begin at one second."""
    path = written(tmp_path, "bag", STAMPS - START_NS + 10**9, ("/imu/a", "/imu/b"))
    with pytest.raises(UsageError, match=r"IMU messages of /imu/a, /imu/b; set variable to one"):
        read_imu(path)
    imu = read_imu(path, variable="/imu/b")
    np.testing.assert_allclose(imu.time, 1.0 + 0.005 * np.arange(N), atol=1e-9)
    assert imu.gps_week is None
    with pytest.raises(
        InputError, match=r"no sensor_msgs/msg/Imu in /gps; topics with some: /imu/a"
    ):
        read_imu(path, variable="/gps")
    with pytest.raises(UsageError, match="holds rates"):
        read_imu(path, variable="/imu/b", quantity="increments")


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_damaged_bags_are_refused_in_one_line(kind: str, tmp_path: Path) -> None:
    """Oracle: cuts; no metadata, no stamps, an empty directory."""
    path = written(tmp_path, kind)
    whole = path.read_bytes()
    for size in (20, len(whole) // 3, len(whole) // 2):
        path.write_bytes(whole[:size])
        with pytest.raises(
            InputError, match=r"^[^\n]*(is no whole ROS bag|no sensor_msgs|holds \d+ of 60)[^\n]*$"
        ):
            read_imu(path)
    (tmp_path / "empty").mkdir()
    with pytest.raises(InputError, match="a directory without a ROS 2 bag"):
        bag_file(tmp_path / "empty")
    if kind != "bag":
        path.write_bytes(whole)
        (path.parent / "metadata.yaml").unlink()
        with pytest.raises(InputError, match=r"lacks the metadata\.yaml in its directory"):
            read_imu(path)
    unstamped = tmp_path / "unstamped"
    unstamped.mkdir()
    with pytest.raises(InputError, match="none has a stamp in its header"):
        read_imu(written(unstamped, kind, 0 * STAMPS))
