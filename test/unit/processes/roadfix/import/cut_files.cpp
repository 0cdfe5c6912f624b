#include "cut_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <set>

#include "roadfix/import/drive_log.h"
#include "roadfix/import/source.h"
#include "small_drive.h"

namespace roadfix::test {
namespace {

namespace fs = std::filesystem;

/// What import said; empty where it went through.
std::string error_of(const fs::path& source, const fs::path& out) {
  try {
    SourceOptions options;
    options.format = detect_format(source);
    write_drive_log(read_source(source, options), {}, out, {});
  } catch (const std::exception& e) {
    return e.what();
  }
  return "";
}

std::size_t separators(const std::string& line) {
  return static_cast<std::size_t>(std::count_if(line.begin(), line.end(), [](char c) { return c == ',' || c == ' '; }));
}

std::string last_line(const std::string& text) { return text.substr(text.rfind('\n') + 1); }

/// May what is left of the file stand for itself? Rows of text that have all their fields; any piece of YAML.
bool may_be_whole(const fs::path& path, const std::string& whole, std::size_t length) {
  const std::string extension = path.extension().string();
  if (extension == ".yaml") return true;
  if (extension != ".csv" && extension != ".txt") return false;
  const std::string left = last_line(whole.substr(0, length));
  const std::size_t end = whole.find('\n', length);
  return left.empty() || separators(left) == separators(last_line(whole.substr(0, end)));
}

}  // namespace

Cuts cut_every_file(const fs::path& root, const fs::path& source) {
  constexpr std::size_t kCuts = 12;
  Cuts cuts;
  const TemporaryFolder output;
  const auto complain = [&](const fs::path& path, std::size_t length, const std::string& what) {
    cuts.complaints.push_back(fmt::format("{} cut to {} bytes: {}", path.string(), length, what));
  };
  std::set<fs::path> files;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.is_regular_file()) files.insert(entry.path());
  }
  for (const fs::path& path : files) {
    const std::string whole = read_file(path);
    for (std::size_t i = 0; i < kCuts; ++i) {
      const std::size_t length = whole.size() * i / kCuts;
      write_file(path, whole.substr(0, length));
      const std::string error = error_of(source, output / "out.lcm");
      if (error.empty()) {
        ++cuts.taken;
        if (!may_be_whole(path, whole, length)) complain(path, length, "taken");
        fs::remove(output / "out.lcm");
      } else {
        ++cuts.refused;
        if (error.find(root.string()) == std::string::npos) complain(path, length, error);
      }
      if (!fs::is_empty(output.path())) complain(path, length, "left something behind");
    }
    write_file(path, whole);
  }
  const std::string error = error_of(source, output / "out.lcm");
  if (!error.empty()) cuts.complaints.push_back("whole again: " + error);
  return cuts;
}

}  // namespace roadfix::test
