/// VO_STATUS, VO_FEATURES and the options of the stage: scale, timestamps, a partly covered lens.
#include <catch2/catch.hpp>
#include <cmath>
#include <random>
#include <roadfix/pose_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_status_t.hpp>

#include "small_street.h"

namespace roadfix {
namespace {

using namespace test;

/// INS poses at the image times, from the frame `first` until the standstill.
std::vector<Sent> with_ins(std::vector<Sent> all, int first, double sigma) {
  for (int i = first; i < 60; ++i) {
    pose_t m{};
    m.q_wxyz[0] = 1.0;
    m.validity = pose_t::VALIDITY_VALID;
    m.velocity_mps[0] = 8.0;
    m.cov_velocity_m2ps2[0][0] = sigma * sigma;
    all.push_back(sent("POSE_INS", kFrame_us * (i + 1), i, m));
  }
  std::stable_sort(all.begin(), all.end(), [](const Sent& a, const Sent& b) { return a.arrival_us < b.arrival_us; });
  return all;
}

std::vector<Sent> without_pictures_before(std::vector<Sent> all, int frame) {
  std::erase_if(all, [frame](const Sent& m) {
    return m.channel.starts_with("CAMERA") && m.arrival_us < kFrame_us * (frame + 1);
  });
  return all;
}

TEST_CASE("mono takes its scale from the wheels and reports it") {
  for (const bool wheels : {false, true}) {
    const Collector out = run(wheels ? with_wheels(images(), 0) : images(), false);
    const auto poses = out.all<pose_t>("POSE_VO");
    const auto status = out.all<vo_status_t>("VO_STATUS").back();
    CHECK(status.scale_source == (wheels ? vo_status_t::SCALE_FROM_WHEELS : vo_status_t::SCALE_FROM_NONE));
    CHECK(poses.back().scale == (wheels ? pose_t::SCALE_METRIC : pose_t::SCALE_UNKNOWN));
    const auto way = poses[60].position_m[0] - poses[20].position_m[0];
    if (wheels) CHECK(way == Approx(40 * kStep).epsilon(0.03));
    if (wheels) CHECK(status.scale_std == Approx(0.02));
  }
}

TEST_CASE("common scale errors are part of the covariance and published beside it") {
  const auto drive = [](double scale_std, double focal_std) {
    Calibration c = calibration(true);
    c.sensors.stereo = StereoCalibration{scale_std, focal_std};
    Collector sink;
    StageRunner runner(make_vo_tracker(c, threads(1)), sink);
    for (const Sent& m : images()) feed(runner, m);
    return sink;
  };
  const Collector exact = drive(0.0, 0.0), doubted = drive(0.02, 0.01);
  const auto of = [](const Collector& out) { return out.all<pose_t>("POSE_VO"); };
  const auto statuses = doubted.all<vo_status_t>("VO_STATUS");
  REQUIRE(of(exact).size() == of(doubted).size());
  REQUIRE(statuses.size() == of(doubted).size());
  const pose_t known = of(exact)[60], told = of(doubted)[60];
  const vo_status_t& status = statuses[60];
  REQUIRE(status.utime == told.utime);
  CHECK(status.scale_std == 0.02);
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j < 6; ++j) {
      double shared = 0.0;
      for (const auto& row : status.shared_error_m_rad) shared += row[i] * row[j];
      CHECK(told.cov_pose_m2_rad2[i][j] == Approx(known.cov_pose_m2_rad2[i][j] + shared).margin(1e-12));
    }
  }
  for (int i = 0; i < 3; ++i) {
    CHECK(told.position_m[i] == known.position_m[i]);  // considered, not estimated
    const double way = told.position_m[i] - of(doubted).front().position_m[i];
    CHECK(status.shared_error_m_rad[0][i] == Approx(0.02 * way).margin(1e-3));
    CHECK(told.cov_velocity_m2ps2[i][i] ==
          Approx(known.cov_velocity_m2ps2[i][i] + 4e-4 * told.velocity_mps[i] * told.velocity_mps[i]).margin(1e-12));
  }
  CHECK(told.position_m[0] > 5.0);
}

TEST_CASE("image and map errors that do not accumulate are published beside the pose") {
  const Collector out = run(images(), true);
  const auto statuses = out.all<vo_status_t>("VO_STATUS");
  const auto poses = out.all<pose_t>("POSE_VO");
  REQUIRE(statuses.size() == poses.size());
  for (const size_t i : {20u, 40u, 59u}) {
    REQUIRE(statuses[i].utime == poses[i].utime);
    Matrix6d pose, image, map;
    for (int r = 0; r < 6; ++r) {
      for (int c = 0; c < 6; ++c) {
        pose(r, c) = poses[i].cov_pose_m2_rad2[r][c];
        image(r, c) = statuses[i].cov_picture_m2_rad2[r][c];
        map(r, c) = statuses[i].cov_map_m2_rad2[r][c];
      }
    }
    CHECK(image.llt().info() == Eigen::Success);
    CHECK(map.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() > -1e-12);  // none of some axes
    CHECK(map.trace() > 0.0);
    const Matrix6d rest = pose - image - map;  // the covariance of the pose contains both
    CHECK(rest.llt().info() == Eigen::Success);
    CHECK(statuses[i].map_time_s > 0.5);
    CHECK(statuses[i].map_time_s < 3.0);
  }
}

TEST_CASE("INS speeds that arrive after the start set the scale of the map") {
  const Collector out = run(with_ins(images(), 16, 0.1), false);
  const auto statuses = out.all<vo_status_t>("VO_STATUS");
  const auto poses = out.all<pose_t>("POSE_VO");
  CHECK(statuses[18].scale_source == vo_status_t::SCALE_FROM_NONE);  // 500 ms of delay are not over
  CHECK(statuses[59].scale_source == vo_status_t::SCALE_FROM_INS);
  CHECK(poses[59].reset_counter == 1);
  CHECK(poses[59].position_m[0] - poses[35].position_m[0] == Approx(24 * kStep).epsilon(0.03));
}

TEST_CASE("mono takes its scale from the better source, from the configured one, or from none") {
  const auto scaled = [](const std::vector<Sent>& messages, ScaleChoice choice) {
    VoTrackerConfig config = threads(1);
    config.keyframe.scale = choice;
    return run(messages, false, config);
  };
  const auto source = [](const Collector& out) { return out.all<vo_status_t>("VO_STATUS")[40].scale_source; };
  const auto ins = without_pictures_before(with_ins(images(), 0, 0.05), 10);
  const Collector out = scaled(ins, ScaleChoice::kAuto);
  const auto poses = out.all<pose_t>("POSE_VO");
  CHECK(source(out) == vo_status_t::SCALE_FROM_INS);
  CHECK(poses[40].scale == pose_t::SCALE_METRIC);
  CHECK(poses[40].reset_counter == 1);  // half a second after the start of the map, as all feedback
  CHECK(poses[40].position_m[0] - poses[20].position_m[0] == Approx(20 * kStep).epsilon(0.03));
  CHECK(out.all<vo_status_t>("VO_STATUS")[40].scale_std == Approx(0.05 / 8.0).epsilon(0.01));
  // Relative sigmas: wheels 2 %, the INS 0.6 % or 6 %.
  CHECK(source(scaled(with_wheels(ins, 0), ScaleChoice::kAuto)) == vo_status_t::SCALE_FROM_INS);
  CHECK(source(scaled(with_wheels(ins, 0), ScaleChoice::kWheels)) == vo_status_t::SCALE_FROM_WHEELS);
  const auto vague = without_pictures_before(with_ins(with_wheels(images(), 0), 0, 0.5), 10);
  CHECK(source(scaled(vague, ScaleChoice::kAuto)) == vo_status_t::SCALE_FROM_WHEELS);
  CHECK(source(scaled(vague, ScaleChoice::kIns)) == vo_status_t::SCALE_FROM_INS);
  const Collector none = scaled(with_wheels(ins, 0), ScaleChoice::kNone);
  CHECK(source(none) == vo_status_t::SCALE_FROM_NONE);
  CHECK(none.all<pose_t>("POSE_VO").back().scale == pose_t::SCALE_UNKNOWN);
}

/// Figures 5 to 7 of Kim and Kang (2025): matches and inliers per image, and the class of each
/// feature.
TEST_CASE("the status counts the published features of every image") {
  for (const bool stereo : {true, false}) {
    const Collector out = run(images(), stereo);
    const auto statuses = out.all<vo_status_t>("VO_STATUS");
    const auto features = out.all<vo_features2_t>("VO_FEATURES");
    REQUIRE(statuses.size() == features.size());
    int judged_pictures = 0, outliers = 0;
    for (size_t i = 0; i < statuses.size(); ++i) {
      CAPTURE(stereo, i);
      const vo_status_t& s = statuses[i];
      const auto count = [&](int8_t use) {
        return static_cast<int>(std::count(features[i].use.begin(), features[i].use.end(), use));
      };
      const int inlier = count(vo_features2_t::USE_INLIER), outlier = count(vo_features2_t::USE_OUTLIER);
      CHECK(s.utime == features[i].utime);
      CHECK(s.num_features == features[i].num_features);
      CHECK(s.num_matches == inlier + outlier + count(vo_features2_t::USE_MATCHED));
      CHECK(s.num_inliers == inlier);
      CHECK(s.inlier_ratio == Approx(inlier + outlier > 0 ? static_cast<double>(inlier) / (inlier + outlier) : 0.0));
      judged_pictures += inlier + outlier > 0 ? 1 : 0;
      outliers += outlier;
    }
    CHECK(judged_pictures > 90);
    CHECK(outliers > 10);  // teeth: there were outliers
  }
}

/// RMS speed error while the car drives at 8 m/s.
double speed_error(const Collector& out) {
  const auto poses = out.all<pose_t>("POSE_VO");
  double sum = 0.0;
  for (size_t i = 20; i < 60; ++i) sum += std::pow(poses[i].velocity_mps[0] - 8.0, 2);
  return std::sqrt(sum / 40.0);
}

TEST_CASE("jittering timestamps are smoothed where configured") {
  std::mt19937 random(5);
  std::uniform_int_distribution<int64_t> late(0, 30'000);
  std::vector<Sent> all;
  for (size_t i = 0; i + 1 < images().size(); i += 2) {
    const int64_t delay_us = late(random);
    for (const size_t k : {i, i + 1}) {
      Sent m = images()[k];
      image_t image = decode<image_t>(m.bytes);
      image.utime += delay_us;
      all.push_back({m.arrival_us + delay_us, m.channel, encode(image)});
    }
  }
  VoTrackerConfig config = threads(1);
  CHECK_FALSE(config.filter_stamps);
  const Collector raw = run(all, true, config);
  config.filter_stamps = true;
  const Collector filtered = run(all, true, config);
  CHECK(speed_error(raw) > 0.5);  // teeth
  CHECK(speed_error(filtered) < 0.3 * speed_error(raw));
  CHECK(filtered.all<pose_t>("POSE_VO").back().utime == all.back().arrival_us);  // poses are at the clock's time
  CHECK(same_outputs(run(images(), true), run(images(), true, config)));         // regular stamps are unchanged
}

TEST_CASE("a half covered lens and an image in ten torn are tolerated") {
  std::vector<Sent> half = images(), torn = images();
  for (size_t i = 20; i < half.size(); ++i) {
    image_t m = decode<image_t>(half[i].bytes);
    cv::Mat image = cv::imdecode(m.data, cv::IMREAD_GRAYSCALE);
    image.colRange(0, kWidth / 2).setTo(90);
    cv::imencode(".png", image, m.data);
    m.size_bytes = static_cast<int32_t>(m.data.size());
    half[i].bytes = encode(m);
  }
  for (size_t i = 20; i < torn.size(); i += 20) {
    image_t m = decode<image_t>(torn[i].bytes);
    m.data.resize(m.data.size() / 2);
    m.size_bytes = static_cast<int32_t>(m.data.size());
    torn[i].bytes = encode(m);
  }
  for (const auto& messages : {half, torn}) {
    const Collector out = run(messages, true);
    const auto poses = out.all<pose_t>("POSE_VO");
    REQUIRE(poses.size() == kFrames);
    CHECK(poses.back().validity == pose_t::VALIDITY_VALID);
    CHECK(poses.back().reset_counter == 0);
    CHECK(poses.back().position_m[0] == Approx(travelled(kFrames)).epsilon(0.03));
    CHECK(std::abs(poses.back().position_m[1]) < 0.5);
    const auto valid =
        std::count_if(poses.begin(), poses.end(), [](const pose_t& p) { return p.validity == pose_t::VALIDITY_VALID; });
    CHECK(valid >= kFrames - 9);
  }
}

}  // namespace
}  // namespace roadfix
