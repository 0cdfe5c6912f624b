#include <arpa/inet.h>
#include <fmt/format.h>
#include <lcm/lcm-cpp.hpp>

#include <charconv>
#include <chrono>
#include <fstream>
#include <sstream>
#include <stdexcept>

#include "roadfix/doctor/doctor.h"

namespace roadfix {
namespace {

/// One raw stereo pair of KITTI's size fits with room for a burst (lcm_facts.md, 0.1: 2 MB in the URL lost nothing at
/// 100 Hz).
constexpr long kReceiveBufferBytes = 4'194'304;
/// lcm_facts.md, 2.3: 64 MB of reassembly, 1 s of time-out.
constexpr long kReassemblyBytes = 67'108'864;
constexpr long kReassemblySeconds = 1;
constexpr int kLoopbackTimeoutMs = 1500;

long read_number(const std::filesystem::path& file) {
  std::ifstream in(file);
  long value = -1;
  in >> value;
  return in ? value : -1;
}

int parse_int(const std::string& text, const std::string& what) {
  int value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw std::invalid_argument(fmt::format("{}: '{}' is no whole number", what, text));
  return value;
}

Finding too_small(const std::string& name, long seen, long wanted, const std::string& why) {
  const std::string key = "net." + name;
  if (seen >= wanted) return {Level::kOk, key, std::to_string(seen), ""};
  return {Level::kWarning, key, fmt::format("{} (wanted {}): {}", seen, wanted, why),
          fmt::format("sysctl -w {}={}", key, wanted)};
}

}  // namespace

BusUrl parse_bus_url(const std::string& url) {
  const std::string scheme = "udpm://";
  if (url.rfind(scheme, 0) != 0)
    throw std::invalid_argument(fmt::format("bus URL '{}': only udpm:// goes over a network", url));
  BusUrl parsed;
  const std::string rest = url.substr(scheme.size());
  const std::size_t question = rest.find('?');
  const std::string address = rest.substr(0, question);
  if (!address.empty()) {
    const std::size_t colon = address.find(':');
    parsed.group = address.substr(0, colon);
    if (colon != std::string::npos)
      parsed.port = parse_int(address.substr(colon + 1), fmt::format("bus URL '{}', port", url));
  }
  in_addr group{};
  if (inet_pton(AF_INET, parsed.group.c_str(), &group) != 1 || !IN_MULTICAST(ntohl(group.s_addr)))
    throw std::invalid_argument(
        fmt::format("bus URL '{}': '{}' is no multicast address (224.0.0.0 to 239.255.255.255)", url, parsed.group));
  if (question == std::string::npos) return parsed;
  std::istringstream arguments(rest.substr(question + 1));
  for (std::string argument; std::getline(arguments, argument, '&');)
    if (argument.rfind("ttl=", 0) == 0)
      parsed.ttl = parse_int(argument.substr(4), fmt::format("bus URL '{}', ttl", url));
  return parsed;
}

Finding check_route(const std::filesystem::path& root, const BusUrl& url) {
  in_addr group{};
  inet_pton(AF_INET, url.group.c_str(), &group);
  std::ifstream table(root / "proc/net/route");
  std::string line;
  std::getline(table, line);  // the heading
  std::string best;
  uint32_t best_mask = 0;
  while (std::getline(table, line)) {
    // Interface, destination, gateway, flags, refcount, use, metric, mask: addresses in hex, network byte order as the
    // machine stores it.
    std::istringstream fields(line);
    std::string interface, gateway, flags;
    uint32_t destination = 0, mask = 0;
    int unused = 0;
    fields >> interface >> std::hex >> destination >> gateway >> flags >> std::dec >> unused >> unused >> unused >>
        std::hex >> mask;
    if (!fields || (group.s_addr & mask) != destination) continue;
    if (best.empty() || ntohl(mask) > ntohl(best_mask)) {
      best = interface;
      best_mask = mask;
    }
  }
  const std::string add = "ip route replace 224.0.0.0/4 dev lo";
  if (best.empty())
    return {Level::kError, "multicast route", fmt::format("none to {}: LCM cannot start", url.group),
            "ip link set lo up && " + add};
  if (url.ttl == 0 && best != "lo")
    return {Level::kWarning, "multicast route", fmt::format("through {}: works, at twice the latency of lo", best),
            add};
  if (url.ttl > 0 && best == "lo")
    return {Level::kError, "multicast route", fmt::format("through lo, but ttl={} asks for other hosts", url.ttl), "",
            "ip route replace 224.0.0.0/4 dev INTERFACE, that of the vehicle's network (ip -brief link)"};
  return {Level::kOk, "multicast route", "through " + best, ""};
}

std::vector<Finding> check_buffers(const std::filesystem::path& root) {
  const std::filesystem::path core = root / "proc/sys/net/core";
  return {too_small("core.rmem_max", read_number(core / "rmem_max"), kReceiveBufferBytes,
                    "processes cannot ask for the buffer that pictures need"),
          too_small("core.rmem_default", read_number(core / "rmem_default"), kReceiveBufferBytes,
                    "lcm-spy and lcm-logger take this one; raw pictures are lost")};
}

std::vector<Finding> check_reassembly(const std::filesystem::path& root, const BusUrl& url) {
  if (url.ttl == 0) return {};
  const std::filesystem::path ipv4 = root / "proc/sys/net/ipv4";
  std::vector<Finding> findings = {too_small("ipv4.ipfrag_high_thresh", read_number(ipv4 / "ipfrag_high_thresh"),
                                             kReassemblyBytes, "one lost packet blocks the reassembly of others")};
  const long seconds = read_number(ipv4 / "ipfrag_time");
  if (seconds > kReassemblySeconds)
    findings.push_back({Level::kWarning, "net.ipv4.ipfrag_time",
                        fmt::format("{} s: broken messages fill the pool for that long", seconds),
                        fmt::format("sysctl -w net.ipv4.ipfrag_time={}", kReassemblySeconds)});
  return findings;
}

Finding check_ttl(const BusUrl& url) {
  if (url.ttl == 0) return {Level::kOk, "ttl", "0: nothing leaves this machine", ""};
  return {Level::kWarning, "ttl",
          fmt::format("{}: every message goes out to the network, and anyone there can send", url.ttl),
          fmt::format("export LCM_DEFAULT_URL='udpm://{}:{}?ttl=0'", url.group, url.port), "unless it is meant so"};
}

Finding check_loopback(const std::string& url) {
  const char* name = "loop-back";
  lcm::LCM bus(url);
  if (!bus.good())
    return {Level::kError, name, "the bus does not open at " + url,
            "ip link set lo up && ip route replace 224.0.0.0/4 dev lo"};
  struct Receiver {
    bool received = false;
    void handle(const lcm::ReceiveBuffer* /*buffer*/, const std::string& /*channel*/) { received = true; }
  } receiver;
  const std::string channel = "ROADFIX_DOCTOR";
  bus.subscribe(channel, &Receiver::handle, &receiver);
  const auto start = std::chrono::steady_clock::now();
  const std::string probe = "doctor";
  bus.publish(channel, probe.data(), static_cast<unsigned>(probe.size()));
  while (!receiver.received && std::chrono::steady_clock::now() - start < std::chrono::milliseconds(kLoopbackTimeoutMs))
    bus.handleTimeout(50);
  if (!receiver.received)
    return {Level::kError, name, "a message to ourselves did not come back", "",
            "a firewall drops it? nft list ruleset shows who; let UDP to 224.0.0.0/4 pass"};
  return {Level::kOk, name, "a message to ourselves came back", ""};
}

}  // namespace roadfix
