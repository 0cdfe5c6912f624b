"""A log as arrays per channel."""
import fnmatch
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from .events import Events, LogError, gather, map_file
from .layout import Columns
from .schema import Schema, from_folder, from_sidecar, packaged

__all__ = ["Channel", "Log", "LogError", "read"]


class Channel(Mapping):
    """The messages of one channel in the order of the file: a field's name, dotted where it is nested, to its array.

    Numbers are arrays of the machine's own byte order with one row a message; strings are arrays of Python strings;
    arrays of varying length are Ragged. Fields are attributes too: channel.utime, channel["provenance.digest"].
    """

    def __init__(self, name, struct, arrays, log_utime, broken):
        self.name, self.type, self.constants = name, struct.name, dict(struct.constants)
        self.log_utime = log_utime  #: when each was written to the log, microseconds
        self.broken = broken  #: (offset in the file, reason) of the messages that are left out
        self._arrays = arrays

    @property
    def messages(self):
        return len(self.log_utime)

    def __getitem__(self, field):
        try:
            return self._arrays[field]
        except KeyError:
            raise KeyError(f"{self.name} ({self.type}) has no field {field!r}; it has {', '.join(self._arrays)}") from None

    def __getattr__(self, field):
        if not field.startswith("_") and field in self._arrays:
            return self._arrays[field]
        raise AttributeError(f"{self.name} ({self.type}) has no field {field!r}")

    def __iter__(self):
        return iter(self._arrays)

    def __len__(self):
        return len(self._arrays)

    def __repr__(self):
        return f"Channel({self.name}, {self.type}, {self.messages} messages)"


class Log(Mapping):
    """Channel names to Channels; read one when it is asked for, and kept."""

    def __init__(self, path, schemas):
        self.path = Path(path)
        self._data = map_file(self.path)
        self.events = Events(self._data)
        self.schemas = schemas
        if not len(self.events.offset):
            raise LogError(f"{self.path}: byte 0: holds no LCM event: {len(self._data)} bytes of something else")
        self._channels = {}
        self.unknown = {}  #: channel to the fingerprint that no schema has
        self._types = {}
        for name, events in self.events.channels.items():
            self._types[name] = self._type_of(name, events)

    @property
    def damage(self):
        """Bytes of the file that belong to no intact event."""
        return self.events.damage

    def _fingerprints(self, events):
        out = np.zeros(len(events), np.uint64)
        whole = self.events.size[events] >= 8
        out[whole] = gather(self._data, self.events.begin[events][whole], ">u8")
        return out

    def _type_of(self, name, events):
        """The type that most of a channel's messages have."""
        prints, counts = np.unique(self._fingerprints(events), return_counts=True)
        for wanted in prints[np.argsort(-counts, kind="stable")]:
            for schema in self.schemas:
                if int(wanted) in schema.by_fingerprint:
                    return schema, schema.by_fingerprint[int(wanted)], wanted
        self.unknown[name] = int(prints[np.argmax(counts)])
        return None

    def __getitem__(self, name):
        if name not in self._channels:
            if name in self.unknown:
                raise LogError(f"{self.path}: {name}: no type has the fingerprint {self.unknown[name]:016x}")
            if name not in self._types:
                raise KeyError(f"{self.path}: no channel {name!r}; there are {', '.join(self)}")
            self._channels[name] = self._read(name)
        return self._channels[name]

    def _read(self, name):
        events = self.events.channels[name]
        schema, struct, wanted = self._types[name]
        ours = self._fingerprints(events) == wanted
        broken = [(int(self.events.offset[e]), "a message of another type") for e in events[~ours]]
        events = events[ours]
        columns = Columns(schema, struct, len(events))
        columns.decode(self._data, self.events.begin[events], self.events.size[events])
        broken += [(int(self.events.offset[events[row]]), why) for row, why in columns.broken]
        keep = np.ones(len(events), bool)
        keep[[row for row, _ in columns.broken]] = False
        return Channel(name, struct, columns.arrays(), self.events.utime[events[keep]], sorted(broken))

    def type_name(self, name):
        return self._types[name][1].name if self._types.get(name) else None

    def __iter__(self):
        return (name for name, found in self._types.items() if found)

    def __len__(self):
        return len(self._types) - len(self.unknown)

    def __repr__(self):
        return f"Log({self.path}, {len(self.events.offset)} events on {len(self._types)} channels)"


def _sidecar_of(path):
    """The recorder's sidecar: NAME.json beside NAME.lcm or NAME_0001.lcm."""
    stem = path.name.removesuffix(".lcm")
    for name in (stem, stem.rsplit("_", 1)[0], stem.rsplit(".", 1)[0]):
        if (path.parent / f"{name}.json").is_file():
            return path.parent / f"{name}.json"
    return None


def read(path, channels=None, types=None):
    """Opens a log; with `channels`, a pattern or a list of them (POSE_*), reads those at once.

    Types are looked up by fingerprint: in `types` (a folder of .lcm files, a recording's sidecar or a Schema), in the
    sidecar beside the log, in what came with this package, which has the types of earlier versions too.
    """
    path = Path(path)
    schemas = []
    if isinstance(types, Schema):
        schemas.append(types)
    elif types is not None:
        schemas.append(from_folder(types) if Path(types).is_dir() else from_sidecar(types))
    sidecar = _sidecar_of(path)
    if sidecar is not None:
        try:
            schemas.append(from_sidecar(sidecar))
        except ValueError:
            pass  # some other JSON of that name
    log = Log(path, [*schemas, *packaged()])
    for pattern in [channels] if isinstance(channels, str) else channels or []:
        names = fnmatch.filter(list(log), pattern)
        if not names:
            raise KeyError(f"{path}: no channel {pattern!r}; there are {', '.join(log)}")
        for name in names:
            _ = log[name]
    return log
