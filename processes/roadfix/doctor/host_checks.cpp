#include <fmt/format.h>
#include <sys/timex.h>

#include <algorithm>
#include <ostream>
#include <sstream>

#include "roadfix/doctor/doctor.h"

namespace roadfix {
namespace {

constexpr double kGibi = 1024.0 * 1024.0 * 1024.0;
constexpr double kMicrosecond = 1e-6;

bool on_path(const std::string& program, const std::string& path, const std::filesystem::path& root) {
  std::istringstream folders(path);
  for (std::string folder; std::getline(folders, folder, ':');) {
    std::error_code error;
    if (std::filesystem::exists(root / std::filesystem::path(folder).relative_path() / program, error)) return true;
  }
  return false;
}

/// Java's window library; headless packages come without it.
bool has_windows(const std::filesystem::path& root) {
  std::error_code error;
  std::filesystem::directory_iterator java(root / "usr/lib/jvm", error);
  return !error && std::any_of(begin(java), end(java), [](const std::filesystem::directory_entry& entry) {
    return std::filesystem::exists(entry.path() / "lib/libawt_xawt.so");
  });
}

const char* level_name(Level level) {
  switch (level) {
    case Level::kOk:
      return "ok";
    case Level::kWarning:
      return "warning";
    case Level::kError:
      return "ERROR";
  }
  return "?";
}

}  // namespace

std::vector<Finding> check_spy(const std::string& path, const std::filesystem::path& root,
                               const std::filesystem::path& jar) {
  std::vector<Finding> findings;
  const auto look = [&](const std::string& what, const std::string& missing) {
    findings.push_back(
        missing.empty() ? Finding{Level::kOk, what, "there", ""}
                        : Finding{Level::kWarning, what, missing + " is missing: no lcm-spy", "scripts/spy --prepare"});
  };
  look("java", !on_path("java", path, root) ? "java" : has_windows(root) ? "" : "a Java with windows");
  std::string missing = on_path("lcm-spy", path, root) ? "" : "the program";
  for (const char* library : {"lcm.jar", "jchart2d.jar"}) {
    if (std::filesystem::exists(root / "usr/share/java" / library)) continue;
    missing += (missing.empty() ? "" : ", ") + std::string(library);
  }
  look("lcm-spy", missing);
  look("types for lcm-spy", std::filesystem::exists(jar) ? "" : "roadfix_types.jar");
  return findings;
}

Finding check_clock() {
  timex state{};
  const int status = adjtimex(&state);
  const char* mend = "apt-get install -y chrony && chronyc waitsync";
  if (status == -1) return {Level::kWarning, "clock", "the kernel does not tell its state", mend};
  if (status == TIME_ERROR || (state.status & STA_UNSYNC) != 0)
    return {Level::kWarning, "clock", "not synchronised: recordings of several machines will not fit together", mend};
  return {
      Level::kOk, "clock",
      fmt::format("synchronised, estimated error {:.3f} ms", static_cast<double>(state.esterror) * kMicrosecond * 1e3),
      ""};
}

Finding check_disk(const std::filesystem::path& folder, std::uint64_t wanted_bytes) {
  std::error_code error;
  const std::filesystem::space_info space = std::filesystem::space(folder, error);
  if (error)
    return {Level::kError, "disk", fmt::format("{}: {}", folder.string(), error.message()),
            fmt::format("mkdir -p '{}'", folder.string())};
  const std::string seen =
      fmt::format("{:.1f} GiB free in {}", static_cast<double>(space.available) / kGibi, folder.string());
  if (space.available >= wanted_bytes) return {Level::kOk, "disk", seen, ""};
  return {Level::kWarning, "disk",
          fmt::format("{} (wanted {:.1f} GiB)", seen, static_cast<double>(wanted_bytes) / kGibi), "",
          fmt::format("delete old recordings (ls -tr '{}'/*.lcm | head), or record elsewhere", folder.string())};
}

Level print_findings(const std::vector<Finding>& findings, std::ostream& out) {
  Level worst = Level::kOk;
  for (const Level level : {Level::kOk, Level::kWarning, Level::kError})
    for (const Finding& finding : findings) {
      if (finding.level != level) continue;
      worst = level;
      out << fmt::format("{:8} {:26} {}\n", level_name(level), finding.check, finding.seen);
      if (!finding.mend.empty()) out << fmt::format("{:35} mend: {}\n", "", finding.mend);
      if (!finding.advice.empty()) out << fmt::format("{:35} to do: {}\n", "", finding.advice);
    }
  return worst;
}

}  // namespace roadfix
