// Plays the sensors of a drive on a bus again and again, as if it went on from now, SPEED times as fast as it was
// recorded: loop_player URL LOG SPEED SECONDS_OF_DATA. Stamps and numbers go on from loop to loop. Prints the seconds
// of data played, once a minute of them, and at the end by how many seconds it was behind its own plan at most.
#include <algorithm>
#include <chrono>
#include <cstdlib>
#include <iostream>
#include <map>
#include <thread>

#include "bus/log/log_reader.h"
#include "bus/run/run_clock.h"
#include "bus/transport/network_bus.h"
#include "bus/types/message.h"

namespace {

using namespace roadfix;

struct Entry {
  int64_t at_us = 0;
  std::string channel;
  std::vector<uint8_t> bytes;
};

void write_int64(uint8_t* data, int64_t value) {
  for (int i = 7; i >= 0; --i, value >>= 8) data[i] = static_cast<uint8_t>(value);
}

std::vector<Entry> read_drive(const char* path) {
  LogReader reader(path);
  std::vector<Entry> drive;
  std::optional<int64_t> first_us;
  while (const std::optional<LogEvent> event = reader.next()) {
    if (!first_us) first_us = event->timestamp_us;
    const std::string channel(event->channel);
    if (!read_header(event->data) || channel.starts_with("CONFIG_")) continue;
    Entry entry{event->timestamp_us - *first_us, channel, {event->data.begin(), event->data.end()}};
    write_int64(entry.bytes.data() + 8, read_header(event->data)->utime - *first_us);
    drive.push_back(std::move(entry));
  }
  return drive;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 5) return 2;
  const double speed = std::atof(argv[3]);
  const auto until_us = static_cast<int64_t>(std::atof(argv[4]) * 1e6);
  const std::vector<Entry> drive = read_drive(argv[2]);
  if (drive.empty() || speed <= 0.0) return 2;
  constexpr int64_t kBetween_us = 50'000;  // two loops are one period of a sensor apart
  constexpr int64_t kMinute_us = 60'000'000;
  const int64_t length_us = drive.back().at_us + kBetween_us;
  NetworkBus bus(argv[1]);
  RunClock clock;
  const int64_t run = clock.now_utime();
  const auto begin = std::chrono::steady_clock::now();
  std::map<std::string, int64_t> seq;
  double behind_s = 0.0;
  int64_t told_us = 0;
  for (int64_t offset_us = 0; offset_us < until_us; offset_us += length_us) {
    for (const Entry& entry : drive) {
      const int64_t at_us = offset_us + entry.at_us;
      if (at_us >= until_us) break;
      const auto due = begin + std::chrono::microseconds(static_cast<int64_t>(static_cast<double>(at_us) / speed));
      std::this_thread::sleep_until(due);
      behind_s = std::max(behind_s, std::chrono::duration<double>(std::chrono::steady_clock::now() - due).count());
      std::vector<uint8_t> bytes = entry.bytes;
      write_int64(bytes.data() + 8, read_int64(bytes.data() + 8) + run + offset_us);
      write_int64(bytes.data() + 16, run);
      write_int64(bytes.data() + 24, seq[entry.channel]++);
      bus.publish(entry.channel, bytes);
      if (at_us - told_us < kMinute_us) continue;
      told_us = at_us;
      std::cout << "played " << at_us / 1'000'000 << std::endl;
    }
  }
  std::cout << "behind " << behind_s << std::endl;
  return 0;
}
