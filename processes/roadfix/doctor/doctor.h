/// What a machine needs before the bus works on it: each check says what it saw and, where something is wrong, the
/// command that mends it (test/bus/mends.sh breaks each thing and runs the command), or what a person has to decide.
///
/// Checks read /proc and /sys below `root`, so that tests hand in a made tree; only the loop-back check opens a bus.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace roadfix {

enum class Level { kOk, kWarning, kError };

struct Finding {
  Level level = Level::kOk;
  std::string check;        ///< for example "multicast route"
  std::string seen;         ///< what was found, as text
  std::string mend;         ///< a shell command for root, from the repository's folder; empty where none mends it
  std::string advice = {};  ///< where no command can mend it: what to look at or to decide
};

/// What of an LCM URL matters here.
struct BusUrl {
  std::string group = "239.255.76.67";  ///< LCM's default
  int port = 7667;
  int ttl = 0;
};

/// Parses udpm://GROUP:PORT?ttl=N&...; throws std::invalid_argument that names the part. Other providers ("memq://",
/// "file://") are no business of doctor's.
BusUrl parse_bus_url(const std::string& url);

/// The route that multicast takes, from ROOT/proc/net/route; an error where there is none (LCM then fails with "Network
/// is unreachable").
Finding check_route(const std::filesystem::path& root, const BusUrl& url);

/// ROOT/proc/sys/net/core/rmem_max and rmem_default: raw pictures die in the kernel's default (lcm_facts.md, 0.1).
std::vector<Finding> check_buffers(const std::filesystem::path& root);

/// The reassembly pool for messages from other hosts; only where ttl > 0 (lcm_facts.md, 2.3).
std::vector<Finding> check_reassembly(const std::filesystem::path& root, const BusUrl& url);

Finding check_ttl(const BusUrl& url);

/// Sends one message to ourselves over `url`.
Finding check_loopback(const std::string& url);

/// Java with windows, lcm-spy with its libraries and the types' jar, looked for in `path` (the value of PATH) and below
/// `root`.
std::vector<Finding> check_spy(const std::string& path, const std::filesystem::path& root,
                               const std::filesystem::path& jar);

/// Whether the kernel's clock is disciplined (adjtimex), and CLOCK_MONOTONIC goes on.
Finding check_clock();

/// Space left where recordings go.
Finding check_disk(const std::filesystem::path& folder, std::uint64_t wanted_bytes);

/// Whether --realtime will be granted; the second form is given who asks and with which limits (RLIMIT_RTPRIO, bytes of
/// RLIMIT_MEMLOCK).
Finding check_realtime();
Finding check_realtime(bool root, std::uint64_t priority_limit, std::uint64_t memory_limit);

/// Whether settings and services come back after a restart: ROOT/etc/sysctl.d and ROOT/etc/systemd/system.
std::vector<Finding> check_services(const std::filesystem::path& root);

/// Serial ports and cameras below ROOT/dev: whether they may be opened by us. Nothing where there are none.
std::vector<Finding> check_devices(const std::filesystem::path& root);

/// Prints a line per finding, worst last, and the mending commands; returns the worst level.
Level print_findings(const std::vector<Finding>& findings, std::ostream& out);

}  // namespace roadfix
