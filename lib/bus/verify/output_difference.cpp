#include "bus/verify/output_difference.h"

#include <initializer_list>
#include <limits>
#include <map>
#include <sstream>
#include <string_view>

#include "bus/types/field_difference.h"

namespace roadfix {

namespace {

std::string joined(std::initializer_list<std::string_view> parts) {
  std::string all;
  for (const std::string_view part : parts) all += part;
  return all;
}

std::string format_seqs(int64_t first, int64_t last) {
  if (first == last) return "seq " + std::to_string(first);
  return "seq " + std::to_string(first) + " to " + std::to_string(last);
}

/// The inputs that this output had applied and the one before it had not.
std::string newly_applied(const StageSpec& spec, const provenance_t& now, const std::optional<provenance_t>& before) {
  std::string text;
  for (std::size_t i = 0; i < now.last_seq.size() && i < spec.inputs.size(); ++i) {
    const int64_t old_seq = before && i < before->last_seq.size() ? before->last_seq[i] : -1;
    if (now.last_seq[i] == old_seq) continue;
    text += joined({text.empty() ? "" : ", ", spec.inputs[i].channel, " ", format_seqs(old_seq + 1, now.last_seq[i])});
  }
  return text.empty() ? "nothing" : text;
}

std::string cause(const StageSpec& spec, const provenance_t& car, const provenance_t& here,
                  const std::optional<provenance_t>& before) {
  for (std::size_t i = 0; i < spec.inputs.size() && i < car.last_seq.size() && i < here.last_seq.size(); ++i) {
    if (car.last_seq[i] == here.last_seq[i] && car.num_applied[i] == here.num_applied[i]) continue;
    return joined({"the car had applied ", std::to_string(car.num_applied[i]), " of ", spec.inputs[i].channel,
                   ", up to seq ", std::to_string(car.last_seq[i]), "; here ", std::to_string(here.num_applied[i]),
                   ", up to seq ", std::to_string(here.last_seq[i]), ": a loss that the ledger does not tell"});
  }
  if (car.ledger_entries != here.ledger_entries) {
    return "the car's ledger had " + std::to_string(car.ledger_entries) + " entries, the log's has " +
           std::to_string(here.ledger_entries);
  }
  if (car.digest == here.digest) {
    return "the state at the horizon is the same; a clock sample ahead of it, or what carries it to now, differs";
  }
  return "the same inputs by name, but their contents or the arithmetic differ; applied since the last identical "
         "output: " +
         newly_applied(spec, car, before);
}

std::optional<provenance_t> provenance_of(const StageSpec& spec, const RecordedOutput* output) {
  if (output == nullptr) return std::nullopt;
  return read_provenance(spec.outputs[static_cast<std::size_t>(output->output)].type, output->bytes);
}

/// The first line that two texts do not share.
std::string first_line_difference(const std::string& a, const std::string& b) {
  std::istringstream lines_a(a);
  std::istringstream lines_b(b);
  std::string line_a;
  std::string line_b;
  for (bool more_a = true, more_b = true; more_a || more_b;) {
    more_a = static_cast<bool>(std::getline(lines_a, line_a));
    more_b = static_cast<bool>(std::getline(lines_b, line_b));
    if (!more_a) line_a = "(no line)";
    if (!more_b) line_b = "(no line)";
    if (line_a != line_b) return joined({"'", line_a, "' in the car, '", line_b, "' here"});
  }
  return "";
}

/// "name version; name version; ..." by name.
std::map<std::string, std::string> versions(const std::string& text) {
  std::map<std::string, std::string> found;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ';');) {
    std::istringstream words(part);
    std::string name;
    std::string version;
    if (words >> name >> version) found[name] = version;
  }
  return found;
}

}  // namespace

std::string describe_difference(const StageSpec& spec, const RecordedOutput& recorded,
                                std::span<const uint8_t> replayed, const RecordedOutput* before) {
  const OutputSpec& output = spec.outputs[static_cast<std::size_t>(recorded.output)];
  std::string text = output.channel + " seq " + std::to_string(recorded.header.seq) + " at utime " +
                     std::to_string(recorded.header.utime) + ": ";
  if (replayed.empty()) {
    return text + "the car published it, the replay does not: its clock sample was refused or is another one here";
  }
  const Schema& schema = Schema::built_in();
  std::optional<std::string> field = first_difference(schema, output.type, recorded.bytes, replayed, "provenance.");
  if (!field) field = first_difference(schema, output.type, recorded.bytes, replayed);
  text += field.value_or("no field") + " (car and here)";
  const std::optional<provenance_t> car = read_provenance(output.type, recorded.bytes);
  const std::optional<provenance_t> here = read_provenance(output.type, replayed);
  if (!car || !here) return text;
  return text + "; " + cause(spec, *car, *here, provenance_of(spec, before));
}

std::string describe_loss(const StageSpec& spec, const LogLoss& loss) {
  const std::string& channel = spec.inputs[static_cast<std::size_t>(loss.input)].channel;
  if (loss.last_seq == std::numeric_limits<int64_t>::max()) return channel + ": not in the log";
  if (loss.first_seq == std::numeric_limits<int64_t>::min()) {
    return channel + ": the log begins with seq " + std::to_string(loss.last_seq + 1);
  }
  return channel + ": " + format_seqs(loss.first_seq, loss.last_seq) + " not in the log";
}

std::vector<std::string> config_differences(const config_t& car, const config_t& here) {
  std::vector<std::string> differences;
  if (car.build_id != here.build_id) {
    differences.push_back("build: " + car.build_id + " in the car, " + here.build_id + " here");
  }
  const std::map<std::string, std::string> recorded_versions = versions(car.library_versions);
  const std::map<std::string, std::string> local_versions = versions(here.library_versions);
  for (const auto& [name, version] : recorded_versions) {
    const auto found = local_versions.find(name);
    if (found != local_versions.end() && found->second != version) {
      differences.push_back(joined({"library ", name, ": ", version, " in the car, ", found->second, " here"}));
    }
  }
  if (car.cpu_features != here.cpu_features) {
    differences.push_back("processor: " + car.cpu_features + " in the car, " + here.cpu_features + " here");
  }
  if (car.config_yaml != here.config_yaml) {
    differences.push_back("configuration: " + first_line_difference(car.config_yaml, here.config_yaml));
  }
  if (car.calibration_yaml != here.calibration_yaml) {
    differences.push_back("calibration: " + first_line_difference(car.calibration_yaml, here.calibration_yaml));
  }
  return differences;
}

}  // namespace roadfix
