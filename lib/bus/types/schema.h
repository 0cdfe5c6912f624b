/// What our message types look like, read from the embedded .lcm texts, and the check that every message from outside
/// passes before LCM's generated decoder sees it: that one throws or reads out of bounds on hostile lengths.
#pragma once

#include <array>
#include <map>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "bus/types/lcm_parser.h"
#include "type_text.h"

namespace roadfix {

enum class CheckResult { kOk, kWrongType, kTooShort, kBadLength, kBadString, kLeftOver };
const char* to_words(CheckResult result);

/// Walks a message of one type: fingerprint, every array length against the bytes that remain, every string, and the
/// end exactly at the end. Neighbouring fields of fixed size are one step: imu_t is a comparison of two lengths.
class MessageCheck {
 public:
  [[nodiscard]] CheckResult operator()(std::span<const uint8_t> bytes) const;

 private:
  friend class Schema;
  static constexpr int kMaxDims = 3;
  static constexpr int kMaxCounts = 32;
  enum class Kind { kSkip, kCount, kElements, kStrings, kStructs };
  struct Step {
    Kind kind = Kind::kSkip;
    int64_t bytes = 0;                               // kSkip: all; kCount, kElements: of one
    int count = -1;                                  // kCount: where to keep it
    int64_t fixed = 1;                               // product of the sizes that are numbers
    std::array<int, kMaxDims> sizes = {-1, -1, -1};  // counts to multiply
    int program = -1;                                // kStructs
  };
  using Program = std::vector<Step>;

  CheckResult walk(const Program& program, std::span<const uint8_t>& rest) const;
  static std::optional<std::size_t> elements(const Step& step, const std::array<int64_t, kMaxCounts>& counts,
                                             std::size_t rest);

  int64_t fingerprint_ = 0;
  std::vector<Program> programs_;  // the first is the message's own
};

class Schema {
 public:
  /// Throws SchemaError.
  explicit Schema(const std::vector<TypeText>& texts);
  /// Of the types that this program was built with.
  static const Schema& built_in();

  /// Throws SchemaError where there is no such type.
  [[nodiscard]] const SchemaType& type(const std::string& name) const;
  [[nodiscard]] int64_t fingerprint(const std::string& name) const;
  [[nodiscard]] MessageCheck check_of(const std::string& name) const;
  /// Name of the type with this fingerprint, or nothing.
  [[nodiscard]] std::optional<std::string> name_of(int64_t fingerprint) const;
  [[nodiscard]] const std::map<std::string, SchemaType>& types() const { return types_; }

 private:
  [[nodiscard]] uint64_t nested_hash(const SchemaType& type, std::vector<std::string>& parents) const;
  struct Compiler;

  std::map<std::string, SchemaType> types_;
};

}  // namespace roadfix
