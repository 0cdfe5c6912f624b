// Whatever bytes stand in a user's data files, the readers give values or a ConfigError. The first byte chooses a
// reader.
#include <cstdint>
#include <span>
#include <string>

#include "config/config_error.h"
#include "roadfix/import/csv_reader.h"
#include "roadfix/import/image_header.h"
#include "roadfix/import/text_table.h"

namespace {

void read_csv(std::string text) {
  roadfix::CsvReader csv(std::move(text), "fuzz.csv", {{"utime_us", "x"}, {{"a", "b"}, {"word"}, {"n"}}});
  double sum = 0.0;
  while (csv.next()) {
    sum += static_cast<double>(csv.utime(csv.index("utime_us")));
    sum += csv.number(csv.index("x"), -1e3, 1e3);
    if (csv.has("a")) sum += csv.number(csv.index("b"), -1e300, 1e300);
    if (csv.has("n")) sum += static_cast<double>(csv.integer(csv.index("n"), 0, 1000));
    if (csv.has("word") && csv.text(csv.index("word")) == "bad") csv.fail(csv.index("word"), "is bad");
  }
  if (!(sum == sum)) throw std::logic_error("a NaN came through");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const std::span<const uint8_t> rest(data + 1, size - 1);
  const std::string text(rest.begin(), rest.end());
  try {
    switch (data[0]) {
      case 'i':
        static_cast<void>(roadfix::read_image_header(rest));
        break;
      case 't':
        static_cast<void>(roadfix::parse_text_table(text, "fuzz.txt"));
        break;
      default:
        read_csv(text);
        break;
    }
  } catch (const roadfix::ConfigError&) {
    return 0;
  }
  return 0;
}
