// roadfix place: where the car stands, for a start without GNSS.
#include <CLI/CLI.hpp>
#include <cstdlib>
#include <iostream>
#include <memory>

#include "bus/run/run_clock.h"
#include "bus/transport/network_bus.h"
#include "geometry/frames.h"
#include "geometry/so3.h"
#include "roadfix/commands.h"
#include "roadfix/common_options.h"
#include "roadfix/place/place.h"

namespace roadfix {
namespace {

struct PlaceOptions {
  double latitude_deg = 0.0, longitude_deg = 0.0, heading_deg = 0.0;
  std::optional<double> height_m;
  double std_m = 3.0, height_std_m = 5.0, heading_std_deg = 5.0;
  double wait_s = 3.0;
  std::string url;
};

constexpr double kAnyHeight_m = 0.0, kAnyHeightStd_m = 3000.0;  // of roads, where nobody knows it

void run_place(const PlaceOptions& o) {
  RunClock clock;
  PriorPose told;
  told.place = {o.latitude_deg * kDegree, o.longitude_deg * kDegree, o.height_m.value_or(kAnyHeight_m)};
  const double up = o.height_m ? o.height_std_m : kAnyHeightStd_m;
  told.cov_enu = Eigen::Vector3d(o.std_m, o.std_m, up).cwiseAbs2().asDiagonal();
  told.yaw = wrap_angle(0.5 * kPi - o.heading_deg * kDegree);
  told.yaw_std = o.heading_std_deg * kDegree;
  NetworkBus bus(o.url);
  told.t_us = clock.now_utime();
  const PlaceAnswer answer =
      tell_place(bus, told, clock.run(), std::chrono::milliseconds(std::llround(1e3 * o.wait_s)));
  std::cout << answer.text << "\n";
  if (!answer.used) throw CLI::RuntimeError(kNotGood);
}

}  // namespace

void add_place_command(CLI::App& app) {
  const auto options = std::make_shared<PlaceOptions>();
  const char* url = std::getenv("LCM_DEFAULT_URL");
  options->url = url != nullptr ? url : kDefaultBusUrl;
  CLI::App* command = app.add_subcommand(
      "place", "Tell the running gnss_ins_ekf where the car is and heads (PRIOR_POSE): in a garage, without GNSS");
  command->add_option("latitude", options->latitude_deg, "deg, WGS84")->required()->check(CLI::Range(-90.0, 90.0));
  command->add_option("longitude", options->longitude_deg, "deg")->required()->check(CLI::Range(-180.0, 180.0));
  command->add_option("heading", options->heading_deg, "deg, clockwise from true north")
      ->required()
      ->check(CLI::Range(-180.0, 360.0));
  command->add_option("--height-m", options->height_m, "above the ellipsoid; absent: unknown")
      ->check(CLI::Range(-500.0, 9000.0));
  command->add_option("--std-m", options->std_m, "sigma of the place, east and north")
      ->check(CLI::Range(0.01, 1e5))
      ->capture_default_str();
  command->add_option("--height-std-m", options->height_std_m, "sigma of the height")
      ->check(CLI::Range(0.01, 1e4))
      ->capture_default_str();
  command->add_option("--heading-std-deg", options->heading_std_deg, "sigma of the heading")
      ->check(CLI::Range(0.01, 180.0))
      ->capture_default_str();
  command->add_option("--wait-s", options->wait_s, "for an answer")
      ->check(CLI::Range(0.1, 600.0))
      ->capture_default_str();
  command->add_option("--bus", options->url, "LCM URL")->capture_default_str();
  command->footer("Exit status: 0 it was used, 1 it was not (standard output says why), 2 wrong usage.");
  command->callback([options] { run_place(*options); });
}

}  // namespace roadfix
