// Whether the stack may run in real time, starts with the machine, and may open its devices.
#include <fmt/format.h>
#include <sys/resource.h>
#include <unistd.h>

#include <fstream>

#include "roadfix/doctor/doctor.h"

namespace roadfix {
namespace {

/// The priority that configs/systemd/realtime.conf gives.
constexpr rlim_t kPriority = 50;
/// What a process of the stack holds in memory, with room.
constexpr rlim_t kLockedBytes = rlim_t{512} << 20;

bool is_device(const std::string& name) {
  for (const char* kind : {"ttyACM", "ttyUSB", "video"})
    if (name.rfind(kind, 0) == 0) return true;
  return false;
}

std::string contents(const std::filesystem::path& file) {
  std::ifstream in(file);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

Finding check_realtime(bool root, std::uint64_t priority_limit, std::uint64_t memory_limit) {
  const std::string mend =
      "printf '* - rtprio 60\\n* - memlock unlimited\\n' >/etc/security/limits.d/roadfix.conf   # then log in again";
  if (root) return {Level::kOk, "real time", "allowed to root", ""};
  if (priority_limit < kPriority)
    return {Level::kWarning, "real time",
            fmt::format("--realtime is allowed up to priority {} (wanted {})", priority_limit, kPriority), mend};
  if (memory_limit < kLockedBytes)
    return {Level::kWarning, "real time", fmt::format("only {} KiB may be locked in memory", memory_limit / 1024),
            mend};
  return {Level::kOk, "real time", fmt::format("--realtime is allowed up to priority {}", priority_limit), ""};
}

Finding check_realtime() {
  rlimit priority{}, memory{};
  getrlimit(RLIMIT_RTPRIO, &priority);
  getrlimit(RLIMIT_MEMLOCK, &memory);
  return check_realtime(geteuid() == 0, priority.rlim_cur, memory.rlim_cur);
}

std::vector<Finding> check_services(const std::filesystem::path& root) {
  std::vector<Finding> findings;
  const std::filesystem::path system = root / "etc/systemd/system";
  const bool kept = contents(root / "etc/sysctl.d/60-roadfix.conf").find("net.core.rmem_max") != std::string::npos;
  findings.push_back({kept ? Level::kOk : Level::kWarning, "settings over a restart",
                      kept ? "/etc/sysctl.d/60-roadfix.conf" : "socket buffers are the kernel's again after a restart",
                      kept ? "" : "cp configs/systemd/60-roadfix-sysctl.conf /etc/sysctl.d/60-roadfix.conf"});
  std::vector<std::string> wanted;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(system / "roadfix.target.wants", error))
    wanted.push_back(entry.path().stem().string());
  if (!std::filesystem::exists(system / "roadfix.target")) {
    findings.push_back(
        {Level::kOk, "services", "not installed (roadfix run for the desk; scripts/install-services)", ""});
  } else if (wanted.empty()) {
    findings.push_back({Level::kWarning, "services", "installed, but none is enabled",
                        "systemctl enable roadfix.target roadfix-multicast roadfix@recorder roadfix@gnss_ins_ekf"});
  } else {
    findings.push_back({Level::kOk, "services", fmt::format("{} start with the machine", wanted.size()), ""});
  }
  return findings;
}

std::vector<Finding> check_devices(const std::filesystem::path& root) {
  std::vector<Finding> findings;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(root / "dev", error)) {
    const std::string name = entry.path().filename().string();
    if (!is_device(name)) continue;
    const bool ours = access(entry.path().c_str(), R_OK | W_OK) == 0;
    const std::string group = name.rfind("video", 0) == 0 ? "video" : "dialout";
    findings.push_back({ours ? Level::kOk : Level::kWarning, "device",
                        "/dev/" + name + (ours ? "" : " may not be opened"),
                        ours ? "" : fmt::format("usermod -aG {} $USER   # then log in again", group)});
  }
  return findings;
}

}  // namespace roadfix
