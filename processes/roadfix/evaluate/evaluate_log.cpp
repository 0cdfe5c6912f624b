#include "roadfix/evaluate/evaluate_log.h"

#include <fmt/format.h>

#include <algorithm>

#include "roadfix/evaluate/evaluation_log.h"

namespace roadfix {
namespace {

/// The channels asked for, each of which must be there; all estimates where none was named.
std::vector<std::string> chosen_channels(const EvaluationRequest& request, const EvaluationLog& log) {
  std::vector<std::string> chosen;
  for (const std::string& channel : request.channels) {
    if (std::find(chosen.begin(), chosen.end(), channel) == chosen.end()) chosen.push_back(channel);
  }
  if (chosen.empty()) {
    for (const auto& [channel, stream] : log.poses) {
      if (channel != "REFERENCE") chosen.push_back(channel);
    }
  }
  if (chosen.empty()) throw EvaluationLogError(request.log.string() + ": no POSE_* channel to evaluate");
  for (const std::string& channel : chosen) static_cast<void>(poses_of(log, channel, request.log));
  return chosen;
}

EstimateInput estimate_input(const std::string& channel, PoseStream stream, const PoseStream& reference,
                             const EvaluationLog& log, const EvaluationLog& truth, EvaluationReport& report) {
  if (reference.anchor) move_to_anchor(stream, *reference.anchor);
  turn_to_imu_axes(channel, log, truth, stream);
  EstimateInput input;
  input.channel = channel;
  input.local_frame = stream.local_frame || reference.local_frame;
  input.scale_unknown = stream.scale_unknown;
  input.lever_arm = lever_arm_between(stream.origin, reference.origin, truth.calibration, report.notes);
  input.latencies = std::move(stream.latencies);
  input.trajectory = std::move(stream.trajectory);
  if (std::string note = left_out(channel, stream); !note.empty()) report.notes.push_back(std::move(note));
  return input;
}

EvaluationOptions options_of(const EvaluationRequest& request, const std::string& channel) {
  EvaluationOptions options = request.options;
  if (const auto own = request.alignments.find(channel); own != request.alignments.end()) {
    options.alignment = own->second;
  }
  return options;
}

}  // namespace

const std::vector<std::string>& alignment_choices() {
  static const std::vector<std::string> kChoices = {"auto", "none", "yaw", "se3", "sim3", "tied"};
  return kChoices;
}

std::optional<Alignment> alignment_named(const std::string& name) {
  for (const Alignment a : {Alignment::kNone, Alignment::kYaw, Alignment::kSe3, Alignment::kSim3, Alignment::kTied}) {
    if (name == name_of(a)) return a;
  }
  if (name == "auto") return std::nullopt;
  throw EvaluationLogError(
      fmt::format("there is no alignment '{}' (there are {})", name, fmt::join(alignment_choices(), ", ")));
}

EvaluationReport evaluate_log(const EvaluationRequest& request) {
  const std::filesystem::path& truth_path = request.reference.empty() ? request.log : request.reference;
  EvaluationLog log = read_evaluation_log(request.log, {request.channels.begin(), request.channels.end()});
  const EvaluationLog other =
      request.reference.empty() ? EvaluationLog{} : read_evaluation_log(truth_path, {"REFERENCE"});
  const EvaluationLog& truth = request.reference.empty() ? log : other;
  EvaluationReport report;
  report.facts = truth.facts;
  report.notes = log.notes;
  if (!request.reference.empty()) report.notes.insert(report.notes.end(), other.notes.begin(), other.notes.end());
  report.reference = reference_of(truth, truth_path);
  if (!truth.has_facts) {
    report.notes.push_back(truth_path.string() + ": no CONFIG_DRIVE; the whole reference is scored");
    report.facts.first_fix_us = report.reference.trajectory.poses.front().t_us;
  }
  const PoseStream& reference = truth.poses.at("REFERENCE");
  for (const std::string& channel : chosen_channels(request, log)) {
    EstimateInput input = estimate_input(channel, std::move(log.poses.at(channel)), reference, log, truth, report);
    if (channel == "POSE_FUSED") input.modes = log.fusion.modes;
    input.protection = std::move(log.protection[channel]);
    report.channels.push_back(
        evaluate_channel(report.reference, report.facts, std::move(input), options_of(request, channel)));
  }
  report.fusion = std::move(log.fusion);
  return report;
}

}  // namespace roadfix
