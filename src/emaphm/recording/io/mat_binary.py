"""Parser of MATLAB's binary .mat formats, versions 4 to 7; each length is checked before it is used.

Only real numeric arrays are read, since a recording consists of these. Other variables are listed by name and
kind.

References
----------
MathWorks: MAT-File Format, R2023b. https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf
"""

import math
import zlib
from dataclasses import dataclass

import numpy as np

from emaphm.arrays import Array

HEADER_BYTES = 128

TYPES = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
"""NumPy's names of the format's data types of stored numbers."""

TYPES_4 = ("f8", "f4", "i4", "i2", "u2", "u1")
"""The same for version 4."""

INT8, INT32, UINT32, MATRIX, COMPRESSED, UTF8 = 1, 5, 6, 14, 15, 16
"""Further data types, of names, shapes, flags and variables."""

STRUCT, FIRST_NUMERIC, LAST_NUMERIC, OPAQUE = 2, 6, 15, 17
"""Classes of arrays: a struct, double to uint64, and objects such as strings, tables and times."""

COMPLEX = 0x08

MOST_DIMENSIONS = 32

NOT_NUMERIC = "is not numeric; save it as a vector of real numbers under this name"
IS_STRUCT = "is a struct; save it as a vector of real numbers under this name"


class MatError(Exception):
    """The bytes violate a rule of the format, which the text names."""


@dataclass(frozen=True, eq=False)
class Variable:
    """A variable: its `values`, shape (n,), or the `complaint` why it is no array of numbers."""

    name: str
    shape: tuple[int, ...]
    values: Array | None = None
    complaint: str | None = None


def read_version_5(content: bytes, order: str, most_bytes: int) -> list[Variable]:
    """Return the variables of a file of version 5, 6 or 7.

    Parameters
    ----------
    content
        Bytes of the file.
    order
        Byte order, "<" or ">".
    most_bytes
        Largest total size of the unpacked variables [bytes].

    Raises
    ------
    MatError
        The file is cut short, damaged, or larger.
    """
    variables, position = [], HEADER_BYTES
    while len(content) - position >= 8:
        kind, body, position = _element(content, position, order)
        if kind == COMPRESSED:
            body = _unpacked(body, most_bytes)
            most_bytes -= len(body)
            kind, body, _ = _element(body, 0, order)
        if kind != MATRIX:
            raise MatError(f"a variable of the unknown type {kind}")
        variable = _variable(body, order)
        if variable.name:  # MATLAB's internal data on objects have no name
            variables.append(variable)
    if content[position:].strip(b"\0"):
        raise MatError("bytes after the last variable")
    return variables


def read_version_4(content: bytes) -> list[Variable]:
    """Return the variables of a file of version 4; errors as in `read_version_5`."""
    variables, position = [], 0
    order = "<" if int.from_bytes(content[:4], "little") < 5000 else ">"
    while position < len(content):
        if len(content) - position < 20:
            raise MatError("the header of a variable is cut short")
        header = np.frombuffer(content, f"{order}i4", 5, position)
        type_code, rows, columns, imaginary, name_bytes = map(int, header)
        position += 20
        storage, kind = type_code // 10 % 10, type_code % 10
        if not 0 <= type_code < 5000 or type_code // 100 % 10 or storage >= len(TYPES_4) or kind > 2:
            raise MatError(f"a variable of the unknown type {type_code}")
        if min(rows, columns) < 0 or imaginary not in {0, 1} or name_bytes < 1:
            raise MatError("the header of a variable is damaged")
        dtype = np.dtype(order + TYPES_4[storage])
        end = position + name_bytes + rows * columns * dtype.itemsize * (1 + imaginary)
        if end > len(content):
            raise MatError("a variable is cut short")
        name = content[position : position + name_bytes].rstrip(b"\0").decode("latin-1")
        if kind or imaginary:
            variables.append(Variable(name, (rows, columns), complaint=NOT_NUMERIC))
        else:
            values = np.frombuffer(content, dtype, rows * columns, position + name_bytes)
            variables.append(Variable(name, (rows, columns), values.astype(float)))
        position = end
    return variables


def _element(content: bytes, position: int, order: str) -> tuple[int, bytes, int]:
    """Return the data type and bytes of the element at `position`, and the position of the next element."""
    if len(content) - position < 8:
        raise MatError("an element is cut short")
    kind, size = np.frombuffer(content, f"{order}u4", 2, position).tolist()
    if kind >> 16:  # a small element: up to four bytes in place of the size
        kind, size, start = kind & 0xFFFF, kind >> 16, position + 4
        if size > 4:
            raise MatError("an element is damaged")
        return kind, content[start : start + size], position + 8
    start, end = position + 8, position + 8 + size
    if end > len(content):
        raise MatError("an element is cut short")
    padded = end if kind == COMPRESSED else end + -size % 8
    return kind, content[start:end], padded


def _unpacked(packed: bytes, most_bytes: int) -> bytes:
    unpacker = zlib.decompressobj()
    try:
        body = unpacker.decompress(packed, max(most_bytes, 0) + 1)
    except zlib.error:
        raise MatError("a packed variable is damaged") from None
    if len(body) > most_bytes:
        raise MatError(f"the variables have more than {most_bytes / 2**20:,.0f} MiB when unpacked")
    if not unpacker.eof:
        raise MatError("a packed variable is cut short")
    return body


def _variable(body: bytes, order: str) -> Variable:
    if not body:
        return Variable("", ())
    kind, flags, position = _element(body, 0, order)
    if kind != UINT32 or len(flags) != 8:
        raise MatError("the flags of a variable are damaged")
    flag = int(np.frombuffer(flags, f"{order}u4", 1)[0])
    array_class = flag & 0xFF
    if array_class == OPAQUE:  # these have no shape
        return Variable(_name(body, position, order)[0], (), complaint=NOT_NUMERIC)
    kind, sizes, position = _element(body, position, order)
    if kind not in {INT32, UINT32} or len(sizes) % 4 or not 8 <= len(sizes) <= 4 * MOST_DIMENSIONS:
        raise MatError("the shape of a variable is damaged")
    shape = tuple(np.frombuffer(sizes, f"{order}i4").tolist())
    if min(shape) < 0:
        raise MatError("the shape of a variable is damaged")
    name, position = _name(body, position, order)
    if array_class == STRUCT:
        return Variable(name, shape, complaint=IS_STRUCT)
    if not FIRST_NUMERIC <= array_class <= LAST_NUMERIC or (flag >> 8) & COMPLEX:
        return Variable(name, shape, complaint=NOT_NUMERIC)
    kind, numbers, _ = _element(body, position, order)
    if kind not in TYPES:
        raise MatError(f"variable '{name}' is stored as the unknown type {kind}")
    dtype = np.dtype(order + TYPES[kind])
    count = math.prod(shape)
    if len(numbers) != count * dtype.itemsize:
        raise MatError(
            f"variable '{name}' has {len(numbers)} bytes where its shape needs {count * dtype.itemsize}"
        )
    return Variable(name, shape, np.frombuffer(numbers, dtype).astype(float))


def _name(body: bytes, position: int, order: str) -> tuple[str, int]:
    """Return the name at `position`, and the position of the next element."""
    kind, letters, position = _element(body, position, order)
    if kind not in {INT8, UTF8}:
        raise MatError("the name of a variable is damaged")
    return letters.rstrip(b"\0").decode("latin-1"), position
