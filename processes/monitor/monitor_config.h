/// configs/VEHICLE/monitor.yaml: what the vehicle should have, when to complain, and where the dashboard is.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "health/health_config.h"

namespace roadfix {

struct DashboardConfig {
  std::string listen = "127.0.0.1:8420";  ///< address:port; other addresses only with a token
  std::string token_file;  ///< the token that other addresses need; empty: a new one at each start, printed
  double rate = 5.0;       ///< Hz
  std::string camera;      ///< the channel whose pictures are shown; empty: CAMERA_LEFT, else the first one received
  int clients = 32;        ///< connections at once
};

struct MonitorConfig {
  HealthConfig health;
  std::vector<ExpectedChannel> channels;  ///< beside the sensors of calibration.yaml
  std::vector<std::string> judged_poses = Expectations{}.judged_poses;
  std::string recordings = "recordings";  ///< the folder whose disk is watched
  double publish_period = 0.5;            ///< s; changes of the verdict are published at once
  DashboardConfig dashboard;
};

template <class Visitor>
void visit(ExpectedChannel& c, Visitor& v) {
  v.require("name");
  v.text("name", c.name);
  v.optional_number("rate_hz", c.rate, 0.001, 1e5);
}

template <class Visitor>
void visit(DashboardConfig& c, Visitor& v) {
  v.text("listen", c.listen);
  v.text("token_file", c.token_file);
  v.number("rate_hz", c.rate, 0.2, 10.0);
  v.text("camera", c.camera);
  v.integer("clients", c.clients, 1, 256);
}

template <class Visitor>
void visit(MonitorConfig& c, Visitor& v) {
  v.group("health", c.health);
  v.groups("channels", c.channels);
  v.texts("judged_poses", c.judged_poses);
  v.text("recordings", c.recordings);
  v.number("publish_period_s", c.publish_period, 0.1, 60.0);
  v.group("dashboard", c.dashboard);
}

/// The sensors of calibration.yaml with their rates, the processes of run.yaml, and what monitor.yaml adds. Files that
/// are not there add nothing.
Expectations expectations_of(const MonitorConfig& config, const std::filesystem::path& vehicle);

}  // namespace roadfix
