"""Decoders of ROS messages, from the definitions that a log holds or the standard ones."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, Literal

Decoder = Callable[[bytes], Any]
Wire = Literal["cdr", "ros1"]


def decoders(definitions: Mapping[str, str], wire: Wire) -> Callable[[str], Decoder]:
    """What makes the decoder of a message type, `sensor_msgs/msg/JointState`.

    definitions: by type, the text (.msg, with those it needs) that the log holds; a type that is not among them is
    taken from the standard ones. What it returns raises KeyError for a type that is known to neither.
    """
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    own = get_typestore(Stores.EMPTY)
    for name, text in definitions.items():
        types = get_types_from_msg(text, name)
        own.register({key: value for key, value in types.items() if key not in own.fielddefs})

    def decoder(name: str) -> Decoder:
        full = name if "/msg/" in name else name.replace("/", "/msg/")
        standard = Stores.LATEST if wire == "cdr" else Stores.ROS1_NOETIC
        store = own if full in own.fielddefs else get_typestore(standard)
        if full not in store.fielddefs:
            raise KeyError(full)
        read = store.deserialize_cdr if wire == "cdr" else store.deserialize_ros1
        return lambda data: read(data, full)

    return decoder
