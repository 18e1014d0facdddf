"""Writes .mat files as MATLAB lays them out: version 7.3 by h5py, and objects of classes in version 5."""

import struct

import h5py
import numpy as np


def write_v73(path, variables):
    """Write dicts (structs), lists (cells, or arrays of structs), texts and arrays; axes are reversed."""
    with h5py.File(path, "w", userblock_size=512) as file:
        references = file.create_group("#refs#")
        for name, value in variables.items():
            _put(file, name, value, references)
    with open(path, "r+b") as file:
        file.write(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM")


def _put(group, name, value, references):
    if isinstance(value, dict):
        item = group.create_group(name)
        item.attrs["MATLAB_class"] = np.bytes_("struct")
        for field, one in value.items():
            _put(item, field, one, references)
    elif isinstance(value, list) and value and isinstance(value[0], dict):
        item = group.create_group(name)
        item.attrs["MATLAB_class"] = np.bytes_("struct")
        for field in value[0]:
            item.create_dataset(field, data=_refer([one[field] for one in value], references))
    elif isinstance(value, list):
        item = group.create_dataset(name, data=_refer(value, references))
        item.attrs["MATLAB_class"] = np.bytes_("cell")
    elif isinstance(value, str):
        codes = np.array([[ord(letter)] for letter in value], dtype=np.uint16)
        item = group.create_dataset(name, data=codes if value else np.zeros(2, dtype=np.uint64))
        item.attrs["MATLAB_class"] = np.bytes_("char")
    else:
        array = np.atleast_2d(np.asarray(value))
        empty = array.size == 0
        item = group.create_dataset(name, data=np.array(array.shape, np.uint64) if empty else array.T)
        item.attrs["MATLAB_class"] = np.bytes_("double")
    if len(value) == 0 if isinstance(value, list | str) else np.size(value) == 0:
        item.attrs["MATLAB_empty"] = np.uint8(1)


def _refer(values, references):
    made = []
    for value in values:
        name = f"r{references.attrs.get('count', 0)}"
        references.attrs["count"] = references.attrs.get("count", 0) + 1
        _put(references, name, value, references)
        made.append([references[name].ref])
    return np.array(made, dtype=h5py.ref_dtype)


def write_object(path, name, kind):
    """Write a version 5 file that holds an object of a class, without what is inside it."""

    def element(code, data):
        return struct.pack("<II", code, len(data)) + data + bytes(-len(data) % 8)

    flags = element(6, struct.pack("<II", 17, 0))
    texts = b"".join(element(1, text.encode()) for text in (name, "MCOS", kind))
    inner = element(6, struct.pack("<II", 6, 0)) + element(5, struct.pack("<ii", 1, 1)) + element(1, b"")
    inner += element(9, struct.pack("<d", 1.0))
    with open(path, "wb") as file:
        file.write(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM")
        file.write(element(14, flags + texts + element(14, inner)))
