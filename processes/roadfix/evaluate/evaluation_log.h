/// What `roadfix evaluate` and `roadfix export` take from a log: poses, the reference and the facts of the drive, all
/// in one ENU frame.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "config/calibration.h"
#include "evaluation/evaluate.h"
#include "roadfix/evaluate/fusion_series.h"
#include "roadfix/evaluate/mounting_series.h"
#include "roadfix/pose_t.hpp"

namespace roadfix {

/// A log without what was asked of it, or with bytes that are no message; the text names the file.
struct EvaluationLogError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// The poses of one channel as they lie in the log.
struct PoseStream {
  Trajectory trajectory;             ///< ENU poses are in `anchor`'s frame
  std::vector<std::string> reasons;  ///< pose_t::reason, one per pose
  std::vector<double> latencies;     ///< s, log time minus utime
  std::optional<Geodetic> anchor;    ///< of its first ENU pose that is not invalid
  bool local_frame = false;
  bool scale_unknown = false;
  int8_t origin = 0;    ///< pose_t::ORIGIN_*
  int other_frame = 0;  ///< poses left out: in another frame than the last one
  int backward = 0;     ///< poses left out: there already at that time
};

struct EvaluationLog {
  DriveFacts facts;
  bool has_facts = false;
  Calibration calibration;
  std::map<std::string, PoseStream> poses;  ///< REFERENCE among them
  std::set<std::string> pose_channels;      ///< POSE_* and REFERENCE that the log holds, read or not
  std::map<std::string, std::vector<ProtectionSample>> protection;  ///< by the channel of the poses that it bounds
  FusionSeries fusion;
  MountingSeries mounting;
  std::vector<int64_t> accepted_fixes_us;  ///< of the INS, by AIDING_INS
  std::vector<std::string> notes;          ///< what a reader of the figures must know: damage, missing facts
};

/// Reads the pose channels in `channels` (all POSE_* where empty), REFERENCE, CONFIG_DRIVE, INS_STATUS and FUSION_STATE,
/// each in the order of its messages' own time. Throws LogError where the file is no log of ours.
EvaluationLog read_evaluation_log(const std::filesystem::path& path, const std::set<std::string>& channels);

/// The poses of `channel`. Throws where there are none, naming the channels that have some.
const PoseStream& poses_of(const EvaluationLog& log, const std::string& channel, const std::filesystem::path& path);

/// The stream in another ENU frame; a local stream stays as it is.
void move_to_anchor(PoseStream& stream, const Geodetic& anchor);

/// A note on the poses that are in the log and not in the stream; empty where there are none.
std::string left_out(const std::string& channel, const PoseStream& stream);

/// Poses of the vehicle's axes turned into the imu's, those of references and calibrations. The navigation filter has
/// estimated the turn between them (POSE_FUSED repeats it): the truth's where `truth` tells it, else what was learnt, whose
/// doubt is added to the pose's claim as if the two were independent. The others have the calibration's.
void turn_to_imu_axes(const std::string& channel, const EvaluationLog& log, const EvaluationLog& truth,
                      PoseStream& stream);

/// The reference of a log, with what may be scored of it. Throws where there is none.
Reference reference_of(const EvaluationLog& log, const std::filesystem::path& path);

/// From the stream's point of the vehicle to the reference's, imu axes; a note where the calibration has none.
Eigen::Vector3d lever_arm_between(int8_t from_origin, int8_t to_origin, const Calibration& calibration,
                                  std::vector<std::string>& notes);

}  // namespace roadfix
