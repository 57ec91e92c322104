"""IMU messages (sensor_msgs/Imu) of ROS 1 and ROS 2 bags, data_specs/rosbag.md; needs rosbags.

A ROS 1 bag is a file; of a ROS 2 bag the file of messages (.db3, .mcap) is named, whose directory
holds `metadata.yaml`. A sample stands at `header.stamp`, UTC since 1970; one that began at zero, as
simulators give, counts seconds of its own.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ....base.advance import share
from ....base.errors import InputError, UsageError, legible, required_library
from ....base.wording import DOCTOR, spell
from ....records import Array, ImuSamples
from ..arrays.content import TableInfo
from ..arrays.mapped import imu_of_content
from ..imu.imu_csv import IMU_COLUMNS
from ..read_options import STATED_NOTHING, ReadOptions
from ..text.database import is_database, opened_database
from ..text.layout import printable
from ..text.text import Source

IMU_MESSAGE = "sensor_msgs/msg/Imu"
NEEDS_ROSBAGS = f"is a ROS bag, which needs rosbags: pip install 'insgnss[ros]'; {DOCTOR}"
BAG_KIND = "whole ROS bag; copy it again"
BAG_ENDINGS = (".db3", ".mcap")
SHARED = 1000  # messages between two reports of progress: a terminal needs no more
# stamp (s): larger ones count from 1970 (September 2001), others from a start of their own
EPOCH_S = 1e9


def bag_file(path: Path) -> Path:
    """Return the file of messages of a ROS 2 bag given by its directory; others as they are.

    Raises
    ------
    InputError
        The directory holds no bag.
    """
    if not path.is_dir():
        return path
    files = sorted(file for file in path.iterdir() if file.suffix in BAG_ENDINGS)
    if not files:
        problem = "is a directory without a ROS 2 bag (.db3 or .mcap)"
        raise InputError.in_file(path, f"{problem}; give a file")
    return files[0]


@contextmanager
def _open_bag(path: Source) -> Iterator[Any]:
    """An open bag, and its failures in one line."""
    with required_library(NEEDS_ROSBAGS, path):
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    file = Path(path)
    bag = file.parent if file.suffix in BAG_ENDINGS else file
    if bag != file and not (bag / "metadata.yaml").is_file():
        problem = "lacks the metadata.yaml in its directory that a ROS 2 bag needs"
        raise InputError.in_file(path, f"{problem}; create one by ros2 bag reindex")
    for database in sorted(bag.iterdir()) if bag != file else ():
        if database.is_file() and is_database(database):
            with opened_database(database, ("messages", "topics"), BAG_KIND):
                pass  # rosbags would read views and virtual tables
    # the library believes any length that a record states: MemoryError is a damaged file as well
    damaged = "is no whole ROS bag ({}); copy it again, or rosbag reindex"
    with (
        legible(path, damaged),
        AnyReader([bag], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as reader,
    ):
        yield reader


def _topics(reader: Any) -> dict[str, list[Any]]:
    """Connections of IMU messages by topic."""
    topics: dict[str, list[Any]] = {}
    for connection in reader.connections:
        if connection.msgtype == IMU_MESSAGE:
            topics.setdefault(printable(connection.topic), []).append(connection)
    return topics


def tables_of_bag(path: Source) -> list[TableInfo]:
    """List the topics of IMU messages, with the number of messages of each."""
    with _open_bag(path) as reader:
        return [
            TableInfo(name, IMU_COLUMNS, sum(connection.msgcount for connection in connections))
            for name, connections in _topics(reader).items()
        ]


def read_imu_rosbag(path: Source, options: ReadOptions = STATED_NOTHING) -> ImuSamples:
    """Read the samples of one IMU.

    Parameters
    ----------
    path : path
        The bag.
    options : ReadOptions
        `variable`: the topic, where the bag has several of IMU messages.

    Returns
    -------
    ImuSamples
        The samples, SI, in the order of their stamps.

    Raises
    ------
    UsageError
        Several topics and none named.
    InputError
        A bag that cannot be read, or has no such topic.
    """
    variable = options.variable
    with _open_bag(path) as reader:
        topics = _topics(reader)
        names = ", ".join(topics) or "none"
        if variable is None and len(topics) > 1:
            raise UsageError(
                f"{path}: IMU messages of {names}; set {spell('variable')} to one of them"
            )
        chosen = next(iter(topics), "") if variable is None else variable
        if chosen not in topics:
            problem = f"no {IMU_MESSAGE} in {chosen or 'any topic'}; topics with some: {names}"
            raise InputError.in_file(path, problem)
        table = _samples(reader, topics[chosen])
        count = sum(connection.msgcount for connection in topics[chosen])
    if len(table) < count:
        problem = f"holds {len(table)} of {count} messages of {chosen}; copy it again"
        raise InputError.in_file(path, problem)
    if not len(table) or not table[:, 0].max() > 0.0:
        problem = f"{chosen}: {len(table)} messages, and none has a stamp in its header"
        raise InputError.in_file(path, f"{problem}; record with a driver that stamps its messages")
    units = {"gyro": "rad/s", "accel": "m/s^2"}
    units |= {"time": "unix"} if table[0, 0] > EPOCH_S else {}
    content = dict(zip(IMU_COLUMNS, table.T, strict=True))
    same = {name: name for name in IMU_COLUMNS}
    options = replace(options, columns=same, variable=None, units=units)
    return imu_of_content(path, content, options)


def _samples(reader: Any, connections: list[Any]) -> Array:
    """Stamps, s, rates and forces (n, 7) of the messages, by stamp."""
    rows: list[tuple[float, ...]] = []
    count = max(sum(connection.msgcount for connection in connections), 1)
    for connection, _, raw in reader.messages(connections=connections):
        if len(rows) % SHARED == 0:
            share(len(rows) / count)
        message = reader.deserialize(raw, connection.msgtype)
        stamp, w, f = message.header.stamp, message.angular_velocity, message.linear_acceleration
        rows.append((stamp.sec + 1e-9 * stamp.nanosec, w.x, w.y, w.z, f.x, f.y, f.z))
    table = np.array(rows, dtype=np.float64).reshape(-1, 7)
    return np.asarray(table[np.argsort(table[:, 0], kind="stable")])
