// What the page is shown, from messages as they come.
#include "monitor/web/view.h"

#include <catch2/catch.hpp>
#include <nlohmann/json.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/protection_level_t.hpp>

#include "bus/track_codec.h"
#include "bus/types/message.h"
#include "monitor/handler.h"

using namespace roadfix;

namespace {

constexpr int64_t kStart_us = 1'700'000'000'000'000;

struct Bench {
  MonitorHandler handler{MonitorConfig{}, Expectations{}};
  Board board{"x", true};
  DriveView view;
  int64_t seq = 0;

  explicit Bench(const std::string& camera = "") : view(board, handler.health(), 5.0, false, camera) {
    handler.add(view);
  }

  template <class T>
  void send(const std::string& channel, int64_t utime, T message) {
    message.utime = utime;
    message.run = 1;
    message.seq = seq++;
    const std::vector<uint8_t> bytes = encode(message);
    handler.take({channel, bytes, utime}, utime);
  }

  /// A drive to the east at 10 m/s: the fused pose, wheels in a frame of their own, turned and far away, that go 10 %
  /// too far, and a reference that lies 1 m to the north.
  void drive(double s) {
    for (int i = 0; i < static_cast<int>(s * 20); ++i) {
      const int64_t t = kStart_us + i * 50'000;
      const double way = 0.5 * i;
      pose_t pose{};
      pose.frame = pose_t::FRAME_ENU;
      pose.anchor_lat_deg = 48.0;
      pose.validity = pose_t::VALIDITY_VALID;
      pose.q_wxyz[0] = 1.0;
      pose.velocity_mps[0] = 10.0;
      for (int k = 0; k < 6; ++k) pose.cov_pose_m2_rad2[k][k] = 1e-4;
      pose.position_m[0] = way;
      send("POSE_FUSED", t, pose);
      pose_t reference = pose;
      reference.position_m[1] = 1.0;
      send("REFERENCE", t, reference);
      pose_t wheel = pose;
      wheel.frame = pose_t::FRAME_LOCAL;
      wheel.velocity_mps[0] = 11.0;
      wheel.position_m[0] = 700.0;
      wheel.position_m[1] = -300.0 + 1.1 * way;
      wheel.q_wxyz[0] = wheel.q_wxyz[3] = std::sqrt(0.5);
      send("POSE_WHEEL", t, wheel);
    }
  }

  nlohmann::json frame() { return nlohmann::json::parse(*board.frame()); }
};

nlohmann::json pose_of(const nlohmann::json& frame, const std::string& name) {
  for (const auto& pose : frame["poses"]) {
    if (pose["name"] == name) return pose;
  }
  return {};
}

}  // namespace

TEST_CASE("an absolute estimate is where it says, and its error is its distance from the reference") {
  Bench bench;
  bench.drive(5.0);
  const auto fused = pose_of(bench.frame(), "POSE_FUSED");
  CHECK(fused["map"]["e"].get<double>() == Approx(49.0).margin(1.0));
  CHECK(fused["map"]["n"].get<double>() == Approx(0.0).margin(0.01));
  CHECK(fused["err"].get<double>() == Approx(1.0).margin(0.01));
  CHECK_FALSE(fused["map"]["pinned"].get<bool>());
  CHECK(bench.frame()["reference"]["n"].get<double>() == Approx(1.0));
}

TEST_CASE("a protection level is shown with the pose that it bounds, as long as that is new") {
  Bench bench;
  bench.drive(2.0);
  protection_level_t level{};
  level.pose_utime = kStart_us + 1'900'000;
  level.num_risks = 2;
  level.risk = {1e-3, 1e-5};
  level.along_m = {0.5, 0.9};
  level.across_m = {0.2, 0.3};
  level.up_m = {1.0, INFINITY};
  level.reason = "positions are not checked yet";
  bench.send("PROTECTION_FUSED", kStart_us + 2'000'000, level);
  bench.drive(2.4);
  const auto bound = pose_of(bench.frame(), "POSE_FUSED")["bound"];
  CHECK(bound["along"] == 0.9);
  CHECK(bound["up"].is_null());
  CHECK(bound["usable"] == false);
  CHECK(bound["reason"] == "positions are not checked yet");
  CHECK_FALSE(pose_of(bench.frame(), "POSE_WHEEL").contains("bound"));
  bench.drive(4.0);
  CHECK_FALSE(pose_of(bench.frame(), "POSE_FUSED").contains("bound"));
}

TEST_CASE("an estimate in a frame of its own is laid on the map where it began, and its drift shows") {
  Bench bench;
  bench.drive(10.0);
  const auto wheel = pose_of(bench.frame(), "POSE_WHEEL");
  REQUIRE(wheel["map"]["pinned"].get<bool>());
  const auto fused = pose_of(bench.frame(), "POSE_FUSED");
  const double ahead = wheel["map"]["e"].get<double>() - fused["map"]["e"].get<double>();
  CHECK(ahead == Approx(9.9).margin(0.5));  // 10 % of the way
  CHECK(wheel["map"]["n"].get<double>() == Approx(0.0).margin(0.05));
  CHECK(wheel["map"]["yaw"].get<double>() == Approx(0.0).margin(1e-3));
}

TEST_CASE("what is no number, or meant to harm, is data and nothing else") {
  Bench bench;
  bench.drive(1.0);
  pose_t pose{};
  pose.frame = pose_t::FRAME_ENU;
  pose.anchor_lat_deg = 48.0;
  pose.validity = pose_t::VALIDITY_VALID;
  pose.position_m[0] = std::nan("");
  pose.reason = "</script>\"\xff\x01";
  bench.send("POSE_FUSED", kStart_us + 1'100'000, pose);
  bench.send("IMU", kStart_us + 1'700'000, pose);
  const auto fused = pose_of(bench.frame(), "POSE_FUSED");
  CHECK_FALSE(fused.contains("map"));
  CHECK_THAT(fused["reason"].get<std::string>(), Catch::Contains("</script>"));
  CHECK(bench.frame()["health"]["verdict"] == 2);
}

TEST_CASE("fusion, camera and history are in the frame") {
  Bench bench;
  bench.drive(2.0);
  fusion_state2_t fusion{};
  fusion.num_modes = 2;
  fusion.mode_name = {"constant_acceleration", "constant_turn"};
  fusion.mode_probability = {0.25, 0.75};
  fusion.mode_log_likelihood = {0.0, 0.0};
  fusion.source = fusion_state2_t::SOURCE_CARRIED;
  fusion.leader = "POSE_WHEEL";
  fusion.reason = "POSE_INS is silent";
  bench.send("FUSION_STATE", kStart_us + 2'000'000, fusion);
  image_t image{};
  image.width_px = image.height_px = 1;
  image.data = {9};
  image.size_bytes = 1;
  bench.send("CAMERA_LEFT", kStart_us + 2'010'000, image);
  vo_features2_t features{};
  append({.track = 5, .left = {10.4, 20.0}, .right = {}, .sigma_px = 0.1, .walk_px = 0.1}, vo_features2_t::USE_INLIER,
         features);
  bench.send("VO_FEATURES", kStart_us + 2'020'000, features);
  bench.send("IMU", kStart_us + 2'600'000, fusion);
  const auto frame = bench.frame();
  CHECK(frame["fusion"]["modes"][1]["p"] == 0.75);
  CHECK(frame["fusion"]["source"] == 2);
  CHECK(frame["fusion"]["leader"] == "POSE_WHEEL");
  CHECK(frame["fusion"]["reason"] == "POSE_INS is silent");
  CHECK(frame["camera"]["features"][0] == nlohmann::json::array({5, 10.0, 20.0, 2}));
  CHECK(frame["camera"]["picture"] == std::to_string(kStart_us + 2'010'000));
  CHECK(bench.board.picture(kStart_us + 2'020'000));
  const auto history = nlohmann::json::parse(bench.board.history().json());
  CHECK(history["t"].size() >= 4);
  CHECK(history["poses"]["POSE_FUSED"]["err"].back().get<double>() == Approx(1.0).margin(0.01));
}

TEST_CASE("the camera shown: the left one as soon as it is heard, or the one that the configuration names") {
  for (const std::string camera : {"", "CAMERA_RIGHT"}) {
    Bench bench(camera);
    bench.drive(2.0);
    const auto shown = [&] {
      return nlohmann::json::parse(bench.view.frame(bench.handler.health().report()))["camera"]["picture"];
    };
    image_t image{};
    image.format = image_t::FORMAT_GRAY8;
    image.width_px = image.height_px = 2;
    image.data.assign(4, 100);
    image.size_bytes = 4;
    const int64_t t = kStart_us + 2'010'000;
    bench.send("CAMERA_RIGHT", t, image);
    CHECK(shown() == std::to_string(t));
    bench.send("CAMERA_LEFT", t + 1'000, image);
    CHECK(shown() == std::to_string(camera.empty() ? t + 1'000 : t));
    bench.send("CAMERA_RIGHT", t + 2'000, image);
    CHECK(shown() == std::to_string(camera.empty() ? t + 1'000 : t + 2'000));
  }
}
