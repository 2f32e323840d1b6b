"""A ROS 1 or ROS 2 bag gives the rows of a recording: the same numbers, in SI, in order of time."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cli_fixture import invoke
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

from workbench.errors import InputError
from workbench.simulation.ros_bag import read_bag, recording_of_bag
from workbench.simulation.ros_topics import TopicMap

START_NS = 1_700_000_000_123_456_789
PEOPLE = """
std_msgs/Header header
test_msgs/Person[] people
"""
PERSON = """
uint32 id
geometry_msgs/Point position
"""
MAP = """
distro = "{distro}"
[vehicle]
topic = "/odometry"
agent = "cart"
kind = "cart"
x = "pose.pose.position.x"
y = "pose.pose.position.y"
heading = "pose.pose.orientation"
v = "twist.twist.linear.x"
yaw_rate = "twist.twist.angular.z"
[people]
topic = "/people"
items = "people"
agent = "id"
x = "position.x"
y = "position.y"
[shape]
front = 1.96
rear = 0.77
half_width = 0.8825
wheelbase = 1.75
"""
N = 25


def store(distro: Stores) -> Any:
    found = get_typestore(distro)
    types = get_types_from_msg(PERSON, "test_msgs/msg/Person")
    types |= get_types_from_msg(PEOPLE, "test_msgs/msg/People")
    found.register(types)
    return found


def stamp(types: Any, at_ns: int) -> Any:
    return types["builtin_interfaces/msg/Time"](at_ns // 10**9, at_ns % 10**9)


def head(types: Any, at_ns: int) -> Any:
    kind = types["std_msgs/msg/Header"]
    extra = {"seq": 0} if "seq" in kind.__dataclass_fields__ else {}
    return kind(stamp=stamp(types, at_ns), frame_id="map", **extra)


def heading_at(k: int) -> float:
    """Passes half a turn twice."""
    return 3.0 + 0.2 * k


def odometry(types: Any, k: int) -> Any:
    def of(name: str, **values: Any) -> Any:
        return types[f"geometry_msgs/msg/{name}"](**values)

    half = heading_at(k) / 2
    turn = of("Quaternion", x=0.0, y=0.0, z=math.sin(half), w=math.cos(half))
    pose = of("Pose", position=of("Point", x=0.1 * k, y=-k / 3, z=0.0), orientation=turn)
    zero = of("Vector3", x=0.0, y=0.0, z=0.0)
    twist = of(
        "Twist", linear=of("Vector3", x=2.0 + k / 7, y=0.0, z=0.0),
        angular=of("Vector3", x=zero.x, y=0.0, z=0.2 + k / 11),
    )  # fmt: skip
    return types["nav_msgs/msg/Odometry"](
        header=head(types, START_NS + k * 10**8), child_frame_id="car",
        pose=of("PoseWithCovariance", pose=pose, covariance=np.zeros(36)),
        twist=of("TwistWithCovariance", twist=twist, covariance=np.zeros(36)),
    )  # fmt: skip


def people(types: Any, k: int) -> Any:
    point, person = types["geometry_msgs/msg/Point"], types["test_msgs/msg/Person"]
    seen = [
        person(id=7 + j, position=point(x=14.0 + j, y=6.0 - 0.1 * k, z=0.0)) for j in range(k % 3)
    ]
    return types["test_msgs/msg/People"](header=head(types, START_NS + k * 10**8), people=seen)


def written(folder: Path, version: int, order: Callable[[int], int] = lambda k: k) -> Path:
    """A bag in one of three forms; `order` changes when the messages came."""
    made = store(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    types = made.types
    plugin = StoragePlugin.MCAP if version == 3 else StoragePlugin.SQLITE3
    bag = folder / ("drive.bag" if version == 1 else "drive")
    writer = Writer1(bag) if version == 1 else Writer2(bag, version=9, storage_plugin=plugin)
    packed = made.serialize_ros1 if version == 1 else made.serialize_cdr
    with writer:
        topics = {
            "/odometry": ("nav_msgs/msg/Odometry", odometry),
            "/people": ("test_msgs/msg/People", people),
        }
        for topic, (kind, make) in topics.items():
            connection = writer.add_connection(topic, kind, typestore=made)
            for k in range(N):
                at_ns = START_NS + k * 10**8
                writer.write(connection, at_ns, packed(make(types, order(k)), kind))
    return bag


def topic_map(
    folder: Path, version: int, change: Callable[[str], str] = lambda text: text
) -> TopicMap:
    path = folder / "topics.toml"
    path.write_text(change(MAP.format(distro="ros1_noetic" if version == 1 else "ros2_humble")))
    return TopicMap.read(path)


@pytest.mark.parametrize("version", [1, 2, 3])
def test_every_number_of_the_bag_is_in_the_tables(version: int, tmp_path: Path) -> None:
    tables = read_bag(written(tmp_path, version), topic_map(tmp_path, version))
    assert tables.vehicles[0] == [
        "recording", "agent", "kind", "t", "x", "y", "heading", "v", "yaw_rate"
    ]  # fmt: skip
    assert len(tables.vehicles) == 1 + N
    for k, row in enumerate(tables.vehicles[1:]):
        assert row[:3] == ["drive", "cart", "cart"]
        assert row[3] == k / 10
        assert row[4:6] == [0.1 * k, -k / 3]
        # Unwrapped; the first one is taken as it comes, within half a turn.
        assert row[6] == pytest.approx(heading_at(k), abs=1e-12)
        assert row[7:] == [2.0 + k / 7, 0.2 + k / 11]
    assert len(tables.peds) == 1 + sum(k % 3 for k in range(N))
    assert tables.peds[1] == ["drive", "7", "ped", 0.1, 14.0, 5.9]
    assert tables.shapes[1] == ["drive", "cart", 1.96, 0.77, 0.8825, 1.75]
    assert tables.repeated == 0


@pytest.mark.parametrize("version", [1, 2])
def test_the_bag_is_a_recording(version: int, tmp_path: Path) -> None:
    recording = recording_of_bag(written(tmp_path, version), topic_map(tmp_path, version))
    assert (recording.name, recording.agent, recording.kind) == ("drive", "cart", "cart")
    assert len(recording.vehicle) == N
    assert {track.name for track in recording.people} == {"7", "8"}
    assert recording.shape.wheelbase_m == 1.75
    assert recording.vehicle[3].yaw_rate_radps == 0.2 + 3 / 11


def test_order_and_repetitions_are_mended_and_counted(tmp_path: Path) -> None:
    late = written(tmp_path, 2, order=lambda k: {4: 5, 5: 4, 9: 8}.get(k, k))
    tables = read_bag(late, topic_map(tmp_path, 2))
    times = [row[3] for row in tables.vehicles[1:]]
    assert times == sorted(k / 10 for k in range(N) if k != 9)
    assert tables.repeated == 1 + 8 % 3


def test_the_bags_own_time_can_be_taken(tmp_path: Path) -> None:
    late = written(tmp_path, 2, order=lambda k: {4: 5, 5: 4}.get(k, k))
    log_time = topic_map(tmp_path, 2, lambda text: text.replace('v = "', 't = "log"\nv = "'))
    rows = read_bag(late, log_time).vehicles[1:]
    assert [row[3] for row in rows] == [k / 10 for k in range(N)]
    assert rows[4][4] == 0.5


def replaced(old: str, new: str) -> Callable[[str], str]:
    return lambda text: text.replace(old, new)


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (replaced("/odometry", "/odom"), "it has /odometry, /people"),
        (replaced("pose.pose.position.y", "pose.pose.position.b"), "expected 'b', got x, y, z"),
        (replaced("twist.twist.linear.x", "header.frame_id"), "finite number, got 'map'"),
        (replaced("pose.pose.orientation", "pose.pose.position"), "finite number or a quaternion"),
        (replaced("pose.pose.orientation", "header"), "finite number or a quaternion"),
        (replaced("ros2_humble", "ros9"), "distro: expected one of"),
        (replaced('v = "', 'speed = "'), "unknown key 'speed'"),
        (replaced("wheelbase = 1.75", ""), "lacks the key wheelbase"),
        (replaced("wheelbase = 1.75", "wheelbase = true"), "finite number"),
        (replaced("[shape]", "[form]"), "unknown section 'form'"),
        (replaced("[vehicle]", "[vehicle"), "topic map in TOML"),
        (lambda text: text + '[definitions]\n"a/msg/B" = "!!"\n', "text of a message"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(change: Callable[[str], str], why: str, tmp_path: Path) -> None:
    bag = written(tmp_path, 2)
    with pytest.raises(InputError, match=why):
        read_bag(bag, topic_map(tmp_path, 2, change))


def test_no_bag_is_refused(tmp_path: Path) -> None:
    (tmp_path / "x.bag").write_bytes(b"no")
    for bag in (tmp_path / "x.bag", tmp_path / "none"):
        with pytest.raises(InputError, match="expected a ROS bag"):
            read_bag(bag, topic_map(tmp_path, 2))


def test_the_command_takes_a_bag_with_its_map(tmp_path: Path) -> None:
    """What it does with the recording, other tests show: here it gets as far as the bundle."""
    bag = written(tmp_path, 1)
    topic_map(tmp_path, 1)
    words = ["replay", bag, "--topics", tmp_path / "topics.toml"]
    result = invoke(*words, "--bundle", tmp_path / "none")
    assert result.status == 2
    assert "SHA256SUMS" in result.err or "bundle" in result.err


def test_the_command_names_what_is_wrong_with_a_bag(tmp_path: Path) -> None:
    bag = written(tmp_path, 2)
    topic_map(tmp_path, 2, replaced('v = "twist', 'v = "pose.pose.position.w" # "twist'))
    result = invoke("replay", bag, "--topics", tmp_path / "topics.toml")
    assert result.status == 2
    assert "expected 'w', got x, y, z" in result.err
    result = invoke("replay", bag, "--topics", tmp_path / "topics.toml", "--recording", "x")
    assert (result.status, "--recording" in result.err) == (2, True)
    result = invoke("replay", bag, "--topics", tmp_path / "topics.toml", "--run", "x")
    assert (result.status, "--run" in result.err) == (2, True)
