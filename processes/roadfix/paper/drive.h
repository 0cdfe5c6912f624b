/// The log that an experiment reads: which channels it has, and the estimators run over it where their poses are missing.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "bus/stage.h"

namespace roadfix {

/// A drive without what an experiment needs; the text names the file and the channel.
struct PaperError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

struct PaperRequest {
  std::filesystem::path drive;
  std::filesystem::path vehicle;               ///< its configuration folder
  bool again = false;                          ///< run the estimators although the drive has their poses
  bool independent = false;                    ///< vision and the INS hear nothing of each other
  double slow_window = 0.0;                    ///< s, of `paper c`: vision is also shown without what is slower; 0: not
  double turn_threshold = 0.0;                 ///< rad/s, the yaw rate that counts as a turn
  std::function<void(double share)> progress;  ///< of what takes long
};

/// A folder for logs that are read once, gone with this object.
class ScratchFolder {
 public:
  ScratchFolder();
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;
  [[nodiscard]] std::filesystem::path operator/(const std::string& name) const { return path_ / name; }

 private:
  std::filesystem::path path_;
};

/// Of a log that holds at least one event. LogError where the file is no log.
std::set<std::string> channels_of(const std::filesystem::path& log);

/// PaperError where one of `wanted` is not among `there`, naming it, what it is wanted for, and what there is.
void require_channels(const std::filesystem::path& log, const std::set<std::string>& there,
                      const std::vector<std::string>& wanted, const std::string& purpose);

/// A log with the poses of these stages: the drive itself where it holds all of them, else what the stages make of its
/// sensors, in `scratch`. PaperError for a sensor that is missing.
std::filesystem::path with_poses_of(const std::vector<std::string>& stages, const PaperRequest& request,
                                    const ScratchFolder& scratch);

/// Replays stages into a log that is read once, with the facts that an evaluation needs. `ignored`: channels of `in`.
void replay_for_paper(const std::filesystem::path& in, const std::filesystem::path& out,
                      std::vector<std::unique_ptr<Stage>> stages,
                      const std::function<void(double share)>& progress = {},
                      const std::vector<std::string>& ignored = {});

}  // namespace roadfix
