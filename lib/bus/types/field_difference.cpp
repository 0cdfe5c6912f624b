#include "bus/types/field_difference.h"

#include <algorithm>
#include <bit>
#include <cstdio>
#include <map>

#include "bus/types/message.h"

namespace roadfix {

namespace {

uint64_t read_big_endian(const uint8_t* data, int bytes) {
  uint64_t value = 0;
  for (int i = 0; i < bytes; ++i) value = (value << 8) | data[i];
  return value;
}

std::string number_text(const std::string& type, uint64_t raw) {
  char text[32];
  if (type == "double") {
    std::snprintf(text, sizeof text, "%.17g", std::bit_cast<double>(raw));
  } else if (type == "float") {
    std::snprintf(text, sizeof text, "%.9g", static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(raw))));
  } else {
    const int unused_bits = 64 - 8 * primitive_bytes(type);
    const auto value = static_cast<int64_t>(raw << unused_bits) >> unused_bits;
    std::snprintf(text, sizeof text, "%lld", static_cast<long long>(value));
  }
  return text;
}

/// Walks a checked message; the bytes are known to suffice.
class Lister {
 public:
  Lister(const Schema& schema, std::span<const uint8_t> rest) : schema_(schema), rest_(rest) {}

  void list_struct(const std::string& prefix, const SchemaType& type) {
    std::vector<int64_t> counts(type.fields.size());
    for (std::size_t i = 0; i < type.fields.size(); ++i) {
      const SchemaField& field = type.fields[i];
      std::vector<int64_t> sizes;
      for (const SchemaDim& dim : field.dims) {
        sizes.push_back(dim.field >= 0 ? counts[static_cast<std::size_t>(dim.field)] : dim.fixed);
      }
      const int bytes = field.type.starts_with("int") ? primitive_bytes(field.type) : 0;  // a struct may begin so too
      if (field.dims.empty() && bytes > 0) {
        const int unused_bits = 64 - 8 * bytes;
        counts[i] = static_cast<int64_t>(read_big_endian(rest_.data(), bytes) << unused_bits) >> unused_bits;
      }
      list_array(prefix + field.name, field.type, sizes, 0);
    }
  }

  std::vector<FieldValue> take() { return std::move(values_); }

 private:
  void list_array(const std::string& path, const std::string& type, const std::vector<int64_t>& sizes,
                  std::size_t level) {
    if (level == sizes.size()) {
      list_one(path, type);
    } else if (type == "byte" && level + 1 == sizes.size()) {
      const auto size = static_cast<std::size_t>(sizes[level]);
      std::string text;
      for (std::size_t i = 0; i < size; ++i) {
        char hex[3];
        std::snprintf(hex, sizeof hex, "%02x", static_cast<unsigned>(rest_[i]));
        text += hex;
      }
      rest_ = rest_.subspan(size);
      values_.push_back({path, text});
    } else {
      for (int64_t i = 0; i < sizes[level]; ++i) {
        list_array(path + "[" + std::to_string(i) + "]", type, sizes, level + 1);
      }
    }
  }

  void list_one(const std::string& path, const std::string& type) {
    if (type == "string") {
      const auto size = static_cast<std::size_t>(read_big_endian(rest_.data(), 4));
      values_.push_back(
          {path, "'" + std::string(rest_.begin() + 4, rest_.begin() + 3 + static_cast<long>(size)) + "'"});
      rest_ = rest_.subspan(4 + size);
    } else if (const int bytes = primitive_bytes(type); bytes > 0) {
      values_.push_back({path, number_text(type, read_big_endian(rest_.data(), bytes))});
      rest_ = rest_.subspan(static_cast<std::size_t>(bytes));
    } else {
      list_struct(path + ".", schema_.type(type));
    }
  }

  const Schema& schema_;
  std::span<const uint8_t> rest_;
  std::vector<FieldValue> values_;
};

/// Long texts and byte arrays are cut around the first place where they differ.
std::string around(const std::string& text, std::size_t place) {
  constexpr std::size_t kShown = 60;
  if (text.size() <= kShown) return text;
  const std::size_t begin = place > kShown / 2 ? place - kShown / 2 : 0;
  return (begin > 0 ? "..." : "") + text.substr(begin, kShown) + (begin + kShown < text.size() ? "..." : "");
}

}  // namespace

std::vector<FieldValue> list_fields(const Schema& schema, const std::string& type, std::span<const uint8_t> bytes) {
  Lister lister(schema, bytes.subspan(8));
  lister.list_struct("", schema.type(type));
  return lister.take();
}

std::optional<std::string> first_difference(const Schema& schema, const std::string& type, std::span<const uint8_t> a,
                                            std::span<const uint8_t> b, const std::string& skipped) {
  std::vector<FieldValue> fields_a = list_fields(schema, type, a);
  std::vector<FieldValue> fields_b = list_fields(schema, type, b);
  for (std::vector<FieldValue>* fields : {&fields_a, &fields_b}) {
    if (!skipped.empty()) std::erase_if(*fields, [&](const FieldValue& f) { return f.path.starts_with(skipped); });
  }
  for (std::size_t i = 0; i < std::min(fields_a.size(), fields_b.size()); ++i) {
    const std::string& value_a = fields_a[i].value;
    const std::string& value_b = fields_b[i].value;
    if (fields_a[i].path != fields_b[i].path) return fields_a[i].path + " and " + fields_b[i].path;
    if (value_a == value_b) continue;
    const auto place = static_cast<std::size_t>(
        std::mismatch(value_a.begin(), value_a.end(), value_b.begin(), value_b.end()).first - value_a.begin());
    return fields_a[i].path + ": " + around(value_a, place) + " and " + around(value_b, place);
  }
  if (fields_a.size() != fields_b.size()) return "the number of fields";
  return std::nullopt;
}

}  // namespace roadfix
