#include "roadfix/import/drive_log.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <roadfix/config_t.hpp>
#include <stdexcept>

#include "bus/log/log_writer.h"
#include "bus/types/message.h"
#include "config/config.h"
#include "config/config_hash.h"
#include "roadfix/import/drive_messages.h"
#include "roadfix/import/drive_reference.h"
#include "roadfix/import/time_spans.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;

bool is_in(const std::vector<std::string>& list, const std::string& word) {
  return std::find(list.begin(), list.end(), word) != list.end();
}

void leave_out(const std::vector<std::string>& without, Drive& drive) {
  for (const std::string& name : without) {
    if (!is_in(sensor_names(), name)) {
      throw std::runtime_error(fmt::format("--without {}: must be of {}", name, fmt::join(sensor_names(), ", ")));
    }
  }
  if (is_in(without, "imu")) drive.imu.clear();
  if (is_in(without, "gnss")) drive.gnss.clear();
  if (is_in(without, "wheels")) drive.wheels.clear();
  if (is_in(without, "mag")) drive.mag.clear();
  if (is_in(without, "camera") || is_in(without, "camera_left")) drive.frames_left.clear();
  if (is_in(without, "camera") || is_in(without, "camera_right")) drive.frames_right.clear();
}

/// Calls `action` with every list of the drive that has times.
template <class Action>
void for_each_list(Drive& drive, const Action& action) {
  action(drive.imu);
  action(drive.gnss);
  action(drive.wheels);
  action(drive.mag);
  action(drive.frames_left);
  action(drive.frames_right);
  action(drive.reference);
  action(drive.local_reference);
  action(drive.estimate);
}

int64_t first_utime(Drive& drive) {
  int64_t first = std::numeric_limits<int64_t>::max();
  for_each_list(drive, [&](const auto& list) {
    if (!list.empty()) first = std::min(first, list.front().t_us);
  });
  return first;
}

void drop_start(double start_after, Drive& drive) {
  if (start_after <= 0.0) return;
  const int64_t zero = drive.gnss.empty() ? first_utime(drive) : drive.gnss.front().t_us;
  const int64_t start_us = zero + std::llround(start_after * 1e6);
  for_each_list(drive,
                [&](auto& list) { std::erase_if(list, [&](const auto& sample) { return sample.t_us < start_us; }); });
}

/// The channels of one log, and in which order their messages lie in it.
class LogPlan {
 public:
  template <class T, class ToMessage>
  void add(const std::string& channel, const std::vector<T>& samples, ToMessage to_bytes) {
    if (samples.empty()) return;
    const auto rank = static_cast<int>(channels_.size());
    for (std::size_t i = 0; i < samples.size(); ++i) entries_.push_back({time_of(samples[i]), rank, i});
    channels_.push_back({channel, samples.size(), [&samples, to_bytes](std::size_t i, int64_t run) {
                           auto message = to_bytes(samples[i]);
                           message.run = run;
                           message.seq = static_cast<int64_t>(i);
                           return encode(message);
                         }});
  }

  /// Stable: messages of one channel and time keep their order.
  void write(const fs::path& path, const Progress& progress) {
    std::stable_sort(entries_.begin(), entries_.end(), [](const Entry& a, const Entry& b) {
      return a.t_us != b.t_us ? a.t_us < b.t_us : a.channel < b.channel;
    });
    constexpr std::size_t kProgressStep = 1000;
    LogWriter writer(path);
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      const Entry& entry = entries_[i];
      const Channel& channel = channels_[static_cast<std::size_t>(entry.channel)];
      writer.write(channel.name, entry.t_us, channel.bytes(entry.index, entries_.front().t_us));
      if (progress && i % kProgressStep == 0) progress(i, entries_.size());
    }
    writer.commit();
    if (progress) progress(entries_.size(), entries_.size());
  }

  [[nodiscard]] std::string summary() const {
    std::string text;
    for (const Channel& channel : channels_) text += fmt::format("  {:<13} {:>8}\n", channel.name, channel.count);
    return text;
  }

 private:
  struct Entry {
    int64_t t_us;
    int channel;
    std::size_t index;
  };
  struct Channel {
    std::string name;
    std::size_t count;
    std::function<std::vector<uint8_t>(std::size_t index, int64_t run)> bytes;
  };

  template <class T>
  static int64_t time_of(const T& sample) {
    if constexpr (requires { sample.t_us; }) {
      return sample.t_us;
    } else {
      return sample.utime;
    }
  }

  std::vector<Channel> channels_;
  std::vector<Entry> entries_;
};

/// A picture as a message; ConfigError where its size is not the calibration's.
image_t picture(const FrameFile& frame, const std::optional<CameraCalibration>& camera) {
  image_t message = to_message(frame);
  const int width = camera ? camera->width_px.value_or(message.width_px) : message.width_px;
  const int height = camera ? camera->height_px.value_or(message.height_px) : message.height_px;
  if (width != message.width_px || height != message.height_px) {
    throw ConfigError(
        frame.path.string(), 0,
        fmt::format("is {} x {}, the calibration says {} x {}", message.width_px, message.height_px, width, height));
  }
  return message;
}

/// What was done to the source, as comments for a person who reads the log.
std::string story(const Drive& drive, const ImportChanges& changes, const ChangedGnss& changed) {
  const auto comment = [](const std::string& label, const std::string& text) {
    return text.empty() ? "" : fmt::format("# {}: {}\n", label, yaml_scalar(text));
  };
  const GnssChanges& gnss = changes.gnss;
  std::string text = fmt::format("# Imported from a source of format {}.\n", drive.format);
  text += comment("origin", drive.description.origin) + comment("note", drive.description.note);
  if (!changes.without.empty()) text += fmt::format("# left out: {}\n", fmt::join(changes.without, ", "));
  if (changes.start_after > 0.0) text += fmt::format("# the first {} s were left out\n", changes.start_after);
  if (gnss.keep_every > 1) text += fmt::format("# one fix in {} was kept\n", gnss.keep_every);
  if (gnss.cut) {
    text += fmt::format("# GNSS cut for {} s every {} s, from {} + {} s after the first fix: {} windows\n",
                        gnss.cut->length, gnss.cut->every, gnss.cut->after, gnss.cut->phase, changed.outages.size());
  }
  if (gnss.spike) text += fmt::format("# every {}th fix was moved {} m\n", gnss.spike->every_fix, gnss.spike->moved);
  if (gnss.bias_after_outage) {
    text += fmt::format("# the first {} fixes after each window were moved {} m\n", gnss.bias_after_outage->fixes,
                        gnss.bias_after_outage->moved);
  }
  if (!changed.moved_utimes.empty()) {
    text += fmt::format("# {} fixes moved, azimuth seed {}\n", changed.moved_utimes.size(), gnss.azimuth_seed);
  }
  return text;
}

}  // namespace

const std::vector<std::string>& sensor_names() {
  static const std::vector<std::string> names = {"imu",    "gnss",        "wheels",      "mag",
                                                 "camera", "camera_left", "camera_right"};
  return names;
}

DriveLogSummary write_drive_log(Drive drive, const ImportChanges& changes, const fs::path& path,
                                const Progress& progress) {
  leave_out(changes.without, drive);
  refuse_times_apart(drive);
  drop_start(changes.start_after, drive);
  if (changes.score_skip) drive.description.score.skip_s = *changes.score_skip;
  const bool asks_gnss = changes.gnss.cut || changes.gnss.spike || changes.gnss.keep_every > 1;
  if (asks_gnss && drive.gnss.empty()) throw std::runtime_error("there are no fixes to cut, thin out or move");
  const ChangedGnss changed = change_gnss(drive.gnss, changes.gnss);
  const DriveReference reference = make_reference(drive, changed, changes.gnss);

  config_t config{};
  config.utime = first_utime(drive);
  if (config.utime == std::numeric_limits<int64_t>::max()) throw std::runtime_error("nothing is left of the drive");
  config.process = "drive";
  config.config_yaml = story(drive, changes, changed) + config_text(reference.facts);
  config.calibration_yaml = calibration_text(drive.description.calibration);
  config.config_hash = config_hash(config.config_yaml, config.calibration_yaml);

  const SensorsCalibration& sensors = drive.description.calibration.sensors;
  const std::vector<config_t> configs = {config};
  const auto as_it_is = [](const auto& message) { return message; };
  const auto convert = [](const auto& sample) { return to_message(sample); };
  const auto as_camera = [](const LocalPose& pose) { return to_message(pose, ReferenceOf::kCamera, 0.0); };
  LogPlan plan;  // the order of these lines is that of messages with the same utime
  plan.add("CONFIG_DRIVE", configs, as_it_is);
  plan.add("CAMERA_LEFT", drive.frames_left, [&](const FrameFile& f) { return picture(f, sensors.camera_left); });
  plan.add("CAMERA_RIGHT", drive.frames_right, [&](const FrameFile& f) { return picture(f, sensors.camera_right); });
  plan.add("GNSS", changed.fixes, convert);
  plan.add("IMU", drive.imu, convert);
  plan.add("MAG", drive.mag, convert);
  plan.add("POSE_VO", drive.estimate, as_camera);
  plan.add("REFERENCE", reference.poses, as_it_is);
  plan.add("WHEELS", drive.wheels, convert);
  plan.write(path, progress);
  return {plan.summary(), reference.facts};
}

void write_vehicle(const Calibration& calibration, const std::string& name, const fs::path& directory, bool overwrite) {
  const fs::path path = directory / "calibration.yaml";
  const std::string text =
      fmt::format("# What is known about the sensors of {}; absent means unknown.\n", yaml_scalar(name)) +
      calibration_text(calibration);
  if (fs::exists(path) && !overwrite) {
    if (read_text_file(path) == text) return;
    throw ConfigError(path.string(), 0, "is there already and differs; give another --vehicle, or --overwrite");
  }
  write_text_file(path, text);
}

}  // namespace roadfix
