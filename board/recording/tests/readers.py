"""Reads a recording with two independent readers and compares every field with the bytes that lay in memory.

Usage: readers.py RECORDING EXPECTED, where EXPECTED is JSON: per topic the description of its messages, and each message's envelope and bytes.
"""

import json
import math
import struct
import sys
from pathlib import Path

NUMBERS = {
    "u8": "B", "u16": "H", "u32": "I", "u64": "Q",
    "i8": "b", "i16": "h", "i32": "i", "i64": "q",
    "f32": "f", "f64": "d",
}


def size_of(kind):
    if isinstance(kind, str):
        return struct.calcsize(NUMBERS[kind])
    if "state" in kind:
        return 4
    if "text" in kind:
        return kind["text"]["capacity"]
    if "array" in kind:
        return size_of(kind["array"]["of"]) * kind["array"]["count"]
    return kind["record"]["size"]


def values(kind, memory):
    """What the field should read as: numbers, lists (arrays of arrays as one), or objects."""
    if isinstance(kind, str):
        return struct.unpack_from("<" + NUMBERS[kind], memory)[0]
    if "state" in kind:
        return struct.unpack_from("<I", memory)[0]
    if "text" in kind:
        return list(memory[: kind["text"]["capacity"]])
    if "array" in kind:
        of, count = kind["array"]["of"], kind["array"]["count"]
        items = [values(of, memory[index * size_of(of):]) for index in range(count)]
        return flat(items) if isinstance(of, dict) and ("array" in of or "text" in of) else items
    return fields(kind["record"], memory)


def flat(items):
    return [item for inner in items for item in inner]


def fields(description, memory):
    return {
        field["name"]: values(field["kind"], memory[field["offset"]:])
        for field in description["fields"]
        if size_of(field["kind"]) > 0
    }


def message(description, memory):
    expected = fields(description, memory)
    element = description["element"]
    if element is not None and size_of(element) > 0:
        size = size_of(element)
        rest = memory[(description["size"] + 7) // 8 * 8:]
        items = [values(element, rest[at:]) for at in range(0, len(rest), size)]
        is_flat = isinstance(element, dict) and ("array" in element or "text" in element)
        expected["elements"] = flat(items) if is_flat else items
    return expected


def compare(path, expected, found):
    if isinstance(expected, dict):
        for name, value in expected.items():
            compare(f"{path}.{name}", value, getattr(found, name))
        return
    if isinstance(expected, list):
        found = list(found)
        assert len(expected) == len(found), f"{path}: {len(expected)} expected, {len(found)} found"
        for index, (left, right) in enumerate(zip(expected, found)):
            compare(f"{path}[{index}]", left, right)
        return
    if isinstance(found, bytes):
        found = found[0]
    same = expected == found or (math.isnan(expected) and math.isnan(found))
    assert same, f"{path}: {expected} expected, {found} found"


def with_mcap_ros2(path):
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, raw, decoded in reader.iter_decoded_messages(log_time_order=False):
            yield channel.topic, raw.log_time, (raw.publish_time, raw.sequence), decoded


def with_rosbags(path):
    from rosbags.highlevel import AnyReader

    with AnyReader([Path(path)]) as reader:
        for connection, stamp_ns, raw in reader.messages():
            yield connection.topic, stamp_ns, None, reader.deserialize(raw, connection.msgtype)


def main():
    recording, expected = sys.argv[1], json.loads(Path(sys.argv[2]).read_text())
    for read in (with_mcap_ros2, with_rosbags):
        places = {topic: 0 for topic in expected}
        count = 0
        for topic, stamp_ns, rest, found in read(recording):
            entry = expected[topic]
            wanted = entry["messages"][places[topic]]
            places[topic] += 1
            count += 1
            assert stamp_ns == wanted["stamp_ns"], f"{topic}: {stamp_ns}"
            if rest is not None:
                assert rest == (wanted["origin_ns"], wanted["sequence"]), f"{topic}: {rest}"
            compare(topic, message(entry["description"], bytes(wanted["bytes"])), found)
        for topic, place in places.items():
            assert place == len(expected[topic]["messages"]), f"{topic}: {place} messages found by {read.__name__}"
        print(f"{read.__name__}: {count} messages of {len(places)} topics, field by field")


main()
