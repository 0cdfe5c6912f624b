/// One signal of a CAN frame, described as a DBC file describes it: "SG_ name : start|length@order sign
/// (factor,offset)". Facts: Vector, DBC File Format Documentation 1.0.5, section 8.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace roadfix {

enum class CanByteOrder {
  kLittle,  ///< Intel, @1: start_bit is that of the least significant bit
  kBig      ///< Motorola, @0: start_bit is that of the most significant bit
};

struct CanSignal {
  std::string frame;  ///< identifier in hex, for example "0x1A0"; eight digits or a value above 7FF: 29 bits
  int start_bit = 0;  ///< bit i of byte k is 8 k + i, bit 0 the least significant
  int length = 8;     ///< bits
  CanByteOrder byte_order = CanByteOrder::kLittle;
  bool is_signed = false;
  double factor = 1.0;  ///< value in SI units = factor * raw + offset
  double offset = 0.0;
  std::vector<int64_t> invalid;  ///< raw values that mean "not available"
};

template <class Visitor>
void visit(CanSignal& c, Visitor& v) {
  v.require("frame");
  v.text("frame", c.frame);
  v.integer("start_bit", c.start_bit, 0, 511);
  v.integer("length", c.length, 1, 64);
  v.choice("byte_order", c.byte_order, {{"little", CanByteOrder::kLittle}, {"big", CanByteOrder::kBig}});
  v.boolean("signed", c.is_signed);
  v.number("factor", c.factor, -1e9, 1e9);
  v.number("offset", c.offset, -1e9, 1e9);
  v.integers("invalid", c.invalid, INT64_MIN, INT64_MAX);
}

struct CanId {
  uint32_t id = 0;
  bool extended = false;
  bool operator==(const CanId&) const = default;
};
/// Absent where the text is no identifier.
std::optional<CanId> parse_can_id(const std::string& text);

/// The signal's raw number; absent where the frame is too short for it.
std::optional<int64_t> raw_value(const CanSignal& signal, std::span<const uint8_t> data);

/// In SI units; absent also where the raw number means "not available".
std::optional<double> value_of(const CanSignal& signal, std::span<const uint8_t> data);

}  // namespace roadfix
