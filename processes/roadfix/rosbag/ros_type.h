/// ROS message types as their .msg texts define them, and messages decoded by them: ROS 1's serialisation and ROS 2's
/// CDR (XCDR1, as rmw writes it). A bag that carries its definitions is read by those, so that a field's name is all that
/// the importer must know of a type.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace roadfix {

/// A definition that cannot be read, or bytes that are no such message; the text says what, not where.
struct RosError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// "sensor_msgs/msg/Imu" and "sensor_msgs/Imu" are "sensor_msgs/Imu".
std::string plain_ros_type(std::string_view type);

struct RosRecord;

/// One field of a message. Which members count, its type says.
struct RosValue {
  double number = 0.0;             ///< any number or bool
  int64_t time_ns = 0;             ///< time and duration
  std::string_view text;           ///< string
  std::span<const uint8_t> bytes;  ///< arrays of uint8, int8, byte and char
  std::vector<double> numbers;     ///< arrays of other numbers
  std::vector<RosRecord> items;    ///< arrays of messages
};

struct RosRecord {
  std::vector<RosValue> values;
};

/// One type, flattened: nested messages' fields are named with dots, "header.stamp".
class RosType {
 public:
  enum class Encoding { kRos1, kCdr };

  /// `definition`: the .msg text with those of its parts behind it, as bags have it; where it is empty, the built-in one.
  /// RosError where there is none, or it cannot be read.
  RosType(const std::string& type, const std::string& definition, Encoding encoding);

  /// Where the field is in a decoded record; nothing where the type has no such field.
  [[nodiscard]] std::optional<std::size_t> find(const std::string& field) const;

  /// The same of a field of the messages in the array `array`.
  [[nodiscard]] std::optional<std::size_t> find_in(const std::string& array, const std::string& field) const;

  /// Texts and bytes point into `bytes`. RosError where these are not exactly one message.
  void decode(std::span<const uint8_t> bytes, RosRecord& record) const;

 private:
  friend class RosCompiler;
  friend class RosDecoder;
  enum class Kind { kSigned, kUnsigned, kFloat, kText, kTime, kStruct, kFiller };
  static constexpr int kSingle = -1, kSequence = 0;
  struct Step {
    Kind kind = Kind::kFiller;
    int size = 0;         ///< bytes of one number
    int array = kSingle;  ///< kSequence, or how many
    std::size_t slot = 0;
    std::size_t nested = 0;  ///< program of kStruct
    bool signed_seconds = false;
  };
  struct Program {
    std::vector<Step> steps;
    std::map<std::string, std::size_t> slots;
  };

  Encoding encoding_;
  std::vector<Program> programs_;
};

/// The .msg text of a common type, without its parts; nothing where it is not built in.
std::optional<std::string> built_in_definition(const std::string& type, RosType::Encoding encoding);

}  // namespace roadfix
