// Bytes of a message to its fields.
#include <fmt/format.h>

#include <bit>

#include "roadfix/rosbag/ros_type.h"

namespace roadfix {

class RosDecoder {
 public:
  RosDecoder(const RosType& type, std::span<const uint8_t> bytes)
      : type_(type), bytes_(bytes), cdr_(type.encoding_ == RosType::Encoding::kCdr) {
    if (cdr_) take_encapsulation();
  }

  void decode(const RosType::Program& program, RosRecord& record) {
    record.values.resize(program.slots.size());
    for (const RosType::Step& step : program.steps) {
      if (step.kind == Kind::kFiller) {
        take(1);
      } else if (step.array == RosType::kSingle) {
        one(step, record.values[step.slot]);
      } else {
        array(step, record.values[step.slot]);
      }
    }
  }

  /// CDR may be filled up to a multiple of four.
  void require_end() const {
    constexpr std::size_t kFill = 3;
    const std::size_t left = bytes_.size() - position_;
    if (left > (cdr_ ? kFill : 0)) throw RosError(fmt::format("{} bytes are left over", left));
  }

 private:
  using Kind = RosType::Kind;

  void take_encapsulation() {
    const std::span<const uint8_t> head = take(4);
    if (head[0] != 0 || head[1] > 1) {
      throw RosError(fmt::format("encapsulation {:02x}{:02x} is not plain CDR", head[0], head[1]));
    }
    little_ = head[1] == 1;
    origin_ = position_;
  }

  std::span<const uint8_t> take(uint64_t size) {
    if (size > bytes_.size() - position_) {
      throw RosError(fmt::format("needs {} bytes at byte {}, has {}", size, position_, bytes_.size() - position_));
    }
    const auto taken = bytes_.subspan(position_, static_cast<std::size_t>(size));
    position_ += taken.size();
    return taken;
  }

  void align(int size) {
    if (!cdr_ || size <= 1) return;
    const auto step = static_cast<std::size_t>(size);
    const std::size_t beyond = (position_ - origin_) % step;
    if (beyond != 0) take(step - beyond);
  }

  uint64_t raw(int size) {
    align(size);
    const std::span<const uint8_t> bytes = take(static_cast<uint64_t>(size));
    uint64_t value = 0;
    for (std::size_t i = 0; i < bytes.size(); ++i) {
      value |= static_cast<uint64_t>(bytes[little_ ? i : bytes.size() - 1 - i]) << (8U * i);
    }
    return value;
  }

  double number(const RosType::Step& step) {
    const uint64_t value = raw(step.size);
    if (step.kind == Kind::kUnsigned) return static_cast<double>(value);
    if (step.kind == Kind::kFloat) {
      return step.size == 8 ? std::bit_cast<double>(value)
                            : static_cast<double>(std::bit_cast<float>(static_cast<uint32_t>(value)));
    }
    const int unused = 64 - 8 * step.size;
    return static_cast<double>(static_cast<int64_t>(value << unused) >> unused);
  }

  int64_t time_ns(const RosType::Step& step) {
    constexpr int64_t kSecond = 1'000'000'000;
    const auto low = static_cast<uint32_t>(raw(4));
    const int64_t seconds = step.signed_seconds ? static_cast<int64_t>(static_cast<int32_t>(low)) : int64_t{low};
    return seconds * kSecond + static_cast<int64_t>(raw(4));
  }

  std::string_view text() {
    const uint64_t size = raw(4);
    std::span<const uint8_t> bytes = take(size);
    if (cdr_ && !bytes.empty()) bytes = bytes.first(bytes.size() - 1);  // its final zero
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

  void one(const RosType::Step& step, RosValue& value) {
    if (step.kind == Kind::kText) {
      value.text = text();
    } else if (step.kind == Kind::kTime) {
      value.time_ns = time_ns(step);
    } else {
      value.number = number(step);
    }
  }

  void array(const RosType::Step& step, RosValue& value) {
    const uint64_t count = step.array == RosType::kSequence ? raw(4) : static_cast<uint64_t>(step.array);
    if (count > bytes_.size() - position_) {  // each takes a byte at least
      throw RosError(fmt::format("an array of {} at byte {}, where {} bytes are left", count, position_,
                                 bytes_.size() - position_));
    }
    if (step.kind != Kind::kStruct && step.size == 1) {
      value.bytes = take(count);
      return;
    }
    value.numbers.clear();
    value.items.clear();
    for (uint64_t i = 0; i < count; ++i) {
      if (step.kind == Kind::kStruct) {
        const std::size_t before = position_;
        decode(type_.programs_[step.nested], value.items.emplace_back());
        // Arrays of these within each other would be as many as anyone likes, of no bytes at all.
        if (position_ == before) throw RosError("an array of messages without a field");
      } else if (step.kind == Kind::kText) {
        text();
      } else if (step.kind == Kind::kTime) {
        time_ns(step);
      } else {
        value.numbers.push_back(number(step));
      }
    }
  }

  const RosType& type_;
  std::span<const uint8_t> bytes_;
  bool cdr_;
  bool little_ = true;
  std::size_t position_ = 0;
  std::size_t origin_ = 0;  ///< that alignment counts from
};

void RosType::decode(std::span<const uint8_t> bytes, RosRecord& record) const {
  RosDecoder decoder(*this, bytes);
  decoder.decode(programs_[0], record);
  decoder.require_end();
}

}  // namespace roadfix
