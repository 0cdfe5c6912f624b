#include "recovery_rig.h"

#include <fcntl.h>
#include <stdlib.h>
#include <sys/wait.h>
#include <termios.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <csignal>
#include <fstream>
#include <sstream>

namespace roadfix::test {

namespace {

double seconds_since(SteadyTime begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// What may be under way between a device and the bus when a driver dies: one read, and a frame.
constexpr std::size_t kUnderWay = 4096 + 256;
constexpr int kMessagesAtOnce = 20;

}  // namespace

void MadeDevice::plug_in() {
  main_ = ::posix_openpt(O_RDWR | O_NOCTTY | O_NONBLOCK | O_CLOEXEC);
  REQUIRE(::grantpt(main_) == 0);
  REQUIRE(::unlockpt(main_) == 0);
  termios raw{};  // before anybody opens it: no echo of our bytes to ourselves
  REQUIRE(::tcgetattr(main_, &raw) == 0);
  ::cfmakeraw(&raw);
  REQUIRE(::tcsetattr(main_, TCSANOW, &raw) == 0);
  std::filesystem::create_symlink(::ptsname(main_), link_);
}

void MadeDevice::unplug() {
  std::filesystem::remove(link_);
  if (main_ >= 0) ::close(main_);
  main_ = -1;
}

void MadeDevice::send(const Bytes& bytes) {
  if (main_ < 0) return;
  const ssize_t size = ::write(main_, bytes.data(), bytes.size());
  if (size > 0) sent_.insert(sent_.end(), bytes.begin(), bytes.begin() + size);
}

RecoveryRig::RecoveryRig(const std::filesystem::path& programs, DriverUnderTest driver, const std::string& config)
    : driver_(std::move(driver)), device_(folder_ / "device"), bus_(kUrl) {
  bus_.subscribe(".*", [this](const BusMessage& m) {
    received_[std::string(m.channel)].emplace_back(m.bytes.begin(), m.bytes.end());
  });
  std::ofstream(folder_ / "run.yaml") << "bus_url: \"" << kUrl << "\"\nprocesses: [{name: " << driver_.name << "}]\n";
  std::ofstream(folder_ / (driver_.name + ".yaml")) << "device: " << (folder_ / "device").string() << "\n" << config;
  const std::string program = (programs / "roadfix").string(), vehicle = folder_.path().string(),
                    said = (folder_ / "said").string();
  supervisor_ = ::fork();
  if (supervisor_ == 0) {
    const int out = ::open(said.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
    ::dup2(out, STDOUT_FILENO);
    ::dup2(out, STDERR_FILENO);
    ::execl(program.c_str(), program.c_str(), "run", vehicle.c_str(), nullptr);
    ::_exit(127);
  }
}

RecoveryRig::~RecoveryRig() {
  ::kill(supervisor_, SIGINT);
  ::waitpid(supervisor_, nullptr, 0);
}

/// What the supervisor said last: "imu_driver started, process 123".
pid_t RecoveryRig::driver_pid() const {
  std::ifstream said(folder_ / "said");
  std::string line;
  pid_t pid = 0;
  while (std::getline(said, line)) {
    const std::size_t at = line.find("started, process ");
    if (at != std::string::npos) pid = std::stoi(line.substr(at + 17));
  }
  return pid;
}

void RecoveryRig::speak(Says says) {
  const double t_s = seconds_since(begin_);
  if (t_s < next_s_) return;
  // What was missed on a busy machine is not made up for: a device keeps its pace.
  next_s_ = std::max(next_s_ + driver_.period_s, t_s);
  if (says == Says::kFrames) device_.send(driver_.frame(t_s));
  if (says == Says::kGarbage) {
    Bytes noise(driver_.frame_bytes + random_() % 50);
    for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random_());
    device_.send(noise);
  }
}

bool RecoveryRig::run_until(Says says, double patience_s, const std::function<bool()>& done) {
  const SteadyTime begin = std::chrono::steady_clock::now();
  while (!done()) {
    if (seconds_since(begin) > patience_s) return false;
    speak(says);
    bus_.handle(std::chrono::milliseconds(2));
    for (int i = 0; i < kMessagesAtOnce; ++i) bus_.handle(std::chrono::milliseconds(0));
  }
  return true;
}

double RecoveryRig::recovery_s() {
  constexpr double kNever_s = 30.0;
  const SteadyTime begin = trouble_.value_or(std::chrono::steady_clock::now());
  trouble_.reset();
  const std::size_t before = received_[driver_.channel].size();
  run_until(Says::kFrames, kNever_s, [&] { return received_[driver_.channel].size() > before; });
  return seconds_since(begin);
}

void RecoveryRig::kill_driver() {
  const std::size_t from = device_.sent().size();
  const pid_t pid = driver_pid();
  REQUIRE(pid > 0);
  REQUIRE(::kill(pid, SIGKILL) == 0);
  trouble_ = std::chrono::steady_clock::now();
  // Whatever came out of the old one has come; the next is the new one's, which says first that it opened the device.
  run_for(Says::kFrames, 0.05);
  const std::size_t before = received_[driver_.raw_channel].size();
  run_until(Says::kFrames, 60.0, [&] { return received_[driver_.raw_channel].size() > before; });
  gaps_.push_back({from - std::min(from, kUnderWay), device_.sent().size()});
}

void RecoveryRig::unplug_for(double seconds) {
  const std::size_t from = device_.sent().size();
  device_.unplug();
  run_for(Says::kFrames, seconds);
  device_.plug_in();
  trouble_ = std::chrono::steady_clock::now();
  const std::size_t before = received_[driver_.raw_channel].size();
  run_until(Says::kNothing, 60.0, [&] { return received_[driver_.raw_channel].size() > before; });
  gaps_.push_back({from - std::min(from, kUnderWay), device_.sent().size()});
}

std::string RecoveryRig::said() const {
  std::ifstream file(folder_ / "said");
  std::string text = heartbeat().state_reason + "\n";
  return text.append(std::istreambuf_iterator<char>(file), {});
}

std::vector<raw_t> RecoveryRig::raw() const {
  std::vector<raw_t> messages;
  const auto found = received_.find(driver_.raw_channel);
  if (found == received_.end()) return messages;
  for (const Bytes& bytes : found->second) messages.push_back(decode<raw_t>(bytes));
  return messages;
}

heartbeat_t RecoveryRig::heartbeat() const {
  for (const auto& [channel, messages] : received_)
    if (channel.starts_with("HEARTBEAT_") && !messages.empty()) return decode<heartbeat_t>(messages.back());
  return {};
}

}  // namespace roadfix::test
