#include "roadfix/import/wheel_csv.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "geometry/frames.h"
#include "roadfix/import/csv_reader.h"
#include "wheel/wheel_encoder.h"

namespace roadfix {
namespace {

constexpr double kMaxSpeed = 150.0;   // m/s
constexpr double kMaxYawRate = 20.0;  // rad/s

const std::vector<std::string> kFourSpeeds = {"front_left_mps", "front_right_mps", "rear_left_mps", "rear_right_mps"};
const std::vector<std::string> kFourTicks = {"front_left_ticks", "front_right_ticks", "rear_left_ticks",
                                             "rear_right_ticks"};

std::vector<WheelSample> read_speeds(CsvReader& csv) {
  const bool one = csv.has("speed_mps");
  if (one == csv.has(kFourSpeeds[0])) {
    csv.fail(fmt::format("must have either column speed_mps or the four {}", fmt::join(kFourSpeeds, ", ")));
  }
  const int t = csv.index("utime_us");
  std::vector<WheelSample> samples;
  while (csv.next()) {
    WheelSample sample;
    sample.t_us = csv.utime(t);
    sample.num_speeds = one ? 1 : 4;
    for (std::size_t i = 0; i < static_cast<std::size_t>(sample.num_speeds); ++i) {
      sample.speeds[i] = csv.number(csv.index(one ? "speed_mps" : kFourSpeeds[i]), -kMaxSpeed, kMaxSpeed);
    }
    if (csv.has("yaw_rate_radps")) sample.yaw_rate = csv.number(csv.index("yaw_rate_radps"), -kMaxYawRate, kMaxYawRate);
    samples.push_back(sample);
  }
  return samples;
}

/// Which of the three sets of counters the file has; nothing where it has none.
std::vector<std::string> tick_columns(const CsvReader& csv) {
  std::vector<std::string> there;
  for (const std::string& column : kFourTicks) {
    if (csv.has(column)) there.push_back(column);
  }
  if (csv.has("ticks")) there.emplace_back("ticks");
  const bool two = there.size() == 2 && there[0] == kFourTicks[2] && there[1] == kFourTicks[3];
  if (there.empty() || two || there == kFourTicks || (there.size() == 1 && there[0] == "ticks")) return there;
  csv.fail(fmt::format("has {}; counters are ticks alone, rear_left_ticks and rear_right_ticks, or the four {}",
                       fmt::join(there, ", "), fmt::join(kFourTicks, ", ")));
}

EncoderConfig encoder_of(const CsvReader& csv, const std::optional<WheelsCalibration>& wheels) {
  if (!wheels || !wheels->ticks_per_turn || !wheels->wheel_radius) {
    csv.fail(
        "has counters (ticks): drive.yaml must say sensors.wheels.ticks_per_turn and wheel_radius_m, and ticks_wrap_at "
        "where they begin again at 0");
  }
  EncoderConfig config;
  config.ticks_per_turn = *wheels->ticks_per_turn;
  config.wheel_radius = *wheels->wheel_radius;
  config.wraps_at = static_cast<uint64_t>(wheels->ticks_wrap_at.value_or(0));
  return config;
}

/// One speed of one wheel on the axle, the mean of two, or four.
WheelSample sample_of(const EncoderSpeeds& speeds, std::size_t wheels, std::optional<double> track_width) {
  WheelSample sample;
  sample.t_us = speeds.t_us;
  sample.num_speeds = wheels == 4 ? 4 : 1;
  sample.speeds = speeds.speed;
  if (wheels == 2) {
    sample.speeds = {0.5 * (speeds.speed[0] + speeds.speed[1])};
    if (track_width) sample.yaw_rate = (speeds.speed[1] - speeds.speed[0]) / *track_width;
  }
  return sample;
}

std::vector<WheelSample> read_ticks(CsvReader& csv, const std::vector<std::string>& columns,
                                    const WheelsCalibration& wheels, const EncoderConfig& config) {
  constexpr int64_t kMaxTicks = int64_t{1} << 62U;
  const int64_t limit = config.wraps_at == 0 ? kMaxTicks : static_cast<int64_t>(config.wraps_at) - 1;
  WheelEncoder encoder(config);
  std::vector<WheelSample> samples;
  EncoderReading reading;
  reading.num_wheels = static_cast<int>(columns.size());
  while (csv.next()) {
    const int64_t before_us = reading.t_us;
    reading.t_us = csv.utime(csv.index("utime_us"));
    if (reading.t_us == before_us) csv.fail(csv.index("utime_us"), "two readings of one time have no speed");
    for (std::size_t i = 0; i < columns.size(); ++i) {
      reading.ticks[i] = csv.integer(csv.index(columns[i]), -limit, limit);
    }
    const auto speeds = encoder.add(reading);
    if (!speeds) continue;
    for (std::size_t i = 0; i < columns.size(); ++i) {
      if (std::abs(speeds->speed[i]) <= kMaxSpeed) continue;
      csv.fail(csv.index(columns[i]),
               fmt::format("is {:.0f} m/s since the row before; allowed: -150 to 150; sensors.wheels.ticks_wrap_at "
                           "tells where a counter begins again at 0",
                           speeds->speed[i]));
    }
    samples.push_back(sample_of(*speeds, columns.size(), wheels.track_width));
  }
  return samples;
}

}  // namespace

std::vector<WheelSample> read_wheel_csv(const std::filesystem::path& path,
                                        const std::optional<WheelsCalibration>& wheels,
                                        std::vector<std::string>& remarks) {
  CsvReader csv(path, {{"utime_us"},
                       {{"speed_mps"},
                        kFourSpeeds,
                        {"yaw_rate_radps"},
                        {"ticks"},
                        {kFourTicks[0], kFourTicks[1]},
                        {kFourTicks[2], kFourTicks[3]}}});
  const std::vector<std::string> columns = tick_columns(csv);
  std::vector<WheelSample> samples;
  if (columns.empty()) {
    samples = read_speeds(csv);
  } else {
    for (const char* other : {"speed_mps", "front_left_mps", "yaw_rate_radps"}) {
      if (csv.has(other)) csv.fail(fmt::format("has {} beside {}: speeds or counters, not both", other, columns[0]));
    }
    const EncoderConfig config = encoder_of(csv, wheels);
    samples = read_ticks(csv, columns, *wheels, config);
    if (samples.empty()) csv.fail("has no two readings within a second: no speed");
    const double step = 2.0 * kPi * config.wheel_radius / config.ticks_per_turn;
    remarks.push_back(fmt::format(
        "wheels are {} counters: {} speeds, each the mean between two readings, at its middle; one tick is {:.3g} m",
        columns.size(), samples.size(), step));
    if (columns.size() == 2 && !wheels->track_width)
      remarks.emplace_back("wheels: no yaw rate of the two rear wheels without sensors.wheels.track_width_m");
  }
  const bool any_negative = std::any_of(samples.begin(), samples.end(), [](const WheelSample& sample) {
    return std::any_of(sample.speeds.begin(), sample.speeds.end(), [](double speed) { return speed < 0.0; });
  });
  for (WheelSample& sample : samples) {
    sample.direction = any_negative ? WheelDirection::kSigned : WheelDirection::kUnknown;
  }
  return samples;
}

}  // namespace roadfix
