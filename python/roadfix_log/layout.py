"""From the bytes of many messages of one type to arrays.

Messages of one size mostly have one layout: their counts and their strings are equally long. The first of them is
walked and gives the layout; all that agree with it in every count and string length are decoded at once, and the
others make another round. What contradicts its own size is broken and told.
"""
import numpy as np

from .events import gather
from .ragged import assemble
from .schema import PRIMITIVES

_LENGTH = ">i4"  #: of a string, its closing zero included


class Broken(ValueError):
    """Why a message cannot be decoded."""


class _Layout:
    """Where everything is in messages of one size and one set of counts."""

    def __init__(self):
        self.names, self.formats, self.offsets = [], [], []
        self.strings = []  #: names of the records' fields that hold one
        self.checks = []  #: (name, value): counts and string lengths
        self.parts = []  #: (path, kind, names): a field of the message and the records' fields it is made of

    def add(self, kind, shape, offset):
        name = f"f{len(self.names)}"
        self.names.append(name)
        self.formats.append((kind, shape) if shape else kind)
        self.offsets.append(offset)
        return name

    def dtype(self, size):
        return np.dtype({"names": self.names, "formats": self.formats, "offsets": self.offsets, "itemsize": size})


class _Walker:
    """Reads one message and writes down its layout."""

    def __init__(self, schema, struct, message):
        self.schema, self.message, self.at = schema, message, 8
        self.layout = _Layout()
        self.struct(struct, "", None)
        if self.at != len(message):
            raise Broken(f"{len(message) - self.at} bytes are left over")

    def need(self, size, path):
        if size > len(self.message) - self.at:
            raise Broken(f"{path} ends {size - (len(self.message) - self.at)} bytes behind the message")

    def struct(self, struct, prefix, inside):
        """`inside`: the parts of a struct in an array, one list of names for each of its fields."""
        counts = {}
        sizes = {d for f in struct.fields for d in f.dims if isinstance(d, str)}
        for f in struct.fields:
            path = prefix + f.name
            dims = [counts[d] if isinstance(d, str) else d for d in f.dims]
            varying = any(isinstance(d, str) for d in f.dims)
            if f.type == "string":
                self.strings(path, dims, inside, varying)
            elif f.type in PRIMITIVES:
                name = self.primitive(path, f.type, dims, inside, varying)
                if f.name in sizes:
                    counts[f.name] = self.count(name, path)
            else:
                self.nested(self.schema.structs[f.type], path, dims, inside)

    def primitive(self, path, kind, dims, inside, varying):
        dtype = np.dtype(PRIMITIVES[kind])
        size = dtype.itemsize
        for dim in dims:
            size *= dim
        self.need(size, path)
        name = self.layout.add(dtype, tuple(dims), self.at)
        self.at += size
        self.part(path, "ragged" if varying else "plain", name, inside)
        return name

    def count(self, name, path):
        dtype, offset = np.dtype(self.layout.formats[-1]), self.layout.offsets[-1]
        value = int(np.frombuffer(self.message, dtype, 1, offset)[0])
        if not 0 <= value <= len(self.message):
            raise Broken(f"{path} = {value} does not fit into a message of {len(self.message)} bytes")
        self.layout.checks.append((name, value))
        return value

    def strings(self, path, dims, inside, varying):
        number = 1
        for dim in dims:
            number *= dim
        names = [self.string(path) for _ in range(number)]
        self.part(path, "strings" if dims else "string", names if dims else names[0], inside)

    def string(self, path):
        self.need(4, path)
        length = int(np.frombuffer(self.message, _LENGTH, 1, self.at)[0])
        self.layout.checks.append((self.layout.add(_LENGTH, (), self.at), length))
        self.at += 4
        if length < 1:
            raise Broken(f"{path} has a length of {length}")
        self.need(length, path)
        name = self.layout.add("u1", (length,), self.at)
        self.layout.strings.append(name)
        self.at += length
        return name

    def nested(self, struct, path, dims, inside):
        if not dims:
            return self.struct(struct, path + ".", inside)
        if inside is not None:
            raise Broken(f"{path}: an array of structs inside of another")
        number = 1
        for dim in dims:
            number *= dim
        parts = {f"{path}.{f.name}": [] for f in struct.fields}
        for _ in range(number):
            self.need(1, path)
            self.struct(struct, path + ".", parts)
        for part, names in parts.items():
            self.layout.parts.append((part, "elements", names))

    def part(self, path, kind, name, inside):
        if inside is None:
            self.layout.parts.append((path, kind, name))
        else:
            inside.setdefault(path, []).append((kind, name))


def _native(values):
    return values.astype(values.dtype.newbyteorder("="), copy=False) if values.dtype.byteorder == ">" else values


def _texts(rows):
    """Python strings of an array of bytes, one row each with its closing zero; equal ones are one object."""
    out = np.empty(len(rows), object)
    if rows.shape[1] == 1:
        out[:] = ""
        return out
    letters = np.ascontiguousarray(rows[:, :-1])
    texts = letters.view(f"S{letters.shape[1]}").ravel()
    if (texts == texts[0]).all():
        out[:] = bytes(texts[0]).decode("utf-8", "replace")
        return out
    distinct, inverse = np.unique(texts, return_inverse=True)
    words = np.array([bytes(t).decode("utf-8", "replace") for t in distinct], object)
    return words[inverse]


def _good_strings(layout, records):
    """Where every string has its zero at its end and nowhere else."""
    good = np.ones(len(records), bool)
    for name in layout.strings:
        letters = records[name]
        good &= (letters[:, -1] == 0) & (letters[:, :-1] != 0).all(axis=1)
    return good


def _values(kind, name, records):
    """Kind of column and values of one part in all records."""
    if kind == "string":
        return "plain", _texts(records[name])
    if kind == "strings":
        columns = [_texts(records[n]) for n in name]
        return "ragged", np.stack(columns, axis=1) if columns else np.empty((len(records), 0), object)
    if kind == "elements":
        columns = [_values(k, n, records)[1] for k, n in name]
        if not columns:
            return "elements", None  # an empty array of structs tells no type
        return "ragged", np.stack(columns, axis=1)
    return kind, _native(records[name])


class Columns:
    """Collects the pieces of each field, then joins them in the order of the messages."""

    def __init__(self, schema, struct, count):
        self.schema, self.struct, self.count = schema, struct, count
        self.kinds, self.pieces, self.broken = {}, {}, []

    def decode(self, data, begins, sizes):
        """All messages; broken ones stand in `broken` as (index, reason)."""
        order = np.argsort(sizes, kind="stable")
        borders = np.flatnonzero(np.diff(sizes[order])) + 1
        for rows in np.split(order, borders) if len(order) else []:
            while len(rows):
                rows = self._round(data, begins, int(sizes[rows[0]]), rows)

    def _round(self, data, begins, size, rows):
        """Decodes what is laid out like the first of `rows`; what is left."""
        message = data[begins[rows[0]]:begins[rows[0]] + size]
        try:
            layout = _Walker(self.schema, self.struct, message).layout
        except Broken as reason:
            self.broken.append((int(rows[0]), str(reason)))
            return rows[1:]
        dtype = layout.dtype(size)
        records = np.frombuffer(message, dtype) if len(rows) == 1 else gather(data, begins[rows], dtype)
        alike = np.ones(len(rows), bool)
        for name, value in layout.checks:
            alike &= records[name] == value
        rest, rows = rows[~alike], rows[alike]
        records = records if not len(rest) else records[alike]
        good = _good_strings(layout, records)
        if not good.all():
            self.broken += [(int(r), "a string's closing zero is not at its end") for r in rows[~good]]
            records, rows = records[good], rows[good]
        for path, kind, name in layout.parts if len(rows) else []:
            column, values = _values(kind, name, records)
            if self.kinds.get(path, "elements") == "elements":
                self.kinds[path] = column
            if values is not None:
                self.pieces.setdefault(path, []).append((rows, values))
        return rest

    def arrays(self):
        """Field to array, the broken messages left out."""
        keep = np.ones(self.count, bool)
        keep[[row for row, _ in self.broken]] = False
        place = np.cumsum(keep) - 1
        count = int(keep.sum())
        return {path: self._join(kind, [(place[r], v) for r, v in self.pieces.get(path, [])], count)
                for path, kind in self.kinds.items()}

    @staticmethod
    def _join(kind, pieces, count):
        if kind == "elements":
            return assemble(count, [(np.empty(0, np.int64), np.empty((0, 0)))])
        if kind == "ragged":
            try:
                return assemble(count, pieces)
            except ValueError:  # inner dimensions that vary too: one array a message
                out = np.empty(count, object)
                for rows, values in pieces:
                    for row, value in zip(rows, values):
                        out[row] = value
                return out
        if len(pieces) == 1 and len(pieces[0][0]) == count and (np.diff(pieces[0][0]) > 0).all():
            return pieces[0][1]
        first = pieces[0][1]
        out = np.empty((count, *first.shape[1:]), first.dtype)
        for rows, values in pieces:
            out[rows] = values
        return out
