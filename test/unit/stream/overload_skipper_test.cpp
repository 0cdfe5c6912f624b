#include "stream/overload_skipper.h"

#include <catch2/catch.hpp>

using namespace roadfix;

namespace {
constexpr int kImu = 0;
constexpr int kLeft = 1;
constexpr int kRight = 2;
}  // namespace

TEST_CASE("up to max_waiting nothing is skipped, beyond it all but the newest") {
  OverloadSkipper choice({{kLeft, kRight}, 2});
  REQUIRE_FALSE(choice.skips(kLeft, 10, 2));
  REQUIRE(choice.skips(kLeft, 20, 3));
  REQUIRE(choice.skips(kLeft, 30, 2));
  REQUIRE(choice.skips(kLeft, 40, 1));
  REQUIRE_FALSE(choice.skips(kLeft, 50, 0));
  REQUIRE_FALSE(choice.skips(kLeft, 60, 1));
}

TEST_CASE("a stereo pair is skipped together, in either order of its images") {
  OverloadSkipper choice({{kLeft, kRight}, 0});
  REQUIRE(choice.skips(kLeft, 10, 1));
  REQUIRE_FALSE(choice.skips(kLeft, 20, 0));
  REQUIRE(choice.skips(kRight, 10, 1));  // its partner is gone
  REQUIRE_FALSE(choice.skips(kRight, 20, 5));
}

TEST_CASE("only cameras are skipped") {
  OverloadSkipper choice({{kLeft}, 0});
  REQUIRE_FALSE(choice.skips(kImu, 10, 1000));
  REQUIRE_FALSE(choice.concerns(kImu));
  OverloadSkipper none({});
  REQUIRE_FALSE(none.skips(kLeft, 10, 1000));
}
