#include "drivers/camera_driver/handler.h"
#include "drivers/device/run_driver.h"

int main(int argc, char** argv) {
  roadfix::DriverProgram program;
  program.name = "camera_driver";
  program.description = "One camera, or two: V4L2, a video file or picture files to CAMERA_LEFT and CAMERA_RIGHT";
  program.footer =
      "Devices: /dev/video0, drive.mp4, frames/%06d.png. What the camera can: v4l2-ctl --list-formats-ext.\n"
      "Again from a log's raw pictures (publish_raw: true): camera_driver --config DIR --log-in IN --log-out OUT";
  program.read = [](const std::filesystem::path& vehicle, const std::string& device) {
    return roadfix::camera_driver_setup(vehicle, device);
  };
  return roadfix::run_driver(argc, argv, program);
}
