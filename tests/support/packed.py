"""Packed arrays of a report."""

import base64
import zlib

import numpy as np


def unpacked(header, text):
    """What the front end makes of packed arrays (frontend/src/arrays.ts), for comparison."""
    data = zlib.decompress(base64.b64decode(text))
    found = {}
    for name, entry in header.items():
        count = int(np.prod(entry["shape"], dtype=int))
        kind = np.dtype({"u8": "u1", "i8": "i1", "i16": "<i2", "i32": "<i4", "f32": "<f4"}[entry["type"]])
        planes = np.frombuffer(data, np.uint8, count * kind.itemsize, entry["at"])
        values = np.ascontiguousarray(planes.reshape(kind.itemsize, count).T).view(kind).reshape(entry["shape"])
        if entry["type"] != "f32":
            values = values.astype(np.int64)
            if entry["steps"] and count:
                rows = values.reshape(-1, entry["shape"][-1]).copy()
                rows[:, 0] = np.cumsum(rows[:, 0])
                values = np.cumsum(rows, axis=1).reshape(entry["shape"])
            values = values * entry["unit"]
            if "absent" in entry:
                bits = np.frombuffer(data, np.uint8, -(-count // 8), entry["absent"])
                absent = np.unpackbits(bits, count=count, bitorder="little").astype(bool)
                values = np.where(absent.reshape(values.shape), np.nan, values)
        found[name] = values
    return found
