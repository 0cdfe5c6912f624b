#include "drivers/device/run_driver.h"
#include "drivers/imu_driver/handler.h"

int main(int argc, char** argv) {
  roadfix::DriverProgram program;
  program.name = "imu_driver";
  program.description =
      "IMU from an SBG Ellipse (sbgECom): publishes IMU and RAW_IMU, on request GNSS and its own pose";
  program.footer =
      "Devices: /dev/ttyUSB0, tcp:HOST:PORT, file:PATH (raw bytes), pty: (a pseudo-terminal; its name is said).\n"
      "Logs used: IMU_SHORT; GPS1_POS, GPS1_VEL, GPS1_HDT with gnss_channel; EKF_QUAT, EKF_NAV with solution_channel.\n"
      "Again from a log's raw bytes: imu_driver --config DIR --log-in drive.lcm --log-out imu.lcm";
  program.read = [](const std::filesystem::path& vehicle, const std::string& device) {
    return roadfix::imu_driver_setup(vehicle, device);
  };
  return roadfix::run_driver(argc, argv, program);
}
