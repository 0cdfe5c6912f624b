"""Definitions of types that a log of ours does not become by itself, for bags of the tests. From the packages' documentation."""
import struct
import zlib

import ros_bags

GPS_STATUS = ("std_msgs/Header header\nuint16 satellites_used\nint32[] satellite_used_prn\nuint16 satellites_visible\n"
              "int32[] satellite_visible_prn\nint32[] satellite_visible_z\nint32[] satellite_visible_azimuth\n"
              "int32[] satellite_visible_snr\nint16 STATUS_NO_FIX=-1 # a constant\nint16 status\nuint16 motion_source\n"
              "uint16 orientation_source\nuint16 position_source")
GPS_FIX = "std_msgs/Header header\n{}/GPSStatus status\n" + "".join(
    f"float64 {name}\n" for name in ("latitude longitude altitude track speed climb pitch roll dip time gdop pdop hdop vdop tdop err "
                                     "err_horz err_vert err_track err_speed err_climb err_time err_pitch err_roll err_dip").split()
) + "float64[9] position_covariance\nuint8 COVARIANCE_TYPE_KNOWN = 3\nuint8 position_covariance_type"
NAV_PVT = ("uint32 i_tow\nuint16 year\nuint8 month\nuint8 day\nuint8 hour\nuint8 min\nuint8 sec\nuint8 valid\nuint32 t_acc\nint32 nano\n"
           "uint8 fix_type\nuint8 flags\nuint8 flags2\nuint8 num_sv\nint32 lon\nint32 lat\nint32 height\nint32 h_msl\nuint32 h_acc\n"
           "uint32 v_acc\nint32 vel_n\nint32 vel_e\nint32 vel_d\nint32 g_speed\nint32 heading\nuint32 s_acc\nuint32 head_acc\n"
           "uint16 p_dop\nuint8[6] reserved1\nint32 head_veh\nint16 mag_dec\nuint16 mag_acc")
# ublox_msgs of ROS 1 has these names, in the same order.
CAMEL = {"i_tow": "iTOW", "t_acc": "tAcc", "fix_type": "fixType", "num_sv": "numSV", "h_msl": "hMSL", "h_acc": "hAcc", "v_acc": "vAcc",
         "vel_n": "velN", "vel_e": "velE", "vel_d": "velD", "g_speed": "gSpeed", "s_acc": "sAcc", "head_acc": "headAcc", "p_dop": "pDOP",
         "head_veh": "headVeh", "mag_dec": "magDec", "mag_acc": "magAcc"}
CAMERA_INFO = ("std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] {}\nfloat64[9] {}\nfloat64[9] {}\n"
               "float64[12] {}\nuint32 binning_x\nuint32 binning_y\nsensor_msgs/RegionOfInterest roi")

ros_bags.DEFINITIONS.update({
    "sensor_msgs/Image": "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\nuint32 step\nuint8[] data",
    "sensor_msgs/RegionOfInterest": "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify",
    ("sensor_msgs/CameraInfo", 1): CAMERA_INFO.format("D", "K", "R", "P"),
    ("sensor_msgs/CameraInfo", 2): CAMERA_INFO.format("d", "k", "r", "p"),
    "geometry_msgs/PoseStamped": "std_msgs/Header header\ngeometry_msgs/Pose pose",
    "gps_common/GPSStatus": GPS_STATUS, "gps_msgs/GPSStatus": GPS_STATUS,
    "gps_common/GPSFix": GPS_FIX.format("gps_common"), "gps_msgs/GPSFix": GPS_FIX.format("gps_msgs"),
    "mavros_msgs/GPSRAW": "std_msgs/Header header\nuint8 fix_type\nint32 lat\nint32 lon\nint32 alt\nuint16 eph\nuint16 epv\nuint16 vel\n"
                          "uint16 cog\nuint8 satellites_visible\nint32 alt_ellipsoid\nuint32 h_acc\nuint32 v_acc\nuint32 vel_acc\n"
                          "int32 hdg_acc\nuint16 yaw\nuint8 dgps_numch\nuint32 dgps_age",
    ("ublox_msgs/NavPVT", 2): NAV_PVT,
    ("ublox_msgs/NavPVT", 1): "\n".join(" ".join([line.split()[0], CAMEL.get(line.split()[1], line.split()[1])])
                                        for line in NAV_PVT.split("\n")),
})


def both_names(value):
    """A message whose fields are found by the names of ROS 1 and of ROS 2."""
    return {**value, **{CAMEL[name]: one for name, one in value.items() if name in CAMEL}}


def png_pixels(data):
    """(width, height, channels, bytes row by row) of a PNG of 8 bits, after its specification, sections 5, 9 and 11."""
    at, packed, header = 8, b"", None
    while at < len(data):
        size, kind = struct.unpack(">I4s", data[at:at + 8])
        body = data[at + 8:at + 8 + size]
        if kind == b"IHDR":
            header = struct.unpack(">IIBB", body[:10])
        packed += body if kind == b"IDAT" else b""
        at += 12 + size
    width, height, depth, colour = header
    assert depth == 8 and colour in (0, 2), header
    channels = 3 if colour == 2 else 1
    rows, raw, before = b"", zlib.decompress(packed), bytes(width * channels)
    for y in range(height):
        begin = y * (width * channels + 1)
        before = unfilter(raw[begin], raw[begin + 1:begin + 1 + width * channels], before, channels)
        rows += before
    return width, height, channels, rows


def unfilter(kind, line, above, channels):
    out = bytearray(line)
    for i in range(len(out)):
        a = out[i - channels] if i >= channels else 0
        b, c = above[i], above[i - channels] if i >= channels else 0
        p = a + b - c
        paeth = min((abs(p - a), 0, a), (abs(p - b), 1, b), (abs(p - c), 2, c))[2]
        out[i] = (out[i] + (0, a, b, (a + b) // 2, paeth)[kind]) & 0xFF
    return bytes(out)
