#include "replay/shipped_stages.h"

#include <roadfix/vo_status_t.hpp>

#include "bus/log/log_reader.h"
#include "config/config.h"
#include "gnss_ins_ekf/handler.h"
#include "imm_fusion/handler.h"
#include "integrity/handler.h"
#include "simulation/scenarios.h"
#include "support/picture_drive.h"
#include "support/shared_data.h"
#include "support/track_messages.h"
#include "vo_tracker/handler.h"
#include "wheel_odometry/handler.h"

namespace roadfix::test {
namespace {

constexpr double kDemo_s = 20.0;
constexpr size_t kFewTracks = 60;  // a picture: enough for the filter

Calibration demo_calibration() { return load_calibration(source_path("configs/demo")); }

/// Collects everything that a stage publishes.
struct Collected : MessageSink {
  std::vector<DriveMessage> messages;
  void put(const std::string& channel, const Header& header, std::span<const uint8_t> bytes) override {
    messages.push_back({channel, header, {bytes.begin(), bytes.end()}});
  }
};

void sort_by_utime(std::vector<DriveMessage>& messages) {
  std::stable_sort(messages.begin(), messages.end(),
                   [](const DriveMessage& a, const DriveMessage& b) { return a.header.utime < b.header.utime; });
}

/// The beginning of the demo drive's sensors.
const std::vector<DriveMessage>& demo() {
  static const std::vector<DriveMessage> kDemo = [] {
    LogReader reader(source_path("logs/demo.lcm"));
    std::vector<DriveMessage> all;
    while (const auto event = reader.next()) {
      all.push_back({std::string(event->channel), *read_header(event->data), {event->data.begin(), event->data.end()}});
    }
    std::erase_if(all, [](const DriveMessage& m) { return m.channel.starts_with("CAMERA_"); });
    sort_by_utime(all);
    const int64_t end = all.front().header.utime + static_cast<int64_t>(kDemo_s * 1e6);
    std::erase_if(all, [&](const DriveMessage& m) { return m.header.utime > end; });
    return all;
  }();
  return kDemo;
}

/// Where the first fix was, give or take: somebody who knows no better than the filter.
DriveMessage rough_prior_pose(const std::vector<DriveMessage>& drive, int64_t utime) {
  const auto fix = std::find_if(drive.begin(), drive.end(), [](const DriveMessage& m) { return m.channel == "GNSS"; });
  const gnss_t first = decode<gnss_t>(fix->bytes);
  pose_t m{};
  m.anchor_lat_deg = first.lat_deg;
  m.anchor_lon_deg = first.lon_deg;
  m.anchor_height_m = first.height_m;
  m.q_wxyz[0] = 1.0;
  for (int i = 0; i < 6; ++i) m.cov_pose_m2_rad2[i][i] = i < 3 ? 1e4 : 4.0;
  return drive_message("PRIOR_POSE", utime, 0, m);
}

/// The same drive once more, with tracks in place of its pictures.
const std::vector<DriveMessage>& demo_with_tracks() {
  static const std::vector<DriveMessage> kDemo = [] {
    ScenarioConfig config = scenario("demo");
    config.duration_s = kDemo_s;
    std::vector<DriveMessage> all = track_messages(make_track_drive(config, 1, with_noise_of_pictures({})), kFewTracks);
    all.push_back(rough_prior_pose(all, all.front().header.utime + 10'000'000));
    sort_by_utime(all);
    return all;
  }();
  return kDemo;
}

std::vector<DriveMessage> outputs(std::unique_ptr<Stage> stage, const std::vector<DriveMessage>& drive) {
  Collected collected;
  StageRunner runner(std::move(stage), collected);
  for (const Delivery& d : deliveries(runner.spec(), drive)) runner.offer(d.input, d.message->bytes);
  return std::move(collected.messages);
}

/// What the estimators say on the demo drive; in place of a camera's, the wheels' pose at 10 Hz.
const std::vector<DriveMessage>& estimates() {
  static const std::vector<DriveMessage> kEstimates = [] {
    std::vector<DriveMessage> all = outputs(make_gnss_ins_ekf(demo_calibration(), {}), demo());
    const std::vector<DriveMessage> wheels = outputs(make_wheel_odometry(demo_calibration(), {}), demo());
    int64_t seq = 0;
    for (const DriveMessage& m : wheels) {
      all.push_back(m);
      if (m.channel != "POSE_WHEEL" || m.header.utime % 100'000 != 0) continue;
      all.push_back(drive_message("VO_STATUS", m.header.utime, seq, vo_status_t{}));
      all.push_back(drive_message("POSE_VO", m.header.utime, seq++, decode<pose_t>(m.bytes)));
    }
    sort_by_utime(all);
    return all;
  }();
  return kEstimates;
}

/// The same, and what the fusion makes of it.
const std::vector<DriveMessage>& fused() {
  static const std::vector<DriveMessage> kFused = [] {
    std::vector<DriveMessage> all = estimates();
    for (DriveMessage& m : outputs(make_imm_fusion(demo_calibration(), {}), estimates())) all.push_back(std::move(m));
    sort_by_utime(all);
    return all;
  }();
  return kFused;
}

std::unique_ptr<Stage> make_tracker(const Calibration& calibration, VoMode mode) {
  VoTrackerConfig config;
  config.mode = mode;
  config.keyframe.front_end.max_features = config.filter.front_end.max_features = 120;  // enough for small pictures
  return make_vo_tracker(calibration, config);
}

}  // namespace

const std::vector<ShippedStage>& shipped_stages() {
  static const std::vector<ShippedStage> kStages = {
      {"gnss_ins_ekf", demo_calibration(), [](const Calibration& c) { return make_gnss_ins_ekf(c, {}); }, demo},
      {"wheel_odometry", demo_calibration(), [](const Calibration& c) { return make_wheel_odometry(c, {}); }, demo},
      {"imm_fusion", demo_calibration(), [](const Calibration& c) { return make_imm_fusion(c, {}); }, estimates},
      {"integrity", demo_calibration(), [](const Calibration& c) { return make_integrity(c, {}); }, fused},
      {"vo_tracker, stereo", picture_car(true), [](const Calibration& c) { return make_tracker(c, VoMode::kKeyframe); },
       picture_drive},
      {"vo_tracker, mode filter", picture_car(false),
       [](const Calibration& c) { return make_tracker(c, VoMode::kFilter); }, picture_drive},
      {"gnss_ins_ekf, with tracks", demo_calibration(), [](const Calibration& c) { return make_gnss_ins_ekf(c, {}); },
       demo_with_tracks},
  };
  return kStages;
}

std::vector<Delivery> deliveries(const StageSpec& spec, const std::vector<DriveMessage>& drive,
                                 const Arrivals& arrivals) {
  std::mt19937_64 random(arrivals.seed.value_or(0));
  std::vector<Delivery> all;
  for (const DriveMessage& message : drive) {
    for (int input = 0; input < static_cast<int>(spec.inputs.size()); ++input) {
      const InputSpec& declared = spec.inputs[static_cast<std::size_t>(input)];
      if (declared.channel != message.channel) continue;
      const bool is_clock = input == spec.clocks.front().input;
      const int64_t window = is_clock ? 0 : declared.lateness_us + declared.effect_delay_us;
      const auto within = [&](int64_t us) { return static_cast<int64_t>(random() % static_cast<uint64_t>(us)); };
      const int64_t delay = arrivals.seed && window > 0 ? within(window) : 0;
      const int64_t arrives = message.header.utime + delay + (window > 0 ? arrivals.extra_us : 0);
      all.push_back({arrives, delivery_order(spec, input), input, &message});
      if (arrivals.duplicates && message.header.seq % 3 == 0)
        all.push_back({arrives + within(400'000), delivery_order(spec, input), input, &message});
    }
  }
  std::stable_sort(all.begin(), all.end(), [](const Delivery& a, const Delivery& b) {
    return std::tie(a.arrives, a.order) < std::tie(b.arrives, b.order);
  });
  return all;
}

std::vector<LoggedEvent> record(const ShippedStage& stage) {
  Collected collected;
  StageRunner runner(stage.made(), collected);
  const std::string name = runner.spec().name;
  std::vector<LoggedEvent> log;
  const auto all = deliveries(runner.spec(), stage.drive());
  config_t config = runner.config_message();
  config.utime = config.run = all.front().message->header.utime;
  log.push_back({stage_channel("CONFIG_", name), {config.utime, config.run, 0}, encode(config)});
  for (const Delivery& d : all) {
    log.push_back({d.message->channel, d.message->header, d.message->bytes});
    runner.offer(d.input, d.message->bytes);
    for (DriveMessage& m : collected.messages) log.push_back({m.channel, m.header, std::move(m.bytes)});
    collected.messages.clear();
  }
  return log;
}

}  // namespace roadfix::test
