"""Where the events of an LCM log are: the file is searched as a whole, not event by event.

An event is a 28-byte big-endian head (magic, number, stamp, two lengths), the channel's name, the data. There is no
index, no file header and no checksum. What is damaged is stepped over and told, as Roadfix's own reader does it.
"""
import mmap
from dataclasses import dataclass

import numpy as np

MAGIC = b"\xed\xa1\xda\x01"
HEAD = np.dtype([("magic", "S4"), ("number", ">i8"), ("utime", ">i8"), ("channel_bytes", ">u4"), ("data_bytes", ">u4")])
MAX_CHANNEL = 63
MAX_DATA = 1 << 28
_CHUNK = 1 << 24


class LogError(ValueError):
    """A file that is no log; the text names file, offset and reason."""


@dataclass(frozen=True)
class Damage:
    offset: int
    bytes: int
    what: str


def map_file(path):
    """The file's bytes as an array that the system loads as they are read."""
    with open(path, "rb") as file:
        file.seek(0, 2)
        if file.tell() == 0:
            return np.empty(0, np.uint8)
        return np.frombuffer(mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ), np.uint8)


def windows(data, dtype):
    """The array whose element i is what begins at byte i: gathers records from anywhere without an index a byte."""
    dtype = np.dtype(dtype)
    count = max(len(data) - dtype.itemsize + 1, 0)
    return np.ndarray((count,), dtype, data, 0, (1,)) if count else np.empty(0, dtype)


def gather(data, offsets, dtype):
    """The records of `dtype` that begin at `offsets`, contiguous."""
    dtype = np.dtype(dtype)
    return windows(data, f"V{dtype.itemsize}")[offsets].view(dtype)


def _find_magic(data):
    found = []
    for begin in range(0, len(data), _CHUNK):
        part = data[begin:begin + _CHUNK + 3]  # a magic across the border belongs to the part it begins in
        at = np.flatnonzero(part[:max(len(part) - 3, 0)] == MAGIC[0])
        for k in (1, 2, 3):
            at = at[part[at + k] == MAGIC[k]]
        found.append(at + begin)
    offsets = np.concatenate(found) if found else np.empty(0, np.int64)
    return offsets[offsets <= len(data) - HEAD.itemsize]


def _printable(data, offsets, lengths):
    good = np.zeros(len(offsets), bool)
    for length in np.unique(lengths):
        which = np.flatnonzero(lengths == length)
        names = gather(data, offsets[which] + HEAD.itemsize, f"V{length}").view(np.uint8).reshape(-1, length)
        good[which] = ((names > 0x20) & (names <= 0x7E)).all(axis=1)
    return good


class Events:
    """The intact events of a log in file order: arrays `offset`, `utime`, `begin` and `size` of the data, and the
    indices of each channel's events in `channels`; what lies between them in `damage`."""

    def __init__(self, data):
        offsets = _find_magic(data)
        head = gather(data, offsets, HEAD)
        names, sizes = head["channel_bytes"].astype(np.int64), head["data_bytes"].astype(np.int64)
        ends = offsets + HEAD.itemsize + names + sizes
        valid = (names >= 1) & (names <= MAX_CHANNEL) & (sizes <= MAX_DATA) & (ends <= len(data))
        valid[valid] = _printable(data, offsets[valid], names[valid])
        offsets, names, sizes, ends = offsets[valid], names[valid], sizes[valid], ends[valid]
        self.damage = []
        chosen = self._chain(offsets, ends, len(data))
        self.offset = offsets[chosen]
        self.utime = head["utime"][valid][chosen].astype(np.int64)
        self.size = sizes[chosen]
        self.begin = ends[chosen] - self.size
        self.channels = self._by_channel(data, names[chosen])

    def _chain(self, offsets, ends, file_bytes):
        """Indices of the events that follow each other from the first byte on. Most candidates do: a break is a magic
        inside of data, or damage."""
        count = len(offsets)
        if count == 0:
            if file_bytes:
                self.damage.append(Damage(0, file_bytes, "no event here"))
            return np.empty(0, np.int64)
        breaks = np.append(np.flatnonzero(ends[:-1] != offsets[1:]), count - 1)
        if offsets[0] > 0:
            self.damage.append(Damage(0, int(offsets[0]), "no event here"))
        runs, at = [], 0
        while at < count:
            last = int(breaks[np.searchsorted(breaks, at)])
            end = int(ends[last])
            after = int(np.searchsorted(offsets, end))
            if (after < count and offsets[after] == end) or (end == file_bytes):
                runs.append(np.arange(at, last + 1))
                at = after
                continue
            # Either what follows is damaged, or this event's own length: then a whole event lies inside of it.
            inside = last + 1 < count and offsets[last + 1] < end
            runs.append(np.arange(at, last if inside else last + 1))
            begin = int(offsets[last]) if inside else end
            at = last + 1 if inside else after
            resume = int(offsets[at]) if at < count else file_bytes
            what = "an event's length is wrong" if inside else "no event here" if at < count else "the last event is cut off"
            self.damage.append(Damage(begin, resume - begin, what))
        return np.concatenate(runs)

    def _by_channel(self, data, lengths):
        channels = {}
        for length in np.unique(lengths):
            which = np.flatnonzero(lengths == length)
            names = gather(data, self.offset[which] + HEAD.itemsize, f"S{length}")
            for name, members in _groups(names):
                channels[name.decode("ascii")] = which[members]
        return dict(sorted(channels.items()))


def _groups(names):
    """Pairs of a name and the indices that have it. Names are many and channels few: a sort of 64-bit sums is cheaper
    than one of texts; where two names have one sum the texts are sorted after all."""
    width = names.dtype.itemsize
    powers = np.power(np.uint64(0x100000001B3), np.arange(1, width + 1, dtype=np.uint64))
    sums = np.zeros(len(names), np.uint64)
    letters = names.view(np.uint8).reshape(-1, width)
    for k in range(width):
        sums += letters[:, k] * powers[k]
    _, first, inverse = np.unique(sums, return_index=True, return_inverse=True)
    if not (names[first][inverse] == names).all():
        _, first, inverse = np.unique(names, return_index=True, return_inverse=True)
    order = np.argsort(inverse, kind="stable")
    borders = np.searchsorted(inverse[order], np.arange(len(first) + 1))
    for k, index in enumerate(first):
        yield names[index], order[borders[k]:borders[k + 1]]
