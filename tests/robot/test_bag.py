"""ROS bags: joint states in another order, topics that do not fit, damaged files."""

import tomllib
from types import SimpleNamespace

import numpy as np
import pytest

from acqd.errors import InputError, UserError
from acqd.robot import load_description
from acqd.robot.bag_joints import arm_states
from acqd.robot.description import LogColumns
from acqd.robot.log_reader import read_log

rosbag2 = pytest.importorskip("rosbags.rosbag2")
from rosbags.typesys import Stores, get_typestore  # noqa: E402

STORE = get_typestore(Stores.ROS2_HUMBLE)
STATE, HEADER = STORE.types["sensor_msgs/msg/JointState"], STORE.types["std_msgs/msg/Header"]
TIME = STORE.types["builtin_interfaces/msg/Time"]
NAMES = ["elbow_joint", "shoulder_lift_joint", "shoulder_pan_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
ROWS = 120


def state(k, names, stamped=True, effort=True):
    time = TIME(*divmod(1_700_000_000_000_000_000 + 10_000_000 * k if stamped else 0, 1_000_000_000))
    position = np.array([0.1 * len(name) + 0.001 * k for name in names])
    force = np.arange(len(names)) + 0.5 if effort else np.array([])
    return STATE(HEADER(time, ""), names, position, np.full(len(names), 0.1), force)


def write_bag(folder, topics, storage=rosbag2.StoragePlugin.SQLITE3):
    """A bag with messages (times of recording in ns, message) of each topic."""
    with rosbag2.Writer(folder, version=9, storage_plugin=storage) as writer:
        for topic, messages in topics.items():
            connection = writer.add_connection(topic, type(messages[0][1]).__msgtype__, typestore=STORE)
            for ns, message in messages:
                writer.write(connection, ns, STORE.serialize_cdr(message, connection.msgtype))
    return folder


def states(names=NAMES, **options):
    return [(2_000_000_000 + 10_000_000 * k, state(k, names, **options)) for k in range(ROWS)]


@pytest.mark.parametrize("storage", list(rosbag2.StoragePlugin))
def test_joints_are_ordered_by_name_and_efforts_are_what_the_driver_says(tmp_path, storage):
    gripper = (5, state(0, ["finger"]))
    bag = write_bag(tmp_path / "bag", {"/joint_states": [gripper, *states()]}, storage)
    file = next(path for path in bag.iterdir() if path.suffix in (".mcap", ".db3"))
    for path in (bag, file):
        log = read_log(path, load_description("ur10e"))
        assert log.q.shape == log.qd.shape == log.current.shape == (ROWS, 6) and log.tau is None
        np.testing.assert_allclose(log.q[0], [0.1 * len(name) for name in sorted_by_axis()])
        np.testing.assert_array_equal(log.current[0], [2.5, 1.5, 0.5, 3.5, 4.5, 5.5])
        np.testing.assert_allclose(np.diff(log.time), 0.01, atol=1e-6)
        assert log.time[0] == 1.7e9


def sorted_by_axis():
    return ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", *NAMES[3:]]


def test_without_stamps_the_time_of_recording_counts_and_efforts_may_be_missing(tmp_path):
    names = [f"joint_{k}" for k in range(1, 8)]
    bag = write_bag(tmp_path / "bag", {"/joint_states": states(names, stamped=False, effort=False)})
    log = read_log(bag, load_description("kinova_gen3"))
    assert log.time[0] == pytest.approx(2.0) and log.tau is None and log.current is None


@pytest.mark.parametrize(
    ("topics", "complaint"),
    [
        ({"/joint_states": states(["a", "b"])}, "has the joints a, b; expected in one message shoulder_pan_joint, sho"),
        ({"/a": states(), "/b": states()}, "has states of the same joints in /a, /b: record one of them"),
        ({"/clock": [(1, TIME(1, 2))]}, "has no messages of the type sensor_msgs/msg/JointState"),
    ],
)
def test_a_bag_without_exactly_this_robot_is_refused(tmp_path, topics, complaint):
    with pytest.raises(InputError, match=complaint):
        read_log(write_bag(tmp_path / "bag", topics), load_description("ur10e"))


def test_damaged_bags_are_refused(tmp_path):
    bag = write_bag(tmp_path / "bag", {"/joint_states": states()}, rosbag2.StoragePlugin.MCAP)
    file = next(bag.glob("*.mcap"))
    whole = file.read_bytes()
    for number, content in enumerate((b"", b"no bag at all" * 9, whole[: len(whole) // 2])):
        for path in (tmp_path / f"{number}.mcap", tmp_path / f"{number}.db3", tmp_path / f"{number}.bag"):
            path.write_bytes(content)
            with pytest.raises(InputError, match=r"is not a readable bag|has no messages of the type"):
                read_log(path, load_description("ur10e"))
    (bag / "metadata.yaml").write_text("rosbag2_bagfile_information: 3")
    with pytest.raises(InputError, match="is not a readable bag"):
        read_log(bag, load_description("ur10e"))


def test_without_the_library_the_extra_is_named(tmp_path, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "rosbags.highlevel", None)
    (tmp_path / "x.mcap").write_bytes(b"")
    with pytest.raises(UserError, match=r"acqd\[rosbag\]"):
        read_log(tmp_path / "x.mcap", load_description("ur10e"))


def test_a_chunk_that_would_fill_the_memory_is_refused_before_it_is_read(tmp_path):
    bag = write_bag(tmp_path / "bag", {"/joint_states": states()}, rosbag2.StoragePlugin.MCAP)
    (file,) = bag.glob("*.mcap")
    data = bytearray(file.read_bytes())
    at = 8
    while data[at] != 0x06:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    data[at + 25 : at + 33] = (10**12).to_bytes(8, "little")
    file.write_bytes(data)
    with pytest.raises(InputError, match="a chunk of 1000000 MB"):
        read_log(bag, load_description("ur10e"))


ARMS = [side + name for side in ("left_", "right_") for name in NAMES]


@pytest.mark.parametrize("prefix", ["", "cell1_ur10e_", "robot/"])
def test_a_prefix_before_all_names_and_another_order_in_each_message_are_no_obstacle(tmp_path, prefix):
    messages = [
        (10_000_000 * k, state(k, [prefix + name for name in np.roll(NAMES, k).tolist()])) for k in range(1, ROWS)
    ]
    log = read_log(write_bag(tmp_path / "bag", {"/joint_states": messages}), load_description("ur10e"))
    # `state` gives each joint an angle by the length of its name
    np.testing.assert_allclose(log.q[0] - log.q[0, 0], [0.1 * (len(n) - 18) for n in sorted_by_axis()], atol=1e-9)
    np.testing.assert_allclose(np.ptp(log.q, axis=0), 0.001 * (ROWS - 2), atol=1e-9)


def without_positions_in_one():
    some = states()
    ns, one = some[40]
    return [*some[:40], (ns, STATE(one.header, one.name, one.position[:5], one.velocity, one.effort)), *some[41:]]


def test_a_message_without_all_positions_is_left_out(tmp_path):
    log = read_log(
        write_bag(tmp_path / "bag", {"/joint_states": without_positions_in_one()}), load_description("ur10e")
    )
    assert len(log.time) == ROWS - 1


def test_one_stamp_for_all_messages_is_no_time(tmp_path):
    header = state(0, NAMES).header
    messages = [(ns, STATE(header, s.name, s.position, s.velocity, s.effort)) for ns, s in states()]
    log = read_log(write_bag(tmp_path / "bag", {"/joint_states": messages}), load_description("ur10e"))
    np.testing.assert_allclose(log.time, 2 + 0.01 * np.arange(ROWS), atol=1e-6)


@pytest.mark.parametrize(
    ("topics", "remedy"),
    [
        ({"/joint_states": states(ARMS)}, 'begin with left_, right_.*"left_shoulder_pan_joint", "left_shoulder_lift_j'),
        ({"/joint_states": states([f"arm_{k}" for k in range(7)])}, 'joints = ..FIRST", "..."'),
        ({"/joint_states": states(), "/desired/joint_states": states()}, 'topic = "/joint_states"'),
    ],
)
def test_the_line_on_joints_that_do_not_fit_has_the_keys_to_write(tmp_path, topics, remedy):
    with pytest.raises(InputError, match=remedy):
        read_log(write_bag(tmp_path / "bag", topics), load_description("ur10e"))


def test_a_topic_can_be_chosen_and_numbered_joints_of_another_arm_are_not_taken(tmp_path):
    robot = load_description("ur10e")
    layout = next(each for each in robot.log if each.format == "ros")
    chosen = robot.model_copy(update={"log": [layout.model_copy(update={"topic": "/b"})]})
    bag = write_bag(tmp_path / "bag", {"/a": states(), "/b": states()[:50]})
    assert len(read_log(bag, chosen).time) == 50
    other = write_bag(tmp_path / "panda", {"/joint_states": states([f"panda_joint{k}" for k in range(1, 8)])})
    with pytest.raises(InputError, match=r'joints = ..panda_joint1", "panda_joint2'):
        read_log(other, load_description("xarm7"))


def bag_states(names):
    return [(0, SimpleNamespace(name=names, position=[0.0] * len(names)))]


@pytest.mark.parametrize(
    "topics",
    [
        {"/a": bag_states(NAMES), "/long/b": bag_states(NAMES)},
        {"/a": bag_states(ARMS)},
        {"/a": bag_states(ARMS), "/long/b": bag_states(ARMS)},
    ],
)
def test_the_keys_that_a_refusal_names_choose_one_arm(tmp_path, topics):
    robot = load_description("ur10e")
    layouts = [layout for layout in robot.log if layout.format == "ros"]
    with pytest.raises(InputError) as refused:
        arm_states(tmp_path, robot, layouts, topics)
    keys = str(refused.value).split("[[log]] ")[1].replace(", topic", "\ntopic").replace(", joints", "\njoints")
    written = LogColumns.model_validate(tomllib.loads(keys.replace(", effort", "\neffort")))
    layout, names, states = arm_states(tmp_path, robot, [*layouts, written], topics)
    assert layout.topic == "/a" and layout.effort == "current"
    assert set(names) <= set(states[0][1].name)


def test_only_names_that_the_bag_has_are_advised(tmp_path):
    robot = load_description("kinova_gen3")
    with pytest.raises(InputError, match=r"joints = ..FIRST"):
        arm_states(tmp_path, robot, [LogColumns(format="ros")], {"/a": bag_states([f"x_{robot.joint[0].name}", "foo"])})


def test_a_bag_that_is_still_open_is_named(tmp_path):
    (tmp_path / "x.bag.active").write_bytes(b"#ROSBAG V2.0\n")
    with pytest.raises(InputError, match=r"rosbag reindex x.bag.active"):
        read_log(tmp_path / "x.bag.active", load_description("ur10e"))
