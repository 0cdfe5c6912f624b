// Drivers on a bus, with devices that are pseudo-terminals, sockets and files: unplugged, replugged, and replayed.
#include <arpa/inet.h>
#include <linux/can.h>
#include <sys/socket.h>
#include <unistd.h>

#include <catch2/catch.hpp>
#include <fstream>
#include <iostream>
#include <mutex>
#include <roadfix/gnss_t.hpp>
#include <roadfix/heartbeat_t.hpp>
#include <roadfix/imu_t.hpp>
#include <roadfix/raw_t.hpp>
#include <roadfix/wheels_t.hpp>
#include <thread>

#include "config/config.h"
#include "drivers/gnss_driver/handler.h"
#include "drivers/imu_driver/handler.h"
#include "drivers/wheel_driver/handler.h"
#include "support/driver_bench.h"
#include "support/outage_bus.h"

namespace roadfix {
namespace {

using test::Bench;
using test::Bytes;
using test::Pty;
using test::Published;
using test::replayed;
using test::sensor_messages;

DeviceConfig quick(const std::string& device) {
  DeviceConfig c;
  c.device = device;
  c.reopen_first = 0.01;
  c.reopen_max = 0.05;
  return c;
}

WheelDriverConfig one_wheel() {
  WheelDriverConfig config;
  config.device = quick("can:can0");
  config.speeds.resize(1);
  config.speeds[0].frame = "123";
  config.speeds[0].length = 16;
  config.speeds[0].factor = 0.01;
  return config;
}

Bytes imu_frame(uint32_t t_us) {
  test::Payload p(32);
  p.at<uint32_t>(0, t_us).at<uint16_t>(4, 0x03FF).at<int32_t>(14, -10'000'000);
  return test::sbg_bytes(kSbgImuShort, p.bytes());
}

TEST_CASE("a pseudo-terminal end to end: raw bytes, samples, and the same samples from the raw bytes") {
  const Pty pty;
  ImuDriverConfig config;
  config.device = quick(pty.name());
  Bench bench(imu_driver_setup(config));
  REQUIRE(bench.step_until([&] { return bench.count("RAW_IMU") > 0; }));  // opened
  for (uint32_t i = 0; i < 50; ++i) {
    Bytes bytes = imu_frame(5000 * i);
    if (i % 7 == 3) bytes[10] ^= 1U;                                        // a wrong checksum
    if (i % 5 == 0) test::append(bytes, test::bytes_of("\xFF\x5A noise"));  // half a beginning
    const auto cut = bytes.begin() + (i % 20);
    pty.write({bytes.begin(), cut});
    REQUIRE(bench.step_until(
        [raws = bench.count("RAW_IMU"), &bench, i] { return i % 20 == 0 || bench.count("RAW_IMU") > raws; }));
    pty.write({cut, bytes.end()});
    REQUIRE(bench.step_until([raws = bench.count("RAW_IMU"), &bench] { return bench.count("RAW_IMU") > raws; }));
  }
  REQUIRE(bench.count("IMU") > 20);
  CHECK(bench.count("IMU") <= 43);
  const std::vector<Published> live = sensor_messages(bench);
  CHECK(replayed(bench) == live);
  // Teeth: without the bytes that completed a sample it does not come.
  auto sample = std::prev(bench.sent.end());
  while (sample->channel != "IMU") --sample;
  while (sample->channel != "RAW_IMU") --sample;
  bench.sent.erase(sample);
  CHECK(replayed(bench).size() == live.size() - 1);
}

TEST_CASE("what the network did not take is told in the heartbeat, beside the device's own trouble") {
  ImuDriverConfig config;
  config.device = quick("/nowhere/imu");
  const DriverSetup setup = imu_driver_setup(config);
  for (const bool gone : {true, false}) {
    test::OutageBus bus;
    LiveDriver driver(setup, bus);
    bus.gone = gone;
    driver.step(std::chrono::milliseconds(0));  // a heartbeat and the configuration
    bus.gone = false;
    const auto h = test::last_of<heartbeat_t>(bus, "HEARTBEAT_IMU_DRIVER", [&] { driver.stop(); });
    CHECK_THAT(h.state_reason, Catch::Contains("/nowhere/imu"));
    CHECK((h.state_reason.find("the network did not take 2 messages") != std::string::npos) == gone);
  }
}

TEST_CASE("unplugged and plugged in again: said in the heartbeat, opened again with pauses") {
  const test::TemporaryFolder folder;
  const std::string link = (folder / "imu").string();
  ImuDriverConfig config;
  config.device = quick(link);
  Bench bench(imu_driver_setup(config));
  REQUIRE(bench.step_until([&] { return bench.driver().state_reason().find("No such file") != std::string::npos; }));
  uint32_t t_us = 0;
  for (int round = 0; round < 3; ++round) {
    {
      const Pty pty;
      std::filesystem::create_symlink(pty.name(), link);
      const std::size_t raws = bench.count("RAW_IMU");
      REQUIRE(bench.step_until([&] { return bench.count("RAW_IMU") > raws; }));
      const std::size_t samples = bench.count("IMU");
      REQUIRE(bench.step_until([&] {
        pty.write(imu_frame(t_us += 5000));
        return bench.count("IMU") > samples + 3;
      }));
      CHECK(bench.driver().state_reason().empty());
    }
    std::filesystem::remove(link);
    REQUIRE(bench.step_until([&] { return !bench.driver().state_reason().empty(); }));
  }
  bench.driver().stop();
  REQUIRE(bench.step_until([&] { return bench.heartbeat().state == heartbeat_t::STATE_STOPPING; }));
  CHECK(bench.heartbeat().state_reason.find("tried again in") != std::string::npos);
  CHECK(replayed(bench) == sensor_messages(bench));
}

TEST_CASE("a device that says nothing is a trouble") {
  const Pty pty;
  ImuDriverConfig config;
  config.device = quick(pty.name());
  config.device.silence = 0.05;
  Bench bench(imu_driver_setup(config));
  REQUIRE(bench.step_until([&] { return bench.driver().state_reason().find("no byte for") != std::string::npos; }));
}

TEST_CASE("the pauses between attempts grow to their limit, and begin anew after bytes") {
  DeviceConfig config;
  config.device = "x";
  config.reopen_first = 1.0;
  config.reopen_max = 4.0;
  int attempts = 0;
  DeviceSession session(
      [&]() -> std::unique_ptr<ByteSource> {
        ++attempts;
        throw SourceError("gone");
      },
      config);
  const DeviceSession::Clock::time_point begin{};
  std::vector<int> at_s;
  std::vector<Packet> packets;
  for (int ds = 0; ds < 200; ++ds) {
    const int before = attempts;
    session.step(begin + std::chrono::milliseconds(100 * ds), std::chrono::milliseconds(0), packets);
    if (attempts > before) at_s.push_back(ds / 10);
  }
  CHECK(at_s == std::vector<int>{0, 1, 3, 7, 11, 15, 19});
}

TEST_CASE("candump lines from a file become wheel speeds, the file's end ends the driver, replay agrees") {
  const test::TemporaryFolder folder;
  {
    std::ofstream file(folder / "can.log");
    for (int i = 0; i < 30; ++i)
      file << "(1700000000.0" << (10 + i) << "000) can0 123#"
           << "E803" << (i == 7 ? "x" : "") << "\n";
  }
  WheelDriverConfig config = one_wheel();
  config.device = quick("candump:" + (folder / "can.log").string());
  Bench bench(wheel_driver_setup(config));
  REQUIRE(bench.step_until([&] { return !bench.more; }));
  CHECK(bench.count("WHEELS") == 29);
  CHECK(replayed(bench) == sensor_messages(bench));
}

/// SocketCAN's datagrams without its kernel module: a socket of packets at one end of which frames are written.
class CanWire {
 public:
  CanWire() { REQUIRE(::socketpair(AF_UNIX, SOCK_SEQPACKET, 0, ends_) == 0); }
  ~CanWire() { unplug(); }
  CanWire(const CanWire&) = delete;
  CanWire& operator=(const CanWire&) = delete;
  [[nodiscard]] int device() const { return ::dup(ends_[1]); }
  template <class Frame>
  void send(const Frame& frame) const {
    REQUIRE(::send(ends_[0], &frame, sizeof frame, 0) == static_cast<ssize_t>(sizeof frame));
  }
  void unplug() {
    for (int& end : ends_) {
      if (end >= 0) ::close(end);
      end = -1;
    }
  }

 private:
  int ends_[2] = {-1, -1};
};

TEST_CASE("SocketCAN: the kernel's frames become wheel speeds, and an interface that went away is told") {
  CanWire wire;
  int opened = 0;
  DriverSetup setup = wheel_driver_setup(one_wheel());
  setup.open = [&](const auto&) {
    if (++opened > 1) throw SourceError("can:can0: Network is down");
    return can_source(wire.device(), "can0");
  };
  Bench bench(setup);
  REQUIRE(bench.step_until([&] { return bench.count("RAW_WHEELS") == 1; }));  // opened
  can_frame classic{};
  classic.can_id = 0x123;
  classic.len = 2;
  classic.data[0] = 0xE8, classic.data[1] = 0x03;  // 1000: 10 m/s
  canfd_frame fast{};
  fast.can_id = 0x123;
  fast.len = 8;
  fast.data[0] = 0xD0, fast.data[1] = 0x07;  // 20 m/s
  can_frame other = classic, error = classic, extended = classic;
  other.can_id = 0x124;
  error.can_id |= CAN_ERR_FLAG;
  extended.can_id |= CAN_EFF_FLAG;
  for (const can_frame& frame : {other, error, extended, classic}) wire.send(frame);
  REQUIRE(bench.step_until([&] { return bench.count("WHEELS") == 1; }));
  wire.send(fast);
  REQUIRE(bench.step_until([&] { return bench.count("WHEELS") == 2; }));
  CHECK(bench.driver().state_reason().empty());
  const std::vector<Published> live = sensor_messages(bench);
  CHECK(decode<wheels_t>(live[0].bytes).speed_mps[0] == Approx(10.0));
  CHECK(decode<wheels_t>(live[1].bytes).speed_mps[0] == Approx(20.0));
  CHECK(replayed(bench) == live);
  wire.unplug();
  REQUIRE(bench.step_until([&] { return bench.driver().state_reason().find("Network is down; tried again") == 10; }));
}

TEST_CASE("SocketCAN: an interface that is not there is said") {
  CHECK_THROWS_WITH(open_byte_source(quick("can:roadfix_none")), Catch::Contains("can:roadfix_none"));
}

TEST_CASE("SocketCAN: frames of vcan0 come in") {
  try {
    const auto source = open_byte_source(quick("can:vcan0"));
    std::vector<Packet> packets;
    CHECK(source->read(std::chrono::milliseconds(1), packets) == ReadState::kNothing);
  } catch (const SourceError& e) {
    std::cout << "skipped: " << e.what() << "\n";
  }
}

TEST_CASE("devices that cannot be are told apart from those that are not there") {
  CHECK_THROWS_AS(open_byte_source(quick("ttyUSB0")), std::invalid_argument);
  CHECK_THROWS_AS(open_byte_source(quick("tcp:nowhere")), std::invalid_argument);
  DeviceConfig odd = quick("/dev/null");
  CHECK_THROWS_AS(open_byte_source(odd), SourceError);
  odd.baud = 12345;
  CHECK_THROWS_WITH(open_byte_source(odd), Catch::Contains("115200"));
  CHECK_THROWS_AS(open_byte_source(quick("file:/no/such/file")), SourceError);
  CHECK_THROWS_AS(open_byte_source(quick("tcp:127.0.0.1:1")), SourceError);
}

/// A server on the loop-back that takes one connection, sends, and keeps what it hears.
class Server {
 public:
  explicit Server(Bytes answer) : answer_(std::move(answer)), socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t size = sizeof address;
    REQUIRE(::bind(socket_, reinterpret_cast<sockaddr*>(&address), size) == 0);
    REQUIRE(::listen(socket_, 1) == 0);
    REQUIRE(::getsockname(socket_, reinterpret_cast<sockaddr*>(&address), &size) == 0);
    port_ = ntohs(address.sin_port);
    thread_ = std::thread([this] { serve(); });
  }
  ~Server() {
    ::shutdown(socket_, SHUT_RDWR);
    thread_.join();
    ::close(socket_);
  }
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;
  [[nodiscard]] int port() const { return port_; }
  [[nodiscard]] std::string heard() {
    const std::lock_guard lock(mutex_);
    return heard_;
  }

 private:
  void serve() {
    const int peer = ::accept(socket_, nullptr, nullptr);
    if (peer < 0) return;
    static_cast<void>(!::write(peer, answer_.data(), answer_.size()));
    char buffer[4096];
    for (ssize_t n = 1; n > 0;) {
      n = ::read(peer, buffer, sizeof buffer);
      const std::lock_guard lock(mutex_);
      if (n > 0) heard_.append(buffer, static_cast<std::size_t>(n));
    }
    ::close(peer);
  }

  Bytes answer_;
  int socket_;
  int port_ = 0;
  std::mutex mutex_;
  std::string heard_;
  std::thread thread_;
};

TEST_CASE("a receiver over TCP") {
  Bytes stream;
  for (int i = 10; i < 20; ++i) {
    const std::string time = "1200" + std::to_string(i) + ".00";
    test::append(stream, test::nmea_bytes("GPGGA," + time + ",4800.0,N,00200.0,E,1,8,1.0,100,M,44,M,,"));
  }
  Server server(stream);
  GnssDriverConfig config;
  config.device = quick("tcp:127.0.0.1:" + std::to_string(server.port()));
  Bench bench(gnss_driver_setup(config));
  REQUIRE(bench.step_until([&] { return bench.count("GNSS") >= 1; }));
  CHECK(replayed(bench) == sensor_messages(bench));
}

TEST_CASE("NTRIP: corrections go to the receiver, its position to the caster") {
  const Bytes corrections = test::rtcm_bytes({0x3E, 0xD0, 0x55, 0x66});
  Bytes answer = test::bytes_of("ICY 200 OK\r\n");
  test::append(answer, corrections);
  Server caster(answer);
  {
    const Pty receiver;
    GnssDriverConfig config;
    config.device = quick(receiver.name());
    config.ntrip = NtripConfig{"127.0.0.1", caster.port(), "NEAR", "", "", 0.1};
    Bench bench(gnss_driver_setup(config));
    REQUIRE(bench.step_until([&] { return bench.count("RAW_GNSS") > 0; }));
    receiver.write(test::nmea_bytes("GPGGA,120000.00,4800.0,N,00200.0,E,1,8,1.0,100,M,44,M,,"));
    Bytes got;
    REQUIRE(bench.step_until([&] {
      test::append(got, receiver.read());
      return got.size() >= corrections.size() && bench.count("RAW_NTRIP") > 0 && bench.driver().state_reason().empty();
    }));
    CHECK(got == corrections);
    REQUIRE(bench.step_until([&] { return caster.heard().find("$GPGGA,") != std::string::npos; }));
  }
  CHECK(caster.heard().starts_with("GET /NEAR HTTP/1.1"));
}

}  // namespace
}  // namespace roadfix
