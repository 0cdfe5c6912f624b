#include "gnss_ins/nav_state.h"

#include <catch2/catch.hpp>

#include "random_state.h"

using namespace roadfix;

TEST_CASE("retract and local are inverse") {
  test::RandomState random(1);
  for (int i = 0; i < 20; ++i) {
    const NavState x = random.state(0.5);
    const ErrorVector dx = random.error();
    CHECK((local(x, retract(x, dx)) - dx).norm() < 1e-12);
    const NavState y = random.state(0.5);
    CHECK(local(retract(x, local(x, y)), y).norm() < 1e-12);
  }
}
