#include "stream/overload_choice.h"

#include <catch2/catch.hpp>

using namespace roadfix;

namespace {
constexpr int kImu = 0;
constexpr int kLeft = 1;
constexpr int kRight = 2;
}  // namespace

TEST_CASE("up to its patience nothing is skipped, beyond it all but the newest") {
  OverloadChoice choice({{kLeft, kRight}, 2});
  REQUIRE_FALSE(choice.skips(kLeft, 10, 2));
  REQUIRE(choice.skips(kLeft, 20, 3));
  REQUIRE(choice.skips(kLeft, 30, 2));
  REQUIRE(choice.skips(kLeft, 40, 1));
  REQUIRE_FALSE(choice.skips(kLeft, 50, 0));
  REQUIRE_FALSE(choice.skips(kLeft, 60, 1));
}

TEST_CASE("a stereo pair is skipped as one, in whatever order its pictures come") {
  OverloadChoice choice({{kLeft, kRight}, 0});
  REQUIRE(choice.skips(kLeft, 10, 1));
  REQUIRE_FALSE(choice.skips(kLeft, 20, 0));
  REQUIRE(choice.skips(kRight, 10, 1));  // its partner is gone
  REQUIRE_FALSE(choice.skips(kRight, 20, 5));
}

TEST_CASE("what is no camera is never skipped") {
  OverloadChoice choice({{kLeft}, 0});
  REQUIRE_FALSE(choice.skips(kImu, 10, 1000));
  REQUIRE_FALSE(choice.concerns(kImu));
  OverloadChoice none({});
  REQUIRE_FALSE(none.skips(kLeft, 10, 1000));
}
