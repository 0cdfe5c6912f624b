#include "roadfix/fleet/drive_words.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <fstream>
#include <functional>
#include <set>
#include <sstream>

#include "config/config_error.h"
#include "roadfix/simulate/scenario_file.h"

namespace roadfix {
namespace {

namespace fs = std::filesystem;
using Words = std::vector<std::string>;

constexpr std::size_t kMaxDrives = 1'000'000;

struct KeyValue {
  std::string key;
  std::string value;
};

Words split(const std::string& text, char separator) {
  Words parts;
  std::istringstream stream(text);
  for (std::string part; std::getline(stream, part, separator);) parts.push_back(part);
  return parts;
}

template <class Number>
Number number(const KeyValue& word) {
  Number value{};
  const char* end = word.value.data() + word.value.size();
  const auto [stopped, error] = std::from_chars(word.value.data(), end, value);
  if (error != std::errc() || stopped != end || !(value >= Number{0})) {
    throw std::runtime_error(fmt::format("{}={}: must be a number, zero or more", word.key, word.value));
  }
  return value;
}

CameraLayout camera_layout(const KeyValue& word) {
  if (word.value == "none") return CameraLayout::kNone;
  if (word.value == "mono") return CameraLayout::kMono;
  if (word.value == "stereo") return CameraLayout::kStereo;
  throw std::runtime_error(fmt::format("camera={}: must be none, mono or stereo", word.value));
}

/// One key, the kind of drive that it changes, and how. A key that makes several drives of one has its single form
/// here.
struct Key {
  const char* name;
  DriveKind kind;
  std::function<void(FleetDrive&, const KeyValue&)> set;
};

GnssSpike& spike_of(FleetDrive& d) {
  if (!d.changes.gnss.spike) d.changes.gnss.spike.emplace();
  return *d.changes.gnss.spike;
}
GnssBias& bias_of(FleetDrive& d) {
  if (!d.changes.gnss.bias_after_outage) d.changes.gnss.bias_after_outage.emplace();
  return *d.changes.gnss.bias_after_outage;
}
CutGnss& cut_of(FleetDrive& d) {
  if (!d.changes.gnss.cut) d.changes.gnss.cut.emplace();
  return *d.changes.gnss.cut;
}

const std::vector<Key>& keys() {
  using D = FleetDrive;
  using K = KeyValue;
  constexpr DriveKind kSim = DriveKind::kScenario;
  constexpr DriveKind kRec = DriveKind::kRecording;
  static const std::vector<Key> kKeys = {
      {"seed", kSim, [](D& d, const K& w) { d.seed = number<std::uint64_t>(w); }},
      {"fault", kSim,
       [](D& d, const K& w) {
         if (w.value != "none") d.scenario.faults = split(w.value, '/');
       }},
      {"duration_s", kSim, [](D& d, const K& w) { d.scenario.duration_s = number<double>(w); }},
      {"camera", kSim, [](D& d, const K& w) { d.scenario.camera = camera_layout(w); }},
      {"camera_rate_hz", kSim, [](D& d, const K& w) { d.scenario.camera_rate_hz = number<double>(w); }},
      {"picture_size", kSim, [](D& d, const K& w) { d.scenario.picture_size = w.value; }},
      {"without", kRec, [](D& d, const K& w) { d.changes.without = split(w.value, ','); }},
      {"start_after_s", kRec, [](D& d, const K& w) { d.changes.start_after = number<double>(w); }},
      {"score_skip_s", kRec, [](D& d, const K& w) { d.changes.score_skip = number<double>(w); }},
      {"gnss_every", kRec, [](D& d, const K& w) { d.changes.gnss.keep_every = number<int>(w); }},
      {"cut_gnss_s", kRec, [](D& d, const K& w) { cut_of(d).length = number<double>(w); }},
      {"every_s", kRec, [](D& d, const K& w) { cut_of(d).every = number<double>(w); }},
      {"after_s", kRec, [](D& d, const K& w) { cut_of(d).after = number<double>(w); }},
      {"phase_s", kRec, [](D& d, const K& w) { cut_of(d).phase = number<double>(w); }},
      {"spike_m", kRec, [](D& d, const K& w) { spike_of(d).moved = number<double>(w); }},
      {"every_fix", kRec, [](D& d, const K& w) { spike_of(d).every_fix = number<int>(w); }},
      {"bias_m", kRec, [](D& d, const K& w) { bias_of(d).moved = number<double>(w); }},
      {"fixes", kRec, [](D& d, const K& w) { bias_of(d).fixes = number<int>(w); }},
      {"azimuth_seed", kRec, [](D& d, const K& w) { d.changes.gnss.azimuth_seed = number<unsigned>(w); }},
  };
  return kKeys;
}

std::string kind_name(DriveKind kind) {
  return kind == DriveKind::kLog ? "a log" : kind == DriveKind::kRecording ? "a recording" : "a scenario";
}

const Key& key_of(const KeyValue& word, DriveKind kind) {
  Words known;
  for (const Key& key : keys()) {
    if (key.kind != kind) continue;
    if (word.key == key.name) return key;
    known.emplace_back(key.name);
  }
  if (kind == DriveKind::kScenario) known.emplace_back("seeds");
  throw std::runtime_error(fmt::format("{}={}: no key of {} ({})", word.key, word.value, kind_name(kind),
                                       known.empty() ? "it has none" : fmt::format("{}", fmt::join(known, ", "))));
}

std::optional<KeyValue> key_value(const std::string& word) {
  const std::size_t equals = word.find('=');
  if (equals == std::string::npos || equals == 0) return std::nullopt;
  KeyValue out{word.substr(0, equals), word.substr(equals + 1)};
  const bool is_key = out.key.find_first_not_of("abcdefghijklmnopqrstuvwxyz_") == std::string::npos;
  return is_key ? std::optional(out) : std::nullopt;
}

/// The drive without its changes.
FleetDrive base_drive(const std::string& word, const fs::path& root) {
  FleetDrive drive;
  const fs::path path = root / word;
  if (is_scenario(word) || (path.extension() == ".yaml" && fs::is_regular_file(path))) {
    drive.kind = DriveKind::kScenario;
    drive.scenario.scenario = is_scenario(word) ? word : path.string();
  } else if (fs::is_regular_file(path)) {
    drive.path = path;
  } else if (fs::is_directory(path)) {
    drive.kind = DriveKind::kRecording;
    drive.path = path;
  } else {
    throw std::runtime_error(fmt::format(
        "{}: neither a scenario (roadfix simulate --list) nor a log or recording at {}", word, path.string()));
  }
  return drive;
}

/// A folder of logs in place of itself.
Words logs_below(const std::string& word, const fs::path& root) {
  Words logs;
  const fs::path path = root / word;
  if (!fs::is_directory(path) || fs::exists(path / "drive.yaml")) return {word};
  for (const fs::directory_entry& entry : fs::directory_iterator(path)) {
    if (entry.is_regular_file() && entry.path().extension() == ".lcm")
      logs.push_back((fs::path(word) / entry.path().filename()).string());
  }
  std::sort(logs.begin(), logs.end());
  return logs.empty() ? Words{word} : logs;
}

/// What one key makes of a drive: one choice for most, several for seeds, faults and phases.
Words choices_of(const KeyValue& word) {
  Words out;
  if (word.key == "seeds" || word.key == "seed") {
    for (const std::uint64_t seed : parse_number_list(word.value)) out.push_back(fmt::format("seed={}", seed));
  } else if (word.key == "phase_s") {
    for (const std::string& phase : split(word.value, ',')) out.push_back("phase_s=" + phase);
  } else {
    out.push_back(word.key + "=" + word.value);
  }
  return out;
}

/// A drive and its changes: every choice of each key with every choice of the others.
void expand_group(const std::string& base, const std::vector<KeyValue>& changes, const fs::path& root,
                  std::vector<Words>& drives) {
  std::vector<std::pair<std::string, Words>> dimensions;
  for (const KeyValue& change : changes) {
    const std::string key = change.key == "seeds" ? "seed" : change.key;
    auto at = std::find_if(dimensions.begin(), dimensions.end(), [&](const auto& d) { return d.first == key; });
    if (at != dimensions.end() && key != "fault" && key != "seed" && key != "phase_s")
      throw std::runtime_error(fmt::format("{}: {} stands there twice", base, key));
    if (at == dimensions.end()) at = dimensions.insert(at, {key, {}});
    for (std::string& choice : choices_of(change)) at->second.push_back(std::move(choice));
  }
  std::vector<Words> group = {{base}};
  for (const auto& [key, choices] : dimensions) {
    std::vector<Words> wider;
    if (group.size() * choices.size() > kMaxDrives) throw std::runtime_error(base + ": more than a million drives");
    for (const Words& words : group) {
      for (const std::string& choice : choices) {
        wider.push_back(words);
        wider.back().push_back(choice);
      }
    }
    group = std::move(wider);
  }
  for (const Words& words : group) static_cast<void>(parse_drive(words, root));
  std::move(group.begin(), group.end(), std::back_inserter(drives));
}

void expand(const Words& words, const fs::path& root, std::vector<Words>& drives);

void expand_file(const fs::path& path, const fs::path& root, std::vector<Words>& drives) {
  std::istringstream lines(read_text_file(path));
  int number = 0;
  for (std::string line; std::getline(lines, line);) {
    ++number;
    std::istringstream stream(line.substr(0, line.find('#')));
    Words words;
    for (std::string word; stream >> word;) words.push_back(word);
    try {
      if (!words.empty()) expand(words, root, drives);
    } catch (const std::runtime_error& e) {
      throw ConfigError(path.string(), number, e.what());
    }
  }
}

void expand(const Words& words, const fs::path& root, std::vector<Words>& drives) {
  for (std::size_t i = 0; i < words.size();) {
    const std::string& base = words[i++];
    if (base.starts_with('@')) {
      expand_file(base.substr(1), root, drives);
      continue;
    }
    if (const auto change = key_value(base); change && !fs::exists(root / base))
      throw std::runtime_error(base + ": there is no drive before it that it could change");
    std::vector<KeyValue> changes;
    for (; i < words.size() && !fs::exists(root / words[i]); ++i) {
      const auto change = key_value(words[i]);
      if (!change) break;
      changes.push_back(*change);
    }
    for (const std::string& drive : logs_below(base, root)) expand_group(drive, changes, root, drives);
  }
}

}  // namespace

std::vector<std::uint64_t> parse_number_list(const std::string& text) {
  const auto wrong = [&] {
    return std::runtime_error(fmt::format("'{}': must be numbers like 1..200 or 1,3,9, up to a million", text));
  };
  std::vector<std::uint64_t> out;
  for (const std::string& part : split(text, ',')) {
    const std::size_t dots = part.find("..");
    try {
      const auto first = number<std::uint64_t>({"", part.substr(0, dots)});
      const auto last = dots == std::string::npos ? first : number<std::uint64_t>({"", part.substr(dots + 2)});
      if (last < first || last - first >= kMaxDrives - out.size()) throw wrong();
      for (std::uint64_t n = first; n <= last; ++n) out.push_back(n);
    } catch (const std::runtime_error&) {
      throw wrong();
    }
  }
  if (out.empty()) throw wrong();
  return out;
}

FleetDrive parse_drive(const Words& words, const fs::path& root) {
  FleetDrive drive = base_drive(words.at(0), root);
  for (std::size_t i = 1; i < words.size(); ++i) {
    const auto word = key_value(words[i]);
    if (!word) throw std::runtime_error(words[i] + ": is no KEY=VALUE");
    key_of(*word, drive.kind).set(drive, *word);
  }
  if (drive.kind == DriveKind::kScenario) {
    std::vector<std::string> remarks;
    static_cast<void>(configured_scenario(drive.scenario, remarks));
  }
  if (const auto& cut = drive.changes.gnss.cut; cut && !(cut->length > 0.0 && cut->every > 0.0))
    throw std::runtime_error(words[0] + ": cut_gnss_s and every_s go together and must be above zero");
  return drive;
}

std::vector<Words> expand_drive_words(const Words& words, const fs::path& root) {
  std::vector<Words> drives;
  expand(words, root, drives);
  if (drives.empty()) throw std::runtime_error("no drives: name logs, recordings or scenarios");
  std::set<Words> seen;
  for (const Words& drive : drives) {
    if (!seen.insert(drive).second) throw std::runtime_error(fmt::format("{}: named twice", fmt::join(drive, " ")));
  }
  return drives;
}

}  // namespace roadfix
