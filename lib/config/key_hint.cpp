#include "config/key_hint.h"

#include <algorithm>
#include <array>
#include <numeric>
#include <string_view>

namespace roadfix {
namespace {

/// Units that a key may end in (docs/STYLE.md, section 2), and those that users reach for instead.
constexpr std::array<std::string_view, 35> kUnits = {
    "m",   "mm",   "cm",  "km",    "mps",   "kmph", "kmh",   "kph",    "mph",   "mps2", "g",   "mg",
    "rad", "mrad", "deg", "radps", "degps", "dps",  "degph", "radps2", "s",     "ms",   "us",  "ns",
    "min", "h",    "hz",  "khz",   "px",    "ut",   "t",     "nt",     "gauss", "per",  "rthz"};

bool is_unit(std::string_view word) { return std::find(kUnits.begin(), kUnits.end(), word) != kUnits.end(); }

/// The key without its trailing words that are units.
std::string_view stem(std::string_view key) {
  while (true) {
    const auto cut = key.rfind('_');
    if (cut == std::string_view::npos || cut == 0 || !is_unit(key.substr(cut + 1))) return key;
    key = key.substr(0, cut);
  }
}

/// Letters to insert, delete or replace (Levenshtein 1966).
std::size_t edit_distance(std::string_view a, std::string_view b) {
  std::vector<std::size_t> row(b.size() + 1);
  std::iota(row.begin(), row.end(), std::size_t{0});
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replace = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replace, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row.back();
}

}  // namespace

bool differ_in_unit_only(const std::string& a, const std::string& b) { return a != b && stem(a) == stem(b); }

std::string closest_key(const std::string& unknown, const std::vector<std::string>& known) {
  constexpr std::size_t kLongestKey = 80;  // what is longer is not a slip of the pen
  if (unknown.size() > kLongestKey) return {};
  for (const std::string& key : known) {
    if (differ_in_unit_only(unknown, key)) return key;
  }
  std::string best;
  std::size_t best_distance = std::max<std::size_t>(2, unknown.size() / 3) + 1;
  for (const std::string& key : known) {
    const std::size_t distance = edit_distance(unknown, key);
    if (distance < best_distance) {
      best_distance = distance;
      best = key;
    }
  }
  return best;
}

}  // namespace roadfix
