#include "roadfix/import/drive_folder.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>

#include "config/config_error.h"
#include "config/key_hint.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/import/csv_reader.h"
#include "roadfix/import/fix_type.h"
#include "roadfix/import/wheel_csv.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

// Bounds of what a road vehicle can meet; they catch a wrong unit (deg/s, g, km/h, gauss) or a slipped column.
constexpr double kMaxRate = 100.0;      // rad/s
constexpr double kMaxAccel = 1000.0;    // m/s2
constexpr double kMaxSpeed = 150.0;     // m/s
constexpr double kMaxSigma = 1e5;       // m or m/s: a receiver that knows nothing
constexpr double kMinHeight = -1000.0;  // m, ellipsoid
constexpr double kMaxHeight = 20000.0;  // m
constexpr double kMaxField = 10000.0;   // uT
constexpr double kTeslaPerMicrotesla = 1e-6;
constexpr double kStandardGravity = 9.80665;  // m/s2, what a sensor's g is (CGPM 1901)

/// The file or its .gz; nothing where neither is there.
std::optional<fs::path> find_csv(const fs::path& folder, const std::string& name) {
  const fs::path plain = folder / name;
  const fs::path packed = folder / (name + ".gz");
  const bool has_plain = fs::exists(plain);
  const bool has_packed = fs::exists(packed);
  if (has_plain && has_packed) throw ConfigError(plain.string(), 0, "is there twice, plain and as .gz");
  if (has_plain) return plain;
  if (has_packed) return packed;
  return std::nullopt;
}

Eigen::Vector3d vector3(const CsvReader& csv, int first, int second, int third, double bound) {
  return {csv.number(first, -bound, bound), csv.number(second, -bound, bound), csv.number(third, -bound, bound)};
}

double normalized_longitude(double longitude) { return longitude >= kPi ? longitude - 2.0 * kPi : longitude; }

/// Three columns of one quantity, in SI or in the unit that the other names say.
class AxisColumns {
 public:
  AxisColumns(const CsvReader& csv, const std::string& quantity, const std::string& si, const std::string& other,
              double unit)
      : unit_(csv.has(quantity + "_x_" + other) ? unit : 1.0) {
    const bool in_si = csv.has(quantity + "_x_" + si);
    if (in_si == csv.has(quantity + "_x_" + other)) {
      csv.fail(fmt::format("must have either {0}_x_{1}, {0}_y_{1}, {0}_z_{1} or {0}_x_{2}, {0}_y_{2}, {0}_z_{2}",
                           quantity, si, other));
    }
    for (std::size_t i = 0; i < 3; ++i) {
      columns_[i] = csv.index(fmt::format("{}_{}_{}", quantity, "xyz"[i], in_si ? si : other));
    }
  }

  [[nodiscard]] Eigen::Vector3d read(const CsvReader& csv, double bound) const {
    return unit_ * vector3(csv, columns_[0], columns_[1], columns_[2], bound / unit_);
  }

 private:
  double unit_;
  std::array<int, 3> columns_{};
};

std::vector<std::string> axes(const std::string& quantity, const std::string& unit) {
  return {quantity + "_x_" + unit, quantity + "_y_" + unit, quantity + "_z_" + unit};
}

std::vector<ImuSample> read_imu(const fs::path& path) {
  CsvReader csv(
      path, {{"utime_us"}, {axes("gyro", "radps"), axes("gyro", "degps"), axes("accel", "mps2"), axes("accel", "g")}});
  const AxisColumns gyro(csv, "gyro", "radps", "degps", kDegree);
  const AxisColumns accel(csv, "accel", "mps2", "g", kStandardGravity);
  const int t = csv.index("utime_us");
  std::vector<ImuSample> samples;
  samples.reserve(csv.expected_rows());
  while (csv.next()) samples.push_back({csv.utime(t), gyro.read(csv, kMaxRate), accel.read(csv, kMaxAccel)});
  return samples;
}

/// Columns of gnss.csv and reference.csv that say where.
class PositionColumns {
 public:
  explicit PositionColumns(const CsvReader& csv)
      : lat_(csv.index("lat_deg")), lon_(csv.index("lon_deg")), height_(csv.index("height_m")) {}

  [[nodiscard]] Geodetic read(const CsvReader& csv) const {
    return {csv.number(lat_, -90.0, 90.0) * kDegree, normalized_longitude(csv.number(lon_, -180.0, 180.0) * kDegree),
            csv.number(height_, kMinHeight, kMaxHeight)};
  }

 private:
  int lat_;
  int lon_;
  int height_;
};

std::vector<std::string> velocity_columns() { return {"vel_e_mps", "vel_n_mps", "vel_u_mps"}; }

Eigen::Vector3d read_velocity(const CsvReader& csv) {
  return vector3(csv, csv.index("vel_e_mps"), csv.index("vel_n_mps"), csv.index("vel_u_mps"), kMaxSpeed);
}

Eigen::Matrix3d square_diagonal(const Eigen::Vector3d& sigma) { return sigma.cwiseAbs2().asDiagonal(); }

std::vector<GnssFix> read_gnss(const fs::path& path, HeightKind height_kind) {
  CsvReader csv(path, {{"utime_us", "lat_deg", "lon_deg", "height_m", "std_e_m", "std_n_m", "std_u_m", "fix_type"},
                       {velocity_columns(), {"std_vel_mps"}, {"heading_deg", "std_heading_deg"}, {"num_satellites"}}});
  const PositionColumns position(csv);
  const int t = csv.index("utime_us");
  const bool has_velocity = csv.has("vel_e_mps");
  if (csv.has("std_vel_mps") && !has_velocity) csv.fail("column std_vel_mps is there without vel_e_mps");
  std::vector<GnssFix> fixes;
  while (csv.next()) {
    GnssFix fix;
    fix.t_us = csv.utime(t);
    fix.height_kind = height_kind;
    fix.antenna = position.read(csv);
    const auto sigma = [&](const char* column) { return csv.number(csv.index(column), 0.0, kMaxSigma); };
    fix.cov_enu = square_diagonal({sigma("std_e_m"), sigma("std_n_m"), sigma("std_u_m")});
    const int type = csv.index("fix_type");
    const auto fix_type = fix_type_from_name(csv.text(type));
    if (!fix_type) csv.fail(type, fmt::format("must be one of {}", fmt::join(fix_type_names(), ", ")));
    fix.fix_type = *fix_type;
    if (has_velocity) fix.velocity = GnssVelocity{read_velocity(csv), Eigen::Matrix3d::Zero()};
    if (csv.has("std_vel_mps"))
      fix.velocity->cov_enu = square_diagonal(Eigen::Vector3d::Constant(sigma("std_vel_mps")));
    if (csv.has("heading_deg")) {
      fix.heading = GnssHeading{csv.number(csv.index("heading_deg"), 0.0, 360.0) * kDegree,
                                csv.number(csv.index("std_heading_deg"), 0.0, 180.0) * kDegree};
    }
    if (csv.has("num_satellites")) {
      fix.num_satellites = static_cast<int>(csv.integer(csv.index("num_satellites"), 0, 1000));
    }
    fixes.push_back(fix);
  }
  return fixes;
}

std::vector<MagSample> read_mag(const fs::path& path) {
  CsvReader csv(path, {{"utime_us", "mag_x_ut", "mag_y_ut", "mag_z_ut"}});
  const int t = csv.index("utime_us");
  std::vector<MagSample> samples;
  while (csv.next()) {
    const Eigen::Vector3d field_ut =
        vector3(csv, csv.index("mag_x_ut"), csv.index("mag_y_ut"), csv.index("mag_z_ut"), kMaxField);
    samples.push_back({csv.utime(t), field_ut * kTeslaPerMicrotesla});
  }
  return samples;
}

std::vector<FrameFile> read_frames(const fs::path& path, const fs::path& folder) {
  CsvReader csv(path, {{"utime_us", "file"}});
  const int t = csv.index("utime_us");
  const int file = csv.index("file");
  std::vector<FrameFile> frames;
  while (csv.next()) {
    const fs::path picture = folder / fs::path(std::string(csv.text(file)));
    std::error_code ignored;
    if (csv.text(file).empty() || !fs::is_regular_file(picture, ignored)) csv.fail(file, "no such file");
    frames.push_back({csv.utime(t), picture});
  }
  return frames;
}

std::vector<ReferencePoint> read_reference(const fs::path& path, const ReferenceDescription& description) {
  CsvReader csv(path, {{"utime_us", "lat_deg", "lon_deg", "height_m"}, {velocity_columns(), {"qw", "qx", "qy", "qz"}}});
  if (description.attitude && !csv.has("qw")) csv.fail("has no qw,qx,qy,qz, but drive.yaml says reference.attitude");
  const PositionColumns position(csv);
  const int t = csv.index("utime_us");
  std::vector<ReferencePoint> points;
  while (csv.next()) {
    ReferencePoint point{csv.utime(t), position.read(csv), std::nullopt, std::nullopt};
    if (csv.has("vel_e_mps")) point.velocity_enu = read_velocity(csv);
    if (description.attitude) {
      const auto part = [&](const char* column) { return csv.number(csv.index(column), -1.001, 1.001); };
      const Eigen::Quaterniond q(part("qw"), part("qx"), part("qy"), part("qz"));
      if (std::abs(q.norm() - 1.0) > 1e-3) csv.fail(csv.index("qw"), "the quaternion must have unit norm");
      point.q_enu_body = normalized_positive(q);
    }
    points.push_back(point);
  }
  return points;
}

/// A misspelt file would be a sensor silently left out.
void refuse_unknown_csv(const fs::path& folder) {
  const std::vector<std::string> known = {"imu.csv",         "gnss.csv",         "wheels.csv",   "mag.csv",
                                          "frames_left.csv", "frames_right.csv", "reference.csv"};
  std::set<std::string> names;  // directory order differs between machines
  for (const auto& entry : fs::directory_iterator(folder)) names.insert(entry.path().filename().string());
  for (const std::string& name : names) {
    const std::string plain = name.ends_with(".gz") ? name.substr(0, name.size() - 3) : name;
    if (!plain.ends_with(".csv") || std::find(known.begin(), known.end(), plain) != known.end()) continue;
    const std::string hint = closest_key(plain, known);
    throw ConfigError((folder / name).string(), 0,
                      hint.empty() ? fmt::format("is not part of a drive folder: {}", fmt::join(known, ", "))
                                   : fmt::format("is not part of a drive folder, did you mean {}?", hint));
  }
}

}  // namespace

DriveFolder read_drive_folder(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_directory(folder, ignored)) throw ConfigError(folder.string(), 0, "no such folder");
  const fs::path yaml = folder / "drive.yaml";
  Drive drive;
  drive.format = "folder";
  drive.description = parse_drive_description(read_text_file(yaml), yaml.string());
  if (drive.description.name.empty()) drive.description.name = fs::weakly_canonical(folder).filename().string();
  refuse_unknown_csv(folder);
  const auto& gnss = drive.description.calibration.sensors.gnss;
  const HeightKind height = gnss ? gnss->height.value_or(HeightKind::kUnknown) : HeightKind::kUnknown;
  const ReferenceDescription& reference = drive.description.reference;
  const auto find = [&](const std::string& name) {
    auto path = find_csv(folder, name + ".csv");
    if (path) drive.files[name] = *path;
    return path;
  };
  if (const auto path = find("imu")) drive.imu = read_imu(*path);
  if (const auto path = find("gnss")) drive.gnss = read_gnss(*path, height);
  if (const auto path = find("wheels"))
    drive.wheels = read_wheel_csv(*path, drive.description.calibration.sensors.wheels, drive.remarks);
  if (const auto path = find("mag")) drive.mag = read_mag(*path);
  if (const auto path = find("frames_left")) drive.frames_left = read_frames(*path, folder);
  if (const auto path = find("frames_right")) drive.frames_right = read_frames(*path, folder);
  const auto reference_path = find("reference");
  if (reference_path) drive.reference = read_reference(*reference_path, reference);
  if (!reference_path && reference.of != ReferenceOf::kNone) {
    throw ConfigError((folder / "reference.csv").string(), 0, "no such file, but drive.yaml has reference.of");
  }
  if (reference_path && reference.of == ReferenceOf::kNone) {
    throw ConfigError(yaml.string(), 0, "reference.of must say what reference.csv is of: imu, antenna or rear_axle");
  }
  if (drive.imu.empty() && drive.gnss.empty() && drive.wheels.empty() && drive.mag.empty() &&
      drive.frames_left.empty() && drive.frames_right.empty()) {
    throw ConfigError(folder.string(), 0, "holds no sensor: imu.csv, gnss.csv, wheels.csv, mag.csv or frames_left.csv");
  }
  return drive;
}

}  // namespace roadfix
