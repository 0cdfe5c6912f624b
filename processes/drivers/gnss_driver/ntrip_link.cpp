#include "drivers/gnss_driver/ntrip_link.h"

#include <fstream>
#include <utility>

#include "drivers/device/tcp_source.h"
#include "drivers/protocols/ntrip.h"

namespace roadfix {

namespace {

using SteadyClock = std::chrono::steady_clock;

constexpr auto kPollTimeout = std::chrono::milliseconds(100);
constexpr std::chrono::duration<double> kFirstPause(1.0), kLongestPause(60.0);
/// What waits for a device that takes nothing; older corrections are worthless.
constexpr std::size_t kMaxWaiting = std::size_t{1} << 16;

int64_t steady_us() {
  return std::chrono::duration_cast<std::chrono::microseconds>(SteadyClock::now().time_since_epoch()).count();
}

std::string first_line(const std::string& path) {
  std::ifstream file(path);
  std::string line;
  if (!std::getline(file, line)) throw std::runtime_error(path + ": cannot read the NTRIP password");
  while (line.ends_with('\r')) line.pop_back();
  return line;
}

}  // namespace

NtripLink::NtripLink(const NtripConfig& config) : config_(config) {
  NtripRequest request{config.host, config.port, config.mountpoint, config.user, ""};
  if (!config.password_file.empty()) request.password = first_line(config.password_file);
  request_ = ntrip_request(request);
  thread_ = std::thread([this] { work(); });
}

NtripLink::~NtripLink() {
  stop_ = true;
  thread_.join();
}

void NtripLink::set_state_reason(const std::string& text) {
  const std::lock_guard lock(mutex_);
  state_reason_ = text;
}

void NtripLink::work() {
  auto pause = kFirstPause;
  while (!stop_) {
    const auto begin = SteadyClock::now();
    try {
      run_session();
    } catch (const SourceError& e) {
      set_state_reason(std::string("NTRIP: ") + e.what());
    }
    if (SteadyClock::now() - begin > kLongestPause) pause = kFirstPause;  // it had worked
    const auto until = SteadyClock::now() + pause;
    while (!stop_ && SteadyClock::now() < until) std::this_thread::sleep_for(kPollTimeout);
    pause = std::min(2.0 * pause, kLongestPause);
  }
}

/// One connection, until it ends.
void NtripLink::run_session() {
  TcpSource caster(config_.host, std::to_string(config_.port));
  const auto write = [&](const std::string& text) {
    return caster.write({reinterpret_cast<const uint8_t*>(text.data()), text.size()});
  };
  write(request_);
  NtripAnswer answer;
  std::vector<Packet> packets;
  SteadyClock::time_point next_position{};
  while (!stop_ && answer.state() != NtripAnswer::State::kRefused) {
    packets.clear();
    if (caster.read(kPollTimeout, packets) == ReadState::kLost) {
      return set_state_reason("NTRIP: " + caster.name() + ": went away");
    }
    for (const Packet& packet : packets) {
      const std::vector<uint8_t> frames = answer.feed(steady_us(), packet.bytes);
      const std::lock_guard lock(mutex_);
      if (corrections_.size() + frames.size() > kMaxWaiting) corrections_.clear();
      corrections_.insert(corrections_.end(), frames.begin(), frames.end());
    }
    if (answer.state() != NtripAnswer::State::kStreaming) continue;
    set_state_reason("");
    if (config_.send_position <= 0.0 || SteadyClock::now() < next_position) continue;
    std::string position;
    {
      const std::lock_guard lock(mutex_);
      position = position_;
    }
    if (position.empty() || !write(position)) continue;
    next_position = SteadyClock::now() + std::chrono::duration_cast<SteadyClock::duration>(
                                             std::chrono::duration<double>(config_.send_position));
  }
  if (answer.state() == NtripAnswer::State::kRefused) set_state_reason("NTRIP: " + caster.name() + ": " + answer.why());
}

void NtripLink::step(int64_t now_utime, const SensorDriver& driver, ByteSource* device) {
  const auto position = dynamic_cast<const GnssDriver&>(driver).position_for_caster(now_utime);
  std::vector<uint8_t> corrections;
  {
    const std::lock_guard lock(mutex_);
    if (position) position_ = *position;
    corrections = std::exchange(corrections_, {});
    received_.insert(received_.end(), corrections.begin(), corrections.end());
  }
  if (device != nullptr && !corrections.empty()) device_rejects_ = !device->write(corrections);
}

std::vector<uint8_t> NtripLink::take_received() { return std::exchange(received_, {}); }

std::string NtripLink::state_reason() const {
  const std::lock_guard lock(mutex_);
  return state_reason_.empty() && device_rejects_ ? "NTRIP: the receiver takes no corrections" : state_reason_;
}

}  // namespace roadfix
