#include "drivers/device/run_driver.h"
#include "drivers/gnss_driver/handler.h"

int main(int argc, char** argv) {
  roadfix::DriverProgram program;
  program.name = "gnss_driver";
  program.description = "GNSS from a receiver's NMEA 0183 and UBX: publishes GNSS and RAW_GNSS";
  program.footer =
      "Devices: /dev/ttyACM0, tcp:HOST:PORT, file:PATH (raw bytes), pty: (a pseudo-terminal; its name is said).\n"
      "Try it without a receiver: gnss_driver --config configs/example --device pty:\n"
      "Again from a log's raw bytes: gnss_driver --config DIR --log-in drive.lcm --log-out gnss.lcm";
  program.read = [](const std::filesystem::path& vehicle, const std::string& device) {
    return roadfix::gnss_driver_setup(vehicle, device);
  };
  return roadfix::run_driver(argc, argv, program);
}
