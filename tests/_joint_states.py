"""`sensor_msgs/JointState` written byte by byte, for the tests of bags."""

import struct

STATE = "sensor_msgs/msg/JointState"


def state(names, *arrays, stamp=(1, 0), frame="", order="<", ros1=False, seq=0):
    """A message: ROS 1 has a count in front and no gaps, CDR closes texts with a zero and aligns to 4 and 8 bytes."""
    out = bytearray()

    def put(code, *values, align=1):
        out.extend(b"\0" * (-len(out) % (1 if ros1 else align)) + struct.pack(order + code, *values))

    def text(word):
        raw = word.encode() + (b"" if ros1 else b"\0")
        put("I", len(raw), align=4)
        out.extend(raw)

    put("III" if ros1 else "iI", *([seq] if ros1 else []), *stamp)
    text(frame)
    put("I", len(names), align=4)
    for name in names:
        text(name)
    for array in (*arrays, *[()] * (3 - len(arrays))):
        put("I", len(array), align=4)
        if len(array):
            put(f"{len(array)}d", *array, align=8)
    return (b"" if ros1 else b"\0\1\7\7" if order == "<" else b"\0\0\7\7") + bytes(out)
