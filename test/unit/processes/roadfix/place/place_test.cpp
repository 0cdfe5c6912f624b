// roadfix place beside a stand-in for the filter: the message that goes out, and what is said of its answer.
#include <catch2/catch.hpp>
#include <roadfix/aiding_t.hpp>
#include <roadfix/pose_t.hpp>

#include "bus/transport/memory_bus.h"
#include "bus/types/message.h"
#include "geometry/frames.h"
#include "gnss_ins_ekf/messages.h"
#include "roadfix/place/place.h"

using namespace roadfix;

namespace {

PriorPose garage() {
  PriorPose p;
  p.t_us = 1'752'003'258'000'000;
  p.place = {52.5 * kDegree, 13.3 * kDegree, 80.0};
  p.cov_enu = Eigen::Vector3d(3.0, 3.0, 5.0).cwiseAbs2().asDiagonal();
  p.yaw = -2.0;
  p.yaw_std = 0.1;
  return p;
}

/// Answers each PRIOR_POSE with this status, and with another measurement's record before it.
struct Filter {
  explicit Filter(MemoryBus& on, int8_t status) : bus(on) {
    bus.subscribe("PRIOR_POSE", [this, status](const BusMessage& m) {
      received = decode<pose_t>(m.bytes);
      aiding_t answer{};
      answer.source = aiding_t::SOURCE_PRIOR_POSE;
      answer.measurement_utime = received->utime - 1;
      answer.status = aiding_t::STATUS_BAD_INPUT;
      bus.publish("AIDING_INS", encode(answer));
      answer.measurement_utime = received->utime;
      answer.status = status;
      answer.dof = 3;
      answer.nis = 400.0;
      answer.innovation = {300.0, 400.0, 0.0};
      answer.innovation_variance = {1.0, 1.0, 1.0};
      bus.publish("AIDING_INS", encode(answer));
    });
  }
  MemoryBus& bus;
  std::optional<pose_t> received;
};

PlaceAnswer answer_of(int8_t status) {
  MemoryBus bus;
  const Filter filter(bus, status);
  return tell_place(bus, garage(), 7, std::chrono::milliseconds(500));
}

}  // namespace

TEST_CASE("the filter gets the place and the heading that were told") {
  MemoryBus bus;
  const Filter filter(bus, aiding_t::STATUS_ACCEPTED);
  CHECK(tell_place(bus, garage(), 7, std::chrono::milliseconds(500)).used);
  REQUIRE(filter.received);
  const PriorPose said = garage(), heard = prior_pose(*filter.received);
  CHECK(heard.t_us == said.t_us);
  CHECK(heard.place.latitude == Approx(said.place.latitude).epsilon(1e-12));
  CHECK(heard.place.longitude == Approx(said.place.longitude).epsilon(1e-12));
  CHECK(heard.place.height == Approx(said.place.height).epsilon(1e-9));
  CHECK(heard.cov_enu == said.cov_enu);
  CHECK(heard.yaw == Approx(said.yaw));
  CHECK(heard.yaw_std == Approx(said.yaw_std));
  // A pose of another point or in a frame of its own claims nothing.
  pose_t other = *filter.received;
  other.origin = pose_t::ORIGIN_ANTENNA;
  CHECK(prior_pose(other).yaw_std == 0.0);
  other = *filter.received;
  other.frame = pose_t::FRAME_LOCAL;
  CHECK(prior_pose(other).yaw_std == 0.0);
}

TEST_CASE("what the filter makes of it is said") {
  CHECK(answer_of(aiding_t::STATUS_ACCEPTED).text == "used");
  const PlaceAnswer gated = answer_of(aiding_t::STATUS_GATED);
  CHECK_FALSE(gated.used);
  CHECK(gated.text == "not used: the filter is 500 m off, 20.0 of the sigmas that both claim");
  CHECK(answer_of(aiding_t::STATUS_NOT_READY).text == "not used: the car has driven on since");
  CHECK_FALSE(answer_of(aiding_t::STATUS_BAD_INPUT).used);
  MemoryBus nobody;
  CHECK_THAT(tell_place(nobody, garage(), 7, std::chrono::milliseconds(100)).text, Catch::StartsWith("no answer"));
}
