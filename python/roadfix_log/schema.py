"""Message types as .lcm files describe them: fields, constants and fingerprints.

The language is that of lcm-gen as far as Roadfix's types need it: one struct a file, no enums, array sizes that are
numbers or earlier integer fields. The fingerprint is lcm-gen's (lcmgen.c, lcm_struct_hash): it covers names and types
of fields and their dimensions, not the name of the struct, comments or constants.
"""
import functools
import json
import re
from dataclasses import dataclass, field
from pathlib import Path

#: NumPy's code for each primitive of LCM, which is big-endian on the wire.
PRIMITIVES = {"int8_t": "i1", "int16_t": ">i2", "int32_t": ">i4", "int64_t": ">i8", "byte": "u1", "boolean": "?",
              "float": ">f4", "double": ">f8"}

_TOKEN = re.compile(r"//[^\n]*|/\*.*?\*/|[A-Za-z0-9_.+-]+|[^\sA-Za-z0-9_]", re.DOTALL)
_MASK = (1 << 64) - 1


class SchemaError(ValueError):
    """A type text that cannot be read; names the type and the word."""


@dataclass(frozen=True)
class Field:
    type: str
    name: str
    dims: tuple  #: numbers, or names of earlier integer fields


@dataclass
class Struct:
    name: str
    fields: list
    constants: dict = field(default_factory=dict)


class _Parser:
    def __init__(self, where, text):
        self.where = where
        self.tokens = [t for t in _TOKEN.findall(text) if not t.startswith(("//", "/*"))]
        self.at = 0

    def fail(self, what):
        raise SchemaError(f"type {self.where}: {what}")

    def take(self, wanted=None):
        if self.at >= len(self.tokens):
            self.fail(f"ends where {wanted or 'a word'!r} should be")
        token = self.tokens[self.at]
        self.at += 1
        if wanted and token != wanted:
            self.fail(f"expected {wanted!r}, found {token!r}")
        return token

    def peek(self):
        return self.tokens[self.at] if self.at < len(self.tokens) else None

    def struct(self):
        if self.peek() == "package":
            self.take()
            self.take()
            self.take(";")
        self.take("struct")
        struct = Struct(self.take(), [])
        self.take("{")
        while self.peek() != "}":
            if self.peek() == "const":
                self.constants(struct)
            else:
                self.fields(struct)
        self.take("}")
        if self.peek() is not None:
            self.fail(f"one struct a file, but then comes {self.peek()!r}")
        if not struct.fields:
            self.fail("a struct without fields")
        return struct

    def constants(self, struct):
        self.take("const")
        kind = self.take()
        while True:
            name = self.take()
            self.take("=")
            value = self.take()
            try:
                struct.constants[name] = float(value) if kind in ("float", "double") else int(value, 0)
            except ValueError:
                self.fail(f"the constant {name} = {value!r} is no number")
            if self.take() == ";":
                return

    def fields(self, struct):
        kind = self.take().rsplit(".", 1)[-1]
        while True:
            name, dims = self.take(), []
            while self.peek() == "[":
                self.take()
                dims.append(self.dim(struct, self.take()))
                self.take("]")
            struct.fields.append(Field(kind, name, tuple(dims)))
            end = self.take()
            if end == ";":
                return
            if end != ",":
                self.fail(f"expected ';' behind {name}, found {end!r}")

    def dim(self, struct, text):
        if text.isdigit():
            return int(text)
        if not any(f.name == text and not f.dims and f.type.startswith("int") for f in struct.fields):
            self.fail(f"the size {text!r} is no earlier integer field")
        return text


def parse(where, text):
    """The one struct in `text`; `where` names it in errors."""
    return _Parser(where, text).struct()


def _signed(value):
    return ((value & _MASK) ^ (1 << 63)) - (1 << 63)


def _update(value, item):
    """lcm-gen's hash_update: an arithmetic shift of a signed 64-bit number."""
    if isinstance(item, int):
        return _signed(((value << 8) ^ (value >> 55)) + item)
    data = item.encode()
    value = _update(value, len(data))
    for byte in data:
        value = _update(value, byte)
    return value


def _own_hash(struct):
    value = 0x12345678
    for f in struct.fields:
        value = _update(value, f.name)
        if f.type in PRIMITIVES or f.type == "string":
            value = _update(value, f.type)
        value = _update(value, len(f.dims))
        for dim in f.dims:
            value = _update(value, 0 if isinstance(dim, int) else 1)
            value = _update(value, str(dim))
    return value


class Schema:
    """Types that belong together: each struct's nested types are found among the others."""

    def __init__(self, texts, origin=""):
        """`texts`: pairs of a name for errors and the text of one .lcm file."""
        self.origin = origin
        self.structs = {}
        for where, text in texts:
            struct = parse(where, text)
            if struct.name in self.structs:
                raise SchemaError(f"type {struct.name}: defined twice")
            self.structs[struct.name] = struct
        self.by_fingerprint = {self.fingerprint(name): struct for name, struct in self.structs.items()}

    def fingerprint(self, name):
        """Of a message of this type, as an unsigned number of 64 bits."""
        return self._nested_hash(name, ()) & _MASK

    def _nested_hash(self, name, parents):
        if name in parents:
            raise SchemaError(f"type {name}: contains itself")
        if name not in self.structs:
            raise SchemaError(f"type {name}: unknown, but {parents[-1] if parents else 'somebody'} asks for it")
        struct = self.structs[name]
        value = _own_hash(struct) & _MASK
        for f in struct.fields:
            if f.type not in PRIMITIVES and f.type != "string":
                value += self._nested_hash(f.type, (*parents, name))
        value &= _MASK
        return ((value << 1) + (value >> 63)) & _MASK


def from_folder(folder):
    """The schema of a folder of .lcm files."""
    folder = Path(folder)
    files = sorted(folder.glob("*.lcm"))
    if not files:
        raise SchemaError(f"{folder}: holds no .lcm file")
    return Schema([(path.stem, path.read_text()) for path in files], str(folder))


def from_sidecar(path):
    """The schema that the recorder wrote beside its logs (JSON); absent keys are an error."""
    try:
        types = json.loads(Path(path).read_text())["types"]
        return Schema([(t["name"], t["text"]) for t in types], str(path))
    except (KeyError, TypeError, json.JSONDecodeError) as error:
        raise SchemaError(f"{path}: is no sidecar of a recording: {error!r}") from None


@functools.lru_cache(maxsize=None)
def packaged():
    """The types that came with this package, the newest first: those of today, then of each released version."""
    folder = Path(__file__).resolve().parent / "lcmtypes"
    old = [f for f in folder.glob("released/*") if f.is_dir()]
    return (from_folder(folder), *(from_folder(f) for f in sorted(old, reverse=True)))
