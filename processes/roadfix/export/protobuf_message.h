/// Builds one protobuf message field by field (protobuf.dev/programming-guides/encoding). What MCAP export needs is a
/// dozen small messages and their descriptors: less than generated code and a library would be.
#pragma once

#include <bit>
#include <cstdint>
#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

namespace roadfix {

class ProtobufMessage {
 public:
  void varint(int field, uint64_t value) {
    tag(field, kVarint);
    put_varint(value);
  }
  void number(int field, double value) {
    tag(field, kFixed64);
    put_double(value);
  }
  void fixed32(int field, uint32_t value) {
    tag(field, kFixed32);
    for (int i = 0; i < 4; ++i) bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  void text(int field, std::string_view value) {
    bytes(field, {reinterpret_cast<const uint8_t*>(value.data()), value.size()});
  }
  void bytes(int field, std::span<const uint8_t> value) {
    tag(field, kDelimited);
    put_varint(value.size());
    bytes_.insert(bytes_.end(), value.begin(), value.end());
  }
  void message(int field, const ProtobufMessage& value) { bytes(field, value.bytes_); }
  /// A repeated field of doubles, packed as proto3 has it.
  void numbers(int field, std::span<const double> values) {
    tag(field, kDelimited);
    put_varint(values.size() * sizeof(double));
    for (const double value : values) put_double(value);
  }
  /// A message whose fields 1, 2, 3 ... are these doubles: vectors, quaternions, points, colours.
  void vector(int field, std::initializer_list<double> values) {
    tag(field, kDelimited);
    put_varint(values.size() * (1 + sizeof(double)));
    int part = 0;
    for (const double value : values) number(++part, value);
  }

  [[nodiscard]] std::span<const uint8_t> bytes() const { return bytes_; }
  [[nodiscard]] bool empty() const { return bytes_.empty(); }

 private:
  static constexpr unsigned kVarint = 0, kFixed64 = 1, kDelimited = 2, kFixed32 = 5;

  void tag(int field, unsigned wire_type) { put_varint((static_cast<uint64_t>(field) << 3U) | wire_type); }
  void put_varint(uint64_t value) {
    for (; value >= 0x80U; value >>= 7U) bytes_.push_back(static_cast<uint8_t>(value | 0x80U));
    bytes_.push_back(static_cast<uint8_t>(value));
  }
  void put_double(double value) {
    const auto raw = std::bit_cast<uint64_t>(value);
    for (int i = 0; i < 8; ++i) bytes_.push_back(static_cast<uint8_t>(raw >> (8 * i)));
  }

  std::vector<uint8_t> bytes_;
};

}  // namespace roadfix
