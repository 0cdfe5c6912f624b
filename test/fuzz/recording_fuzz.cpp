// Whatever bytes stand in the files of KITTI raw and comma2k19, the readers give values or a ConfigError that names the
// file. The first byte chooses a reader.
#include <cmath>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <string>

#include "config/config_error.h"
#include "roadfix/import/kitti_calib.h"
#include "roadfix/import/kitti_oxts.h"
#include "roadfix/import/npy.h"

namespace {

using namespace roadfix;

void require(bool holds, const char* what) {
  if (!holds) throw std::logic_error(what);
}

void read_calib(const std::string& text) {
  const KittiCalib calib(text, "fuzz");
  const KittiCamera camera = kitti_camera(calib, 0, 8, 6, SE3{});
  require(camera.calibration.mounting->p.allFinite(), "a camera sits nowhere");
  require(std::abs(camera.calibration.mounting->q_wxyz.norm() - 1.0) < 1e-9, "a mounting is no rotation");
}

void read_packet(const std::string& text) {
  const OxtsPacket packet = parse_oxts(text, "fuzz");
  require(packet.gyro.allFinite() && packet.accel.allFinite() && packet.velocity_enu.allFinite(), "NaN came through");
  require(std::abs(packet.q_enu_imu.norm() - 1.0) < 1e-9, "an attitude is no rotation");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, std::size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> rest(data + 1, size - 1);
  const std::string text(rest.begin(), rest.end());
  try {
    switch (data[0]) {
      case 'n': {
        const NpyArray array = parse_npy(rest, "fuzz");
        require(array.numbers.size() == array.rows * array.columns, "an array is not of its shape");
        break;
      }
      case 'o':
        read_packet(text);
        break;
      case 't':
        require(!parse_kitti_times(text, "fuzz").empty(), "no times and no error");
        break;
      default:
        read_calib(text);
        break;
    }
  } catch (const ConfigError& e) {
    require(std::string(e.what()).starts_with("fuzz"), "an error without a file");
  }
  return 0;
}
