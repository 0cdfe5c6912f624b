#include <catch2/catch.hpp>
#include <limits>

#include "bus/verify/output_difference.h"

using namespace roadfix;

namespace {

std::string words(int64_t first_seq, int64_t last_seq) {
  StageSpec spec;
  spec.inputs.emplace_back().channel = "GNSS";
  LogLoss loss;
  loss.first_seq = first_seq;
  loss.last_seq = last_seq;
  return describe_loss(spec, loss);
}

constexpr int64_t kFirst = std::numeric_limits<int64_t>::min();
constexpr int64_t kLast = std::numeric_limits<int64_t>::max();

}  // namespace

TEST_CASE("a loss says which messages the log lacks") {
  REQUIRE(words(7, 9) == "GNSS: seq 7 to 9 not in the log");
  REQUIRE(words(7, 7) == "GNSS: seq 7 not in the log");
  REQUIRE(words(kFirst, 9) == "GNSS: the log begins with seq 10");
  REQUIRE(words(kFirst, kLast) == "GNSS: not in the log");
}
