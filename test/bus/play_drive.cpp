// Publishes the made-up drive on a bus in real time: play_drive URL SECONDS
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <thread>

#include "bus/network_bus.h"
#include "support/small_drive.h"

int main(int argc, char** argv) {
  using namespace roadfix;
  if (argc != 3) return 2;
  NetworkBus bus(argv[1]);
  const auto begin = std::chrono::steady_clock::now();
  int64_t published = 0;
  for (const test::DriveMessage& message : test::small_drive(std::atof(argv[2]))) {
    std::this_thread::sleep_until(begin + std::chrono::microseconds(message.header.utime - test::kDriveStart_us));
    bus.publish(message.channel, message.bytes);
    ++published;
  }
  std::cout << published << " published\n";
  return 0;
}
