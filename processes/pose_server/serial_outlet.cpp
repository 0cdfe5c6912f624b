#include <poll.h>
#include <termios.h>

#include "drivers/device/byte_source.h"
#include "drivers/device/serial_port.h"
#include "pose_server/outlets.h"
#include "pose_server/sentence_queue.h"
#include "pose_server/socket_address.h"

namespace roadfix {

namespace {

constexpr std::size_t kMostWaiting = 2'048;  ///< a second or two of sentences: more would only be older
constexpr auto kReopen = std::chrono::seconds(1);
/// A pseudo-terminal whose reader takes nothing for so long is emptied: who opens it later wants the present.
constexpr auto kStale = std::chrono::seconds(1);

class SerialOutlet final : public Outlet {
 public:
  SerialOutlet(std::string device, int baud) : device_(std::move(device)), baud_(baud) {
    if (device_ == "pty:") {
      Pty pty = open_pty_ends();
      port_ = Descriptor(pty.main);
      end_ = Descriptor(pty.end);
      device_ = pty.name;
    } else {
      port_ = Descriptor(open_serial_port(device_, baud_));
    }
  }

  void send(std::string_view sentences, Clock::time_point now) override {
    if (!port_.open()) return;
    queue_.add(sentences);
    flush(now);
  }

  void step(Clock::time_point now) override {
    if (port_.open()) {
      flush(now);
    } else if (now >= due_) {
      reopen(now);
    }
  }

  [[nodiscard]] std::string name() const override { return "serial " + device_; }
  [[nodiscard]] std::string state_reason() const override { return state_reason_; }

 private:
  void flush(Clock::time_point now) {
    if (end_.open() && queue_.stuck(now) > kStale) {
      ::tcflush(end_.get(), TCIFLUSH);
      queue_.clear();
    }
    if (queue_.flush(port_.get(), now) && !hung_up()) return;
    if (end_.open()) return;  // ours from both ends: it cannot go away
    port_ = Descriptor();
    queue_.clear();
    state_reason_ = name() + " went away";
    due_ = now + kReopen;
  }

  [[nodiscard]] bool hung_up() const {
    pollfd state{port_.get(), 0, 0};
    return ::poll(&state, 1, 0) > 0 && (state.revents & (POLLHUP | POLLERR)) != 0;
  }

  void reopen(Clock::time_point now) {
    due_ = now + kReopen;
    try {
      port_ = Descriptor(open_serial_port(device_, baud_));
      state_reason_.clear();
    } catch (const SourceError& e) {
      state_reason_ = std::string("serial ") + e.what();
    }
  }

  std::string device_;
  int baud_;
  Descriptor port_, end_;  ///< end_: the other end of a pseudo-terminal of ours
  SentenceQueue queue_{kMostWaiting};
  Clock::time_point due_{};
  std::string state_reason_;
};

}  // namespace

std::unique_ptr<Outlet> open_serial_outlet(const std::string& device, int baud) {
  try {
    return std::make_unique<SerialOutlet>(device, baud);
  } catch (const SourceError& e) {
    throw OutletError(std::string("serial: ") + e.what());
  } catch (const std::invalid_argument& e) {  // no such baud rate
    throw OutletError(std::string("serial: ") + e.what());
  }
}

std::vector<std::unique_ptr<Outlet>> open_outlets(const PoseServerConfig& config) {
  std::vector<std::unique_ptr<Outlet>> outlets;
  if (!config.tcp.empty()) outlets.push_back(listen_tcp(config.tcp, config.clients, config.patience));
  for (const std::string& address : config.udp) outlets.push_back(send_udp(address));
  if (!config.serial.empty()) outlets.push_back(open_serial_outlet(config.serial, config.baud));
  if (outlets.empty()) throw OutletError("neither tcp, udp nor serial says where the sentences are to go");
  return outlets;
}

}  // namespace roadfix
