#include "bus/types/schema.h"

#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <random>
#include <roadfix/aiding_t.hpp>
#include <roadfix/config_t.hpp>
#include <roadfix/fusion_state2_t.hpp>
#include <roadfix/fusion_state_t.hpp>
#include <roadfix/gnss_t.hpp>
#include <roadfix/health_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/horizon_t.hpp>
#include <roadfix/image_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/ins_status_t.hpp>
#include <roadfix/ledger_t.hpp>
#include <roadfix/mag_t.hpp>
#include <roadfix/pose_t.hpp>
#include <roadfix/protection_level_t.hpp>
#include <roadfix/raw_t.hpp>
#include <roadfix/state_t.hpp>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_features_t.hpp>
#include <roadfix/vo_restart_t.hpp>
#include <roadfix/vo_status_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <set>

#include "bus/types/message.h"
#include "support/shared_data.h"

using namespace roadfix;

namespace {

template <class... Types>
std::map<std::string, int64_t> generated_fingerprints() {
  return {{Types::getTypeName(), Types::getHash()}...};
}

std::map<std::string, int64_t> all_generated() {
  return generated_fingerprints<aiding_t, config_t, fusion_state_t, gnss_t, health_t, protection_level_t, heartbeat_t,
                                horizon_t, image_t, imu_t, ins_status_t, ledger_entry_t, ledger_t, mag_t, pose_t,
                                provenance_t, raw_t, fusion_state2_t, state_t, vo_features2_t, vo_features_t,
                                vo_restart_t, vo_status_t, wheels_t>();
}

ledger_t some_ledger() {
  ledger_t ledger{};
  ledger.num_entries = 3;
  ledger.entries.resize(3);
  for (int i = 0; i < 3; ++i)
    ledger.entries[static_cast<std::size_t>(i)].channel = std::string("POSE_INS_X", static_cast<std::size_t>(i * 5));
  return ledger;
}

aiding_t some_aiding() {
  aiding_t aiding{};
  aiding.provenance.num_inputs = 2;
  aiding.provenance.last_seq = {1, 2};
  aiding.provenance.num_applied = {3, 4};
  aiding.dof = 3;
  aiding.innovation = {1, 2, 3};
  aiding.innovation_variance = {4, 5, 6};
  return aiding;
}

/// Overwrites the first place where `from` stands as a big-endian 32-bit number.
std::vector<uint8_t> with_count(std::vector<uint8_t> bytes, std::size_t offset, int32_t value) {
  for (std::size_t i = 0; i < 4; ++i)
    bytes[offset + i] = static_cast<uint8_t>(static_cast<uint32_t>(value) >> (24 - 8 * i));
  return bytes;
}

Schema schema_of(const std::string& text) { return Schema(std::vector<TypeText>{{"a_t", text}}); }

}  // namespace

TEST_CASE("fingerprints are those of the generated classes, frozen, and unique") {
  const std::map<std::string, int64_t> generated = all_generated();
  REQUIRE(generated.size() == type_texts().size());
  std::set<std::string> frozen, lines;
  std::ifstream file(test::source_path("lcmtypes/FINGERPRINTS.txt"));
  for (std::string line; std::getline(file, line);) frozen.insert(line);
  for (const auto& [type, fingerprint] : generated)
    lines.insert(fmt::format("{} {:016x}", type, static_cast<uint64_t>(fingerprint)));
  // A released type never changes: add name2_t. A new type adds its line.
  for (const std::string& line : lines) {
    CAPTURE("not in FINGERPRINTS.txt", line);
    CHECK(frozen.contains(line));
  }
  CHECK(frozen.size() == lines.size());
  std::set<int64_t> unique;
  for (const auto& [type, fingerprint] : generated) {
    CAPTURE(type);
    CHECK(Schema::built_in().fingerprint(type) == fingerprint);
    CHECK(Schema::built_in().name_of(fingerprint) == type);
    unique.insert(fingerprint);
  }
  REQUIRE(unique.size() == generated.size());
}

TEST_CASE("every message starts with utime, run and seq") {
  for (const auto& [name, type] : Schema::built_in().types()) {
    if (name == "provenance_t" || name == "ledger_entry_t") continue;  // parts of messages
    CAPTURE(name);
    REQUIRE(type.fields.size() > 3);
    CHECK(type.fields[0].name == "utime");
    CHECK(type.fields[1].name == "run");
    CHECK(type.fields[2].name == "seq");
    for (int i = 0; i < 3; ++i) CHECK(type.fields[static_cast<std::size_t>(i)].type == "int64_t");
  }
}

TEMPLATE_TEST_CASE("a message is intact only at its exact length", "", imu_t, gnss_t, pose_t, ledger_t, aiding_t,
                   state_t, fusion_state2_t, heartbeat_t) {
  TestType message{};
  if constexpr (std::is_same_v<TestType, ledger_t>) message = some_ledger();
  if constexpr (std::is_same_v<TestType, aiding_t>) message = some_aiding();
  const std::vector<uint8_t> bytes = encode(message);
  const MessageCheck check = Schema::built_in().check_of(TestType::getTypeName());
  REQUIRE(check(bytes) == CheckResult::kOk);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    REQUIRE(check({bytes.data(), size}) != CheckResult::kOk);
  }
  std::vector<uint8_t> longer = bytes;
  longer.push_back(0);
  REQUIRE(check(longer) == CheckResult::kLeftOver);
  std::vector<uint8_t> other = bytes;
  other[7] ^= 1;
  REQUIRE(check(other) == CheckResult::kWrongType);
}

TEST_CASE("hostile lengths are refused before the decoder sees them") {
  const MessageCheck check = Schema::built_in().check_of("aiding_t");
  const std::vector<uint8_t> bytes = encode(some_aiding());
  const std::size_t num_inputs = 8 + 24 + 16;
  const std::size_t dof = num_inputs + 4 + 32 + 16 + 2 + 8;
  for (const std::size_t offset : {num_inputs, dof}) {
    for (const int32_t value : {-1, 2147483647, -2147483647 - 1, 4, 1 << 29}) {
      CAPTURE(offset, value);
      REQUIRE(check(with_count(bytes, offset, value)) != CheckResult::kOk);
    }
  }
  const MessageCheck ledger_check = Schema::built_in().check_of("ledger_t");
  const std::vector<uint8_t> ledger = encode(some_ledger());
  const std::size_t string_length = 8 + 24 + 8 + 4 + 16 + 1;
  REQUIRE(ledger_check(with_count(ledger, string_length - 21, 1 << 30)) == CheckResult::kBadLength);
  for (const int32_t value : {-1, 0, 2147483647}) {
    REQUIRE(ledger_check(with_count(ledger, string_length, value)) == CheckResult::kBadLength);
  }
  REQUIRE(ledger_check(with_count(ledger, string_length, 3)) == CheckResult::kBadString);
}

TEST_CASE("what the check lets through decodes, whatever the bytes") {
  std::mt19937 random(11);
  const std::vector<uint8_t> bytes = encode(some_ledger());
  const MessageCheck check = Schema::built_in().check_of("ledger_t");
  int passed = 0;
  for (int trial = 0; trial < 20000; ++trial) {
    std::vector<uint8_t> damaged = bytes;
    const std::size_t flips = 1 + random() % 3;
    for (std::size_t i = 0; i < flips; ++i)
      damaged[8 + random() % (damaged.size() - 8)] = static_cast<uint8_t>(random());
    if (check(damaged) != CheckResult::kOk) continue;
    REQUIRE(encode(decode<ledger_t>(damaged)) == damaged);
    ++passed;
  }
  REQUIRE(passed > 1000);
  REQUIRE(passed < 20000);
}

TEST_CASE("type texts that cannot be read are named") {
  using Catch::Contains;
  REQUIRE_THROWS_WITH(schema_of("struct a_t { int64_t utime }"), Contains("a_t") && Contains("';'"));
  REQUIRE_THROWS_WITH(schema_of("struct a_t { double x[n]; int32_t n; }"), Contains("'n'"));
  REQUIRE_THROWS_WITH(schema_of("struct a_t { b_t b; }"), Contains("b_t"));
  REQUIRE_THROWS_WITH(schema_of("struct a_t { a_t a; }"), Contains("contains itself"));
  REQUIRE_THROWS_WITH(schema_of("struct a_t { int8_t"), Contains("ends too early"));
}
