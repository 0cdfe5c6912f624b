/// The pose server as a program: on the bus, or over logs.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace roadfix {

struct PoseServerOptions {
  std::filesystem::path vehicle;  ///< empty: defaults
  std::string bus;
  int realtime = 0;
  bool print_config = false;
  std::string pose, tcp, serial;  ///< instead of pose_server.yaml's, where not empty
  std::vector<std::string> udp;
  std::vector<std::filesystem::path> logs;
  std::filesystem::path out;  ///< of the logs' sentences; "-": standard output
};

/// Live until a signal asks to stop; over logs until they end.
void run_pose_server(const PoseServerOptions& options);

}  // namespace roadfix
