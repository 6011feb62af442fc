"""Bags written by rosbags hold the numbers of their CSV; faults are named."""

import re
import sqlite3
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest

from pushfit.data.recordings.recording import read_recording
from pushfit.errors import ConfigError, DataError

pytest.importorskip("rosbags", reason="bags need the extra `ros`")

from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

# Halfway in a step of 10 counts, of which times since 1970 keep a quarter microsecond.
STAMPED = 1e-3

# The message of the public BioTac driver, shortened to what a recording needs, so that
# no store of standard types can know it.
BIOTAC_HAND = """std_msgs/Header header
string hand_id
biotac_sensors/BioTacData[] bt_data
"""
BIOTAC_DATA = """string bt_serial
uint16 tdc_data
uint16 pdc_data
uint16[22] pac_data
uint16[19] electrode_data
"""
BIOTAC_ALL = "std_msgs/Header header\nsr_robot_msgs/Biotac[5] tactiles\n"
BIOTAC = (
    "int16 pac0\nint16 pac1\nint16 pdc\nint16 tac\nint16 tdc\nint16[19] electrodes\n"
)

START = 1_581_073_084_690_542_596
STEP = 10_000_000
PDC = np.array([[2400, 1800], [2410, 1801], [2455, 1807], [2431, 1803]])
STAMPS = START + STEP * np.arange(len(PDC))
# The bag records messages a little after they were stamped.
DELAY = 1_234_567
# Epoch seconds resolve 0.24 µs.
RESOLUTION = 2.5e-7


def typestore(base):
    store = get_typestore(base)
    types = {}
    for text, name in (
        (BIOTAC_HAND, "biotac_sensors/msg/BioTacHand"),
        (BIOTAC_DATA, "biotac_sensors/msg/BioTacData"),
        (BIOTAC_ALL, "sr_robot_msgs/msg/BiotacAll"),
        (BIOTAC, "sr_robot_msgs/msg/Biotac"),
    ):
        types |= get_types_from_msg(text, name)
    store.register(types)
    return store


def header(store, stamp):
    time = store.types["builtin_interfaces/msg/Time"]
    fields = {
        "stamp": time(sec=int(stamp // 10**9), nanosec=int(stamp % 10**9)),
        "frame_id": "finger",
    }
    cls = store.types["std_msgs/msg/Header"]
    if "seq" in cls.__dataclass_fields__:
        fields["seq"] = 0
    return cls(**fields)


def hand(store, stamp, pdc):
    data = store.types["biotac_sensors/msg/BioTacData"]
    return store.types["biotac_sensors/msg/BioTacHand"](
        header=header(store, stamp),
        hand_id="left",
        bt_data=[
            data(
                bt_serial="x",
                tdc_data=3,
                pdc_data=int(value),
                pac_data=np.zeros(22, np.uint16),
                electrode_data=np.zeros(19, np.uint16),
            )
            for value in pdc
        ],
    )


def write_bag(folder, kind, messages):
    """Write (topic, time of receipt, message) to a bag; give the path to read."""
    is_ros1 = kind == "bag"
    store = typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    path = folder / ("push.bag" if is_ros1 else "push")
    if is_ros1:
        writer, serialize = Writer1(path), store.serialize_ros1
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        writer = Writer2(path, version=9, storage_plugin=plugin)
        serialize = store.serialize_cdr
    with writer:
        connections = {}
        for topic, received, build in messages:
            message = build(store)
            msgtype = message.__msgtype__
            if topic not in connections:
                connections[topic] = writer.add_connection(
                    topic, msgtype, typestore=store
                )
            raw = serialize(message, msgtype)
            writer.write(connections[topic], int(received), raw)
    return path


def hands(stamps=STAMPS):
    return [
        ("/biotac_pub", received + DELAY, lambda s, k=k: hand(s, stamps[k], PDC[k]))
        for k, received in enumerate(STAMPS)
    ]


@pytest.fixture
def as_csv(tmp_path):
    """The same messages as `rostopic echo -p` prints them."""
    path = tmp_path / "echo.csv"
    names = "%time,field.header.stamp,field.bt_data0.pdc_data,field.bt_data1.pdc_data"
    rows = [
        f"{stamp + DELAY},{stamp},{a},{b}"
        for stamp, (a, b) in zip(STAMPS, PDC, strict=True)
    ]
    path.write_text("\n".join([names, *rows]) + "\n")
    columns = {f"pdc{i}": f"field.bt_data{i}.pdc_data" for i in range(2)}
    return read_recording(path, mapping=columns, units=dict.fromkeys(columns, "counts"))


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
def test_a_bag_holds_the_numbers_of_its_csv(kind, tmp_path, as_csv):
    """A type that only the bag defines, read from each of the three formats."""
    recording = read_recording(write_bag(tmp_path, kind, hands()))
    np.testing.assert_array_equal(recording.time, as_csv.time)
    assert recording.units == as_csv.units == {"pdc0": "counts", "pdc1": "counts"}
    for name, values in as_csv.channels.items():
        np.testing.assert_array_equal(recording.channels[name], values)
    (source,) = recording.sources
    assert "/biotac_pub (biotac_sensors/msg/BioTacHand)" in source.dialect
    assert len(source.sha256) == 64


@pytest.mark.parametrize("kind", ["db3", "mcap"])
def test_the_file_in_a_ros2_folder_reads_like_the_folder(kind, tmp_path):
    folder = write_bag(tmp_path, kind, hands())
    (file,) = folder.glob(f"*.{kind}")
    np.testing.assert_array_equal(read_recording(file).channels["pdc0"], PDC[:, 0])


FIELDS = [
    "/biotac_pub.bt_data[1].pdc_data",
    "/biotac_pub.bt_data.1.pdc_data",
    "/biotac_pub.bt_data1.pdc_data",
]


@pytest.mark.parametrize("target", FIELDS)
def test_a_field_may_be_named_as_the_ros_tools_do(target, tmp_path):
    path = write_bag(tmp_path, "bag", hands())
    recording = read_recording(path, mapping={"pressure_counts": target})
    np.testing.assert_array_equal(recording.channels["pressure"], PDC[:, 1])


def test_stamps_that_nobody_filled_in_give_way_to_the_time_of_receipt(tmp_path):
    path = write_bag(tmp_path, "bag", hands(stamps=np.zeros(len(PDC), int)))
    recording = read_recording(path)
    expected = (STAMPS + DELAY) / 1e9
    np.testing.assert_allclose(recording.time, expected, rtol=0, atol=RESOLUTION)
    assert any("time of receipt" in note for note in recording.notes)


def shadow(store, stamp, pdc):
    biotac = store.types["sr_robot_msgs/msg/Biotac"]
    numbers = {"pac0": 0, "pac1": 0, "tac": 0, "tdc": 0}
    return store.types["sr_robot_msgs/msg/BiotacAll"](
        header=header(store, stamp),
        tactiles=[
            biotac(pdc=int(pdc) + k, electrodes=np.zeros(19, np.int16), **numbers)
            for k in range(5)
        ],
    )


def test_the_five_fingers_of_a_shadow_hand_are_five_channels(tmp_path):
    messages = [
        ("/rh/tactile", t, lambda s, t=t, p=p: shadow(s, t, p))
        for t, p in zip(STAMPS, PDC[:, 0], strict=True)
    ]
    recording = read_recording(write_bag(tmp_path, "bag", messages))
    assert list(recording.channels) == [f"pdc{k}" for k in range(5)]
    np.testing.assert_array_equal(recording.channels["pdc3"], PDC[:, 0] + 3)


def wrench(store, stamp, force):
    vector = store.types["geometry_msgs/msg/Vector3"]
    zero = vector(x=0.0, y=0.0, z=0.0)
    return store.types["geometry_msgs/msg/WrenchStamped"](
        header=header(store, stamp),
        wrench=store.types["geometry_msgs/msg/Wrench"](
            force=vector(x=0.1, y=-0.2, z=float(force)), torque=zero
        ),
    )


def test_a_wrench_is_three_forces_in_newtons(tmp_path):
    messages = [
        ("/ft", t, lambda s, t=t, k=k: wrench(s, t, k / 4))
        for k, t in enumerate(STAMPS)
    ]
    recording = read_recording(write_bag(tmp_path, "mcap", messages))
    assert recording.units == {"force_x": "n", "force_y": "n", "force_z": "n"}
    np.testing.assert_array_equal(recording.channels["force_z"], [0, 0.25, 0.5, 0.75])


@pytest.mark.parametrize("kind", ["bag", "mcap"])
def test_topics_that_are_not_used_are_named(kind, tmp_path):
    """Beside a wrench, which is taken by itself, a hand that nobody mapped."""
    forces = [("/ft", t, lambda s, t=t: wrench(s, t, 1.0)) for t in STAMPS]
    fingers = [
        ("/rh/tactile", t, lambda s, t=t, p=p: shadow(s, t, p))
        for t, p in zip(STAMPS, PDC[:, 0], strict=True)
    ]
    path = write_bag(tmp_path, kind, [*forces, *fingers])
    mapping = {"force_n": "/ft.wrench.force.z"}
    said = "topics not used: /rh/tactile (sr_robot_msgs/msg/BiotacAll)"
    assert said in read_recording(path, mapping=mapping).notes
    (tmp_path / "alone").mkdir()
    alone = read_recording(write_bag(tmp_path / "alone", kind, forces))
    assert not any("topics not used" in note for note in alone.notes)


def joints(store, stamp, names, positions, effort):
    return store.types["sensor_msgs/msg/JointState"](
        header=header(store, stamp),
        name=list(names),
        position=np.array(positions),
        velocity=np.zeros(0),
        effort=np.array(effort),
    )


def test_a_joint_is_found_by_its_name_whatever_the_order(tmp_path):
    orders = [("thumb", "little"), ("little", "thumb")] * 2
    messages = [
        (
            "/joint_states",
            t,
            lambda s, t=t, names=names: joints(
                s,
                t,
                names,
                [len(n) / 10 for n in names],
                [float(len(n)) for n in names],
            ),
        )
        for t, names in zip(STAMPS, orders, strict=True)
    ]
    messages[2] = (
        "/joint_states",
        STAMPS[2],
        lambda s: joints(s, STAMPS[2], ("thumb", "i"), [0.5, 0.1], [9.0, 1.0]),
    )
    recording = read_recording(
        write_bag(tmp_path, "db3", messages),
        mapping={
            "effort": "/joint_states.effort[thumb]",
            "theta": "/joint_states.position[thumb]",
        },
        units={"effort": "au", "theta": "rad"},
    )
    np.testing.assert_array_equal(recording.channels["effort"], [5, 5, 9, 5])
    np.testing.assert_array_equal(recording.theta, [0.5] * 4)


def test_numbers_in_a_text_payload_are_counted_from_zero(tmp_path):
    """The BioTac SP node publishes its numbers as one bracketed text."""
    messages = [
        (
            "/biotac_sp",
            t,
            lambda s, p=p: s.types["std_msgs/msg/String"](data=f"[7, -1.5, {p}, 3]"),
        )
        for t, p in zip(STAMPS, PDC[:, 0], strict=True)
    ]
    recording = read_recording(
        write_bag(tmp_path, "bag", messages),
        mapping={"pressure": "/biotac_sp.data[2]"},
        units={"pressure": "counts"},
    )
    np.testing.assert_array_equal(recording.channels["pressure"], PDC[:, 0])


def test_topics_on_two_clocks_are_merged_under_the_gap_policy(tmp_path):
    half = STEP // 2
    messages = hands()
    messages += [
        ("/ft", t + half, lambda s, t=t, k=k: wrench(s, t + half, k))
        for k, t in enumerate(STAMPS)
    ]
    messages.sort(key=lambda message: message[1])
    path = write_bag(tmp_path, "bag", messages)
    options = {
        "mapping": {
            "pdc": "/biotac_pub.bt_data[0].pdc_data",
            "force": "/ft.wrench.force.z",
        },
        "units": {"pdc": "counts", "force": "n"},
    }
    with pytest.raises(DataError, match="4 of 8 samples are missing"):
        read_recording(path, **options)
    recording = read_recording(path, gaps="split", **options)
    np.testing.assert_array_equal(recording.channels["pdc"][::2], PDC[:, 0])
    np.testing.assert_array_equal(recording.channels["force"][1::2], [0, 1, 2, 3])
    assert np.isnan(recording.channels["pdc"][1::2]).all()
    filled = read_recording(path, gaps="interpolate", **options)
    np.testing.assert_allclose(filled.channels["pdc"][1], 2405, rtol=0, atol=STAMPED)


def test_two_topics_that_could_be_meant_are_not_chosen_between(tmp_path):
    messages = [*hands(), ("/ft", STAMPS[-1] + DELAY, lambda s: wrench(s, START, 1))]
    with pytest.raises(
        DataError, match=r"2 topics of a known type.*state `mapping="
    ) as e:
        read_recording(write_bag(tmp_path, "bag", messages))
    assert e.value.code == "ambiguous_topic"


REFUSED = {
    "unknown_topic": (
        {"mapping": {"p": "/biotac.pdc"}, "units": {"p": "counts"}},
        DataError,
        "missing_column",
        "/biotac_pub (biotac_sensors/msg/BioTacHand)",
    ),
    "unknown_field": (
        {"mapping": {"p": "/biotac_pub.bt_data[0].pcd"}, "units": {"p": "counts"}},
        DataError,
        "missing_column",
        "map what it holds: bt_data[0..1].tdc_data, bt_data[0..1].pdc_data, bt_data",
    ),
    "finger_that_is_not_there": (
        {"mapping": {"p": "/biotac_pub.bt_data[7].pdc_data"}, "units": {"p": "counts"}},
        DataError,
        "missing_column",
        "no number bt_data[7].pdc_data; bt_data has 2 numbers, [0] to [1]; map one",
    ),
    "no_unit": (
        {"mapping": {"p": "/biotac_pub.bt_data[0].pdc_data"}},
        ConfigError,
        "missing_unit",
        "`units={'p': 'counts'}`",
    ),
    "too_large": ({"max_bytes": 10}, DataError, "too_large", "split the bag"),
}


@pytest.mark.parametrize("case", REFUSED)
def test_what_a_bag_does_not_hold_is_refused_with_what_it_holds(case, tmp_path):
    options, kind, code, fragment = REFUSED[case]
    with pytest.raises(kind) as caught:
        read_recording(write_bag(tmp_path, "bag", hands()), **options)
    assert caught.value.code == code
    assert fragment in str(caught.value)


@pytest.mark.parametrize("kind", ["bag", "db3", "mcap"])
@pytest.mark.parametrize("share", [0.02, 0.5, 0.95])
def test_a_cut_bag_is_refused_whatever_the_library_raises(kind, share, tmp_path):
    path = write_bag(tmp_path, kind, hands())
    file = path if path.is_file() else next(path.glob(f"*.{kind}"))
    whole = file.read_bytes()
    file.write_bytes(whole[: int(len(whole) * share)])
    with pytest.raises(DataError):
        read_recording(Path(file))


def test_a_damaged_bag_names_the_repair(tmp_path):
    path = tmp_path / "push.mcap"
    path.write_bytes(b"\x89MCAP0\r\n" + bytes(40))
    with pytest.raises(DataError, match="tail='salvage'") as caught:
        read_recording(path)
    assert caught.value.code == "bad_bag"


@pytest.mark.parametrize("share", [0.6, 0.9])
def test_the_first_messages_of_a_cut_mcap_can_be_salvaged(share, tmp_path):
    """As a recorder leaves it that was switched off: whole chunks, then nothing."""
    messages = [
        ("/ft", START + STEP * k, lambda s, k=k: wrench(s, START + STEP * k, k))
        for k in range(20_000)
    ]
    (file,) = write_bag(tmp_path, "mcap", messages).glob("*.mcap")
    whole = file.read_bytes()
    cut = whole[: int(len(whole) * share)]
    file.write_bytes(cut)
    with pytest.raises(DataError, match="tail='salvage'"):
        read_recording(file)
    recording = read_recording(file, tail="salvage")
    force = recording.channels["force_z"]
    np.testing.assert_array_equal(force, np.arange(len(force)))
    # The chunk that was being written is lost; rosbags' hold some 10 000 of these.
    assert 0 < len(force) <= 20_000 * share
    assert any(f"of {len(cut)} bytes: the file was cut" in n for n in recording.notes)
    assert file.read_bytes() == cut


def test_a_whole_mcap_is_not_salvaged(tmp_path):
    folder = write_bag(tmp_path, "mcap", hands())
    recording = read_recording(folder, tail="salvage")
    np.testing.assert_array_equal(recording.channels["pdc0"], PDC[:, 0])
    assert not any("salvaged" in note for note in recording.notes)


@pytest.mark.parametrize(
    ("n_bytes", "reason"), [(20, "nothing of the bag can"), (300, "holds no messages")]
)
def test_a_bag_cut_in_its_first_chunk_has_nothing_to_salvage(n_bytes, reason, tmp_path):
    (file,) = write_bag(tmp_path, "mcap", hands()).glob("*.mcap")
    file.write_bytes(file.read_bytes()[:n_bytes])
    with pytest.raises(DataError, match=reason):
        read_recording(file, tail="salvage")


@pytest.fixture
def old_bag(tmp_path):
    """A bag as ROS 2 Humble wrote it: without definitions."""
    folder = write_bag(tmp_path, "db3", hands())
    (file,) = folder.glob("*.db3")
    with closing(sqlite3.connect(file)) as base, base:
        base.execute("DELETE FROM message_definitions")
        base.execute("UPDATE topics SET type_description_hash = ''")
    metadata = folder / "metadata.yaml"
    empty = "type_description_hash: ''"
    text = re.sub(r"type_description_hash:\s*\S+", empty, metadata.read_text())
    metadata.write_text(text)
    return folder


def test_definitions_from_the_user_serve_a_bag_without_any(old_bag, tmp_path):
    package = tmp_path / "src" / "biotac_sensors" / "msg"
    package.mkdir(parents=True)
    (package / "BioTacHand.msg").write_text(BIOTAC_HAND)
    (package / "BioTacData.msg").write_text(BIOTAC_DATA)
    with pytest.raises(DataError, match="no definition of biotac_sensors/msg/BioTacH"):
        read_recording(old_bag)
    recording = read_recording(old_bag, definitions=str(tmp_path / "src"))
    np.testing.assert_array_equal(recording.channels["pdc0"], PDC[:, 0])
    assert recording.time[0] == START // 10**9 + START % 10**9 / 1e9


def test_definitions_that_are_none_are_named(old_bag, tmp_path):
    with pytest.raises(ConfigError, match=r"no \.msg file"):
        read_recording(old_bag, definitions=str(tmp_path))
    (tmp_path / "Bad.msg").write_text("uint16 = = 3 ???\n")
    with pytest.raises(ConfigError, match=r"Bad\.msg: is no message definition"):
        read_recording(old_bag, definitions=str(tmp_path))
