#include "drivers/device/run_driver.h"
#include "drivers/wheel_driver/handler.h"

int main(int argc, char** argv) {
  roadfix::DriverProgram program;
  program.name = "wheel_driver";
  program.description =
      "Wheel speeds from a CAN bus by a mapping in wheel_driver.yaml: publishes WHEELS and RAW_WHEELS";
  program.footer =
      "Devices: can:can0 (SocketCAN), candump:PATH (lines of candump -L at their pace), file:PATH, pty:.\n"
      "Again from a log's raw frames: wheel_driver --config DIR --log-in drive.lcm --log-out wheels.lcm";
  program.read = [](const std::filesystem::path& vehicle, const std::string& device) {
    return roadfix::wheel_driver_setup(vehicle, device);
  };
  return roadfix::run_driver(argc, argv, program);
}
