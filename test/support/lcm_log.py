"""LCM event logs of our types in plain Python: an independent reading of the files and of lcmtypes/*.lcm, to compare with."""
import re
import struct
from pathlib import Path

MAGIC = 0xEDA1DA01
NUMBERS = {"int8_t": "b", "int16_t": "h", "int32_t": "i", "int64_t": "q", "boolean": "?", "float": "f", "double": "d", "byte": "B"}


def events(path):
    """(channel, timestamp in us, data) of every event of an undamaged log."""
    data = Path(path).read_bytes()
    at = 0
    while at < len(data):
        magic, _, timestamp, name, size = struct.unpack_from(">IqqII", data, at)
        if magic != MAGIC:
            raise ValueError(f"{path}: no event at offset {at}")
        at += 28
        yield data[at:at + name].decode(), timestamp, data[at + name:at + name + size]
        at += name + size


class Types:
    """Decodes messages by the text of the .lcm files."""

    def __init__(self, folder):
        self.types = {}
        for path in sorted(Path(folder).glob("*.lcm")):
            text = re.sub(r"/\*.*?\*/", "", re.sub(r"//[^\n]*", "", path.read_text()), flags=re.S)
            name, body = re.search(r"struct\s+(\w+)\s*\{(.*)\}", text, re.S).groups()
            fields = []
            for line in body.split(";"):
                words = line.split(None, 1)
                if len(words) < 2 or words[0] == "const":
                    continue
                for one in words[1].split(","):
                    field, *dims = re.split(r"[\[\]]+", one.strip())
                    fields.append((words[0], field, [d for d in dims if d]))
            self.types[name] = fields

    def decode(self, name, data):
        """The message as a dictionary; `data` begins with the fingerprint."""
        value, rest = self._struct(name, data, 8)
        if rest != len(data):
            raise ValueError(f"{name}: {len(data) - rest} bytes are left over")
        return value

    def _struct(self, name, data, at):
        values = {}
        for kind, field, dims in self.types[name]:
            sizes = [int(d) if d.isdigit() else values[d] for d in dims]
            values[field], at = self._array(kind, sizes, data, at)
        return values, at

    def _array(self, kind, sizes, data, at):
        if not sizes:
            return self._one(kind, data, at)
        if len(sizes) == 1 and kind == "byte":
            return data[at:at + sizes[0]], at + sizes[0]
        if len(sizes) == 1 and kind in NUMBERS:
            step = struct.Struct(f">{sizes[0]}{NUMBERS[kind]}")
            return list(step.unpack_from(data, at)), at + step.size
        values = []
        for _ in range(sizes[0]):
            value, at = self._array(kind, sizes[1:], data, at)
            values.append(value)
        return values, at

    def _one(self, kind, data, at):
        if kind in NUMBERS:
            step = struct.Struct(">" + NUMBERS[kind])
            return step.unpack_from(data, at)[0], at + step.size
        if kind == "string":
            size = struct.unpack_from(">I", data, at)[0]
            return data[at + 4:at + 3 + size].decode(), at + 4 + size
        return self._struct(kind, data, at)


def type_of_channel(channel):
    """The type that our channels carry, by their name."""
    by_prefix = {"CAMERA_": "image_t", "POSE_": "pose_t", "CONFIG_": "config_t", "STATE_": "state_t", "LEDGER_": "ledger_t",
                 "HEARTBEAT_": "heartbeat_t", "AIDING_": "aiding_t", "RAW_": "raw_t", "HORIZON_": "horizon_t"}
    by_name = {"REFERENCE": "pose_t", "IMU": "imu_t", "GNSS": "gnss_t", "WHEELS": "wheels_t", "MAG": "mag_t",
               "VO_FEATURES": "vo_features_t", "VO_STATUS": "vo_status_t", "VO_RESTART": "vo_restart_t", "INS_STATUS": "ins_status_t",
               "FUSION_STATE": "fusion_state2_t", "HEALTH": "health_t"}
    return by_name.get(channel) or next((t for p, t in by_prefix.items() if channel.startswith(p)), None)
