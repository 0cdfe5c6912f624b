// Two figures of the bus that need a whole program each; prints "NAME VALUE" lines.
//   bus_figures latency         proof.live_p50_ratio: publish to handler at 1 kHz, 200 B, our bus and bare LCM side by
//   side,
//                               each on a port of its own (needs a multicast route: run it in a network namespace)
//   bus_figures index MBYTES    proof.index_ratio: time to index a log of images and small messages over time to read
//   it
#include <fcntl.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <iostream>
#include <lcm/lcm-cpp.hpp>
#include <thread>

#include "bus/log/log_index.h"
#include "bus/log/log_writer.h"
#include "bus/transport/network_bus.h"
#include "support/temporary_folder.h"

using namespace roadfix;

namespace {

constexpr int kMessages = 3000;
constexpr std::size_t kBytes = 200;
const std::string kBareUrl = "udpm://239.255.76.67:7701?ttl=0&recv_buf_size=4194304";
const std::string kOurUrl = "udpm://239.255.76.67:7702?ttl=0";

int64_t now_ns() {
  timespec now{};
  ::clock_gettime(CLOCK_MONOTONIC, &now);
  return int64_t{now.tv_sec} * 1'000'000'000 + now.tv_nsec;
}

double age_us(const void* message) {
  int64_t sent_ns = 0;
  std::memcpy(&sent_ns, message, sizeof sent_ns);
  return static_cast<double>(now_ns() - sent_ns) * 1e-3;
}

double median(std::vector<double>& values) {
  if (values.empty()) throw std::runtime_error("nothing was received");
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

void listen_bare(const std::atomic<bool>& stop, std::vector<double>& ages) {
  lcm::LCM lcm(kBareUrl);
  using Receive = void (*)(const lcm::ReceiveBuffer*, const std::string&, std::vector<double>*);
  const Receive receive = [](const lcm::ReceiveBuffer* buffer, const std::string&, std::vector<double>* to) {
    to->push_back(age_us(buffer->data));
  };
  lcm.subscribeFunction("TICK", receive, &ages)->setQueueCapacity(0);
  while (!stop) lcm.handleTimeout(20);
}

void listen_ours(const std::atomic<bool>& stop, std::vector<double>& ages) {
  NetworkBus bus(kOurUrl);
  bus.subscribe("TICK", [&](const BusMessage& message) { ages.push_back(age_us(message.bytes.data())); });
  while (!stop) bus.handle(std::chrono::milliseconds(20));
}

void measure_latency() {
  std::atomic<bool> stop = false;
  std::vector<double> bare;
  std::vector<double> ours;
  std::thread bare_thread([&] { listen_bare(stop, bare); });
  std::thread our_thread([&] { listen_ours(stop, ours); });
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  lcm::LCM to_bare(kBareUrl);
  lcm::LCM to_ours(kOurUrl);
  std::vector<uint8_t> message(kBytes);
  auto due = std::chrono::steady_clock::now();
  for (int i = 0; i < 2 * kMessages; ++i) {
    due += std::chrono::microseconds(500);
    std::this_thread::sleep_until(due);
    const int64_t sent_ns = now_ns();
    std::memcpy(message.data(), &sent_ns, sizeof sent_ns);
    (i % 2 == 0 ? to_bare : to_ours).publish("TICK", message.data(), kBytes);
  }
  std::this_thread::sleep_for(std::chrono::milliseconds(200));
  stop = true;
  bare_thread.join();
  our_thread.join();
  const double bare_us = median(bare);
  const double our_us = median(ours);
  std::cout << "bare_received " << bare.size() << "\nours_received " << ours.size() << "\nbare_p50_us " << bare_us
            << "\nours_p50_us " << our_us << "\nlive_p50_ratio " << our_us / bare_us << "\n";
}

double read_seconds(const std::filesystem::path& path) {
  std::vector<uint8_t> buffer(std::size_t{1} << 20);
  const int64_t begin_ns = now_ns();
  const int fd = ::open(path.c_str(), O_RDONLY);
  while (::read(fd, buffer.data(), buffer.size()) > 0) {
  }
  ::close(fd);
  return static_cast<double>(now_ns() - begin_ns) * 1e-9;
}

void measure_index(int mbytes) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / "big.lcm";
  {
    LogWriter writer(path);
    const std::vector<uint8_t> image(100'000, 7);
    const std::vector<uint8_t> imu(80, 7);
    while (writer.bytes() < static_cast<uint64_t>(mbytes) << 20) {
      writer.write("CAMERA_LEFT", 1, image);
      for (int i = 0; i < 20; ++i) writer.write("IMU", 1, imu);
    }
    writer.commit();
  }
  double read_s = read_seconds(path);
  read_s = std::min(read_s, read_seconds(path));
  double index_s = 1e9;
  for (int i = 0; i < 2; ++i) {
    const int64_t begin_ns = now_ns();
    LogReader reader(path);
    const LogIndex index = index_logs({&reader}, [](std::string_view) { return true; });
    if (index.messages.empty()) throw std::runtime_error("an empty index");
    index_s = std::min(index_s, static_cast<double>(now_ns() - begin_ns) * 1e-9);
  }
  std::cout << "read_s " << read_s << "\nindex_s " << index_s << "\nindex_ratio " << index_s / read_s << "\n";
}

}  // namespace

int main(int argc, char** argv) {
  const std::string what = argc > 1 ? argv[1] : "";
  try {
    if (what == "latency") {
      measure_latency();
    } else if (what == "index" && argc == 3) {
      measure_index(std::stoi(argv[2]));
    } else {
      std::cerr << "bus_figures latency | bus_figures index MBYTES\n";
      return 2;
    }
  } catch (const std::exception& e) {
    std::cerr << "bus_figures: " << e.what() << "\n";
    return 2;
  }
  return 0;
}
