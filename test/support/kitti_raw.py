"""Writes a drive log of ours as a KITTI raw recording, from the documentation of the development kit alone: a recording that writer and
reader both agree on is right twice."""
import datetime
import math

from lcm_log import Types, events

RADIUS_M, FLATTENING = 6378137.0, 1 / 298.257223563  # WGS84
E2 = FLATTENING * (2 - FLATTENING)


def ecef(lat, lon, height):
    n = RADIUS_M / math.sqrt(1 - E2 * math.sin(lat) ** 2)
    return ((n + height) * math.cos(lat) * math.cos(lon), (n + height) * math.cos(lat) * math.sin(lon), (n * (1 - E2) + height) * math.sin(lat))


def geodetic(x, y, z):
    lon, p, height = math.atan2(y, x), math.hypot(x, y), 0.0
    lat = math.atan2(z, p * (1 - E2))
    for _ in range(8):
        n = RADIUS_M / math.sqrt(1 - E2 * math.sin(lat) ** 2)
        height = p / math.cos(lat) - n
        lat = math.atan2(z, p * (1 - E2 * n / (n + height)))
    return lat, lon, height


def place(pose):
    """Latitude, longitude (rad) and height of a pose in ENU."""
    lat, lon = math.radians(pose["anchor_lat_deg"]), math.radians(pose["anchor_lon_deg"])
    (x, y, z), (e, n, u) = ecef(lat, lon, pose["anchor_height_m"]), pose["position_m"]
    sl, cl, so, co = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return geodetic(x - so * e - sl * co * n + cl * co * u, y + co * e - sl * so * n + cl * so * u, z + cl * n + sl * u)


def matrix(q):
    w, x, y, z = q
    return [[1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)]]


def turned(R, v):
    return [sum(a * b for a, b in zip(row, v)) for row in R]


def transposed(R):
    return [list(column) for column in zip(*R)]


def product(A, B):
    return transposed([turned(A, column) for column in transposed(B)])


def axes(lat, lon):
    """East, north and up at a place as the columns of a matrix, in Earth-fixed axes."""
    sl, cl, so, co = math.sin(lat), math.cos(lat), math.sin(lon), math.cos(lon)
    return [[-so, -sl * co, cl * co], [co, -sl * so, cl * so], [0.0, cl, sl]]


def stamp(utime):
    second = datetime.datetime.fromtimestamp(utime // 10**6, datetime.timezone.utc)
    return second.strftime("%Y-%m-%d %H:%M:%S") + f".{utime % 10**6 * 1000:09d}"


def packet(pose, imu):
    """One line of oxts: roll positive left side up, pitch front down, yaw 0 in the east and counterclockwise."""
    lat, lon, height = place(pose)
    anchor = axes(math.radians(pose["anchor_lat_deg"]), math.radians(pose["anchor_lon_deg"]))
    R = product(transposed(axes(lat, lon)), product(anchor, matrix(pose["q_wxyz"])))  # level at the place, not at the anchor
    roll, pitch, yaw = math.atan2(R[2][1], R[2][2]), -math.asin(R[2][0]), math.atan2(R[1][0], R[0][0])
    east, north, up = turned(R, pose["velocity_mps"])
    forward, left, _ = pose["velocity_mps"]
    accel, gyro = imu["accel_mps2"], imu["gyro_radps"]
    numbers = [math.degrees(lat), math.degrees(lon), height, roll, pitch, yaw, north, east, forward, left, up, *accel, *accel, *gyro, *gyro, 0.02, 0.03]
    return " ".join(map(repr, numbers)) + " 4 10 6 6 6\n"


def write(root, log, day, seconds):
    """(folder of the drive, [(pose, imu)], pictures): packets at every reference that has an IMU sample of its time."""
    types, imu, poses, pictures = Types(root / "lcmtypes"), {}, {}, []
    for channel, _, data in events(log):
        if channel == "IMU":
            m = types.decode("imu_t", data)
            imu[m["utime"]] = m
        elif channel == "REFERENCE":
            m = types.decode("pose_t", data)
            poses[m["utime"]] = m
        elif channel == "CAMERA_LEFT":
            pictures.append(types.decode("image_t", data))
    last = min(poses) + seconds * 1_000_000
    packets = [(poses[t], imu[t]) for t in sorted(poses) if t in imu and t <= last]
    pictures = [m for m in pictures if m["utime"] <= last]
    drive = day / "2011_09_26_drive_0001_extract"
    (drive / "oxts" / "data").mkdir(parents=True)
    for i, (pose, sample) in enumerate(packets):
        (drive / "oxts" / "data" / f"{i:010}.txt").write_text(packet(pose, sample))
    (drive / "oxts" / "timestamps.txt").write_text("".join(stamp(pose["utime"]) + "\n" for pose, _ in packets))
    (drive / "image_00" / "data").mkdir(parents=True)
    ending = "jpg" if pictures[0]["format"] == 2 else "png"
    for i, m in enumerate(pictures):
        (drive / "image_00" / "data" / f"{i:010}.{ending}").write_bytes(bytes(m["data"]))
    (drive / "image_00" / "timestamps.txt").write_text("".join(stamp(m["utime"]) + "\n" for m in pictures))
    return drive, packets, pictures


def write_calibration(day, p_body_camera, q_body_camera, size, intrinsics, distortion):
    """The day's three files for a camera that is not rectified; the Velodyne between IMU and camera is anywhere."""
    R_camera_body = transposed(matrix(q_body_camera))
    t_camera_body = [-v for v in turned(R_camera_body, p_body_camera)]
    R_velo_imu, t_velo_imu = matrix((math.cos(0.02), 0.0, 0.0, math.sin(0.02))), [-0.81, 0.32, -0.79]
    R_camera_velo = product(R_camera_body, transposed(R_velo_imu))
    t_camera_velo = [a - b for a, b in zip(t_camera_body, turned(R_camera_velo, t_velo_imu))]
    line = lambda name, numbers: f"{name}: " + " ".join(f"{v:.9e}" for v in numbers) + "\n"
    flat = lambda R: [v for row in R for v in row]
    (day / "calib_imu_to_velo.txt").write_text("calib_time: 25-May-2012 16:47:16\n" + line("R", flat(R_velo_imu)) + line("T", t_velo_imu))
    (day / "calib_velo_to_cam.txt").write_text("calib_time: 15-Mar-2012 11:37:16\n" + line("R", flat(R_camera_velo)) + line("T", t_camera_velo)
                                               + "delta_f: 0 0\ndelta_c: 0 0\n")
    fx, fy, cx, cy = intrinsics
    still = [1, 0, 0, 0, 1, 0, 0, 0, 1]
    (day / "calib_cam_to_cam.txt").write_text(
        "calib_time: 09-Jan-2012 13:57:47\n" + line("S_00", size) + line("K_00", [fx, 0, cx, 0, fy, cy, 0, 0, 1]) + line("D_00", distortion)
        + line("R_00", still) + line("T_00", [0, 0, 0]) + line("S_rect_00", [size[0] - 20, size[1] - 12]))
