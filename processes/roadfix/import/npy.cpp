#include "roadfix/import/npy.h"

#include <fmt/format.h>

#include <bit>
#include <cstring>

#include "config/config_error.h"
#include "config/scalar.h"
#include "roadfix/mcap/byte_cursor.h"

namespace roadfix {
namespace {

constexpr std::size_t kMaxNumbers = std::size_t{1} << 27U;

struct Header {
  std::string type;  ///< "<f8"
  bool fortran = false;
  std::vector<std::size_t> shape;
};

/// Reads the header's Python dictionary {'descr': '<f8', 'fortran_order': False, 'shape': (3, 4), }.
class HeaderText {
 public:
  HeaderText(std::string_view text, const std::string& file, uint64_t offset)
      : text_(text), file_(file), offset_(offset) {}

  Header read() {
    Header header;
    bool has_type = false, has_order = false, has_shape = false;
    expect('{');
    while (!skip('}')) {
      const std::string key = quoted();
      expect(':');
      if (key == "descr") {
        header.type = quoted();
        has_type = true;
      } else if (key == "fortran_order") {
        header.fortran = boolean();
        has_order = true;
      } else if (key == "shape") {
        header.shape = numbers();
        has_shape = true;
      } else {
        fail("key '" + key + "' is not known");
      }
      if (skip('}')) break;
      expect(',');
    }
    if (!has_type || !has_order || !has_shape) fail("descr, fortran_order or shape is missing");
    return header;
  }

 private:
  [[noreturn]] void fail(const std::string& what) const {
    throw ConfigError(file_, 0, fmt::format("at offset {}: the header of the array: {}", offset_ + at_, what));
  }
  void blanks() {
    while (at_ < text_.size() && (text_[at_] == ' ' || text_[at_] == '\n')) ++at_;
  }
  bool skip(char c) {
    blanks();
    if (at_ >= text_.size() || text_[at_] != c) return false;
    ++at_;
    return true;
  }
  void expect(char c) {
    if (!skip(c)) fail(fmt::format("'{}' is missing", c));
  }
  std::string quoted() {
    expect('\'');
    const std::size_t end = text_.find('\'', at_);
    if (end == std::string_view::npos) fail("a quote has no end; arrays of several types are not read");
    std::string word(text_.substr(at_, end - at_));
    for (char& c : word) c = c >= ' ' && c < 0x7f ? c : '?';
    at_ = end + 1;
    return word;
  }
  bool boolean() {
    blanks();
    for (const auto& [word, value] : {std::pair<std::string_view, bool>("True", true), {"False", false}}) {
      if (text_.substr(at_).starts_with(word)) {
        at_ += word.size();
        return value;
      }
    }
    fail("fortran_order must be True or False");
  }
  std::vector<std::size_t> numbers() {
    std::vector<std::size_t> shape;
    expect('(');
    while (!skip(')')) {
      blanks();
      const std::size_t end = std::min(text_.find_first_not_of("0123456789", at_), text_.size());
      const auto value = parse_integer(text_.substr(at_, end - at_));
      if (!value || static_cast<uint64_t>(*value) > kMaxNumbers) fail("shape must be of numbers up to 134217728");
      shape.push_back(static_cast<std::size_t>(*value));
      at_ = end;
      if (skip(')')) break;
      expect(',');
    }
    return shape;
  }

  std::string_view text_;
  const std::string& file_;
  uint64_t offset_;
  std::size_t at_ = 0;
};

template <class T>
double number(const uint8_t* bytes) {
  T value;
  std::memcpy(&value, bytes, sizeof value);
  return static_cast<double>(value);
}

struct ElementType {
  std::size_t size = 0;
  double (*read)(const uint8_t*) = nullptr;
};

/// Nothing to read by: a type that is not known.
ElementType element_type(const std::string& name) {
  static_assert(std::endian::native == std::endian::little);
  if (name == "<f8") return {8, number<double>};
  if (name == "<f4") return {4, number<float>};
  if (name == "<i8") return {8, number<int64_t>};
  if (name == "<u8") return {8, number<uint64_t>};
  if (name == "<i4") return {4, number<int32_t>};
  if (name == "<u4") return {4, number<uint32_t>};
  if (name == "<i2") return {2, number<int16_t>};
  if (name == "<u2") return {2, number<uint16_t>};
  if (name == "|i1") return {1, number<int8_t>};
  if (name == "|u1" || name == "|b1") return {1, number<uint8_t>};
  return {};
}

Header read_header(ByteCursor& cursor, const std::string& file) {
  constexpr std::string_view kMagic = "\x93NUMPY";
  const std::span<const uint8_t> magic = cursor.take(kMagic.size(), "the array's signature");
  if (std::memcmp(magic.data(), kMagic.data(), kMagic.size()) != 0) {
    throw ConfigError(file, 0, "at offset 0: is no array of numpy.save: the signature \\x93NUMPY is missing");
  }
  const auto major = cursor.number<uint8_t>("version");
  static_cast<void>(cursor.number<uint8_t>("version"));
  if (major < 1 || major > 3) cursor.fail(fmt::format("version {} of the format is not known, 1 to 3 are", major));
  const std::size_t length =
      major == 1 ? cursor.number<uint16_t>("the header's length") : cursor.number<uint32_t>("the header's length");
  const uint64_t offset = cursor.offset();
  const std::span<const uint8_t> text = cursor.take(length, "the header");
  return HeaderText({reinterpret_cast<const char*>(text.data()), text.size()}, file, offset).read();
}

}  // namespace

NpyArray parse_npy(std::span<const uint8_t> bytes, const std::string& file) {
  const BytePlace place{file};
  ByteCursor cursor(bytes, place);
  const Header header = read_header(cursor, file);
  const ElementType type = element_type(header.type);
  if (type.read == nullptr)
    cursor.fail("elements of type '" + header.type + "' are not read: little-endian floats and integers are");
  if (header.shape.empty() || header.shape.size() > 2)
    cursor.fail(fmt::format("has {} dimensions, must have 1 or 2", header.shape.size()));
  NpyArray array;
  array.file = file;
  array.rows = header.shape[0];
  array.columns = header.shape.size() == 2 ? header.shape[1] : 1;
  const std::size_t count = array.rows * array.columns;  // each up to 2^27: no overflow
  if (count > kMaxNumbers) cursor.fail("has more than 134217728 numbers");
  const std::span<const uint8_t> data = cursor.take(count * type.size, "the numbers");
  if (!cursor.at_end()) cursor.fail(fmt::format("{} bytes behind the numbers", cursor.left()));
  array.numbers.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t to = header.fortran ? (i % array.rows) * array.columns + i / array.rows : i;
    array.numbers[to] = type.read(data.data() + i * type.size);
  }
  return array;
}

NpyArray read_npy(const std::filesystem::path& path, std::size_t columns) {
  const std::string text = read_text_file(path, std::size_t{1} << 30U);
  NpyArray array = parse_npy(std::span(reinterpret_cast<const uint8_t*>(text.data()), text.size()), path.string());
  if (array.columns != columns) {
    throw ConfigError(path.string(), 0, fmt::format("has {} columns, must have {}", array.columns, columns));
  }
  return array;
}

}  // namespace roadfix
