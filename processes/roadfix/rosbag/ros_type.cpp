#include "roadfix/rosbag/ros_type.h"

#include <fmt/format.h>

#include <algorithm>
#include <sstream>

#include "config/scalar.h"

namespace roadfix {

std::string plain_ros_type(std::string_view type) {
  std::string plain(type);
  if (const std::size_t middle = plain.find("/msg/"); middle != std::string::npos) plain.erase(middle, 4);
  return plain;
}

namespace {

struct Declared {
  std::string type;
  std::string name;
  int array = -1;
};

std::string_view trimmed(std::string_view text) {
  constexpr const char* kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  return first == std::string_view::npos ? std::string_view()
                                         : text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

/// "float64[36] covariance # why", "string<=10 name", "uint8 FIX=0": nothing where the line declares no field.
std::optional<Declared> parse_line(std::string_view line) {
  line = trimmed(line.substr(0, line.find('#')));
  if (line.empty()) return std::nullopt;
  const std::size_t blank = line.find_first_of(" \t");
  if (blank == std::string_view::npos) throw RosError(fmt::format("definition line '{}' has no name", line));
  Declared field;
  field.type = line.substr(0, blank);
  std::string_view rest = trimmed(line.substr(blank));
  const std::size_t end = std::min(rest.find_first_of(" \t="), rest.size());
  field.name = rest.substr(0, end);
  rest = trimmed(rest.substr(end));
  if (rest.starts_with('=')) return std::nullopt;  // a constant; what else follows is a default
  if (const std::size_t bracket = field.type.find('['); bracket != std::string::npos) {
    const std::string size = field.type.substr(bracket + 1, field.type.size() - bracket - 2);
    field.array = 0;
    if (!size.empty() && !size.starts_with("<=")) {
      const auto number = parse_integer(size);
      if (!number || *number <= 0 || *number > 1'000'000) throw RosError(fmt::format("array size '{}'", size));
      field.array = static_cast<int>(*number);
    }
    field.type.erase(bracket);
  }
  if (const std::size_t bound = field.type.find("<="); bound != std::string::npos) field.type.erase(bound);
  return field;
}

using Definitions = std::map<std::string, std::vector<Declared>>;

/// Sections between lines of '=', each but the first headed by "MSG: package/Type".
Definitions parse_definitions(const std::string& type, const std::string& text) {
  Definitions definitions;
  std::istringstream stream(text);
  std::string line, current = type;
  definitions[current];
  while (std::getline(stream, line)) {
    if (line.starts_with("====")) continue;
    if (line.starts_with("MSG:")) {
      current = plain_ros_type(trimmed(std::string_view(line).substr(4)));
      definitions[current];
    } else if (const auto field = parse_line(line)) {
      definitions[current].push_back(*field);
    }
  }
  return definitions;
}

}  // namespace

/// Flattens a type into programs.
class RosCompiler {
 public:
  RosCompiler(RosType& type, Definitions definitions) : type_(type), definitions_(std::move(definitions)) {}

  std::size_t compile(const std::string& name) {
    if (++depth_ > kMaxDepth) throw RosError("type " + name + " is nested too deeply");
    if (type_.programs_.size() > kMaxPrograms) throw RosError("type " + name + " has too many parts");
    const std::size_t index = type_.programs_.size();
    type_.programs_.emplace_back();
    RosType::Program program;
    add_fields(name, "", program);
    type_.programs_[index] = std::move(program);
    --depth_;
    return index;
  }

 private:
  using Kind = RosType::Kind;
  static constexpr int kMaxDepth = 16;
  static constexpr std::size_t kMaxSteps = 10'000, kMaxPrograms = 1000;

  void add_fields(const std::string& name, const std::string& prefix, RosType::Program& program) {
    if (++depth_ > kMaxDepth) throw RosError("type " + name + " is nested too deeply");
    const std::vector<Declared>& fields = fields_of(name);
    const std::string package = name.substr(0, name.find('/'));
    for (const Declared& field : fields) add_field(field, package, prefix, program);
    if (fields.empty() && type_.encoding_ == RosType::Encoding::kCdr) {
      program.steps.push_back({Kind::kFiller, 1});  // rmw: a structure needs at least one member
    }
    if (program.steps.size() > kMaxSteps) throw RosError("type " + name + " has too many fields");
    --depth_;
  }

  void add_field(const Declared& field, const std::string& package, const std::string& prefix,
                 RosType::Program& program) {
    RosType::Step step;
    step.array = field.array;
    if (is_time(field.type)) {
      step.kind = Kind::kTime;
      step.signed_seconds = field.type == "duration" || type_.encoding_ == RosType::Encoding::kCdr;
    } else if (!set_primitive(field.type, step)) {
      const std::string nested = nested_name(field.type, package);
      if (field.array == RosType::kSingle) return add_fields(nested, prefix + field.name + ".", program);
      step.kind = Kind::kStruct;
      step.nested = compile(nested);
    }
    step.slot = program.slots.size();
    if (!program.slots.emplace(prefix + field.name, step.slot).second) {
      throw RosError(fmt::format("field '{}{}' is defined twice", prefix, field.name));
    }
    program.steps.push_back(step);
  }

  static bool is_time(const std::string& type) {
    const std::string plain = plain_ros_type(type);
    return plain == "time" || plain == "duration" || plain == "builtin_interfaces/Time" ||
           plain == "builtin_interfaces/Duration";
  }

  static bool set_primitive(const std::string& type, RosType::Step& step) {
    static const std::map<std::string, std::pair<Kind, int>> kinds = {
        {"bool", {Kind::kUnsigned, 1}},   {"byte", {Kind::kUnsigned, 1}},   {"char", {Kind::kUnsigned, 1}},
        {"octet", {Kind::kUnsigned, 1}},  {"int8", {Kind::kSigned, 1}},     {"uint8", {Kind::kUnsigned, 1}},
        {"int16", {Kind::kSigned, 2}},    {"uint16", {Kind::kUnsigned, 2}}, {"int32", {Kind::kSigned, 4}},
        {"uint32", {Kind::kUnsigned, 4}}, {"int64", {Kind::kSigned, 8}},    {"uint64", {Kind::kUnsigned, 8}},
        {"float32", {Kind::kFloat, 4}},   {"float64", {Kind::kFloat, 8}},   {"string", {Kind::kText, 0}}};
    const auto found = kinds.find(type);
    if (found == kinds.end()) return false;
    step.kind = found->second.first;
    step.size = found->second.second;
    return true;
  }

  [[nodiscard]] std::string nested_name(const std::string& type, const std::string& package) const {
    const std::string plain = plain_ros_type(type);
    if (plain.find('/') != std::string::npos) return plain;
    return plain == "Header" ? "std_msgs/Header" : package + "/" + plain;
  }

  const std::vector<Declared>& fields_of(const std::string& name) {
    const auto found = definitions_.find(name);
    if (found != definitions_.end()) return found->second;
    const auto text = built_in_definition(name, type_.encoding_);
    if (!text) throw RosError("type " + name + " is not defined in the bag, and not known here");
    return definitions_[name] = parse_definitions(name, *text)[name];
  }

  RosType& type_;
  Definitions definitions_;
  int depth_ = 0;
};

RosType::RosType(const std::string& type, const std::string& definition, Encoding encoding) : encoding_(encoding) {
  const std::string plain = plain_ros_type(type);
  Definitions definitions;
  if (definition.find_first_not_of(" \t\r\n") != std::string::npos) definitions = parse_definitions(plain, definition);
  RosCompiler(*this, std::move(definitions)).compile(plain);
}

std::optional<std::size_t> RosType::find(const std::string& field) const {
  const auto found = programs_[0].slots.find(field);
  if (found == programs_[0].slots.end()) return std::nullopt;
  return found->second;
}

std::optional<std::size_t> RosType::find_in(const std::string& array, const std::string& field) const {
  const auto slot = find(array);
  for (const Step& step : programs_[0].steps) {
    if (!slot || step.slot != *slot || step.kind != Kind::kStruct) continue;
    const auto& slots = programs_[step.nested].slots;
    const auto found = slots.find(field);
    if (found != slots.end()) return found->second;
  }
  return std::nullopt;
}

}  // namespace roadfix
