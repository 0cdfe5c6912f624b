#include "drivers/protocols/sbg.h"

#include <catch2/catch.hpp>

#include "drivers/protocols/checksums.h"
#include "support/device_bytes.h"

namespace roadfix {
namespace {

using test::Bytes;
using test::Payload;

TEST_CASE("the checksum is CRC-16/KERMIT, with its published check value") {
  CHECK(crc16_sbg(test::bytes_of("123456789")) == 0x2189);  // reveng's catalogue of CRC algorithms
}

TEST_CASE("a frame needs its checksum and its end") {
  const Bytes frame = test::sbg_bytes(kSbgImuShort, Bytes(32, 3));
  CHECK(probe_sbg(frame).fit == Fit::kFrame);
  CHECK(sbg_frame(frame).id == kSbgImuShort);
  CHECK(sbg_frame(frame).payload.size() == 32);
  for (std::size_t i = 0; i < frame.size(); ++i) {
    Bytes wrong = frame;
    wrong[i] ^= 4U;
    CHECK(probe_sbg(wrong).fit != Fit::kFrame);
  }
  const Bytes long_payload = {0xFF, 0x5A, 1, 0, 0xFF, 0xFF};
  CHECK(probe_sbg(long_payload).fit == Fit::kNoFrame);
  CHECK(sbg_frame(test::sbg_bytes(31, Bytes(20, 1), 0x80)).payload.empty());  // a page of a large frame
}

TEST_CASE("IMU_SHORT in both of its scales") {
  constexpr uint16_t kHealthy = 0x00FF, kInRange = 0x0300, kHighScale = 0x0400;
  Payload p(32);
  p.at<uint32_t>(0, 4'000'000'000U).at<uint16_t>(4, kHealthy | kInRange);
  p.at<int32_t>(6, 1048576).at<int32_t>(14, -2097152).at<int32_t>(18, 67108864).at<int32_t>(26, -33554432);
  p.at<int16_t>(30, 25 * 256 + 128);
  const auto m = parse_sbg_imu_short(p.bytes());
  REQUIRE(m);
  CHECK(m->time_us == 4'000'000'000U);
  CHECK(m->healthy);
  CHECK(m->in_range);
  CHECK(m->accel_mps2[0] == 1.0);
  CHECK(m->accel_mps2[2] == -2.0);
  CHECK(m->gyro_radps[0] == 1.0);
  CHECK(m->gyro_radps[2] == -0.5);
  CHECK(m->temperature_c == 25.5);
  p.at<uint16_t>(4, kHealthy | kHighScale).at<int32_t>(18, 12304174);
  CHECK(parse_sbg_imu_short(p.bytes())->gyro_radps[0] == 1.0);
  CHECK_FALSE(parse_sbg_imu_short(p.bytes())->in_range);
  p.at<uint16_t>(4, kHealthy & ~0x0020U);
  CHECK_FALSE(parse_sbg_imu_short(p.bytes())->healthy);
}

TEST_CASE("EKF_NAV and EKF_QUAT") {
  Payload nav(72);
  nav.at<float>(4, 1.5F).at<float>(12, -0.25F).at<float>(16, 0.125F);
  nav.at<double>(28, 48.5).at<double>(36, -3.25).at<double>(44, 120.0).at<float>(52, 47.5F).at<float>(56, 0.5F);
  nav.at<uint32_t>(68, 4U | (1U << 4U) | (1U << 5U) | (1U << 6U) | (1U << 7U));
  const auto m = parse_sbg_ekf_nav(nav.bytes());
  REQUIRE(m);
  CHECK(m->velocity_ned_mps[0] == 1.5);
  CHECK(m->velocity_ned_mps[2] == -0.25);
  CHECK(m->velocity_std_ned_mps[0] == 0.125);
  CHECK(m->lat_deg == 48.5);
  CHECK(m->lon_deg == -3.25);
  CHECK(m->height_msl_m + m->undulation_m == 167.5);
  CHECK(m->position_std_ned_m[0] == 0.5);
  CHECK(m->solution.mode == 4);
  CHECK((m->solution.attitude_valid && m->solution.position_valid));
  Payload quat(44);  // with the declination that newer firmware appends
  quat.at<float>(4, 1.0F).at<float>(20, 0.01F).at<uint32_t>(32, 2U | (1U << 4U));
  const auto q = parse_sbg_ekf_quat(quat.bytes());
  REQUIRE(q);
  CHECK(q->q_ned_body_wxyz[0] == 1.0);
  CHECK(q->roll_pitch_yaw_std_rad[0] == Approx(0.01));
  CHECK(q->solution.attitude_valid);
  CHECK_FALSE(q->solution.heading_valid);
}

TEST_CASE("GPS1_POS, GPS1_VEL and GPS1_HDT, with what is not available") {
  Payload pos(57);
  pos.at<uint32_t>(4, 7U << 6U).at<uint32_t>(8, 1234).at<double>(12, 48.0).at<double>(20, 2.0).at<double>(28, 35.0);
  pos.at<float>(36, 44.0F).at<float>(40, 0.02F).at<uint8_t>(52, 0xFF).at<uint16_t>(55, 0xFFFF);
  auto m = parse_sbg_gps_pos(pos.bytes());
  REQUIRE(m);
  CHECK(m->type == SbgPositionType::kRtkFixed);
  CHECK_FALSE(m->num_satellites);
  CHECK_FALSE(m->correction_age_s);
  CHECK(m->std_north_m == Approx(0.02));
  pos.at<uint32_t>(4, 1U | (7U << 6U)).at<uint8_t>(52, 12).at<uint16_t>(55, 150);
  m = parse_sbg_gps_pos(pos.bytes());
  CHECK(m->type == SbgPositionType::kNone);
  CHECK(m->num_satellites == 12);
  CHECK(*m->correction_age_s == Approx(1.5));
  Payload vel(44);
  vel.at<uint32_t>(4, 2U << 6U).at<float>(12, 3.0F).at<float>(24, 0.1F);
  CHECK(parse_sbg_gps_vel(vel.bytes())->computed);
  CHECK(parse_sbg_gps_vel(vel.bytes())->velocity_ned_mps[0] == 3.0);
  vel.at<uint32_t>(4, 0);
  CHECK_FALSE(parse_sbg_gps_vel(vel.bytes())->computed);
  Payload hdt(26);
  hdt.at<uint32_t>(6, 1234).at<float>(10, 123.5F).at<float>(14, 0.25F);
  CHECK(parse_sbg_gps_hdt(hdt.bytes())->computed);
  CHECK(parse_sbg_gps_hdt(hdt.bytes())->heading_deg == 123.5);
  hdt.at<uint16_t>(4, 1);
  CHECK_FALSE(parse_sbg_gps_hdt(hdt.bytes())->computed);
}

TEST_CASE("a payload that is too short is none") {
  for (std::size_t size = 0; size < 80; ++size) {
    const Bytes p(size);
    CHECK(parse_sbg_imu_short(p).has_value() == (size >= 32));
    CHECK(parse_sbg_ekf_nav(p).has_value() == (size >= 72));
    CHECK(parse_sbg_ekf_quat(p).has_value() == (size >= 36));
    CHECK(parse_sbg_gps_pos(p).has_value() == (size >= 57));
    CHECK(parse_sbg_gps_vel(p).has_value() == (size >= 44));
    CHECK(parse_sbg_gps_hdt(p).has_value() == (size >= 26));
  }
}

}  // namespace
}  // namespace roadfix
