"""Bags of ROS 1 (.bag) and ROS 2 (.mcap, .db3), by rosbags."""

from array import array
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from sautereau.daq.convert.readers import MOST_COLUMNS, Found, refuse

TIMES = "times"


def read(path: str, most: int) -> Found:
    """Return the numbers in the messages of each topic: ``/scale/wrench.force.z``.

    ``/scale/times`` are the times at which its messages were recorded, and the stamps in them,
    ``/scale/header.stamp``, those at which they were made: s from the first message of the bag.
    """
    values: defaultdict[str, array[float]] = defaultdict(lambda: array("d"))
    sizes: defaultdict[str, set[int]] = defaultdict(set)
    topic_of: dict[str, str] = {}
    count = 0
    # Bags of ROS 2 before Iron do not define their messages.
    with AnyReader([Path(path)], default_typestore=get_typestore(Stores.LATEST)) as bag:
        refuse(bag.message_count, most)
        begin = bag.start_time
        for connection, date, data in bag.messages():
            message = bag.deserialize(data, connection.msgtype)
            topic = connection.topic
            for place, found in [(TIMES, (date - begin) * 1e-9), *_numbers(message, "", begin)]:
                name = f"{topic}/{place}"
                topic_of[name] = topic
                one = np.atleast_1d(found)
                sizes[name].add(one.size)
                values[name].extend(one)
                count += one.size
                refuse(count, most)
    arrays, about = {}, {}
    date = np.datetime_as_string(np.datetime64(begin, "ns").astype("M8[us]")) + "+00:00"
    for name, numbers in values.items():
        messages = len(values[f"{topic_of[name]}/{TIMES}"])
        even = len(sizes[name]) == 1 and len(numbers) == messages * max(sizes[name])
        arrays[name] = np.reshape(numbers, (messages, -1)) if even else np.array(numbers)
        about[name] = {"date": date}
        if not even:
            about[name]["unknown"] = "another number of values in some messages"
    return arrays, about, None


def _numbers(message: Any, prefix: str, begin: int) -> Iterator[tuple[str, Any]]:
    """Yield the numbers of a message and of those in it, by their paths with dots.

    Larger arrays than a table has columns, such as pictures, are omitted.
    """
    for field, value in vars(message).items():
        name = f"{prefix}{field}"
        inner: list[tuple[str, Any]] = [(name, value)]
        if isinstance(value, list):
            inner = [(f"{name}({i})", one) for i, one in enumerate(value[:MOST_COLUMNS], 1)]
        for place, one in inner:
            if isinstance(one, np.ndarray) and one.dtype.kind in "fiu":
                yield from [(place, one)] if one.size <= MOST_COLUMNS else []
            elif isinstance(one, int | float) and not isinstance(one, bool):
                yield place, one
            elif getattr(one, "__msgtype__", "").endswith("/Time"):
                yield place, (vars(one)["sec"] * 10**9 + vars(one)["nanosec"] - begin) * 1e-9
            elif hasattr(one, "__msgtype__"):
                yield from _numbers(one, f"{place}.", begin)
