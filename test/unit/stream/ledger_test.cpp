#include "stream/ledger.h"

#include <catch2/catch.hpp>

using namespace roadfix;

TEST_CASE("entries get the next clock sample's time and ascending numbers") {
  Ledger ledger;
  ledger.note(LedgerKind::kLost, 0, 1, 5, 6, 0);
  REQUIRE(ledger.total() == 0);
  REQUIRE(ledger.enter(100) == 1);
  REQUIRE(ledger.enter(200) == 0);
  ledger.note(LedgerKind::kLate, 1, 1, 5, 5, 90);
  ledger.note(LedgerKind::kRefused, 1, 1, 6, 6, 95);
  REQUIRE(ledger.enter(300) == 2);
  REQUIRE(ledger.total() == 3);
  REQUIRE(ledger.recent().size() == 3);
  for (std::size_t i = 0; i < 3; ++i) CHECK(ledger.recent()[i].entry == static_cast<int64_t>(i) + 1);
  CHECK(ledger.recent()[0].at_clock_utime == 100);
  CHECK(ledger.recent()[2].at_clock_utime == 300);
}

TEST_CASE("contiguous seqs of one kind are one entry, run starts are not") {
  Ledger ledger;
  ledger.note(LedgerKind::kLate, 0, 1, 5, 5, 50);
  ledger.note(LedgerKind::kLate, 0, 1, 6, 6, 60);
  ledger.note(LedgerKind::kLate, 0, 1, 8, 8, 80);
  ledger.note(LedgerKind::kRunBegan, 0, 2, 0, 0, 90);
  ledger.note(LedgerKind::kRunBegan, 0, 2, 1, 1, 91);
  REQUIRE(ledger.enter(100) == 4);
  CHECK(ledger.recent()[0].first_seq == 5);
  CHECK(ledger.recent()[0].last_seq == 6);
  CHECK(ledger.recent()[0].utime == 50);
}

TEST_CASE("entries are repeated for a minute of data, with a limit") {
  Ledger ledger;
  ledger.note(LedgerKind::kLost, 0, 1, 5, 5, 0);
  ledger.enter(1'000'000);
  ledger.enter(61'000'000);
  REQUIRE(ledger.recent().size() == 1);
  ledger.enter(61'000'001);
  REQUIRE(ledger.recent().empty());
  for (int i = 0; i < 5000; ++i) ledger.note(LedgerKind::kLost, 0, 1, 2 * i, 2 * i, 0);
  REQUIRE(ledger.enter(62'000'000) == 5000);
  REQUIRE(ledger.recent().size() == Ledger::kMaxRepeated);
  REQUIRE(ledger.recent().back().entry == 5001);
}
