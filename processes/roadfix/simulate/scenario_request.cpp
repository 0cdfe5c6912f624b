#include "roadfix/simulate/scenario_request.h"

#include <fmt/format.h>

#include <cstdio>
#include <stdexcept>

#include "roadfix/simulate/scenario_file.h"

namespace roadfix {
namespace {

void set_camera(const ScenarioRequest& request, CameraConfig& camera) {
  if (request.camera) camera.layout = *request.camera;
  if (request.camera_rate_hz > 0.0) camera.rate_hz = request.camera_rate_hz;
  if (request.lossless) camera.lossless = true;
  if (request.picture_size.empty()) return;
  int width = 0;
  int height = 0;
  char end = 0;
  if (std::sscanf(request.picture_size.c_str(), "%4dx%4d%c", &width, &height, &end) != 2 || width < 64 || height < 48)
    throw std::runtime_error("--picture-size is WIDTHxHEIGHT, at least 64x48, not " + request.picture_size);
  camera = with_size(camera, width, height);
}

}  // namespace

ScenarioConfig configured_scenario(const ScenarioRequest& request, std::vector<std::string>& remarks) {
  ScenarioConfig config = load_scenario(request.scenario);
  if (request.duration_s > 0.0) config.duration_s = request.duration_s;
  set_camera(request, config.camera);
  for (const std::string& text : request.faults) {
    config.faults.push_back(parse_fault(text));
    const Fault& fault = config.faults.back();
    const bool blind = fault.sensor == Sensor::kCamera && config.camera.layout == CameraLayout::kNone;
    if (fault.start_s < config.duration_s && !blind) continue;
    remarks.push_back(
        fmt::format("fault {} never acts: {}", text,
                    blind ? "there is no camera" : fmt::format("the drive ends at {} s", config.duration_s)));
  }
  return config;
}

}  // namespace roadfix
