#include "bus/types/field_difference.h"

#include <catch2/catch.hpp>
#include <cmath>
#include <roadfix/ledger_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/state_t.hpp>

#include "bus/types/message.h"

using namespace roadfix;

namespace {

template <class T>
std::optional<std::string> difference(const T& a, const T& b, const std::string& skipped = {}) {
  return first_difference(Schema::built_in(), T::getTypeName(), encode(a), encode(b), skipped);
}

}  // namespace

TEST_CASE("the first field that differs is named with both values") {
  pose_t a{};
  REQUIRE_FALSE(difference(a, a));
  pose_t b = a;
  b.position_m[1] = 3.5;
  b.reason = "lost";
  REQUIRE(difference(a, b) == "position_m[1]: 0 and 3.5");
  a.position_m[1] = std::nextafter(3.5, 4.0);
  REQUIRE(difference(a, b) == "position_m[1]: 3.5000000000000004 and 3.5");
  a.position_m[1] = 3.5;
  REQUIRE(difference(a, b) == "reason: '' and 'lost'");
  b.reason = "";
  b.cov_pose_m2_rad2[2][4] = -1.0;
  REQUIRE(difference(a, b) == "cov_pose_m2_rad2[2][4]: 0 and -1");
}

TEST_CASE("fields may be left out, nested arrays and bytes are walked") {
  pose_t a{};
  pose_t b{};
  b.provenance.digest = -7;
  b.seq = 2;
  REQUIRE(difference(a, b) == "seq: 0 and 2");
  b.seq = 0;
  REQUIRE(difference(a, b) == "provenance.digest: 0 and -7");
  REQUIRE_FALSE(difference(a, b, "provenance."));

  ledger_t c{};
  c.num_entries = 2;
  c.entries.resize(2);
  ledger_t d = c;
  d.entries[1].channel = "IMU";
  REQUIRE(difference(c, d) == "entries[1].channel: '' and 'IMU'");

  state_t e{};
  e.size_bytes = 3;
  e.state = {1, 2, 255};
  state_t f = e;
  f.state[2] = 254;
  REQUIRE(difference(e, f) == "state: 0102ff and 0102fe");
}
