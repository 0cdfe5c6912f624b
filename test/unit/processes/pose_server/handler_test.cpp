#include "pose_server/handler.h"

#include <catch2/catch.hpp>
#include <roadfix/aiding_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <sstream>

#include "bus/types/message.h"
#include "geodesy/enu_anchor.h"
#include "geometry/frames.h"
#include "support/geoid_file.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

constexpr int64_t kStart_us = 1'700'000'000'000'000;

/// 40 m east of the anchor, driving north at 10 m/s with 0.1 m and 0.2 m of sigma.
pose_t pose_at(int64_t t_us) {
  pose_t m{};
  m.utime = t_us;
  m.run = kStart_us;
  m.anchor_lat_deg = 48.0;
  m.anchor_lon_deg = 11.0;
  m.anchor_height_m = 500.0;
  m.position_m[0] = 40.0;
  m.q_wxyz[0] = m.q_wxyz[3] = std::sqrt(0.5);
  m.velocity_mps[0] = 10.0;
  m.cov_pose_m2_rad2[0][0] = 0.01;
  m.cov_pose_m2_rad2[1][1] = 0.04;
  m.cov_pose_m2_rad2[2][2] = 0.09;
  m.validity = pose_t::VALIDITY_VALID;
  return m;
}

gnss_t fix_at(int64_t t_us, int8_t type = gnss_t::FIX_RTK_FIXED) {
  gnss_t m{};
  m.utime = t_us;
  m.fix_type = type;
  m.height_kind = gnss_t::HEIGHT_ELLIPSOID;
  m.has_num_satellites = 1;
  m.num_satellites = 14;
  return m;
}

aiding_t aiding_at(int64_t t_us, int8_t status) {
  aiding_t m{};
  m.utime = m.measurement_utime = t_us;
  m.source = aiding_t::SOURCE_GNSS_POSITION;
  m.status = status;
  return m;
}

struct Server {
  explicit Server(const PoseServerConfig& config = {}, const GeoidModel* geoid = nullptr) : handler(config, geoid) {}

  template <class T>
  std::string give(const char* channel, const T& message) {
    const std::vector<uint8_t> bytes = encode(message);
    return handler.take({channel, bytes, 0}, message.utime);
  }

  /// The fields of the first sentence of a type; empty where there is none.
  static std::vector<std::string> fields(const std::string& text, const std::string& type) {
    std::istringstream lines(text);
    for (std::string line; std::getline(lines, line);) {
      if (line.substr(3, 3) != type) continue;
      std::vector<std::string> out;
      std::istringstream rest(line.substr(0, line.find('*')));
      for (std::string field; std::getline(rest, field, ',');) out.push_back(field);
      return out;
    }
    return {};
  }

  std::string quality(const pose_t& pose) { return fields(give("POSE_FUSED", pose), "GGA").at(6); }

  PoseServerHandler handler;
};

TEST_CASE("pose server: a pose is where it is and looks where it looks") {
  Server server;
  server.give("GNSS", fix_at(kStart_us));
  pose_t pose = pose_at(kStart_us);
  const std::string text = server.give("POSE_FUSED", pose);
  const Geodetic place = EnuAnchor({48.0 * kDegree, 11.0 * kDegree, 500.0}).geodetic({40.0, 0.0, 0.0});
  const auto gga = Server::fields(text, "GGA");
  CHECK(gga.at(6) == "4");
  CHECK(gga.at(7) == "14");
  const double minutes = std::stod(gga.at(4).substr(3));
  CHECK(minutes / 60.0 + 11.0 == Approx(place.longitude / kDegree).margin(2e-8));
  const auto rmc = Server::fields(text, "RMC");
  CHECK(rmc.at(2) == "A");
  CHECK(std::stod(rmc.at(7)) == Approx(10.0 * 3600.0 / 1852.0).margin(1e-3));
  CHECK(std::stod(rmc.at(8)) == Approx(0.0).margin(2e-3));
  CHECK(std::stod(Server::fields(text, "HDT").at(1)) == Approx(0.0).margin(2e-3));
  const auto gst = Server::fields(text, "GST");
  CHECK(std::stod(gst.at(3)) == Approx(0.2));
  CHECK(std::stod(gst.at(4)) == Approx(0.1));
  CHECK(std::stod(gst.at(5)) == Approx(0.0).margin(0.01));  // the long axis points north
  CHECK(std::stod(gst.at(6)) == Approx(0.2));
  CHECK(std::stod(gst.at(7)) == Approx(0.1));
  CHECK(std::stod(gst.at(8)) == Approx(0.3));
}

TEST_CASE("pose server: north is that of the place, not of the anchor") {
  Server server;
  pose_t pose = pose_at(kStart_us);
  pose.position_m[0] = 100'000.0;  // meridians converge by the difference in longitude times sin(latitude)
  const double lon =
      EnuAnchor({48.0 * kDegree, 11.0 * kDegree, 500.0}).geodetic({1e5, 0.0, 0.0}).longitude - 11.0 * kDegree;
  const double heading = std::stod(Server::fields(server.give("POSE_FUSED", pose), "HDT").at(1));
  CHECK(heading == Approx(lon / kDegree * std::sin(48.0 * kDegree)).margin(0.01));
  CHECK(heading > 0.9);
}

TEST_CASE("pose server: quality says what the pose rests on") {
  Server server;
  CHECK(server.quality(pose_at(kStart_us)) == "6");  // no receiver was heard
  int64_t t_us = kStart_us + 1'000'000;
  const auto next = [&] { return pose_at(t_us += 200'000); };
  for (const auto& [type, digit] : std::vector<std::pair<int8_t, std::string>>{{gnss_t::FIX_SINGLE, "1"},
                                                                               {gnss_t::FIX_DIFFERENTIAL, "2"},
                                                                               {gnss_t::FIX_RTK_FLOAT, "5"},
                                                                               {gnss_t::FIX_RTK_FIXED, "4"},
                                                                               {gnss_t::FIX_DEAD_RECKONING, "6"}}) {
    server.give("GNSS", fix_at(t_us, type));
    CHECK(server.quality(next()) == digit);
  }
  server.give("GNSS", fix_at(t_us));
  pose_t coasting = next();
  coasting.validity = pose_t::VALIDITY_COASTING;
  CHECK(server.quality(coasting) == "6");
  t_us += 3'000'000;  // the fix is old
  CHECK(server.quality(next()) == "6");
}

TEST_CASE("pose server: a fix that no estimator took is none") {
  Server server;
  server.give("GNSS", fix_at(kStart_us));
  server.give("AIDING_INS", aiding_at(kStart_us, aiding_t::STATUS_GATED));
  CHECK(server.quality(pose_at(kStart_us)) == "6");
  server.give("AIDING_INS", aiding_at(kStart_us, aiding_t::STATUS_ACCEPTED));
  CHECK(server.quality(pose_at(kStart_us + 200'000)) == "4");
  server.give("GNSS", fix_at(kStart_us + 2'500'000));
  server.give("AIDING_INS", aiding_at(kStart_us + 2'500'000, aiding_t::STATUS_GATED));
  CHECK(server.quality(pose_at(kStart_us + 2'600'000)) == "6");
}

TEST_CASE("pose server: no position of a pose that has none") {
  Server server;
  server.give("GNSS", fix_at(kStart_us));
  pose_t pose = pose_at(kStart_us);
  SECTION("invalid") { pose.validity = pose_t::VALIDITY_INVALID; }
  SECTION("in a frame of its own") { pose.frame = pose_t::FRAME_LOCAL; }
  SECTION("of unknown scale") { pose.scale = pose_t::SCALE_UNKNOWN; }
  SECTION("no number") { pose.position_m[1] = std::nan(""); }
  SECTION("an attitude that is none") { pose.q_wxyz[0] = std::nan(""); }
  SECTION("out of this world") { pose.position_m[0] = 1e300; }
  SECTION("an unknown word") { pose.validity = 77; }
  const std::string text = server.give("POSE_FUSED", pose);
  const auto gga = Server::fields(text, "GGA");
  CHECK(gga.at(6) == "0");
  for (const std::size_t i : {2, 3, 4, 5, 7, 9, 11}) CHECK(gga.at(i).empty());
  CHECK(Server::fields(text, "RMC").at(2) == "V");
  CHECK(Server::fields(text, "HDT").at(1).empty());
  CHECK(text.find("4800") == std::string::npos);
  CHECK_FALSE(server.handler.state_reason().empty());
}

TEST_CASE("pose server: heights are above sea level, or not there") {
  const test::TemporaryFolder folder;
  test::write_geoid(folder.path(), "egm96-5", [](double, double) { return 46.0; });
  const auto geoid = GeoidModel::open("auto", folder.path().string());
  gnss_t fix = fix_at(kStart_us);
  const auto gga = [&](const GeoidModel* model) {
    Server server({}, model);
    server.give("GNSS", fix);
    return Server::fields(server.give("POSE_FUSED", pose_at(kStart_us)), "GGA");
  };
  CHECK(gga(nullptr).at(9).empty());
  CHECK(gga(nullptr).at(11).empty());
  CHECK(gga(geoid.get()).at(9) == "454.00");
  CHECK(gga(geoid.get()).at(11) == "46.00");
  fix.height_kind = gnss_t::HEIGHT_MSL;
  CHECK(gga(nullptr).at(9) == "500.00");
  CHECK(gga(geoid.get()).at(9) == "500.00");
  CHECK(gga(geoid.get()).at(11).empty());
  fix.height_kind = gnss_t::HEIGHT_UNKNOWN;
  CHECK(gga(geoid.get()).at(9).empty());
}

TEST_CASE("pose server: the place told is the configured point") {
  PoseServerConfig config;
  config.point = {0.0, 40.0, 0.0};  // to the left, which is west: back to the anchor
  Server server(config);
  const auto gga = Server::fields(server.give("POSE_FUSED", pose_at(kStart_us)), "GGA");
  CHECK(gga.at(2) == "4800.000000");
  CHECK(gga.at(4) == "01100.000000");
}

TEST_CASE("pose server: each sentence at its rate, on full seconds") {
  PoseServerConfig config;
  config.rates = {10.0, 5.0, 2.0, 100.0, 1.0, 0.0};
  Server server(config);
  std::map<std::string, int> count;
  std::vector<std::string> times;
  for (int64_t i = 0; i < 500; ++i) {
    const std::string text = server.give("POSE_FUSED", pose_at(kStart_us + i * 10'000 + 3'000));
    for (const char* type : {"GGA", "RMC", "VTG", "HDT", "GST", "ZDA"})
      count[type] += Server::fields(text, type).empty() ? 0 : 1;
    if (const auto gga = Server::fields(text, "GGA"); !gga.empty()) times.push_back(gga.at(1).substr(6));
  }
  CHECK(count ==
        std::map<std::string, int>{{"GGA", 50}, {"RMC", 25}, {"VTG", 10}, {"HDT", 500}, {"GST", 5}, {"ZDA", 0}});
  for (std::size_t i = 0; i < times.size(); ++i) CHECK(times[i] == "." + std::to_string(i % 10) + "03");
}

TEST_CASE("pose server: silence is told, and no old pose comes again") {
  Server server;
  CHECK_FALSE(server.give("POSE_FUSED", pose_at(kStart_us)).empty());
  CHECK(server.give("POSE_FUSED", pose_at(kStart_us)).empty());  // the same again
  CHECK(server.handler.refused() == 1);
  CHECK(server.handler.advance(kStart_us + 400'000).empty());
  const std::string text = server.handler.advance(kStart_us + 600'000);
  CHECK(Server::fields(text, "GGA").at(6) == "0");
  CHECK(Server::fields(text, "RMC").at(2) == "V");
  CHECK(server.handler.state_reason() == "POSE_FUSED is silent for 0.6 s");
  CHECK(server.handler.advance(kStart_us + 600'000).empty());  // at its rate, too
  CHECK(server.quality(pose_at(kStart_us + 800'000)) == "6");
  CHECK(server.handler.state_reason().empty());
}

TEST_CASE("pose server: a drive played again begins again") {
  Server server;
  CHECK_FALSE(server.give("POSE_FUSED", pose_at(kStart_us)).empty());
  const std::vector<uint8_t> bytes = encode(pose_at(kStart_us - 90'000'000));
  CHECK_FALSE(server.handler.take({"POSE_FUSED", bytes, 0}, kStart_us + 10'000).empty());
}

TEST_CASE("pose server: broken messages are counted, wherever they are cut") {
  Server server;
  const std::vector<uint8_t> bytes = encode(pose_at(kStart_us));
  for (std::size_t cut = 0; cut < bytes.size(); ++cut) {
    CHECK(server.handler.take({"POSE_FUSED", std::span(bytes).first(cut), 0}, kStart_us).empty());
  }
  CHECK(server.handler.refused() == static_cast<int64_t>(bytes.size()));
  CHECK(server.handler.poses() == 0);
  CHECK(server.handler.take({"OTHER", bytes, 0}, kStart_us).empty());
}

}  // namespace
}  // namespace roadfix
