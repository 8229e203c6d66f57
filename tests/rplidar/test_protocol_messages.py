"""Requests and short answers: bytes as Slamtec documents them, and back."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from lidarcore.rplidar.protocol import (
    Answer,
    Command,
    Conf,
    Descriptor,
    DeviceInfo,
    Health,
    Request,
    RequestReader,
    encode_dense,
    encode_nodes,
    request,
)

REQUESTS = {
    "a525": (Command.STOP, ""),
    "a540": (Command.RESET, ""),
    "a520": (Command.SCAN, ""),
    "a521": (Command.FORCE_SCAN, ""),
    "a550": (Command.GET_INFO, ""),
    "a552": (Command.GET_HEALTH, ""),
    "a559": (Command.GET_SAMPLERATE, ""),
    "a582050000000000" + "22": (Command.EXPRESS_SCAN, "0000000000"),
    "a582050100000000" + "23": (Command.EXPRESS_SCAN, "0100000000"),
    "a5a802580255": (Command.MOTOR_SPEED, "5802"),
    "a5a80200000f": (Command.MOTOR_SPEED, "0000"),
    "a5840470000000" + "55": (Command.GET_LIDAR_CONF, "70000000"),
    "a584047c000000" + "59": (Command.GET_LIDAR_CONF, "7c000000"),
    "a58406710000000100" + "57": (Command.GET_LIDAR_CONF, "710000000100"),
    "a584067f0000000100" + "59": (Command.GET_LIDAR_CONF, "7f0000000100"),
}
COMMANDS = st.tuples(st.sampled_from(sorted(set(range(0x80)) - {0xA5})), st.just(b"")) | st.tuples(
    st.integers(0x80, 0xFF).filter(lambda command: command != 0xA5), st.binary(max_size=40)
)


@pytest.mark.parametrize("written", REQUESTS)
def test_requests_are_the_bytes_slamtec_documents(written: str) -> None:
    command, payload = REQUESTS[written]
    assert request(command, bytes.fromhex(payload)).hex() == written
    assert RequestReader().feed(bytes.fromhex(written)) == [Request(command, bytes.fromhex(payload))]


@given(st.lists(COMMANDS, max_size=8), st.data())
def test_requests_are_read_back_in_any_fragments_and_with_noise_between(commands, data) -> None:
    sent = b""
    for command, payload in commands:
        sent += data.draw(st.binary(max_size=6)).replace(b"\xa5", b"") + request(command, payload)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(sent)), max_size=10)))
    reader = RequestReader()
    parts = [sent[a:b] for a, b in zip([0, *cuts], [*cuts, len(sent)], strict=True)]
    read = [found for part in parts for found in reader.feed(part)]
    assert read == [Request(command, payload) for command, payload in commands]
    assert reader.dropped == len(sent) - sum(len(request(*each)) for each in commands)


def test_a_request_with_a_wrong_checksum_is_dropped_and_the_next_one_read() -> None:
    reader = RequestReader()
    damaged = bytearray(request(Command.MOTOR_SPEED, b"\x58\x02"))
    damaged[3] ^= 1
    assert reader.feed(bytes(damaged) + request(Command.STOP)) == [Request(Command.STOP)]
    assert reader.dropped == len(damaged)


def test_an_incomplete_request_waits_until_it_is_forgotten() -> None:
    reader = RequestReader()
    whole = request(Command.GET_LIDAR_CONF, b"\x70\0\0\0")
    assert reader.feed(whole[:5]) == []
    assert reader.feed(whole[5:]) == [Request(Command.GET_LIDAR_CONF, b"\x70\0\0\0")]
    reader.feed(whole[:5])
    reader.reset()
    assert reader.feed(request(Command.GET_INFO)) == [Request(Command.GET_INFO)]
    assert reader.dropped == 5


def test_a_payload_where_none_can_be_is_refused() -> None:
    with pytest.raises(ValueError, match="takes no payload"):
        request(Command.STOP, b"\0")


@pytest.mark.parametrize(
    ("written", "descriptor"),
    [
        ("a55a0500004081", Descriptor(Answer.NODES, 5, True)),
        ("a55a5400004085", Descriptor(Answer.DENSE, 84, True)),
        ("a55a0300000006", Descriptor(Answer.HEALTH, 3)),
        ("a55a1400000004", Descriptor(Answer.INFO, 20)),
    ],
)
def test_descriptors_are_the_bytes_slamtec_documents(written: str, descriptor: Descriptor) -> None:
    assert descriptor.encode().hex() == written
    assert Descriptor.decode(bytes.fromhex(written)) == descriptor


@given(st.binary(max_size=9))
def test_what_is_no_descriptor_is_none(data: bytes) -> None:
    descriptor = Descriptor.decode(data)
    assert descriptor is None or descriptor.encode() == data


@given(st.integers(0, 255), st.integers(0, (1 << 30) - 1), st.booleans())
def test_every_descriptor_comes_back(kind: int, length: int, repeated: bool) -> None:
    descriptor = Descriptor(kind, length, repeated)
    assert Descriptor.decode(descriptor.encode()) == descriptor


def test_device_info_as_an_s1_sends_it() -> None:
    serial = "DEADBEEF00112233445566778899AABB"
    data = bytes.fromhex("611c0112" + serial)
    info = DeviceInfo.decode(data)
    assert info == DeviceInfo(0x61, (1, 28), 18, serial)
    assert (info.name, info.version, info.encode()) == ("RPLIDAR S1", "1.28", data)


@pytest.mark.parametrize(
    ("model", "name"),
    [(0x18, "A1"), (0x28, "A2"), (0x31, "A3"), (0x41, "C1"), (0x71, "S2"), (0x81, "S3"), (0x91, "T1")],
)
def test_other_models_are_named(model: int, name: str) -> None:
    assert DeviceInfo(model=model).name == f"RPLIDAR {name}"


@pytest.mark.parametrize(
    ("data", "status", "code", "name"),
    [("000000", 0, 0, "good"), ("013412", 1, 0x1234, "warning"), ("020080", 2, 0x8000, "protection stop")],
)
def test_health_has_its_code_little_endian(data: str, status: int, code: int, name: str) -> None:
    health = Health.decode(bytes.fromhex(data))
    assert (health.status, health.code, health.name, health.encode().hex()) == (status, code, name, data)


@pytest.mark.parametrize(("kind", "size"), [(DeviceInfo, 20), (Health, 3)])
def test_answers_of_another_size_are_refused(kind: type[DeviceInfo] | type[Health], size: int) -> None:
    with pytest.raises(ValueError, match=f"{size + 1} bytes, not {size}"):
        kind.decode(bytes(size + 1))


def test_dense_capsules_are_the_bytes_slamtec_documents() -> None:
    first, second = encode_dense(350.0, range(1000, 1040), True), encode_dense(5.5, [2000] * 40)
    assert first[:8].hex() == "a75580d7e803e903"
    assert second[:8].hex() == "a1566001d007d007"
    assert encode_dense([350.0, 5.5], [range(1000, 1040), [2000] * 40], [True, False]) == first + second


def test_nodes_are_the_bytes_slamtec_documents() -> None:
    assert encode_nodes([7900 / 64], [2000.25], [47], [False]).hex() == "beb93d411f"


def test_what_a_distance_cannot_express_is_no_return() -> None:
    dense = encode_dense(0, [float("nan"), 65_536, -5, float("inf")] * 10)
    assert dense[4:] == bytes(80)
    assert encode_nodes([0] * 2, [float("nan"), 16_384], [0] * 2, [False] * 2) == bytes.fromhex(
        "0201000000" * 2
    )


def test_the_configuration_that_can_be_asked_for_has_slamtecs_numbers() -> None:
    assert {entry.name: entry.value for entry in Conf} == {
        "DESIRED_SPEED": 1,
        "MIN_SPEED": 4,
        "MAX_SPEED": 5,
        "SCAN_MODE_COUNT": 0x70,
        "US_PER_SAMPLE": 0x71,
        "MAX_DISTANCE": 0x74,
        "ANSWER_TYPE": 0x75,
        "MAC": 0x79,
        "TYPICAL": 0x7C,
        "NAME": 0x7F,
    }
