#include "bus/types/type_conversion.h"

#include <bit>
#include <catch2/catch.hpp>
#include <map>
#include <roadfix/vo_features2_t.hpp>
#include <roadfix/vo_features_t.hpp>

#include "bus/log/log_reader.h"
#include "bus/types/field_difference.h"
#include "bus/types/message.h"
#include "support/shared_data.h"

using namespace roadfix;
using Catch::Contains;

namespace {

const std::vector<ReleasedTypes> kReleased = {{"0.1",
                                               {{"point_t", "struct point_t { float x_m; int8_t kind; }"},
                                                {"track_t",
                                                 "struct track_t { int64_t utime; int16_t n; float u_px[n]; string "
                                                 "label; point_t points[n]; int32_t wide; double old_name; }"}}}};
const Schema kCurrent({{"point2_t", "struct point2_t { double x_m; int8_t kind; int8_t colour; }"},
                       {"track2_t",
                        "struct track2_t { int64_t utime; int16_t n; string label; string note; float u_px[n]; "
                        "float sigma_px[n]; point2_t points[n]; int64_t wide; double new_name; }"}});
const TypeRule kPoint = {"0.1", "point_t", "point2_t", {{"colour", "", 7.0}}};
TypeRule track_rule() {
  TypeRule rule{"0.1", "track_t", "track2_t", {}};
  rule.fields = {{"note", "", 0.0}, {"sigma_px", "", 0.5}, {"points", "points", 0.0}, {"new_name", "old_name", 0.0}};
  return rule;
}

/// Bytes as LCM writes them.
struct Message {
  std::vector<uint8_t> bytes;
  Message& integer(int64_t value, int size) {
    for (int i = size - 1; i >= 0; --i) bytes.push_back(static_cast<uint8_t>(static_cast<uint64_t>(value) >> (8 * i)));
    return *this;
  }
  Message& real(double value) { return integer(std::bit_cast<int64_t>(value), 8); }
  Message& single(float value) { return integer(std::bit_cast<int32_t>(value), 4); }
  Message& text(const std::string& value) {
    integer(static_cast<int64_t>(value.size()) + 1, 4);
    bytes.insert(bytes.end(), value.begin(), value.end());
    bytes.push_back(0);
    return *this;
  }
};

Message old_track() {
  const Schema old(kReleased[0].texts);
  Message m;
  m.integer(old.fingerprint("track_t"), 8).integer(123, 8).integer(2, 2).single(1.5F).single(2.5F).text("left");
  m.single(0.25F).integer(-3, 1).single(8.0F).integer(4, 1).integer(-70'000, 4).real(3.125);
  return m;
}

std::map<std::string, std::string> fields_of(const std::vector<uint8_t>& bytes) {
  REQUIRE(kCurrent.check_of("track2_t")(bytes) == CheckResult::kOk);
  std::map<std::string, std::string> out;
  for (const FieldValue& f : list_fields(kCurrent, "track2_t", bytes)) out[f.path] = f.value;
  return out;
}

std::vector<std::vector<uint8_t>> messages_of(const std::string& channel) {
  LogReader reader(test::source_path("logs/released/0.1.lcm"));
  std::vector<std::vector<uint8_t>> out;
  while (const std::optional<LogEvent> event = reader.next()) {
    if (event->channel == channel || channel.empty()) out.emplace_back(event->data.begin(), event->data.end());
  }
  return out;
}

}  // namespace

TEST_CASE("type conversion: copied, filled, renamed, widened and nested fields") {
  const TypeConverter converter(kReleased, kCurrent, {kPoint, track_rule()});
  std::vector<uint8_t> out;
  REQUIRE(converter(old_track().bytes, out) == TypeConverter::Result::kConverted);
  CHECK(fields_of(out) == std::map<std::string, std::string>{{"utime", "123"},
                                                             {"n", "2"},
                                                             {"label", "'left'"},
                                                             {"note", "''"},
                                                             {"u_px[0]", "1.5"},
                                                             {"u_px[1]", "2.5"},
                                                             {"sigma_px[0]", "0.5"},
                                                             {"sigma_px[1]", "0.5"},
                                                             {"points[0].x_m", "0.25"},
                                                             {"points[0].kind", "-3"},
                                                             {"points[0].colour", "7"},
                                                             {"points[1].x_m", "8"},
                                                             {"points[1].kind", "4"},
                                                             {"points[1].colour", "7"},
                                                             {"wide", "-70000"},
                                                             {"new_name", "3.125"}});
  CHECK(*converter.old_name(read_int64(old_track().bytes.data())) == "track_t of 0.1");
}

TEST_CASE("type conversion: what is not old stays, what is cut is broken") {
  const TypeConverter converter(kReleased, kCurrent, {kPoint, track_rule()});
  std::vector<uint8_t> out;
  const std::vector<uint8_t> whole = old_track().bytes;
  for (std::size_t cut = 0; cut < whole.size(); ++cut) {
    const auto result = converter(std::span(whole).first(cut), out);
    CHECK(result == (cut < 8 ? TypeConverter::Result::kCurrent : TypeConverter::Result::kBroken));
  }
  std::vector<uint8_t> longer = whole;
  longer.push_back(0);
  CHECK(converter(longer, out) == TypeConverter::Result::kBroken);
  longer = whole;
  longer[16] = 0x7F;  // 32514 elements
  CHECK(converter(longer, out) == TypeConverter::Result::kBroken);
  REQUIRE(converter(whole, out) == TypeConverter::Result::kConverted);
  const std::vector<uint8_t> today = out;
  CHECK(converter(today, out) == TypeConverter::Result::kCurrent);
}

TEST_CASE("type conversion: a table that leaves something open is refused") {
  const auto with = [](const auto& change) {
    TypeRule rule = track_rule();
    change(rule);
    return std::vector<TypeRule>{kPoint, rule};
  };
  const auto refuses = [](const std::vector<TypeRule>& rules, const std::string& what) {
    CHECK_THROWS_WITH(TypeConverter(kReleased, kCurrent, rules), Contains(what));
  };
  refuses(with([](TypeRule& r) { r.fields.erase(r.fields.begin()); }), "note is new, and no rule says what it holds");
  refuses(with([](TypeRule& r) { r.fields[0].field = "nonsense"; }), "nonsense is no field of the new type");
  refuses(with([](TypeRule& r) { r.fields[3].from = "nonsense"; }), "nonsense is no field of the old type");
  refuses(with([](TypeRule& r) { r.fields[3].from = "u_px"; }), "new_name has another size");
  refuses(with([](TypeRule& r) { r.fields[3].from = "label"; }), "new_name has another type");
  refuses(with([](TypeRule& r) { r.fields[2].from.clear(); }), "points is a struct");
  refuses(with([](TypeRule& r) { r.version = "0.0"; }), "version 0.0: not there");
  refuses(with([](TypeRule& r) { r.to = "other_t"; }), "other_t: unknown");
  refuses({track_rule()}, "points has another type, which no rule converts");
  refuses({kPoint, track_rule(), track_rule()}, "two rules");
}

TEST_CASE("released types: what was released is there still, or a rule says what it became") {
  REQUIRE_FALSE(released_types().empty());
  REQUIRE_NOTHROW(TypeConverter::built_in());
  const Schema& current = Schema::built_in();
  for (const ReleasedTypes& version : released_types()) {
    const Schema old(version.texts);
    REQUIRE_FALSE(old.types().empty());
    for (const auto& [name, type] : old.types()) {
      INFO(name << " of " << version.version
                << ": a released type is never changed; add another one and a rule (docs/TYPES.md)");
      const int64_t fingerprint = old.fingerprint(name);
      CHECK((current.name_of(fingerprint) == name || TypeConverter::built_in().old_name(fingerprint)));
    }
  }
}

TEST_CASE("released types: a log of 0.1 becomes one of today") {
  const TypeConverter& converter = TypeConverter::built_in();
  const Schema& current = Schema::built_in();
  std::vector<uint8_t> out;
  int converted = 0;
  for (const std::vector<uint8_t>& message : messages_of("")) {
    const auto result = converter(message, out);
    REQUIRE(result != TypeConverter::Result::kBroken);
    if (result == TypeConverter::Result::kConverted) ++converted;
    const std::vector<uint8_t>& now = result == TypeConverter::Result::kConverted ? out : message;
    const auto name = current.name_of(read_int64(now.data()));
    REQUIRE(name);
    CHECK(current.check_of(*name)(now) == CheckResult::kOk);
  }
  CHECK(converted >= 9);
}

TEST_CASE("released types: tracks of 0.1 keep what they had and say what they had not") {
  const std::vector<std::vector<uint8_t>> messages = messages_of("VO_FEATURES");
  REQUIRE(messages.size() == 9);
  std::vector<uint8_t> out;
  for (const std::vector<uint8_t>& message : messages) {
    REQUIRE(TypeConverter::built_in()(message, out) == TypeConverter::Result::kConverted);
    const auto old = decode<vo_features_t>(message);
    const auto now = decode<vo_features2_t>(out);
    REQUIRE(old.num_features > 10);
    CHECK(now.utime == old.utime);
    CHECK(now.provenance.digest == old.provenance.digest);
    CHECK(now.track_id == old.track_id);
    CHECK(now.u_px == old.u_px);
    CHECK(now.v_px == old.v_px);
    CHECK(now.use == old.use);
    CHECK(now.sigma_px == std::vector<float>(old.u_px.size(), 1.0F));
    CHECK(now.right == std::vector<int8_t>(old.u_px.size(), vo_features2_t::RIGHT_NONE));
  }
}
