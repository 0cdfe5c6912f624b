"""Writes a drive log of ours as ROS bags: ROS 1 (own writer, or the official rosbag), rosbag2 in sqlite3 and in MCAP.

Everything here is written from the formats' documentation, apart from what the importer reads by: a bag that both agree on is right
twice. Vectors go into the axes of REP 103, which are ours."""
import bz2
import ctypes
import sqlite3
import struct
import zlib
from pathlib import Path

from lcm_log import Types, events, type_of_channel

DEFINITIONS = {
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation",
    "geometry_msgs/PoseWithCovariance": "geometry_msgs/Pose pose\nfloat64[36] covariance",
    "geometry_msgs/Twist": "geometry_msgs/Vector3 linear\ngeometry_msgs/Vector3 angular",
    "geometry_msgs/TwistWithCovariance": "geometry_msgs/Twist twist\nfloat64[36] covariance",
    "geometry_msgs/TwistStamped": "std_msgs/Header header\ngeometry_msgs/Twist twist",
    "geometry_msgs/TwistWithCovarianceStamped": "std_msgs/Header header\ngeometry_msgs/TwistWithCovariance twist",
    "geometry_msgs/Transform": "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation",
    "geometry_msgs/TransformStamped": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform",
    "tf2_msgs/TFMessage": "geometry_msgs/TransformStamped[] transforms",
    "nav_msgs/Odometry": "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n"
                         "geometry_msgs/TwistWithCovariance twist",
    "sensor_msgs/Imu": "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n"
                       "geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n"
                       "geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance",
    "sensor_msgs/NavSatStatus": "int8 STATUS_FIX=0 # a constant\nint8 status\nuint16 service",
    "sensor_msgs/NavSatFix": "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
                             "float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type",
    "sensor_msgs/MagneticField": "std_msgs/Header header\ngeometry_msgs/Vector3 magnetic_field\nfloat64[9] magnetic_field_covariance",
    "sensor_msgs/CompressedImage": "std_msgs/Header header\nstring format\nuint8[] data",
    "std_msgs/String": "string data",
}
HEADER = {1: "uint32 seq\ntime stamp\nstring frame_id", 2: "builtin_interfaces/Time stamp\nstring frame_id"}
NUMBERS = {"int8": "b", "uint8": "B", "bool": "B", "int16": "h", "uint16": "H", "int32": "i", "uint32": "I", "float64": "d"}


def text_of(kind, version):
    """The .msg text of one type; ROS 2 renamed fields of some."""
    return HEADER[version] if kind == "std_msgs/Header" else DEFINITIONS.get((kind, version)) or DEFINITIONS[kind]


def fields(kind, version):
    text = text_of(kind, version)
    return [line.split() for line in text.split("\n") if "=" not in line]


def definition(kind, version):
    """The .msg text with the texts of its parts, as bags carry it."""
    parts, seen = [kind], []
    while parts:
        part = parts.pop(0)
        if part not in seen:
            seen.append(part)
            parts += [t.split("[")[0] for t, _ in fields(part, version) if "/" in t and "builtin" not in t]
    return text_of(kind, version) + "\n" + "".join(f"{'=' * 80}\nMSG: {part}\n{text_of(part, version)}\n" for part in seen[1:])


class Encoder:
    """ROS 1's serialisation (version 1) or CDR (version 2)."""

    def __init__(self, version):
        self.version, self.out = version, bytearray()

    def pack(self, code, value):
        size = struct.calcsize("<" + code)
        if self.version == 2:
            self.out += bytes(-len(self.out) % size)
        self.out += struct.pack("<" + code, value)

    def text(self, value):
        data = value.encode() + (b"\0" if self.version == 2 else b"")
        self.pack("I", len(data))
        self.out += data

    def value(self, kind, value):
        base, _, size = kind.partition("[")
        if size:
            value = value if value is not None else [0] * int(size.rstrip("]") or 0)
            if size == "]":
                self.pack("I", len(value))
            if base == "uint8":
                self.out += bytes(value)
            else:
                for one in value:
                    self.value(base, one)
        elif base in NUMBERS:
            self.pack(NUMBERS[base], value or 0)
        elif base == "string":
            self.text(value or "")
        elif base in ("time", "builtin_interfaces/Time"):
            self.pack("I" if self.version == 1 else "i", (value or 0) // 10**9)
            self.pack("I", (value or 0) % 10**9)
        else:
            for part, name in fields(base, self.version):
                self.value(part, (value or {}).get(name))


def encode(kind, value, version):
    encoder = Encoder(version)
    encoder.value(kind, value)
    return bytes(encoder.out) if version == 1 else b"\0\1\0\0" + bytes(encoder.out)


def xyz(values):
    return dict(zip("xyz", values))


def messages(root, log, seconds=None, rotate_imu=False):
    """(topic, type, time in ns, value) of every sensor message, and what went out of it: channel -> list of expected values.
    rotate_imu: the IMU hangs upside down under the roof (turned about x by 180 degrees), and /tf_static says so."""
    types, out, expected, first = Types(root / "lcmtypes"), [], {}, None
    turn = (lambda v: [v[0], -v[1], -v[2]]) if rotate_imu else list
    for channel, _, data in events(log):
        kind = type_of_channel(channel)
        if kind not in ("imu_t", "gnss_t", "wheels_t", "mag_t", "image_t"):
            continue
        m = types.decode(kind, data)
        t = m["utime"] * 1000
        first = t if first is None else first
        if seconds is not None and t - first > seconds * 1e9:
            break
        head = lambda frame: {"stamp": t, "frame_id": frame}
        keep = lambda *values: expected.setdefault(channel, []).append([m["utime"], *values])
        if kind == "imu_t":
            out.append(("/imu/data", "sensor_msgs/Imu", t, {"header": head("imu_link"), "angular_velocity": xyz(turn(m["gyro_radps"])),
                                                            "linear_acceleration": xyz(turn(m["accel_mps2"]))}))
            keep(*m["gyro_radps"], *m["accel_mps2"])
        elif kind == "gnss_t":
            status = {0: -1, 1: 0, 2: 1, 4: 2}[m["fix_type"]]
            cov = [v for row in m["cov_enu_m2"] for v in row]
            out.append(("/gps/fix", "sensor_msgs/NavSatFix", t, {
                "header": head("antenna"), "status": {"status": status}, "latitude": m["lat_deg"], "longitude": m["lon_deg"],
                "altitude": m["height_m"], "position_covariance": cov, "position_covariance_type": 3}))
            velocity = []
            if m["has_velocity"]:
                velocity = list(m["velocity_enu_mps"])
                wide = [0.0] * 36
                for i in range(3):
                    for k in range(3):
                        wide[6 * i + k] = m["cov_velocity_enu_m2ps2"][i][k]
                out.append(("/gps/fix_velocity", "geometry_msgs/TwistWithCovarianceStamped", t,
                            {"header": head("map"), "twist": {"twist": {"linear": xyz(velocity)}, "covariance": wide}}))
                velocity += [v for row in m["cov_velocity_enu_m2ps2"] for v in row]
            keep(m["fix_type"], m["lat_deg"], m["lon_deg"], m["height_m"], *cov, *velocity)
        elif kind == "wheels_t":
            speed = m["speed_mps"][0] if m["num_speeds"] == 1 else (m["speed_mps"][2] + m["speed_mps"][3]) / 2
            yaw_rate = m["yaw_rate_radps"] if m["has_yaw_rate"] else 0.0
            out.append(("/vehicle/twist", "geometry_msgs/TwistStamped", t,
                        {"header": head("base_link"), "twist": {"linear": {"x": speed}, "angular": {"z": yaw_rate}}}))
            keep(speed, yaw_rate)
        elif kind == "mag_t":
            out.append(("/imu/mag", "sensor_msgs/MagneticField", t,
                        {"header": head("base_link"), "magnetic_field": xyz([v * 1e-6 for v in m["field_ut"]])}))
            keep(*m["field_ut"])
        else:
            camera = "left" if channel == "CAMERA_LEFT" else "right"
            out.append((f"/camera/{camera}/image_raw/compressed", "sensor_msgs/CompressedImage", t,
                        {"header": head(f"camera_{camera}"), "format": "jpeg" if m["format"] == 2 else "png", "data": m["data"]}))
            keep(m["data"])
    frame = lambda child, place, q: {"header": {"stamp": first, "frame_id": "base_link"}, "child_frame_id": child,
                                     "transform": {"translation": xyz(place), "rotation": dict(zip("xyzw", q))}}
    still, over = (0.0, 0.0, 0.0, 1.0), (1.0, 0.0, 0.0, 0.0)
    frames = [frame("imu_link", (0.5, 0.0, 0.4), over if rotate_imu else still), frame("antenna", (1.0, 0.25, 1.5), still),
              frame("camera_left", (1.5, 0.25, 1.25), (-0.5, 0.5, -0.5, 0.5))]
    out.insert(0, ("/tf_static", "tf2_msgs/TFMessage", first, {"transforms": frames}))
    out.insert(1, ("/chatter", "std_msgs/String", first, {"data": "not for us"}))
    return out, expected


def found_in(root, log):
    """The same values of a log that was imported from such a bag."""
    types, found = Types(root / "lcmtypes"), {}
    for channel, _, data in events(log):
        kind = type_of_channel(channel)
        if kind not in ("imu_t", "gnss_t", "wheels_t", "mag_t", "image_t"):
            continue
        m = types.decode(kind, data)
        values = [m["utime"]]
        if kind == "imu_t":
            values += m["gyro_radps"] + m["accel_mps2"]
        elif kind == "gnss_t":
            values += [m["fix_type"], m["lat_deg"], m["lon_deg"], m["height_m"]] + [v for row in m["cov_enu_m2"] for v in row]
            if m["has_velocity"]:
                values += m["velocity_enu_mps"] + [v for row in m["cov_velocity_enu_m2ps2"] for v in row]
        elif kind == "wheels_t":
            values += [m["speed_mps"][0], m["yaw_rate_radps"] if m["has_yaw_rate"] else 0.0]
        else:
            values += m["field_ut"] if kind == "mag_t" else [m["data"]]
        found.setdefault(channel, []).append(values)
    return found


def same(a, b):
    """Equal, up to the last bits of a change of units (degrees and radians, tesla and microtesla) there and back."""
    return abs(a - b) <= 1e-15 * abs(a) if isinstance(a, float) else a == b


def equal_values(expected, found):
    """(values that came back equal, values that went out)"""
    equal, total = 0, 0
    for channel, rows in expected.items():
        others = found.get(channel, [])
        for i, row in enumerate(rows):
            total += len(row)
            if i < len(others) and len(others[i]) == len(row):
                equal += sum(map(same, row, others[i]))
    return equal, total


def pack(compression, data):
    """By the packers' own libraries, which the programs need anyway; Debian's Python has lz4 and zstd in packages alone."""
    if compression in ("", "none"):
        return data
    if compression == "bz2":
        return bz2.compress(data)
    out = ctypes.create_string_buffer(len(data) + 65536)
    if compression == "zstd":
        call, more = ctypes.CDLL("libzstd.so.1").ZSTD_compress, (ctypes.c_int(3),)
    else:
        call, more = ctypes.CDLL("liblz4.so.1").LZ4F_compressFrame, (None,)
    call.restype = ctypes.c_size_t
    size = call(out, ctypes.c_size_t(len(out)), data, ctypes.c_size_t(len(data)), *more)
    assert 0 < size <= len(out), f"{compression} failed"
    return out.raw[:size]


def connections(stream):
    return list(dict.fromkeys((topic, kind) for topic, kind, _, _ in stream))


def write_ros1(path, stream, compression="none"):
    def record(data, **parts):
        head = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v for k, v in parts.items())
        return struct.pack("<I", len(head)) + head + struct.pack("<I", len(data)) + data

    number = lambda code, value: struct.pack("<" + code, value)
    stamp = lambda t: number("I", t // 10**9) + number("I", t % 10**9)
    topics = connections(stream)

    def connection(i):
        topic, kind = topics[i]
        text = {"topic": topic, "type": kind, "md5sum": "*", "message_definition": definition(kind, 1)}
        data = b"".join(struct.pack("<I", len(k) + 1 + len(v)) + k.encode() + b"=" + v.encode() for k, v in text.items())
        return record(data, op=b"\7", conn=number("I", i), topic=topic.encode())

    def head(index, chunks):
        parts = dict(op=b"\3", index_pos=number("Q", index), conn_count=number("I", len(topics)), chunk_count=number("I", chunks))
        size = len(record(b"", **parts))
        return record(b" " * (4096 - size), **parts)

    body, infos, told = bytearray(), [], set()
    start = 13 + len(head(0, 0))
    for begin in range(0, len(stream), 400):
        chunk, counts = bytearray(), {}
        for topic, kind, t, value in stream[begin:begin + 400]:
            i = topics.index((topic, kind))
            if i not in told:
                chunk += connection(i)
                told.add(i)
            counts[i] = counts.get(i, 0) + 1
            chunk += record(encode(kind, value, 1), op=b"\2", conn=number("I", i), time=stamp(t))
        packed = pack(compression, bytes(chunk))
        times = [t for _, _, t, _ in stream[begin:begin + 400]]
        infos.append(record(b"".join(number("I", i) + number("I", n) for i, n in counts.items()), op=b"\6", ver=number("I", 1),
                            chunk_pos=number("Q", start + len(body)), start_time=stamp(min(times)), end_time=stamp(max(times)),
                            count=number("I", len(counts))))
        body += record(packed, op=b"\5", compression=compression.encode(), size=number("I", len(chunk)))
    index = b"".join(connection(i) for i in range(len(topics))) + b"".join(infos)
    Path(path).write_bytes(b"#ROSBAG V2.0\n" + head(start + len(body), len(infos)) + body + index)


def write_official_ros1(path, stream, compression):
    """By Debian's python3-rosbag; ImportError where it is not installed."""
    import genpy
    import rosbag
    import roslib.message

    def fill(message, value):
        for name, one in (value or {}).items():
            if isinstance(one, dict):
                fill(getattr(message, name), one)
            elif name == "stamp":
                setattr(message, name, genpy.Time(one // 10**9, one % 10**9))
            elif isinstance(one, list) and one and isinstance(one[0], dict):
                part = roslib.message.get_message_class("geometry_msgs/TransformStamped")
                setattr(message, name, [fill(part(), item) for item in one])
            else:
                setattr(message, name, one)
        return message

    with rosbag.Bag(str(path), "w", compression=compression) as bag:
        for topic, kind, t, value in stream:
            bag.write(topic, fill(roslib.message.get_message_class(kind)(), value), genpy.Time(t // 10**9, t % 10**9))


def ros2_type(kind):
    return kind.replace("/", "/msg/")


def write_metadata(folder, name, storage, count):
    (folder / "metadata.yaml").write_text(
        f"rosbag2_bagfile_information:\n  version: 5\n  storage_identifier: {storage}\n  relative_file_paths:\n    - {name}\n"
        f"  message_count: {count}\n  compression_format: \"\"\n  compression_mode: \"\"\n")


def write_sqlite(folder, stream):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "drive_0.db3"
    path.unlink(missing_ok=True)
    topics = connections(stream)
    database = sqlite3.connect(path)
    database.execute("CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT NOT NULL, type TEXT NOT NULL, "
                     "serialization_format TEXT NOT NULL, offered_qos_profiles TEXT NOT NULL)")
    database.execute("CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER NOT NULL, timestamp INTEGER NOT NULL, data BLOB NOT NULL)")
    for i, (topic, kind) in enumerate(topics):
        database.execute("INSERT INTO topics VALUES (?, ?, ?, 'cdr', '')", (i + 1, topic, ros2_type(kind)))
    for topic, kind, t, value in stream:
        database.execute("INSERT INTO messages(topic_id, timestamp, data) VALUES (?, ?, ?)",
                         (topics.index((topic, kind)) + 1, t, encode(kind, value, 2)))
    database.commit()
    database.close()
    write_metadata(folder, path.name, "sqlite3", len(stream))


def write_mcap(folder, stream, compression=""):
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "drive_0.mcap"
    magic, text = b"\x89MCAP0\r\n", lambda s: struct.pack("<I", len(s)) + s.encode()
    record = lambda op, data: struct.pack("<BQ", op, len(data)) + data
    out = bytearray(magic + record(1, text("ros2") + text("test")))
    topics = connections(stream)
    for begin in range(0, len(stream), 400):
        chunk = bytearray()
        if begin == 0:
            for i, (topic, kind) in enumerate(topics):
                chunk += record(3, struct.pack("<H", i + 1) + text(ros2_type(kind)) + text("ros2msg") + text(definition(kind, 2)))
                chunk += record(4, struct.pack("<HH", i, i + 1) + text(topic) + text("cdr") + struct.pack("<I", 0))
        part = stream[begin:begin + 400]
        for topic, kind, t, value in part:
            chunk += record(5, struct.pack("<HIQQ", topics.index((topic, kind)), 0, t, t) + encode(kind, value, 2))
        times = [t for _, _, t, _ in part]
        packed = pack(compression, bytes(chunk))
        out += record(6, struct.pack("<QQQI", min(times), max(times), len(chunk), zlib.crc32(chunk)) + text(compression)
                      + struct.pack("<Q", len(packed)) + packed)
    out += record(15, struct.pack("<I", 0)) + record(2, struct.pack("<QQI", 0, 0, 0)) + magic
    path.write_bytes(out)
    write_metadata(folder, path.name, "mcap", len(stream))


def write_all(folder, stream):
    """Every kind of bag: name -> what import takes."""
    write_ros1(folder / "plain.bag", stream)
    write_ros1(folder / "packed.bag", stream, "bz2")
    write_sqlite(folder / "sqlite", stream)
    write_mcap(folder / "mcap", stream)
    return {"ROS 1": folder / "plain.bag", "ROS 1, bz2": folder / "packed.bag", "sqlite3": folder / "sqlite", "MCAP": folder / "mcap"}
