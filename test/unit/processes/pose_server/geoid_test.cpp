#include "pose_server/geoid.h"

#include <catch2/catch.hpp>

#include "support/geoid_file.h"
#include "support/temporary_folder.h"

namespace roadfix {
namespace {

using Catch::Contains;

TEST_CASE("geoid: heights of a file, by name and found") {
  const test::TemporaryFolder folder;
  test::write_geoid(folder.path(), "egm96-5", [](double lat, double) { return 0.5 * lat; });
  test::write_geoid(folder.path(), "egm84-30", [](double, double) { return 7.0; });
  const auto found = GeoidModel::open("auto", folder.path().string());
  REQUIRE(found);
  CHECK(found->name() == "egm96-5");
  CHECK(*found->separation_m(48.0, 11.0) == Approx(24.0).margin(0.01));
  CHECK(*found->separation_m(-20.0, -170.0) == Approx(-10.0).margin(0.01));
  const auto named = GeoidModel::open("egm84-30", folder.path().string());
  REQUIRE(named);
  CHECK(*named->separation_m(48.0, 11.0) == Approx(7.0).margin(0.01));
}

TEST_CASE("geoid: what is not there") {
  const test::TemporaryFolder folder;
  CHECK(GeoidModel::open("auto", folder.path().string()) == nullptr);
  CHECK(GeoidModel::open("none", folder.path().string()) == nullptr);
  CHECK_THROWS_WITH(GeoidModel::open("egm96-5", folder.path().string()),
                    Contains("geoid 'egm96-5'") && Contains("geographiclib-get-geoids egm96-5"));
  std::ofstream(folder / "egm96-5.pgm") << "P5\nno geoid\n";
  CHECK_THROWS_AS(GeoidModel::open("egm96-5", folder.path().string()), GeoidError);
  CHECK(GeoidModel::open("auto", folder.path().string()) == nullptr);
}

TEST_CASE("geoid: a file cut short is no geoid") {
  const test::TemporaryFolder folder;
  test::write_geoid(folder.path(), "egm96-5", [](double, double) { return 1.0; });
  const auto size = std::filesystem::file_size(folder / "egm96-5.pgm");
  for (std::uintmax_t cut = 0; cut < size; cut += 97) {
    std::filesystem::resize_file(folder / "egm96-5.pgm", cut);
    CHECK_THROWS_AS(GeoidModel::open("egm96-5", folder.path().string()), GeoidError);
    test::write_geoid(folder.path(), "egm96-5", [](double, double) { return 1.0; });
  }
}

TEST_CASE("geoid: a place that is none has no height") {
  const test::TemporaryFolder folder;
  test::write_geoid(folder.path(), "egm96-5", [](double, double) { return 1.0; });
  const auto geoid = GeoidModel::open("egm96-5", folder.path().string());
  CHECK_FALSE(geoid->separation_m(std::nan(""), 0.0));
  CHECK_FALSE(geoid->separation_m(91.0, 0.0));
}

}  // namespace
}  // namespace roadfix
