#include "roadfix/paper/drive.h"

#include <fmt/format.h>
#include <stdlib.h>

#include <algorithm>
#include <map>

#include "bus/log/log_reader.h"
#include "bus/run/replay.h"
#include "roadfix/paper/deaf_stage.h"
#include "roadfix/stages.h"

namespace roadfix {
namespace {

struct PoseMaker {
  std::string pose;
  std::vector<std::string> sensors;
};

const std::map<std::string, PoseMaker>& pose_makers() {
  static const std::map<std::string, PoseMaker> kMakers = {{"gnss_ins_ekf", {"POSE_INS", {"IMU", "GNSS"}}},
                                                           {"vo_tracker", {"POSE_VO", {"CAMERA_LEFT"}}},
                                                           {"wheel_odometry", {"POSE_WHEEL", {"WHEELS"}}}};
  return kMakers;
}

/// What an estimator hears of the other one.
const std::map<std::string, std::string>& other_estimators() {
  static const std::map<std::string, std::string> kOthers = {{"gnss_ins_ekf", "VO_FEATURES"},
                                                             {"vo_tracker", "POSE_INS"}};
  return kOthers;
}

}  // namespace

ScratchFolder::ScratchFolder() {
  std::string name = (std::filesystem::temp_directory_path() / "roadfix_paper_XXXXXX").string();
  if (::mkdtemp(name.data()) == nullptr) throw PaperError(name + ": no folder for logs that are read once");
  path_ = name;
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  std::filesystem::remove_all(path_, ignored);
}

std::set<std::string> channels_of(const std::filesystem::path& log) {
  LogReader reader(log);
  reader.require_events();
  std::set<std::string, std::less<>> channels;
  while (const auto event = reader.next()) {
    if (!channels.contains(event->channel)) channels.emplace(event->channel);
  }
  return {channels.begin(), channels.end()};
}

void require_channels(const std::filesystem::path& log, const std::set<std::string>& there,
                      const std::vector<std::string>& wanted, const std::string& purpose) {
  for (const std::string& channel : wanted) {
    if (there.contains(channel)) continue;
    throw PaperError(fmt::format("{}: no messages on channel {}, which {} (there are {})", log.string(), channel,
                                 purpose, fmt::join(there, ", ")));
  }
}

std::filesystem::path with_poses_of(const std::vector<std::string>& stages, const PaperRequest& request,
                                    const ScratchFolder& scratch) {
  const std::set<std::string> there = channels_of(request.drive);
  const bool recorded = std::all_of(stages.begin(), stages.end(), [&](const std::string& stage) {
    return there.contains(pose_makers().at(stage).pose);
  });
  if (recorded && !request.again && !request.independent) return request.drive;
  for (const std::string& stage : stages) {
    const PoseMaker& maker = pose_makers().at(stage);
    require_channels(request.drive, there, maker.sensors, maker.pose + " is made from");
  }
  const std::filesystem::path out = scratch / "poses.lcm";
  std::vector<std::unique_ptr<Stage>> made = make_stages(stages, request.vehicle);
  for (std::unique_ptr<Stage>& stage : made) {
    const auto other = other_estimators().find(stage->spec().name);
    if (request.independent && other != other_estimators().end()) stage = deaf_to(other->second, std::move(stage));
  }
  replay_for_paper(request.drive, out, std::move(made), request.progress);
  return out;
}

void replay_for_paper(const std::filesystem::path& in, const std::filesystem::path& out,
                      std::vector<std::unique_ptr<Stage>> stages, const std::function<void(double share)>& progress,
                      const std::vector<std::string>& ignored) {
  ReplayOptions options;
  options.ignored_channels = ignored;
  options.to_disk = false;
  options.progress = progress;
  const bool makes_aiding =
      std::any_of(stages.begin(), stages.end(), [](const auto& stage) { return stage->spec().name == "gnss_ins_ekf"; });
  if (!makes_aiding) options.copied_channels.emplace_back("AIDING_INS");  // the outages are found from it
  replay(in, out, std::move(stages), options);
}

}  // namespace roadfix
