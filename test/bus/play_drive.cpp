// Publishes the made-up drive on a bus in real time: play_drive URL SECONDS [CHANNEL FROM_S TO_S, which is silent then]
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "bus/transport/network_bus.h"
#include "support/small_drive.h"

int main(int argc, char** argv) {
  using namespace roadfix;
  if (argc != 3 && argc != 6) return 2;
  const std::string silent = argc == 6 ? argv[3] : "";
  const double from_s = argc == 6 ? std::atof(argv[4]) : 0.0;
  const double to_s = argc == 6 ? std::atof(argv[5]) : 0.0;
  NetworkBus bus(argv[1]);
  const auto begin = std::chrono::steady_clock::now();
  int64_t published = 0;
  for (const test::DriveMessage& message : test::small_drive(std::atof(argv[2]))) {
    std::this_thread::sleep_until(begin + std::chrono::microseconds(message.header.utime - test::kDriveStart_us));
    const double elapsed_s = static_cast<double>(message.header.utime - test::kDriveStart_us) * 1e-6;
    if (message.channel == silent && from_s <= elapsed_s && elapsed_s < to_s) continue;
    bus.publish(message.channel, message.bytes);
    ++published;
  }
  std::cout << published << " published\n";
  return 0;
}
