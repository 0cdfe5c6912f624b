#include "small_drive.h"

#include <fmt/format.h>
#include <zlib.h>

#include <fstream>
#include <iterator>

namespace roadfix::test {
namespace {

namespace fs = std::filesystem;

constexpr const char* kDriveYaml = R"(name: small
origin: written by a test
body_origin: imu
sensors:
  imu: {rate_hz: 20, gyro_noise_radps_per_rthz: 1.0e-4}
  gnss: {rate_hz: 4, lever_arm_body_m: [0.1, 0.2, 1.0], height: ellipsoid}
  wheels: {rate_hz: 10, speed_scale_std: 0.01}
  mag: {declination_deg: 3}
  camera_left: {rate_hz: 1, width_px: 4, height_px: 2}
mounting: {std_deg: [2, 2, 1]}
reference: {of: imu, attitude: true, sigma_m: 0.01}
score: {skip_s: 1, fix_types: [rtk_fixed]}
windows:
  - {length_s: 0.5, first_s: 1, every_s: 1, phases_s: [0, 0.5]}
)";

std::string big_endian(uint32_t value) {
  return {static_cast<char>(value >> 24U), static_cast<char>(value >> 16U), static_cast<char>(value >> 8U),
          static_cast<char>(value)};
}

std::string png_chunk(const std::string& type, const std::string& data) {
  const std::string body = type + data;
  const auto crc =
      static_cast<uint32_t>(crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size())));
  return big_endian(static_cast<uint32_t>(data.size())) + body + big_endian(crc);
}

}  // namespace

void write_file(const fs::path& path, const std::string& text) {
  std::ofstream stream(path, std::ios::binary);
  stream << text;
}

void write_gzip(const fs::path& path, const std::string& text) {
  gzFile file = gzopen(path.c_str(), "wb");
  gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
  gzclose(file);
}

std::string read_file(const fs::path& path) {
  std::ifstream stream(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(stream), std::istreambuf_iterator<char>()};
}

std::string tiny_png(int width, int height) {
  std::string rows;
  for (int y = 0; y < height; ++y) rows += std::string(1, '\0') + std::string(static_cast<std::size_t>(width), 'g');
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  std::string packed(size, '\0');
  compress(reinterpret_cast<Bytef*>(packed.data()), &size, reinterpret_cast<const Bytef*>(rows.data()),
           static_cast<uLong>(rows.size()));
  packed.resize(size);
  const std::string header = big_endian(static_cast<uint32_t>(width)) + big_endian(static_cast<uint32_t>(height)) +
                             std::string("\x08\x00\x00\x00\x00", 5);  // 8 bits, gray
  return "\x89PNG\r\n\x1a\n" + png_chunk("IHDR", header) + png_chunk("IDAT", packed) + png_chunk("IEND", "");
}

void write_small_drive(const fs::path& folder) {
  const auto at = [](int64_t ms) { return kSmallDriveStart + ms * 1000; };
  write_file(folder / "drive.yaml", kDriveYaml);
  std::string imu = "utime_us,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2\n";
  for (int i = 0; i < 60; ++i) imu += fmt::format("{},0.001,-0.002,0.1,{},0.02,9.81\n", at(50 * i), 0.01 * i);
  write_file(folder / "imu.csv", imu);
  std::string gnss =
      "utime_us,lat_deg,lon_deg,height_m,std_e_m,std_n_m,std_u_m,vel_e_mps,vel_n_mps,vel_u_mps,std_vel_mps,heading_deg,"
      "std_heading_deg,fix_type,num_satellites\n";
  std::string reference = "utime_us,lat_deg,lon_deg,height_m,vel_e_mps,vel_n_mps,vel_u_mps,qw,qx,qy,qz\n";
  for (int i = 0; i < 12; ++i) {
    gnss += fmt::format("{},{:.9f},11.5,500.25,0.01,0.02,0.03,0.5,10,0,0.05,2.5,0.5,{},12\n", at(250 * i),
                        48.1 + i * 2.25e-5, i == 2 ? "rtk_float" : "rtk_fixed");
    reference +=
        fmt::format("{},{:.9f},11.5,499.25,0.5,10,0,0.7071067812,0,0,0.7071067812\n", at(250 * i), 48.1 + i * 2.25e-5);
  }
  write_file(folder / "gnss.csv", gnss);
  write_file(folder / "reference.csv", reference);
  std::string wheels = "utime_us,front_left_mps,front_right_mps,rear_left_mps,rear_right_mps,yaw_rate_radps\n";
  std::string mag = "utime_us,mag_x_ut,mag_y_ut,mag_z_ut\n";
  for (int i = 0; i < 30; ++i) {
    wheels += fmt::format("{},10.1,10.2,10.0,{},0.01\n", at(100 * i + 5), 10.05);
    mag += fmt::format("{},20,-3,-42.5\n", at(100 * i + 7));
  }
  write_file(folder / "wheels.csv", wheels);
  write_file(folder / "mag.csv", mag);
  fs::create_directories(folder / "images");
  for (const char* name : {"l0.png", "l1.png", "r0.png", "r1.png"})
    write_file(folder / "images" / name, tiny_png(4, 2));
  write_file(folder / "frames_left.csv",
             fmt::format("utime_us,file\n{},images/l0.png\n{},images/l1.png\n", at(100), at(1100)));
  write_file(folder / "frames_right.csv",
             fmt::format("utime_us,file\n{},images/r0.png\n{},images/r1.png\n", at(100), at(1100)));
}

}  // namespace roadfix::test
