// Plays a drive on a bus in real time as if it happened now, and spoils it as a schedule says: fault_player URL LOG
// SCHEDULE CHANNELS [BEGIN_US]
//
// A line of the schedule: NAME FROM_S TO_S CHANNELS KIND VALUE, where CHANNELS is a regular expression over names. Told
// on stdout when it begins and ends: "begin NAME WALL_US", and first of all "spoilt NAME MESSAGES". Acts on what was
// recorded, pictures too, unlike the faults of `roadfix simulate`, and on the bytes.
//   unplugged  nothing comes; the numbers go on afterwards without a gap      lost       nothing comes; a gap in the
//   numbers tells frozen     the last values under new stamps                                delayed    comes VALUE s
//   later shifted    stamps are VALUE s off                                          garbage    bytes that are no
//   message nan        a message in order whose values are no numbers (a picture: bytes that are no picture) flood
//   VALUE messages instead of one                                   step       the clock of all CHANNELS is VALUE s off
//   from here on forged     beside the true messages false ones, of wrong type, size or time, on every channel that
//   test/bus/forged.h knows mark       nothing: somebody else does something (kills a process, pulls a cable)
#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <iostream>
#include <random>
#include <regex>
#include <sstream>
#include <thread>

#include "bus/forged.h"
#include "bus/log/log_reader.h"
#include "bus/run/run_clock.h"
#include "bus/transport/network_bus.h"

namespace {

using namespace roadfix;

struct Fault {
  std::string name, channels, kind;
  int64_t from_us = 0, to_us = 0;
  double value = 0.0;
  std::regex pattern;

  [[nodiscard]] bool holds(int64_t t_us) const { return from_us <= t_us && (t_us < to_us || kind == "step"); }
};

/// To be published `at_us` after the beginning. `stamped`: utime counts from the beginning, too. `ours`: not forged.
struct Planned {
  int64_t at_us = 0;
  std::string channel;
  std::vector<uint8_t> bytes;
  bool stamped = true;
  bool ours = true;
};

int64_t to_us(double seconds) { return std::llround(seconds * 1e6); }

std::vector<Fault> read_schedule(const char* path) {
  std::vector<Fault> faults;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream words(line);
    Fault fault;
    double from_s = 0.0, to_s = 0.0;
    if (!(words >> fault.name >> from_s >> to_s >> fault.channels >> fault.kind >> fault.value)) {
      throw std::runtime_error("fault_player: not a line of a schedule: " + line);
    }
    fault.from_us = to_us(from_s);
    fault.to_us = to_us(to_s);
    fault.pattern = fault.channels;
    faults.push_back(std::move(fault));
  }
  return faults;
}

void write_int64(uint8_t* data, int64_t value) {
  for (int i = 7; i >= 0; --i, value >>= 8) data[i] = static_cast<uint8_t>(value);
}

constexpr std::size_t kHeadBytes = 32, kUtime = 8, kRun = 16, kSeq = 24;

/// The doubles of a sensor message are replaced; a picture keeps its head and loses its contents.
std::vector<uint8_t> without_numbers(const std::string& channel, std::span<const uint8_t> bytes, std::mt19937& random) {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto all_nan = [&](auto& values) { std::fill(std::begin(values), std::end(values), kNan); };
  if (channel == "IMU") {
    auto m = decode<imu_t>(bytes);
    all_nan(m.gyro_radps);
    all_nan(m.accel_mps2);
    return encode(m);
  }
  if (channel == "GNSS") {
    auto m = decode<gnss_t>(bytes);
    m.lat_deg = m.lon_deg = m.height_m = kNan;
    all_nan(m.velocity_enu_mps);
    return encode(m);
  }
  if (channel == "WHEELS") {
    auto m = decode<wheels_t>(bytes);
    all_nan(m.speed_mps);
    return encode(m);
  }
  if (channel == "MAG") {
    auto m = decode<mag_t>(bytes);
    all_nan(m.field_ut);
    return encode(m);
  }
  auto m = decode<image_t>(bytes);
  for (uint8_t& byte : m.data) byte = static_cast<uint8_t>(random());
  return encode(m);
}

class Plan {
 public:
  explicit Plan(const std::vector<Fault>& faults) : faults_(faults) {}

  /// One message of the drive, `t_us` after its beginning.
  void add(int64_t t_us, const std::string& channel, std::span<const uint8_t> bytes, int64_t first_us) {
    Planned planned{t_us, channel, {bytes.begin(), bytes.end()}};
    int64_t stamp_us = read_header(bytes)->utime - first_us;
    int copies = 1;
    bool garbage = false;
    for (const Fault& fault : faults_) {
      if (!fault.holds(t_us) || !std::regex_match(channel, fault.pattern)) continue;
      ++spoilt_[fault.name];
      if (fault.kind == "unplugged") return;
      if (fault.kind == "lost") {
        ++seq_[channel];
        return;
      }
      if (fault.kind == "frozen" && last_.contains(channel)) planned.bytes = last_[channel];
      if (fault.kind == "delayed") planned.at_us += to_us(fault.value);
      if (fault.kind == "shifted" || fault.kind == "step") stamp_us += to_us(fault.value);
      if (fault.kind == "nan") planned.bytes = without_numbers(channel, bytes, random_);
      if (fault.kind == "flood") copies = static_cast<int>(fault.value);
      garbage = garbage || fault.kind == "garbage";
    }
    last_[channel] = planned.bytes;
    const int64_t step_us = period_us(channel, t_us) / copies;
    for (int i = 0; i < copies; ++i) {
      Planned copy = planned;
      copy.at_us += i * step_us;
      write_int64(copy.bytes.data() + kUtime, stamp_us + i * step_us);
      write_int64(copy.bytes.data() + kSeq, seq_[channel]++);
      if (garbage) {
        for (std::size_t at = kHeadBytes; at < copy.bytes.size(); ++at)
          copy.bytes[at] = static_cast<uint8_t>(random_());
        copy.bytes.resize(copy.bytes.size() - 1 - random_() % 8);
      }
      planned_.push_back(std::move(copy));
    }
  }

  void forge() {
    for (const Fault& fault : faults_) {
      if (fault.kind != "forged") continue;
      const std::vector<test::Forged> all = test::forged_messages(random_);
      const int64_t step_us = (fault.to_us - fault.from_us) / static_cast<int64_t>(all.size());
      int64_t at_us = fault.from_us;
      for (const test::Forged& forged : all) {
        planned_.push_back({at_us, forged.channel, forged.bytes, forged.stamped, false});
        at_us += step_us;
      }
    }
  }

  /// How many messages each fault met.
  [[nodiscard]] const std::map<std::string, int>& spoilt() const { return spoilt_; }

  std::vector<Planned> take() {
    std::stable_sort(planned_.begin(), planned_.end(),
                     [](const Planned& a, const Planned& b) { return a.at_us < b.at_us; });
    return std::move(planned_);
  }

 private:
  int64_t period_us(const std::string& channel, int64_t t_us) {
    const auto [known, first] = last_at_us_.try_emplace(channel, t_us);
    const int64_t period_us = t_us - known->second;
    known->second = t_us;
    return first ? 0 : period_us;
  }

  const std::vector<Fault>& faults_;
  std::mt19937 random_{20};
  std::map<std::string, int64_t> seq_, last_at_us_;
  std::map<std::string, int> spoilt_;
  std::map<std::string, std::vector<uint8_t>> last_;
  std::vector<Planned> planned_;
};

std::vector<Planned> plan_of(const char* log, const std::vector<Fault>& faults, const std::string& channels) {
  LogReader reader(log);
  Plan plan(faults);
  std::optional<int64_t> first_us;
  const std::regex wanted(channels);
  while (const std::optional<LogEvent> event = reader.next()) {
    if (!first_us) first_us = event->timestamp_us;
    const std::string channel(event->channel);
    if (!std::regex_match(channel, wanted) || !read_header(event->data)) continue;
    plan.add(event->timestamp_us - *first_us, channel, event->data, *first_us);
  }
  plan.forge();
  for (const auto& [name, count] : plan.spoilt()) std::cout << "spoilt " << name << " " << count << std::endl;
  return plan.take();
}

void play(const char* url, std::vector<Planned> messages, const std::vector<Fault>& faults, int64_t begin_us) {
  NetworkBus bus(url);
  RunClock clock;
  if (begin_us == 0) begin_us = clock.now_utime() + 200'000;
  const auto wait_until = [&](int64_t at_us) {
    const int64_t left_us = begin_us + at_us - clock.now_utime();
    if (left_us > 0) std::this_thread::sleep_for(std::chrono::microseconds(left_us));
  };
  std::vector<std::pair<int64_t, std::string>> marks;
  for (const Fault& fault : faults) {
    marks.emplace_back(fault.from_us, "begin " + fault.name);
    const int64_t held_back_us = fault.kind == "delayed" ? to_us(fault.value) : 0;  // still comes
    marks.emplace_back(fault.to_us + held_back_us, "end " + fault.name);
  }
  std::stable_sort(marks.begin(), marks.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::size_t mark = 0;
  const auto tell_until = [&](int64_t at_us) {
    for (; mark < marks.size() && marks[mark].first <= at_us; ++mark) {
      wait_until(marks[mark].first);
      std::cout << marks[mark].second << " " << begin_us + marks[mark].first << std::endl;
    }
  };
  for (Planned& message : messages) {
    tell_until(message.at_us);
    wait_until(message.at_us);
    if (message.stamped) {
      write_int64(message.bytes.data() + kUtime, read_int64(message.bytes.data() + kUtime) + begin_us);
    }
    if (message.ours) write_int64(message.bytes.data() + kRun, begin_us);
    bus.publish(message.channel, message.bytes);
  }
  tell_until(std::numeric_limits<int64_t>::max() - begin_us);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 5 || argc > 6) {
    std::cerr << "fault_player URL LOG SCHEDULE CHANNELS [BEGIN_US]\n";
    return 2;
  }
  try {
    const std::vector<Fault> faults = read_schedule(argv[3]);
    play(argv[1], plan_of(argv[2], faults, argv[4]), faults, argc == 6 ? std::atoll(argv[5]) : 0);
  } catch (const std::exception& e) {
    std::cerr << e.what() << "\n";
    return 2;
  }
  return 0;
}
